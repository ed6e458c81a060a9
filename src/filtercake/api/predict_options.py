"""Arguments of the instant estimate, apart from what makes it: a command's options need not wait for that."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from filtercake.api.arguments import PRESSURE
from filtercake.filtration.resistance import CARMAN
from filtercake.packing.scene import FILTRATION_PROTOCOL
from filtercake.results.resistance_columns import ALWAYS
from filtercake.study.config.values import (
    TO_NUMBER,
    Adhesion,
    Cohesion,
    CrystalModulus,
    Density,
    Friction,
    LawName,
    Model,
    Pressure,
    Protocol,
    YoungsModulus,
)


class PredictOptions(Model):
    """Arguments of :func:`predict`, besides the distribution."""

    protocol: Protocol = Field(
        default=FILTRATION_PROTOCOL,
        description="filtration: a cake pressed as in a filter; gravity: spheres that are dropped, as the paper does.",
    )
    pressure_kPa: Pressure | None = Field(  # noqa: N815
        default=None,
        description=f"Pressure drop across the cake, kPa (protocol: filtration); {PRESSURE:g} if left out.",
    )
    friction: Friction = Field(default=0.0, description="Coefficient of friction.")
    adhesion_mJ_m2: Adhesion | None = Field(  # noqa: N815
        default=None,
        description="Work of adhesion of the crystals in the liquid, mJ/m2 (protocol: filtration); none if left out.",
    )
    cohesion_kJ_m3: Cohesion | None = Field(  # noqa: N815
        default=None,
        description="Cohesion energy density, kJ/m3, instead of the adhesion; 50 if left out with protocol: gravity.",
    )
    youngs_modulus_MPa: YoungsModulus = Field(  # noqa: N815
        default=5.0, description="Young's modulus that goes with the cohesion, MPa."
    )
    youngs_modulus_GPa: CrystalModulus = Field(  # noqa: N815
        default=3.0, description="Young's modulus of the real crystals, GPa (protocol: filtration)."
    )
    density_kg_m3: Density | None = Field(
        default=None, description="Crystal density, kg/m3; that of the crystallizer's kinetics if left out."
    )
    sphericity: Annotated[float, Field(ge=0.01, le=1, allow_inf_nan=False), TO_NUMBER] = Field(
        default=1.0, description="Sphericity in the resistance law; packings are of spheres."
    )
    law: LawName = Field(default=CARMAN, description=f"Law of the resistance: {' or '.join(ALWAYS)}.")
    trust_units: bool = Field(default=False, description="Take density and sizes as they are, however unlikely.")
