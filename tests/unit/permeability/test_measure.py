"""Permeability of beds and cells: independent methods, error budgets, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filtercake.errors import FiltercakeError
from filtercake.filtration.resistance import KozenyConstant
from filtercake.permeability import measure
from filtercake.permeability.lattice import Spheres, build
from filtercake.permeability.measure import Domain, bed_domain, cell_domain, measure_bed, measure_cell, solve
from filtercake.permeability.replicates import constant_of
from filtercake.permeability.resolution import LEVELS
from filtercake.permeability.stokes import Flow

UM = 1e-6
SIMPLE_CUBIC = {0.343: 15.4, 0.5236: 42.1}
"""Drag factor K of simple cubic arrays (Zick and Homsy, J. Fluid Mech. 115 (1982) 13)."""


def cubic(cells: int, layers: int, solids: float, side: float = 30.0 * UM) -> tuple[np.ndarray, np.ndarray, float]:
    """Spheres of a cubic array standing on the floor: cells x cells x layers of them, cells of the given side."""
    radius = side * (0.75 * solids / math.pi) ** (1 / 3)
    grid = np.stack(np.meshgrid(*[np.arange(n) for n in (cells, cells, layers)], indexing="ij"), axis=-1)
    position = (grid.reshape(-1, 3) + 0.5) * side
    position[:, 2] += radius - 0.5 * side
    return position, np.full(len(position), radius), cells * side


def loose(seed: int, layers: int = 7) -> tuple[np.ndarray, np.ndarray, float]:
    """A bed of spheres of several sizes near the places of a cubic array."""
    position, radius, length = cubic(3, layers, 0.40)
    chance = np.random.default_rng(seed)
    position += chance.uniform(-2.0, 2.0, position.shape) * UM
    position[:, :2] %= length
    return position, radius * chance.uniform(0.8, 1.1, radius.size), length


@pytest.mark.parametrize("solids", SIMPLE_CUBIC)
def test_a_cell_has_the_published_drag(solids: float) -> None:
    side = 30.0 * UM
    radius = side * (0.75 * solids / math.pi) ** (1 / 3)
    found = measure_cell(np.full((1, 3), 0.37 * side), np.array([radius]), np.full(3, side), accuracy=0.005)
    drag = (2.0 * radius) ** 2 / (18.0 * solids * found.permeability)
    assert drag == pytest.approx(SIMPLE_CUBIC[solids], rel=0.01)
    assert found.sauter_diameter == pytest.approx(2.0 * radius, rel=1e-9)


def test_a_bed_has_the_constant_of_its_cell() -> None:
    # a regular array on the floor, in a box that it does not fill: as the same array without end
    position, radius, length = cubic(2, 12, 0.45)
    bed = measure_bed(position, radius, length, accuracy=0.01)
    cell = measure_cell(position[:1], radius[:1], np.full(3, 30.0 * UM), accuracy=0.01)
    assert bed.permeability == pytest.approx(cell.permeability, rel=0.02)
    assert bed.resistance(1180.0) == pytest.approx(1.0 / (bed.permeability * 1180.0 * (1.0 - bed.porosity)))


def test_layers_in_series_resist_one_after_the_other() -> None:
    # a cell of coarse layers and one of fine ones, each regular: the resistances add, as in eq. 3
    side = 40.0 * UM
    coarse, fine = side * 0.45, side * 0.225
    grid = np.stack(np.meshgrid([0.25, 0.75], [0.25, 0.75], [0.25, 0.75], indexing="ij"), axis=-1).reshape(-1, 3)
    position = np.concatenate(
        [
            np.array([[0.5, 0.5, 0.5 + k] for k in range(4)]),
            *(grid + np.array([0.0, 0.0, 4.0 + k]) for k in range(4)),
        ]
    )
    radius = np.concatenate([np.full(4, coarse), np.full(32, fine)])
    both = measure_cell(position * side, radius, np.array([side, side, 8.0 * side]), accuracy=0.01)
    one = measure_cell(position[:1] * side, radius[:1], np.full(3, side), accuracy=0.005)
    other = measure_cell(grid * side, radius[4:12], np.full(3, side), accuracy=0.005)
    series = 2.0 / (1.0 / one.permeability + 1.0 / other.permeability)
    assert both.permeability == pytest.approx(series, rel=0.03)
    # what a mixture of the same sizes with the Sauter mean would let through is far from it
    assert other.permeability == pytest.approx(one.permeability / 4.0, rel=0.02)


def test_flux_is_the_same_in_every_plane() -> None:
    domain = bed_domain(*loose(1))
    flow, _, _ = measure._converge(domain, 0.02, 1, lambda _: None)
    for _ in range(4):
        measure._balance(flow, 25.0 * UM)
        flow.run(100)
    flux = flow.layers()[2]
    inside = measure._Slabs(domain, flow).inside
    assert np.abs(flux[inside] / flux[inside].mean() - 1.0).max() < 0.005


def test_the_stated_error_holds_wherever_the_lattice_lies() -> None:
    position, radius, length = loose(2)
    found = []
    for step in range(10):
        moved = position.copy()
        moved[:, :2] = (moved[:, :2] + step * np.array([0.31, 0.17]) * UM) % length
        found.append(measure_bed(moved, radius, length))
    values = np.array([item.permeability for item in found])
    assert np.all(np.abs(values / values.mean() - 1.0) < [item.numerical_ci95 for item in found])


def test_the_stated_error_covers_the_fine_solution() -> None:
    for seed in range(3):
        bed = loose(seed)
        coarse, fine = measure_bed(*bed), measure_bed(*bed, accuracy=0.004)
        assert fine.levels[-1].diameters_per_spacing > 1.5 * coarse.levels[-1].diameters_per_spacing
        assert abs(coarse.permeability / fine.permeability - 1.0) < coarse.numerical_ci95


def test_less_accuracy_takes_fewer_nodes() -> None:
    bed = loose(1)
    rough, usual = (bed_domain(*bed, accuracy) for accuracy in (0.1, 0.02))
    assert rough.units < usual.units
    assert bed_domain(*bed, 0.2).units >= 2


def test_a_picture_shows_the_speed_in_the_pores() -> None:
    domain = bed_domain(*loose(1), 0.1)
    _, picture = solve(domain, 0.1, picture=True)
    assert picture is not None
    solid = np.isnan(picture.speed)
    assert 0.2 < solid[picture.speed.shape[0] // 4 : -picture.speed.shape[0] // 4].mean() < 0.7
    assert 1.0 < np.nanmax(picture.speed) < 50.0


def test_more_memory_than_there_is_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure, "available_bytes", lambda: 1e6)
    with pytest.raises(FiltercakeError, match=r"takes .* GB of memory, and 0.001 GB are free: use a larger accuracy"):
        measure_bed(*loose(1))


def test_memory_stated_is_memory_taken() -> None:
    domain = bed_domain(*loose(1))
    lattice = build(domain.spheres, domain.units * LEVELS[1])
    flow = Flow(lattice, np.ones(lattice.shape[0]))
    arrays = [lattice.source, lattice.wall, lattice.layer, lattice.number, flow._f, flow._force]
    taken = sum(array.nbytes for array in arrays)
    assert measure._check_memory(domain, domain.units * LEVELS[1]) == pytest.approx(taken, rel=0.05)


@pytest.mark.parametrize("accuracy", [0.001, 0.5, math.nan])
def test_impossible_accuracies_are_refused(accuracy: float) -> None:
    with pytest.raises(FiltercakeError, match=r"accuracy = .*: must be 0.003 to 0.2"):
        bed_domain(*loose(1), accuracy)


def test_a_shallow_bed_is_refused() -> None:
    with pytest.raises(FiltercakeError, match="the bed is too shallow"):
        bed_domain(*loose(1, layers=2))


def test_a_flow_that_never_settles_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure, "MOST_STEPS", 100)
    with pytest.raises(FiltercakeError, match=r"has not settled after 100 steps on [\d,]+ nodes"):
        measure_bed(*loose(1))


def test_a_cell_needs_whole_spacings() -> None:
    domain = cell_domain(np.full((1, 3), 10 * UM), np.array([9 * UM]), np.array([30.0, 30.0, 41.3]) * UM)
    assert isinstance(domain, Domain)
    with pytest.raises(FiltercakeError, match="must be whole numbers"):
        solve(domain)


def test_constants_of_packings_are_put_together() -> None:
    rows = [{"kozeny_constant": value, "slab": 0.03, "numerical_ci95": 0.01} for value in (160.0, 170.0)]
    found = constant_of(rows)
    assert found == KozenyConstant(165.0, pytest.approx(math.hypot(0.03 / math.sqrt(2.0), 0.01)))
    assert constant_of([]) is None


def test_spheres_of_a_slab_count_by_their_surface() -> None:
    spheres = Spheres(np.full((3, 3), 0.5), np.array([1.0, 1.0, 2.0]), np.full(3, 9.0))
    domain = Domain(spheres, measure.Slab(0.0, 9.0), 10, periodic=True)
    assert measure._effective_spheres(domain) == pytest.approx(36.0 / 18.0)


def test_balancing_evens_the_flux_of_layers() -> None:
    domain = bed_domain(*loose(1))
    lattice = build(domain.spheres, domain.units * LEVELS[0])
    heights = measure._heights(domain, lattice)
    bed = ((heights > 0.0) & (heights < domain.slab.upper)).astype(np.float64)  # as if nothing were foretold
    spread = []
    for balanced in (True, False):
        flow = Flow(lattice, bed)
        while flow.steps < 500:
            if balanced:
                measure._balance(flow, 25.0 * UM)
            flow.run(50)
        flux = flow.layers()[2][measure._Slabs(domain, flow).inside]
        spread.append(flux.std() / flux.mean())
    assert spread[0] < 0.3 * spread[1]


def test_the_porosity_counts_once_what_two_spheres_share() -> None:
    radius, apart = 0.3, 0.4
    position = np.array([[0.3, 0.5, 0.5], [0.3 + apart, 0.5, 0.5]])
    found = measure_cell(position, np.full(2, radius), np.ones(3), accuracy=0.1)
    lens = math.pi * (2.0 * radius - apart) ** 2 * (apart**2 + 4.0 * apart * radius) / (12.0 * apart)
    assert found.porosity == pytest.approx(1.0 - (8.0 / 3.0 * math.pi * radius**3 - lens), rel=1e-9)
