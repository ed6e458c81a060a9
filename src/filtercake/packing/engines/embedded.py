"""The embedded engine: the same contact law as LIGGGHTS, compiled on the spot, from pip alone."""

from __future__ import annotations

import math
import time
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from filtercake.errors import EngineError, TimeLimitReached
from filtercake.packing.engines.base import Engine, SettleRequest, parallelism
from filtercake.packing.pictures import write_vtk
from filtercake.packing.result import SettledState, publish
from filtercake.packing.scene import Scene
from filtercake.packing.settling import TYPICAL_SOLIDS, Trajectory
from filtercake.units import FloatArray

if TYPE_CHECKING:
    from filtercake.packing.engines.embedded_bed import Bed

PROGRESS_SECONDS = 20.0
STATE_SECONDS = 60.0
"""Wall time between two savings of a long bed's state."""
CHECKS_PER_PICTURE = 4
REST_AFTER_ARRIVAL = 1.2
"""Time at which a bed is at rest over that at which its last sphere arrives; for the forecast only."""


class Embedded(Engine):
    """Numba kernels for the Hertz + SJKR contact law with optional friction, in double precision."""

    name = "embedded"
    label = "embedded engine"
    sphere_step = (9.2e-9, 20.5e-9)
    compiles = True

    @classmethod
    def suits(cls, scene: Scene) -> bool:  # noqa: ARG003
        """Whether ``engine: auto`` may take it: always."""
        return True

    def settle(self, request: SettleRequest) -> SettledState:
        """Let the cloud settle (see :class:`filtercake.packing.engines.base.Engine`)."""
        # who plans a study need not wait for the compiler
        from filtercake import __version__
        from filtercake.packing.engines.embedded_bed import Bed, use_threads

        threads = parallelism(request.scene)
        if threads > 1:
            use_threads(threads)
        run = _Run(request, Bed.from_cloud(request.cloud, request.scene, threads))
        run.resume()
        run.settle()
        position, velocity = run.bed.state()
        return SettledState(
            position=position,
            velocity=velocity,
            radius=request.cloud.radius,
            length=run.bed.length,
            trajectory=run.trajectory(),
            steps=run.bed.step,
            expected=request.cloud.radius.size,
            dangerous_builds=0,
            engine=self.name,
            engine_version=__version__,
            wall_time=run.spent(),
        )


class _Run:
    """One bed on its way to rest: what the stop rule saw, reports, pictures and the saved state."""

    def __init__(self, request: SettleRequest, bed: Bed):
        self.request, self.bed = request, bed
        self.records = [bed.record()]
        self.started = self.reported = self.saved = time.monotonic()
        self.before = 0.0  # wall time spent before the bed was resumed, s
        self.work = 0  # spheres in the bed times steps since the pace is taken
        self.paced: float | None = None  # since when: the first steps compile the engine and say nothing of the pace

    def settle(self) -> None:
        """Advance from check to check until the stop rule holds or its patience ends.

        Raises
        ------
        EngineError
            If the bed explodes.
        TimeLimitReached
            At the time limit; the saved state lets it go on.
        """
        rule, scene = self.request.rule, self.request.scene
        while len(self.records) <= rule.max_checks and rule.settled_at(self.trajectory()) is None:
            self._picture()
            self.bed.advance(rule.check_steps)
            if self.paced is None:
                self.paced = self.reported = time.monotonic()
            else:
                self.work += self.bed.count * rule.check_steps
            self.records.append(self.bed.record())
            if not all(map(math.isfinite, self.records[-1])):
                raise EngineError(
                    "the bed exploded: positions are no longer finite; use a shorter time step", outcome="exploded"
                )
            now = time.monotonic()
            if 0.0 < scene.time_limit < now - self.started:
                self._save()
                raise TimeLimitReached(scene.time_limit)
            if now - self.saved > STATE_SECONDS:
                self._save()
            if now - self.reported > PROGRESS_SECONDS:
                self.reported = now
                self.request.progress(self._report())

    def trajectory(self) -> Trajectory:
        """Return what the stop rule saw so far."""
        return Trajectory(*np.array(self.records, dtype=np.float64).T)

    def spent(self) -> float:
        """Wall time of the packing, s, with what was spent before it was resumed."""
        return self.before + time.monotonic() - self.started

    def resume(self) -> None:
        """Go on from a saved state if there is one; one that cannot be read is not there."""
        path = self.request.state_file
        if path is None or not path.exists():
            return
        try:
            with np.load(path) as data:
                records, before = data["records"], float(data["spent"])
                self.bed.restore({name: data[name] for name in data.files})
        except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile):
            self.bed = type(self.bed).from_cloud(self.request.cloud, self.request.scene, self.bed.threads)
            return
        self.records = [tuple(row) for row in records]
        self.before = before
        self.request.progress(f"resumed at step {self.bed.step:,}")

    def _save(self) -> None:
        path = self.request.state_file
        if path is None:
            return
        with publish(path) as temporary, temporary.open("wb") as stream:
            np.savez(stream, records=np.array(self.records), spent=self.spent(), **self.bed.saved())
        self.saved = time.monotonic()

    def _picture(self) -> None:
        check = len(self.records) - 1
        if self.request.scene.write_vtk and check % CHECKS_PER_PICTURE == 0:
            path: Path = self.request.folder / f"packing_{self.bed.step}.vtk"
            write_vtk(path, *self.bed.state(), self.request.cloud.radius)

    def _report(self) -> str:
        bed = self.bed
        left = self._seconds_left()
        when = f"about {left / 60.0:.0f} min left" if left > 90.0 else f"about {left:.0f} s left"
        return f"step {bed.step:,}, {bed.down:,} of {bed.total:,} spheres down, {when}"

    def _seconds_left(self) -> float:
        """Forecast from the pace so far and the spheres' free fall on a bed that rises with them."""
        bed, cloud = self.bed, self.request.cloud
        depth = (1.0 - cloud.void_fraction) * cloud.height / TYPICAL_SOLIDS
        arrival = self.request.scene.free_fall_time(max(cloud.height - depth, 0.0)) / self.request.scene.time_step
        steps = np.linspace(bed.step, max(REST_AFTER_ARRIVAL * arrival, 1.02 * bed.step), 101)
        down: FloatArray = np.minimum(
            1.0, np.array([bed.fallen(int(step)) for step in steps]) / bed.fallen(int(arrival))
        )
        pace = (time.monotonic() - (self.paced or self.started)) / max(self.work, 1)
        return float(pace * bed.total * down.mean() * (steps[-1] - steps[0]))
