"""The section ``published``: values to stand beside ours."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from filtercake.study.config.values import (
    LARGEST_INTEGER,
    TO_NUMBER,
    TO_TEXT,
    TO_WHOLE,
    Cohesion,
    Friction,
    Model,
    Name,
)

PublishedValue = Annotated[float, Field(ge=0, le=1e20, allow_inf_nan=False), TO_NUMBER]


class Published(Model):
    """A published value to stand beside ours."""

    csd: Name = Field(description="Name of a distribution from csds.")
    quantity: Literal[
        "porosity",
        "resistance_m_kg",
        "system_dimension_um",
        "smallest_um",
        "largest_um",
        "filter_area_m2",
        "medium_share",
    ] = Field(description="What was published.")
    value: PublishedValue = Field(description="The value, in the unit its name says.")
    source: Annotated[str, Field(max_length=80), TO_TEXT] = Field(description="Where it is from, for the legend.")
    kind: Literal["simulation", "measurement"] = Field(description="Simulated or measured.")
    cohesion_kJ_m3: Cohesion | None = Field(default=None, description="At this cohesion, kJ/m3.")  # noqa: N815
    friction: Friction | None = Field(default=None, description="At this friction.")
    kinetics: Name | None = Field(
        default=None, description="Of the product of these kinetics; not shown beside crystals of others."
    )
    particles: Annotated[int, Field(ge=1, le=LARGEST_INTEGER), TO_WHOLE] | None = Field(
        default=None, description="For this number of spheres (system_dimension_um), if not the study's."
    )
    low: PublishedValue | None = Field(default=None, description="Lower end, where only a range is known.")
    high: PublishedValue | None = Field(default=None, description="Upper end, where only a range is known.")

    @model_validator(mode="after")
    def _range(self) -> Published:
        ends = (self.low, self.high)
        if ends != (None, None) and (None in ends or not float(self.low or 0) <= self.value <= float(self.high or 0)):
            raise ValueError("low and high go together, with the value between them")
        return self
