"""Intervals of means, differences and fitted parameters: every "95 %" of the package is made here.

Means of few packings have Student intervals, differences of two means Welch's (B. L. Welch, Biometrika 34 (1947) 28,
with the degrees of freedom of F. E. Satterthwaite, Biometrics Bull. 2 (1946) 110), paired values the Student interval
of their differences. What cannot be known, such as the spread of a single value, is nan.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from filtercake.units import FloatArray

CONFIDENCE: Final = 0.95
"""Probability with which an interval covers what it is of."""

CONTRADICTION: Final = 0.99
"""Probability of a ratio of variances below which values may have the spread that is known beforehand."""


@dataclass(frozen=True)
class Spread:
    """Standard deviation of one value, and the degrees of freedom that it rests on (nan and 0 where nothing tells)."""

    sd: float
    freedom: float


def quantile(freedom: float = math.inf, confidence: float = CONFIDENCE) -> float:
    """Half-width of a two-sided Student interval, in standard errors; of the normal one by default.

    Parameters
    ----------
    freedom : float
        Degrees of freedom of the standard error, infinite where it is known; nan below or at 0.
    confidence : float
        Confidence level.
    """
    from scipy import special  # costs more than all else of a short command

    return float(special.stdtrit(freedom, 0.5 + 0.5 * confidence)) if freedom > 0.0 else math.nan


def likelihood_limit(freedom: float = math.inf) -> float:
    """-2 ln(likelihood ratio) up to which a value belongs to the 95 % interval of one parameter.

    Chi-square with one degree of freedom (3.84) where the errors are known. Where their scale was estimated, F with 1
    and ``freedom`` degrees (161, 18.5, 10.1 with 1, 2 and 3): the square of Student's quantile.

    Parameters
    ----------
    freedom : float
        Degrees of freedom of the scale.
    """
    return quantile(freedom) ** 2


def standard_error(values: ArrayLike) -> float:
    """Return the standard error of the mean of independent values (n,); nan for fewer than two."""
    x = _array(values)
    return float(np.std(x, ddof=1)) / math.sqrt(x.size) if x.size > 1 else math.nan


def half_width(values: ArrayLike) -> float:
    """Half-width of the 95 % interval of the mean of independent values (n,); nan for fewer than two."""
    x = _array(values)
    return quantile(x.size - 1.0) * standard_error(x)


def informed_spread(values: ArrayLike, known: Spread) -> Spread:
    """Pool the spread of independent values (n,) with what is known of it beforehand.

    Each counts by its degrees of freedom. Where the values contradict it, scattering more than chance allows in one of
    a hundred cases (F test), they alone count.

    Parameters
    ----------
    values : array_like, shape (n,)
        Independent values.
    known : Spread
        Standard deviation of one value as far as it is known without them.

    Notes
    -----
    Source: the moderated t statistic of G. K. Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004) 3. Over scenes whose
    variances scatter about the known one as its degrees of freedom say, the interval of :func:`informed_half_width`
    covers in 95 % of cases, and goes on to do so if packings are added until it is narrow: when that is depends on the
    spread alone, which tells nothing of the mean of normal values.
    """
    own = pooled_spread([values])
    if own.freedom == 0.0:
        return known
    if own.sd > known.sd * math.sqrt(_largest_ratio(own.freedom, known.freedom)):
        return own
    freedom = own.freedom + known.freedom
    return Spread(math.sqrt((own.freedom * own.sd**2 + known.freedom * known.sd**2) / freedom), freedom)


def informed_half_width(values: ArrayLike, known: Spread) -> float:
    """Half-width of the 95 % interval of the mean of values (n,), whose spread is known beforehand as well.

    Not a number without a value; see :func:`informed_spread`.
    """
    spread, count = informed_spread(values, known), _array(values).size
    return quantile(spread.freedom) * spread.sd / math.sqrt(count) if count else math.nan


def difference_half_width(one: ArrayLike, other: ArrayLike) -> float:
    """Half-width of Welch's 95 % interval of the difference of two means; nan where either has fewer than two values.

    Parameters
    ----------
    one, other : array_like, shapes (n,) and (m,)
        Independent values, which need not spread alike.
    """
    x, y = _array(one), _array(other)
    parts = [standard_error(x) ** 2, standard_error(y) ** 2]
    return quantile(effective_freedom(parts, [x.size - 1.0, y.size - 1.0])) * math.sqrt(sum(parts))


def paired_half_width(one: ArrayLike, other: ArrayLike) -> float:
    """Half-width of the 95 % interval of the mean difference of pairs (n,) and (n,); nan for fewer than two."""
    return half_width(_array(one) - _array(other))


def effective_freedom(parts: ArrayLike, freedom: ArrayLike) -> float:
    """Degrees of freedom of a sum of estimated variances (Satterthwaite).

    Parameters
    ----------
    parts : array_like, shape (k,)
        The variances.
    freedom : array_like, shape (k,)
        Degrees of freedom of each; infinite where it is known.

    Returns
    -------
    float
        ``sum(parts)^2 / sum(parts^2 / freedom)``; infinite where no part is estimated, and where all are nothing.
    """
    variance, degrees = _array(parts), _array(freedom)
    if (degrees <= 0.0).any():
        return math.nan
    doubt = float(np.sum(variance**2 / degrees))
    return math.inf if doubt == 0.0 else float(variance.sum()) ** 2 / doubt


def pooled_spread(samples: Iterable[ArrayLike]) -> Spread:
    """Pool the standard deviation of one value from samples with means of their own but the same spread."""
    listed = [_array(values) for values in samples]
    freedom = float(sum(max(x.size - 1, 0) for x in listed))
    if freedom == 0.0:
        return Spread(math.nan, 0.0)
    squares = sum(float(np.sum((x - x.mean()) ** 2)) for x in listed if x.size)
    return Spread(math.sqrt(squares / freedom), freedom)


@functools.cache
def _largest_ratio(freedom: float, known: float) -> float:
    """Return the ratio of two variances that chance exceeds in one of a hundred cases."""
    from scipy import special  # as above

    return float(special.fdtri(freedom, known, CONTRADICTION))


def _array(values: ArrayLike) -> FloatArray:
    return np.asarray(values, dtype=np.float64)
