"""LIGGGHTS's ``units micro``: the only place where micrometres, microseconds and picograms appear as such.

SI makes particle volumes underflow the code's tolerances (paper, section 4.1).
"""

from __future__ import annotations

from typing import Final

LENGTH: Final = 1e-6
"""um in m."""
TIME: Final = 1e-6
"""us in s."""
MASS: Final = 1e-15
"""pg in kg."""
# written out, not computed from the three above: 50 kJ/m3 must be 50, not 49.999999999999993
VELOCITY: Final = 1.0
"""um/us in m/s."""
DENSITY: Final = 1e3
"""pg/um3 in kg/m3."""
ACCELERATION: Final = 1e6
"""um/us2 in m/s2."""
PRESSURE: Final = 1e3
"""pg/(um us2) in Pa; Young's modulus and cohesion energy density alike."""
ENERGY: Final = 1e-15
"""pg um2/us2 in J."""


def number(value: float) -> str:
    """Text of a float that LIGGGHTS reads back to the same bits."""
    return f"{value:.17g}"
