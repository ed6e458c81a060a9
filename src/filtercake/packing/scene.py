"""What one packing is made of: everything that decides its outcome, in SI units, and nothing else."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from filtercake.packing import contact_law
from filtercake.units import GRAVITY


@dataclass(frozen=True)
class PackingSpec:
    """One point of a study as an engine sees it (the crystal size distribution travels beside it).

    Attributes
    ----------
    particles : int
        Number of spheres N.
    initial_void_fraction : float
        Void fraction of the initial cloud.
    settling_velocity : float
        Initial downward speed of every sphere, m/s.
    density : float
        Crystal density, kg/m3.
    youngs_modulus : float
        Young's modulus, Pa.
    poisson_ratio, restitution, friction : float
        Poisson's ratio, coefficient of restitution, coefficient of friction.
    cohesion : float
        Cohesion energy density, J/m3.
    time_step : float
        Integration time step, s.
    engine : str
        Name of the packing engine.
    seed : int
        Base seed; clouds follow from it, the distribution, N, the void fraction and the replicate.
    porosity_tolerance : float
        The bed is at rest when its porosity falls by less than this per check.
    max_fall_times : float
        Give up (unsettled) after this many free-fall times of the highest sphere.
    skin : float
        Neighbour skin, m; 0 lets the engine choose.
    processes : int
        MPI processes for one packing; 0 lets the engine choose by size.
    time_limit : float
        Wall-clock limit of one packing, s; 0 for none.
    bed_depth_factor : float
        How many times deeper than the paper's the bed is, in units of its box side.
    write_vtk : bool
        Whether to keep pictures of the settling for ParaView.
    """

    particles: int
    initial_void_fraction: float
    settling_velocity: float
    density: float
    youngs_modulus: float
    poisson_ratio: float
    restitution: float
    friction: float
    cohesion: float
    time_step: float
    engine: str
    seed: int = 1
    porosity_tolerance: float = 1e-4
    max_fall_times: float = 4.0
    skin: float = 0.0
    processes: int = 0
    time_limit: float = 0.0
    bed_depth_factor: float = 1.0
    write_vtk: bool = False

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> PackingSpec:
        """Build a spec from plain values, e.g. a rule's params."""
        return cls(**values)

    def as_dict(self) -> dict[str, Any]:
        """Plain Python values, fit for JSON and rule params."""
        return asdict(self)

    def rayleigh_fraction(self, smallest_diameter: float) -> float:
        """Time step over the Rayleigh time step of the smallest sphere (m)."""
        return self.time_step / contact_law.rayleigh_time_step(
            0.5 * smallest_diameter, self.density, self.youngs_modulus, self.poisson_ratio
        )

    def free_fall_time(self, height: float) -> float:
        """Time a sphere needs from ``height`` (m) to the floor, s."""
        v0 = self.settling_velocity
        return (math.sqrt(v0**2 + 2.0 * GRAVITY * height) - v0) / GRAVITY


def digest(*parts: Any) -> str:
    """SHA-256 of JSON-able parts; the same on every machine and Python version."""
    text = json.dumps(parts, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def stage_seed(*parts: Any) -> int:
    """Seed (63 bits) of one random stage, from the hash of everything that identifies it."""
    return int(digest(*parts)[:16], 16) >> 1
