"""Large beds: time per sphere and step on one and two threads, memory, and what a bed of a million would take.

A settled bed is laid side by side with itself: so a million spheres in contact are there at once. All of them move.
"""

from __future__ import annotations

import gc
import resource
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import pandas as pd

from filtercake.packing.cloud import make_cloud
from filtercake.packing.engines.embedded_bed import Bed, use_threads
from filtercake.packing.pack import Report
from filtercake.packing.scene import Scene
from filtercake.study.estimate import fall_steps
from filtercake.units import HOUR, FloatArray

MEGABYTE: Final = 1024.0
"""Kibibytes in the unit of the table's memory."""
SETTLED_FALLS: Final = 1.2
"""Free-fall times of the highest sphere after which the bed that is laid out is dense."""
IN_BED: Final = 0.67
"""Mean share of the spheres that have met something while a bed settles: the others cost nothing."""
CORES: Final = (1, 2, 16, 64)


def time_large_beds(
    scene: Scene, tiles: Sequence[int], steps: int, repeats: int, report: Report = lambda _: None
) -> pd.DataFrame:
    """Time beds of one settled bed, laid out ``tiles`` times along x and y, on one and two threads in turn.

    Parameters
    ----------
    scene : Scene
        The bed that is laid out.
    tiles : sequence of int
        How often, along each axis, ascending: the memory is the most so far.
    steps : int
        Time steps that are timed.
    repeats : int
        How often each is timed; the median counts.
    report : callable
        Receives a line per bed.

    Returns
    -------
    DataFrame
        Columns particles, threads, steps, ns_per_particle_step, peak_memory_MB.
    """
    use_threads(2)
    position, velocity, radius, length = _settled(scene)
    rows = []
    for count in tiles:
        shift = length * np.array([(i, j, 0) for j in range(count) for i in range(count)], dtype=np.float64)
        spheres = (np.vstack([position + way for way in shift]), np.tile(velocity, (count**2, 1)))
        laid = replace(scene, particles=radius.size * count**2)
        rows += _time(laid, *spheres, np.tile(radius, count**2), count * length, steps, repeats)
        of_one, of_two = (row["ns_per_particle_step"] for row in rows[-2:])
        report(f"N = {laid.particles:,}: {of_one:.1f} ns on one thread, {of_two:.1f} ns on two")
    return pd.DataFrame(rows)


def _settled(scene: Scene) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    cloud = make_cloud(scene.csd, scene.particles, scene.initial_void_fraction, scene.seed, scene.bed_depth_factor)
    bed = Bed.from_cloud(cloud, scene)
    bed.advance(int(SETTLED_FALLS * scene.free_fall_time(cloud.height) / scene.time_step))
    position, velocity = bed.state()
    return position, velocity, cloud.radius, cloud.length


def _time(
    scene: Scene,
    position: FloatArray,
    velocity: FloatArray,
    radius: FloatArray,
    length: float,
    steps: int,
    repeats: int,
) -> list[dict[str, float]]:
    """Time one bed on one and on two threads; its state is written as that of a long bed is."""
    found = []
    for threads in (1, 2):
        bed = Bed(position, velocity, radius, length, scene, threads=threads)
        bed.advance(10)
        paces = []
        for _ in range(repeats):
            began = time.perf_counter()
            bed.advance(steps)
            paces.append(1e9 * (time.perf_counter() - began) / steps / radius.size)
        with tempfile.TemporaryFile() as file:
            np.savez(file, **bed.saved())
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEGABYTE
        row = {"particles": radius.size, "threads": threads, "steps": steps}
        found.append({**row, "ns_per_particle_step": float(np.median(paces)), "peak_memory_MB": peak})
        del bed
        gc.collect()
    return found


def whole_bed_hours(scene: Scene, table: pd.DataFrame, cores: Iterable[int] = CORES) -> pd.DataFrame:
    """Estimate the hours that a whole bed of the largest timed number of spheres takes on several cores.

    One and two threads are measured; beyond, what one thread does alone is taken to stay (Amdahl): an estimate.

    Returns
    -------
    DataFrame
        Columns cores, hours.
    """
    largest = table[table["particles"] == table["particles"].max()].set_index("threads")["ns_per_particle_step"]
    alone = max(2.0 * largest[2] / largest[1] - 1.0, 0.0)
    particles = int(table["particles"].max())
    steps = fall_steps(replace(scene, particles=particles))
    one = steps * particles * IN_BED * largest[1] * 1e-9 / HOUR
    return pd.DataFrame([{"cores": number, "hours": one * (alone + (1.0 - alone) / number)} for number in cores])


def large_beds_of(study_scene: Scene, particles: int) -> Scene:
    """Return the scene of the bed that is laid out, from a study's."""
    scene = replace(study_scene, engine="embedded", particles=particles, processes=1)
    return scene.with_time_step(scene.rayleigh_fraction)
