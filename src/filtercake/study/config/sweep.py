"""The section ``sweeps``: the points to visit."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from filtercake.study.config.packing import EngineName
from filtercake.study.config.values import (
    ENTRIES,
    LISTED,
    TO_WHOLE,
    Adhesion,
    Cohesion,
    Friction,
    Model,
    Name,
    PoissonRatio,
    Pressure,
    Protocol,
    ResidenceTime,
    Restitution,
    YoungsModulus,
)

OF_BEDS = ("cohesion_kJ_m3", "friction", "poisson_ratio", "restitution", "youngs_modulus_MPa")
"""What beds that fell have of them."""
OF_FILTRATION = ("adhesion_mJ_m2", "pressure_kPa")
"""What only pressed cakes have of them; nothing in the rows of others."""
SWEPT = (*OF_BEDS, *OF_FILTRATION)
"""Properties a sweep may vary, besides the distribution and the protocol."""


class Sweep(Model):
    """One block of points: every combination of the values given; what is left out keeps its base value."""

    csd: Annotated[list[Name], LISTED, ENTRIES] | None = Field(
        default=None, description="Names of distributions from csds."
    )
    residence_time_min: Annotated[list[ResidenceTime], LISTED, ENTRIES] | None = Field(
        default=None, description="Residence times of the crystallizer, min, instead of csd."
    )
    cohesion_kJ_m3: Annotated[list[Cohesion], LISTED, ENTRIES] | None = Field(  # noqa: N815
        default=None, description="Cohesion energy densities, kJ/m3."
    )
    friction: Annotated[list[Friction], LISTED, ENTRIES] | None = Field(
        default=None, description="Coefficients of friction."
    )
    poisson_ratio: Annotated[list[PoissonRatio], LISTED, ENTRIES] | None = Field(
        default=None, description="Poisson's ratios."
    )
    restitution: Annotated[list[Restitution], LISTED, ENTRIES] | None = Field(
        default=None, description="Coefficients of restitution."
    )
    youngs_modulus_MPa: (  # noqa: N815
        Annotated[list[YoungsModulus], LISTED, ENTRIES] | None
    ) = Field(default=None, description="Young's moduli, MPa.")
    adhesion_mJ_m2: Annotated[list[Adhesion], LISTED, ENTRIES] | None = Field(  # noqa: N815
        default=None, description="Works of adhesion, mJ/m2 (protocol: filtration)."
    )
    pressure_kPa: Annotated[list[Pressure], LISTED, ENTRIES] | None = Field(  # noqa: N815
        default=None, description="Pressure drops across the cake, kPa (protocol: filtration)."
    )
    protocol: Annotated[list[Protocol], LISTED, ENTRIES] | None = Field(
        default=None, description="Protocols of this block, instead of packing.protocol."
    )
    engine: Annotated[list[EngineName], LISTED, ENTRIES] | None = Field(
        default=None,
        description="Engines that pack this block, each its own points, instead of packing.engine; one that is not "
        "installed is left out, and said.",
    )
    replicates: Annotated[int, Field(ge=1, le=1000), TO_WHOLE] | None = Field(
        default=None, description="Packings per point of this block, instead of packing.replicates."
    )

    @model_validator(mode="after")
    def _one_product(self) -> Sweep:
        if (self.csd is None) == (self.residence_time_min is None):
            raise ValueError("needs exactly one of csd and residence_time_min")
        return self
