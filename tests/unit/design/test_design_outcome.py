"""What a design says and tabulates, from packings as they would be measured."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from designs import DESIGN, made, packed, task_of

from filtercake.design import tables as tabulate
from filtercake.design.outcome import Outcome
from filtercake.design.plant import drum_of
from filtercake.design.words import findings
from filtercake.filtration.drum_filter import area


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """A finished design, its packings a little looser than the estimate."""
    task = task_of(tmp_path_factory.mktemp("design"))
    return made(task, {2: (0.003, 0.001, 0.004), 3: (0.002, 0.003, math.nan)})


def texts(outcome: Outcome, kind: str) -> list[str]:
    return [item.text for item in findings(outcome) if item.kind == kind]


def test_the_tables_agree_with_each_other(outcome: Outcome) -> None:
    record, tables = tabulate.summary(outcome), tabulate.tables(outcome)
    assert tuple(tables) == tabulate.TABLES
    search = tables["search"]
    best = search.iloc[search["objective"].argmin()]
    for name, value in record["best"].items():
        assert best[name] == (pytest.approx(value) if isinstance(value, float) else value)
    assert record["value"]["low"] <= record["value"]["value"] <= record["value"]["high"]
    assert (search["objective_low"] <= search["objective"]).all() and (
        search["objective"] <= search["objective_high"]
    ).all()
    for name in ("filter_area", "porosity", "resistance"):
        unit = {"filter_area": "_m2", "porosity": "", "resistance": "_m_kg"}[name]
        assert (search[f"{name}_low{unit}"] < search[f"{name}{unit}"]).all()
        assert (search[f"{name}{unit}"] < search[f"{name}_high{unit}"]).all()
    for cost in ("installed_cost", "purchase_cost"):
        assert search[cost].to_numpy() == pytest.approx(search[f"crystallizer_{cost}"] + search[f"filter_{cost}"])
    settings = outcome.optimum.choice.settings
    flow = outcome.problem.plant.production / settings.slurry_concentration
    expected = float(area(drum_of(outcome.problem.plant, settings), record["resistance_m_kg"], flow))
    assert record["best"]["filter_area_m2"] == pytest.approx(expected)


def test_the_record_is_plain(outcome: Outcome) -> None:
    record = tabulate.summary(outcome)
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert record["packings"] == 6 and record["n_failed"] == 1 and record["levels"] == 2


def test_packings_stand_beside_their_estimate(outcome: Outcome) -> None:
    levels = tabulate.levels_table(outcome)
    assert levels["n"].tolist() == [3, 2] and levels["n_failed"].tolist() == [0, 1]
    assert (levels["porosity"] - levels["estimated_porosity"]).to_numpy() == pytest.approx([0.008 / 3, 0.0025])
    assert (levels["resistance_low_m_kg"] < levels["resistance_m_kg"]).all()
    assert (levels["filter_area_low_m2"] < levels["filter_area_m2"]).all()


def test_safety_names_what_each_choice_leaves_out(outcome: Outcome) -> None:
    table = tabulate.safety_table(outcome)
    assert table["resistance_over_found"].iloc[0] == 1.0 and table["resistance_over_found"].iloc[3] == 2.0
    assert table["resistance_over_found"].is_monotonic_increasing and table["filter_area_m2"].is_monotonic_increasing
    assert table["leaves_out"].str.len().min() > 5
    # a cake that resists more wants a larger crystallizer
    assert table["best_residence_time_min"].is_monotonic_increasing and table["best_objective"].is_monotonic_increasing
    assert table["best_residence_time_min"].iloc[0] == outcome.optimum.residence_time / 60.0
    upper = math.hypot(outcome.half_width, outcome.law_half_width) / float(outcome.cake.resistance)
    assert table["resistance_over_found"].iloc[2] == pytest.approx(1.0 + upper)
    (said,) = texts(outcome, "safety")
    assert f"{table['filter_area_m2'].iloc[2]:.3g} m2" in said and f"{table['filter_area_m2'].iloc[3]:.3g} m2" in said


def test_both_correlations_stand_side_by_side(outcome: Outcome) -> None:
    table = tabulate.costs_table(outcome)
    assert table["filter_costed_by"].tolist() == ["drum_filter_turton", "drum_filter_seider"]
    assert table["filter_installed_cost"].iloc[0] == pytest.approx(outcome.best.filter_installed)
    assert any("drum_filter_seider" in text for text in texts(outcome, "costs"))


def test_no_design_of_the_trade_off_beats_another(outcome: Outcome) -> None:
    table = tabulate.pareto_table(outcome)
    pairs = table[["installed_cost", "filter_area_m2"]].to_numpy()
    assert len(table) > 3
    assert (np.diff(pairs[:, 0]) > 0.0).all() and (np.diff(pairs[:, 1]) < 0.0).all()


def test_the_words_say_where_and_why(outcome: Outcome) -> None:
    record = tabulate.summary(outcome)
    (said,) = texts(outcome, "optimum")
    assert f"{record['residence_time_min']['value']:.3g} min" in said
    assert f"{record['best']['filter_area_m2']:.3g} m2" in said
    assert texts(outcome, "settings") == [
        f"rotation rate {record['best']['rotation_rate_rpm']:.3g} rpm, at the thinnest cake allowed"
    ]
    assert "ended: because" in texts(outcome, "packings")[0]


@pytest.mark.parametrize(
    ("change", "kind", "says"),
    [
        (("5.0e+9", "2.0e+10"), "medium", "the filter is decided by the medium, not the cake"),
        (
            (
                "trade_off: filter_area",
                "trade_off: cake_moisture\n  deliquoring_share: 0.4\n  surface_tension_mN_m: 72",
            ),
            "moisture",
            "within the correlation's own error",
        ),
        (("5.0e+9", "0"), "medium", "holds 0 % of the filter's resistance there"),
        (("[0.1, 10]", "[0.1, 0.6]"), "settings", "rotation rate 0.6 rpm, the highest asked for"),
        (("objective: installed_cost", "objective: filter_area\n  costs: {currency: EUR}"), "optimum", "upper bound"),
        (("trade_off: filter_area", "constraints: {largest_filter_area_m2: 0.001}"), "impossible", "filter too large"),
    ],
)
def test_the_words_follow_the_case(tmp_path: Path, change: tuple[str, str], kind: str, says: str) -> None:
    text = DESIGN.replace("  trade_off: filter_area\n", "") if "objective: filter" in change[1] else DESIGN
    if "constraints" in change[1]:
        text = text.replace("  constraints: {cake_thickness_mm: [5, 50]}\n", "")
    assert change[0] in text
    outcome = packed(task_of(tmp_path, text.replace(*change)), {})
    assert any(says in said for said in texts(outcome, kind)), findings(outcome)


def test_a_design_that_cannot_be_has_tables_without_rows(tmp_path: Path) -> None:
    text = DESIGN.replace("cake_thickness_mm: [5, 50]", "cake_thickness_mm: [5000, 6000]")
    outcome = packed(task_of(tmp_path, text), {})
    tables, record = tabulate.tables(outcome), tabulate.summary(outcome)
    assert not record["possible"] and "best" not in record
    assert all(tables[name].empty for name in ("pareto", "safety", "costs", "levels"))
    assert (tables["search"]["misses"] == "cake too thin").all()
    for name, table in tables.items():
        path = tmp_path / f"{name}.csv"
        table.to_csv(path, index=False)
        pd.read_csv(path)


def test_packings_that_all_failed_tell_nothing(tmp_path: Path) -> None:
    outcome = made(task_of(tmp_path), {2: (math.nan, math.nan)})
    (found,) = outcome.task.found(outcome.packings).porosity.values()
    assert found.shape == (0, 1) and outcome.task.found(outcome.packings).made == 2
    assert (outcome.belief.mean == outcome.task.prior.mean).all()
    levels = tabulate.levels_table(outcome)
    assert levels["n"].tolist() == [0] and levels["n_failed"].tolist() == [2] and levels["porosity"].isna().all()


def test_beds_have_one_porosity_at_every_pressure(tmp_path: Path) -> None:
    text = DESIGN.replace("protocol: filtration", "initial_void_fraction: 0.6").replace("  adhesion_mJ_m2: 0\n", "")
    text = text.replace("    rotation_rate_rpm: [0.1, 10]\n", "    pressure_drop_kPa: [20, 80]\n")
    task = task_of(tmp_path, text)
    assert task.prior.mean.shape[1] == 9 and (np.ptp(task.prior.mean, axis=1) == 0.0).all()
    outcome = made(task, {1: (0.001,)})
    outcome = Outcome(task, outcome.packings.drop_duplicates("replicate"), "because")
    (found,) = task.found(outcome.packings).porosity.values()
    assert found.shape == (1, 9) and np.ptp(found) == 0.0
    assert outcome.optimum.choice.settings.pressure_drop == pytest.approx(80e3)


def test_filter_types_stand_side_by_side(tmp_path: Path) -> None:
    text = DESIGN.replace(
        "  objective:", "    filter_type: [leaf, plate_and_frame, drum]\n  turnaround_min: 30\n  objective:"
    )
    outcome = packed(task_of(tmp_path, text), {})
    values = dict(outcome.by_filter_type())
    assert min(values.values()) == outcome.optimum.value
    (said,) = (item for item in texts(outcome, "settings") if "filter types" in item)
    order = sorted(values, key=lambda kind: values[kind])
    places = [said.index({"leaf": "leaf filter", "drum": "drum"}.get(kind, "plate-and-frame")) for kind in order]
    assert places == sorted(places) and outcome.optimum.choice.settings.filter_type == order[0]


def test_the_ends_of_an_area_hold_it_where_a_denser_cake_needs_less(tmp_path: Path) -> None:
    """A leaf filter whose cake is as high as there is room: more crystals in it outweigh their resistance."""
    text = DESIGN.replace("    rotation_rate_rpm: [0.1, 10]\n", "    filter_type: [leaf]\n") + "  turnaround_min: 60\n"
    outcome = made(task_of(tmp_path, text), {2: (0.001, 0.002)})
    tables = tabulate.tables(outcome)
    assert tables["search"]["cake_thickness_mm"].to_numpy() == pytest.approx(50.0)
    for table in (tables["search"], tables["levels"]):
        assert (table["filter_area_low_m2"] <= table["filter_area_m2"]).all()
        assert (table["filter_area_m2"] <= table["filter_area_high_m2"]).all()


def test_pressed_packings_are_measured_at_every_pressure(tmp_path: Path) -> None:
    text = DESIGN.replace("    rotation_rate_rpm: [0.1, 10]\n", "    pressure_drop_kPa: [20, 80]\n")
    text = text.replace("adhesion_mJ_m2: 0", "adhesion_mJ_m2: 5")
    outcome = made(task_of(tmp_path, text), {2: (0.001, 0.002)})
    task = outcome.task
    assert task.pressures.size == 9 and task.prior.mean.shape == (len(task.residence_times), 9)
    assert (np.diff(task.prior.mean, axis=1) < 0.0).all()  # pressed harder, denser
    assert outcome.optimum.choice.settings.pressure_drop == pytest.approx(80e3)
    assert any("pressure drop 80 kPa, the highest asked for" in text for text in texts(outcome, "settings"))
    assert tabulate.levels_table(outcome)["n"].tolist() == [2]
