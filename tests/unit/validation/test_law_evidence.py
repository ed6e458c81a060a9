"""The packings that the resistance laws are held against, and the page that is made of them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from filtercake.api.steps import distribution
from filtercake.permeability.result import Permeability
from filtercake.validation import permeability
from filtercake.validation.hard_spheres import Species, arrange, deepest_overlap
from filtercake.validation.permeability import (
    BED,
    COLUMNS,
    FINER,
    LATTICE,
    LAYER_SOLIDS,
    LAYERED,
    MIXED,
    SECOND,
    cases,
    layered,
)
from filtercake.validation.permeability_page import FITS, PAGE, TABLE, render, write
from filtercake.validation.resistance_law import both_methods, by_case, finer, fit_table

REPOSITORY = Path(__file__).resolve().parents[3]
DOCS = REPOSITORY / "docs"
TEMPLATE = REPOSITORY / "workflow" / "report" / "permeability.md.j2"


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return pd.read_csv(DOCS / "data" / TABLE)


def test_the_cases_are_well_formed() -> None:
    listed = cases()
    assert len({case.name for case in listed}) == len(listed)
    assert all((case.cell is None) == bool(case.distribution) == (case.kind in (BED, FINER, SECOND)) for case in listed)
    assert all(case.replicates >= 3 for case in listed if case.kind == BED)
    assert all(case.replicates >= 2 for case in listed if case.kind in (*MIXED, LAYERED))
    assert sum(case.kind == BED for case in listed) >= 8


@pytest.mark.parametrize("case", [case for case in cases() if case.kind == BED], ids=lambda case: case.name)
def test_every_distribution_can_be_made(case: permeability.Case) -> None:
    made = distribution(**case.distribution)
    assert made.truncated.largest / made.truncated.smallest < 40.0


@pytest.mark.parametrize("solids", [0.40, 0.55])
def test_hard_spheres_do_not_overlap_and_fill_what_they_should(solids: float) -> None:
    side = (60 * math.pi / 6.0 / solids) ** (1.0 / 3.0)
    position, radius = arrange([Species(60, 1.0)], np.full(3, side), [1])
    assert deepest_overlap(position, radius, np.full(3, side)) < 0.0
    assert np.sum(4.0 / 3.0 * np.pi * radius**3) / side**3 == pytest.approx(solids)
    assert (position >= 0.0).all()
    assert (position < side).all()


def test_the_same_seed_makes_the_same_array_and_another_does_not() -> None:
    one, again, other = (arrange([Species(30, 1.0)], np.full(3, 4.0), seed)[0] for seed in ([1, 0], [1, 0], [1, 1]))
    assert np.array_equal(one, again)
    assert not np.allclose(one, other)


def test_too_dense_an_array_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("filtercake.validation.hard_spheres.MOST_SWEEPS", 200)
    with pytest.raises(ValueError, match="too dense"):
        arrange([Species(100, 1.0)], np.full(3, 4.0), [1])


@pytest.mark.parametrize("pairs", [0, 2])
def test_layers_hold_as_much_fine_as_coarse(pairs: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(permeability, "LAYER_HEIGHT", 12)
    position, radius, box = layered(pairs, [1], sweeps=1)
    assert deepest_overlap(position, radius, box) <= 0.0
    volume = 4.0 / 3.0 * np.pi * radius**3
    fine = radius < 1.5 * radius.min()
    assert volume.sum() / np.prod(box) == pytest.approx(LAYER_SOLIDS, rel=0.03)
    assert volume[fine].sum() / volume.sum() == pytest.approx(0.5, abs=0.02)
    if pairs:
        layer = np.floor(position[:, 2] / (box[2] / (2 * pairs)))
        assert np.array_equal(layer % 2 == 0, fine)


def test_the_width_of_sizes_is_that_of_the_volume() -> None:
    position, radius = np.zeros((9, 3)), np.array([2.0] + [1.0] * 8)
    expected = (0.5 + 0.5 / 4.0) / 0.75**2
    assert permeability.width_ratio(position, radius) == pytest.approx(expected)
    # far inside one of the coarse ones, there is nothing else
    position[1:, 2] = 10.0
    assert permeability.width_ratio(position, radius, (-0.5, 0.5)) == pytest.approx(1.0)


def test_slices_in_series_resist_as_their_own_sizes_and_porosities() -> None:
    # evenly over the height of each layer; the coarse ones are twice as large, and each layer is half of the height
    radius = np.array([0.5] * 8000 + [1.0] * 1000)
    height = np.concatenate([np.linspace(0.0, 50.0, 8000), np.linspace(50.0, 100.0, 1000)])
    position, box = np.column_stack([np.zeros((9000, 2)), height]), np.array([15.0, 15.0, 100.0])
    assert permeability.series(position, radius, box) == pytest.approx(1.0 / 9.0 + 1.0, rel=0.03)
    position[:, 2] = np.concatenate([np.linspace(0.0, 100.0, 8000), np.linspace(0.0, 100.0, 1000)])
    assert permeability.series(position, radius, box) == pytest.approx(1.0, abs=0.01)


def test_a_solved_packing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def solved(*_arguments: object, **_options: object) -> Permeability:
        calls.append(1)
        return Permeability(1e-12, 0.4764, 20e-6, 150.0, 0.01, 0.001, 0.02, ())

    monkeypatch.setattr(permeability, "measure_cell", solved)
    lattice = [case for case in cases() if case.name == "simple_cubic"]
    one, again = (permeability.solve_all(tmp_path, lattice) for _ in range(2))
    assert calls == [1]
    pd.testing.assert_frame_equal(one, again)
    assert list(one.columns) == list(COLUMNS)
    # of the spheres, not of the lattice's nodes
    assert one["porosity"][0] == pytest.approx(1.0 - math.pi / 6.0)


@pytest.mark.parametrize("name", ["simple_cubic", "face-centred_cubic"])
def test_a_lattices_constant_is_known(name: str) -> None:
    case = next(case for case in cases() if case.name == name)
    assert case.cell is not None
    _, radius, box = case.cell([0])
    porosity = 1.0 - float(np.sum(4.0 / 3.0 * np.pi * radius**3) / np.prod(box))
    assert porosity == pytest.approx(0.476 if name == "simple_cubic" else 0.2595, abs=5e-4)
    assert permeability.known_constant(case.label, porosity) == pytest.approx(156 if porosity > 0.4 else 184, abs=1.0)


def test_the_table_in_the_documentation_has_every_case(table: pd.DataFrame) -> None:
    assert list(table.columns) == list(COLUMNS)
    counts = table.groupby("case", sort=False).size().to_dict()
    assert counts == {case.name: case.replicates for case in cases()}
    assert set(table["kind"]) == {*MIXED, LAYERED, LATTICE, FINER, SECOND}


def test_the_page_is_made_of_the_tables(table: pd.DataFrame) -> None:
    page = render(TEMPLATE, DOCS)
    assert page == (DOCS / PAGE).read_text(encoding="utf-8"), "make pages"
    assert "nan" not in page
    assert "{{" not in page
    fits = pd.read_csv(DOCS / "data" / FITS)
    pd.testing.assert_frame_equal(fits, fit_table(by_case(table)), rtol=1e-4)


def test_everything_is_written(table: pd.DataFrame, tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "images").mkdir()
    second = "permeability_second_method.csv"
    other = pd.read_csv(DOCS / "data" / second)
    other.assign(kozeny_constant=999.234).to_csv(tmp_path / "data" / second, index=False)
    write(table, TEMPLATE, tmp_path, tmp_path / "figure.pdf")
    assert (tmp_path / "images" / "permeability.png").stat().st_size > 10_000
    page = (tmp_path / PAGE).read_text(encoding="utf-8")
    assert page.count("| 999.2 +- ") == len(other) == 3


def test_both_methods_agree(table: pd.DataFrame) -> None:
    found = both_methods(table, pd.read_csv(DOCS / "data" / "permeability_second_method.csv"))
    assert list(found["bed"]) == ["one size", "PMMA 50/50", "5:1"]
    assert np.allclose(found["porosity"], found["other_porosity"], atol=5e-4)
    assert (found["difference"].abs() < 0.03).all()


def test_the_stated_error_covers_beds_on_fine_lattices(table: pd.DataFrame) -> None:
    found = finer(table)
    assert len(found) == 20 and found["covered"].sum() >= 18
    assert (found["finer_nodes"] > 1.4 * found["nodes"]).all()
