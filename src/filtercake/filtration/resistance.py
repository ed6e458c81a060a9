"""Specific cake resistance from porosity and crystal size distribution: a registry of laws of the Kozeny-Carman form.

All laws share ``(1 - eps) / (eps^3 psi^2 rho)``; they differ in the mean of the sizes and in the constant. A new law is
one more record in :data:`RESISTANCE_LAWS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import did_you_mean

KOZENY_CARMAN: Final = 180.0
"""Kozeny-Carman constant for spheres (paper, eq. 2)."""
CARMAN_CONSTANT: Final = 170.0
"""Kozeny-Carman constant that goes with the Sauter mean diameter: mean over ten sets of packings (porosity 0.23 to
0.46, size ratio 1 to 15) in which Stokes flow was solved; standard deviation over the sets 6."""
CARMAN_CONSTANT_CI95: Final = 10.0
"""Half-width of the 95 % interval of :data:`CARMAN_CONSTANT` for a packing that was not among them."""

ADDITIVE: Final = "additive"
CARMAN: Final = "carman"
STOKES: Final = "stokes"


class KozenyConstant(NamedTuple):
    """Kozeny constant of packings, from the flow solved in them.

    Attributes
    ----------
    value : float
        The constant K of the law ``stokes``, dimensionless.
    relative_ci95 : float
        Half-width of its 95 % interval over its value; nan where it is not known.
    """

    value: float
    relative_ci95: float = math.nan


@dataclass(frozen=True)
class ResistanceLaw:
    """A law for the specific cake resistance alpha, m/kg.

    Attributes
    ----------
    name : str
        Its key in :data:`RESISTANCE_LAWS` and in study files.
    title : str
        Its name for readers.
    equation : str
        alpha of porosity eps, sphericity psi, crystal density rho, and volume fractions x of the diameters d.
    units : str
        Of what enters and comes out.
    validity : str
        Where it holds.
    accuracy : str
        What was found when it was held against Stokes flow solved in packings.
    source : str
        Where it is from.
    sizes : callable
        The term of the sizes, 1/m2, of a distribution.
    constant : float or None
        Its constant; None where it is solved on the packings, and must be given.
    """

    name: str
    title: str
    equation: str
    units: str
    validity: str
    accuracy: str
    source: str
    sizes: Callable[[CrystalSizeDistribution], float]
    constant: float | None

    @property
    def needs_kozeny_constant(self) -> bool:
        """Whether the law is nothing without a constant solved on the packings."""
        return self.constant is None

    def evaluate(
        self,
        porosity: float,
        csd: CrystalSizeDistribution,
        density: float,
        sphericity: float = 1.0,
        kozeny_constant: float | None = None,
    ) -> float:
        """Specific cake resistance, m/kg (see :func:`resistance`)."""
        return _prefactor(self._constant(kozeny_constant), porosity, density, sphericity) * self.sizes(csd)

    def relative_ci95(self, csd: CrystalSizeDistribution, kozeny_relative_ci95: float = math.nan) -> float:
        """Half-width of the law's own 95 % interval, over the resistance (see :func:`law_relative_ci95`)."""
        if self.constant is None:
            return kozeny_relative_ci95
        own, carman = self.constant * self.sizes(csd), csd.sum_x_over_d**2
        return (abs(own - CARMAN_CONSTANT * carman) + CARMAN_CONSTANT_CI95 * carman) / own

    def _constant(self, given: float | None) -> float:
        constant = given if self.constant is None else self.constant
        if constant is None:
            raise ValueError(f"the law {self.name} needs a kozeny_constant, solved on the packings")
        if not (constant > 0.0 and math.isfinite(constant)):
            raise ValueError(f"kozeny_constant {constant:g} is not positive")
        return constant


def _additive(csd: CrystalSizeDistribution) -> float:
    return csd.sum_x_over_d2


def _sauter(csd: CrystalSizeDistribution) -> float:
    return csd.sum_x_over_d**2


_UNITS = "alpha m/kg; d m; rho kg/m3; eps, psi, x and constants dimensionless"

RESISTANCE_LAWS: Final[dict[str, ResistanceLaw]] = {
    law.name: law
    for law in (
        ResistanceLaw(
            name=ADDITIVE,
            title="eq. 3 (additive)",
            equation=f"alpha = {KOZENY_CARMAN:g} (1 - eps) / (eps^3 psi^2 rho) sum(x / d^2)",
            units=_UNITS,
            validity="creeping flow; layers of one size each in series, and so cakes of one size",
            accuracy="above Stokes flow in packings by 4 to 9 % for one size, 18 to 32 % for 20 and 50 um, 48 % for "
            "the truncated product of a crystallizer, about 60 % for the whole one",
            source="M. Fang and J. D. Ward, eq. 3; Bourcier et al. 2016",
            sizes=_additive,
            constant=KOZENY_CARMAN,
        ),
        ResistanceLaw(
            name=CARMAN,
            title="Carman (Sauter mean)",
            equation=f"alpha = {CARMAN_CONSTANT:g} (1 - eps) / (eps^3 psi^2 rho) (sum(x / d))^2",
            units=_UNITS,
            validity="creeping flow; mixed cakes of spheres, porosity 0.29 to 0.46, width of the sizes up to 1.5",
            accuracy=f"{CARMAN_CONSTANT:g} +- {CARMAN_CONSTANT_CI95:g} (95 %) against Stokes flow in packings, "
            "whatever the width of the distribution",
            source="P. C. Carman 1937, Trans. Inst. Chem. Eng. 15, 150; the constant: Stokes flow solved in packings",
            sizes=_sauter,
            constant=CARMAN_CONSTANT,
        ),
        ResistanceLaw(
            name=STOKES,
            title="Stokes flow in the packings",
            equation="alpha = K (1 - eps) / (eps^3 psi^2 rho) (sum(x / d))^2, K solved on the packings",
            units=_UNITS,
            validity="creeping flow; the packings that K was solved on, any width",
            accuracy="that of the constant",
            source="the Stokes equations",
            sizes=_sauter,
            constant=None,
        ),
    )
}
"""Resistance laws by name."""


def law_of(name: str) -> ResistanceLaw:
    """Return the law of a name.

    Raises
    ------
    ValueError
        If there is none; proposes the nearest.
    """
    try:
        return RESISTANCE_LAWS[name]
    except KeyError:
        known = ", ".join(RESISTANCE_LAWS)
        near = did_you_mean(name, RESISTANCE_LAWS)
        raise ValueError(f"unknown resistance law {name!r}; allowed: {known}{near}") from None


def resistance(
    law: str,
    porosity: float,
    csd: CrystalSizeDistribution,
    density: float,
    sphericity: float = 1.0,
    kozeny_constant: float | None = None,
) -> float:
    """Specific cake resistance by a law, m/kg.

    Parameters
    ----------
    law : str
        A name of :data:`RESISTANCE_LAWS`, whose records say equation, validity, accuracy and source.
    porosity : float
        Cake porosity, in (0, 1).
    csd : CrystalSizeDistribution
        The full distribution, not the truncated one.
    density : float
        Crystal density, kg/m3.
    sphericity : float
        Particle sphericity, in (0, 1].
    kozeny_constant : float, optional
        Constant of ``stokes``; the other laws have their own, and leave it aside.

    Raises
    ------
    ValueError
        If the law is unknown, an argument is out of range, or ``stokes`` has no constant.

    Examples
    --------
    >>> from filtercake.crystals.csd import mixture
    >>> round(resistance("carman", 0.36, mixture([20e-6, 50e-6], [0.5, 0.5]), 1180.0) / 1e9, 4)
    2.4209
    """
    return law_of(law).evaluate(porosity, csd, density, sphericity, kozeny_constant)


def law_relative_ci95(law: str, csd: CrystalSizeDistribution, kozeny_relative_ci95: float = math.nan) -> float:
    """Half-width of the 95 % interval of a law itself, over the resistance that it gives.

    ``carman``: that of its constant. ``additive``: as far as the far end of Carman's interval for the distribution.
    ``stokes``: the one given, of the constant solved on the packings; nan where it is not known.

    Raises
    ------
    ValueError
        If the law is unknown.
    """
    return law_of(law).relative_ci95(csd, kozeny_relative_ci95)


def kozeny_carman(porosity: float, csd: CrystalSizeDistribution, density: float, sphericity: float = 1.0) -> float:
    """Specific cake resistance by the law ``additive``, m/kg (paper, eq. 3): :func:`resistance` with its arguments."""
    return resistance(ADDITIVE, porosity, csd, density, sphericity)


def carman_sauter(porosity: float, csd: CrystalSizeDistribution, density: float, sphericity: float = 1.0) -> float:
    """Specific cake resistance by Carman's form with the paper's constant, 180, m/kg.

    Like :func:`kozeny_carman` with ``(sum x_i / d_i)^2`` instead of ``sum(x_i / d_i^2)``; never larger.
    """
    return resistance(STOKES, porosity, csd, density, sphericity, KOZENY_CARMAN)


def log_sensitivity(porosity: float) -> float:
    """Relative change of the resistance per unit of porosity, ``d ln(alpha) / d eps``; about -10 at 0.36."""
    return -1.0 / (1.0 - porosity) - 3.0 / porosity


def implied_porosity(
    resistance: float,
    csd: CrystalSizeDistribution,
    density: float,
    sphericity: float = 1.0,
    law: str = ADDITIVE,
    kozeny_constant: float | None = None,
) -> float:
    """Porosity at which a law gives a resistance (m/kg): the one that a measurement implies.

    The other arguments are those of :func:`resistance`.

    Raises
    ------
    ValueError
        If an argument is out of range, the law is unknown, or ``stokes`` has no constant.
    """
    from scipy import optimize, special

    if not (resistance > 0.0 and math.isfinite(resistance)):
        raise ValueError(f"resistance {resistance:g} m/kg is not positive")
    at_half = law_of(law).evaluate(0.5, csd, density, sphericity, kozeny_constant)
    # (1 - eps)/eps^3 falls from infinity to 0: one root, found in ln(eps/(1 - eps)), where its slope is -3 to -1
    ratio = math.log(resistance) - math.log(at_half)
    farthest = abs(ratio) + 1.0
    root = float(optimize.brentq(lambda odds: _log_solids_over_cube(odds) - ratio, -farthest, farthest))
    return float(special.expit(root))


def _log_solids_over_cube(odds: float) -> float:
    """Logarithm of ``(1 - eps) / eps^3`` over its value at one half, from ``ln(eps / (1 - eps))``."""
    return float(3.0 * np.logaddexp(0.0, -odds) - np.logaddexp(0.0, odds)) - math.log(4.0)


def _prefactor(constant: float, porosity: float, density: float, sphericity: float) -> float:
    if not 0.0 < porosity < 1.0:
        raise ValueError(f"porosity {porosity:g} is not between 0 and 1")
    if not (density > 0.0 and math.isfinite(density)):
        raise ValueError(f"density {density:g} kg/m3 is not positive")
    if not 0.0 < sphericity <= 1.0:
        raise ValueError(f"sphericity {sphericity:g} is not in (0, 1]")
    return constant * (1.0 - porosity) / (porosity**3 * sphericity**2 * density)
