"""Numerical stability under stress: scenes far outside the safe ground, and what becomes of each.

A case is one scene with one choice of numbers (time step, skin, engine). It is settled a few times and judged by the
same acceptance checks that guard every packing, and the porosity of what they let through is held, cloud by cloud,
against the same scene settled with a small time step.
"""

from __future__ import annotations

import itertools
import math
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import CloudError, EngineError, PackingRejected
from filtercake.packing.accept import accept
from filtercake.packing.cloud import Cloud
from filtercake.packing.engines import Engine, get_engine
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.engines.liggghts import Liggghts
from filtercake.packing.engines.micro import SI
from filtercake.packing.pack import Report, settle
from filtercake.packing.porosity import measure
from filtercake.packing.result import Packing, SettledState
from filtercake.packing.scene import Scene
from filtercake.statistics import paired_half_width
from filtercake.study import limits
from filtercake.units import GRAVITY, KILOJOULE_PER_M3, MEGAPASCAL

INACCURATE = 0.002
"""Bias of the mean porosity that a case is held to: its 95 % interval lies within, beyond, or cannot tell."""
WRONG = 0.005
"""Bias of accepted packings that a user must never meet without a word."""
REFERENCE_STEP, FRICTIONAL_REFERENCE_STEP = 0.2, 0.1
"""Time step of the reference over the Rayleigh step, without and with friction: far inside what the error benchmark
found without bias."""
REFERENCE_TOLERANCE = 2e-5
REFERENCE_REPLICATES = 5
REPLICATES = {Embedded.name: 5, Liggghts.name: 3}
HOPELESS = 2
"""Packings without an accepted one after which no more are tried: what never rests takes the longest."""
SLOW_STEP = 0.05
"""Time step over the Rayleigh step under which a packing takes long."""
TIME_LIMIT = 240.0
"""Wall-clock limit of one packing, s: a case that hangs is found out."""
SI_UNITS = "liggghts_si"
"""LIGGGHTS in SI units, which the paper warns of."""

UNDECIDED = "undecided"
"""Outcome of a case whose interval is too wide to tell."""
OUTCOMES = ("ok", UNDECIDED, "inaccurate", "unsettled", "exploded", "refused")
COLUMNS = (
    "family",
    "engine",
    "x_name",
    "x",
    "y_name",
    "y",
    "outcome",
    "n",
    "n_accepted",
    "porosity",
    "reference",
    "bias",
    "bias_ci95",
    "overlap_max",
    "energy_gain",
    "momentum_drift",
    "seconds",
    "reason",
)


BASE = {
    "cohesion_kJ_m3": 50.0,
    "youngs_modulus_MPa": 5.0,
    "restitution": 0.3,
    "friction": 0.0,
    "density_kg_m3": 1180.0,
    "size_ratio": 2.5,
    "drop_height": 1.0,
    "time_step": 0.0,
    "skin": 0.0,
}
"""What the axes of maps start from: the material; large over small size of a mixture of two sizes with the same volume
(one size at 1); the height from which the spheres are released, over the paper's; the time step over the Rayleigh step
(0 for the default); and the skin over the smallest diameter (0 lets the engine choose)."""


@dataclass(frozen=True)
class Case:
    """One place on a map: a scene that differs from the base in two numbers, and the engine that settles it.

    Attributes
    ----------
    family : str
        The map it belongs to.
    engine : str
        ``embedded``, ``liggghts`` or ``liggghts_si``.
    x_name, y_name : str
        What the map's axes are: names in ``BASE``.
    x, y : float
        Its place on the map.
    """

    family: str
    engine: str
    x_name: str
    x: float
    y_name: str
    y: float

    @property
    def numbers(self) -> dict[str, float]:
        """Values of all that is in ``BASE``."""
        return {**BASE, self.x_name: self.x, self.y_name: self.y}


def cases(engines: Iterable[str], family: str = "", quick: bool = False) -> list[Case]:
    """List the cases of one family or of all.

    Parameters
    ----------
    engines : iterable of str
        Engines that can run here.
    family : str
        Name of a map; empty for all.
    quick : bool
        A few of them, to see whether all works.
    """
    asked = set(engines)
    made = [case for name, make in _FAMILIES.items() if family in ("", name) for case in make()]
    listed = [case for case in made if case.engine.removesuffix("_si") in asked]
    return [case for index, case in enumerate(listed) if not quick or index % 12 == 6]


def families() -> tuple[str, ...]:
    """Return the names of the maps."""
    return tuple(_FAMILIES)


def _grid(
    family: str, engine: str, x_name: str, xs: Iterable[float], y_name: str, ys: Iterable[float]
) -> Iterable[Case]:
    """Cases at every combination."""
    return [Case(family, engine, x_name, x, y_name, y) for x, y in itertools.product(xs, ys)]


def _time_step_cohesion() -> Iterable[Case]:
    names = ("time_step_cohesion", Embedded.name, "time_step")
    yield from _grid(*names, (0.02,), "cohesion_kJ_m3", (50.0,))
    steps = (0.12, 0.36, 0.5, 0.7, 0.9, 1.1, 2.0)
    yield from _grid(*names, steps, "cohesion_kJ_m3", (0.0, 50.0, 100.0, 200.0, 500.0))
    names = ("time_step_cohesion", Liggghts.name, "time_step")
    yield from _grid(*names, (0.12, 0.5, 0.7, 1.1, 2.0), "cohesion_kJ_m3", (0.0, 50.0, 200.0, 500.0))


def _time_step_friction() -> Iterable[Case]:
    names = ("time_step_friction", Embedded.name, "time_step")
    steps = (0.12, 0.2, 0.28, 0.36, 0.5, 0.7, 1.1)
    yield from _grid(*names, steps, "friction", (0.05, 0.3, 2.0))
    yield from _grid("time_step_friction", Liggghts.name, "time_step", (0.2, 0.36, 0.7), "friction", (0.3, 2.0))


def _modulus_cohesion() -> Iterable[Case]:
    names = ("modulus_cohesion", Embedded.name, "youngs_modulus_MPa")
    yield from _grid(*names, (0.5, 1.0, 2.0), "cohesion_kJ_m3", (0.0, 15.0, 50.0, 100.0))
    yield from _grid(*names, (50.0,), "cohesion_kJ_m3", (0.0, 200.0))
    yield from _grid(*names, (500.0,), "cohesion_kJ_m3", (50.0,))
    yield from _grid(
        "modulus_cohesion", Liggghts.name, "youngs_modulus_MPa", (0.5, 5.0, 50.0), "cohesion_kJ_m3", (50.0,)
    )


def _restitution_time_step() -> Iterable[Case]:
    names = ("restitution_time_step", Embedded.name, "restitution")
    yield from _grid(*names, (0.01, 0.1, 0.3, 0.9, 0.99), "time_step", (0.2, 0.36, 0.5, 0.7))
    yield from _grid("restitution_time_step", Liggghts.name, "restitution", (0.01, 0.99), "time_step", (0.5,))


def _size_ratio_skin() -> Iterable[Case]:
    names = ("size_ratio_skin", Embedded.name, "size_ratio")
    yield from _grid(*names, (1.0, 2.5), "skin", (0.05, 0.2, 1.0, 5.0, 20.0))
    yield from _grid(*names, (5.0, 10.0), "skin", (0.05, 0.2, 1.0, 5.0))
    yield from _grid(*names, (20.0, 50.0), "skin", (0.05, 1.0))
    yield from _grid("size_ratio_skin", Liggghts.name, "size_ratio", (1.0, 5.0), "skin", (0.05, 0.2, 1.0, 5.0))


def _density_drop() -> Iterable[Case]:
    axes = ("density_kg_m3", (118.0, 1180.0, 118_000.0), "drop_height", (1.0, 3.0, 10.0))
    yield from _grid("density_drop", Embedded.name, *axes)
    yield from _grid("density_drop", Liggghts.name, "density_kg_m3", (1180.0, 118_000.0), "drop_height", (1.0, 10.0))


def _si_units() -> Iterable[Case]:
    yield from _grid("si_units", SI_UNITS, "time_step", (0.12, 0.36), "cohesion_kJ_m3", (0.0, 50.0))


_FAMILIES: dict[str, Callable[[], Iterable[Case]]] = {
    "time_step_cohesion": _time_step_cohesion,
    "time_step_friction": _time_step_friction,
    "modulus_cohesion": _modulus_cohesion,
    "restitution_time_step": _restitution_time_step,
    "size_ratio_skin": _size_ratio_skin,
    "density_drop": _density_drop,
    "si_units": _si_units,
}

SMALL = 20e-6
"""Smaller diameter of every scene, m."""
LARGE_SPHERES = 6
"""Large spheres at least in a bed, where the ratio is so wide that the volume cannot be shared evenly."""
PARTICLES = 1000
WIDE_PARTICLES = 12_000
"""Spheres of a bed with a size ratio above 10."""
WIDE_COLUMN = 4.0


def distribution(size_ratio: float) -> tuple[CrystalSizeDistribution, int, float]:
    """Return sizes, number of spheres and column ratio of a scene's bed.

    Up to a ratio of 10 both sizes have the same volume; above, the bed would need too many spheres for that, and holds
    ``LARGE_SPHERES`` large ones among small ones in a column deep enough to have an interior.
    """
    if size_ratio == 1.0:
        return CrystalSizeDistribution.from_classes([SMALL], [1.0]), PARTICLES, 1.0
    if size_ratio <= 10.0:
        particles = PARTICLES * (1 if size_ratio <= 5.0 else 8)
        share, column = 0.5, 1.0 if size_ratio < 5.0 else 3.0
    else:
        particles, column = WIDE_PARTICLES, WIDE_COLUMN
        large = max(LARGE_SPHERES, round(particles / size_ratio**3)) * size_ratio**3
        share = large / (large + particles - LARGE_SPHERES)
    csd = CrystalSizeDistribution.from_classes([SMALL, SMALL * size_ratio], [1.0 - share, share])
    return csd, particles, column


def scene_of(numbers: Mapping[str, float], engine: str) -> Scene:
    """Return what is settled, from the values of all that is in ``BASE``."""
    csd, particles, column = distribution(numbers["size_ratio"])
    scene = Scene(
        csd=csd,
        particles=particles,
        initial_void_fraction=0.65,
        settling_velocity=0.01,
        density=numbers["density_kg_m3"],
        youngs_modulus=numbers["youngs_modulus_MPa"] * MEGAPASCAL,
        poisson_ratio=0.2,
        restitution=numbers["restitution"],
        friction=numbers["friction"],
        cohesion=numbers["cohesion_kJ_m3"] * KILOJOULE_PER_M3,
        time_step=0.0,
        engine=engine.removesuffix("_si"),
        skin=numbers["skin"] * csd.smallest,
        # thrown fast, they are down soon, but rebound as high as if they had fallen
        max_fall_times=4.0 * numbers["drop_height"],
        time_limit=TIME_LIMIT,
        bed_depth_factor=column,
        processes=1,
    )
    # released k times as high, the spheres reach the height of the cloud with this speed
    speed = math.sqrt(scene.settling_velocity**2 + 2.0 * GRAVITY * (numbers["drop_height"] - 1.0) * scene.cloud_height)
    step = numbers["time_step"] or limits.default_time_step(scene.friction)
    return replace(scene, settling_velocity=speed).with_time_step(step)


def run(listed: Iterable[Case], report: Report = lambda _: None, replicates: int = 0) -> pd.DataFrame:
    """Settle and judge cases.

    Parameters
    ----------
    listed : iterable of Case
        The cases.
    report : callable
        Takes a line per case.
    replicates : int
        Packings per case and reference; 0 for ``REPLICATES`` and ``REFERENCE_REPLICATES``.

    Returns
    -------
    DataFrame
        One row per case, ``COLUMNS``.
    """
    references: dict[Scene, dict[int, float]] = {}
    rows = []
    for case in listed:
        reference = reference_scene(case)
        if reference not in references:
            references[reference] = _reference(reference, replicates or REFERENCE_REPLICATES)
        row = _judge(case, references[reference], replicates or REPLICATES.get(case.engine, REPLICATES[Liggghts.name]))
        report(
            f"{case.engine}, {case.x_name} {case.x:g}, {case.y_name} {case.y:g}: {row['outcome']}, "
            f"bias {row['bias']:+.4f}, {row['seconds']:.1f} s"
        )
        rows.append(row)
    return pd.DataFrame(rows, columns=list(COLUMNS))


def reference_scene(case: Case) -> Scene:
    """Return a case's physics at a small time step, from the same clouds: what a cloud does to its bed is no error."""
    scene = scene_of({**case.numbers, "time_step": 0.0, "skin": 0.0}, Embedded.name)
    times = 2.0 * scene.max_fall_times
    scene = replace(scene, porosity_tolerance=REFERENCE_TOLERANCE, max_fall_times=times)
    return scene.with_time_step(FRICTIONAL_REFERENCE_STEP if scene.friction > 0.0 else REFERENCE_STEP)


def _reference(scene: Scene, replicates: int) -> dict[int, float]:
    """Porosities by replicate of the accepted packings of a scene at a small time step; a scene may have none."""
    found: dict[int, float] = {}
    for replicate in range(_number(scene, replicates)):
        result = _try(scene, Embedded(), replicate)
        if result.outcome == "ok":
            found[replicate] = result.porosity
        elif replicate + 1 == HOPELESS and not found:
            break
    return found


def _number(scene: Scene, replicates: int) -> int:
    """Packings of a case: fewer where one takes long."""
    slow = scene.particles > PARTICLES or scene.rayleigh_fraction < SLOW_STEP
    return max(2, replicates // 3) if slow else replicates


@dataclass(frozen=True)
class _Try:
    """One packing of a case."""

    outcome: str
    reason: str = ""
    porosity: float = math.nan
    overlap: float = math.nan
    energy_gain: float = math.nan
    momentum_drift: float = math.nan
    seconds: float = math.nan


def _judge(case: Case, reference: Mapping[int, float], replicates: int) -> dict[str, Any]:
    scene = scene_of(case.numbers, case.engine)
    engine = Liggghts(units=SI) if case.engine == SI_UNITS else get_engine(case.engine)
    tries: list[_Try] = []
    for replicate in range(_number(scene, replicates)):
        tries.append(_try(scene, engine, replicate))
        if len(tries) == HOPELESS and all(result.outcome != "ok" for result in tries):
            break
    accepted = {k: result.porosity for k, result in enumerate(tries) if result.outcome == "ok"}
    # by pairs: both start from the same cloud
    own, known = (np.array([table[k] for k in accepted if k in reference]) for table in (accepted, reference))
    bias = float(np.mean(own - known)) if own.size else math.nan
    half = paired_half_width(own, known)
    failures = Counter(result.outcome for result in tries if result.outcome != "ok")
    outcome = failures.most_common(1)[0][0] if failures else verdict(bias, half)
    reasons = Counter(result.reason for result in tries if result.reason)
    return {
        **{name: getattr(case, name) for name in ("family", "engine", "x_name", "x", "y_name", "y")},
        "outcome": outcome,
        "n": len(tries),
        "n_accepted": len(accepted),
        "porosity": _mean(accepted.values()),
        "reference": _mean(reference.values()),
        "bias": bias,
        "bias_ci95": half,
        **{name: _largest(getattr(result, name) for result in tries) for name in ("energy_gain", "momentum_drift")},
        "overlap_max": _largest(result.overlap for result in tries),
        "seconds": _mean(result.seconds for result in tries),
        "reason": reasons.most_common(1)[0][0] if reasons else "",
    }


def verdict(bias: float, half: float) -> str:
    """Say whether a bias is ok, inaccurate or undecided, by the half-width of its 95 % interval; nan is undecided."""
    if abs(bias) + half <= INACCURATE:
        return "ok"
    return "inaccurate" if abs(bias) - half > INACCURATE else UNDECIDED


def _try(scene: Scene, engine: Engine, replicate: int) -> _Try:
    """Settle once and say how it ended; never raises for what a scene may do."""
    with tempfile.TemporaryDirectory(prefix="filtercake-") as folder:
        try:
            settled = settle(scene, replicate, Path(folder), engine=engine)
        except CloudError as error:
            return _Try("refused", str(error))
        except EngineError as error:
            return _Try(error.outcome, str(error))
    state = settled.state
    recorded: dict[str, Any] = {
        "energy_gain": energy_gain(state, scene, settled.cloud),
        "momentum_drift": momentum_drift(state),
        "seconds": state.wall_time,
    }
    try:
        accepted = accept(state, scene, settled.cloud, settled.rule)
    except PackingRejected as error:
        return _Try(error.outcome, str(error), **recorded)
    porosity = measure(Packing(state.position, state.radius, state.length), scene).interior
    return _Try("ok", porosity=porosity, overlap=accepted["overlap_max"], **recorded)


def energy_gain(state: SettledState, scene: Scene, cloud: Cloud) -> float:
    """Largest rise of the bed's mechanical energy between two checks, over what it started with.

    Gravity and impacts can only spend what the spheres started with; a rise is the integration's own work, or what
    cohesion gives when contacts close (negligible beside the fall). Rotation is not counted.
    """
    mass = scene.density * 4.0 / 3.0 * np.pi * cloud.radius**3
    record = state.trajectory
    energy = record.kinetic_energy + float(mass.sum()) * GRAVITY * record.mean_height
    if not np.isfinite(energy).all():
        return math.inf
    return float(np.max(energy - np.minimum.accumulate(energy)) / energy[0])


def momentum_drift(state: SettledState) -> float:
    """Sideways speed of the centre of mass at the end, m/s: nothing pushes sideways but a rough floor."""
    weight = state.radius**3
    sideways = np.average(state.velocity[:, :2], axis=0, weights=weight)
    return float(np.hypot(*sideways)) if np.isfinite(sideways).all() else math.inf


def with_fence(table: pd.DataFrame) -> pd.DataFrame:
    """Add what the configuration says to each case today: column ``fence``.

    Parameters
    ----------
    table : DataFrame
        Of :func:`run`.
    """
    known = {(c.family, c.engine, c.x, c.y): c for c in cases({str(e).removesuffix("_si") for e in table["engine"]})}
    keys = table[["family", "engine", "x", "y"]].itertuples(index=False, name=None)
    return table.assign(fence=[limits.verdict(scene_of(known[key].numbers, known[key].engine)) for key in keys])


def wrong(table: pd.DataFrame) -> pd.Series[bool]:
    """Whether the mean porosity of a row's accepted packings is off by more than ``WRONG`` beyond doubt."""
    return (table["bias"].abs() - table["bias_ci95"] > WRONG) & (table["n_accepted"] > 0)


def undetected(table: pd.DataFrame) -> pd.DataFrame:
    """Rows whose accepted packings are wrong, though the configuration would let them pass without a word."""
    return table[wrong(table) & (table["fence"] == "allowed")]


def _mean(values: Iterable[float]) -> float:
    found = [value for value in values if not math.isnan(value)]
    return sum(found) / len(found) if found else math.nan


def _largest(values: Iterable[float]) -> float:
    found = [value for value in values if not math.isnan(value)]
    return max(found) if found else math.nan
