"""The section ``material``: the crystals."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from filtercake.study.config.values import (
    TO_NUMBER,
    Adhesion,
    Cohesion,
    CrystalModulus,
    Density,
    Friction,
    Model,
    PoissonRatio,
    Restitution,
    YoungsModulus,
)


class Material(Model):
    """The crystals, and the base value of every property a sweep may vary."""

    density_kg_m3: Density | None = Field(
        default=None, description="Crystal density, kg/m3; that of the crystallizer's kinetics if left out."
    )
    youngs_modulus_MPa: YoungsModulus = Field(  # noqa: N815
        default=5.0, description="Young's modulus of the simulated crystals, MPa."
    )
    poisson_ratio: PoissonRatio = Field(default=0.2, description="Poisson's ratio.")
    restitution: Restitution = Field(default=0.3, description="Coefficient of restitution.")
    friction: Friction = Field(default=0.0, description="Coefficient of friction.")
    cohesion_kJ_m3: Cohesion = Field(default=50.0, description="Cohesion energy density, kJ/m3.")  # noqa: N815
    adhesion_mJ_m2: Adhesion | None = Field(  # noqa: N815
        default=None,
        description="Work of adhesion of the crystals in the liquid, mJ/m2, instead of the cohesion: 0 without "
        "attraction, about 0.1 to 1 rough, 10 smooth. Needs protocol: filtration.",
    )
    youngs_modulus_GPa: CrystalModulus = Field(  # noqa: N815
        default=3.0,
        description="Young's modulus of the real crystals, GPa (protocol: filtration); softer ones are simulated.",
    )
    sphericity: Annotated[float, Field(ge=0.01, le=1, allow_inf_nan=False), TO_NUMBER] = Field(
        default=1.0, description="Sphericity in the resistance law; packings are of spheres."
    )
    trust_units: bool = Field(
        default=False, description="Take density, sizes and measured resistances as they are, however unlikely."
    )

    @property
    def density(self) -> float:
        """Crystal density, kg/m3, of a study that has been loaded."""
        if self.density_kg_m3 is None:
            raise ValueError("the study gives no crystal density and was not loaded")
        return self.density_kg_m3
