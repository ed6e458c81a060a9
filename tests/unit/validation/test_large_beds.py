"""Large beds: a settled bed laid side by side with itself, and what a whole bed would take."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from filtercake.crystals.csd import mixture
from filtercake.packing.engines.pair_kernels import FAR
from filtercake.packing.scene import Scene
from filtercake.study.estimate import fall_steps
from filtercake.validation import large_beds
from filtercake.validation.large_beds import IN_BED, large_beds_of, time_large_beds, whole_bed_hours

SCENE = large_beds_of(
    Scene(
        csd=mixture([20e-6, 30e-6], [0.5, 0.5]),
        particles=150,
        initial_void_fraction=0.65,
        settling_velocity=0.01,
        density=1180.0,
        youngs_modulus=5e6,
        poisson_ratio=0.2,
        restitution=0.3,
        friction=0.0,
        cohesion=50e3,
        time_step=0.25e-6,
        engine="embedded",
    ),
    150,
)


# the second is so large that what comes next is fetched ahead
@pytest.mark.parametrize("count", [2, math.ceil(math.sqrt(FAR / SCENE.particles))])
def test_beds_are_laid_side_by_side_without_a_seam(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The forces on every tile are those on the bed that was laid out."""
    position, velocity, radius, length = large_beds._settled(SCENE)
    forces = []

    class Kept(large_beds.Bed):
        def advance(self, steps: int) -> None:
            super().advance(steps)
            if self.threads == 1 and not self.step > 10:
                back = np.argsort(self.identity)
                forces.append(self.force[0][back])

    monkeypatch.setattr(large_beds, "Bed", Kept)
    large_beds._time(SCENE, position, velocity, radius, length, 1, 1)
    shift = length * np.array([(i, j, 0) for j in range(count) for i in range(count)], dtype=float)
    tiled = np.vstack([position + way for way in shift])
    tiles = count**2
    large_beds._time(SCENE, tiled, np.tile(velocity, (tiles, 1)), np.tile(radius, tiles), count * length, 1, 1)
    one, all_of_them = forces
    assert all_of_them == pytest.approx(np.tile(one, (tiles, 1)), rel=1e-6, abs=1e-6 * np.abs(one).max())


def test_every_bed_is_timed_on_one_and_two_threads() -> None:
    table = time_large_beds(SCENE, (1, 2), 5, 1)
    assert table["particles"].tolist() == [150, 150, 600, 600]
    assert table["threads"].tolist() == [1, 2, 1, 2]
    assert (table["ns_per_particle_step"] > 0.0).all() and table["peak_memory_MB"].is_monotonic_increasing


def test_what_one_thread_does_alone_stays() -> None:
    rows = [(40_000, 1, 9.0), (40_000, 2, 9.0), (1_000_000, 1, 20.0), (1_000_000, 2, 12.0)]
    table = pd.DataFrame(rows, columns=["particles", "threads", "ns_per_particle_step"])
    hours = whole_bed_hours(SCENE, table, (1, 2, 4)).set_index("cores")["hours"]
    one = fall_steps(replace(SCENE, particles=1_000_000)) * 1e6 * IN_BED * 20e-9 / 3600.0
    assert hours[1] == pytest.approx(one)
    assert hours[2] == pytest.approx(one * 0.6)
    assert hours[4] == pytest.approx(one * (0.2 + 0.8 / 4))
