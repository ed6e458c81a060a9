"""The second solver of Stokes flow: closed forms, a published array, symmetry, and the table made with it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from documented import REPOSITORY

from filtercake.units import FloatArray
from filtercake.validation.stokes_reference import (
    BEDS,
    METHOD,
    SEED,
    ReferenceBed,
    Spheres,
    System,
    bed_permeability,
    cell_permeability,
    drag_factor,
    extrapolate,
    measure_bed,
    parabola,
    slab_averages,
    solve,
)

NOWHERE = np.empty((0, 3)), np.empty(0)
LAYERS = 12
TABLE = REPOSITORY / "docs" / "data" / "permeability_second_method.csv"


def simple_cubic(solids: float, nodes: int, shift: FloatArray | float = 0.0) -> float:
    """Permeability of a simple cubic array of side 1, m2."""
    radius = np.array([0.5 * (6.0 * solids / math.pi) ** (1.0 / 3.0)])
    return cell_permeability(np.array([[0.13, 0.27, 0.41]]) + shift, radius, (1.0, 1.0, 1.0), nodes)


def stack(diameter: float = 1.0) -> ReferenceBed:
    """A bed of touching spheres above one another; eight half as large stand for the lowest and resist more."""
    height = diameter * (1.5 + np.arange(LAYERS - 1))
    large = np.column_stack([np.full((LAYERS - 1, 2), 0.3 * diameter), height])
    small = diameter * (0.25 + 0.5 * np.array(list(np.ndindex(2, 2, 2))))
    radius = diameter * np.repeat([0.25, 0.5], [8, LAYERS - 1])
    return ReferenceBed("stack", np.vstack([small, large]), radius, diameter)


@pytest.mark.parametrize(("nodes", "allowed"), [(16, 0.01), (32, 1e-3)])
def test_plane_channel(nodes: int, allowed: float) -> None:
    plate = 0.2137  # its faces lie between the nodes
    found = cell_permeability(*NOWHERE, (1.0, 0.25, 0.25), nodes, plate=plate)
    assert found == pytest.approx((1.0 - plate) ** 3 / 12.0, rel=allowed)


def test_simple_cubic_array_has_the_published_drag() -> None:
    """Zick and Homsy, J. Fluid Mech. 115 (1982) 13: 15.4 at a solids fraction of 0.343."""
    nodes = (16, 24, 32)
    limit = extrapolate([1.0 / n for n in nodes], [simple_cubic(0.343, n) for n in nodes])
    diameter = (6.0 * 0.343 / math.pi) ** (1.0 / 3.0)
    assert drag_factor(limit.value, 0.343, diameter) == pytest.approx(15.4, rel=0.01)
    assert 1.5 < limit.order < 3.0 and limit.error < 0.02


def test_shift_by_whole_nodes_changes_nothing() -> None:
    nodes = 16
    shifted = simple_cubic(0.343, nodes, np.array([5.0, -3.0, 11.0]) / nodes)
    assert shifted == pytest.approx(simple_cubic(0.343, nodes), rel=1e-5)


def test_permeability_does_not_depend_on_the_guess() -> None:
    box = Spheres(np.array([[2.1, 3.3, 4.7]]), np.array([4.0]), (12, 12, 12))
    first, second = (solve(replace(box, permeability=k), np.ones(12)).velocity for k in (0.1, 10.0))
    assert first == pytest.approx(second, rel=1e-4)


def test_equations_and_preconditioner_are_symmetric() -> None:
    system = System(Spheres(np.array([[2.1, 3.3, 4.7]]), np.array([4.0]), (12, 10, 9), half_plate=0.7))
    rng = np.random.default_rng(1)
    one, two = rng.normal(size=(2, system.unknowns))
    assert one @ system.apply(two) == pytest.approx(two @ system.apply(one))
    assert one @ system.precondition(two) == pytest.approx(two @ system.precondition(one), rel=1e-3, abs=1e-2)
    assert one @ system.precondition(one) > 0.0


def test_mass_is_conserved_in_every_plane() -> None:
    """A pressure that rises by the force in each plane but one drives what the force there alone drives."""
    box = Spheres(np.array([[2.1, 3.3, 4.7]]), np.array([4.0]), (12, 12, 12))
    everywhere = solve(box, np.ones(12)).velocity
    one_plane = solve(box, 12.0 * (np.arange(12) == 5)).velocity
    assert one_plane == pytest.approx(everywhere, rel=1e-4)


def test_bed_and_cell_of_the_same_array_agree() -> None:
    bed = stack()
    cell = cell_permeability(bed.position[-1:], bed.radius[-1:], (1.0, 1.0, 1.0), 16)
    assert bed_permeability(bed.position, bed.radius, bed.length, 16) == pytest.approx(cell, rel=0.01)


def test_permeability_grows_with_the_square_of_the_size() -> None:
    small, large = (bed_permeability(*bed[1:], 10) for bed in (stack(1e-6), stack(1e-3)))
    assert large == pytest.approx(1e6 * small, rel=1e-4)


def test_slab_of_a_regular_array() -> None:
    bed = stack(2e-5)
    porosity, diameter = slab_averages(bed.position, bed.radius, bed.length)
    assert porosity == pytest.approx(1.0 - math.pi / 6.0, abs=0.01)
    assert diameter == pytest.approx(2e-5)


def test_weights_are_those_of_a_regression() -> None:
    planes = np.arange(40, dtype=np.float64)
    value = np.random.default_rng(2).normal(size=40)
    slope = np.polyfit(planes, value, 1)[0]
    between = 0.5 * (planes[1:] + planes[:-1])
    assert parabola(between, -0.5, 39.5) @ np.diff(value) == pytest.approx(slope, abs=0.02)
    assert parabola(between, 3.0, 20.0).sum() == pytest.approx(1.0)


def test_extrapolation_of_exact_values() -> None:
    spacing = [1.0, 0.75, 0.5]
    limit = extrapolate(spacing, [3.0 + 0.4 * h**2 for h in spacing])
    assert (limit.value, limit.order) == (pytest.approx(3.0), pytest.approx(2.0))
    assert limit.error < 1e-12
    assert math.isnan(extrapolate(spacing, [3.1, 3.2, 3.0]).order)


def test_sides_that_are_no_whole_number_of_spacings_are_refused() -> None:
    with pytest.raises(ValueError, match="whole numbers"):
        cell_permeability(*NOWHERE, (1.0, 1.0, 1.03), 10)


def test_committed_table_is_what_the_command_writes() -> None:
    table = pd.read_csv(TABLE)
    assert list(table.columns) == list(measure_bed(stack(), (5.0, 6.0, 8.0)))
    assert list(table["bed"]) == list(BEDS)
    assert list(table["spheres"]) == [options["particles"] for _, options in BEDS.values()]
    assert set(table["method"]) == {METHOD} and set(table["seed"]) == {SEED}


def test_committed_values_agree_with_each_other() -> None:
    table = pd.read_csv(TABLE)
    for _, row in table.iterrows():
        fineness = [row[f"diameter_over_spacing_{k}"] for k in (1, 2, 3)]
        limit = extrapolate([1.0 / d for d in fineness], [row[f"k_{k}_m2"] for k in (1, 2, 3)])
        assert row["k_m2"] == pytest.approx(limit.value, rel=1e-4)
        assert row["relative_error"] == pytest.approx(limit.error, abs=1e-4)
        solids, diameter = 1.0 - row["porosity"], row["sauter_um"] * 1e-6
        constant = row["porosity"] ** 3 * diameter**2 / (row["k_m2"] * solids**2)
        assert row["kozeny_constant"] == pytest.approx(constant, rel=1e-4)
    assert (table["relative_error"] <= 0.015).all()
    assert table["kozeny_constant"].between(150.0, 190.0).all()
