"""The ensembles that the pressure cell is held against, what they say, and the page that is made of them."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from filtercake.packing.cell import CellScene
from filtercake.statistics import quantile
from filtercake.validation import pressure, pressure_column
from filtercake.validation import pressure_evidence as evidence
from filtercake.validation.pressure import (
    COLLAPSE,
    COLUMN,
    COLUMNS,
    COST,
    INVARIANCE,
    PATHS,
    SCALING,
    Case,
    cases,
    kept_as,
)
from filtercake.validation.pressure_page import (
    CELLS,
    COLUMN_IMAGE,
    FRICTION_IMAGE,
    LOAD_IMAGE,
    MEANS,
    PAGE,
    render,
    write,
)

REPOSITORY = Path(__file__).resolve().parents[3]
DOCS = REPOSITORY / "docs"
TEMPLATE = REPOSITORY / "workflow" / "report" / "pressure.md.j2"


@pytest.fixture(scope="module")
def listed() -> list[Case]:
    return cases()


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return evidence.read_cells(DOCS / "data" / CELLS)


def few(**options: Any) -> CellScene:
    return pressure.cell(pressure.mixture({30.0: 1.0}), 60, patience=600, **options)


def rows_of(case: str, porosity: Sequence[float], section: str = INVARIANCE, **options: Any) -> list[dict[str, Any]]:
    usual = {
        "label": case,
        "spheres": 2000,
        "friction": 0.0,
        "cohesion_kJ_m3": 0.0,
        "stress_Pa": 88.0,
        "load": math.nan,
    }
    found = {"coordination": 6.0, "backbone": 6.1, "rattlers": 0.02, "steps": 1000, "seconds": 2.0, "reason": ""}
    given = {"section": section, "case": case, **usual, **found, **options}
    return [{**given, "seed": seed + 1, "porosity": value} for seed, value in enumerate(porosity)]


def test_the_cases_are_well_formed(listed: list[Case]) -> None:
    assert len({case.name for case in listed}) == len(listed)
    assert all(case.cells >= 1 for case in listed)
    for case in listed:
        if not isinstance(case.stages, tuple) or len(case.stages) == 1:
            continue
        loads = [stage.stress / stage.strength for stage in case.stages]
        assert case.section == PATHS and loads == pytest.approx(pressure.LOADS)
        assert loads[0] <= 4.0 and all(after <= 2.0 * before for before, after in itertools.pairwise(loads))
        assert len({stage.friction for stage in case.stages}) == 1


def test_each_change_of_the_cell_changes_one_thing(listed: list[Case]) -> None:
    for friction in pressure.FRICTIONS:
        usual, *others = (
            {**vars(stage), "radius": stage.radius.size}
            for case in listed
            if case.section == INVARIANCE and isinstance(case.stages, tuple)
            for stage in case.stages
            if stage.friction == friction
        )
        assert [sum(usual[key] != other[key] for key in usual) for other in others] == [1] * 12


def test_half_the_time_step_is_half(listed: list[Case]) -> None:
    for friction in pressure.FRICTIONS:
        here = {case.label: case.stages for case in listed if case.name.startswith(f"mu{friction:g}_")}
        usual, halved = here["as it is"], here["time step halved"]
        assert isinstance(usual, tuple) and isinstance(halved, tuple)
        assert halved[0].time_step == pytest.approx(0.5 * usual[0].time_step)


def test_what_is_kept_goes_by_all_that_decides_it() -> None:
    one = few(friction=0.1)
    name = kept_as(Path(), (one,))
    assert kept_as(Path(), (replace(one, radius=one.radius.copy()),)) == name
    others = [replace(one, friction=0.2), replace(one, seed=2), replace(one, radius=one.radius * 1.001)]
    assert len({name, *(kept_as(Path(), (other,)) for other in others), kept_as(Path(), (one, one))}) == 5
    bed = pressure.bed({"mixture": {30.0: 1.0}}, particles=200)
    column = pressure_column.Column(bed)
    others = [bed, replace(bed, seed=2), column, replace(column, load=9.0), replace(column, scene=replace(bed, seed=2))]
    assert len({kept_as(Path(), other) for other in others}) == 5


def test_what_is_kept_is_not_computed_again(tmp_path: Path) -> None:
    chosen = [Case(INVARIANCE, "few", "60 spheres", (few(),), 2), Case(COST, "other", "the same", (few(),), 1)]
    for number, case in enumerate(chosen):
        for seed in range(1, case.cells + 1):
            kept = [{"porosity": 0.3 + 0.01 * seed + 0.1 * number, "reason": ""}]
            kept_as(tmp_path, case.member(seed)).write_text(json.dumps({"rows": kept}), encoding="utf-8")
    found = pressure.compute(tmp_path, chosen, 1, lambda line: pytest.fail(line))
    assert list(found.columns) == list(COLUMNS)
    assert found["case"].tolist() == ["few", "few", "other"]
    assert found["porosity"].tolist() == pytest.approx([0.31, 0.32, 0.41])
    # seed 1 of what is timed is none of the others'
    assert len(list(tmp_path.iterdir())) == 3


def test_a_cell_that_is_not_at_rest_is_a_row_with_its_reason(tmp_path: Path) -> None:
    (row,) = pressure._keep(tmp_path / "a.json", (few(),))
    assert set(row) == set(COLUMNS[4:])
    assert row["steps"] == 600 and "must be within" in row["reason"] and row["load"] is None
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["rows"] == [row]


def test_a_cell_that_cannot_be_made_is_a_row_with_its_reason() -> None:
    (row,) = pressure.pressed_rows((replace(few(), radius=few().radius[:2]),))
    assert set(row) == set(COLUMNS[4:])
    assert row["porosity"] is None and "use more spheres than 2" in row["reason"]


def test_the_contacts_of_a_lattice_are_counted_across_the_sides() -> None:
    place = np.stack(np.meshgrid(*[np.arange(3.0)] * 3), axis=-1).reshape(-1, 3)
    sides = np.full(3, 3.0)
    pairs = pressure._contacts(place, np.full(27, 0.501), sides)
    assert pressure.backbone(pairs, 27, 4) == (6.0, 0.0)
    # a small sphere in the middle of each cube touches eight
    both = np.concatenate([place, place + 0.5])
    radius = np.concatenate([np.full(27, 0.501), np.full(27, 0.366)])
    coordination, rattlers = pressure.backbone(pressure._contacts(both, radius, sides), 54, 4)
    assert (coordination, rattlers) == (11.0, 0.0)
    # twice as high: three layers more
    high = np.concatenate([place, place + np.array([0.0, 0.0, 3.0])])
    pairs = pressure._contacts(high, np.full(54, 0.501), np.array([3.0, 3.0, 6.0]))
    assert pressure.backbone(pairs, 54, 4) == (6.0, 0.0)


def test_rattlers_are_taken_away_until_none_is_left() -> None:
    clique = [(a, b) for a in range(5) for b in range(a)]
    chain = [(5, 4), (6, 5), (7, 6), (7, 5), (7, 4)]
    assert pressure.backbone(np.array(clique + chain), 10, 4) == (4.0, 0.5)
    coordination, rattlers = pressure.backbone(np.array(chain), 10, 4)
    assert math.isnan(coordination) and rattlers == 1.0
    # with friction two contacts hold a sphere
    coordination, rattlers = pressure.backbone(np.array([*chain, (9, 8)]), 10, 2)
    assert coordination == pytest.approx(10.0 / 4.0) and rattlers == pytest.approx(0.6)


def test_rejected_packings_count_but_take_no_part() -> None:
    rows = rows_of("a", [0.30, 0.32]) + rows_of("a", [0.9], reason="stress")
    (mean,) = evidence.averages(pd.DataFrame(rows)).to_dict("records")
    assert (mean["n"], mean["rejected"]) == (2, 1)
    assert mean["porosity"] == pytest.approx(0.31)
    assert mean["sd"] == pytest.approx(0.01 * math.sqrt(2.0)) and mean["se"] == pytest.approx(0.01)


def test_changes_are_against_the_first_of_each_friction() -> None:
    usual, other = [0.310, 0.312, 0.311], [0.315, 0.313, 0.314]
    rows = rows_of("a", usual) + rows_of("b", other)
    rows += rows_of("c", usual, friction=0.3, label="a") + rows_of("d", other, friction=0.3, label="b")
    found = evidence.changes(pd.DataFrame(rows), INVARIANCE)
    assert found["change"].tolist() == pytest.approx([0.0, 0.003, 0.0, 0.003])
    assert found["holds"].tolist() == [True, False, True, True]
    # both spread by 0.001, with four degrees of freedom together
    assert found["ci95"][1] == pytest.approx(2.776445 * 0.001 * math.sqrt(2.0 / 3.0), rel=1e-5)
    assert found["se"][1] == pytest.approx(0.001 / math.sqrt(3.0))
    assert math.isnan(found["ci95"][0])


def test_each_mean_of_a_collapse_has_its_error() -> None:
    rows = []
    for friction, load in itertools.product(pressure.FRICTIONS, pressure.COLLAPSED):
        for cohesion, porosity in ((30.0, [0.310, 0.312, 0.311]), (50.0, [0.312, 0.314])):
            given = {"friction": friction, "load": load, "cohesion_kJ_m3": cohesion, "stress_Pa": load * cohesion}
            rows += rows_of(f"s{cohesion}_x{load}_{friction}", porosity, COLLAPSE, **given)
    (first, *_) = evidence.collapse(pd.DataFrame(rows)).to_dict("records")
    assert first["change"] == pytest.approx(0.002)
    # of two: 2 + 1 degrees of freedom at each of two loads, squares 2e-6 and 2e-6
    sd = math.sqrt((2e-6 + 2e-6) * 2.0 / 6.0)
    assert first["se"] == pytest.approx(sd / math.sqrt(2.0))
    assert first["ci95"] == pytest.approx(2.446912 * sd * math.sqrt(1.0 / 3.0 + 1.0 / 2.0), rel=1e-5)


def test_ways_to_a_load_have_intervals_even_where_there_is_one_cell_of_each() -> None:
    rows = rows_of("stress_0", [0.310, 0.312], PATHS, load=3.0) + rows_of("direct_0", [0.315], PATHS, load=10.0)
    found = evidence.led(pd.DataFrame(rows + rows_of("a", [0.32, 0.33])))
    assert found["case"].tolist() == ["stress_0", "direct_0"]
    sd = math.sqrt((2e-6 + 5e-5) / 2.0)
    assert found["ci95"].tolist() == pytest.approx([4.302653 * sd / math.sqrt(2.0), 4.302653 * sd], rel=1e-5)


def test_spread_is_that_of_2000_spheres_whatever_the_size() -> None:
    rows = rows_of("a", [0.300, 0.304], spheres=500) + rows_of("b", [0.31, 0.311], spheres=8000)
    one = evidence.spread(pd.DataFrame(rows))
    assert one.freedom == 2.0
    assert one.sd == pytest.approx(math.sqrt(0.5 * (8e-6 / 4.0 + 5e-7 * 4.0)))
    assert evidence.ensemble(pd.DataFrame(rows)).weight == pytest.approx(2 * 0.25 + 2 * 4.0)


def rows_of_columns() -> list[dict[str, Any]]:
    """Slices of three columns at each load, a rejected one, and cells pressed in both ways."""
    rows = []
    for load in pressure_column.SLICES:
        given = {"load": load, "cohesion_kJ_m3": 50.0, "stress_Pa": 24.0 * load, "friction": 0.05}
        rows += rows_of("column0.05", [0.362, 0.364, 0.366], COLUMN, **given)
        rows += rows_of("column0.05", [0.5], COLUMN, reason="not at rest", **given)
    rows += rows_of("s50_x10", [0.358, 0.360], COLLAPSE, **given)
    rows += rows_of("mu0.05_0", [0.358, 0.360], INVARIANCE, **given)
    rows += rows_of("mu0.05_12", [0.361, 0.363], INVARIANCE, **{**given, "label": pressure.UNIAXIAL})
    return [*rows, *rows_of("s30_x10", [0.1, 0.2], COLLAPSE, **{**given, "cohesion_kJ_m3": 30.0})]


def test_columns_are_held_against_cells_of_their_load() -> None:
    found = evidence.columns(pd.DataFrame(rows_of_columns()))
    assert found["load"].tolist() == list(pressure_column.SLICES)
    assert found["n"].tolist() == [3, 3, 3] and found["rejected"].tolist() == [1, 1, 1]
    assert found["n_cell"].tolist() == [0, 0, 2] and found["n_axial"].tolist() == [0, 0, 2]
    last = found.iloc[-1]
    assert (last["porosity"], last["cell"], last["axial"]) == pytest.approx((0.364, 0.359, 0.362))
    assert (last["cell_change"], last["axial_change"]) == pytest.approx((0.005, 0.002))
    # Welch: variances of the means 4e-6/3 and 2e-6/2, with 2 and 1 degrees of freedom
    both = 4e-6 / 3.0 + 1e-6
    freedom = both**2 / ((4e-6 / 3.0) ** 2 / 2.0 + 1e-12)
    assert last["cell_change_ci95"] == pytest.approx(quantile(freedom) * math.sqrt(both))
    assert math.isnan(found.iloc[0]["limit"]) and last["limit"] == 0.004 and not last["holds"]
    said = evidence._said_of_columns(found)
    assert len(said) == 1 and not said[0][0]
    assert said[0][1].startswith("column against cells, x = 10, friction 0.05: +0.0050 +- ")
    assert evidence.columns(pd.DataFrame(rows_of("a", [0.31, 0.32]))).empty


def test_a_slice_is_hardly_looser_than_its_mean_load() -> None:
    loads = np.linspace(7.0, 13.0, 10_001)
    for friction in evidence.FITS:
        exact = np.trapezoid(evidence.fitted(loads, friction), loads) / 6.0
        assert evidence.slice_bias(friction) == pytest.approx(
            exact - evidence.fitted(np.array([10.0]), friction)[0], abs=2e-6
        )


def test_columns_are_left_out_where_liggghts_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = [case for case in cases() if case.section == COLUMN]
    assert [case.cells for case in chosen] == [pressure.COLUMNS_EACH] * 3
    monkeypatch.setattr(pressure.Liggghts, "why_missing", lambda _: "LIGGGHTS is not installed")
    said: list[str] = []
    assert pressure.compute(tmp_path, chosen, 1, said.append).empty
    assert said == ["no columns: LIGGGHTS is not installed"]


def test_the_page_tells_columns_and_their_absence(table: pd.DataFrame, tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    without, rows = table[table["section"] != COLUMN], pd.DataFrame(rows_of_columns())
    for found, told in ((without, False), (pd.concat([without, rows[rows["section"] == COLUMN]]), True)):
        found.to_csv(tmp_path / "data" / CELLS, index=False)
        page = render(TEMPLATE, tmp_path)
        assert ("No columns: LIGGGHTS was not installed" in page) != told
        assert (f"images/{COLUMN_IMAGE}" in page) == told
        assert "nan" not in page
    assert "| 0.05 | 10 | 3 | 1 | 0.3640 +- 0.0050 |" in page


def test_a_cost_is_time_times_variance() -> None:
    rows = rows_of("pmma_cell_2000", [0.310, 0.312], COST, seconds=4.0)
    rows += rows_of("pmma_gravity_2000", [0.350, 0.354], COST, seconds=3.0)
    rows += rows_of("pmma_cell_4000", [0.310, 0.310 + 0.001 * math.sqrt(2.0)], COST, spheres=4000, seconds=9.0)
    found = evidence.cost(pd.DataFrame(rows)).set_index("case")
    cell = found.loc["pmma_cell_2000"]
    assert cell["seconds_for"] == pytest.approx(4.0 * 1.959964**2 * 2e-6 / 0.002**2, rel=1e-6)
    assert cell["gain"] == pytest.approx(3.0 * 4.0 / 4.0)
    assert math.isnan(found.loc["pmma_gravity_2000", "gain"])
    assert found.loc["pmma_cell_4000", "gain"] == pytest.approx(3.0 * 4.0 / 4.0 * 8.0 / 9.0)
    assert cell["freedom"] == 2.0
    assert cell["gain_factor"] == pytest.approx(math.exp(1.959964 * math.sqrt(2.0 / 1.0 + 2.0 / 2.0)))
    (best,) = evidence.gains(found.reset_index()).to_dict("records")
    assert best["wanted"] == 2.0 and best["holds"]


def test_mass_scaling_is_held_against_none() -> None:
    rows = rows_of("w_plain", [0.30, 0.31], SCALING, label="w", steps=9000, seconds=9.0)
    rows += rows_of("w_scaled", [0.305, 0.309], SCALING, label="w", steps=3000, seconds=2.0)
    rows += rows_of("w_plain", [0.5], SCALING, label="w", reason="not at rest")
    (found,) = evidence.mass_scaling(pd.DataFrame(rows)).to_dict("records")
    assert found["change"] == pytest.approx(0.002)
    assert (found["n_plain"], found["rejected_plain"], found["n_scaled"], found["rejected_scaled"]) == (2, 1, 2, 0)
    assert found["steps_plain"] / found["steps_scaled"] == 3.0


def test_the_fit_has_its_limits() -> None:
    assert evidence.fitted(np.array([1e-12, 1e12]), 0.05) == pytest.approx([0.4807, 0.3354], abs=1e-6)
    assert evidence.fitted(np.array([0.064]), 0.0) == pytest.approx((0.3105 + 0.5145) / 2.0)


def test_the_table_in_the_documentation_has_every_case(table: pd.DataFrame, listed: list[Case]) -> None:
    assert list(table.columns) == list(COLUMNS)
    counts = table.drop_duplicates(["case", "seed"]).groupby("case").size().to_dict()
    assert counts == {case.name: case.cells for case in listed}


def test_what_does_not_hold_is_said(table: pd.DataFrame) -> None:
    said, count = evidence.unmet(table)
    spoilt = table.assign(porosity=table["porosity"] + 0.02 * (table["case"] == "one_size"))
    more, same = evidence.unmet(spoilt)
    assert same == count
    assert [text for text in more if text not in said] == [
        text for text in more if text.startswith("one size: porosity")
    ]
    assert len(more) == len(said) + 1


def test_the_page_is_made_of_the_tables(table: pd.DataFrame) -> None:
    page = render(TEMPLATE, DOCS)
    assert page == (DOCS / PAGE).read_text(encoding="utf-8"), "make pages"
    assert "nan" not in page
    assert "{{" not in page
    means = pd.read_csv(DOCS / "data" / MEANS)
    pd.testing.assert_frame_equal(means, evidence.averages(table), rtol=1e-4, check_dtype=False)
    for text in evidence.unmet(table)[0]:
        assert f"* {text}\n" in page
    assert page.count("| rejected |") >= 4


def test_everything_is_written(table: pd.DataFrame, tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "images").mkdir()
    write(table, TEMPLATE, tmp_path, tmp_path)
    for image in (LOAD_IMAGE, FRICTION_IMAGE):
        assert (tmp_path / "images" / image).stat().st_size > 10_000
    assert (tmp_path / PAGE).read_text(encoding="utf-8") == (DOCS / PAGE).read_text(encoding="utf-8")
