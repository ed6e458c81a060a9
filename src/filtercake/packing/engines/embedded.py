"""The embedded engine: the same contact law as LIGGGHTS, compiled on the spot, from pip alone.

Only what moves is computed: spheres still in free fall follow one known parabola and join the bed, with its
pairs and forces, when they come near it.
"""

from __future__ import annotations

import math
import time

import numpy as np
from numba import get_num_threads, set_num_threads

from filtercake import __version__
from filtercake.errors import EngineError
from filtercake.packing.engines.base import SettleRequest, parallelism
from filtercake.packing.engines.embedded_bed import Bed
from filtercake.packing.pictures import write_vtk
from filtercake.packing.result import SettledState
from filtercake.packing.settling import Trajectory

PROGRESS_SECONDS = 20.0
CHECKS_PER_PICTURE = 4


class Embedded:
    """Numba kernels for the Hertz + SJKR contact law with optional friction, in double precision."""

    name = "embedded"

    def why_missing(self) -> str | None:
        """Never missing: it comes with the package."""
        return None

    def settle(self, request: SettleRequest) -> SettledState:
        """Let the cloud settle (see :class:`filtercake.packing.engines.base.Engine`)."""
        started = time.monotonic()
        threads = parallelism(request.spec)
        if threads > 1:
            set_num_threads(min(threads, get_num_threads()))
        bed = Bed.from_cloud(request.cloud, request.spec, threads)
        trajectory = _settle(bed, request, started)
        position, velocity = bed.state()
        return SettledState(
            position=position,
            velocity=velocity,
            radius=request.cloud.radius,
            length=bed.length,
            trajectory=trajectory,
            steps=bed.step,
            expected=request.cloud.radius.size,
            dangerous_builds=0,
            engine=self.name,
            engine_version=__version__,
            wall_time=time.monotonic() - started,
        )


def _settle(bed: Bed, request: SettleRequest, started: float) -> Trajectory:
    """Advance from check to check until the stop rule holds or its patience ends."""
    rule, spec = request.rule, request.spec
    records = [bed.record()]
    peak, calm, reported = 0.0, 0, started
    for check in range(rule.max_checks):
        if spec.write_vtk and check % CHECKS_PER_PICTURE == 0:
            write_vtk(request.folder / f"packing_{bed.step}.vtk", *bed.state(), request.cloud.radius)
        bed.advance(rule.check_steps)
        records.append(bed.record())
        (_, before, _, _), (_, after, energy, _) = records[-2:]
        if not math.isfinite(after + energy):
            raise EngineError("the bed exploded: positions are no longer finite; use a shorter time step")
        peak = max(peak, energy)
        calm = calm + 1 if rule.is_calm(before, after, energy, peak) else 0
        if calm >= rule.calm_checks:
            break
        now = time.monotonic()
        if spec.time_limit > 0.0 and now - started > spec.time_limit:
            raise EngineError(f"time limit of {spec.time_limit:g} s reached; the packing was stopped", transient=True)
        if now - reported > PROGRESS_SECONDS:
            reported = now
            request.progress(f"step {bed.step:,}, {bed.count:,} of {bed.total:,} spheres down")
    return Trajectory(*np.array(records, dtype=np.float64).T)
