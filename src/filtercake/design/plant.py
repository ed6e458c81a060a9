"""A crystallizer and the filter behind it: their sizes, costs and cake from formulas, for many settings at once.

Everything is in SI units. The production of crystals is the same in every design: a thicker slurry is less of it, so
that crystallizer and filter become smaller. The crystallizer's volume is its residence time times the slurry's flow. A
drum is sized by eq. 10 on the slurry basis, as the study's own (:mod:`filtercake.filtration.drum_filter`); a leaf or a
plate-and-frame filter by the cake of the most crystals per area and time (:mod:`filtercake.filtration.batch_filter`)
that is neither thinner nor thicker than allowed, without washing. The moisture is that of a drum's cake after suction
over a share of the turn (:mod:`filtercake.filtration.deliquoring`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from filtercake.design.costs import FARTHEST, Correlation
from filtercake.filtration import deliquoring
from filtercake.filtration.batch_filter import BatchCake, BatchFilter, area_for, best_height, cycle, solids_per_filtrate
from filtercake.filtration.drum_filter import DrumFilter, area, cake_thickness, medium_share
from filtercake.filtration.ranges import Values
from filtercake.study.config.design import DRUM
from filtercake.units import FloatArray

Bools = NDArray[np.bool_]

TOO_THIN, TOO_THICK = "cake too thin", "cake too thick"
TOO_LARGE, TOO_MUCH_MEDIUM = "filter too large", "medium's share too large"
NOT_COSTED = "outside of what the cost correlations are for"
ROUNDING: Final = 1e-9
"""Share by which a limit may be missed."""


@dataclass(frozen=True)
class Limits:
    """What a design must keep to, in SI.

    Attributes
    ----------
    thinnest, thickest : float
        Cake thickness, m.
    largest_area : float
        Filter area, m2.
    largest_medium_share : float
        Share of the medium in the filter's resistance.
    """

    thinnest: float = 0.0
    thickest: float = np.inf
    largest_area: float = np.inf
    largest_medium_share: float = 1.0


@dataclass(frozen=True)
class Suction:
    """How a drum's cake is deliquored.

    Attributes
    ----------
    share : float
        Fraction of the turn under suction after the slurry.
    surface_tension : float
        Of the filtrate, N/m.
    """

    share: float
    surface_tension: float


@dataclass(frozen=True)
class Plant:
    """What is the same in every design.

    Attributes
    ----------
    production : float
        Crystals made, kg/s.
    density : float
        Of the crystals, kg/m3.
    viscosity, liquid_density : float
        Of the filtrate, Pa s and kg/m3.
    medium_resistance : float
        Rm, 1/m.
    crystallizer_cost : Correlation
        Cost of the crystallizer.
    filter_cost : mapping of str to Correlation
        Cost of each filter type.
    cost_index, currency_per_usd : float
        CEPCI of the costs, and units of the currency that a US dollar buys.
    limits : Limits
        What a design must keep to.
    turnaround : float
        Time to empty, clean and fill a batch filter, s.
    suction : Suction or None
        How a drum's cake is deliquored, where its moisture is asked for.
    """

    production: float
    density: float
    viscosity: float
    liquid_density: float
    medium_resistance: float
    crystallizer_cost: Correlation
    filter_cost: Mapping[str, Correlation]
    cost_index: float
    currency_per_usd: float = 1.0
    limits: Limits = Limits()
    turnaround: float = 0.0
    suction: Suction | None = None


@dataclass(frozen=True)
class Settings:
    """Settings of a design, in SI; arrays broadcast against each other.

    Attributes
    ----------
    filter_type : str
        Drum, leaf or plate and frame.
    residence_time : float
        Of the crystallizer, s.
    slurry_concentration : float or ndarray
        Crystals in the slurry, kg/m3.
    pressure_drop : float or ndarray
        Across cake and medium, Pa.
    submerged_fraction, rotation_rate : float or ndarray
        Of a drum: fraction immersed, and turns per time, 1/s.
    """

    filter_type: str
    residence_time: float
    slurry_concentration: Values
    pressure_drop: Values
    submerged_fraction: Values
    rotation_rate: Values


@dataclass(frozen=True, eq=False)
class CakeOf:
    """The cake of a residence time.

    Attributes
    ----------
    porosity : ndarray
        Its porosity.
    resistance : ndarray
        Its specific resistance, m/kg.
    sauter_mean : float
        Of the crystals, m.
    """

    porosity: FloatArray
    resistance: FloatArray
    sauter_mean: float


@dataclass(frozen=True, eq=False)
class Evaluated:
    """What designs are and cost.

    Attributes
    ----------
    crystallizer_volume, filter_area : ndarray
        Sizes, m3 and m2.
    cake_thickness : ndarray
        Of the cake that leaves the filter, m.
    medium_share : ndarray
        Share of the medium in the filter's resistance.
    cake_moisture : ndarray
        Liquor over the wet cake's mass; nan where it is not asked for.
    crystallizer_purchase, crystallizer_installed, filter_purchase, filter_installed : ndarray
        Costs, in the currency asked for.
    in_range : ndarray of bool
        Whether both sizes are in the ranges of their cost correlations.
    misses : dict of str to ndarray of bool
        Where a limit is missed, by the limit in words.
    """

    crystallizer_volume: FloatArray
    filter_area: FloatArray
    cake_thickness: FloatArray
    medium_share: FloatArray
    cake_moisture: FloatArray
    crystallizer_purchase: FloatArray
    crystallizer_installed: FloatArray
    filter_purchase: FloatArray
    filter_installed: FloatArray
    in_range: Bools
    misses: dict[str, Bools]

    @property
    def feasible(self) -> Bools:
        """Where no limit is missed."""
        return np.asarray(~np.any(list(self.misses.values()), axis=0))

    def objective(self, name: str) -> FloatArray:
        """Return an objective, infinite where a limit is missed."""
        if name == "installed_cost":
            value = self.crystallizer_installed + self.filter_installed
        elif name == "purchase_cost":
            value = self.crystallizer_purchase + self.filter_purchase
        else:
            value = getattr(self, name)
        return np.where(self.feasible, value, np.inf)


def evaluate(plant: Plant, settings: Settings, cake: CakeOf) -> Evaluated:
    """Size and cost designs.

    Raises
    ------
    FilterError
        If a setting leaves what the filters' equations are for.
    """
    flow = plant.production / np.asarray(settings.slurry_concentration, dtype=np.float64)
    volume = np.asarray(flow * settings.residence_time)
    if settings.filter_type == DRUM:
        size, thick, share, moisture = _drum(plant, settings, cake, flow)
    else:
        size, thick, share, moisture = _batch(plant, settings, cake)
    vessel, cloth = plant.crystallizer_cost, plant.filter_cost[settings.filter_type]
    of_vessel = plant.production if vessel.si_unit == "kg/s" else volume
    limits = plant.limits
    bought = [_purchase(plant, kind, np.asarray(of)) for kind, of in ((vessel, of_vessel), (cloth, size))]
    columns = {
        "crystallizer_volume": volume,
        "filter_area": size,
        "cake_thickness": thick,
        "medium_share": share,
        "cake_moisture": moisture,
        "crystallizer_purchase": bought[0],
        "crystallizer_installed": bought[0] * vessel.installed_factor,
        "filter_purchase": bought[1],
        "filter_installed": bought[1] * cloth.installed_factor,
    }
    shape = np.broadcast_shapes(*(values.shape for values in columns.values()))
    marks = [_in_range(vessel, np.asarray(of_vessel)), _in_range(cloth, size)]
    misses = {
        TOO_THIN: thick < limits.thinnest * (1.0 - ROUNDING),
        TOO_THICK: thick > limits.thickest * (1.0 + ROUNDING),
        TOO_LARGE: size > limits.largest_area * (1.0 + ROUNDING),
        TOO_MUCH_MEDIUM: share > limits.largest_medium_share * (1.0 + ROUNDING),
        NOT_COSTED: _no_sense(vessel, np.asarray(of_vessel)) | _no_sense(cloth, size),
    }
    return Evaluated(
        **{name: np.broadcast_to(values, shape) for name, values in columns.items()},
        in_range=np.broadcast_to(marks[0] & marks[1], shape),
        misses={name: np.broadcast_to(missed, shape) for name, missed in misses.items()},
    )


def cake_mass_to_resistance(plant: Plant, cake: CakeOf, mass: FloatArray) -> FloatArray:
    """Share of the medium in the resistance of a filter with so much cake per area (kg/m2), its mean while it grows."""
    medium = plant.medium_resistance
    return np.asarray(medium / (medium + 0.5 * cake.resistance * mass))


def _drum(
    plant: Plant, settings: Settings, cake: CakeOf, flow: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Area, cake thickness, share of the medium and moisture of drums."""
    drum = drum_of(plant, settings)
    thick = cake_thickness(drum, cake.resistance, cake.porosity, plant.density)
    return (
        area(drum, cake.resistance, flow),
        thick,
        medium_share(drum, cake.resistance),
        _moisture(plant, settings, cake, thick),
    )


def drum_of(plant: Plant, settings: Settings) -> DrumFilter:
    """Return the drums of some settings, on the slurry basis."""
    return DrumFilter(
        pressure_drop=settings.pressure_drop,
        submerged_fraction=settings.submerged_fraction,
        rotation_rate=settings.rotation_rate,
        medium_resistance=plant.medium_resistance,
        viscosity=plant.viscosity,
        slurry_concentration=settings.slurry_concentration,
    )


def _moisture(plant: Plant, settings: Settings, cake: CakeOf, thick: FloatArray) -> FloatArray:
    if plant.suction is None:
        return np.full(thick.shape, np.nan)
    wet, liquor, left = _drained(plant, plant.suction, settings, cake, thick)
    return deliquoring.moisture(wet, liquor, left)


def moisture_ends(plant: Plant, settings: Settings, cake: CakeOf, thick: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the moistures of a drum's cakes at both ends of the correlation's error; nan where none is asked for."""
    if plant.suction is None:
        return np.full(thick.shape, np.nan), np.full(thick.shape, np.nan)
    return deliquoring.moisture_range(*_drained(plant, plant.suction, settings, cake, thick))


def _drained(
    plant: Plant, suction: Suction, settings: Settings, cake: CakeOf, thick: FloatArray
) -> tuple[deliquoring.WetCake, deliquoring.Liquor, FloatArray]:
    """Cake, liquor, and how full the pores are after the suction."""
    wet = deliquoring.WetCake(cake.resistance, cake.porosity, plant.density, cake.sauter_mean, thick)
    liquor = deliquoring.Liquor(settings.pressure_drop, plant.viscosity, plant.liquid_density, suction.surface_tension)
    return wet, liquor, deliquoring.saturation(wet, liquor, suction.share / np.asarray(settings.rotation_rate))


def _batch(plant: Plant, settings: Settings, cake: CakeOf) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Area, cake thickness and share of the medium of batch filters; their cakes' moisture is not known."""
    made = BatchCake(cake.resistance, cake.porosity, plant.density)
    batch = BatchFilter(
        pressure_drop=settings.pressure_drop,
        medium_resistance=plant.medium_resistance,
        viscosity=plant.viscosity,
        solids_per_filtrate=solids_per_filtrate(settings.slurry_concentration, made),
        turnaround_time=plant.turnaround,
        height_limit=plant.limits.thickest,
    )
    # the productivity rises up to the best height and falls beyond: the nearest allowed one is best
    found = cycle(batch, made, np.maximum(best_height(batch, made), plant.limits.thinnest))
    share = cake_mass_to_resistance(plant, cake, found.cake_mass)
    return area_for(found, plant.production), found.height, share, np.full(found.height.shape, np.nan)


def _purchase(plant: Plant, correlation: Correlation, size: FloatArray) -> FloatArray:
    return np.asarray(correlation.purchase(size) * plant.cost_index / correlation.cost_index * plant.currency_per_usd)


def _in_range(correlation: Correlation, size: FloatArray) -> Bools:
    limits = correlation.si_range
    return np.ones(size.shape, np.bool_) if limits is None else (size >= limits[0]) & (size <= limits[1])


def _no_sense(correlation: Correlation, size: FloatArray) -> Bools:
    """Where a cost is refused: far outside of the range, or where a larger piece would cost less."""
    limits = correlation.si_range
    falls = np.asarray(correlation.exponent(size) <= 0.0)
    if limits is None:
        return falls
    return np.asarray(falls | (size < limits[0] / FARTHEST) | (size > limits[1] * FARTHEST))


def by_other_cost(plant: Plant, filter_type: str, correlation: Correlation) -> Plant:
    """Return the same plant with a filter type costed by another correlation."""
    return replace(plant, filter_cost={**plant.filter_cost, filter_type: correlation})
