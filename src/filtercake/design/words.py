"""A design's answers in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from filtercake.design.outcome import Outcome
from filtercake.design.plant import Evaluated, drum_of, moisture_ends
from filtercake.design.search import FLAT, INTERIOR, LOWER, ON_THE_DRUM, UPPER
from filtercake.filtration.drum_filter import Cake, model_warnings
from filtercake.filtration.safety import PAPER_FACTOR
from filtercake.study.config.design import CAKE_MOISTURE, DRUM
from filtercake.units import KILOPASCAL, MINUTE

OBJECTIVES = {
    "installed_cost": "installed cost",
    "purchase_cost": "purchase cost",
    "filter_area": "filter area",
    CAKE_MOISTURE: "cake moisture",
}
"""Objectives in words."""
FILTERS = {"drum": "drum", "leaf": "leaf filter", "plate_and_frame": "plate-and-frame filter"}
SETTINGS = {
    "slurry_concentration": ("slurry concentration", "kg/m3", 1.0),
    "submerged_fraction": ("submerged fraction", "", 1.0),
    "rotation_rate": ("rotation rate", "rpm", 1.0 / MINUTE),
}
"""Settings in words, with their units and what these are in SI."""
COSTS = ("installed_cost", "purchase_cost")
DECIDES = 0.5
"""Share of the filter's resistance from which the medium, and not the cake, decides."""
NEAR = 1e-3
"""Relative distance at which a setting is at a limit."""
NARROW = 0.02
"""Width of an interval, over its value, that takes a fourth digit to be seen."""
THOUSAND, MILLION = 1e3, 1e6


@dataclass(frozen=True)
class Finding:
    """One thing that is to be known of a design: what it is about, and the sentence."""

    kind: str
    text: str


def findings(outcome: Outcome) -> list[Finding]:
    """Say what was found, how sure it is, why it is so, and what is not in it."""
    if not outcome.optimum.possible:
        return [Finding("impossible", _why_impossible(outcome))]
    return [
        Finding("optimum", _optimum(outcome)),
        *(Finding("flat", text) for text in _flat(outcome)),
        Finding("medium", _medium(outcome)),
        *(Finding("settings", text) for text in _settings(outcome)),
        *(Finding("costs", text) for text in _other_costs(outcome)),
        *(Finding("costs", text) for text in _out_of_range(outcome)),
        *(Finding("moisture", text) for text in _moisture(outcome)),
        Finding("safety", _safety(outcome)),
        *(Finding("estimate", text) for text in _outside(outcome)),
        *(Finding("filter", text) for text in _filter_warnings(outcome)),
        Finding("packings", _packings(outcome)),
    ]


def amount(outcome: Outcome, objective: str, value: float) -> str:
    """Write an objective's value with its unit."""
    scale, unit = _unit(outcome, objective, value)
    return f"{value / scale:.3g} {unit}"


def amounts(outcome: Outcome, objective: str, value: float, low: float, high: float) -> str:
    """Write an objective's value with its unit and the ends of its 95 % interval, told apart by their digits."""
    scale, unit = _unit(outcome, objective, value)
    digits = 3 if high - low > NARROW * value else 4
    best, first, last = (f"{part / scale:.{digits}g}" for part in (value, low, high))
    return f"{best} {unit} (95 %: {first} to {last})"


def _unit(outcome: Outcome, objective: str, value: float) -> tuple[float, str]:
    """Return the unit to write an objective in, and its size."""
    currency = outcome.task.design.costs.currency
    if objective in COSTS:
        return (MILLION, f"million {currency}") if value >= MILLION else (THOUSAND, f"thousand {currency}")
    return (1.0, "m2") if objective == "filter_area" else (0.01, "%")


def money(outcome: Outcome, value: float) -> str:
    """Write a sum in thousands or millions."""
    return amount(outcome, COSTS[0], value)


def minutes(seconds: float) -> str:
    """Write a residence time in min, without the unit."""
    return f"{seconds / MINUTE:.3g}"


def _optimum(outcome: Outcome) -> str:
    optimum, name = outcome.optimum, outcome.problem.objective
    value = amounts(outcome, name, optimum.value, optimum.value_low, optimum.value_high)
    interval = f"(95 %: {minutes(optimum.low)} to {minutes(optimum.high)})"
    where = f"at {minutes(optimum.residence_time)} min {interval}"
    ends = {LOWER: "the lower", UPPER: "the upper"}
    if optimum.kind in ends:
        where = f"at {ends[optimum.kind]} bound of the residence time, {minutes(optimum.residence_time)} min"
    sizes = f"a crystallizer of {outcome.best.crystallizer_volume:.3g} m3 and {_filter(outcome)}"
    words = {
        INTERIOR: "interior",
        FLAT: "flat: all of that interval is as good",
        LOWER: f"{_because(outcome)}",
        UPPER: f"{_because(outcome)}",
    }
    standing = words.get(optimum.kind, "not known to the width asked for")
    return f"the least {OBJECTIVES[name]}, {value}, is {where}, {sizes}; {standing}"


def _filter(outcome: Outcome) -> str:
    kind = FILTERS[outcome.optimum.choice.settings.filter_type]
    return f"a {kind} of {outcome.best.filter_area:.3g} m2"


def _because(outcome: Outcome) -> str:
    """Say what goes on beyond a bound: from one end of the range to the other, the parts of the objective."""
    places = (0, len(outcome.task.residence_times) - 1)
    first, last = (outcome.at(place) for place in places)
    name = outcome.problem.objective
    span = " to ".join(minutes(outcome.task.residence_times[place]) for place in places)
    if name not in COSTS:
        values = [amount(outcome, name, outcome.choices[place].value) for place in places]
        return f"because over the range, {span} min, it goes from {values[0]} to {values[1]}"
    part = name.removesuffix("_cost")
    changes = [
        (label, float(getattr(last, f"{item}_{part}") - getattr(first, f"{item}_{part}")))
        for label, item in (("the crystallizer's cost", "crystallizer"), ("the filter's", "filter"))
    ]
    said = " and ".join(
        f"{label} {'rises' if change >= 0.0 else 'falls'} by {money(outcome, abs(change))}" for label, change in changes
    )
    return f"because from {span} min {said}"


def _flat(outcome: Outcome) -> Iterator[str]:
    low, high = outcome.optimum.flat
    tolerance = outcome.problem.tolerance
    if np.isfinite(low) and low < high:
        yield (
            f"from {minutes(low)} to {minutes(high)} min it is within {100.0 * tolerance:g} % of the least, with 95 % "
            "confidence: flat there"
        )


def _medium(outcome: Outcome) -> str:
    """Say whether medium or cake decide the filter's size, at the best design and over the range."""
    times = outcome.task.residence_times
    ends = [(minutes(times[place]), float(outcome.at(place).medium_share)) for place in (0, len(times) - 1)]
    shares = [float(outcome.best.medium_share), *(share for _, share in ends)]
    there = f"{100.0 * shares[0]:.0f} % of the filter's resistance there"
    span = " and ".join(f"{100.0 * share:.0f} % at {time} min" for time, share in ends)
    if sum(shares) / len(shares) > DECIDES:
        return (
            f"the medium (Rm) holds {there} ({span}): the filter is decided by the medium, not the cake, so that "
            "coarser crystals help little"
        )
    return f"the medium (Rm) holds {there} ({span}), the cake the rest"


def _settings(outcome: Outcome) -> Iterator[str]:
    """Say where each varied setting is, and what holds it there."""
    settings, limits = outcome.optimum.choice.settings, outcome.problem.plant.limits
    held = [
        text
        for value, limit, text in (
            (float(outcome.best.cake_thickness), limits.thinnest, "the thinnest cake allowed"),
            (float(outcome.best.cake_thickness), limits.thickest, "the thickest cake allowed"),
            (float(outcome.best.filter_area), limits.largest_area, "the largest filter allowed"),
            (float(outcome.best.medium_share), limits.largest_medium_share, "the medium's largest share allowed"),
        )
        if 0.0 < limit < np.inf and abs(value / limit - 1.0) < NEAR
    ]
    for name, (words, unit, scale) in SETTINGS.items():
        low, high = outcome.problem.ranges[name]
        if low == high or (name in ON_THE_DRUM and settings.filter_type != DRUM):
            continue
        value = float(getattr(settings, name))
        yield f"{words} {value / scale:.3g} {unit}".rstrip() + _held(value, (low, high), held)
    pressures = outcome.problem.pressure_drops
    if pressures.size > 1:
        value = float(settings.pressure_drop)
        text = f"pressure drop {value / KILOPASCAL:.3g} kPa"
        yield text + _held(value, (float(pressures[0]), float(pressures[-1])), held)
    if len(outcome.problem.filter_types) > 1:
        yield f"filter types, each at its best: {_types(outcome)}"


def _types(outcome: Outcome) -> str:
    """Name the filter types asked for with the least objective of each, the best one first."""
    name, found = outcome.problem.objective, list(outcome.by_filter_type())
    return ", ".join(
        f"{FILTERS[kind]} {amount(outcome, name, value) if np.isfinite(value) else 'none that keeps to the limits'}"
        for kind, value in sorted(found, key=lambda item: item[1])
    )


def _held(value: float, ends: tuple[float, float], held: list[str]) -> str:
    for end, word in zip(ends, ("lowest", "highest"), strict=True):
        if abs(value / end - 1.0) < NEAR:
            return f", the {word} asked for"
    return f", at {held[0]}" if held else ""


def _other_costs(outcome: Outcome) -> Iterator[str]:
    if outcome.problem.objective not in COSTS:
        return
    for name, optimum in outcome.by_other_costs():
        if optimum.possible:
            yield (
                f"with the filter costed by {name}, the least is {money(outcome, optimum.value)} at "
                f"{minutes(optimum.residence_time)} min"
            )


def _out_of_range(outcome: Outcome) -> Iterator[str]:
    best, kind = outcome.best, outcome.optimum.choice.settings.filter_type
    plant = outcome.problem.plant
    sizes = (
        ("crystallizer", plant.crystallizer_cost, float(best.crystallizer_volume)),
        ("filter", plant.filter_cost[kind], float(best.filter_area)),
    )
    for what, correlation, size in sizes:
        limits = correlation.si_range
        if limits is not None and not limits[0] <= size <= limits[1] and correlation.si_unit in ("m2", "m3"):
            unit = correlation.si_unit
            yield (
                f"the {what} of {size:.3g} {unit} is outside of what its cost correlation is for, {limits[0]:.3g} to "
                f"{limits[1]:.3g} {unit}: its cost is extrapolated"
            )


def _moisture(outcome: Outcome) -> Iterator[str]:
    """Say how well the moisture is known, where it is asked for."""
    plant, best = outcome.problem.plant, outcome.best
    if plant.suction is not None:
        ends = moisture_ends(plant, outcome.optimum.choice.settings, outcome.cake, best.cake_thickness)
        low, own, high = (f"{100.0 * float(value):.3g}" for value in (ends[0], best.cake_moisture, ends[1]))
        yield f"the cake keeps {own} % of moisture, {low} to {high} % within the correlation's own error"


def _safety(outcome: Outcome) -> str:
    safety = outcome.safety
    sized = outcome.with_resistance(np.array([float(safety.upper), float(safety.paper)]))
    upper, paper = (f"{area:.3g} m2" for area in np.asarray(sized.filter_area).ravel())
    text = f"{safety.words()}; the filter would be {upper} for the interval's end, {paper} for the paper's factor"
    shifted = outcome.by_resistance(PAPER_FACTOR)
    if not shifted.possible:
        return f"{text}, at which no design would keep to the limits"
    return f"{text}, at which the best residence time would be {minutes(shifted.residence_time)} min"


def _outside(outcome: Outcome) -> Iterator[str]:
    said = dict.fromkeys(text for item in outcome.task.estimates for text in item.outside[:1])
    for text in list(said)[:1]:
        yield f"the instant estimate lies outside of what it was trained on, with wider intervals: {text}"


def _filter_warnings(outcome: Outcome) -> Iterator[str]:
    settings, cake = outcome.optimum.choice.settings, outcome.cake
    if settings.filter_type != DRUM:
        return
    plant, place = outcome.problem.plant, outcome.optimum.place
    largest = outcome.task.products[place].largest
    whole = Cake(float(cake.resistance), float(cake.porosity), plant.density, cake.sauter_mean, largest)
    yield from model_warnings(drum_of(plant, settings), whole, plant.liquid_density)


def _packings(outcome: Outcome) -> str:
    made = outcome.made
    failed = f", {made['n_failed']} of them failed" if made["n_failed"] else ""
    where = f"{made['levels']} of {len(outcome.task.levels)} residence times"
    return f"{made['packings']} packings at {where}{failed}; ended: {outcome.ended}"


def _why_impossible(outcome: Outcome) -> str:
    """Name the limits that designs miss, those missed most first."""
    from filtercake.design.search import every_design

    missed: dict[str, int] = {}
    for place in range(len(outcome.task.residence_times)):
        for _, _, item in every_design(outcome.problem, outcome.belief, place):
            for name, where in _misses(item):
                missed[name] = missed.get(name, 0) + where
    names = sorted(missed, key=lambda name: -missed[name])
    return f"no design keeps to the limits: {', '.join(names)}"


def _misses(item: Evaluated) -> Iterator[tuple[str, int]]:
    for name, where in item.misses.items():
        if where.any():
            yield name, int(where.sum())
