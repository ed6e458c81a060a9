"""The pressure cell: spheres in a box periodic in all directions, brought to a stress and to rest.

A cake is packed by the pressure of filtration, from a slurry in which no crystal ever falls freely. So nothing falls
here: a random cloud at rest in a viscous fluid is squeezed by a servo on the sides of its box, without gravity, floor
or surface, until its contacts carry the stress asked for. Contacts are those of the embedded engine. The stress is
isotropic, or that along z, where only this side gives way, as in a filter.

The structure depends on the sizes, the friction and two ratios alone, stress over the contacts' strength and stress
over their stiffness (:mod:`filtercake.packing.similarity`), and hardly on the second where that is small: porosities
are corrected to rigid spheres.
"""

from __future__ import annotations

import json
import math
import time
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import CellError, TimeLimitReached
from filtercake.packing import contact_law
from filtercake.packing.cloud import class_radii, place_spheres
from filtercake.packing.result import publish
from filtercake.packing.scene import CELL_VOID_FRACTION
from filtercake.packing.settling import TYPICAL_SOLIDS
from filtercake.packing.similarity import LARGEST_LOAD, check_rigid
from filtercake.units import FloatArray

if TYPE_CHECKING:
    from filtercake.packing.cell_box import CellBox

Report = Callable[[str], None]

STATE_SECONDS: Final = 60.0
"""Time between two states that are kept of a long run."""
PROGRESS_SECONDS: Final = 20.0
"""Time between two lines about a long run."""
CHECK_STEPS: Final = 500
"""Time steps between two looks at the cell."""
WINDOW_STEPS: Final = 4000
"""Time steps over which the porosity must have stopped changing and the forces must have come into balance."""
STRESS_TOLERANCE: Final = 3e-3
FORCE_TOLERANCE: Final = 3e-3
"""Mean force left on a sphere over the mean force of a contact."""
BALANCED: Final = 1e-5
"""Such a ratio that need not fall any more."""
POROSITY_TOLERANCE: Final = 2e-5
"""Change of porosity within the window."""
ANISOTROPY_LIMIT: Final = 6.0
"""Largest deviation of the stress from an isotropic one, over the stress, times the root of the number of spheres.

Spheres count by their surface, as forces grow with it: a few coarse ones among many fine ones carry most of the stress.

The largest of 26 cells with friction 0.3 had 3.2, of cells without friction 1.7.
"""
FRICTIONLESS_STEP, FRICTIONAL_STEP = 0.5, 0.2
"""Time step over Rayleigh's."""


@dataclass(frozen=True, eq=False)
class CellScene:
    """One pressure cell; SI.

    Attributes
    ----------
    radius : ndarray, shape (n,)
        Radii, m, the largest first.
    stress : float
        Stress to be reached, Pa, isotropic or along z, at the modulus below.
    density : float
        Crystal density, kg/m3.
    friction, restitution : float
        Coefficients of friction and restitution.
    cohesion : float
        Cohesion energy density of SJKR, J/m3: a contact pulls off at a force that grows with R*^2.
    adhesion : float
        Work of adhesion W, J/m2, at the modulus below, instead of cohesion: a contact pulls off at ``1.5 pi W R*``,
        whatever its overlap (:func:`filtercake.packing.contact_law.adhesive_force`).
    youngs_modulus, poisson_ratio : float
        Young's modulus, Pa, and Poisson's ratio.
    seed : int
        Seed of the initial cloud.
    void_fraction : float
        Void fraction of the initial cloud.
    drag : float
        Drag over mass, in units of ``sqrt(p/rho)/D`` with the Sauter mean D: 1 to 2. Without it cells with friction
        depend on how they were made.
    servo : float
        Fastest rate at which the box's volume changes, in the same unit. Three times the default halves the steps
        and packs friction 0.3 denser by 0.003.
    time_step_rayleigh : float
        Time step over Rayleigh's of the smallest sphere; 0 chooses by friction.
    mass_scaling : bool
        Whether spheres smaller than D move as if they weighed ``(D/d)^2`` times as much: the same packing in fewer,
        longer time steps for a wide distribution.
    patience : int
        Time steps after which a cell that is not at rest is given up.
    uniaxial : bool
        Whether the box gives way along z only, to ``stress`` along z; across it the stress is what the spheres pass on.
    """

    radius: FloatArray
    stress: float
    density: float
    friction: float = 0.0
    restitution: float = 0.3
    cohesion: float = 0.0
    adhesion: float = 0.0
    youngs_modulus: float = 5e6
    poisson_ratio: float = 0.2
    seed: int = 1
    void_fraction: float = CELL_VOID_FRACTION
    drag: float = 2.0
    servo: float = 1e-2
    time_step_rayleigh: float = 0.0
    mass_scaling: bool = False
    patience: int = 150_000
    uniaxial: bool = False

    def __post_init__(self) -> None:
        """Refuse what no cell can be made of, and what leaves the rigid limit."""
        for name, (low, high, allowed) in _ALLOWED.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise CellError(f"{name} = {value:g}: must be {allowed}")
        if self.adhesion > 0.0 and self.cohesion > 0.0:
            raise CellError(
                f"adhesion = {self.adhesion:g} J/m2: must be 0 where there is cohesion, here {self.cohesion:g} J/m3"
            )
        radius = self.radius
        if radius.ndim != 1 or radius.size < 2 or not (np.isfinite(radius).all() and (radius > 0.0).all()):
            raise CellError(f"radius = array of shape {radius.shape}: must be at least two finite numbers above 0")
        if (np.diff(radius) > 0.0).any():
            raise CellError("radius = not sorted: must begin with the largest")
        check_rigid(self.stress, self.strength, self.modulus)

    @classmethod
    def from_csd(cls, csd: CrystalSizeDistribution, particles: int, **others: Any) -> CellScene:
        """Take ``particles`` spheres from a distribution, with exact class counts; the rest as above."""
        return cls(radius=class_radii(csd, particles), **others)

    @property
    def modulus(self) -> float:
        """Effective modulus E*, Pa."""
        return contact_law.effective_modulus(self.youngs_modulus, self.poisson_ratio)

    @property
    def strength(self) -> float:
        """Stress p_c that the contacts hold, Pa; under adhesion, those of spheres of the Sauter mean."""
        if self.adhesion > 0.0:
            return contact_law.adhesive_strength(self.adhesion, self.sauter_mean)
        return contact_law.cohesive_strength(self.cohesion, self.youngs_modulus, self.poisson_ratio)

    @property
    def sauter_mean(self) -> float:
        """Sauter mean diameter D of the spheres, m."""
        return 2.0 * float(np.sum(self.radius**3) / np.sum(self.radius**2))

    @property
    def solids(self) -> float:
        """Volume of the spheres, m3."""
        return 4.0 / 3.0 * math.pi * float(np.sum(self.radius**3))

    @property
    def cloud_sides(self) -> FloatArray:
        """Sides of the cloud's box, m, shape (3,): a cube, or what will be about one once it is pressed along z."""
        volume = self.solids / (1.0 - self.void_fraction)
        slender = TYPICAL_SOLIDS / (1.0 - self.void_fraction) if self.uniaxial else 1.0
        side = (volume / slender) ** (1.0 / 3.0)
        return np.array([side, side, slender * side])

    def held(self, look: Look) -> float:
        """Stress that the servo holds, Pa."""
        return float(look.stress[2, 2]) if self.uniaxial else look.pressure

    @property
    def rate(self) -> float:
        """Unit of rates ``sqrt(p/rho)/D``, 1/s."""
        return math.sqrt(self.stress / self.density) / self.sauter_mean

    @property
    def heaviness(self) -> FloatArray:
        """Mass with which each sphere moves over its own, shape (n,)."""
        if not self.mass_scaling:
            return np.ones(self.radius.size)
        return np.maximum(1.0, (0.5 * self.sauter_mean / self.radius) ** 2)

    @property
    def time_step(self) -> float:
        """Time step, s."""
        unit = contact_law.rayleigh_time_step(1.0, self.density, self.youngs_modulus, self.poisson_ratio)
        share = self.time_step_rayleigh or (FRICTIONAL_STEP if self.friction > 0.0 else FRICTIONLESS_STEP)
        return share * unit * float((self.radius * np.sqrt(self.heaviness)).min())


_ABOVE = (5e-324, 1e300, "a finite number above 0")
_NOT_BELOW = (0.0, 1e300, "a finite number, 0 or above")
_ALLOWED: Final = {
    "stress": _ABOVE,
    "density": _ABOVE,
    "friction": (0.0, 10.0, "0 to 10"),
    "restitution": (1e-3, 1.0, "0.001 to 1"),
    "cohesion": _NOT_BELOW,
    "adhesion": _NOT_BELOW,
    "youngs_modulus": _ABOVE,
    "poisson_ratio": (0.0, 0.5, "0 to 0.5"),
    "void_fraction": (0.55, 0.99, "0.55 to 0.99"),
    "drag": (0.0, 100.0, "0 to 100"),
    "servo": (1e-5, 0.3, "0.00001 to 0.3"),
    "time_step_rayleigh": (0.0, 0.9, "0 to 0.9"),
    "patience": (1, 10**9, "1 to 1e9"),
}


@dataclass(frozen=True)
class Look:
    """What one look at a cell finds.

    Attributes
    ----------
    step : int
        Time steps since the cloud.
    stress : ndarray, shape (3, 3)
        Stress of the contacts, Pa, compression positive.
    porosity, rigid_porosity : float
        Of the spheres as they overlap (each counted whole), and corrected to rigid ones.
    coordination : float
        Mean number of contacts of a sphere.
    overlap : float
        Mean overlap of the contacts over the sum of the radii.
    force_ratio : float
        Mean force left on a sphere over the mean force of a contact; infinite without contacts.
    """

    step: int
    stress: FloatArray
    porosity: float
    rigid_porosity: float
    coordination: float
    overlap: float
    force_ratio: float

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Look:
        """Build a look from its plain values."""
        return cls(**{**values, "stress": np.array(values["stress"], dtype=np.float64)})

    @property
    def pressure(self) -> float:
        """Mean normal stress, Pa."""
        return float(np.trace(self.stress)) / 3.0

    @property
    def anisotropy(self) -> float:
        """Largest deviation of an element of the stress from an isotropic one, over the mean normal stress."""
        pressure = self.pressure
        return float(np.abs(self.stress - pressure * np.eye(3)).max()) / pressure if pressure > 0.0 else math.inf


@dataclass(frozen=True)
class PressedCell:
    """A cell as it came out.

    Attributes
    ----------
    position : ndarray, shape (n, 3)
        Centres in the box, m, in the order of the scene's radii.
    radius : ndarray, shape (n,)
        Radii, m.
    length, height : float
        Sides of the box along x and y, and along z, m; different only where it was pressed along z.
    last : Look
        What was found at the end: stress, porosities, coordination, balance.
    steps : int
        Time steps since the cloud, or the stress before.
    wall_time : float
        Time that they took, s.
    reasons : tuple of str
        Why it is not accepted; empty when it is.
    """

    position: FloatArray
    radius: FloatArray
    length: float
    height: float
    last: Look
    steps: int
    wall_time: float
    reasons: tuple[str, ...]

    @property
    def sides(self) -> FloatArray:
        """Sides of the box, m, shape (3,)."""
        return np.array([self.length, self.length, self.height])

    @property
    def accepted(self) -> bool:
        """Whether it is a packing under the stress asked for."""
        return not self.reasons


def press(scene: CellScene) -> PressedCell:
    """Squeeze a cell until it is at rest under its stress, or patience ends.

    Raises
    ------
    CellError
        If the box is or becomes too narrow for its largest sphere.
    CloudError
        If the spheres find no free place.
    EngineError
        If the cell explodes.
    """
    return press_along(scene, [scene.stress])[0]


def press_along(scene: CellScene, stresses: Sequence[float]) -> list[PressedCell]:
    """Lead one cell from stress to stress, to rest at each: how a cake is compressed.

    Parameters
    ----------
    scene : CellScene
        What is asked for; ``patience`` is that at each stress.
    stresses : sequence of float
        Stresses, Pa, instead of the scene's; each at most about twice the one before, and the first, with friction,
        at most four times what the contacts hold.

    Returns
    -------
    list of PressedCell
        One for each stress; it ends with the first that is not accepted.

    Raises
    ------
    CellError, CloudError, EngineError
        As :func:`press`; CellError for a stress that no cell can have.
    """
    if not stresses:
        raise CellError("stresses = (none): must be at least one")
    return press_through([replace(scene, stress=stress) for stress in stresses])


def press_through(
    stages: Sequence[CellScene],
    *,
    state_file: Path | None = None,
    time_limit: float = 0.0,
    progress: Report = lambda _: None,
) -> list[PressedCell]:
    """Lead one cell through scenes that differ in stress and attraction only, to rest in each.

    At rest only their ratio counts, so that a weaker cohesion or adhesion under the same stress is a higher load.

    Parameters
    ----------
    stages : sequence of CellScene
        The scenes.
    state_file : Path, optional
        Keeps the state of a long run, which goes on from there, to the last bit, when it was stopped.
    time_limit : float
        Wall-clock limit, s, with what was spent before; 0 for none.
    progress : callable
        Receives a line now and then.

    Raises
    ------
    CellError, CloudError, EngineError
        As :func:`press`; EngineError also when the time limit is reached.
    """
    return _Run(stages, state_file, time_limit, progress).finish()


class _Run:
    """A cell on its way through its scenes, with what it must remember to go on."""

    def __init__(self, stages: Sequence[CellScene], state_file: Path | None, time_limit: float, progress: Report):
        """Start from the cloud, or from the state file where it holds a state of this cell."""
        self.stages, self.state_file, self.time_limit, self.progress = stages, state_file, time_limit, progress
        self.found: list[PressedCell] = []
        self.before, self.started = 0.0, time.monotonic()
        self.saved = self.reported = self.started
        self.box = self._fresh()
        self.first, self.looks = 0, [self.box.look()]
        self._resume()

    @property
    def spent(self) -> float:
        """Wall time so far, s."""
        return self.before + time.monotonic() - self.started

    def finish(self) -> list[PressedCell]:
        """Lead the cell through the scenes that are left."""
        while len(self.found) < len(self.stages):
            self._rest()
            if not self.found[-1].accepted:
                break
            if len(self.found) < len(self.stages):
                self.box.lead_to(self.stages[len(self.found)])
                self.first, self.looks = self.box.step, [self.box.look()]
        return self.found

    def _rest(self) -> None:
        """Advance the cell until it is at rest under its stress, or patience ends."""
        box, scene, since = self.box, self.box.scene, self.spent
        end = self.first + scene.patience
        while unrest(scene, self.looks) and box.step < end:
            box.advance(min(CHECK_STEPS, end - box.step))
            self.looks = [*self.looks, box.look()][-1 - WINDOW_STEPS // CHECK_STEPS :]
            self._watch()
        position, last = box.positions(), self.looks[-1]
        reasons = (*unrest(scene, self.looks), *refusals(scene, last, position, box.sides))
        steps, spent = box.step - self.first, self.spent - since
        self.found.append(PressedCell(position, scene.radius, box.length, box.height, last, steps, spent, reasons))

    def _watch(self) -> None:
        """Stop at the time limit; save and report now and then."""
        now = time.monotonic()
        if 0.0 < self.time_limit < self.spent:
            self._save()
            raise TimeLimitReached(self.time_limit)
        if now - self.saved > STATE_SECONDS:
            self._save()
        if now - self.reported > PROGRESS_SECONDS:
            self.reported, last = now, self.looks[-1]
            self.progress(
                f"load {len(self.found) + 1} of {len(self.stages)}, step {self.box.step:,}: "
                f"porosity {last.rigid_porosity:.4f}, force ratio {last.force_ratio:.1g}"
            )

    def _fresh(self) -> CellBox:
        # who plans a study need not wait for the compiler
        from filtercake.packing.cell_box import CellBox

        scene = self.stages[0]
        sides = scene.cloud_sides
        cloud = place_spheres(scene.radius, float(sides[0]), float(sides[2]), scene.seed, periodic=True)
        return CellBox(scene, cloud, sides)

    def _save(self) -> None:
        self.saved = time.monotonic()
        if self.state_file is None:
            return
        past: dict[str, Any] = {f"position_{k}": cell.position for k, cell in enumerate(self.found)}
        plain = {
            "first": self.first,
            "spent": self.spent,
            "looks": [_plain(look) for look in self.looks],
            "found": [[cell.length, cell.height, _plain(cell.last), cell.steps, cell.wall_time] for cell in self.found],
        }
        with publish(self.state_file) as temporary, temporary.open("wb") as stream:
            np.savez(stream, plain=json.dumps(plain), **past, **self.box.saved())

    def _resume(self) -> None:
        """Go on from the state file; one that cannot be read, or is of another cell, is passed over."""
        if self.state_file is None or not self.state_file.exists():
            return
        try:
            with np.load(self.state_file) as data:
                plain = json.loads(str(data["plain"]))
                self.found = [
                    PressedCell(
                        data[f"position_{k}"], self.stages[k].radius, length, height, Look.of(last), steps, spent, ()
                    )
                    for k, (length, height, last, steps, spent) in enumerate(plain["found"])
                ]
                self.box.lead_to(self.stages[len(self.found)])
                self.box.restore({name: data[name] for name in data.files})
            self.first, self.before = int(plain["first"]), float(plain["spent"])
            self.looks = [Look.of(values) for values in plain["looks"]]
            self.progress(f"resumed at load {len(self.found) + 1} of {len(self.stages)}, step {self.box.step:,}")
        except (OSError, EOFError, ValueError, KeyError, IndexError, TypeError, zipfile.BadZipFile):
            self.box, self.found, self.first, self.before = self._fresh(), [], 0, 0.0
            self.looks = [self.box.look()]


def _plain(look: Look) -> dict[str, Any]:
    return {**vars(look), "stress": look.stress.tolist()}


def unrest(scene: CellScene, looks: list[Look]) -> list[str]:
    """Say why a cell is not yet at rest under its stress; nothing when it is.

    Parameters
    ----------
    scene : CellScene
        What is asked for.
    looks : list of Look
        All looks so far, ``CHECK_STEPS`` apart.
    """
    last, window = looks[-1], looks[-1 - WINDOW_STEPS // CHECK_STEPS :]
    found = []
    held = scene.held(last)
    off = (held - scene.stress) / scene.stress
    if not abs(off) < STRESS_TOLERANCE:
        found.append(
            f"stress {held:.4g} Pa after {last.step:,} steps: must be within {STRESS_TOLERANCE:g} "
            f"of {scene.stress:.4g} Pa"
        )
    balanced = last.force_ratio < FORCE_TOLERANCE and (last.force_ratio < max(window[0].force_ratio, BALANCED))
    if not balanced:
        found.append(
            f"mean net over mean contact force {last.force_ratio:.2g}, {window[0].force_ratio:.2g} "
            f"{last.step - window[0].step:,} steps before: must be below {FORCE_TOLERANCE:g} and falling"
        )
    moved = max(look.porosity for look in window) - min(look.porosity for look in window)
    if last.step - window[0].step < WINDOW_STEPS or not moved < POROSITY_TOLERANCE:
        found.append(
            f"porosity changed by {moved:.2g} in the last {last.step - window[0].step:,} steps: "
            f"must be below {POROSITY_TOLERANCE:g} in {WINDOW_STEPS:,}"
        )
    return found


def refusals(scene: CellScene, last: Look, position: FloatArray, sides: FloatArray | float) -> list[str]:
    """Say why a cell at rest is no packing under the stress asked for; nothing when it is one.

    Parameters
    ----------
    scene : CellScene
        What is asked for.
    last : Look
        What was found at the end.
    position : ndarray, shape (n, 3)
        Centres, m.
    sides : ndarray, shape (3,), or float
        Sides of the box, m.
    """
    found = []
    if position.shape != (scene.radius.size, 3) or not ((position >= 0.0) & (position < sides)).all():
        found.append(f"{scene.radius.size} spheres were put in, and not all are in the box")
    held = scene.held(last)
    if not held / scene.modulus <= 1.01 * LARGEST_LOAD:
        found.append(
            f"stress over E* = {held / scene.modulus:.2g}: must be at most {LARGEST_LOAD:g} "
            "(the limit of rigid spheres)"
        )
    area = scene.radius**2
    limit = ANISOTROPY_LIMIT * math.sqrt(float(np.sum(area**2))) / float(np.sum(area))
    if not (scene.uniaxial or last.anisotropy <= limit):
        found.append(
            f"stress deviates by {last.anisotropy:.2g} of itself from an isotropic one: must be at most {limit:.2g}"
        )
    return found
