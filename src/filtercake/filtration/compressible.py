"""Cakes whose porosity falls with the stress in them: averages from the surface to the medium, and the exponent.

The solids stress rises from nothing at the surface to the pressure drop at the medium, by the drag of the filtrate.
Where the local resistance ``alpha(p)`` is known, a constant-pressure cake has ``alpha_av = dP / int_0^dP dp / alpha``
(B. F. Ruth, Ind. Eng. Chem. 27 (1935) 708; F. M. Tiller, Chem. Eng. Prog. 49 (1953) 467).

Every law of resistance here depends on the porosity as ``(1 - eps)/eps^3``, so the average over the cake is that of an
even cake of one porosity, and the exponent does not depend on the law.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from filtercake.units import FloatArray

POINTS_PER_DECADE: Final = 120
"""Loads at which a cake is cut."""

PorosityOfLoad = Callable[[FloatArray], FloatArray]
"""Porosities at loads; constant below the smallest, 1."""


@dataclass(frozen=True)
class CakeAverage:
    """A cake under its pressure drop.

    Attributes
    ----------
    porosity : float
        Porosity of the even cake that has the same resistance.
    porosity_at_medium : float
        Porosity at the medium, under the whole pressure drop.
    exponent : float
        Compressibility ``n = d ln alpha_av / d ln dP`` at this pressure drop; 0 for an incompressible cake.
    """

    porosity: float
    porosity_at_medium: float
    exponent: float


@dataclass(frozen=True, eq=False)
class CakeProfile:
    """Porosity through a cake.

    Attributes
    ----------
    height : ndarray, shape (n,)
        Height over the medium, over the cake's thickness: from 1 at the surface to 0.
    porosity : ndarray, shape (n,)
        Porosity there.
    """

    height: FloatArray
    porosity: FloatArray


def cake_average(load: float, porosity: PorosityOfLoad) -> CakeAverage:
    """Average a cake from its surface to the medium.

    Parameters
    ----------
    load : float
        Pressure drop over the stress that the contacts hold, x; at least 1, infinite without attraction.
    porosity : callable
        Porosity at an array of loads. Under x = 1, where a structure depends on how it was made, the porosity counts
        as that at 1; that part of the cake carries 1/x of the pressure drop.

    Raises
    ------
    ValueError
        If the load is below 1 or no number.
    """
    loads, local = _cut(load, porosity)
    if loads.size == 1:
        return CakeAverage(float(local[0]), float(local[0]), 0.0)
    resistance = shape(local)
    average = float(loads[-1] / _integral(loads, 1.0 / resistance)[-1])
    return CakeAverage(_porosity_of(average), float(local[-1]), float(1.0 - average / resistance[-1]))


def cake_profile(load: float, porosity: PorosityOfLoad) -> CakeProfile:
    """Porosity against the height in a cake; the parameters are those of :func:`cake_average`."""
    loads, local = _cut(load, porosity)
    depth = _integral(loads, 1.0 / (shape(local) * (1.0 - local)))
    depth, local = np.append(0.0, depth), np.append(local[0], local)
    return CakeProfile(1.0 - depth / depth[-1], local)


def _cut(load: float, porosity: PorosityOfLoad) -> tuple[FloatArray, FloatArray]:
    """Cut a cake at loads from 1 to that of the medium, with their porosities; once without attraction: all is even."""
    if not load >= 1.0 - 1e-9:
        raise ValueError(f"load = {load:g}: must be at least 1")
    if math.isinf(load):
        return np.array([1.0]), porosity(np.array([load]))
    count = 2 + math.ceil(POINTS_PER_DECADE * math.log10(max(load, 1.0)))
    loads = np.geomspace(1.0, max(load, 1.0), count)
    return loads, porosity(loads)


def _integral(loads: FloatArray, values: FloatArray) -> FloatArray:
    """Integral of values over the stress from 0 to each load, the first value also below the first load."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(loads)
    return np.asarray(values[0] * loads[0] + np.append(0.0, np.cumsum(steps)))


def shape(porosity: FloatArray) -> FloatArray:
    """``(1 - eps)/eps^3``: how every law's resistance depends on the porosity."""
    return np.asarray((1.0 - porosity) / porosity**3)


def _porosity_of(value: float) -> float:
    """Porosity in (0, 1) with this ``(1 - eps)/eps^3``: the real root of a cubic."""
    # eps^3 + eps/value - 1/value = 0 has one real root (Cardano)
    half = 0.5 / value
    root = math.sqrt(half**2 + (1.0 / (3.0 * value)) ** 3)
    return math.cbrt(half + root) + math.cbrt(half - root)
