"""Batch filters and deliquoring: areas, cycles, moistures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from filtercake.api.arguments import MILLIMETRE, ORIGIN, OUT_OF_REACH
from filtercake.errors import ConfigError, FilterError, Problem
from filtercake.filtration.batch_filter import (
    NO_LIMIT,
    BatchCake,
    BatchFilter,
    area_for,
    best_height,
    capacity_of,
    cycle,
    solids_per_filtrate,
)
from filtercake.filtration.deliquoring import (
    TIME_RANGE,
    Liquor,
    WetCake,
    dimensionless_time,
    irreducible_saturation,
    moisture,
    moisture_range,
    saturation,
    threshold_pressure,
    time_to_moisture,
)
from filtercake.study.config.values import TO_NUMBER, Density, Model
from filtercake.study.parsing import parse
from filtercake.units import HOUR, KILOPASCAL, MICROMETRE, MILLIPASCAL_SECOND, MINUTE

MILLINEWTON_PER_METRE = 1e-3

Positive = Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False), TO_NUMBER]
NotNegative = Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False), TO_NUMBER]
ResistanceValue = Annotated[float, Field(gt=0, le=1e20, allow_inf_nan=False), TO_NUMBER]
MediumResistance = Annotated[float, Field(ge=0, le=1e15, allow_inf_nan=False), TO_NUMBER]
Fraction = Annotated[float, Field(ge=0.001, le=0.999, allow_inf_nan=False), TO_NUMBER]
Pressure = Annotated[float, Field(ge=0.001, le=10_000, allow_inf_nan=False), TO_NUMBER]
Viscosity = Annotated[float, Field(ge=0.001, le=1e6, allow_inf_nan=False), TO_NUMBER]
Concentration = Annotated[float, Field(ge=0.001, le=2000, allow_inf_nan=False), TO_NUMBER]
Flow = Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False), TO_NUMBER]


class BatchFilterOptions(Model):
    """Arguments of :func:`batch_filter`."""

    resistance_m_kg: ResistanceValue = Field(description="Specific resistance of the cake, m/kg.")
    porosity: Fraction = Field(description="Porosity of the cake.")
    density_kg_m3: Density = Field(description="Crystal density, kg/m3.")
    slurry_concentration_kg_m3: Concentration = Field(description="Crystals in the slurry, kg/m3 (= g/L).")
    slurry_flow_m3_h: Flow | None = Field(
        default=None, description="Slurry to be filtered, mean over the cycles, m3/h: gives the area it needs."
    )
    filter_area_m2: Flow | None = Field(
        default=None, description="Area of a filter, m2, instead of the flow: gives the flow it can take."
    )
    pressure_drop_kPa: Pressure = Field(description="Pressure drop across cake and medium, kPa.")  # noqa: N815
    medium_resistance_1_m: MediumResistance = Field(description="Resistance of the filter medium, 1/m.")
    viscosity_mPa_s: Viscosity = Field(default=1.0, description="Viscosity of the filtrate, mPa s.")  # noqa: N815
    turnaround_time_min: NotNegative = Field(description="Time to empty, clean, close and fill the filter, min.")
    deliquoring_time_min: NotNegative = Field(default=0.0, description="Time of deliquoring, min.")
    wash_ratio: NotNegative = Field(default=0.0, description="Volume of wash liquor over that of the cake's pores.")
    wash_viscosity_mPa_s: Viscosity | None = Field(  # noqa: N815
        default=None, description="Viscosity of the wash liquor, mPa s; the filtrate's if left out."
    )
    cake_height_mm: Positive | None = Field(
        default=None, description="Height of the cake, mm; the one of most cake per time if left out."
    )
    height_limit_mm: Positive | None = Field(
        default=None, description="Highest cake that there is room for, mm; in a filter press half its chamber's depth."
    )

    @model_validator(mode="after")
    def _one_way(self) -> BatchFilterOptions:
        if (self.slurry_flow_m3_h is None) == (self.filter_area_m2 is None):
            raise ValueError("needs exactly one of slurry_flow_m3_h and filter_area_m2")
        if self.turnaround_time_min + self.deliquoring_time_min == 0.0:
            raise ValueError(
                "turnaround_time_min or deliquoring_time_min must be above 0, or ever thinner cakes are better"
            )
        return self


class DeliquoringOptions(Model):
    """Arguments of :func:`deliquoring`."""

    resistance_m_kg: ResistanceValue = Field(description="Specific resistance of the cake, m/kg.")
    porosity: Fraction = Field(description="Porosity of the cake.")
    density_kg_m3: Density = Field(description="Crystal density, kg/m3.")
    sauter_mean_um: Positive = Field(description="Sauter mean diameter of the crystals, um.")
    cake_height_mm: Positive = Field(description="Height of the cake, mm.")
    pressure_drop_kPa: Pressure = Field(description="Pressure drop of the gas across the cake, kPa.")  # noqa: N815
    viscosity_mPa_s: Viscosity = Field(default=1.0, description="Viscosity of the liquor, mPa s.")  # noqa: N815
    liquid_density_kg_m3: Density = Field(default=1000.0, description="Density of the liquor, kg/m3.")
    surface_tension_mN_m: Positive = Field(default=72.0, description="Surface tension of the liquor, mN/m.")  # noqa: N815
    time_min: NotNegative | None = Field(default=None, description="Time of deliquoring, min: gives the moisture.")
    moisture: Fraction | None = Field(
        default=None, description="Mass of liquor over that of the wet cake, instead of the time: gives the time."
    )

    @model_validator(mode="after")
    def _one_way(self) -> DeliquoringOptions:
        if (self.time_min is None) == (self.moisture is None):
            raise ValueError("needs exactly one of time_min and moisture")
        return self


@dataclass(frozen=True)
class BatchFilterSize:
    """A batch filter and its cycle.

    Attributes
    ----------
    filter_area_m2, slurry_flow_m3_h : float
        Area, m2, and slurry flow, mean over the cycles, m3/h.
    slurry_per_batch_m3 : float
        Slurry of one cycle, m3.
    cake_height_mm, best_height_mm : float
        Height of the cake, and the one of most cake per time within the height limit, mm.
    cake_mass_kg_m2 : float
        Dry cake per area, kg/m2.
    filtration_time_min, wash_time_min, deliquoring_time_min, turnaround_time_min, cycle_time_min : float
        Times, min.
    crystals_kg_m2_h : float
        Crystals per area and hour, kg/(m2 h).
    fits : bool
        Whether the cake is within the height limit.
    """

    filter_area_m2: float
    slurry_flow_m3_h: float
    slurry_per_batch_m3: float
    cake_height_mm: float
    best_height_mm: float
    cake_mass_kg_m2: float
    filtration_time_min: float
    wash_time_min: float
    deliquoring_time_min: float
    turnaround_time_min: float
    cycle_time_min: float
    crystals_kg_m2_h: float
    fits: bool


@dataclass(frozen=True)
class Deliquored:
    """A cake after some time of deliquoring.

    Attributes
    ----------
    time_min : float
        That time, min.
    moisture : float
        Mass of liquor over that of the wet cake.
    moisture_low, moisture_high : float
        The same for a saturation 0.1 lower and higher: the correlation's error.
    saturation, irreducible_saturation : float
        Share of the pores that is full, and the share that no time undercuts.
    lowest_moisture : float
        Moisture at that share.
    threshold_pressure_kPa : float
        Pressure drop up to which no gas enters the pores, kPa.
    in_range : bool
        Whether the time is within the correlation's range.
    """

    time_min: float
    moisture: float
    moisture_low: float
    moisture_high: float
    saturation: float
    irreducible_saturation: float
    lowest_moisture: float
    threshold_pressure_kPa: float  # noqa: N815
    in_range: bool


def batch_filter(**options: Any) -> BatchFilterSize:
    """Area of a batch filter (Nutsche, leaf, press) for a slurry flow, or the flow that an area takes; and its cycle.

    Parameters
    ----------
    **options
        ``resistance_m_kg``, ``porosity``, ``density_kg_m3``, ``slurry_concentration_kg_m3``; exactly one of
        ``slurry_flow_m3_h`` and ``filter_area_m2``; ``pressure_drop_kPa``, ``medium_resistance_1_m``,
        ``viscosity_mPa_s``; ``turnaround_time_min``, ``deliquoring_time_min``, ``wash_ratio``,
        ``wash_viscosity_mPa_s``; ``cake_height_mm``, the best one if left out, and ``height_limit_mm``.

    Raises
    ------
    ConfigError, FilterError
        With every problem.
    """
    given = parse(BatchFilterOptions, options, str(ORIGIN))
    with np.errstate(all="ignore"):
        found = _batch(given)
    numbers = (found.filter_area_m2, found.slurry_flow_m3_h, found.cycle_time_min)
    if not all(math.isfinite(number) and number > 0.0 for number in numbers):
        raise FilterError(OUT_OF_REACH)
    return found


def deliquoring(**options: Any) -> Deliquored:
    """Moisture of a cake after some time of deliquoring, or the time that a moisture takes.

    Parameters
    ----------
    **options
        ``resistance_m_kg``, ``porosity``, ``density_kg_m3``, ``sauter_mean_um``, ``cake_height_mm``;
        ``pressure_drop_kPa``, ``viscosity_mPa_s``, ``liquid_density_kg_m3``, ``surface_tension_mN_m``; exactly one of
        ``time_min`` and ``moisture``.

    Raises
    ------
    ConfigError, FilterError
        With every problem; also where no time suffices for the moisture.
    """
    given = parse(DeliquoringOptions, options, str(ORIGIN))
    cake = WetCake(
        resistance=given.resistance_m_kg,
        porosity=given.porosity,
        density=given.density_kg_m3,
        sauter_mean=given.sauter_mean_um * MICROMETRE,
        height=given.cake_height_mm * MILLIMETRE,
    )
    liquor = Liquor(
        pressure_drop=given.pressure_drop_kPa * KILOPASCAL,
        viscosity=given.viscosity_mPa_s * MILLIPASCAL_SECOND,
        density=given.liquid_density_kg_m3,
        surface_tension=given.surface_tension_mN_m * MILLINEWTON_PER_METRE,
    )
    with np.errstate(all="ignore"):
        return _deliquored(given, cake, liquor)


def _batch(given: BatchFilterOptions) -> BatchFilterSize:
    cake = BatchCake(given.resistance_m_kg, given.porosity, given.density_kg_m3)
    wash, limit = given.wash_viscosity_mPa_s, given.height_limit_mm
    batch = BatchFilter(
        pressure_drop=given.pressure_drop_kPa * KILOPASCAL,
        medium_resistance=given.medium_resistance_1_m,
        viscosity=given.viscosity_mPa_s * MILLIPASCAL_SECOND,
        solids_per_filtrate=solids_per_filtrate(given.slurry_concentration_kg_m3, cake),
        turnaround_time=given.turnaround_time_min * MINUTE,
        deliquoring_time=given.deliquoring_time_min * MINUTE,
        wash_ratio=given.wash_ratio,
        wash_viscosity=None if wash is None else wash * MILLIPASCAL_SECOND,
        height_limit=NO_LIMIT if limit is None else limit * MILLIMETRE,
    )
    best = best_height(batch, cake)
    found = cycle(batch, cake, best if given.cake_height_mm is None else given.cake_height_mm * MILLIMETRE)
    slurry = given.slurry_concentration_kg_m3
    if given.slurry_flow_m3_h is not None:
        flow = given.slurry_flow_m3_h
        area = float(area_for(found, flow / HOUR * slurry))
    else:
        area = given.filter_area_m2 or 0.0  # the model lets one of the two pass
        flow = float(capacity_of(found, area)) / slurry * HOUR
    return BatchFilterSize(
        filter_area_m2=area,
        slurry_flow_m3_h=flow,
        slurry_per_batch_m3=area * float(found.cake_mass) / slurry,
        cake_height_mm=float(found.height) / MILLIMETRE,
        best_height_mm=float(best) / MILLIMETRE,
        cake_mass_kg_m2=float(found.cake_mass),
        filtration_time_min=float(found.filtration_time) / MINUTE,
        wash_time_min=float(found.wash_time) / MINUTE,
        deliquoring_time_min=given.deliquoring_time_min,
        turnaround_time_min=given.turnaround_time_min,
        cycle_time_min=float(found.time) / MINUTE,
        crystals_kg_m2_h=float(found.productivity) * HOUR,
        fits=bool(found.fits),
    )


def _deliquored(given: DeliquoringOptions, cake: WetCake, liquor: Liquor) -> Deliquored:
    threshold = float(threshold_pressure(cake, liquor)) / KILOPASCAL
    if not given.pressure_drop_kPa > threshold:
        allowed = f"must be above {threshold:.4g} kPa, up to which no gas enters the pores"
        raise ConfigError([Problem(str(ORIGIN), "pressure_drop_kPa", f"{given.pressure_drop_kPa:g}", allowed)])
    least = irreducible_saturation(cake, liquor)
    lowest = float(moisture(cake, liquor, least))
    if given.moisture is None:
        seconds = (given.time_min or 0.0) * MINUTE
    else:
        seconds = float(time_to_moisture(cake, liquor, given.moisture))
        if not math.isfinite(seconds):
            allowed = f"must be above {lowest:.4g}, which no time of deliquoring undercuts"
            raise ConfigError([Problem(str(ORIGIN), "moisture", f"{given.moisture:g}", allowed)])
    full = saturation(cake, liquor, seconds)
    low, high = moisture_range(cake, liquor, full)
    scaled = float(dimensionless_time(cake, liquor, seconds))
    return Deliquored(
        time_min=seconds / MINUTE,
        moisture=float(moisture(cake, liquor, full)),
        moisture_low=float(low),
        moisture_high=float(high),
        saturation=float(full),
        irreducible_saturation=float(least),
        lowest_moisture=lowest,
        threshold_pressure_kPa=threshold,
        in_range=TIME_RANGE[0] <= scaled <= TIME_RANGE[1],
    )
