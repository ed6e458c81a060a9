"""Fixtures shared by all tests: the paper's materials and distributions, and a LIGGGHTS that may be missing."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import settings
from scipy.special import gammainc

from filtercake.crystals.csd import CrystalSizeDistribution, Truncation, discretise, mixture, truncate
from filtercake.packing.cloud import Cloud
from filtercake.packing.engines.liggghts import find_executable
from filtercake.packing.result import SettledState
from filtercake.packing.scene import Scene
from filtercake.packing.settling import StopRule, Trajectory
from filtercake.study.loading import LoadedStudy, load_study

settings.register_profile("filtercake", max_examples=50, deadline=None, derandomize=True)
settings.load_profile("filtercake")

UM = 1e-6

ALUM_G_TAU = {15: 58.417e-6, 30: 67.103e-6, 45: 72.771e-6, 60: 77.081e-6}
"""Growth rate times residence time (m) of the ammonium alum crystallizer by residence time (min)."""


@pytest.fixture
def liggghts() -> str:
    """Path of LIGGGHTS; skips the test where there is none."""
    executable = find_executable()
    if executable is None:
        pytest.skip("LIGGGHTS is not installed (filtercake.packing.engines.liggghts.find_executable() is None)")
    return executable


@pytest.fixture(autouse=True)
def _liggghts_or_skip(request: pytest.FixtureRequest) -> None:
    """Skip tests marked ``liggghts`` where it is missing."""
    if request.node.get_closest_marker("liggghts"):
        request.getfixturevalue("liggghts")


@pytest.fixture(scope="session")
def pmma() -> Callable[[float], CrystalSizeDistribution]:
    """PMMA of 20 and 50 um; takes the volume fraction of the 20 um spheres."""
    return lambda small: mixture([20 * UM, 50 * UM], [small, 1.0 - small])


@pytest.fixture(scope="session")
def alum() -> Callable[[int], tuple[CrystalSizeDistribution, Truncation]]:
    """Alum crystals of a residence time (min): the full distribution and its truncation, as the paper cuts them."""

    def make(minutes: int) -> tuple[CrystalSizeDistribution, Truncation]:
        a = ALUM_G_TAU[minutes]
        full = discretise(lambda size: gammainc(4, size / a), upper=15.0 * a, bin_width=5.0 * UM)
        return full, truncate(full, 1e-3)

    return make


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., Scene]:
    """A scene of half 30 um, half 50 um PMMA at the paper's values; keywords replace some of them."""
    base = Scene(
        csd=mixture([30 * UM, 50 * UM], [0.5, 0.5]),
        particles=300,
        initial_void_fraction=0.65,
        settling_velocity=0.01,
        density=1180.0,
        youngs_modulus=5e6,
        poisson_ratio=0.2,
        restitution=0.3,
        friction=0.0,
        cohesion=50e3,
        time_step=0.0,
        engine="liggghts",
    ).with_time_step(0.36)
    return lambda **changes: dataclasses.replace(base, **changes)


@pytest.fixture(scope="session")
def small_csd() -> CrystalSizeDistribution:
    """Half 30 um, half 50 um: coarse enough for a packing in two seconds."""
    return mixture([30 * UM, 50 * UM], [0.5, 0.5])


def calm_trajectory(height: float, checks: int = 30) -> Trajectory:
    """Build the record of a bed that falls, lands and comes to rest at a mean height (m)."""
    k = np.arange(checks)
    energy = np.where(k < 10, 1.0 + k, 10.0 * 10.0 ** -(k - 9.0)) * 1e-12
    return Trajectory(
        time=k * 1e-5,
        mean_height=height * (1.0 + np.exp(-0.8 * k)),
        kinetic_energy=np.maximum(energy, 1e-20),
        porosity_sample=np.full(checks, 0.4),
    )


@pytest.fixture
def settled_lattice(make_scene: Callable[..., Scene]) -> SimpleNamespace:
    """A bed that must be accepted: a simple cubic lattice at rest, with its scene, cloud and stop rule.

    Six layers of 5 x 5 spheres of 40 um that just touch one another and the floor: N = 150, L = 200 um.
    """
    side, layers, radius = 5, 6, 20 * UM
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in (side, side, layers)), indexing="ij"), axis=-1).reshape(-1, 3)
    position = (2.0 * grid + 1.0) * radius
    length = 2.0 * side * radius
    n = len(position)
    radii = np.full(n, radius)
    cloud = Cloud(position, radii, length, 2.0 * length)
    scene = make_scene(particles=n)
    rule = StopRule(check_steps=100, max_checks=160, height_tolerance=1e-4 / 0.65)
    state = SettledState(
        position=position.copy(),
        velocity=np.zeros((n, 3)),
        radius=radii.copy(),
        length=length,
        trajectory=calm_trajectory(float(position[:, 2].mean())),
        steps=3000,
        expected=n,
        dangerous_builds=0,
        engine="liggghts",
        engine_version="test",
    )
    return SimpleNamespace(state=state, scene=scene, cloud=cloud, rule=rule)


STUDY = """\
title: A study for tests
csds:
  bimodal:
    label: half and half
    mixture:
      - {size_um: 20, volume_fraction: 0.5}
      - {size_um: 50, volume_fraction: 0.5}
material:
  density_kg_m3: 1180
sweeps:
  - csd: bimodal
"""
"""The smallest useful study."""


@pytest.fixture
def write_study(tmp_path: Path) -> Callable[..., Path]:
    """Write a study file; takes its text (default: a small good one) and its name."""

    def write(text: str = STUDY, name: str = "study.yaml") -> Path:
        path = tmp_path / name
        path.write_text(textwrap.dedent(text), encoding="utf-8")
        return path

    return write


@pytest.fixture
def study_from(write_study: Callable[..., Path]) -> Callable[..., LoadedStudy]:
    """Write and load a study."""
    return lambda text=STUDY, name="study.yaml": load_study(write_study(text, name))


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """No program at all is on the PATH."""
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.setenv("PATH", str(empty))
    monkeypatch.delenv("FILTERCAKE_LIGGGHTS", raising=False)
    return empty


@pytest.fixture
def good_study() -> str:
    """Text of a small good study, to be broken by a test."""
    return STUDY
