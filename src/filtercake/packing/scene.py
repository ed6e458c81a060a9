"""What one packing is made of: everything that decides its outcome, in SI units, and how it is run."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import shown
from filtercake.packing import contact_law
from filtercake.packing.cloud import NARROW, PLACEMENT_HEIGHT, box_length
from filtercake.packing.similarity import SIMULATED_MODULUS, strength_of_adhesion
from filtercake.units import GRAVITY

SPREAD: Final = 0.0026
"""Standard deviation of one packing's porosity at ``SPREAD_PARTICLES`` spheres."""
SPREAD_PARTICLES: Final = 2000
GRAVITY_PROTOCOL, FILTRATION_PROTOCOL = "gravity", "filtration"
"""Spheres that fall onto a floor, as in the paper; a cake pressed as in a filter (:mod:`filtercake.packing.cell`)."""
PROTOCOLS: Final = (GRAVITY_PROTOCOL, FILTRATION_PROTOCOL)
OF_FILTRATION: Final = ("protocol", "pressure", "adhesion", "crystal_modulus")
"""What only pressed cakes have: it is not named where nothing is pressed."""
CELL_VOID_FRACTION: Final = 0.65
"""Void fraction of the cloud that a cell is pressed from; a denser one packs denser with friction."""
INCIDENTAL: Final = ("processes", "time_limit", "write_vtk")
"""What does not decide a packing: it stands whatever these become."""
_KINDS: Final = {"int": (int,), "float": (int, float), "str": (str,), "bool": (bool,)}


@dataclass(frozen=True, eq=False)
class Scene:
    """One point of a study as an engine sees it; two scenes are equal when they make the same packings.

    Attributes
    ----------
    csd : CrystalSizeDistribution
        The (truncated) distribution that is packed.
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
    bed_depth_factor : float
        How many times deeper than the paper's the bed is, in units of its box side.
    processes : int
        MPI processes or threads for one packing; 0 lets the engine choose by size.
    time_limit : float
        Wall-clock limit of one packing, s; 0 for none.
    write_vtk : bool
        Whether to keep pictures of the settling for ParaView.
    protocol : {"gravity", "filtration"}
        Whether the spheres fall, or are pressed.
    pressure : float
        Real pressure drop across a pressed cake, Pa.
    adhesion : float
        Real work of adhesion of pressed crystals, J/m2; 0 where ``cohesion`` says how they stick.
    crystal_modulus : float
        Young's modulus of real crystals under that pressure, Pa; those that are simulated have ``youngs_modulus``.
    """

    csd: CrystalSizeDistribution
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
    bed_depth_factor: float = 1.0
    processes: int = 0
    time_limit: float = 0.0
    write_vtk: bool = False
    protocol: str = GRAVITY_PROTOCOL
    pressure: float = 0.0
    adhesion: float = 0.0
    crystal_modulus: float = 0.0

    def __eq__(self, other: object) -> bool:
        """Whether both make the same packings."""
        return isinstance(other, Scene) and self.decisive() == other.decisive()

    def __hash__(self) -> int:
        """Hash of what decides the packing."""
        return hash(digest(self.decisive()))

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Scene:
        """Build a scene from plain values: all or the decisive ones, to the last bit.

        Raises
        ------
        CsdError, OverflowError, TypeError, ValueError
            If a value is missing, unknown, or not of its kind.
        """
        given = dict(values)
        try:
            size, share = (np.array(given.pop(name), dtype=np.float64) for name in ("size", "volume_fraction"))
        except KeyError as error:
            raise ValueError(f"{error.args[0]} is missing") from None
        for field in fields(cls)[1:]:
            value = given.get(field.name, field.default)
            if type(value) not in _KINDS[str(field.type)] or not (isinstance(value, str) or math.isfinite(value)):
                raise ValueError(f"{field.name} = {shown(value)}: must be a finite {field.type}")
        checked = CrystalSizeDistribution.from_classes(size, share)
        # not the checked one, whose fractions are normalised anew: the last digits decide the cloud
        exact = np.array_equal(checked.size, size)
        return cls(CrystalSizeDistribution(size, share) if exact else checked, **given)

    def decisive(self) -> dict[str, Any]:
        """Return all that decides the packing, as plain values: the point's name, key and reruns follow from it."""
        left_out = ("csd", *INCIDENTAL, *(() if self.is_pressed else OF_FILTRATION))
        numbers = {name: value for name, value in vars(self).items() if name not in left_out}
        return {**numbers, "size": self.csd.size.tolist(), "volume_fraction": self.csd.volume_fraction.tolist()}

    def incidental(self) -> dict[str, Any]:
        """Return what does not decide the packing, as plain values."""
        return {name: getattr(self, name) for name in INCIDENTAL}

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return {**self.decisive(), **self.incidental()}

    def as_packed(self) -> Scene:
        """Return the scene whose packings serve this one.

        One pressed cell is led through all loads, so that only the kind of attraction counts for it, not how strong it
        is or how high the pressure (:mod:`filtercake.packing.compression`).
        """
        if not self.is_pressed:
            return self
        kind = self.attraction
        one = replace(
            self,
            youngs_modulus=SIMULATED_MODULUS,
            cohesion=float(kind == "cohesion"),
            adhesion=float(kind == "adhesion"),
            pressure=1.0,
            crystal_modulus=1.0,
            bed_depth_factor=1.0,
            initial_void_fraction=CELL_VOID_FRACTION,
            settling_velocity=0.0,
            skin=0.0,
        )
        return one.with_time_step(self.rayleigh_fraction)

    @property
    def is_pressed(self) -> bool:
        """Whether the packing is a cake pressed as in a filter."""
        return self.protocol == FILTRATION_PROTOCOL

    @property
    def attraction(self) -> str:
        """How the crystals stick: ``none``, ``cohesion`` (SJKR) or ``adhesion`` (size-true pull-off)."""
        if self.adhesion > 0.0:
            return "adhesion"
        return "cohesion" if self.cohesion > 0.0 else "none"

    @property
    def strength(self) -> float:
        """Stress that the real contacts hold, p_c, Pa: of two crystals as large as the Sauter mean."""
        if self.attraction == "adhesion":
            return strength_of_adhesion(self.adhesion, self.csd.sauter_mean)
        return contact_law.cohesive_strength(self.cohesion, self.youngs_modulus, self.poisson_ratio)

    @property
    def load_over_strength(self) -> float:
        """Pressure over what the contacts hold, x = p/p_c; infinite without attraction."""
        return self.pressure / self.strength if self.strength > 0.0 else math.inf

    @property
    def rayleigh_time_step(self) -> float:
        """Rayleigh time step of the smallest sphere, s."""
        return contact_law.rayleigh_time_step(
            0.5 * self.csd.smallest, self.density, self.youngs_modulus, self.poisson_ratio
        )

    @property
    def rayleigh_fraction(self) -> float:
        """Time step over the Rayleigh time step of the smallest sphere."""
        return self.time_step / self.rayleigh_time_step

    def with_time_step(self, rayleigh_fraction: float) -> Scene:
        """Return the same scene at a time step given over the Rayleigh time step of its smallest sphere."""
        return replace(self, time_step=rayleigh_fraction * self.rayleigh_time_step)

    @property
    def relative_overlap(self) -> float:
        """Equilibrium overlap of equal spheres over their diameter."""
        return contact_law.relative_overlap(self.cohesion, self.youngs_modulus, self.poisson_ratio)

    @property
    def expected_spread(self) -> float:
        """Standard deviation of one packing's porosity, roughly: it falls with the root of the number of spheres."""
        return SPREAD * math.sqrt(SPREAD_PARTICLES / self.particles)

    @property
    def pull_off_over_weight(self) -> float:
        """Pull-off force of two of the smallest spheres over the weight of one."""
        radius = 0.5 * self.csd.smallest
        force = contact_law.pull_off_force(self.cohesion, self.youngs_modulus, self.poisson_ratio, radius, radius)
        return force / (self.density * 4.0 / 3.0 * math.pi * radius**3 * GRAVITY)

    @property
    def strength_over_load(self) -> float:
        """Cohesive strength of the contacts over the solids stress half way down the bed."""
        strength = contact_law.cohesive_strength(self.cohesion, self.youngs_modulus, self.poisson_ratio)
        solids = self.particles * self.csd.mean_particle_volume
        return strength / (0.5 * self.density * GRAVITY * solids / self.box_length**2)

    @property
    def is_wide(self) -> bool:
        """Whether the distribution is so broad that its bed and neighbour lists are another matter."""
        return self.csd.largest > NARROW * self.csd.smallest

    @property
    def box_length(self) -> float:
        """Side of the periodic box, m."""
        return box_length(self.csd, self.particles, self.initial_void_fraction, self.bed_depth_factor)

    @property
    def cloud_height(self) -> float:
        """Height of the region the spheres start in, m."""
        return PLACEMENT_HEIGHT * self.bed_depth_factor * self.box_length

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
