"""What is known of the porosity along the residence time: the instant estimate, and what packings told of its error.

The error of the estimate is a Gaussian process along the logarithm of the residence time: its standard deviation is
that which the estimate states, and its correlation Matern's with smoothness 5/2,

``rho = (1 + s + s^2/3) exp(-s)`` with ``s = sqrt(5) |ln(tau/tau')| / ln 2``.

Distributions of one crystallizer are alike, so that an error at one residence time is there at its neighbours, too: two
a factor of 1.26 apart share 0.92 of it, two a factor of 2 apart 0.52, a factor of 4 apart 0.14. That is an assumption,
on the side of caution. The means of packings update the process (C. E. Rasmussen and C. K. I. Williams, Gaussian
Processes for Machine Learning, MIT Press 2006, eq. 2.23 and 2.24).

At several pressure drops, each has a process of its own; the packings are the same, so that their errors are taken to
be the same number of standard deviations at each.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from filtercake.units import FloatArray

CORRELATION_LENGTH: Final = math.log(2.0)
"""Distance in the logarithm of the residence time over which the error of the estimate stays alike."""
SMOOTHING_DEGREE: Final = 3
"""Degree of the polynomial in it that smooths the estimate: where the cut of a distribution drops one more class, the
estimate makes a step of some 0.0005 that is no property of the crystals."""
PRIOR_FREEDOM: Final = 4.0
"""Packings that the estimate's scatter of one packing counts for, beside the scatter that is seen."""
POSSIBLE: Final = (0.02, 0.9)
"""Porosities of a cake, whatever an interval says."""
SMALLEST_DEVIATION: Final = 1e-6
"""Standard deviation of a porosity below which nothing is told apart."""


@dataclass(frozen=True, eq=False)
class LevelEstimate:
    """The instant estimate at a residence time, per pressure drop (p,).

    Attributes
    ----------
    porosity, deviation : ndarray
        Expected mean of many packings, and the standard deviation of what is not known of it.
    scatter : ndarray
        Standard deviation of one packing about that mean.
    outside : tuple of str
        Where it lies outside of what the estimate was trained on, in words.
    """

    porosity: FloatArray
    deviation: FloatArray
    scatter: FloatArray
    outside: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Packed:
    """Accepted packings of a level.

    Attributes
    ----------
    level : int
        Number of the residence time among those that may be packed.
    porosity : ndarray, shape (n, p)
        Porosity of each, per pressure drop.
    """

    level: int
    porosity: FloatArray


@dataclass(frozen=True, eq=False)
class Belief:
    """Porosity along the residence time.

    Attributes
    ----------
    position : ndarray, shape (m,)
        Logarithms of residence times.
    levels : ndarray of int
        Those of them that may be packed.
    mean : ndarray, shape (m, p)
        Expected porosity per pressure drop.
    covariance : ndarray, shape (p, m, m)
        Of what is not known of it.
    scatter : ndarray, shape (levels, p)
        Standard deviation of one packing.
    """

    position: FloatArray
    levels: tuple[int, ...]
    mean: FloatArray
    covariance: FloatArray
    scatter: FloatArray

    @classmethod
    def prior(cls, residence_times: Sequence[float], estimates: Sequence[LevelEstimate], between: int) -> Belief:
        """Start from the instant estimate at ascending residence times (s), with steps ``between`` one and the next."""
        at = np.log(np.asarray(residence_times, dtype=np.float64))
        steps = np.arange((at.size - 1) * between + 1) / between
        position = np.interp(steps, np.arange(at.size), at)
        found = {name: np.array([getattr(item, name) for item in estimates]) for name in ("porosity", "deviation")}
        mean, missed = _smooth(at, found["porosity"], position)
        own = np.stack([np.interp(position, at, column) for column in found["deviation"].T], axis=1)
        deviation = np.maximum(np.hypot(own, missed), SMALLEST_DEVIATION)
        alike = correlation(position[:, None] - position[None, :])
        return cls(
            position=position,
            levels=tuple(range(0, position.size, between)),
            mean=mean,
            covariance=np.array([alike * np.outer(column, column) for column in deviation.T]),
            scatter=np.array([item.scatter for item in estimates]),
        )

    def after(self, packed: Iterable[Packed]) -> Belief:
        """Update with packings."""
        groups = [item for item in packed if len(item.porosity)]
        if not groups:
            return self
        at = np.array([self.levels[item.level] for item in groups])
        counts = np.array([len(item.porosity) for item in groups])
        means = np.array([item.porosity.mean(axis=0) for item in groups])
        noise = self._noise(groups)
        mean, covariance = self.mean.copy(), self.covariance.copy()
        for k, known in enumerate(self.covariance):
            cross = known[:, at]
            inverse = np.linalg.inv(known[np.ix_(at, at)] + np.diag(noise[:, k] / counts))
            mean[:, k] += cross @ inverse @ (means[:, k] - self.mean[at, k])
            covariance[k] = known - cross @ inverse @ cross.T
        return replace(self, mean=mean, covariance=covariance)

    def _noise(self, groups: Sequence[Packed]) -> FloatArray:
        """Variance of one packing at each group's level, (groups, p): what is seen, pooled with what is expected."""
        expected = self.scatter[[item.level for item in groups]] ** 2
        freedom = sum(len(item.porosity) - 1 for item in groups)
        squares = sum(np.sum((item.porosity - item.porosity.mean(axis=0)) ** 2, axis=0) for item in groups)
        # of the levels' own expectations, seen and expected differ by one factor
        seen = np.asarray(squares) / np.maximum(expected.mean(axis=0), SMALLEST_DEVIATION**2)
        return np.asarray(expected * (PRIOR_FREEDOM + seen) / (PRIOR_FREEDOM + freedom))

    @cached_property
    def deviation(self) -> FloatArray:
        """Standard deviation of what is not known, shape (m, p)."""
        variance = np.diagonal(self.covariance, axis1=1, axis2=2).T
        return np.asarray(np.maximum(np.sqrt(np.maximum(variance, 0.0)), SMALLEST_DEVIATION))

    def at(self, place: int, deviations: float = 0.0) -> FloatArray:
        """Return the porosity at a place, so many standard deviations above its mean, per pressure drop, (p,)."""
        return np.asarray(np.clip(self.mean[place] + deviations * self.deviation[place], *POSSIBLE))

    def draws(self, count: int, seed: int) -> FloatArray:
        """Draw porosity curves, in standard deviations about the mean, shape (count, m).

        Correlated as at the middle one of the pressure drops.
        """
        middle = self.covariance.shape[0] // 2
        spread = self.deviation[:, middle]
        values, vectors = np.linalg.eigh(self.covariance[middle] / np.outer(spread, spread))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        normal = np.random.default_rng(seed).standard_normal((count, values.size))
        return np.asarray(normal @ root.T)


def correlation(distance: FloatArray) -> FloatArray:
    """Correlation of the estimate's errors at a distance in the logarithm of the residence time."""
    scaled = math.sqrt(5.0) * np.abs(distance) / CORRELATION_LENGTH
    return np.asarray((1.0 + scaled + scaled**2 / 3.0) * np.exp(-scaled))


def _smooth(at: FloatArray, values: FloatArray, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Smooth values (levels, p) over a position; with the root mean square of what that leaves out, (p,)."""
    centre, reach = at.mean(), max(float(np.ptp(at)), 1.0)
    degree = min(SMOOTHING_DEGREE, at.size - 1)
    powers = np.vander((at - centre) / reach, degree + 1)
    coefficients, *_ = np.linalg.lstsq(powers, values, rcond=None)
    missed = np.sqrt(np.mean((powers @ coefficients - values) ** 2, axis=0))
    return np.vander((position - centre) / reach, degree + 1) @ coefficients, missed
