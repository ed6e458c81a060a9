"""The rotary drum filter that a cake needs, as a function."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from filtercake.api.arguments import MILLIMETRE, ORIGIN, OUT_OF_REACH
from filtercake.errors import FilterError
from filtercake.filtration.drum_filter import (
    area,
    cake_mass_per_area,
    cake_thickness,
    capacity,
    forming_warning,
    medium_share,
    on_filtrate_basis,
)
from filtercake.filtration.safety import design_resistance
from filtercake.study.config.filter import Filter, drum_filter
from filtercake.study.config.values import TO_NUMBER, Density
from filtercake.study.parsing import parse
from filtercake.units import HOUR


@dataclass(frozen=True)
class FilterSize:
    """A rotary drum filter and the slurry it takes.

    Attributes
    ----------
    filter_area_m2, slurry_flow_m3_h : float
        Area, m2, and slurry flow, m3/h.
    medium_share : float
        Share of the medium in the overall resistance.
    cake_mass_kg_m2 : float
        Crystals on the drum per area and revolution, kg/m2.
    cake_thickness_mm : float or None
        Thickness of the cake, mm, where porosity and crystal density are given.
    filter_area_upper_m2, filter_area_paper_factor_m2 : float or None
        Areas at the upper end of the resistance's 95 % interval and at twice the resistance, the paper's safety factor,
        m2; None where the interval is not given.
    safety : str
        Which of the two asks for more, in words; empty where the interval is not given.
    warnings : tuple of str
        What speaks against a continuous filter, where porosity and crystal density are given.
    """

    filter_area_m2: float
    slurry_flow_m3_h: float
    medium_share: float
    cake_mass_kg_m2: float
    cake_thickness_mm: float | None
    filter_area_upper_m2: float | None = None
    filter_area_paper_factor_m2: float | None = None
    safety: str = ""
    warnings: tuple[str, ...] = ()


class FilterOptions(Filter):
    """Arguments of :func:`filter_area`."""

    resistance_m_kg: Annotated[float, Field(ge=0, le=1e20, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Specific resistance of the cake, m/kg."
    )
    slurry_concentration_kg_m3: Annotated[float, Field(ge=0.001, le=2000, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Crystals in the slurry, kg/m3 (= g/L)."
    )
    slurry_flow_m3_h: Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None, description="Slurry to be filtered, m3/h: gives the area it needs."
    )
    filter_area_m2: Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None, description="Area of a filter, m2, instead of the flow: gives the flow it can take."
    )
    porosity: Annotated[float, Field(ge=0.001, le=0.999, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None, description="Porosity of the cake, for its thickness; goes with density_kg_m3."
    )
    density_kg_m3: Density | None = Field(
        default=None, description="Crystal density, kg/m3, for the cake's thickness; goes with porosity."
    )
    filtrate_basis: bool = Field(
        default=False,
        description="Count as filtrate what passes the cake, and not all of the slurry as the paper does; goes with "
        "porosity and density_kg_m3.",
    )
    resistance_ci95_m_kg: Annotated[float, Field(ge=0, le=1e20, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None,
        description="Half-width of the resistance's 95 % interval, m/kg, for the areas with safety; goes with "
        "slurry_flow_m3_h.",
    )

    @model_validator(mode="after")
    def _one_way(self) -> FilterOptions:
        if (self.slurry_flow_m3_h is None) == (self.filter_area_m2 is None):
            raise ValueError("needs exactly one of slurry_flow_m3_h and filter_area_m2")
        if (self.porosity is None) != (self.density_kg_m3 is None):
            raise ValueError("porosity and density_kg_m3 go together")
        if self.filtrate_basis and self.porosity is None:
            raise ValueError("filtrate_basis needs porosity and density_kg_m3")
        if self.resistance_ci95_m_kg is not None and self.slurry_flow_m3_h is None:
            raise ValueError("resistance_ci95_m_kg goes with slurry_flow_m3_h")
        return self


def filter_area(**options: Any) -> FilterSize:
    """Area of a rotary drum filter for a slurry flow, or the flow that an area can take (paper, eq. 10).

    Parameters
    ----------
    **options
        The keys of the configuration's ``filter`` block; ``resistance_m_kg``, ``slurry_concentration_kg_m3``; exactly
        one of ``slurry_flow_m3_h`` and ``filter_area_m2``; ``porosity`` and ``density_kg_m3`` for the cake's thickness,
        and with them ``filtrate_basis``; ``resistance_ci95_m_kg`` for the areas with safety.

    Raises
    ------
    ConfigError, FilterError
        With every problem.
    """
    given = parse(FilterOptions, options, str(ORIGIN))
    try:
        with np.errstate(all="ignore"):
            found = _size(given)
    except (ZeroDivisionError, OverflowError):
        raise FilterError(OUT_OF_REACH) from None
    if not (math.isfinite(found.filter_area_m2) and math.isfinite(found.slurry_flow_m3_h)):
        raise FilterError(OUT_OF_REACH)
    return found


def _size(given: FilterOptions) -> FilterSize:
    drum, alpha = drum_filter(given, given.slurry_concentration_kg_m3), given.resistance_m_kg
    thickness, warning = None, None
    if given.porosity is not None and given.density_kg_m3 is not None:
        if given.filtrate_basis:
            drum = on_filtrate_basis(drum, given.porosity, given.density_kg_m3)
        thickness = float(cake_thickness(drum, alpha, given.porosity, given.density_kg_m3)) / MILLIMETRE
        warning = forming_warning(drum, alpha, given.porosity, given.density_kg_m3)
    if given.slurry_flow_m3_h is not None:
        flow = given.slurry_flow_m3_h
        needed = float(area(drum, alpha, flow / HOUR))
    else:
        needed = given.filter_area_m2 or 0.0  # the model lets one of the two pass
        flow = float(capacity(drum, alpha, needed)) * HOUR
    found = FilterSize(
        filter_area_m2=needed,
        slurry_flow_m3_h=flow,
        medium_share=float(medium_share(drum, alpha)),
        cake_mass_kg_m2=float(cake_mass_per_area(drum, alpha)),
        cake_thickness_mm=thickness,
        warnings=() if warning is None else (warning,),
    )
    if given.resistance_ci95_m_kg is None:
        return found
    asked = design_resistance(alpha, given.resistance_ci95_m_kg)
    upper, paper = (float(area(drum, resistance, flow / HOUR)) for resistance in (asked.upper, asked.paper))
    return replace(found, filter_area_upper_m2=upper, filter_area_paper_factor_m2=paper, safety=asked.words())
