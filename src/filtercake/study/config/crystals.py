"""The sections ``csds`` and ``crystallizer``: where the crystals come from."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from filtercake.study.config.values import MOST_VALUES, TO_NUMBER, TO_TEXT, Model, Name, PathText, ResidenceTime
from filtercake.units import MICROMETRE

TruncationSize = Annotated[float, Field(ge=0.001, le=100_000, allow_inf_nan=False), TO_NUMBER]


def _check_ends(below: float | None, above: float | None) -> None:
    if below is not None and above is not None and not below < above:
        raise ValueError("truncate_below_um must be below truncate_above_um")


class SizeClass(Model):
    """One size of a mixture."""

    size_um: Annotated[
        float, Field(ge=0.001, le=100_000, description="Crystal diameter, um.", allow_inf_nan=False), TO_NUMBER
    ]
    volume_fraction: Annotated[
        float,
        Field(ge=1e-12, le=1, description="Its share of the crystal volume (= mass).", allow_inf_nan=False),
        TO_NUMBER,
    ]


class Csd(Model):
    """A crystal size distribution: a mixture of discrete sizes, a CSV file, or the crystallizer's product."""

    label: Annotated[str, Field(max_length=60), TO_TEXT] | None = Field(
        default=None, description="Name in figures and tables; the key if left out."
    )
    mixture: Annotated[list[SizeClass], Field(min_length=1, max_length=MOST_VALUES)] | None = Field(
        default=None, description="Discrete sizes with their volume fractions."
    )
    file: PathText | None = Field(
        default=None,
        description="CSV with the columns size_um,volume_fraction; path relative to the study file.",
    )
    residence_time_min: ResidenceTime | None = Field(
        default=None, description="Product of the study's crystallizer at this residence time, min."
    )
    truncate_below_volume_fraction: Annotated[float, Field(ge=0, lt=0.5, allow_inf_nan=False), TO_NUMBER] = Field(
        default=0.0,
        description="Classes below this volume share are left out of the packing (not of the resistance).",
    )
    truncate_below_um: TruncationSize | None = Field(
        default=None, description="Classes of smaller crystals than this, um, are left out of the packing likewise."
    )
    truncate_above_um: TruncationSize | None = Field(
        default=None, description="Classes of larger crystals than this, um, are left out of the packing likewise."
    )

    @model_validator(mode="after")
    def _one_source(self) -> Csd:
        if [self.mixture, self.file, self.residence_time_min].count(None) != 2:
            raise ValueError("needs exactly one of mixture, file and residence_time_min")
        _check_ends(self.truncate_below_um, self.truncate_above_um)
        return self

    @property
    def truncation(self) -> dict[str, float]:
        """Keywords of :func:`filtercake.crystals.csd.truncate`: what is left out of the packing, empty for nothing."""
        found = {"smallest_share": self.truncate_below_volume_fraction}
        for name, size in (("smallest", self.truncate_below_um), ("largest", self.truncate_above_um)):
            found[name] = (size or 0.0) * MICROMETRE
        return {name: value for name, value in found.items() if value > 0.0}


class Crystallizer(Model):
    """A mixed-suspension, mixed-product-removal crystallizer, whose residence time a sweep may vary."""

    kinetics: Name = Field(description="Crystallization kinetics: a preset, or a name in kinetics_file.")
    kinetics_file: PathText | None = Field(
        default=None, description="YAML with kinetics of your own; path relative to the study file."
    )
    slurry_concentration_kg_m3: Annotated[float, Field(ge=0.001, le=2000, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Crystals in the slurry, kg/m3 (= g/L)."
    )
    slurry_flow_m3_h: Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False), TO_NUMBER] = Field(
        default=20.0, description="Slurry that leaves the crystallizer, m3/h; times the residence time, its volume."
    )
    bin_width_um: Annotated[float, Field(ge=0.001, le=1000, allow_inf_nan=False), TO_NUMBER] = Field(
        default=5.0, description="Width of the size classes, um (rounded to a whole number of classes)."
    )
    truncate_below_volume_fraction: Annotated[float, Field(ge=0, lt=0.5, allow_inf_nan=False), TO_NUMBER] = Field(
        default=0.001, description="Classes below this volume share are left out of the packing, not of the resistance."
    )
    truncate_below_um: TruncationSize | None = Field(
        default=None, description="Classes of smaller crystals than this, um, are left out of the packing likewise."
    )
    truncate_above_um: TruncationSize | None = Field(
        default=None, description="Classes of larger crystals than this, um, are left out of the packing likewise."
    )

    @model_validator(mode="after")
    def _ends(self) -> Crystallizer:
        _check_ends(self.truncate_below_um, self.truncate_above_um)
        return self
