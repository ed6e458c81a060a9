"""The section ``design``: what a designer may choose, what is wanted of it, and how well it must be known."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from filtercake.study.config.values import (
    LISTED,
    TO_NUMBER,
    TO_TEXT,
    TO_WHOLE,
    Model,
    Name,
    PathText,
    Pressure,
    ResidenceTime,
)

DRUM, LEAF, PLATE_AND_FRAME = "drum", "leaf", "plate_and_frame"
BATCH_TYPES = (LEAF, PLATE_AND_FRAME)
"""Filter types that work in cycles."""
CAKE_MOISTURE = "cake_moisture"

FilterType = Literal["drum", "leaf", "plate_and_frame"]
Objective = Literal["installed_cost", "purchase_cost", "filter_area", "cake_moisture"]


def _ascending(ends: Any) -> Any:
    if not ends[0] < ends[1]:
        raise ValueError("must be the lowest, then the highest value")
    return ends


_TWO = Field(min_length=2, max_length=2)
_ASCENDING = AfterValidator(_ascending)
Concentration = Annotated[float, Field(ge=0.001, le=2000, allow_inf_nan=False), TO_NUMBER]
Rate = Annotated[float, Field(ge=1e-6, le=100, allow_inf_nan=False), TO_NUMBER]
Share = Annotated[float, Field(ge=0.001, lt=1, allow_inf_nan=False), TO_NUMBER]
Thickness = Annotated[float, Field(ge=0.01, le=10_000, allow_inf_nan=False), TO_NUMBER]
PositiveNumber = Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False), TO_NUMBER]


class Variables(Model):
    """What is varied, each from a lowest to a highest value; what is left out keeps the study's value."""

    residence_time_min: Annotated[list[ResidenceTime], _TWO, _ASCENDING] = Field(
        description="Residence time of the crystallizer, min."
    )
    slurry_concentration_kg_m3: Annotated[list[Concentration], _TWO, _ASCENDING] | None = Field(
        default=None, description="Crystals in the slurry, kg/m3, at the production that the crystallizer section has."
    )
    pressure_drop_kPa: Annotated[list[Pressure], _TWO, _ASCENDING] | None = Field(  # noqa: N815
        default=None, description="Pressure drop across cake and medium, kPa."
    )
    submerged_fraction: Annotated[list[Share], _TWO, _ASCENDING] | None = Field(
        default=None, description="Fraction of the drum that is immersed (form share)."
    )
    rotation_rate_rpm: Annotated[list[Rate], _TWO, _ASCENDING] | None = Field(
        default=None, description="Rotation rate of the drum, 1/min."
    )
    filter_type: Annotated[list[FilterType], LISTED, Field(min_length=1, max_length=3)] = Field(
        default=["drum"], description="Filter types to choose from."
    )


class Constraints(Model):
    """What a design must keep to; what is left out is free."""

    cake_thickness_mm: Annotated[list[Thickness], _TWO, _ASCENDING] | None = Field(
        default=None, description="Thinnest and thickest cake, mm."
    )
    largest_filter_area_m2: PositiveNumber | None = Field(
        default=None, description="Filter area that must have the capacity for the slurry, m2."
    )
    largest_medium_share: Share | None = Field(
        default=None, description="Largest share of the medium in the filter's resistance."
    )


class Costs(Model):
    """By what the equipment is costed."""

    cost_index: Annotated[float, Field(ge=1, le=100_000, allow_inf_nan=False), TO_NUMBER] = Field(
        default=798.0,
        description="Chemical Engineering Plant Cost Index (CEPCI) of the costs: 397 in 2001, 798 in 2023.",
    )
    currency: Annotated[str, Field(min_length=1, max_length=10), TO_TEXT] = Field(
        default="USD", description="Name of the currency."
    )
    currency_per_usd: PositiveNumber = Field(default=1.0, description="Units of it that a US dollar buys.")
    crystallizer: Name = Field(
        default="batch_evaporative_crystallizer_turton", description="Cost correlation of the crystallizer."
    )
    filter: Name | None = Field(
        default=None, description="Cost correlation of the filter; the first one of each filter type if left out."
    )
    file: PathText | None = Field(
        default=None, description="YAML with cost correlations of your own; path relative to the study file."
    )


class Design(Model):
    """A choice of crystallizer and filter, made on estimates that packings confirm where it depends on them."""

    variables: Variables = Field(description="What is varied, and how far.")
    objective: Objective = Field(
        default="installed_cost",
        description="What is made as small as possible: cost of crystallizer and filter in place or bought, filter "
        "area, or moisture of the cake.",
    )
    trade_off: Objective | None = Field(
        default=None, description="A second objective: the designs that are best in neither alone (Pareto) are shown."
    )
    constraints: Constraints = Field(default=Constraints(), description="What a design must keep to.")
    costs: Costs = Field(default=Costs(), description="By what the equipment is costed.")
    turnaround_min: PositiveNumber | None = Field(
        default=None, description="Time to empty, clean and fill a leaf or plate-and-frame filter, min."
    )
    deliquoring_share: Share | None = Field(
        default=None, description="Fraction of the drum under suction after the slurry, for the cake's moisture."
    )
    surface_tension_mN_m: PositiveNumber | None = Field(  # noqa: N815
        default=None, description="Surface tension of the filtrate, mN/m (72 for water), for the cake's moisture."
    )
    levels: Annotated[int, Field(ge=3, le=41), TO_WHOLE] = Field(
        default=13, description="Residence times that may be packed, from the lowest to the highest, evenly by ratio."
    )
    packings: Annotated[int, Field(ge=1, le=100_000), TO_WHOLE] = Field(
        default=60, description="Packings after which the search ends, and says how well the optimum is known."
    )
    relative_ci95_target: Annotated[float, Field(ge=1e-4, lt=10, allow_inf_nan=False), TO_NUMBER] = Field(
        default=0.1,
        description="Half-width of the 95 % interval of the optimum's residence time, over its value, that ends it.",
    )
    objective_tolerance: Annotated[float, Field(ge=1e-6, lt=1, allow_inf_nan=False), TO_NUMBER] = Field(
        default=0.02,
        description="Relative difference of the objective that is no difference: it makes an optimum flat.",
    )

    @model_validator(mode="after")
    def _enough_said(self) -> Design:
        types = self.variables.filter_type
        if len(set(types)) != len(types):
            raise ValueError("variables.filter_type names a type twice")
        if any(kind in BATCH_TYPES for kind in types) and self.turnaround_min is None:
            raise ValueError(f"turnaround_min must be given for the filter types {' and '.join(BATCH_TYPES)}")
        if CAKE_MOISTURE in self.objectives:
            if types != [DRUM]:
                raise ValueError("cake_moisture is that of a drum: variables.filter_type must be [drum]")
            if self.deliquoring_share is None or self.surface_tension_mN_m is None:
                raise ValueError("cake_moisture needs deliquoring_share and surface_tension_mN_m")
        if self.trade_off == self.objective:
            raise ValueError("trade_off must be another objective")
        return self

    @property
    def objectives(self) -> tuple[str, ...]:
        """One objective or two."""
        return (self.objective,) if self.trade_off is None else (self.objective, self.trade_off)
