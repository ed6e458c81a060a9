"""The embedded engine against LIGGGHTS: trajectories of small scenes from the same start.

References: tests/data/force_references.npz, remade by tests/data/force_scenes.py.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "data"))

from force_scenes import EVERY, LENGTH_UM, REFERENCES, SCENES

from filtercake.packing.engines.embedded_bed import Bed


def trajectory(scene):
    """Positions (um), velocities (m/s) and spins (rad/us) every ``EVERY`` steps, (frames, n, 9)."""
    bed = Bed(
        np.array(scene.position) * 1e-6,
        np.array(scene.velocity),
        np.array(scene.radius) * 1e-6,
        LENGTH_UM * 1e-6,
        scene.packed(),
        gravity=scene.gravity,
    )
    bed.spin[:] = np.array(scene.spins()) * 1e6
    frames = []
    for frame in range(scene.steps // EVERY + 1):
        bed.advance(EVERY if frame else 0)
        position, velocity = bed.state()
        spin = bed.full_spin()
        frames.append(np.hstack([position * 1e6, velocity, spin * 1e-6]))
    return np.array(frames)


@pytest.mark.parametrize("name", SCENES)
def test_follows_liggghts(name):
    scene, tolerance = SCENES[name], 1e-4 if name.startswith("cluster") else 1e-6
    with np.load(REFERENCES) as data:
        expected = data[name]
    found = trajectory(scene)
    assert found.shape == expected.shape
    apart = found - expected
    apart[..., :2] -= LENGTH_UM * np.round(apart[..., :2] / LENGTH_UM)
    diameter = 2.0 * min(scene.radius)
    speed = max(np.abs(expected[..., 3:6]).max(), 1e-3)
    turning = max(np.abs(expected[..., 6:9]).max(), 1e-4)
    assert np.abs(apart[..., :3]).max() < tolerance * diameter
    assert np.abs(apart[..., 3:6]).max() < tolerance * speed
    if scene.friction > 0.0:
        assert np.abs(apart[..., 6:9]).max() < tolerance * turning
    # the scene does something: a wrong force could not hide behind spheres that only drift
    assert np.ptp(expected[..., 3:6], axis=0).max() > 1e-3 * speed
