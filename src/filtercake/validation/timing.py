"""Run time against the paper's protocol: the same packing by each protocol, in turn, on one core."""

from __future__ import annotations

import math
import resource
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import CloudError, EngineError, EngineMissing, PackingRejected
from filtercake.packing.accept import accept
from filtercake.packing.engines import ENGINES, Engine, get_engine
from filtercake.packing.pack import Report, settle
from filtercake.packing.porosity import measure
from filtercake.packing.result import Packing
from filtercake.packing.scene import Scene
from filtercake.statistics import difference_half_width, half_width
from filtercake.validation.lammps_engine import Lammps

WARM_UP_PARTICLES = 60
"""Spheres packed before the clock starts: the embedded engine's kernels are compiled once per machine."""
MEGABYTE = 1024.0
"""Kibibytes in the unit of the table's memory."""

POROSITIES = ("porosity", "porosity_from_floor", "porosity_paper_count")


@dataclass(frozen=True)
class Contender:
    """One way to make a packing.

    Attributes
    ----------
    name : str
        For the table.
    scene : Scene
        What is packed.
    engine : Engine
        By what.
    """

    name: str
    scene: Scene
    engine: Engine


def contender(name: str, scene: Scene, time_step: float = 0.0, skin: float = 0.0, steps: int = 0) -> Contender:
    """Make a contender of an engine's name; the last three are for an engine of a fixed number of steps.

    Parameters
    ----------
    name : str
        Name of the engine.
    scene : Scene
        The scene, at the time step of the tuned engines.
    time_step, skin : float
        Those of the published protocol, s and m; a skin of 0 is one largest diameter.
    steps : int
        Its fixed number of time steps.
    """
    engine = Lammps() if name == Lammps.name else get_engine(name)
    if engine.fixed_steps:
        engine.fixed_steps = steps
        scene = replace(scene, time_step=time_step, skin=skin)
    return Contender(name, replace(scene, engine=name), engine)


def present(names: Iterable[str]) -> list[str]:
    """Return those engines' names that can run here."""
    made = {name: Lammps() if name == Lammps.name else ENGINES[name]() for name in names}
    return [name for name, engine in made.items() if engine.why_missing() is None]


def time_in_turn(
    contenders: Iterable[Contender],
    replicates: int,
    report: Report = lambda _: None,
) -> pd.DataFrame:
    """Make every contender's replicate k before any replicate k + 1, so that a change of the machine's pace hits all.

    Returns
    -------
    DataFrame
        Columns engine, particles and those of :func:`settle_timed`: wall_s is the engine's own, peak_memory_MB of
        this process (the embedded engine's).
    """
    listed = list(contenders)
    for each in listed:
        warm_up(each)
    rows: list[dict[str, Any]] = []
    for replicate in range(replicates):
        for each in listed:
            rows.append({"engine": each.name, "particles": each.scene.particles, **settle_timed(each, replicate)})
            last = rows[-1]
            report(f"{each.name} r{replicate}: {last['wall_s']:.1f} s, porosity {last['porosity']:.4f}")
    return pd.DataFrame(rows)


def warm_up(each: Contender) -> None:
    """Let an engine compile what the contender needs: once per machine, and not what is timed."""
    if each.engine.compiles:
        narrow = CrystalSizeDistribution.from_classes([each.scene.csd.smallest], [1.0])
        particles = min(WARM_UP_PARTICLES, each.scene.particles)
        few = replace(each.scene, csd=narrow, particles=particles, initial_void_fraction=0.8)
        with tempfile.TemporaryDirectory(prefix="filtercake-") as folder:
            settle(few, 0, Path(folder), engine=each.engine)


def settle_timed(each: Contender, replicate: int) -> dict[str, Any]:
    """Time one packing; one that is not accepted is timed all the same, and says so.

    Returns
    -------
    dict
        replicate, wall_s, steps, status, porosity, porosity_from_floor, porosity_paper_count, peak_memory_MB; the
        porosities are blank where the engine itself failed.
    """
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="filtercake-") as folder:
        try:
            settled = settle(each.scene, replicate, Path(folder), engine=each.engine)
        except EngineMissing:
            raise
        except (CloudError, EngineError) as error:
            nothing = dict.fromkeys(POROSITIES, math.nan)
            seconds = time.monotonic() - started
            return {"replicate": replicate, "wall_s": seconds, "steps": 0, "status": str(error), **nothing}
    state, status = settled.state, "ok"
    try:
        accept(state, each.scene, settled.cloud, settled.rule)
    except PackingRejected as error:
        status = str(error)
    found = measure(Packing(state.position, state.radius, state.length), each.scene)
    return {
        "replicate": replicate,
        "wall_s": state.wall_time,
        "steps": state.steps,
        "status": status,
        "porosity": found.interior,
        "porosity_from_floor": found.from_floor,
        "porosity_paper_count": found.paper_count,
        "peak_memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEGABYTE,
    }


def compare(timings: pd.DataFrame) -> pd.DataFrame:
    """Summarise timings: per engine the median time, the ratio to the first engine's, and the porosity.

    ``same_porosity`` says whether the difference of the mean porosities is within its own 95 % interval; it is
    blank where there is one packing each.
    """
    names = list(timings["engine"].unique())
    base = timings[timings["engine"] == names[0]]
    rows = []
    for engine, group in timings.groupby("engine", sort=False):
        values, reference = group["porosity"].to_numpy(np.float64), base["porosity"].to_numpy(np.float64)
        difference = float(values.mean() - reference.mean())
        interval = difference_half_width(values, reference)
        rows.append(
            {
                "engine": engine,
                "particles": int(group["particles"].iloc[0]),
                "n": len(group),
                "n_not_accepted": int((group["status"] != "ok").sum()),
                "median_s": group["wall_s"].median(),
                "times_faster": base["wall_s"].median() / group["wall_s"].median(),
                **_range_of_ratios(base, group),
                "porosity": values.mean(),
                "porosity_ci95": half_width(values),
                "difference": difference,
                "difference_ci95": interval,
                "same_porosity": abs(difference) <= interval if np.isfinite(interval) else "",
                "peak_memory_MB": group["peak_memory_MB"].max(),
            }
        )
    return pd.DataFrame(rows)


def _range_of_ratios(base: pd.DataFrame, group: pd.DataFrame) -> dict[str, float]:
    """Smallest and largest ratio of the times of one replicate, made right after each other."""
    of_base, of_group = (rows.set_index("replicate")["wall_s"] for rows in (base, group))
    ratios = (of_base / of_group).dropna()
    return {"times_faster_low": float(ratios.min()), "times_faster_high": float(ratios.max())}
