"""Stokes flow against closed forms and published arrays, and what it must not depend on."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filtercake.errors import FiltercakeError
from filtercake.permeability import stokes
from filtercake.permeability.lattice import Lattice, Spheres, build, connect
from filtercake.permeability.stokes import Flow

SIMPLE = np.array([[0.5, 0.5, 0.5]])
BODY_CENTRED = np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.5]])
FACE_CENTRED = np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]])


def array(centres: np.ndarray, solids: float) -> Spheres:
    """Equal spheres in a unit cube."""
    radius = (0.75 * solids / math.pi / len(centres)) ** (1 / 3)
    return Spheres(centres, np.full(len(centres), radius), np.ones(3))


def random_spheres(seed: int = 1, count: int = 12) -> Spheres:
    """Spheres of several sizes at random places, overlapping here and there."""
    chance = np.random.default_rng(seed)
    return Spheres(chance.random((count, 3)), chance.uniform(0.1, 0.2, count), np.ones(3))


def permeability(lattice: Lattice, steps: int = 0, **options: object) -> float:
    """Permeability of a periodic lattice under a unit force, in squares of the box's unit."""
    flow = Flow(lattice, np.ones(lattice.shape[0]), **options)  # type: ignore[arg-type]
    before = math.inf
    while flow.steps < (steps or 20000):
        flow.run(50)
        found = float(flow.layers()[1].mean())
        if not steps and abs(found - before) < 1e-6 * found:
            break
        before = found
    return found * flow.viscosity * lattice.spacing**2


def drag(centres: np.ndarray, solids: float, across: int) -> float:
    """Drag factor K = d^2 / (18 phi k), the mean over two places of the lattice."""
    spheres = array(centres, solids)
    diameter = 2.0 * float(spheres.radius[0])
    found = [permeability(build(spheres, across, (shift,) * 3)) for shift in (0.1, 0.4)]
    return diameter**2 / (18.0 * solids * float(np.mean(found)))


@pytest.mark.parametrize(("solids", "published"), [(0.125, 4.292), (0.343, 15.4), (0.5236, 42.1)])
def test_simple_cubic_arrays(solids: float, published: float) -> None:
    # Zick and Homsy, J. Fluid Mech. 115 (1982) 13
    assert drag(SIMPLE, solids, 28) == pytest.approx(published, rel=0.01)


@pytest.mark.parametrize(
    ("centres", "solids", "low", "high"),
    [
        (BODY_CENTRED, math.sqrt(3.0) * math.pi / 8.0, 5.014e-4, 5.014e-4),
        (FACE_CENTRED, math.pi / math.sqrt(18.0), 1.72e-4, 1.736e-4),
    ],
)
def test_touching_arrays_after_extrapolation(centres: np.ndarray, solids: float, low: float, high: float) -> None:
    coarse, fine = (1.0 / (18.0 * solids * drag(centres, solids, across)) for across in (44, 66))
    found = fine + (fine - coarse) / (1.5**2.7 - 1.0)
    assert 0.98 * low < found < 1.02 * high


@pytest.mark.parametrize("distance", [0.5, 0.0, 0.3, 0.8])
def test_plane_channel(distance: float) -> None:
    # flow along z between walls that lie anywhere on the links: the parabola y (H - y) / 2 at the nodes
    number = np.zeros((4, 13, 4), dtype=np.int32)
    number[:, 0, :] = -1
    height, y = 11.0 + 2.0 * distance, distance + np.arange(12)
    exact = np.sum(y * (height - y) / 2.0) / 13.0
    tolerance = 1e-5 if distance == 0.5 else 0.001  # distances are kept to 1/254
    assert permeability(connect(number, 1.0, wall_distance=distance)) == pytest.approx(exact, rel=tolerance)


def test_flow_does_not_depend_on_the_relaxation_time() -> None:
    lattice = build(random_spheres(), 20)
    found = [permeability(lattice, 3000, relaxation_time=tau, precision=np.float64) for tau in (1.25, 1.6, 2.0)]
    assert found == pytest.approx([found[0]] * 3, rel=1e-5)


def test_flow_does_not_depend_on_the_width_of_floats() -> None:
    lattice = build(random_spheres(), 20)
    narrow, wide = (permeability(lattice, 1000, precision=kind) for kind in (np.float32, np.float64))
    assert narrow == pytest.approx(wide, rel=1e-5)


def test_threads_do_not_change_a_bit() -> None:
    lattice = build(random_spheres(), 20)
    assert permeability(lattice, 200, threads=1) == permeability(lattice, 200, threads=2)


def test_a_shift_through_the_periodic_edge_changes_nothing() -> None:
    spheres, across = random_spheres(), 16
    moved = Spheres((spheres.position + np.array([5, 11, 3]) / across) % 1.0, spheres.radius, spheres.box)
    one, other = (permeability(build(of, across), 400, precision=np.float64) for of in (spheres, moved))
    assert one == pytest.approx(other, rel=1e-12)


def test_overlapping_spheres_are_their_union() -> None:
    # a small sphere inside a large one, and a doubled one, are not there
    lone = array(SIMPLE, 0.3)
    radius = lone.radius[0]
    more = Spheres(np.repeat(SIMPLE, 3, axis=0), np.array([radius, radius, 0.6 * radius]), lone.box)
    assert permeability(build(lone, 16), 200) == permeability(build(more, 16), 200)


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_walls_are_where_the_first_sphere_is(order: list[int]) -> None:
    # both cover node 3 of the row, at 3.5; along x, one begins at 2.6 and the other at 2.9
    position, radius = np.array([[4.6, 4.5, 4.5], [4.4, 4.5, 4.5]]), np.array([2.0, 1.5])
    lattice = build(Spheres(position[order], radius[order], np.full(3, 9.0)), 9)
    node = lattice.number[4, 4, 2]
    place = (node // 64) * 19 * 64 + 1 * 64 + node % 64
    assert lattice.number[4, 4, 3] == -1
    assert lattice.wall[place] / 127.0 == pytest.approx(1.0 - 2.0 * 0.1, abs=0.5 / 127.0)


def test_a_coarse_flow_is_near_the_fine_one() -> None:
    spheres = random_spheres(3)
    coarse, lattice = build(spheres, 20), build(spheres, 30)
    first = Flow(coarse, np.ones(20))
    first.run(600)
    fine, cold = Flow(lattice, np.ones(30)), Flow(lattice, np.ones(30))
    fine.start_from(first)
    settled = permeability(lattice, 2000)
    for flow in (fine, cold):
        flow.run(50)
    near, far = (abs(float(flow.layers()[1].mean()) * flow.viscosity / 900.0 / settled - 1.0) for flow in (fine, cold))
    assert near < 0.03 and near < 0.3 * far


def test_what_no_lattice_can_hold_is_refused() -> None:
    with pytest.raises(FiltercakeError, match="no fluid between the spheres"):
        build(Spheres(SIMPLE, np.array([0.9]), np.ones(3)), 8)
    with pytest.raises(FiltercakeError, match="must be whole numbers"):
        build(Spheres(SIMPLE, np.array([0.3]), np.array([1.0, 1.0, 1.03])), 10)


def test_the_default_relaxation_time_is_stable() -> None:
    # at 1.1 the flow through such spheres blows up
    lattice = build(random_spheres(5, 30), 24)
    flow = Flow(lattice, np.ones(24))
    flow.run(6000)
    late = float(flow.layers()[1].mean())
    flow.run(1000)
    assert stokes.RELAXATION_TIME >= 1.2
    assert float(flow.layers()[1].mean()) == pytest.approx(late, rel=1e-3)
