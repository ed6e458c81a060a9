"""When soft spheres under a low stress pack as crystals do under a filter's pressure.

At rest the structure of a packing depends on the sizes, the friction, and two ratios alone: the stress over the stress
``p_c`` that the contacts' adhesion holds, ``x = p/p_c``, and the stress over the effective modulus, ``p/E*``. A crystal
of a few GPa would need time steps of nanoseconds. A softer one packs alike if stress and adhesion are scaled with the
modulus, as long as it stays in the limit of rigid spheres, where ``p/E*`` no longer matters.
"""

from __future__ import annotations

import math
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


def strength_of_adhesion(adhesion: float, diameter: float) -> float:
    """Stress that a real surface's work of adhesion (J/m2) holds between spheres of a diameter (m), Pa.

    A cell with adhesion has JKR's pull-off between all sizes. One with cohesion of this strength has it at this
    diameter alone, best the Sauter mean: its pull-off grows with the square of the size, the real one with the size.
    """
    if not (math.isfinite(adhesion) and adhesion >= 0.0):
        raise CellError(f"adhesion = {adhesion:g} J/m2: must be a finite number, 0 or above")
    if not (math.isfinite(diameter) and diameter > 0.0):
        raise CellError(f"diameter = {diameter:g} m: must be a finite number above 0")
    return contact_law.adhesive_strength(adhesion, diameter)


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
