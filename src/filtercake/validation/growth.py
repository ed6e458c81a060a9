"""How the embedded engine's run time grows: with the number of spheres, and with the width of their sizes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.pack import Report, settle
from filtercake.packing.result import SettledState
from filtercake.packing.scene import Scene
from filtercake.validation.timing import Contender, warm_up

SMALLEST = 20e-6
"""Diameter of the smallest class, m."""
CLASSES = 10
"""Size classes, evenly spaced in log size, each with the same volume."""


@dataclass(frozen=True)
class Case:
    """One bed that is timed.

    Attributes
    ----------
    series : {"particles", "size_ratio"}
        Quantity that is varied.
    particles : int
        Number of spheres.
    size_ratio : float
        Largest over smallest diameter.
    """

    series: str
    particles: int
    size_ratio: float


def even_distribution(size_ratio: float) -> CrystalSizeDistribution:
    """Make a distribution from ``SMALLEST`` up whose classes, evenly spaced in log size, hold the same volume."""
    if size_ratio == 1.0:
        return CrystalSizeDistribution.from_classes([SMALLEST], [1.0])
    sizes = SMALLEST * np.geomspace(1.0, size_ratio, CLASSES)
    return CrystalSizeDistribution.from_classes(sizes, np.full(CLASSES, 1.0 / CLASSES))


def time_growth(base: Scene, cases: Iterable[Case], report: Report = lambda _: None) -> pd.DataFrame:
    """Time the whole settling of each case, on one core.

    A machine's pace changes within minutes: the first case is timed anew before and after every other one, and
    what a case costs is given relative to it.

    Parameters
    ----------
    base : Scene
        Material and protocol; the number of spheres and the time step follow the case.
    cases : iterable of Case
        Beds that are timed, in this order.
    report : callable
        Receives a line per case.

    Returns
    -------
    DataFrame
        Columns series, particles, size_ratio, steps, wall_s, ns_per_particle_step, and reference_ns: that of the
        first case, the mean of before and after.
    """
    listed = list(cases)
    rows: list[dict[str, object]] = []
    before = _time(base, listed[0])[1]
    for case in listed:
        state, pace = _time(base, case)
        after = _time(base, listed[0])[1]
        row = {**vars(case), "steps": state.steps, "wall_s": state.wall_time, "ns_per_particle_step": pace}
        rows.append({**row, "reference_ns": 0.5 * (before + after)})
        report(
            f"N = {case.particles:,}, ratio {case.size_ratio:g}: {state.wall_time:.1f} s, {pace:.1f} ns; "
            f"the first case {before:.1f} ns before, {after:.1f} ns after"
        )
        before = after
    return pd.DataFrame(rows)


def _time(base: Scene, case: Case) -> tuple[SettledState, float]:
    """Settle a bed; return what became of it, and its time per sphere and step, ns."""
    csd = even_distribution(case.size_ratio)
    scene = replace(base, csd=csd, engine=Embedded.name, particles=case.particles, processes=1)
    scene = scene.with_time_step(base.rayleigh_fraction)
    contender = Contender(Embedded.name, scene, Embedded())
    warm_up(contender)
    with tempfile.TemporaryDirectory(prefix="filtercake-") as folder:
        state = settle(scene, 0, Path(folder), engine=contender.engine).state
    return state, 1e9 * state.wall_time / state.steps / case.particles
