"""What the embedded engine leaves out changes nothing: spheres in free fall, neighbour lists, and a stop halfway."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from filtercake.crystals.csd import mixture
from filtercake.packing.cloud import Cloud, make_cloud
from filtercake.packing.engines import embedded
from filtercake.packing.engines.base import SettleRequest
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.engines.embedded_bed import Bed
from filtercake.packing.scene import Scene
from filtercake.packing.settling import StopRule

CSD = mixture([20e-6, 50e-6], [0.5, 0.5])
SCENE = Scene(
    csd=CSD,
    particles=400,
    initial_void_fraction=0.65,
    settling_velocity=0.01,
    density=1180.0,
    youngs_modulus=5e6,
    poisson_ratio=0.2,
    restitution=0.3,
    friction=0.0,
    cohesion=50e3,
    time_step=0.1e-6,
    engine="embedded",
)


def all_awake(cloud, scene):
    """The same cloud with every sphere in the bed from the start: nothing is left out."""
    velocity = np.zeros_like(cloud.position)
    velocity[:, 2] = -scene.settling_velocity
    return Bed(cloud.position, velocity, cloud.radius, cloud.length, scene)


def apart(one, other):
    """Largest distance between the same sphere in two beds, in smallest radii."""
    difference = one.state()[0] - other.state()[0]
    difference[:, :2] -= one.length * np.round(difference[:, :2] / one.length)
    return np.abs(difference).max() / one.radius.min()


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize(
    ("speed", "steps"),
    # fast ones cross more than a skin between two looks at the airborne spheres; chaos comes sooner, too
    [(0.01, 12_000), (0.5, 1500), (2.0, 500)],
)
def test_free_fall_left_out_changes_nothing(speed, steps, friction):
    scene = replace(SCENE, settling_velocity=speed, time_step=0.05e-6 if speed > 0.1 else 0.1e-6, friction=friction)
    cloud = make_cloud(CSD, scene.particles, scene.initial_void_fraction, 1)
    lazy, eager = Bed.from_cloud(cloud, scene), all_awake(cloud, scene)
    for bed in (lazy, eager):
        bed.advance(steps)
    assert 60 < lazy.down < lazy.count < lazy.total  # some landed, some near, some far: all three kinds are there
    assert apart(lazy, eager) < 1e-6


def test_a_chain_of_spheres_wakes_upwards():
    """A tall column with hair-thin gaps: a blow at its foot runs up faster than the spheres fall."""
    n, radius = 12, 10e-6
    height = radius + 2e-6 + np.arange(n) * (2.0 * radius + 1e-9)
    lean = 0.05 * radius * np.arange(n) % (0.3 * radius)
    cloud = Cloud(np.column_stack([50e-6 + lean, np.full(n, 50e-6), height]), np.full(n, radius), 100e-6, 400e-6)
    scene = replace(SCENE, settling_velocity=0.3, time_step=0.05e-6)
    lazy, eager = Bed.from_cloud(cloud, scene), all_awake(cloud, scene)
    for bed in (lazy, eager):
        bed.advance(600)
    assert lazy.down > 3
    assert apart(lazy, eager) < 1e-6


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_neighbour_skin_changes_nothing(friction):
    cloud = make_cloud(CSD, SCENE.particles, SCENE.initial_void_fraction, 1)
    beds = [Bed.from_cloud(cloud, replace(SCENE, friction=friction, skin=skin)) for skin in (0.4e-6, 3e-6, 30e-6)]
    for bed in beds:
        bed.advance(12_000)
    assert beds[0].down > 60
    assert max(apart(beds[0], other) for other in beds[1:]) < 1e-6


def test_a_bed_costs_pairs_only_where_it_lies():
    cloud = make_cloud(CSD, SCENE.particles, SCENE.initial_void_fraction, 1)
    bed = Bed.from_cloud(cloud, SCENE)
    bed.advance(12_000)
    # a quarter of the fall: most spheres are still on their parabola
    assert bed.count < 0.6 * bed.total


class Killed(BaseException):
    """Like a signal: not an error that anything catches."""


def request(cloud, scene, folder, progress=lambda _line: None):
    rule = StopRule.for_bed(scene, cloud.length)
    return SettleRequest(scene, cloud, rule, 1, folder, progress, folder / "bed.state.npz")


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_bed_killed_halfway_ends_as_one_that_was_not(tmp_path: Path, monkeypatch, friction):
    scene = replace(SCENE, particles=200, friction=friction, time_step=0.15e-6)
    cloud = make_cloud(CSD, scene.particles, scene.initial_void_fraction, 1)
    undisturbed = Embedded().settle(request(cloud, scene, tmp_path))
    assert not list(tmp_path.glob("*"))  # a short packing saves nothing
    monkeypatch.setattr(embedded, "STATE_SECONDS", 0.0)
    monkeypatch.setattr(embedded, "PROGRESS_SECONDS", 0.0)
    lines = []

    def kill_at_check(limit):
        def progress(line):
            lines.append(line)
            if len(lines) == limit:
                raise Killed

        return progress

    for limit in (10, 22):  # twice
        with pytest.raises(Killed):
            Embedded().settle(request(cloud, scene, tmp_path, kill_at_check(limit)))
    state = Embedded().settle(request(cloud, scene, tmp_path, lines.append))
    assert sum("resumed at step" in line for line in lines) == 2
    assert np.array_equal(state.position, undisturbed.position)
    assert np.array_equal(state.velocity, undisturbed.velocity)
    assert np.array_equal(state.trajectory.porosity_sample, undisturbed.trajectory.porosity_sample)
    assert state.steps == undisturbed.steps


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 cut short", b"not an archive"])
def test_a_damaged_state_is_as_none(tmp_path: Path, damage):
    scene = replace(SCENE, particles=60, time_step=0.25e-6)
    cloud = make_cloud(CSD, scene.particles, scene.initial_void_fraction, 1)
    undisturbed = Embedded().settle(request(cloud, scene, tmp_path))
    (tmp_path / "bed.state.npz").write_bytes(damage)
    assert np.array_equal(Embedded().settle(request(cloud, scene, tmp_path)).position, undisturbed.position)


def test_a_state_of_another_number_of_threads_is_refused():
    cloud = make_cloud(CSD, 60, SCENE.initial_void_fraction, 1)
    saved = Bed.from_cloud(cloud, SCENE, threads=2).saved()
    with pytest.raises(ValueError, match="another number of threads"):
        Bed.from_cloud(cloud, SCENE).restore(saved)


def test_a_second_process_compiles_no_kernel_anew():
    """A loop compiled anew in every process costs each seconds, and nothing else shows it."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from test_embedded_waking import CSD, SCENE, Bed, make_cloud\n"
        "bed = Bed.from_cloud(make_cloud(CSD, 20, SCENE.initial_void_fraction, 1), SCENE)\n"
        "bed.advance(20_000)\n"
        "print(*(sum(kernel.stats.cache_misses.values()) for kernel in (bed.kernel, bed.find_pairs)))\n"
    )
    command = [sys.executable, "-c", code, str(Path(__file__).parent)]
    for _ in range(2):  # the first fills the cache, unless it is full
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0", "0"]


def test_reports_say_how_many_are_down_and_when_it_ends(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(embedded, "PROGRESS_SECONDS", 0.0)
    cloud = make_cloud(CSD, SCENE.particles, SCENE.initial_void_fraction, 1)
    lines = []
    Embedded().settle(request(cloud, replace(SCENE, time_step=0.25e-6), tmp_path, lines.append))
    down = [int(re.search(r", ([\d,]+) of 400 spheres down, ", line).group(1).replace(",", "")) for line in lines]
    assert down == sorted(down)
    assert down[-1] == SCENE.particles
    assert all(line.endswith(" left") for line in lines)


def test_compiling_the_engine_does_not_lengthen_the_forecast(tmp_path: Path, monkeypatch):
    clock = [0.0]
    cloud = make_cloud(CSD, SCENE.particles, SCENE.initial_void_fraction, 1)
    scene = replace(SCENE, time_step=0.25e-6)
    advance = Bed.advance
    lines = []

    def timed(bed, steps):
        clock[0] += 1000.0 if clock[0] == 0.0 else 1.0  # the first steps compile
        advance(bed, steps)

    monkeypatch.setattr(embedded.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(Bed, "advance", timed)
    monkeypatch.setattr(embedded, "PROGRESS_SECONDS", 0.5)
    run = embedded._Run(request(cloud, scene, tmp_path, lines.append), Bed.from_cloud(cloud, scene, 1))
    run.settle()
    took = clock[0] - 1000.0  # a second a check
    forecasts = [re.search(r"about (\d+) (min|s) left", line).groups() for line in lines]
    seconds = [int(number) * (60 if unit == "min" else 1) for number, unit in forecasts]
    assert len(seconds) == len(run.records) - 2  # none before the pace is known
    assert max(seconds) < 5.0 * took
