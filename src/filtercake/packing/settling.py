"""When a settling bed is at rest: one rule, evaluated the same way whatever the engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filtercake.packing.cloud import PLACEMENT_HEIGHT
from filtercake.packing.scene import Scene
from filtercake.units import FloatArray

CHECKS_PER_FALL = 40
"""Checks of the stop rule during one free-fall time of the highest sphere."""
CALM_CHECKS = 2
"""Checks on end that must find the bed at rest."""
WINDOW = 4
"""Checks whose mean height is compared with that of as many before them: a deep bed swings on its soft contacts."""
ENERGY_FRACTION = 1e-3
"""The kinetic energy must have fallen below this share of its peak."""
TYPICAL_SOLIDS = 0.65
"""Solids fraction used to turn a tolerance on porosity into one on the bed's mean height."""


@dataclass(frozen=True)
class Trajectory:
    """What the stop rule saw, one entry per check; arrays of shape (m,).

    Attributes
    ----------
    time : ndarray
        Physical time since release, s.
    mean_height : ndarray
        Height of the spheres' centre of mass, m.
    kinetic_energy : ndarray
        Translational kinetic energy of all spheres, J.
    porosity_sample : ndarray
        Porosity of the paper's sample region (centres in 0..L counted whole).
    """

    time: FloatArray
    mean_height: FloatArray
    kinetic_energy: FloatArray
    porosity_sample: FloatArray


@dataclass(frozen=True)
class StopRule:
    """The bed is at rest when its mean height and its kinetic energy have both stopped falling.

    The mean height z of a bed of solids fraction 1-eps obeys d eps = (1-eps) dz/z, so that a tolerance on
    porosity is one on height, which is free of the counting noise of a sample region. A deep bed goes on swinging
    when it has long stopped falling: it counts as calm, too, when the mean over a window of checks no longer falls.

    Attributes
    ----------
    check_steps : int
        Time steps between checks.
    max_checks : int
        Checks after which the bed counts as unsettled.
    height_tolerance : float
        Largest relative change of the mean height between checks.
    energy_fraction : float
        Largest kinetic energy over its peak.
    calm_checks : int
        Checks on end that must pass.
    """

    check_steps: int
    max_checks: int
    height_tolerance: float
    energy_fraction: float = ENERGY_FRACTION
    calm_checks: int = CALM_CHECKS

    @classmethod
    def for_bed(cls, scene: Scene, length: float) -> StopRule:
        """Scale the rule to a box of side ``length`` (m)."""
        fall_time = scene.free_fall_time(PLACEMENT_HEIGHT * scene.bed_depth_factor * length)
        check_steps = max(1, round(fall_time / CHECKS_PER_FALL / scene.time_step))
        return cls(
            check_steps=check_steps,
            max_checks=max(CALM_CHECKS, round(CHECKS_PER_FALL * scene.max_fall_times)),
            height_tolerance=scene.porosity_tolerance / TYPICAL_SOLIDS,
        )

    def is_calm(self, heights: FloatArray, energy: float, peak_energy: float) -> bool:
        """Whether one check finds the bed at rest.

        Parameters
        ----------
        heights : ndarray, shape (m,)
            Mean heights up to this check, m; before the first the bed stood at the first.
        energy, peak_energy : float
            Kinetic energy now and at its largest, J.
        """
        if not energy < self.energy_fraction * peak_energy:
            return False
        last = np.concatenate([np.full(max(0, 2 * WINDOW - heights.size), heights[0]), heights[-2 * WINDOW :]])
        fallen = abs(last[-2] - last[-1]) / last[-1]
        older, newer = last[:WINDOW].mean(), last[WINDOW:].mean()
        swung = abs(older - newer) / newer / WINDOW
        return bool(min(fallen, swung) < self.height_tolerance)

    def settled_at(self, trajectory: Trajectory) -> int | None:
        """Index of the check at which the rule held, or None.

        The engine decides when to stop; this repeats its decision from the record, so that an engine that
        stopped for another reason is found out.
        """
        peak, calm = 0.0, 0
        for k in range(1, trajectory.time.size):
            energy = float(trajectory.kinetic_energy[k])
            peak = max(peak, energy)
            calm = calm + 1 if self.is_calm(trajectory.mean_height[: k + 1], energy, peak) else 0
            if calm >= self.calm_checks:
                return k
        return None


def stopped_falling(trajectory: Trajectory, porosity_tolerance: float, last_share: float = 0.1) -> bool:
    """Whether the sample porosity changed by less than a tolerance over the last part of a fixed-length run.

    The paper's own criterion (Fig 3), used for the as-published protocol, which runs a fixed number of steps.
    """
    count = max(2, int(trajectory.time.size * last_share))
    height = trajectory.mean_height[-count:]
    fallen = float(np.ptp(height)) / float(height[-1]) * TYPICAL_SOLIDS
    return fallen < porosity_tolerance
