"""What packings will cost before they are made: core-hours, wall time, memory and disk, from measured run times.

The constants are those of the machine of docs/benchmark.md, one core, undisturbed; tests hold them against its tables.
A packing's time is its spheres times its steps times a time per sphere and step; its steps follow from how many
free-fall times such a bed needs to come to rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from filtercake.packing.engines import ENGINES
from filtercake.packing.engines.base import parallelism
from filtercake.packing.replication import LEAST_REPLICATES
from filtercake.packing.scene import Scene
from filtercake.packing.spread import known_spread
from filtercake.permeability.resolution import LEVELS, bytes_needed, spacing
from filtercake.statistics import quantile
from filtercake.study.points import Point
from filtercake.units import HOUR, MINUTE, duration

ACCURACY: Final = 1.5
"""Factor within which a packing's time holds on the machine of the benchmark, undisturbed."""

FALLS: Final = {
    (False, True): 0.95,
    (False, False): 1.35,
    (True, True): 0.72,
    (True, False): 1.11,
}
"""Free-fall times of the highest sphere until a bed is at rest, by whether there is friction and cohesion."""
WIDE_FALLS: Final = 1.15
"""Factor on it for a wide distribution, whose bed swings for longer."""

PRESSED_STEPS: Final = {
    (False, False): 30_000.0,
    (False, True): 190_000.0,
    (True, False): 70_000.0,
    (True, True): 250_000.0,
}
"""Time steps of a pressed cell, by whether there is friction, and attraction: then it is led through all loads."""

SPHERES: Final = 8000
"""Number of spheres that the engines' times per sphere and step are for."""
GROWTH: Final = 0.04
"""Exponent of the time per sphere in the number of spheres: less of a large bed is surface, and it needs more steps."""
START_SECONDS: Final = 1.5
"""Seconds of a job before and after its packings: Python, compiled kernels from their cache, records."""

USUAL_POROSITY: Final = 0.35
"""Of a bed, where what its flow takes is estimated."""
BASE_MB: Final = 1200
"""Memory of a job before its first sphere: Snakemake on the node (twice 260 MB), Python with numba (330), and room."""
SPHERE_MB: Final = 0.005
"""Memory of one sphere while it is packed."""

SPHERE_BYTES: Final = 32
"""A position and a radius in double precision."""
PACKING_BYTES: Final = 7_000
"""A packing's record, and the header of its geometry file."""
POINT_BYTES: Final = 20_000
"""A point's log, benchmark, manifest, and what Snakemake notes about its job."""
STUDY_BYTES: Final = 3_000_000
"""A study's tables and figures."""

NODE_SECONDS: Final = 10.0
"""Seconds that a point takes on a cluster's node beside packing: Snakemake is started once for each."""
WALLTIME_FACTOR: Final = 4.0
"""How much longer than estimated a job may take before it is ended: other machines, unlucky beds."""
START_MINUTES: Final = 2.0
"""Walltime for what a job does beside packing, on a busy file system."""
LONGEST_MINUTES: Final = 10_080
"""A week: more than that few clusters grant."""

SUBMISSION_MINUTES: Final = 10.0
"""Estimated time that makes one submission worth its wait in a cluster's queue."""
GROUP_SIZES: Final = (32, 8)
"""Points in one submission, one after the other; the largest that stays within ``SUBMISSION_MINUTES`` is taken."""


@dataclass(frozen=True)
class Estimate:
    """What a set of points will cost.

    Attributes
    ----------
    core_seconds : float
        Time of all packings on one core, s.
    longest : float
        Wall time of the longest job, s.
    disk : float
        Bytes written.
    points, packings : int
        How many.
    """

    core_seconds: float
    longest: float
    disk: float
    points: int
    packings: int

    def wall_seconds(self, cores: int) -> float:
        """Return the wall time on ``cores`` cores that are kept busy, s: never less than that of the longest job."""
        return max(self.core_seconds / max(cores, 1), self.longest)

    def words(self, cores: int) -> str:
        """Say it in one line."""
        wall = f"{duration(self.wall_seconds(cores))} on {cores} {'core' if cores == 1 else 'cores'}"
        return (
            f"estimate: {_amount(self.core_seconds / HOUR)} core-hours, {wall}, {_size(self.disk)} on disk "
            f"(within a factor of {ACCURACY:g} on the machine of docs/benchmark.md)"
        )


def fall_steps(scene: Scene) -> float:
    """Return the time steps that a packing is expected to take."""
    if scene.is_pressed:
        return PRESSED_STEPS[scene.friction > 0.0, scene.attraction != "none"]
    steps = ENGINES[scene.engine].fixed_steps
    if steps:
        return steps
    falls = FALLS[scene.friction > 0.0, scene.cohesion > 0.0] * (WIDE_FALLS if scene.is_wide else 1.0)
    return float(min(falls, scene.max_fall_times) * scene.free_fall_time(scene.cloud_height) / scene.time_step)


def packing_seconds(scene: Scene) -> float:
    """Time of one packing on one core, s."""
    engine = ENGINES[scene.engine]
    seconds = engine.sphere_step[scene.friction > 0.0] * scene.particles * fall_steps(scene)
    if engine.fixed_steps:
        return seconds
    return seconds * (engine.wide_factor if scene.is_wide else 1.0) * float((scene.particles / SPHERES) ** GROWTH)


def packings_of(point: Point) -> int:
    """Return the packings that a point is expected to need: those asked for, or those that its interval takes."""
    if point.porosity_ci95_target is None:
        return point.replicates
    known, needed = known_spread(point.scene.as_packed()), max(LEAST_REPLICATES, point.replicates)
    while needed < point.most_replicates:
        half_width = quantile(known.freedom + needed - 1.0) * known.sd / math.sqrt(needed)
        if half_width <= point.porosity_ci95_target:
            break
        needed += 1
    return min(needed, point.most_replicates)


def job_seconds(point: Point, start: float = START_SECONDS) -> float:
    """Return the wall time of a point's job on the cores it takes, s; ``start`` is its time beside packing."""
    # ASSUME: two processes or threads halve the time of a large bed
    return start + packings_of(point) * packing_seconds(point.scene) / parallelism(point.scene)


def walltime_minutes(point: Point, attempt: int = 1, *, granted: int = LONGEST_MINUTES) -> int:
    """Return the walltime to ask for, min: four times the estimate for the most packings, doubled with every retry.

    A submission, in which other points may wait for this one, asks for no more than is ``granted`` (min).
    """
    longest = granted // group_size(point, granted=granted)
    return min(_first_walltime(point) << (attempt - 1), longest)


def _first_walltime(point: Point) -> int:
    most = point.most_replicates * packing_seconds(point.scene) / parallelism(point.scene)
    return math.ceil(START_MINUTES + WALLTIME_FACTOR * most / MINUTE)


def memory_mb(scene: Scene) -> int:
    """Memory to ask for, MB: measured, with room."""
    return math.ceil(BASE_MB + SPHERE_MB * scene.particles)


def flow_memory_mb(scene: Scene, accuracy: float) -> int:
    """Memory to ask for to solve the flow in a packing, MB: that of the third lattice, in a bed of usual porosity."""
    sauter = 1.0 / scene.csd.sum_x_over_d
    height = scene.particles * scene.csd.mean_particle_volume / scene.box_length**2 / (1.0 - USUAL_POROSITY)
    box = np.array([scene.box_length, scene.box_length, height + scene.csd.largest])
    finest = spacing(USUAL_POROSITY, sauter, accuracy) * LEVELS[1] / LEVELS[2]
    return math.ceil(BASE_MB + bytes_needed(box, finest, USUAL_POROSITY) / 1e6)


def group_size(point: Point, *, granted: int = LONGEST_MINUTES) -> int:
    """Return how many points like this one make a submission to a cluster worth its start-up; 1 for a long one.

    The walltimes of all of them together stay within what is ``granted`` (min).
    """
    if parallelism(point.scene) > 1:
        return 1
    minutes = job_seconds(point, START_SECONDS + NODE_SECONDS) / MINUTE
    walltime = _first_walltime(point)
    fitting = (size for size in GROUP_SIZES if size * minutes <= SUBMISSION_MINUTES and size * walltime <= granted)
    return next(fitting, 1)


def estimate(points: Iterable[Point], *, on_cluster: bool = False) -> Estimate:
    """Estimate what a study's points will cost.

    Parameters
    ----------
    points : iterable of Point
        Those to be made.
    on_cluster : bool
        Whether Snakemake is started on a node for each.
    """
    start = START_SECONDS + (NODE_SECONDS if on_cluster else 0.0)
    listed = list(points)
    packings = [packings_of(point) for point in listed]
    bytes_each = [SPHERE_BYTES * point.scene.particles + PACKING_BYTES for point in listed]
    written = sum(n * size for n, size in zip(packings, bytes_each, strict=True))
    return Estimate(
        core_seconds=sum(job_seconds(point, start) * parallelism(point.scene) for point in listed),
        longest=max((job_seconds(point, start) for point in listed), default=0.0),
        disk=written + POINT_BYTES * len(listed) + (STUDY_BYTES if listed else 0),
        points=len(listed),
        packings=sum(packings),
    )


def together(estimates: Iterable[Estimate]) -> Estimate:
    """Add up the estimates of several studies."""
    listed = list(estimates)
    return Estimate(
        core_seconds=sum(item.core_seconds for item in listed),
        longest=max((item.longest for item in listed), default=0.0),
        disk=sum(item.disk for item in listed),
        points=sum(item.points for item in listed),
        packings=sum(item.packings for item in listed),
    )


def _amount(hours: float) -> str:
    return f"{hours:.2g}" if hours < 10.0 else f"{hours:.0f}"


def _size(count: float) -> str:
    return f"{count / 1e6:.0f} MB" if count < 1e9 else f"{count / 1e9:.1f} GB"
