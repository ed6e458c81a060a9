"""Several measurements of one quantity: their weighted mean, and the scatter that their errors do not explain.

The scatter is the one of R. C. Paule & J. Mandel, J. Res. Natl. Bur. Stand. 87 (1982) 377: the standard deviation
that, added to every measurement's error, makes the weighted sum of squares what it should be on average.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from filtercake.units import FloatArray

MISFIT: Final = 0.05
"""Probability of a sum of squares below which it is not put down to the errors."""


@dataclass(frozen=True)
class Pool:
    """What several measurements of one quantity say together.

    Attributes
    ----------
    mean, variance : float
        Their weighted mean and its variance; the scatter is in both.
    chi_square : float
        Weighted sum of squares about the mean by the errors alone.
    degrees_of_freedom : int
        Measurements less one.
    scatter : float
        Standard deviation added to every error; 0 where the measurements agree within their errors.
    """

    mean: float
    variance: float
    chi_square: float
    degrees_of_freedom: int
    scatter: float

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the variance: infinite unless a scatter was estimated for it."""
        return float(self.degrees_of_freedom) if self.scatter > 0.0 else math.inf


def pool(values: ArrayLike, errors: ArrayLike) -> Pool:
    """Average measurements with weights; where they contradict each other, a scatter is added to their errors.

    Parameters
    ----------
    values, errors : array_like, shape (m,)
        The measurements and their standard errors.
    """
    value, error = _arrays(values, errors)
    chi_square, freedom = _squares(value, error), value.size - 1
    added = scatter(value, error) if improbable(chi_square, freedom) else 0.0
    mean, variance = _average(value, np.hypot(error, added))
    return Pool(mean, variance, chi_square, freedom, added)


def scatter(values: ArrayLike, errors: ArrayLike) -> float:
    """Return the standard deviation between measurements that their errors do not explain.

    Parameters
    ----------
    values, errors : array_like, shape (m,)
        The measurements and their standard errors.
    """
    from scipy import optimize

    value, error = _arrays(values, errors)
    freedom = value.size - 1
    if freedom == 0 or _squares(value, error) <= freedom:
        return 0.0
    # the squares fall as the scatter grows, and are below the degrees of freedom once it is the whole spread
    widest = 1.01 * float(np.ptp(value))
    return float(
        optimize.brentq(lambda added: _squares(value, np.hypot(error, added)) - freedom, 0.0, widest, rtol=1e-12)
    )


def improbable(chi_square: float, degrees_of_freedom: int) -> bool:
    """Whether errors alone would give so large a sum of squares only with the probability ``MISFIT`` or less."""
    from scipy import special

    return degrees_of_freedom > 0 and bool(special.chdtrc(degrees_of_freedom, chi_square) < MISFIT)


def chi_square(values: ArrayLike, errors: ArrayLike) -> float:
    """Weighted sum of squares of measurements (m,) about their weighted mean."""
    return _squares(*_arrays(values, errors))


def _arrays(values: ArrayLike, errors: ArrayLike) -> tuple[FloatArray, FloatArray]:
    return np.asarray(values, dtype=np.float64), np.asarray(errors, dtype=np.float64)


def _average(value: FloatArray, error: FloatArray) -> tuple[float, float]:
    weight = error**-2.0
    return float(np.average(value, weights=weight)), float(1.0 / weight.sum())


def _squares(value: FloatArray, error: FloatArray) -> float:
    mean, _ = _average(value, error)
    return float(np.sum(((value - mean) / error) ** 2))
