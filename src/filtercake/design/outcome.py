"""A finished design: what was known before and after its packings, the best design, and that by other costs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from filtercake.design.belief import Belief
from filtercake.design.confirm import learnt
from filtercake.design.plant import CakeOf, Evaluated, by_other_cost, evaluate
from filtercake.design.search import Choice, Optimum, Problem, best_at, evaluated, find
from filtercake.design.task import Task
from filtercake.filtration.resistance import law_relative_ci95
from filtercake.filtration.safety import DesignResistance, design_resistance
from filtercake.statistics import quantile
from filtercake.units import FloatArray


@dataclass(frozen=True, eq=False)
class Outcome:
    """A finished design.

    Attributes
    ----------
    task : Task
        What was asked.
    packings : DataFrame
        All packings (:meth:`filtercake.design.task.Task.measured`).
    ended : str
        Why no more were made.
    """

    task: Task
    packings: pd.DataFrame
    ended: str

    @cached_property
    def belief(self) -> Belief:
        """What is known of the porosity, with the packings."""
        return learnt(self.task.prior, self.task.candidates, self.task.found(self.packings))

    @property
    def problem(self) -> Problem:
        """What was to be found."""
        return self.task.problem

    @cached_property
    def optimum(self) -> Optimum:
        """The best design."""
        return find(self.problem, self.belief)

    @cached_property
    def choices(self) -> list[Choice]:
        """Best settings at every residence time of the search."""
        return [best_at(self.problem, self.belief, place, 0.0) for place in range(len(self.task.residence_times))]

    @cached_property
    def best(self) -> Evaluated:
        """Sizes and costs of the best design."""
        return evaluated(self.problem, self.belief, self.optimum.place, self.optimum.choice)

    @cached_property
    def cake(self) -> CakeOf:
        """Cake of the best design: numbers, no arrays."""
        place, pressure = self.optimum.place, self.optimum.choice.pressure
        whole = self.problem.cake(place, self.belief.at(place))
        return replace(whole, porosity=whole.porosity[pressure], resistance=whole.resistance[pressure])

    @cached_property
    def safety(self) -> DesignResistance:
        """Resistances that the filter may be designed for: the interval of packings and law, and the paper's factor."""
        own = float(self.cake.resistance)
        return design_resistance(own, self.half_width, self.law_half_width)

    @property
    def half_width(self) -> float:
        """Half-width of the 95 % interval of the best design's resistance, from what is known of the porosity, m/kg."""
        place, pressure = self.optimum.place, self.optimum.choice.pressure
        low = self.problem.resistance(place, self.belief.at(place, -quantile())[pressure])
        return float(low - self.cake.resistance)

    @property
    def law_half_width(self) -> float:
        """That of the law's own interval, m/kg."""
        csd = self.task.products[self.optimum.place]
        return float(self.cake.resistance) * law_relative_ci95(self.task.study.resistance_law, csd)

    def with_resistance(self, resistance: FloatArray) -> Evaluated:
        """Size and cost the best design's settings for other resistances, m/kg, of the same porosity."""
        place = self.optimum.place
        cake = CakeOf(self.cake.porosity, resistance, float(self.problem.sauter_means[place]))
        return evaluate(self.problem.plant, self.optimum.choice.settings, cake)

    def by_resistance(self, factor: float) -> Optimum:
        """Find the best design if all resistances were so many times as high."""
        own = self.problem.resistance
        scaled = replace(self.problem, resistance=lambda place, porosity: factor * own(place, porosity))
        return find(scaled, self.belief)

    def by_filter_type(self) -> Iterable[tuple[str, float]]:
        """Yield the least objective with each filter type alone."""
        for kind in self.problem.filter_types:
            yield kind, find(replace(self.problem, filter_types=(kind,)), self.belief).value

    def by_other_costs(self) -> Iterable[tuple[str, Optimum]]:
        """Yield the best design by each other correlation of the best design's filter, with its name."""
        kind = self.optimum.choice.settings.filter_type
        for name in self.task.filter_costs(kind)[1:]:
            plant = by_other_cost(self.problem.plant, kind, self.task.correlations[name])
            yield name, find(replace(self.problem, plant=plant), self.belief)

    def at(self, place: int) -> Evaluated:
        """Sizes and costs of the best settings at a residence time."""
        return evaluated(self.problem, self.belief, place, self.choices[place])

    @property
    def made(self) -> dict[str, Any]:
        """Count the packings: all, failed, and the residence times packed."""
        each = self.packings.drop_duplicates(["packings", "replicate"])
        failed = int(np.sum(each["status"] != "ok"))
        return {"packings": len(each), "n_failed": failed, "levels": int(each["level"].nunique())}
