"""Specific cake resistance from porosity and crystal size distribution: Kozeny-Carman, in two forms."""

from __future__ import annotations

import math

import numpy as np
import scipy

from filtercake.crystals.csd import CrystalSizeDistribution

KOZENY_CARMAN = 180.0
"""Kozeny-Carman constant for spheres (paper, eq. 2)."""


def kozeny_carman(porosity: float, csd: CrystalSizeDistribution, density: float, sphericity: float = 1.0) -> float:
    """Specific cake resistance with additive resistances, m/kg (paper, eq. 3; Bourcier et al. 2016).

    ``alpha = 180 (1 - eps) / (eps^3 psi^2 rho) * sum(x_i / d_i^2)``

    Parameters
    ----------
    porosity : float
        Cake porosity, in (0, 1).
    csd : CrystalSizeDistribution
        The full distribution, not the truncated one.
    density : float
        Crystal density, kg/m3.
    sphericity : float
        Particle sphericity, in (0, 1].

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    return _prefactor(porosity, density, sphericity) * csd.sum_x_over_d2


def carman_sauter(porosity: float, csd: CrystalSizeDistribution, density: float, sphericity: float = 1.0) -> float:
    """Specific cake resistance from the Sauter mean diameter, m/kg (Carman's specific surface).

    Like :func:`kozeny_carman` with ``(sum x_i / d_i)^2`` instead of ``sum(x_i / d_i^2)``; never larger.
    """
    return _prefactor(porosity, density, sphericity) * csd.sum_x_over_d**2


def log_sensitivity(porosity: float) -> float:
    """Relative change of the resistance per unit of porosity, ``d ln(alpha) / d eps``; about -10 at 0.36."""
    return -1.0 / (1.0 - porosity) - 3.0 / porosity


def implied_porosity(resistance: float, csd: CrystalSizeDistribution, density: float, sphericity: float = 1.0) -> float:
    """Porosity at which :func:`kozeny_carman` gives a resistance (m/kg): the one that a measurement implies.

    Raises
    ------
    ValueError
        If an argument is out of range.
    """
    if not (resistance > 0.0 and math.isfinite(resistance)):
        raise ValueError(f"resistance {resistance:g} m/kg is not positive")
    at_half = kozeny_carman(0.5, csd, density, sphericity)
    # (1 - eps)/eps^3 falls from infinity to 0: one root, found in ln(eps/(1 - eps)), where its slope is -3 to -1
    ratio = math.log(resistance) - math.log(at_half)
    farthest = abs(ratio) + 1.0
    root = float(scipy.optimize.brentq(lambda odds: _log_solids_over_cube(odds) - ratio, -farthest, farthest))
    return float(scipy.special.expit(root))


def _log_solids_over_cube(odds: float) -> float:
    """Logarithm of ``(1 - eps) / eps^3`` over its value at one half, from ``ln(eps / (1 - eps))``."""
    return float(3.0 * np.logaddexp(0.0, -odds) - np.logaddexp(0.0, odds)) - math.log(4.0)


def _prefactor(porosity: float, density: float, sphericity: float) -> float:
    if not 0.0 < porosity < 1.0:
        raise ValueError(f"porosity {porosity:g} is not between 0 and 1")
    if not (density > 0.0 and math.isfinite(density)):
        raise ValueError(f"density {density:g} kg/m3 is not positive")
    if not 0.0 < sphericity <= 1.0:
        raise ValueError(f"sphericity {sphericity:g} is not in (0, 1]")
    return KOZENY_CARMAN * (1.0 - porosity) / (porosity**3 * sphericity**2 * density)
