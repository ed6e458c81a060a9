"""Size distributions from number densities: those of other programs, and those of crystallizer models.

Crystals are as many as the number density n(L) says, and of volumes that grow as L^3, so that volume, surface and
length of a range of sizes are the integrals of L^3 n, L^2 n and L n over it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from filtercake.crystals.crystallizer import BIN_WIDTH, UPPER_SCALES
from filtercake.crystals.csd import MOST_CLASSES, CrystalSizeDistribution, discretise
from filtercake.errors import CrystallizerError, CsdError
from filtercake.units import MICROMETRE, FloatArray

ROUNDING: Final = 1e-9
"""A negative density, over the largest, that is the rounding of the program that made it."""

CumulativeMoments = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Integrals of L n, L^2 n and L^3 n from 0 up to sizes (m), shape (n,) each."""


def from_number_density(size: ArrayLike, number_density: ArrayLike) -> CrystalSizeDistribution:
    """Make a distribution from a number density on a grid of sizes, as population balance programs give it.

    The density is taken as constant over each cell, whose edges lie half-way to the neighbours, and each class adds to
    the sums of x/d and x/d^2 what its cell does. From PharmaPy: ``from_number_density(1e-6 * x_distrib, distrib)``, for
    one time of a result, or the state of a slurry or solid phase (its sizes are in um).

    Parameters
    ----------
    size : array_like, shape (n,)
        Sizes, m; ascending, from 0 or above, 2 or more.
    number_density : array_like, shape (n,)
        Crystals per size and per whatever volume or mass, in any unit: only the shape counts.

    Raises
    ------
    CsdError
        If the arrays do not fit together, the sizes do not ascend, or a density is negative.
    """
    sizes, density = (np.atleast_1d(np.asarray(values, dtype=np.float64)) for values in (size, number_density))
    _check_grid(sizes, density)
    middles = 0.5 * (sizes[1:] + sizes[:-1])
    first, last = max(0.0, 2.0 * sizes[0] - middles[0]), 2.0 * sizes[-1] - middles[-1]
    edges = np.concatenate(([first], middles, [last]))
    number = np.maximum(density, 0.0)
    length, surface, volume = (number * np.diff(edges**power) / power for power in (2, 3, 4))
    total = volume.sum()
    if not total > 0.0:
        raise CsdError("number_density: the crystals have no volume; at least one density must be positive")
    filled = volume > 0.0
    at = np.where(sizes > 0.0, sizes, 0.5 * (edges[1:] + edges[:-1]))[filled]
    csd = CrystalSizeDistribution.from_classes(at, volume[filled] / total)
    return replace(csd, x_over_d=surface[filled] / total, x_over_d2=length[filled] / total)


def cut_moments(
    cumulative: CumulativeMoments, whole_volume: float, size_scale: float, bin_width: float = BIN_WIDTH
) -> CrystalSizeDistribution:
    """Cut a continuous product into classes, up to where as much of its volume is left as in an MSMPR product.

    Parameters
    ----------
    cumulative : callable
        Integrals of L n, L^2 n and L^3 n up to sizes.
    whole_volume : float
        Integral of L^3 n over all sizes.
    size_scale : float
        Some size of the product, m, to start the search for its end from.
    bin_width : float
        Wanted width of the classes, m.

    Raises
    ------
    CrystallizerError
        If the width is not positive or asks for more than :data:`~filtercake.crystals.instruments.MOST_CLASSES`.
    CsdError
        If a class is wider than the largest size.
    """
    if not 0.0 < bin_width < np.inf:
        raise CrystallizerError(f"bin_width = {bin_width:g} m: must be positive and finite")
    upper = _end(lambda size: float(cumulative(np.array([size]))[2][0]) / whole_volume, size_scale)
    if upper > MOST_CLASSES * bin_width:
        raise CrystallizerError(
            f"bin_width = {bin_width:g} m: the sizes go up to {upper / MICROMETRE:.4g} um; "
            f"at most {MOST_CLASSES} classes are allowed"
        )

    def volume(size: FloatArray) -> FloatArray:
        # rounding may have a sum fall by its last digit
        return np.maximum.accumulate(cumulative(size)[2] / whole_volume)

    def sums(size: FloatArray) -> tuple[FloatArray, FloatArray]:
        length, surface, _ = cumulative(size)
        return surface / whole_volume, length / whole_volume

    return discretise(volume, upper, bin_width, sums)


def _end(share_below: Callable[[float], float], start: float) -> float:
    """Size with the volume above it that an MSMPR product has above its largest class."""
    from scipy import optimize, special

    target = float(special.gammainc(4.0, UPPER_SCALES))

    def beyond(log_size: float) -> float:
        return share_below(start * math.exp(log_size)) - target

    for reach in (4.0, 16.0, 64.0):
        if beyond(-reach) < 0.0 < beyond(reach):
            return start * math.exp(float(optimize.brentq(beyond, -reach, reach, xtol=1e-12)))
    raise CrystallizerError(
        f"the product has no end near a size of {start / MICROMETRE:.4g} um; check the residence time, the kinetics "
        "and the sizes of fines and coarse crystals"
    )


def _check_grid(sizes: FloatArray, density: FloatArray) -> None:
    if sizes.shape != density.shape or sizes.ndim != 1:
        raise CsdError(f"{sizes.size} sizes but {density.size} number densities; must be as many, in one dimension")
    if sizes.size < 2:
        raise CsdError(f"{sizes.size} sizes: a number density needs at least 2")
    if not (np.isfinite(sizes).all() and sizes[0] >= 0.0 and (np.diff(sizes) > 0.0).all()):
        raise CsdError("size: must be finite, ascend, and start at 0 or above, in m")
    bad = density[~np.isfinite(density)]
    if not bad.size:
        bad = density[density < -ROUNDING * np.abs(density).max()]
    if bad.size:
        raise CsdError(f"number_density = {bad[0]:g}: must be finite and not negative")
