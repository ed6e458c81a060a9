"""The best design at what is known of the porosity, and how sure it is.

Of all that is varied, only the residence time needs packings. At each one, and at a few porosities that it may have,
the other settings are found on a grid that closes in on the best of them; between the porosities, the objective is
interpolated. The best residence time of each of many porosity curves that agree with what is known gives its interval.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from filtercake.design.belief import Belief
from filtercake.design.plant import CakeOf, Evaluated, Plant, Settings, evaluate
from filtercake.statistics import CONFIDENCE
from filtercake.study.config.design import DRUM
from filtercake.units import FloatArray, IntArray

DRAWS: Final = 1000
"""Porosity curves drawn."""
SEED: Final = 20
"""Of the drawing: the same curves in every round."""
REACH: Final = np.linspace(-3.0, 3.0, 7)
"""Porosities at which the objective is computed, in standard deviations about the mean."""
GRID: Final = {0: 1, 1: 65, 2: 33, 3: 17, 4: 9}
"""Values of a setting on the grid, by how many settings are varied."""
ZOOM: Final = 9
"""Values of a setting on a finer grid about the best of the coarser one."""
ZOOMS: Final = 3
"""Finer grids, each a quarter as wide as the one before."""
ON_THE_DRUM: Final = ("submerged_fraction", "rotation_rate")
"""Settings that batch filters do not have."""
AXES: Final = ("slurry_concentration", *ON_THE_DRUM)
"""Settings on the grid, in the order of its axes; the first axis is the pressure drop."""
INTERIOR, LOWER, UPPER, FLAT, OPEN = "interior", "lower bound", "upper bound", "flat", "open"
"""What an optimum is: known to the width asked for, at an end of the range, anywhere where it makes no difference, or
not known well enough."""

Span = tuple[float, float]
"""Lowest and highest value."""
Ranges = Mapping[str, Span]
"""Settings that are varied, besides the residence time, or have one value: (value, value)."""
ResistanceOf = Callable[[int, FloatArray], FloatArray]
"""Specific cake resistance (m/kg) of porosities at a place along the residence time."""


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be found.

    Attributes
    ----------
    plant : Plant
        What is the same in every design.
    residence_times : ndarray, shape (m,)
        Residence times, ascending, s.
    sauter_means : ndarray, shape (m,)
        Of the crystals at each, m.
    resistance : callable
        Specific cake resistance of porosities at one of them.
    pressure_drops : ndarray, shape (p,)
        Pressure drops, Pa.
    ranges : mapping of str to (float, float)
        Lowest and highest slurry concentration, submerged fraction and rotation rate, in SI.
    filter_types : sequence of str
        Those to choose from.
    objective : str
        What is made as small as possible.
    target : float
        Half-width of the interval of the residence time, over its value, that is enough.
    tolerance : float
        Relative difference of the objective that is none.
    """

    plant: Plant
    residence_times: FloatArray
    sauter_means: FloatArray
    resistance: ResistanceOf
    pressure_drops: FloatArray
    ranges: Ranges
    filter_types: Sequence[str]
    objective: str
    target: float
    tolerance: float

    def cake(self, place: int, porosity: FloatArray) -> CakeOf:
        """Return the cake at a place along the residence time, of porosities per pressure drop or anything like it."""
        return CakeOf(porosity, self.resistance(place, porosity), float(self.sauter_means[place]))


@dataclass(frozen=True, eq=False)
class Choice:
    """The best settings at a residence time and porosity.

    Attributes
    ----------
    value : float
        Objective; infinite where no settings keep to the limits.
    settings : Settings
        Numbers, no arrays.
    pressure : int
        Number of the pressure drop.
    """

    value: float
    settings: Settings
    pressure: int


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best design, and how well it is known.

    Attributes
    ----------
    kind : str
        Interior, at a bound, flat, or open (not known well enough).
    place : int
        Number of its residence time.
    residence_time, low, high : float
        Residence time, s, and the ends of its 95 % interval.
    value, value_low, value_high : float
        Objective and the ends of its 95 % interval.
    flat : (float, float)
        Residence times, s, between which the objective is within the tolerance of the best one, with 95 % confidence.
    at_bounds : (float, float)
        Shares of the drawn curves whose optimum is at the lower and at the upper end of the range.
    choice : Choice
        Its settings.
    draws : ndarray, shape (d,)
        Logarithm of the best residence time of each drawn curve.
    values : ndarray, shape (d,)
        Objective there.
    curves : ndarray, shape (d, m)
        The curves, in standard deviations about the mean.
    surface : ndarray, shape (d, m)
        Objective of each curve at each residence time.
    """

    kind: str
    place: int
    residence_time: float
    low: float
    high: float
    value: float
    value_low: float
    value_high: float
    flat: Span
    at_bounds: Span
    choice: Choice
    draws: FloatArray
    values: FloatArray
    curves: FloatArray
    surface: FloatArray

    @property
    def settled(self) -> bool:
        """Whether it is known well enough."""
        return self.kind != OPEN

    @property
    def possible(self) -> bool:
        """Whether any design keeps to the limits."""
        return bool(np.isfinite(self.value))


def find(problem: Problem, belief: Belief) -> Optimum:
    """Find the best design, and how well it is known."""
    table = _table(problem, belief)
    curves = belief.draws(DRAWS, SEED)
    surface = np.stack([_between(table[:, place], curves[:, place]) for place in range(table.shape[1])], axis=1)
    middle = table[REACH.size // 2]
    place = int(np.argmin(middle))
    choice = best_at(problem, belief, place, 0.0)
    at = np.log(problem.residence_times)
    kept = np.isfinite(surface).any(axis=1)
    draws = np.array([_lowest(at, row) for row in surface[kept]])
    values = surface[kept].min(axis=1)
    if not (np.isfinite(middle).any() and kept.any()):
        nothing = (float("nan"), float("nan"))
        return Optimum(
            OPEN,
            place,
            *(float("nan"),) * 3,
            *(np.inf,) * 3,
            nothing,
            (0.0, 0.0),
            choice,
            draws,
            values,
            curves,
            surface,
        )
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = _ends(draws, float(at[place]), tail)
    value_low, value_high = _ends(values, float(middle.min()), tail)
    optimum = Optimum(
        kind=OPEN,
        place=place,
        residence_time=float(problem.residence_times[place]),
        low=float(np.exp(low)),
        high=float(np.exp(high)),
        value=float(middle.min()),
        value_low=value_low,
        value_high=value_high,
        flat=_flat(problem, surface[kept], place),
        at_bounds=(float(np.mean(draws <= at[0])), float(np.mean(draws >= at[-1]))),
        choice=choice,
        draws=draws,
        values=values,
        curves=curves[kept],
        surface=surface[kept],
    )
    return replace(optimum, kind=_kind(problem, optimum))


def best_at(problem: Problem, belief: Belief, place: int, deviations: float) -> Choice:
    """Find the best settings at a residence time, its porosity so many standard deviations above the mean."""
    cake = problem.cake(place, belief.at(place, deviations))
    found = [_settings(problem, place, kind, cake) for kind in problem.filter_types]
    return min(found, key=lambda choice: choice.value)


def evaluated(problem: Problem, belief: Belief, place: int, choice: Choice, deviations: float = 0.0) -> Evaluated:
    """Size and cost the settings chosen at a residence time, for another porosity."""
    cake = problem.cake(place, belief.at(place, deviations))
    one = replace(cake, porosity=cake.porosity[choice.pressure], resistance=cake.resistance[choice.pressure])
    return evaluate(problem.plant, choice.settings, one)


def every_design(problem: Problem, belief: Belief, place: int) -> Iterator[tuple[Settings, CakeOf, Evaluated]]:
    """Yield all designs on the grid at a residence time, by filter type."""
    cake = problem.cake(place, belief.at(place))
    for kind in problem.filter_types:
        settings, shaped = _laid_out(problem, place, kind, cake, _axes(problem, kind))
        yield settings, shaped, evaluate(problem.plant, settings, shaped)


def _table(problem: Problem, belief: Belief) -> FloatArray:
    """Objective at each porosity of ``REACH`` and each residence time, shape (r, m)."""
    places = range(problem.residence_times.size)
    return np.array([[best_at(problem, belief, place, float(z)).value for place in places] for z in REACH])


def _between(values: FloatArray, at: FloatArray) -> FloatArray:
    """Interpolate over ``REACH``, to its ends; infinite where a neighbour is."""
    with np.errstate(invalid="ignore"):
        found = np.interp(np.clip(at, REACH[0], REACH[-1]), REACH, values)
    return np.where(np.isnan(found), np.inf, found)


def _lowest(at: FloatArray, values: FloatArray) -> float:
    """Place of the lowest value, by the parabola through it and its neighbours; an end where it is the lowest."""
    k = int(np.argmin(values))
    if k in (0, at.size - 1) or not np.isfinite(values[k - 1 : k + 2]).all():
        return float(at[k])
    before, after = at[k - 1] - at[k], at[k + 1] - at[k]
    rise, fall = (values[k - 1] - values[k]) / before, (values[k + 1] - values[k]) / after
    bend = (fall - rise) / (after - before)
    if bend <= 0.0:
        return float(at[k])
    return float(at[k] + np.clip(-0.5 * (rise - bend * before) / bend, before, after))


def _ends(draws: FloatArray, value: float, tail: float) -> Span:
    """Return the ends of the 95 % interval, which holds the value."""
    low, high = np.quantile(draws, [tail, 1.0 - tail], method="nearest")  # some may be infinite
    return min(float(low), value), max(float(high), value)


def _flat(problem: Problem, surface: FloatArray, place: int) -> Span:
    """Residence times about the best one at which the objective is within the tolerance, in 95 % of the curves."""
    lowest = surface.min(axis=1, keepdims=True)
    alike = np.mean(surface <= lowest * (1.0 + problem.tolerance), axis=0) >= CONFIDENCE
    if not alike[place]:
        return (float("nan"), float("nan"))
    first, last = place, place
    while first > 0 and alike[first - 1]:
        first -= 1
    while last < alike.size - 1 and alike[last + 1]:
        last += 1
    return float(problem.residence_times[first]), float(problem.residence_times[last])


def _kind(problem: Problem, optimum: Optimum) -> str:
    for share, kind in zip(optimum.at_bounds, (LOWER, UPPER), strict=True):
        if share >= CONFIDENCE:
            return kind
    if 0.5 * (optimum.high - optimum.low) <= problem.target * optimum.residence_time:
        return INTERIOR
    if optimum.flat[0] <= optimum.low and optimum.high <= optimum.flat[1]:
        return FLAT
    return OPEN


def _axes(problem: Problem, kind: str) -> dict[str, FloatArray]:
    """Values of each setting on the grid, evenly by ratio."""
    ranges = {name: ends for name, ends in problem.ranges.items() if kind == DRUM or name not in ON_THE_DRUM}
    varied = sum(low < high for low, high in ranges.values()) + (problem.pressure_drops.size > 1)
    axes = {name: np.geomspace(low, high, GRID[varied] if low < high else 1) for name, (low, high) in ranges.items()}
    return {**{name: np.ones(1) for name in ON_THE_DRUM}, **axes}


def _settings(problem: Problem, place: int, kind: str, cake: CakeOf) -> Choice:
    """Find the best settings of a filter type, closing in on them."""
    axes = _axes(problem, kind)
    choice = _best_on(problem, place, kind, cake, axes)
    varied = [name for name, values in axes.items() if values.size > 1]
    if not varied or not np.isfinite(choice.value):
        return choice
    step = {name: float(np.log(axes[name][1] / axes[name][0])) for name in varied}
    for _ in range(ZOOMS):
        for name in varied:
            centre, (low, high) = getattr(choice.settings, name), problem.ranges[name]
            nearby = centre * np.exp(np.linspace(-step[name], step[name], ZOOM))
            axes[name] = np.unique(np.append(np.clip(nearby, low, high), centre))
            step[name] /= (ZOOM - 1) / 2
        finer = _best_on(problem, place, kind, cake, axes)
        choice = finer if finer.value < choice.value else choice
    return choice


def _best_on(problem: Problem, place: int, kind: str, cake: CakeOf, axes: Mapping[str, FloatArray]) -> Choice:
    """Return the best settings on a grid."""
    settings, shaped = _laid_out(problem, place, kind, cake, axes)
    values = evaluate(problem.plant, settings, shaped).objective(problem.objective)
    shape = (problem.pressure_drops.size, *(axes[name].size for name in AXES))
    values = np.broadcast_to(values, shape)
    index = np.unravel_index(int(np.argmin(values)), shape)
    chosen = {name: float(axes[name][k]) for name, k in zip(AXES, index[1:], strict=True)}
    pressure = int(index[0])
    own = Settings(kind, settings.residence_time, pressure_drop=float(problem.pressure_drops[pressure]), **chosen)
    return Choice(float(values[index]), own, pressure)


def _laid_out(
    problem: Problem, place: int, kind: str, cake: CakeOf, axes: Mapping[str, FloatArray]
) -> tuple[Settings, CakeOf]:
    """Lay out settings and cakes of a grid, each along its own axis."""
    count = len(AXES) + 1

    def along(values: FloatArray, axis: int) -> FloatArray:
        return values.reshape([-1 if k == axis else 1 for k in range(count)])

    laid = {name: along(axes[name], axis) for axis, name in enumerate(AXES, 1)}
    settings = Settings(
        filter_type=kind,
        residence_time=float(problem.residence_times[place]),
        pressure_drop=along(problem.pressure_drops, 0),
        **laid,
    )
    porosity, resistance = (along(np.asarray(values), 0) for values in (cake.porosity, cake.resistance))
    return settings, replace(cake, porosity=porosity, resistance=resistance)


def pareto(first: FloatArray, second: FloatArray) -> IntArray:
    """Numbers of the designs that no other one beats in both objectives, by the first; infinite ones are none."""
    order = np.lexsort((second, first))
    order = order[np.isfinite(first[order]) & np.isfinite(second[order])]
    lowest = np.minimum.accumulate(second[order]) if order.size else second[order]
    best = np.ones(order.size, np.bool_)
    best[1:] = second[order][1:] < lowest[:-1]
    return np.asarray(order[best])
