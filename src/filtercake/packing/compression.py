"""A cake pressed as in a filter: one cell led through all loads, and the porosity at any of them.

The structure of a pressed cake of given sizes and friction follows from one number, the load over what the contacts
hold, ``x = p/p_c`` (:mod:`filtercake.packing.similarity`). So one cell serves every pressure and every strength of the
attraction: its stress rises first, at the strongest attraction that counts as rigid, and then its attraction weakens
under the highest stress, down to none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from filtercake.errors import PackingRejected
from filtercake.packing import contact_law
from filtercake.packing.cell import CellScene, PressedCell, press_through
from filtercake.packing.contacts import find_contacts, relative_overlap
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.result import Packing
from filtercake.packing.scene import FILTRATION_PROTOCOL, Scene
from filtercake.packing.similarity import LEAST_LOAD, SIMULATED_MODULUS
from filtercake.units import FloatArray

LOADS: Final = (LEAST_LOAD, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 256.0, 1024.0, 4096.0, math.inf)
"""Loads x = p/p_c to which a cell is led; the last without attraction."""
STRESS_OVER_MODULUS: Final = 3.4e-5
"""Highest simulated stress over E*: that of 53 kPa on crystals of 3 GPa. Six times as much packs denser by 0.004."""
PATIENCE: Final = 400_000
"""Time steps after which a cell that is not at rest is given up; one of 2000 spheres took 140 000 at the first load."""
STRENGTH_OVER_MODULUS: Final = 9e-6
"""Strongest simulated attraction, p_c over E*."""

Report = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class CompressionCurve:
    """Porosity of one packing against its load.

    Attributes
    ----------
    load : ndarray, shape (n,)
        Loads x = p/p_c, ascending; the last is infinite.
    porosity : ndarray, shape (n,)
        Porosities, of rigid spheres.
    """

    load: FloatArray
    porosity: FloatArray

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> CompressionCurve:
        """Read the curve from a packing's record.

        Raises
        ------
        PackingRejected
            If the record is not that of a pressed packing.
        """
        try:
            loads = [math.inf if row["load"] is None else float(row["load"]) for row in record["loads"]]
            return cls(np.array(loads), np.array([float(row["porosity"]) for row in record["loads"]]))
        except (KeyError, TypeError, ValueError):
            raise PackingRejected(["the record holds no loads of a pressed packing"]) from None

    def at(self, load: FloatArray) -> FloatArray:
        """Porosity at any loads, interpolated without overshoot; under the smallest load of the curve, that of it.

        The variable of the interpolation is x to the power -1/4, in which the loads of the curve are about evenly
        spaced and the last one is finite.
        """
        if self.load.size == 1:
            return np.full(np.shape(load), self.porosity[0])
        # who plans a study need not wait for it
        from scipy.interpolate import PchipInterpolator

        known = _variable(self.load)[::-1]
        asked = np.clip(_variable(np.asarray(load, dtype=np.float64)), known[0], known[-1])
        return np.asarray(PchipInterpolator(known, self.porosity[::-1])(asked))


def _variable(load: FloatArray) -> FloatArray:
    return np.asarray(load**-0.25)


def press_cake(
    scene: Scene, replicate: int, seed: int, progress: Report = lambda _: None, state_file: Path | None = None
) -> Packing:
    """Make one pressed packing: a periodic cell at the last load, with the porosities at all loads in its record.

    Parameters
    ----------
    scene : Scene
        As packed (:meth:`filtercake.packing.scene.Scene.as_packed`).
    replicate, seed : int
        Number of the replicate, and the seed of its cloud.
    progress : callable
        Receives a line now and then.
    state_file : Path, optional
        Keeps the state of a long run.

    Raises
    ------
    CellError, CloudError, EngineError
        As :func:`filtercake.packing.cell.press`.
    PackingRejected
        If the cell does not come to rest at a load, or is not acceptable.
    """
    loads = LOADS if scene.attraction != "none" else LOADS[-1:]
    found = press_through(
        stages(scene, loads, seed),
        state_file=state_file,
        time_limit=scene.time_limit,
        progress=lambda line: progress(f"r{replicate}: {line}"),
    )
    last = found[-1]
    if not last.accepted:
        raise PackingRejected([f"load {loads[len(found) - 1]:g}: {reason}" for reason in last.reasons])
    record = {**_measurements(found, loads), "replicate": replicate, "seed": seed, "scene": scene.as_dict()}
    return Packing(last.position, last.radius, last.length, record)


def stages(scene: Scene, loads: Sequence[float], seed: int) -> list[CellScene]:
    """Scenes of the cell at each load."""
    modulus = contact_law.effective_modulus(SIMULATED_MODULUS, scene.poisson_ratio)
    base = CellScene.from_csd(
        scene.csd,
        scene.particles,
        stress=STRESS_OVER_MODULUS * modulus,
        density=scene.density,
        friction=scene.friction,
        restitution=scene.restitution,
        youngs_modulus=SIMULATED_MODULUS,
        poisson_ratio=scene.poisson_ratio,
        seed=seed,
        time_step_rayleigh=scene.rayleigh_fraction,
        mass_scaling=scene.is_wide,
        patience=PATIENCE,
    )
    stress = [min(load * STRENGTH_OVER_MODULUS, STRESS_OVER_MODULUS) * modulus for load in loads]
    return [replace(base, stress=p, **_attraction(scene, base, p / x)) for p, x in zip(stress, loads, strict=True)]


def _attraction(scene: Scene, cell: CellScene, strength: float) -> dict[str, Any]:
    """Choose what makes a cell's contacts hold a stress (Pa)."""
    if scene.attraction == "adhesion":
        return {"adhesion": contact_law.adhesion_of_strength(strength, cell.sauter_mean)}
    return {"cohesion": contact_law.cohesion_of_strength(strength, cell.youngs_modulus, cell.poisson_ratio)}


def _measurements(found: Sequence[PressedCell], loads: Sequence[float]) -> dict[str, Any]:
    """Plain numbers that describe an accepted cell."""
    from filtercake import __version__

    last = found[-1]
    contacts = find_contacts(last.position, last.radius, last.length)
    return {
        "protocol": FILTRATION_PROTOCOL,
        "particles": last.radius.size,
        "length_m": last.length,
        "bed_height_m": last.length,
        "steps": sum(cell.steps for cell in found),
        "settled": True,
        "overlap_max": float(relative_overlap(contacts, last.radius).max(initial=0.0)),
        "overlap_mean": last.last.overlap,
        "coordination": last.last.coordination,
        "dangerous_builds": 0,
        "engine": Embedded.name,
        "engine_version": __version__,
        "warnings": [],
        "wall_s": sum(cell.wall_time for cell in found),
        "loads": [
            {
                "load": None if math.isinf(load) else load,
                "porosity": cell.last.rigid_porosity,
                "coordination": cell.last.coordination,
                "overlap": cell.last.overlap,
                "force_ratio": cell.last.force_ratio,
                "steps": cell.steps,
            }
            for load, cell in zip(loads, found, strict=True)
        ],
    }
