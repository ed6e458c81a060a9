"""How much liquor stays in a cake when gas is sucked or blown through it, and how long a moisture takes.

Everything is in SI units. A share S of the pores is full of liquor (saturation). It falls from 1 to S_inf, where what
is left hangs in no continuous thread, by the design correlation of Wakeman and Tarleton,

``S_inf = 0.155 (1 + 0.031 Nc^-0.49)`` with the capillary number
``Nc = eps^3 d^2 (rho_l g L + dP) / ((1 - eps)^2 L sigma)``, and, where dP is above the threshold pressure
``p_b = 4.6 (1 - eps) sigma / (eps d)`` at which gas enters the pores at all,
``S_R = (S - S_inf) / (1 - S_inf) = 1 / (1 + 1.08 T^0.88)`` up to T = 1.915 and ``1 / (1 + 1.46 T^0.48)`` above, with
the dimensionless time ``T = k dP t / (eps mu L^2 (1 - S_inf))`` and the permeability ``k = 1 / (alpha rho (1 - eps))``.

At T = 1.915 the correlation falls from 0.343 to 0.334; it never rises. It is for T of 0.096 to 204. It is good to about
:data:`SATURATION_ERROR`: a paracetamol cake was measured to keep 0.085 where it says at least 0.155.

Source: R. J. Wakeman and E. S. Tarleton, Solid/Liquid Separation: Principles of Industrial Filtration, Elsevier 2005,
chapter on deliquoring. All functions take arrays, in the values of cake and liquor too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from filtercake.filtration.ranges import FRACTION, NOT_NEGATIVE, POSITIVE, SATURATION, Values, problem, refuse, require
from filtercake.units import GRAVITY, FloatArray

SATURATION_ERROR: Final = 0.1
"""Error of the saturation, either way."""

LEAST_SATURATION: Final = 0.155
"""What stays in the coarsest cake by the correlation."""

KNEE: Final = 1.915
"""Dimensionless time at which one formula hands over to the other."""

TIME_RANGE: Final = (0.096, 204.0)
"""Dimensionless times that the correlation was made for."""

_EARLY: Final = (1.08, 0.88)
_LATE: Final = (1.46, 0.48)


@dataclass(frozen=True)
class WetCake:
    """A cake with full pores, before it is deliquored.

    Attributes
    ----------
    resistance : float
        Specific resistance alpha, m/kg.
    porosity : float
        Porosity eps, in (0, 1).
    density : float
        Density rho of the crystals, kg/m3.
    sauter_mean : float
        Mean diameter d of the crystals by their surface, m.
    height : float
        Height L, m.

    Raises
    ------
    FilterError
        If a value is out of range; names every such value and what is allowed.
    """

    resistance: Values
    porosity: Values
    density: Values
    sauter_mean: Values
    height: Values

    def __post_init__(self) -> None:
        refuse(
            problem("resistance", self.resistance, "m/kg", POSITIVE),
            problem("porosity", self.porosity, "", FRACTION),
            problem("density", self.density, "kg/m3", POSITIVE),
            problem("sauter_mean", self.sauter_mean, "m", POSITIVE),
            problem("height", self.height, "m", POSITIVE),
        )

    @property
    def permeability(self) -> Values:
        """Permeability k to the liquor alone, ``1 / (alpha rho (1 - eps))``, m2."""
        return 1.0 / (self.resistance * self.density * (1.0 - self.porosity))


@dataclass(frozen=True)
class Liquor:
    """The liquor in the cake, and the pressure that drives it out.

    Attributes
    ----------
    pressure_drop : float
        Pressure drop dP of the gas across the cake, Pa.
    viscosity : float
        Viscosity mu, Pa s.
    density : float
        Density rho_l, kg/m3.
    surface_tension : float
        Surface tension sigma, N/m (0.072 for water at 25 C), of a liquor that wets the crystals.

    Raises
    ------
    FilterError
        If a value is out of range; names every such value and what is allowed.
    """

    pressure_drop: Values
    viscosity: Values
    density: Values
    surface_tension: Values

    def __post_init__(self) -> None:
        refuse(
            problem("pressure_drop", self.pressure_drop, "Pa", POSITIVE),
            problem("viscosity", self.viscosity, "Pa s", POSITIVE),
            problem("density", self.density, "kg/m3", POSITIVE),
            problem("surface_tension", self.surface_tension, "N/m", POSITIVE),
        )


def capillary_number(cake: WetCake, liquor: Liquor) -> FloatArray:
    """Capillary number Nc: what drives the liquor over what holds it."""
    driving = liquor.density * GRAVITY * cake.height + liquor.pressure_drop
    holding = (1.0 - cake.porosity) ** 2 * cake.height * liquor.surface_tension
    return np.asarray(cake.porosity**3 * cake.sauter_mean**2 * driving / holding)


def irreducible_saturation(cake: WetCake, liquor: Liquor) -> FloatArray:
    """Saturation S_inf that no time undercuts; at most 1."""
    return np.asarray(np.minimum(LEAST_SATURATION * (1.0 + 0.031 * capillary_number(cake, liquor) ** -0.49), 1.0))


def threshold_pressure(cake: WetCake, liquor: Liquor) -> FloatArray:
    """Pressure drop p_b, Pa, up to which no gas enters the pores."""
    holding = 4.6 * (1.0 - cake.porosity) * liquor.surface_tension
    return np.asarray(holding / (cake.porosity * cake.sauter_mean))


def dimensionless_time(cake: WetCake, liquor: Liquor, time: ArrayLike) -> FloatArray:
    """Dimensionless time T of deliquoring for a time, s; infinite where nothing can leave the cake.

    Raises
    ------
    FilterError
        If the time is negative or not finite.
    """
    seconds = require("time", time, "s", NOT_NEGATIVE)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(seconds > 0.0, seconds / _unit_of_time(cake, liquor), 0.0))


def saturation(cake: WetCake, liquor: Liquor, time: ArrayLike) -> FloatArray:
    """Saturation S after some time of deliquoring, s; 1 where the pressure is not above the threshold.

    Raises
    ------
    FilterError
        If the time is negative or not finite.
    """
    least = irreducible_saturation(cake, liquor)
    left = _reduced(dimensionless_time(cake, liquor, time))
    return np.asarray(np.where(_drains(cake, liquor), least + (1.0 - least) * left, 1.0))


def moisture(cake: WetCake, liquor: Liquor, saturation: ArrayLike) -> FloatArray:
    """Mass of liquor over that of the wet cake, from a saturation in [0, 1].

    Raises
    ------
    FilterError
        If a saturation is out of range.
    """
    full = require("saturation", saturation, "", SATURATION)
    wet = full * cake.porosity * liquor.density
    return np.asarray(wet / (wet + (1.0 - cake.porosity) * cake.density))


def moisture_range(cake: WetCake, liquor: Liquor, saturation: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest moisture within :data:`SATURATION_ERROR` of a saturation.

    Raises
    ------
    FilterError
        If a saturation is out of range.
    """
    middle = require("saturation", saturation, "", SATURATION)
    low, high = np.maximum(middle - SATURATION_ERROR, 0.0), np.minimum(middle + SATURATION_ERROR, 1.0)
    return moisture(cake, liquor, low), moisture(cake, liquor, high)


def time_to_moisture(cake: WetCake, liquor: Liquor, moisture: ArrayLike) -> FloatArray:
    """Time of deliquoring, s, until the wet cake holds a mass fraction of liquor; the inverse of :func:`moisture`.

    0 where full pores hold no more than that, infinite where no time suffices: the irreducible saturation is above it,
    or the pressure not above the threshold.

    Raises
    ------
    FilterError
        If a moisture is not in (0, 1).
    """
    wanted = require("moisture", moisture, "", FRACTION)
    filled = wanted / (1.0 - wanted) * (1.0 - cake.porosity) * cake.density / (cake.porosity * liquor.density)
    least = irreducible_saturation(cake, liquor)
    with np.errstate(divide="ignore", invalid="ignore"):
        left = np.asarray((filled - least) / (1.0 - least))
        time = _time_to_reduced(left) * _unit_of_time(cake, liquor)
    reached = np.where(_drains(cake, liquor) & (left > 0.0), time, np.inf)
    return np.asarray(np.where(filled >= 1.0, 0.0, reached))


def _drains(cake: WetCake, liquor: Liquor) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Whether gas enters the pores, and some liquor can leave them."""
    entering = liquor.pressure_drop > threshold_pressure(cake, liquor)
    return np.asarray(entering & (irreducible_saturation(cake, liquor) < 1.0))


def _unit_of_time(cake: WetCake, liquor: Liquor) -> FloatArray:
    """Time that is 1 in the dimensionless one, s; that of a cake that keeps everything is 0."""
    moving = cake.porosity * liquor.viscosity * cake.height**2 * (1.0 - irreducible_saturation(cake, liquor))
    return np.asarray(moving / (cake.permeability * liquor.pressure_drop))


def _reduced(time: FloatArray) -> FloatArray:
    """Reduced saturation S_R at dimensionless times."""
    early, late = (1.0 / (1.0 + factor * time**power) for factor, power in (_EARLY, _LATE))
    return np.asarray(np.where(time <= KNEE, early, late))


def _time_to_reduced(left: FloatArray) -> FloatArray:
    """Dimensionless time from which the reduced saturation is at most some value, above 0."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        rest = np.maximum(1.0 / left - 1.0, 0.0)
        early, late = ((rest / factor) ** (1.0 / power) for factor, power in (_EARLY, _LATE))
    # between the two formulas' values at the knee, the fall there is when it is reached
    return np.asarray(np.where(early <= KNEE, early, np.maximum(late, KNEE)))
