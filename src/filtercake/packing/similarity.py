"""From a filter's pressure and a crystal's surface to a cell that can be computed, and back.

At rest the structure of a packing depends on the sizes, the friction, and two ratios alone: the stress over the stress
``p_c`` that the contacts' adhesion holds, ``x = p/p_c``, and the stress over the effective modulus, ``p/E*``. A crystal
of a few GPa would need time steps of nanoseconds. A softer one packs alike if stress and adhesion are scaled with the
modulus, as long as it stays in the limit of rigid spheres, where ``p/E*`` no longer matters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from filtercake.errors import CellError
from filtercake.packing import contact_law

SIMULATED_MODULUS: Final = 5e6
"""Young's modulus of the simulated crystals, Pa."""
LARGEST_LOAD: Final = 3e-4
"""Stress over E* up to which spheres count as rigid."""
LARGEST_STRENGTH: Final = 1e-5
"""Stress that adhesion holds over E* up to which spheres count as rigid."""
LEAST_LOAD: Final = 1.0
"""Load x = p/p_c under which a packing depends on how it was made."""
ROUNDING: Final = 1e-9
"""Share by which a limit may be exceeded: a strength that was computed by way of a cohesion."""


@dataclass(frozen=True)
class Similar:
    """What is simulated for a real crystal under a real pressure.

    Attributes
    ----------
    scale : float
        Simulated modulus, stress and strength over the real ones.
    youngs_modulus : float
        Simulated Young's modulus, Pa.
    stress : float
        Simulated stress, Pa.
    cohesion : float
        Simulated cohesion energy density, J/m3.
    adhesion : float
        Simulated work of adhesion, J/m2, of the same strength between spheres of the diameter given: the real one times
        ``scale``. NaN without a diameter. A cell takes the one or the other.
    strength : float
        Stress that the real contacts hold, p_c, Pa.
    load_over_strength : float
        x = p/p_c, the same in both; infinite without adhesion.
    load_over_modulus : float
        p/E*, the same in both.
    """

    scale: float
    youngs_modulus: float
    stress: float
    cohesion: float
    adhesion: float
    strength: float
    load_over_strength: float
    load_over_modulus: float


def similar(
    pressure: float,
    youngs_modulus: float,
    *,
    poisson_ratio: float = 0.2,
    strength: float = 0.0,
    diameter: float | None = None,
    simulated_modulus: float = SIMULATED_MODULUS,
) -> Similar:
    """Scale a real crystal under a real pressure to one that can be computed.

    Parameters
    ----------
    pressure : float
        Real solids stress, Pa; at the medium of a filter its pressure drop.
    youngs_modulus : float
        Young's modulus of the crystal, Pa.
    poisson_ratio : float
        Poisson's ratio, the same in both.
    strength : float
        Stress that the real contacts hold, Pa: :func:`strength_of_adhesion` or
        :func:`filtercake.packing.contact_law.cohesive_strength`.
    diameter : float, optional
        Diameter of the spheres that hold it, best the Sauter mean, m; for the adhesion alone.
    simulated_modulus : float
        Young's modulus that is simulated, Pa.

    Raises
    ------
    CellError
        If a value makes no sense, or stress or strength leave the limit of rigid spheres.
    """
    for name, value in (
        ("pressure", pressure),
        ("youngs_modulus", youngs_modulus),
        ("simulated_modulus", simulated_modulus),
    ):
        if not (math.isfinite(value) and value > 0.0):
            raise CellError(f"{name} = {value:g} Pa: must be a finite number above 0")
    if not (math.isfinite(strength) and strength >= 0.0):
        raise CellError(f"strength = {strength:g} Pa: must be a finite number, 0 or above")
    if diameter is not None:
        _check_diameter(diameter)
    if not 0.0 <= poisson_ratio <= 0.5:
        raise CellError(f"poisson_ratio = {poisson_ratio:g}: must be 0 to 0.5")
    modulus = contact_law.effective_modulus(youngs_modulus, poisson_ratio)
    check_rigid(pressure, strength, modulus)
    scale = simulated_modulus / youngs_modulus
    return Similar(
        scale,
        simulated_modulus,
        scale * pressure,
        contact_law.cohesion_of_strength(scale * strength, simulated_modulus, poisson_ratio),
        math.nan if diameter is None else contact_law.adhesion_of_strength(scale * strength, diameter),
        strength,
        pressure / strength if strength > 0.0 else math.inf,
        pressure / modulus,
    )


def strength_of_adhesion(adhesion: float, diameter: float) -> float:
    """Stress that a real surface's work of adhesion (J/m2) holds between spheres of a diameter (m), Pa.

    A cell with adhesion has JKR's pull-off between all sizes. One with cohesion of this strength has it at this
    diameter alone, best the Sauter mean: its pull-off grows with the square of the size, the real one with the size.
    """
    if not (math.isfinite(adhesion) and adhesion >= 0.0):
        raise CellError(f"adhesion = {adhesion:g} J/m2: must be a finite number, 0 or above")
    _check_diameter(diameter)
    return contact_law.adhesive_strength(adhesion, diameter)


def _check_diameter(diameter: float) -> None:
    if not (math.isfinite(diameter) and diameter > 0.0):
        raise CellError(f"diameter = {diameter:g} m: must be a finite number above 0")


def check_rigid(stress: float, strength: float, modulus: float) -> None:
    """Refuse a stress, or a strength of the contacts, that presses spheres out of shape.

    Parameters
    ----------
    stress, strength : float
        Stress, and stress that the contacts hold, Pa.
    modulus : float
        Effective modulus E*, Pa.

    Raises
    ------
    CellError
        With the value and what is allowed.
    """
    for name, value, limit in (("stress", stress, LARGEST_LOAD), ("strength", strength, LARGEST_STRENGTH)):
        if not value <= limit * modulus * (1.0 + ROUNDING):
            raise CellError(
                f"{name} = {value:.4g} Pa, {value / modulus:.2g} of E* = {modulus:.4g} Pa: must be at most {limit:g} "
                f"of it, {limit * modulus:.4g} Pa (the limit of rigid spheres)"
            )
