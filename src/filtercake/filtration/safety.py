"""How much more resistance a filter is designed for than was found: the paper's factor beside an interval's own end.

The paper advises a factor of 2 on the specific cake resistance (its section 4.1), since an error of 0.03 in porosity is
35 % of it. Where an interval says how far the resistance is known, its upper end is what the numbers ask for; what
they do not know of (other crystals, another shape, a cake that is compressed) is not in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from filtercake.filtration.ranges import NOT_NEGATIVE, POSITIVE, Values, require
from filtercake.units import FloatArray

PAPER_FACTOR: Final = 2.0
"""Safety factor on the resistance that the paper suggests."""


@dataclass(frozen=True, eq=False)
class DesignResistance:
    """Resistances to design a filter for.

    Attributes
    ----------
    found : ndarray
        Specific cake resistance as it was found, m/kg.
    upper : ndarray
        Upper end of its 95 % interval, m/kg.
    paper : ndarray
        By the paper's factor, m/kg.
    """

    found: FloatArray
    upper: FloatArray
    paper: FloatArray

    @property
    def factor(self) -> FloatArray:
        """Factor from the resistance found to its interval's upper end."""
        return np.asarray(self.upper / self.found)

    def words(self) -> str:
        """Say of one resistance which of the two asks for more."""
        factor = float(self.factor)
        own = f"the 95 % interval ends at {factor:.3g} times the resistance found"
        if factor > PAPER_FACTOR:
            return f"{own}, beyond the paper's factor of {PAPER_FACTOR:g}: design for the interval's end"
        return (
            f"{own}; the paper's factor is {PAPER_FACTOR:g}, which leaves room for what no interval knows of: other "
            "crystals, another shape, compression"
        )


def design_resistance(resistance: Values, *half_widths: Values) -> DesignResistance:
    """Return what to design for, from a resistance (m/kg) and the half-widths of its 95 % intervals (m/kg).

    Half-widths of independent sources, such as packings and law, add as the root of their squares.

    Raises
    ------
    FilterError
        If the resistance is not positive, a half-width is negative, or one is not finite.
    """
    found = require("resistance", resistance, "m/kg", POSITIVE)
    total = np.zeros(found.shape)
    for half_width in half_widths:
        total = np.hypot(total, require("half_width", half_width, "m/kg", NOT_NEGATIVE))
    return DesignResistance(found, np.asarray(found + total), np.asarray(PAPER_FACTOR * found))
