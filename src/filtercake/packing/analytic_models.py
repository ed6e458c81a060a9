"""Analytic packing models: the porosity of a crystal size distribution in milliseconds, without DEM.

Baselines for the simulated porosity. All take spheres that only fill space (no cohesion, no friction, no drop height)
and depend on the ratios of the sizes alone. Two are told the porosity eps0 of equal spheres and say how much a spread
of sizes lowers it; Farr & Groot give the frictionless close packing, which a settled bed should not go under.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.units import FloatArray

GAP_FACTOR: Final = 0.7654
"""Smallest gap between two rods over the length of the shorter one (Farr & Groot 2009): equal spheres fill 0.6435."""

RODS: Final = 10_000
"""Rods that stand for a distribution; see :func:`farr_groot` for what that resolves."""


def ouchiyama_tanaka(csd: CrystalSizeDistribution, eps0: float = 0.375) -> float:
    """Porosity of a random packing by Ouchiyama & Tanaka, the model the paper compares itself with.

    Each sphere, among neighbours of the mean size, owns its core and a share 1/n of the shell up to their centres. With
    f the number fractions, Dm the number mean and ``<x> = max(x, 0)``,

    ``1 - eps = sum D^3 f / sum {<D-Dm>^3 + [(D+Dm)^3 - <D-Dm>^3] / n} f``

    ``n = 1 + (4/13)(7 - 8 eps0) Dm sum {(D+Dm)^2 [1 - (3/8) Dm/(D+Dm)] f} / sum {[D^3 - <D-Dm>^3] f}``

    Equal spheres return eps0.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The distribution; only the ratios of its sizes matter.
    eps0 : float
        Porosity of equal spheres, in (0, 1); the paper (eq. 15) takes 0.375 in a filter many spheres wide.

    Returns
    -------
    float
        Porosity, dimensionless; never above eps0 if eps0 is at least 1/3 (below, a trace of fines raises it slightly).

    Raises
    ------
    ValueError
        If eps0 is out of range.

    Notes
    -----
    Range: narrow and moderately wide distributions. Every sphere is surrounded by spheres of the number-mean size, so
    that a trace of fines moves the result (alum: 0.240 whole, 0.304 without the classes under 0.1 vol%), and at
    extreme size ratios it falls below eps0^2, the limit of perfect mixing.

    Accuracy: 0.013 to 0.025 under settled frictionless DEM beds of 20/50 um spheres, about 0.006 over that of alum.

    Source: Ouchiyama & Tanaka, Ind. Eng. Chem. Fundam. 23 (1984) 490-493.
    """
    _check_eps0(eps0)
    size, number = csd.size / csd.largest, csd.number_fraction
    mean = float(number @ size)
    # a sphere larger than the mean has a core that no neighbour's shell reaches
    core = np.maximum(size - mean, 0.0) ** 3
    reach = (size + mean) ** 2 * (1.0 - 0.375 * mean / (size + mean))
    sharing = 1.0 + 4.0 / 13.0 * (7.0 - 8.0 * eps0) * mean * float(number @ reach) / float(number @ (size**3 - core))
    owned = core + ((size + mean) ** 3 - core) / sharing
    return 1.0 - float(number @ size**3) / float(number @ owned)


def yu_zou_standish(csd: CrystalSizeDistribution, eps0: float = 0.40) -> float:
    """Porosity by the linear packing model of Yu, Zou & Standish, with the interaction functions of 1996.

    If class i carries the packing, coarser spheres replace its bulk and finer ones fill its voids, each less perfectly
    the nearer the sizes. With x the volume fractions, ``V0 = 1/(1 - eps0)`` and r the smaller size over the larger,

    ``V_i = V0 - sum_{j coarser} x_j (V0 - 1) g(r) - sum_{j finer} x_j V0 f(r)``, ``eps = 1 - 1/max_i V_i``

    ``f(r) = (1-r)^3.3 + 2.8 r (1-r)^2.7`` (filling), ``g(r) = (1-r)^2 + 0.4 r (1-r)^3.7`` (occupation)

    Equal spheres return eps0; two sizes of infinite ratio at their best composition return eps0^2.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The distribution; only the ratios of its sizes matter.
    eps0 : float
        Porosity of equal spheres, in (0, 1): 0.36 for close, 0.40 for loose (poured) packing.

    Returns
    -------
    float
        Porosity, dimensionless, in (0, eps0].

    Raises
    ------
    ValueError
        If eps0 is out of range.

    Notes
    -----
    Range: any distribution. V_i is linear in the fractions, so that the minimum over the composition of two sizes is a
    corner, where one class takes over from the other.

    Accuracy: with eps0 0.40, 0.009 to 0.037 under settled frictionless DEM beds of 20/50 um spheres and about 0.04
    over that of alum; with 0.36, 0.048 to 0.073 under and on it: no one eps0 suits both.

    Source: Yu, Zou & Standish, Ind. Eng. Chem. Res. 35 (1996) 3730-3741.
    """
    _check_eps0(eps0)
    size, volume = csd.size, csd.volume_fraction
    ratio = np.minimum.outer(size, size) / np.maximum.outer(size, size)
    rest = 1.0 - ratio
    filling = rest**3.3 + 2.8 * ratio * rest**2.7
    occupation = rest**2 + 0.4 * ratio * rest**3.7
    alone = 1.0 / (1.0 - eps0)
    # row i: the class that carries the packing; column j: the others (both functions are 0 at ratio 1)
    coarser = size[np.newaxis, :] > size[:, np.newaxis]
    saved = np.where(coarser, (alone - 1.0) * occupation, alone * filling) @ volume
    return 1.0 - 1.0 / float(np.max(alone - saved))


def farr_groot(csd: CrystalSizeDistribution, rods: int = RODS) -> float:
    """Porosity of frictionless close packing by Farr & Groot, from packing rods on a line.

    A line through the packing cuts each sphere with a chance proportional to D^2 into a rod of length l < D with the
    density ``2 l / D^2``. The rods are laid on a periodic line, the longest first, each into the largest gap, keeping
    ``0.7654 min(l_i, l_j)`` between any two; a largest gap that is too short is widened by what is missing. Then

    ``eps = 1 - sum(l) / length of the line``.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The distribution; only the ratios of its sizes matter.
    rods : int
        Number of rods, at least 1, at equidistant quantiles of the length distribution: no random numbers.

    Returns
    -------
    float
        Porosity, dimensionless; 0.3565 for equal spheres.

    Raises
    ------
    ValueError
        If ``rods`` is not positive.

    Notes
    -----
    Range: any distribution whose coarse end is cut into some ten rods or more. Convergence: the default is within 1e-4
    of 100 000 rods for size ratios up to 100 and for alum (500 rods for ratios up to 10). At a ratio of 1000 it is
    within 1e-3 if the coarse spheres hold 40 % of the volume, and 0.005 if they hold less and are one rod or none.

    Accuracy: the authors find it to agree with simulated close packings of two and three sizes and of log-normal
    distributions, and to have the right limits at large size ratios. It is a floor for settled beds: they lie 0.053 to
    0.066 above (20/50 um spheres, frictionless DEM) and about 0.016 above (alum).

    Source: Farr & Groot, J. Chem. Phys. 131 (2009) 244104.
    """
    if rods < 1:
        raise ValueError(f"{rods} rods: at least one is needed")
    lengths: list[float] = _chords(csd, rods)[::-1].tolist()
    # Laid down longest first, the next rod is always the shorter neighbour and so sets both gaps beside it. Keeping
    # one of them as short as allowed leaves the rest of the old gap in one piece. Negative, as heapq finds the least.
    gaps = [-GAP_FACTOR * lengths[0]]
    for length in lengths[1:]:
        least = GAP_FACTOR * length
        largest = -heapq.heapreplace(gaps, -least)
        heapq.heappush(gaps, -max(largest - length - least, least))
    empty = -sum(gaps)
    return empty / (empty + sum(lengths))


PEERS: Final[dict[str, Callable[[CrystalSizeDistribution], float]]] = {
    "Ouchiyama-Tanaka, eps0 0.375": partial(ouchiyama_tanaka, eps0=0.375),
    "Yu-Zou-Standish, eps0 0.36": partial(yu_zou_standish, eps0=0.36),
    "Yu-Zou-Standish, eps0 0.40": partial(yu_zou_standish, eps0=0.40),
    "Farr-Groot": farr_groot,
}
"""The models with the parameters that a benchmark compares, by readable name; a new peer is one line here."""


def _chords(csd: CrystalSizeDistribution, count: int) -> FloatArray:
    """Lengths at equidistant quantiles of the chords of a random line, in units of the largest sphere, ascending.

    The weight D^2 of a sphere cancels against its chords' density 2 l / D^2, so that the density of l^2 is proportional
    to the number of spheres larger than l: constant between class sizes, and its integral exactly invertible.
    """
    squares = np.concatenate([[0.0], (csd.size / csd.largest) ** 2])
    larger = np.cumsum(csd.number_fraction[::-1])[::-1]
    cumulative = np.concatenate([[0.0], np.cumsum(larger * np.diff(squares))])
    quantiles = (np.arange(count) + 0.5) / count * cumulative[-1]
    return np.asarray(np.sqrt(np.interp(quantiles, cumulative, squares)))


def _check_eps0(eps0: float) -> None:
    if not 0.0 < eps0 < 1.0:
        raise ValueError(f"porosity of equal spheres eps0 = {eps0:g} is not between 0 and 1")
