"""Which readings of a filtration test lie on the parabola of Ruth's law, and when its clock was at zero.

At constant pressure t = t0 + b V + a V^2 holds from the first reading behind the start-up (a pump's ramp, crystals
that still bridge the medium, an outlet with air in it) to the last one before the end (cake dry, chamber full, solids
used up). Neither change-point is known, nor whether t0 is 0, nor how errors grow along the test. Every choice of the
three is compared with the others:

* the readings before the first and behind the last change-point follow a parabola of their own, or each what it likes;
* t0 is 0, or fitted;
* errors of the times have a standard deviation proportional to V^q, q of ``ERROR_GROWTHS``.

The weight of a choice is its posterior probability with Zellner's g-prior (A. Zellner, in Bayesian Inference and
Decision Techniques, 1986, p. 233) on what it has beyond b and a of the whole test: g = n for t0 and the parabolas of
their own (unit information; Kass & Wasserman, J. Am. Stat. Assoc. 90 (1995) 928), n^2 for every reading that is where
it likes, so that of the many that a test offers few are left out by chance. The prior: an end is disturbed with
probability ``DISTURBED``, long disturbances are less likely than short ones; the clock is wrong with probability
``WRONG_CLOCK``. A straight line is no filtration, nor is a parabola with a medium that drives it. That is a
change-point rule at both ends, and what it leaves open stays visible as several choices with weight. The answer is the
most probable one, or a simpler one that is nearly as probable (``SIMPLER``).
"""

from __future__ import annotations

import itertools
import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from filtercake.units import FloatArray, IntArray

BoolArray = NDArray[np.bool_]

FEWEST: Final = 5
"""Readings that a parabola needs to be told from what surrounds it."""
SMALLEST_SHARE: Final = 1.0 / 3.0
"""Share of the readings that must lie on it."""
DISTURBED: Final = 0.1
"""Prior probability that an end of a test is disturbed."""
WRONG_CLOCK: Final = 0.3
"""Prior probability that a clock was not started with the filtration."""
SIMPLER: Final = 0.2
"""Probability, over the largest, from which a choice with less amiss is the answer."""
DEVIATIONS: Final = (1.0, 1e2, 1e4, 1e8)
"""Factors on g, of which each choice has its best: readings off the parabola may be so by far more than n errors."""
ERROR_GROWTHS: Final = (0.0, 0.5, 1.0, 1.5)
"""Powers of the volume that the standard deviation of a time's error may grow with."""
SIGNIFICANT: Final = 2.0
"""Standard errors by which the curvature must exceed 0, and at most by which the medium's share may lie under it."""
LEAST_WEIGHT: Final = 1e-3
"""Choices less probable than this, over the most probable one, are not looked at."""

MOST_CHOICES: Final = 300
"""Choices that are looked at."""

_OWN_PARABOLA: Final = 3
_RIDGE: Final = 1e-13
_MOST_PLACES: Final = 40
"""Change-points that are tried at each end of a long test, before those near the best are."""
_ROUND_OFF: Final = 1e-9
"""Standard deviation of times without noise, over the longest."""


class Choice(NamedTuple):
    """One way to read a test.

    Attributes
    ----------
    start, stop : int
        The first reading on the parabola, and the one behind the last.
    free_zero : bool
        Whether t0 is fitted.
    growth : float
        Power q of the volume that the errors grow with.
    weight : float
        Its probability, up to a factor that all share.
    """

    start: int
    stop: int
    free_zero: bool
    growth: float
    weight: float


def choices(time: FloatArray, volume: FloatArray, *, known_zero: bool) -> list[Choice]:
    """Weigh the ways to read a test, the answer first.

    Parameters
    ----------
    time, volume : ndarray, shape (n,)
        Readings, in any units; volumes positive.
    known_zero : bool
        Whether the filtration may have begun at time 0; t0 is fitted in any case where not.

    Returns
    -------
    list of Choice
        Those with at least ``LEAST_WEIGHT``.
    """
    n = time.size
    least = max(FEWEST, math.ceil(SMALLEST_SHARE * n))
    starts, stops = _places(0, max(n - least, 0)), _places(min(least, n), n)
    found = _weighed(time, volume, starts, stops, known_zero)
    if starts.size < n - least + 1:
        best, step = found[0], -(-n // _MOST_PLACES)
        starts = np.union1d(starts, np.arange(max(best.start - step, 0), min(best.start + step, n - least) + 1))
        stops = np.union1d(stops, np.arange(max(best.stop - step, least), min(best.stop + step, n) + 1))
        found = _weighed(time, volume, starts, stops, known_zero)
    return found


def _places(first: int, last: int) -> IntArray:
    """Whole numbers from first to last, an even choice of ``_MOST_PLACES`` where they are more."""
    count = min(last - first + 1, _MOST_PLACES)
    return np.unique(np.round(np.linspace(first, last, count)).astype(np.int64))


def _weighed(time: FloatArray, volume: FloatArray, starts: IntArray, stops: IntArray, known_zero: bool) -> list[Choice]:
    n = time.size
    start, stop = (axis.ravel() for axis in np.meshgrid(starts, stops, indexing="ij"))
    whole = (start == 0) & (stop == n)
    wide = whole | (stop - start >= max(FEWEST, math.ceil(SMALLEST_SHARE * n)))
    start, stop, whole = start[wide], stop[wide], whole[wide]
    prior = _prior(start / n, starts.size) + _prior(1.0 - stop / n, stops.size)
    rows = []
    for growth in ERROR_GROWTHS:
        weighted = _Weighted(time, volume, growth)
        for free_zero in (False, True) if known_zero else (True,):
            evidence = prior + weighted.evidence(start, stop, known_zero=known_zero, free_zero=free_zero)
            evidence = np.where(whole | weighted.filters(start, stop, free_zero), evidence, -np.inf)
            rows += [(e, i, j, free_zero, growth) for e, i, j in zip(evidence, start, stop, strict=True)]
    best = max(row[0] for row in rows)
    chosen = sorted((row for row in rows if row[0] > best + math.log(LEAST_WEIGHT)), key=lambda row: -row[0])
    found = [Choice(int(i), int(j), free, growth, math.exp(e - best)) for e, i, j, free, growth in chosen]
    return _answer_first(found[:MOST_CHOICES], n)


def _answer_first(found: list[Choice], readings: int) -> list[Choice]:
    """Put the readings and time zero first that are most probable whatever the growth of the errors, or simpler."""
    shares: dict[tuple[int, int, bool], float] = {}
    for choice in found:
        shares[choice[:3]] = shares.get(choice[:3], 0.0) + choice.weight
    enough = SIMPLER * max(shares.values())

    def rank(key: tuple[int, int, bool]) -> tuple[int, float]:
        start, stop, free_zero = key
        return (start > 0) + (stop < readings) + free_zero, -shares[key]

    answer = min((key for key, share in shares.items() if share >= enough), key=rank)
    return sorted(found, key=lambda choice: choice[:3] != answer)


def _prior(disturbed: FloatArray, places: int) -> FloatArray:
    """Logarithm of the prior of a share of disturbed readings at one end, over that of none."""
    odds = math.log(DISTURBED / (1.0 - DISTURBED)) - math.log(max(places - 1, 1))
    return np.where(disturbed > 0.0, odds + np.log1p(-disturbed), 0.0)


class _Outside(NamedTuple):
    """Readings off the parabola: sum of squares about what describes them, and its unknowns, shapes (m,).

    ``shaped`` counts the unknowns of a curve, ``loose`` readings that are where they like beyond so many.
    """

    squares: FloatArray
    loose: FloatArray
    shaped: FloatArray


class _Weighted:
    """Readings with their weights, and the fits of any stretch of them."""

    def __init__(self, time: FloatArray, volume: FloatArray, growth: float):
        v = volume / volume.max()
        scale = v**-growth
        y = time / time.max() * scale
        parabola = np.stack([np.ones_like(v), v, v**2], axis=1) * scale[:, None]
        self.n = time.size
        self.free, self.fixed = Segments(parabola, y), Segments(parabola[:, 1:], y)
        self.scale = float(np.sum(np.log(scale)))

    def evidence(self, start: IntArray, stop: IntArray, *, known_zero: bool, free_zero: bool) -> FloatArray:
        """Logarithm of the marginal likelihood of each pair of change-points, shape (m,), up to a common constant."""
        n = self.n
        common = self.fixed if known_zero else self.free
        freedom, floor = n - common.unknowns, n * _ROUND_OFF**2
        base = float(common.squares(np.array([0]), np.array([n]))[0])
        inside = (self.free if free_zero else self.fixed).squares(start, stop)
        zero_fitted = float(known_zero and free_zero)
        best = np.full(start.size, -np.inf)
        length = stop - start
        before_and_behind = (self._outside(0, start, length), self._outside(stop, n, length))
        for before, behind in itertools.product(*before_and_behind):
            rest = inside + before.squares + behind.squares
            shaped = zero_fitted + before.shaped + behind.shaped
            used = shaped + before.loose + behind.loose
            likely = np.full(start.size, -np.inf)
            for g in n**2 * np.array(DEVIATIONS):
                fits = 0.5 * (freedom - used) * np.log1p(g) - 0.5 * freedom * np.log(base + g * (rest + floor))
                likely = np.maximum(likely, fits)
            likely += 0.5 * shaped * math.log(n)
            best = np.maximum(best, np.where(used < freedom, likely, -np.inf))
        wrong_clock = math.log(WRONG_CLOCK / (1.0 - WRONG_CLOCK))
        return best + self.scale - common.log_volume + zero_fitted * wrong_clock

    def _outside(self, first: IntArray | int, last: IntArray | int, inside: IntArray) -> tuple[_Outside, _Outside]:
        """Describe readings off the parabola as each where it likes, or on a parabola of their own.

        On one of their own are no more than are ``inside``: the filtration is what most readings show.
        """
        first, last = np.broadcast_arrays(np.asarray(first), np.asarray(last))
        count, none = (last - first).astype(np.float64), np.zeros(first.shape)
        few = np.minimum(count, _OWN_PARABOLA)
        own = np.where(count <= inside, self.free.squares(first, last), math.inf)
        return _Outside(none, count - few, few), _Outside(np.where(count > few, own, 0.0), none, few)

    def filters(self, start: IntArray, stop: IntArray, free_zero: bool) -> BoolArray:
        """Whether what is on the parabola may be a filtration: it slows down, and no medium drives it."""
        ratios = (self.free if free_zero else self.fixed).ratios(start, stop)
        return np.asarray((ratios[:, 1] > SIGNIFICANT) & (ratios[:, 0] > -SIGNIFICANT))


class Segments:
    """Least squares over any stretch of readings, from running sums."""

    def __init__(self, design: FloatArray, time: FloatArray):
        """Take design (n, p) and times (n,), weighted."""
        q, r = np.linalg.qr(design)
        self.whole, self.inverse = q.T @ time, np.linalg.inv(r)
        rest = time - q @ self.whole  # what the whole fit explains is taken away first, so that nothing cancels
        self.gram = _running(q[:, :, None] * q[:, None, :])
        self.moment, self.square = _running(q * rest[:, None]), _running(rest**2)
        self.unknowns = q.shape[1]
        self.log_volume = float(np.sum(np.log(np.abs(np.diag(r)))))

    def squares(self, first: IntArray, last: IntArray) -> FloatArray:
        """Sum of squares of readings first..last-1 about their fit, shape (m,)."""
        return self._solved(first, last)[2]

    def ratios(self, first: IntArray, last: IntArray) -> FloatArray:
        """Return the coefficients of V and V^2 over their standard errors, shape (m, 2)."""
        gram, solved, rest = self._solved(first, last)
        rows = self.inverse[-2:]
        values = (self.whole + solved) @ rows.T
        shape = np.einsum("ci,kij,cj->kc", rows, np.linalg.inv(gram), rows)
        variance = shape * (rest / np.maximum(last - first - self.unknowns, 1))[:, None]
        return np.asarray(values / np.sqrt(variance + _ROUND_OFF**2))

    def _solved(self, first: IntArray, last: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        # the ridge is far under what decides, and lets readings of one volume pass
        gram = self.gram[last] - self.gram[first] + _RIDGE * np.eye(self.unknowns)
        moment = self.moment[last] - self.moment[first]
        solved = np.linalg.solve(gram, moment[:, :, None])[:, :, 0]
        rest = self.square[last] - self.square[first] - np.einsum("ij,ij->i", moment, solved)
        return gram, np.asarray(solved), np.maximum(rest, 0.0)


def _running(values: FloatArray) -> FloatArray:
    """Return the sums of the first 0, 1, ... n values."""
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
