"""The sections ``csds`` and ``crystallizer``: where the crystals come from."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, model_validator

from filtercake.study.config.values import MOST_VALUES, TO_NUMBER, TO_TEXT, Model, Name, PathText, ResidenceTime
from filtercake.units import MICROMETRE

LawSize = Annotated[float, Field(ge=0.01, le=10_000, allow_inf_nan=False), TO_NUMBER]
LAW_TRUNCATION = 0.001
"""Volume share under which a class of a distribution with tails is left out of the packing (paper section 3.1)."""
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


class Lognormal(Model):
    """A lognormal distribution of the volume."""

    d10_um: LawSize = Field(description="Size, um, that 10 % of the volume is smaller than.")
    d50_um: LawSize = Field(description="Size, um, that half of the volume is smaller than; near sqrt(d10 d90).")
    d90_um: LawSize = Field(description="Size, um, that 90 % of the volume is smaller than.")


class RosinRammler(Model):
    """A Rosin-Rammler distribution: exp(-(d/size_um)^exponent) of the volume is larger than d."""

    size_um: LawSize = Field(description="Size, um, that 36.8 % of the volume is larger than.")
    exponent: Annotated[float, Field(ge=0.1, le=100, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Exponent, above 2: with less the sum of x/d^2 has no end towards the fines."
    )


SOURCES = ("mixture", "file", "lognormal", "rosin_rammler", "residence_time_min")
"""Keys that say where a distribution is from; each has exactly one."""


class Csd(Model):
    """A crystal size distribution: a mixture of sizes, a file, a law of few numbers, or the crystallizer's product."""

    label: Annotated[str, Field(max_length=60), TO_TEXT] | None = Field(
        default=None, description="Name in figures and tables; the key if left out."
    )
    mixture: Annotated[list[SizeClass], Field(min_length=1, max_length=MOST_VALUES)] | None = Field(
        default=None, description="Discrete sizes with their volume fractions."
    )
    file: PathText | None = Field(
        default=None,
        description="CSV with the columns size_um,volume_fraction, or as a spreadsheet or an instrument writes it; "
        "path relative to the study file.",
    )
    lognormal: Lognormal | None = Field(default=None, description="Lognormal by volume, from d10_um, d50_um, d90_um.")
    rosin_rammler: RosinRammler | None = Field(
        default=None, description="Rosin-Rammler by volume, from size_um and exponent."
    )
    residence_time_min: ResidenceTime | None = Field(
        default=None, description="Product of the study's crystallizer at this residence time, min."
    )
    truncate_below_volume_fraction: Annotated[float, Field(ge=0, lt=0.5, allow_inf_nan=False), TO_NUMBER] = Field(
        default=0.0,
        description="Classes below this volume share are left out of the packing (not of the resistance); 0.001 for "
        "lognormal and rosin_rammler if left out.",
    )
    truncate_below_um: TruncationSize | None = Field(
        default=None, description="Classes of smaller crystals than this, um, are left out of the packing likewise."
    )
    truncate_above_um: TruncationSize | None = Field(
        default=None, description="Classes of larger crystals than this, um, are left out of the packing likewise."
    )

    @model_validator(mode="before")
    @classmethod
    def _without_tails(cls, values: Any) -> Any:
        of_law = isinstance(values, dict) and (values.get("lognormal") or values.get("rosin_rammler"))
        return {"truncate_below_volume_fraction": LAW_TRUNCATION, **values} if of_law else values

    @model_validator(mode="after")
    def _one_source(self) -> Csd:
        if sum(getattr(self, source) is not None for source in SOURCES) != 1:
            raise ValueError(f"needs exactly one of {', '.join(SOURCES[:-1])} and {SOURCES[-1]}")
        _check_ends(self.truncate_below_um, self.truncate_above_um)
        return self

    @property
    def recipe(self) -> dict[str, list[Any]]:
        """What :func:`filtercake.crystals.size_laws.made` takes: plain values, empty for a file or a crystallizer."""
        if self.lognormal is not None:
            return {"lognormal": list(self.lognormal.model_dump().values())}
        if self.rosin_rammler is not None:
            return {"rosin_rammler": list(self.rosin_rammler.model_dump().values())}
        return {"classes": [[item.size_um, item.volume_fraction] for item in self.mixture or []]}

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
