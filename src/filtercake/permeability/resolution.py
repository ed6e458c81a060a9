"""How fine a lattice an accuracy needs, and what it takes: known before any flow is solved."""

from __future__ import annotations

from typing import Final

import numpy as np

from filtercake.units import FloatArray

ACCURACY: Final = 0.02
"""Relative half-width of the numerical error that is asked for by default."""
FINEST_ACCURACY: Final = 0.003
COARSEST_ACCURACY: Final = 0.2
"""The narrowest and the widest that may be asked for."""
PORE_NODES: Final = 0.8
"""Pore radius in nodes of the second lattice at the default accuracy."""
LEVELS: Final = (2, 3, 4, 6)
"""Nodes of the lattices in units of the box; the third and fourth only where the first two differ too much."""
ORDER: Final = 2.0
"""Power of the spacing with which errors fall."""
FEWEST_DIAMETERS: Final = 7.0
"""Nodes per Sauter mean diameter of the second lattice, however wide the pores are."""


def spacing(porosity: float, sauter: float, accuracy: float = ACCURACY) -> float:
    """Return the distance of nodes on the second lattice, m, for a porosity, a Sauter mean (m) and an accuracy."""
    pore_radius = porosity * sauter / (6.0 * (1.0 - porosity))
    widest = min(pore_radius / PORE_NODES, sauter / FEWEST_DIAMETERS)
    return widest * float((accuracy / ACCURACY) ** (1.0 / ORDER))


def bytes_needed(box: FloatArray, distance: float, porosity: float, float_bytes: int = 4) -> float:
    """Memory that a lattice and its flow take, bytes: places of the fluid, and a number for every node of the box."""
    nodes = float(np.prod(box)) / distance**3
    return nodes * porosity * (19 * (float_bytes + 4 + 1) + float_bytes + 4) + nodes * 4
