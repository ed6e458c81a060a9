"""Size distributions of a few numbers: lognormal from D10, D50 and D90, and Rosin-Rammler.

Both are of the volume. Their sums of x/d and x/d^2 have closed forms, which the classes add up to exactly, whatever
their number. Sources: ISO 9276-5 (lognormal); Rosin and Rammler, J. Inst. Fuel 7 (1933) 29, DIN 66145.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from statistics import NormalDist
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.errors import CsdError
from filtercake.units import MICROMETRE, FloatArray

D90_DEVIATE: Final = 2.0 * NormalDist().inv_cdf(0.9)
"""ln(D90/D10) of a lognormal over the logarithm of its standard deviation: 2.5631."""

MEDIAN_TOLERANCE: Final = 0.05
"""How far D50 may be off sqrt(D10 D90), which it is in a lognormal."""

TAIL: Final = 1e-4
"""Volume beyond the first and the last edge, which is put into the classes there."""

CLASS_STEP: Final = math.log(10.0) / 20.0
"""Width of a class in the natural logarithm of the size, at most: 20 classes a decade (R20 of ISO 3)."""

FEWEST_CLASSES: Final = 20
"""Classes that a narrow distribution is cut into."""

LEAST_EXPONENT: Final = 2.0
"""Rosin-Rammler's exponent up to which the sum of x/d^2 diverges (that of x/d: up to 1)."""

Cumulative = Callable[[FloatArray], FloatArray]


def lognormal(d10: float, d50: float, d90: float) -> CrystalSizeDistribution:
    """Cut a lognormal distribution of the volume into classes.

    ln s = ln(D90/D10)/2.5631; the sum of x/d is exp(ln^2 s / 2)/D50, that of x/d^2 exp(2 ln^2 s)/D50^2.

    Parameters
    ----------
    d10, d50, d90 : float
        Sizes, m, that 10, 50 and 90 % of the volume are smaller than.

    Raises
    ------
    CsdError
        If they do not ascend, or D50 is not within ``MEDIAN_TOLERANCE`` of sqrt(D10 D90).
    """
    from scipy import special

    shown = ", ".join(f"{size / MICROMETRE:g}" for size in (d10, d50, d90))
    if not 0.0 < d10 < d50 < d90:
        raise CsdError(f"d10, d50, d90 = {shown} um: must ascend")
    median = math.sqrt(d10 * d90)
    off = d50 / median - 1.0
    if abs(off) > MEDIAN_TOLERANCE:
        raise CsdError(
            f"d10, d50, d90 = {shown} um are not of a lognormal distribution: d50 is {off:+.0%} off sqrt(d10 d90) = "
            f"{median / MICROMETRE:.4g} um; give the classes in a file"
        )
    spread = math.log(d90 / d10) / D90_DEVIATE

    def part(power: int) -> Cumulative:
        whole = math.exp(-power * math.log(d50) + 0.5 * (power * spread) ** 2)
        return lambda size: (
            whole * np.asarray(special.ndtr(np.log(size / d50) / spread + power * spread), dtype=np.float64)
        )

    ends = [d50 * math.exp(spread * NormalDist().inv_cdf(share)) for share in (TAIL, 1.0 - TAIL)]
    words = (
        f"lognormal by volume: geometric standard deviation {math.exp(spread):.4g}, d50 {off:+.1%} off sqrt(d10 d90)"
    )
    return _cut(ends, part(0), part(1), part(2), words)


def rosin_rammler(size: float, exponent: float) -> CrystalSizeDistribution:
    """Cut a Rosin-Rammler distribution into classes: R = exp(-(d/d')^n) of the volume is larger than d.

    The sum of x/d is Gamma(1 - 1/n)/d', that of x/d^2 Gamma(1 - 2/n)/d'^2.

    Parameters
    ----------
    size : float
        d', m, which exp(-1) = 36.8 % of the volume is larger than.
    exponent : float
        n, above ``LEAST_EXPONENT``.

    Raises
    ------
    CsdError
        If the sum of x/d^2 diverges.
    """
    from scipy import special

    if not exponent > LEAST_EXPONENT:
        raise CsdError(
            f"exponent = {exponent:g}: must be above {LEAST_EXPONENT:g}: with fewer, the sum of x/d^2, and so the "
            "resistance, has no end towards the fines; give the classes down to the smallest crystals in a file"
        )

    def part(power: int) -> Cumulative:
        rest = 1.0 - power / exponent
        whole = math.gamma(rest) / size**power
        return lambda sizes: whole * np.asarray(special.gammainc(rest, (sizes / size) ** exponent), dtype=np.float64)

    ends = [size * (-math.log1p(-share)) ** (1.0 / exponent) for share in (TAIL, 1.0 - TAIL)]
    words = f"Rosin-Rammler by volume: d' {size / MICROMETRE:.4g} um, exponent {exponent:g}"
    return _cut(ends, part(0), part(1), part(2), words)


def made(recipe: Mapping[str, Sequence[Any]]) -> CrystalSizeDistribution:
    """Make a distribution from the plain values of a study: ``classes``, ``lognormal`` or ``rosin_rammler``, in um.

    Raises
    ------
    CsdError
        If the values are no distribution.
    """
    if "lognormal" in recipe:
        d10, d50, d90 = (size * MICROMETRE for size in recipe["lognormal"])
        return lognormal(d10, d50, d90)
    if "rosin_rammler" in recipe:
        size, exponent = recipe["rosin_rammler"]
        return rosin_rammler(size * MICROMETRE, exponent)
    classes = recipe["classes"]
    return mixture([size * MICROMETRE for size, _ in classes], [fraction for _, fraction in classes])


def _floats(values: ArrayLike) -> FloatArray:
    return np.asarray(values, dtype=np.float64)


def _cut(
    ends: list[float], volume: Cumulative, over_d: Cumulative, over_d2: Cumulative, words: str
) -> CrystalSizeDistribution:
    """Cut a distribution into classes of equal ratio, the first and the last with the tails beyond them."""
    ratio = math.log(ends[1] / ends[0])
    classes = max(FEWEST_CLASSES, math.ceil(ratio / CLASS_STEP))
    edges = np.geomspace(ends[0], ends[1], classes + 1)
    middles = np.sqrt(edges[1:] * edges[:-1])
    with np.errstate(divide="ignore"):
        reach = np.concatenate([[0.0], edges[1:-1], [np.inf]])
        share, first, second = (np.diff(part(reach)) for part in (volume, over_d, over_d2))
    csd = CrystalSizeDistribution.from_classes(middles, share)
    return replace(csd, x_over_d=first, x_over_d2=second, understood=f"{words}; {classes} classes")
