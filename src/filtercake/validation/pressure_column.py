"""Columns of spheres under raised gravity, by LIGGGHTS: what the pressure cell is held against.

A bed settles in a viscous fluid that keeps it from any impact. Then gravity is raised until the stress of the bed's own
weight, straight from nothing at its surface to the highest at its floor, passes the loads at which cells were pressed.
Between two loads lies a slice of the bed, of which the mean load is known from the weight above alone: the periodic
sides carry nothing, and the drag that is left is looked at. Its porosity is that of whole spheres, corrected to rigid
ones as a cell's is.
"""

from __future__ import annotations

import itertools
import math
import os
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from filtercake.errors import CloudError, EngineError, EngineMissing
from filtercake.packing import contact_law
from filtercake.packing.contacts import Contacts, find_contacts
from filtercake.packing.engines import micro
from filtercake.packing.engines.base import SettleRequest
from filtercake.packing.engines.liggghts import Liggghts
from filtercake.packing.pack import settle
from filtercake.packing.porosity import volume_below
from filtercake.packing.result import SettledState
from filtercake.packing.scene import Scene
from filtercake.packing.slab import MARGIN_DIAMETERS, bed_height
from filtercake.units import GRAVITY, FloatArray

EDGES: Final = (2.0, 4.0, 7.0, 13.0)
"""Loads x = p/p_c between which slices lie."""
SLICES: Final = tuple(0.5 * (low + high) for low, high in itertools.pairwise(EDGES))
"""Mean loads of the slices."""
FLOOR_LOAD: Final = 15.0
"""Load on the floor: the slices stay a largest diameter away from it."""
RISE: Final = 2.0
"""Largest factor from one gravity to the next."""
RISE_TIME: Final = 10.0
"""Time for which a column stays at a gravity, in units of ``D/sqrt(p/rho)`` with the stress p on the floor."""
DRAG: Final = 2.0
"""Drag over mass, in one over the same unit, as the cell's; p is that of the last slice."""
IMPACT: Final = 0.1
"""Stress of an impact of spheres that settle, ``rho v^2``, over what the contacts hold."""
CHECK_STEPS: Final = 4000
"""Time steps between two looks at a column."""
HEIGHT_TOLERANCE: Final = 3e-5
"""Relative change of its mean height in between, at rest; of its porosity, two thirds of that."""
CALM_CHECKS: Final = 1
MOST_CHECKS: Final = 100
"""Looks that must find it at rest, and after which it counts as unsettled: drag and floor tell."""
GRID: Final = 2001
"""Heights at which the weight above is taken; it is smooth in between."""
BALANCE: Final = 3e-3
"""Share of the weight that drag may carry at the end, and by which the floor's contacts may miss the weight."""


@dataclass(frozen=True, eq=False)
class Column:
    """A bed that settles, and the load x on its floor to which gravity is raised.

    Attributes
    ----------
    scene : Scene
        The bed, with cohesion; its seed decides the cloud.
    load : float
        Stress on the floor over what the contacts hold.
    """

    scene: Scene
    load: float = FLOOR_LOAD

    @property
    def strength(self) -> float:
        """Stress p_c that the contacts hold, Pa."""
        return self.scene.strength

    def rate(self, load: float) -> float:
        """Work out the unit of rates ``sqrt(p/rho)/D`` at a load x, 1/s."""
        return math.sqrt(load * self.strength / self.scene.density) / self.scene.csd.sauter_mean

    def without_impact(self) -> Column:
        """Return the same column, whose spheres settle at a speed that does nothing."""
        return replace(self, scene=replace(self.scene, settling_velocity=self.settling_speed))

    @property
    def settling_speed(self) -> float:
        """Speed, m/s, whose impacts do nothing."""
        return math.sqrt(IMPACT * self.strength / self.scene.density)

    def gravity(self, load: float, radius: FloatArray, length: float) -> float:
        """Gravity, m/s2, under which spheres (radii in m) in a box of side ``length`` (m) load the floor by x."""
        mass = self.scene.density * 4.0 / 3.0 * math.pi * float(np.sum(radius**3))
        return load * self.strength * length**2 / mass

    def loads(self) -> list[float]:
        """List the loads on the floor to which gravity is raised, one after the other."""
        count = math.ceil(math.log(self.load, RISE))
        return [self.load * RISE ** (k - count) for k in range(count + 1)]


class ColumnEngine(Liggghts):
    """LIGGGHTS with the deck of a column; the bed it returns stands under the last gravity."""

    template = "column.in.j2"

    def __init__(self, column: Column):
        """Create the engine of one column."""
        super().__init__()
        self.column = column

    def _deck_values(self, request: SettleRequest) -> dict[str, Any]:
        scene, column, units = request.scene, self.column, self.units
        radius = request.cloud.radius
        mass = scene.density * 4.0 / 3.0 * np.pi * radius**3
        bounds = np.flatnonzero(np.diff(radius, prepend=np.inf, append=-np.inf))
        mass = mass[bounds[:-1]]

        def stage(gravity: float, rate: float, steps: int) -> dict[str, Any]:
            return {
                "gravity": micro.number(gravity / units.acceleration),
                "drags": [micro.number(each * rate / units.mass * units.time) for each in mass],
                "steps": steps,
            }

        drag = DRAG * column.rate(SLICES[-1])
        stages = [stage(GRAVITY, GRAVITY / column.settling_speed, 0)]
        for load in column.loads():
            steps = math.ceil(RISE_TIME / column.rate(load) / scene.time_step)
            stages.append(stage(column.gravity(load, radius, request.cloud.length), drag, steps))
        return {
            **super()._deck_values(request),
            "check_steps": CHECK_STEPS,
            "max_checks": MOST_CHECKS,
            "calm_checks": CALM_CHECKS,
            "height_tolerance": micro.number(HEIGHT_TOLERANCE),
            "sizes": [{"first": int(first) + 1, "last": int(last)} for first, last in itertools.pairwise(bounds)],
            "stages": stages,
        }


def press_column(column: Column) -> list[dict[str, Any]]:
    """Make a column by LIGGGHTS, and look at its slices.

    Returns
    -------
    list of dict
        Of each slice, from the top: stress_Pa and load (means), porosity (corrected to rigid spheres), coordination
        (contacts of a sphere), steps and seconds (of CPU time, of the whole column, both with the lowest slice), and
        the reason where the column is no packing under its weight; without values where there is none.

    Raises
    ------
    EngineMissing
        If LIGGGHTS is not installed.
    """
    before = os.times()
    steps, found = 0, [{**asked, "porosity": None, "coordination": None} for asked in _asked(column)]
    with tempfile.TemporaryDirectory(prefix="filtercake-") as folder:
        try:
            state = settle(column.scene, 0, Path(folder), engine=ColumnEngine(column)).state
            steps, reasons = state.steps, refusals(column, state)
            if _is_whole(column, state):
                found = slices(column, state)
        except EngineMissing:
            raise
        except (CloudError, EngineError) as error:
            reasons = [str(error)]
    rows = [{**row, "steps": 0, "seconds": 0.0, "reason": "; ".join(reasons)} for row in found]
    rows[-1].update(steps=steps, seconds=_children() - _children(before))
    return rows


def _asked(column: Column) -> list[dict[str, Any]]:
    return [{"stress_Pa": load * column.strength, "load": load} for load in SLICES]


def _children(times: os.times_result | None = None) -> float:
    """CPU time of programs that were run and have ended, s."""
    found = times or os.times()
    return found.children_user + found.children_system


def heights(column: Column, state: SettledState, loads: FloatArray) -> FloatArray:
    """Heights, m, at which the weight above is so many times what the contacts hold.

    Parameters
    ----------
    column : Column
        What was asked for.
    state : SettledState
        What came out.
    loads : ndarray, shape (m,)
        Loads x, between 0 and the floor's.
    """
    centre, radius = state.position[:, 2], state.radius
    grid = np.linspace(0.0, float((centre + radius).max()), GRID)
    below = np.array([float(volume_below(z, centre, radius).sum()) for z in grid])
    return np.asarray(np.interp(-loads, -column.load * (1.0 - below / below[-1]), grid))


def slices(column: Column, state: SettledState) -> list[dict[str, Any]]:
    """Look at the slices of a column, from the top: stress_Pa, load, porosity, coordination."""
    position, radius, area = state.position, state.radius, state.length**2
    contacts = find_contacts(position, radius, state.length)
    middle = position[contacts.pairs, 2].mean(axis=1)
    overlap = contacts.overlap / radius[contacts.pairs].sum(axis=1)
    found = []
    edges = heights(column, state, np.array(EDGES))
    for asked, upper, lower in zip(_asked(column), edges, edges[1:], strict=False):
        solids = float(
            (volume_below(upper, position[:, 2], radius) - volume_below(lower, position[:, 2], radius)).sum()
        )
        porosity = 1.0 - solids / (area * (upper - lower))
        inside = (middle > lower) & (middle < upper)
        soft = float(overlap[inside].mean()) if inside.any() else 0.0
        found.append(
            {
                **asked,
                "porosity": porosity + 3.0 * (1.0 - porosity) * soft,
                "coordination": _coordination(contacts, (position[:, 2] > lower) & (position[:, 2] < upper)),
            }
        )
    return found


def _coordination(contacts: Contacts, chosen: np.ndarray[Any, np.dtype[np.bool_]]) -> float:
    """Mean number of contacts of chosen spheres, shape (n,)."""
    counts = np.bincount(contacts.pairs.ravel(), minlength=chosen.size)
    return float(counts[chosen].mean()) if chosen.any() else math.nan


def floor_stress(column: Column, state: SettledState) -> float:
    """Stress that the floor's contacts carry at rest, Pa: Hertz less SJKR's cohesion on what the floor cuts out."""
    scene, centre, radius = column.scene, state.position[:, 2], state.radius
    depth = np.maximum(radius - centre, 0.0)
    modulus = contact_law.effective_modulus(scene.youngs_modulus, scene.poisson_ratio)
    push = 4.0 / 3.0 * modulus * np.sqrt(radius) * depth**1.5
    pull = np.where(depth > 0.0, scene.cohesion * np.pi * (radius**2 - centre**2), 0.0)
    return float((push - pull).sum()) / state.length**2


def _is_whole(column: Column, state: SettledState) -> bool:
    """Whether all spheres came out, at finite places."""
    values = np.concatenate([state.position, state.velocity])
    return state.radius.size == column.scene.particles and bool(np.isfinite(values).all())


def refusals(column: Column, state: SettledState) -> list[str]:
    """Say why a column is no packing at rest under its own weight; nothing where it is one."""
    position, velocity, radius = state.position, state.velocity, state.radius
    if not _is_whole(column, state):
        return [f"{column.scene.particles} spheres were put in, and {radius.size} came out, not all at finite places"]
    found = []
    if state.dangerous_builds:
        found.append(f"{state.dangerous_builds} neighbour lists were built late")
    gravity = column.gravity(column.load, radius, state.length)
    mean_speed = abs(float(np.average(velocity[:, 2], weights=radius**3)))
    for name, share in (
        ("drag carries", DRAG * column.rate(SLICES[-1]) * mean_speed / gravity),
        ("the floor's contacts miss", abs(floor_stress(column, state) / (column.load * column.strength) - 1.0)),
    ):
        if not share <= BALANCE:
            found.append(f"{name} {share:.2g} of the weight: must be at most {BALANCE:g}")
    margin = 2.0 * MARGIN_DIAMETERS * float(radius.max())
    top, bottom = heights(column, state, np.array([EDGES[0], EDGES[-1]]))
    if not margin <= bottom < top <= bed_height(position, radius) - margin:
        found.append(
            f"the slices lie at {bottom * 1e6:.4g} to {top * 1e6:.4g} um of a bed of "
            f"{bed_height(position, radius) * 1e6:.4g} um, nearer than {margin * 1e6:.4g} um to its ends"
        )
    return found
