"""LIGGGHTS's unit systems: the only place where micrometres, microseconds and picograms appear as such.

SI makes particle volumes underflow the code's tolerances (paper, section 4.1): ``units micro`` is what is used, SI is
there to be stress-tested.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class UnitSystem:
    """Units of a LIGGGHTS deck, each in SI.

    Attributes
    ----------
    name : str
        LIGGGHTS's word for it.
    length, time, mass, velocity, density, acceleration, pressure, energy : float
        Its units; pressure is also that of Young's modulus and cohesion energy density.
    """

    name: str
    length: float
    time: float
    mass: float
    velocity: float
    density: float
    acceleration: float
    pressure: float
    energy: float


# written out, not computed from length, time and mass: 50 kJ/m3 must be 50, not 49.999999999999993
MICRO: Final = UnitSystem(
    name="micro",
    length=1e-6,
    time=1e-6,
    mass=1e-15,
    velocity=1.0,
    density=1e3,
    acceleration=1e6,
    pressure=1e3,
    energy=1e-15,
)
"""um, us and pg."""
SI: Final = UnitSystem("si", *[1.0] * 8)


def number(value: float) -> str:
    """Text of a float that LIGGGHTS reads back to the same bits."""
    return f"{value:.17g}"
