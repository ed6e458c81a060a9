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
VELOCITY: Final = LENGTH / TIME
DENSITY: Final = MASS / LENGTH**3
ACCELERATION: Final = LENGTH / TIME**2
PRESSURE: Final = MASS / (LENGTH * TIME**2)
"""Young's modulus and cohesion energy density alike: 1 pg/(um us2) = 1000 Pa."""
ENERGY: Final = MASS * VELOCITY**2


def number(value: float) -> str:
    """Text of a float that LIGGGHTS reads back to the same bits."""
    return f"{value:.17g}"
