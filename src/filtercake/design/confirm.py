"""Which packings a design needs, and when it needs no more.

The first ones are where the estimate has its optimum: no answer stands on the estimate alone. Further ones are where
they are expected to narrow the optimum's interval most: of the porosity curves drawn, each has a best residence time
and a porosity at each level; how much of the spread of the former goes with the latter (linear regression, with the
scatter of the packings) is what packings there would tell. Where all curves have one best residence time, it is the
spread of the objective instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from filtercake.design.belief import Belief, Packed
from filtercake.design.search import Optimum, Problem, find
from filtercake.units import MINUTE, FloatArray

BATCHES: Final = 3
"""Sets of packings that a level may get, one after the other."""
AT_ONCE: Final = 2
"""Levels packed in a round."""
STILL: Final = 1e-9
"""Spread below which nothing varies."""


@dataclass(frozen=True)
class Candidate:
    """A set of packings that a design may come to need.

    Attributes
    ----------
    name : str
        Of the packings.
    level : int
        Number of the residence time among those that may be packed.
    batch : int
        Which of its sets.
    replicates : int
        Packings in it.
    """

    name: str
    level: int
    batch: int
    replicates: int


@dataclass(frozen=True)
class Round:
    """One round of packings.

    Attributes
    ----------
    packings : tuple of str
        Names of what is to be packed.
    finished : bool
        Whether it is the last: then there is nothing to pack.
    why : str
        The reason, for the log and the report.
    """

    packings: tuple[str, ...]
    finished: bool
    why: str


@dataclass(frozen=True, eq=False)
class Found:
    """What earlier rounds gave.

    Attributes
    ----------
    porosity : dict of str to ndarray, shape (n, p)
        Porosity of the accepted packings per pressure drop, by the name of what was packed.
    made : int
        Packings made, failed ones among them.
    """

    porosity: Mapping[str, FloatArray]
    made: int


def learnt(prior: Belief, candidates: Sequence[Candidate], found: Found) -> Belief:
    """Update what is known with all packings."""
    by_level: dict[int, list[FloatArray]] = {}
    for candidate in candidates:
        if candidate.name in found.porosity:
            by_level.setdefault(candidate.level, []).append(found.porosity[candidate.name])
    return prior.after(Packed(level, np.concatenate(parts)) for level, parts in sorted(by_level.items()))


def choose(problem: Problem, prior: Belief, candidates: Sequence[Candidate], found: Found, budget: int) -> Round:
    """Decide what to pack next, from what was packed so far, with at most so many packings in all."""
    belief = learnt(prior, candidates, found)
    optimum = find(problem, belief)
    so_far = standing(optimum)
    if not optimum.possible:
        return Round((), finished=True, why=f"{so_far}: packings would not change that")
    near = _nearest(belief, optimum.residence_time)
    confirmed = _confirmed(belief, optimum, candidates, found, near)
    if confirmed and optimum.settled:
        return Round((), finished=True, why=so_far)
    offered = _offered(candidates, found)
    if not offered:
        return Round((), finished=True, why=f"{so_far}: every level has its {BATCHES} sets of packings")
    wanted = _informative(optimum, belief, offered, None if confirmed else near, 1 if optimum.settled else AT_ONCE)
    chosen, left = [], budget - found.made
    for candidate in wanted:
        if candidate.replicates <= left:
            chosen.append(candidate)
            left -= candidate.replicates
    if not chosen:
        return Round((), finished=True, why=f"{so_far}: the {budget} packings allowed are made")
    at = ", ".join(f"{np.exp(belief.position[belief.levels[item.level]]) / MINUTE:.3g}" for item in chosen)
    return Round(tuple(item.name for item in chosen), finished=False, why=f"{so_far}: packings at {at} min")


def standing(optimum: Optimum) -> str:
    """Say in short where the optimum is."""
    if not optimum.possible:
        return "no design keeps to the limits"
    low, best, high = (value / MINUTE for value in (optimum.low, optimum.residence_time, optimum.high))
    return f"{optimum.kind}, residence time {best:.3g} min (95 %: {low:.3g} to {high:.3g})"


def _nearest(belief: Belief, residence_time: float) -> int:
    """Level nearest to a residence time, s."""
    return int(np.argmin(np.abs(belief.position[list(belief.levels)] - np.log(residence_time))))


def _confirmed(belief: Belief, optimum: Optimum, candidates: Sequence[Candidate], found: Found, near: int) -> bool:
    """Whether accepted packings are where the optimum may be, or as near to it as can be."""
    packed = {item.level for item in candidates if len(found.porosity.get(item.name, ()))}
    at = {level: float(np.exp(belief.position[belief.levels[level]])) for level in packed}
    return near in packed or any(optimum.low <= time <= optimum.high for time in at.values())


def _offered(candidates: Sequence[Candidate], found: Found) -> list[Candidate]:
    """Return the next set of packings of each level."""
    left = [item for item in candidates if item.name not in found.porosity]
    first = {level: min(item.batch for item in left if item.level == level) for level in {c.level for c in left}}
    return sorted((item for item in left if item.batch == first[item.level]), key=lambda item: item.level)


def _informative(
    optimum: Optimum, belief: Belief, offered: Sequence[Candidate], first: int | None, count: int
) -> list[Candidate]:
    """Return the sets that would tell most of the optimum, best first; one at a level first, where it is given."""
    target = optimum.draws if np.std(optimum.draws) > STILL else optimum.values
    at = [belief.levels[item.level] for item in offered]
    curves = optimum.curves[:, at]
    spread = np.cov(np.column_stack([target, curves]).T)
    middle = belief.mean.shape[1] // 2
    scatter = np.array([belief.scatter[item.level, middle] / item.replicates**0.5 for item in offered])
    noise = (scatter / belief.deviation[at, middle]) ** 2
    chosen = [k for k, item in enumerate(offered) if item.level == first][:1]

    def told(group: list[int]) -> float:
        rows = [k + 1 for k in group]
        known = spread[np.ix_(rows, rows)] + np.diag(noise[group])
        return float(spread[0, rows] @ np.linalg.solve(known, spread[rows, 0]))

    while len(chosen) < min(count, len(offered)):
        rest = [k for k in range(len(offered)) if k not in chosen]
        chosen.append(max(rest, key=lambda k: told([*chosen, k])))
    return [offered[k] for k in chosen]
