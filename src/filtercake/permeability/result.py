"""What is found of a packing's permeability, and how far it can be trusted."""

from __future__ import annotations

import math
from dataclasses import dataclass

from filtercake.units import FloatArray


@dataclass(frozen=True)
class Level:
    """The flow on one lattice.

    Attributes
    ----------
    across : int
        Nodes along the side of the box.
    diameters_per_spacing : float
        Sauter mean diameter over the spacing.
    permeability : float
        m2.
    convergence : float
        Relative change still to come when it was stopped.
    steps, nodes : int
        Time steps, and fluid nodes.
    """

    across: int
    diameters_per_spacing: float
    permeability: float
    convergence: float
    steps: int
    nodes: int


@dataclass(frozen=True)
class Permeability:
    """Permeability of a packing, and its error budget: relative 95 % half-widths.

    Attributes
    ----------
    permeability : float
        m2, on the finest lattice.
    porosity, sauter_diameter : float
        Of the same slab with the same weights; overlapping spheres are their union, m.
    kozeny_constant : float
        A of ``k = eps^3 D^2 / (A (1 - eps)^2)``, D the Sauter mean diameter.
    resolution, convergence : float
        What the lattice, and stopping, leave open for this very packing.
    slab : float
        How far the constant of one such packing is from that of a large one, by the number of its spheres.
    levels : tuple of Level
        Coarse to fine.
    seconds, memory_bytes : float
        What it took.
    """

    permeability: float
    porosity: float
    sauter_diameter: float
    kozeny_constant: float
    resolution: float
    convergence: float
    slab: float
    levels: tuple[Level, ...]
    seconds: float = 0.0
    memory_bytes: float = 0.0

    @property
    def numerical_ci95(self) -> float:
        """Relative half-width for this very packing."""
        return math.hypot(self.resolution, self.convergence)

    @property
    def relative_ci95(self) -> float:
        """Relative half-width for a large packing of its kind."""
        return math.hypot(self.numerical_ci95, self.slab)

    def resistance(self, density: float) -> float:
        """Specific cake resistance ``1 / (k rho (1 - eps))`` of these spheres, m/kg; density in kg/m3."""
        return 1.0 / (self.permeability * density * (1.0 - self.porosity))


@dataclass(frozen=True)
class Picture:
    """Speed in an upright cut through the middle of the packing.

    Attributes
    ----------
    speed : ndarray, shape (nz, nx)
        Over the superficial velocity; nan in spheres.
    spacing, bottom : float
        Distance of nodes and height of the lowest, m.
    """

    speed: FloatArray
    spacing: float
    bottom: float
