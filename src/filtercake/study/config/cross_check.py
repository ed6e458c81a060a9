"""The section ``cross_check``: a few packings made once more by another engine."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from filtercake.packing.engines import kind_of
from filtercake.study.config.packing import AUTO, EngineName
from filtercake.study.config.values import TO_WHOLE, Model


class CrossCheck(Model):
    """Beds, drawn at random, that another engine packs from the same clouds."""

    engine: EngineName = Field(description="The other engine; where it is not installed, nothing is checked, and said.")
    packings: Annotated[int, Field(ge=2, le=1000), TO_WHOLE] = Field(
        default=3, description="Packings made by it, each of another point as far as there are so many."
    )

    @field_validator("engine")
    @classmethod
    def _another(cls, value: str) -> str:
        if value == AUTO:
            raise ValueError("must be named: auto is what the study may be packed by already")
        if kind_of(value).own_spheres:
            raise ValueError(f"{value} has spheres of its own: it cannot pack the same clouds")
        return value
