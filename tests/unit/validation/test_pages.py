"""Pages made from tables: every number on them is one of the table's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from filtercake.figures.style import applied
from filtercake.validation import pages
from filtercake.validation.error_against_time import COLUMNS
from filtercake.validation.figures import run_time_error, stability_maps
from filtercake.validation.interval_coverage import KNOWN
from filtercake.validation.stability import OUTCOMES, cases, with_fence

REPOSITORY = Path(__file__).resolve().parents[3]
TEMPLATES = REPOSITORY / "workflow" / "report"


def error_rows() -> pd.DataFrame:
    def row(
        axis: str, engine: str, seconds: float, error: float, estimator: str = "interior slab"
    ) -> dict[str, object]:
        values = {
            "sd": error,
            "bias": 0.0,
            "bias_se": 0.0005,
            "bias_ci95": 0.0010,
            "error": error,
            "resistance_error": 10 * error,
        }
        place = {
            "case": "pmma",
            "axis": axis,
            "value": 0.5,
            "engine": engine,
            "particles": 2000,
            "estimator": estimator,
        }
        return {**place, "n": 8, "n_failed": 0, "seconds": seconds, "porosity": 0.35, **values}

    rows = [
        row("default", "embedded", 0.5, 0.0025),
        row("default", "embedded", 0.5, 0.0090, "count"),
        row("default", "embedded", 0.5, 0.0080, "slab from the floor"),
        row("spheres", "embedded", 0.125, 0.0049),
        row("engine", "liggghts", 4.0, 0.0026),
        row("as published", "liggghts_as_published", 100.0, 0.0095, "count"),
        row("as published", "liggghts_as_published", 100.0, 0.0025),
        row("analytic", "Farr-Groot", 0.004, 0.043),
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def references() -> pd.DataFrame:
    return pd.DataFrame([{"case": "pmma", "porosity": 0.3512, "standard_error": 0.0004, "n": 24}])


def choice_rows() -> pd.DataFrame:
    row = {"choice": "drop height", "model": "the paper's", "other": "2 times"}
    return pd.DataFrame([{**row, "porosity_change": -0.004, "porosity_change_ci95": 0.001, "resistance_change": 0.04}])


def coverage_rows() -> pd.DataFrame:
    rows = {"n": [6, 9, 12], "covered": [True, True, False], "reached": [True, True, True], "seconds": [1.0, 2.0, 3.0]}
    return pd.DataFrame({"case": "pmma", "asked": 0.002, "rule": KNOWN, "porosity": [0.351, 0.352, 0.353], **rows})


def answer_rows() -> pd.DataFrame:
    row = {"protocol": "gravity", "n": 6, "seconds": 0.5, "porosity": 0.352, "resistance_m_kg": 3.1e9, "spread": 0.021}
    errors = {"resistance_error": -0.17, "resistance_error_ci95": 0.012, "filter_area_m2": 3.44, "area_error": -0.08}
    estimate = {"law": "instant estimate", "protocol": "filtration", "resistance_error_ci95": 0.01, "spread": np.nan}
    return pd.DataFrame([{**row, "law": "additive", **errors}, {**row, **errors, **estimate}]).assign(friction=0.3)


def benchmark_page(errors: pd.DataFrame) -> str:
    tables = errors, references(), choice_rows(), coverage_rows(), answer_rows()
    return pages.benchmark(TEMPLATES / "benchmark.md.j2", *tables, REPOSITORY / "docs" / "data")


def test_the_headline_compares_with_the_papers_own_estimator() -> None:
    found = pages.headline(error_rows())
    assert found["published"]["estimator"] == "count"
    assert found["times_faster"] == pytest.approx(200.0)
    assert found["same_error"]["axis"] == "spheres"
    assert found["same_error_times_faster"] == pytest.approx(800.0)


def test_a_single_packing_as_published_is_as_good_as_its_bias() -> None:
    rows = error_rows()
    published = (rows["axis"] == "as published") & (rows["estimator"] == "count")
    rows.loc[published, ["error", "bias"]] = [np.nan, -0.0026]
    found = pages.headline(rows)
    assert found["same_error"]["axis"] == "default"
    assert found["same_error_times_faster"] == pytest.approx(200.0)


def test_without_the_published_protocol_there_is_no_ratio() -> None:
    rows = error_rows()
    assert set(pages.headline(rows[rows["axis"] != "as published"])) == {"default"}


def test_a_case_is_summed_up_by_the_interior_porosity() -> None:
    errors = error_rows().assign(on_front=[True, False, False, True, False, False, True, False])
    spheres, counted = errors.index[3], errors.index[1]
    errors.loc[[spheres, counted], "bias"] = [-0.0011, 0.01]  # of 0.0005 standard error
    errors.loc[errors.index[4], ["bias", "n", "n_failed"]] = [0.0009, 5, 3]
    found = pages.said(errors)
    assert (found["variants"], found["front"]) == (4, 3)
    assert [row["axis"] for row in found["biased"]] == ["spheres"]
    assert [row["engine"] for row in found["failed"]] == ["liggghts"]
    assert [row["engine"] for row in found["analytic"]] == ["Farr-Groot"]


def test_the_benchmark_page_holds_the_tables_numbers() -> None:
    errors = error_rows().assign(on_front=True)
    errors.loc[errors.index[3], "bias"] = -0.0048
    errors.loc[errors.index[4], ["n", "n_failed"]] = [5, 3]
    page = benchmark_page(errors)
    assert "| pmma | filtercake's default | 0.5 | 200 |" in page
    assert "| pmma | fastest with no larger an error: spheres 0.5 | 0.125 | 800 |" in page
    assert "| drop height | the paper's | 2 times | -0.0040 +- 0.0010 | +4.0 % |" in page
    assert "| pmma | 0.3512 | 0.0004 | 24 |" in page
    assert "| 0.3 | gravity | additive | 0.5 | 0.3520 | 3.1e+09 | -17.0 +- 1.2 % | 2.1 % | 3.44 | -8.0 % |" in page
    assert (
        "| 0.3 | filtration | instant estimate | 0.5 | 0.3520 | 3.1e+09 | -17.0 +- 1.0 % | – | 3.44 | -8.0 % |" in page
    )
    assert "| pmma | 0.002 | known spread | 3 times | 2 | 6 to 12 | 9.0 | 0.3520 +- 0.0025 | 2 |" in page
    assert "all that follows from the cloud" in page
    assert "Biased: spheres 0.5 (-0.0048)." in page
    assert "Failed: engine (liggghts) (3 of 8)." in page
    assert "| pmma | count | 0.3500 |" in page
    assert "Analytic models are off by 0.0430 (Farr-Groot)." in page
    assert "+0.0000 +- 0.0010" in page
    assert "{{" not in page
    assert "nan" not in page.lower().replace("nano", "")


def test_what_one_packing_does_not_tell_is_a_dash() -> None:
    errors = error_rows().assign(on_front=True)
    errors.loc[errors["axis"] == "default", ["n", "sd", "bias_se", "bias_ci95", "error"]] = [1, *[np.nan] * 4]
    page = benchmark_page(errors)
    assert "| pmma | interior slab | 0.3500 | +0.0000 +- – | – | – |" in page


def stress_rows() -> pd.DataFrame:
    rows = []
    for k, case in enumerate(cases(["embedded", "liggghts"])):
        good = case.numbers["time_step"] < 1.0
        numbers = {"bias": 0.001 * (k % 7 - 3), "bias_ci95": 0.002} if good else {"bias": np.nan, "bias_ci95": np.nan}
        place = {name: getattr(case, name) for name in ("family", "engine", "x_name", "x", "y_name", "y")}
        rows.append(
            {
                **place,
                **numbers,
                "outcome": "ok" if good else "exploded",
                "n": 4,
                "n_accepted": 4 if good else 0,
                **dict.fromkeys(("porosity", "reference", "overlap_max", "seconds"), 0.35 if good else np.nan),
                "energy_gain": 1e-6,
                "momentum_drift": 1e-16,
                "reason": "" if good else "the bed exploded | far away",
            }
        )
    return pd.DataFrame(rows)


def test_the_stability_page_tells_the_wrong_ones() -> None:
    table = with_fence(stress_rows())
    assert set(table["fence"]) == {"allowed", "warned", "refused"}
    page = pages.stability(TEMPLATES / "stability.md.j2", table)
    assert f"{len(table)} cases" in page
    assert "Not among these results" not in page
    part = pages.stability(TEMPLATES / "stability.md.j2", table[table["family"] != "size_ratio_skin"])
    assert "though `make stability` makes them: size_ratio_skin." in part
    assert "None: every accepted packing" in page
    assert "data/stability.csv" in page and len(page.splitlines()) < 100
    place = table.index[table["fence"] == "allowed"][0]
    table.loc[place, ["bias", "outcome"]] = [0.02, "inaccurate"]
    table.loc[table["fence"] == "warned", "outcome"] = "undecided"
    page = pages.stability(TEMPLATES / "stability.md.j2", table)
    assert "+0.0200 +- 0.0020" in page
    warned = ((table["fence"] == "warned") & (table["engine"] == "embedded")).sum()
    assert f"| embedded | warned | 0 | {warned} | 0 |" in page
    assert "Of these, 1 pass the configuration without a word" in page


def test_the_stability_page_counts_verdicts_of_each_engine() -> None:
    table = with_fence(stress_rows())
    page = pages.stability(TEMPLATES / "stability.md.j2", table)
    for engine in ("embedded", "liggghts"):
        for fence in ("allowed", "warned", "refused"):
            here = table[(table["engine"] == engine) & (table["fence"] == fence)]["outcome"]
            counts = [int((here == outcome).sum()) for outcome in OUTCOMES]
            assert f"| {engine} | {fence} | {' | '.join(map(str, counts))} |" in page


def test_a_map_says_where_it_fails() -> None:
    outcomes = {
        0.0: ["ok", "ok", "ok"],
        1.0: ["ok", "unsettled", "exploded"],
        2.0: ["ok", "unsettled", "exploded"],
        3.0: ["exploded", "ok", "ok"],
        4.0: ["refused", "refused", "refused"],
        5.0: ["exploded", "ok", "exploded"],
    }
    rows = [(x, y, found) for y, line in outcomes.items() for x, found in zip((0.1, 0.5, 2.0), line, strict=True)]
    table = pd.DataFrame(rows, columns=["x", "y", "outcome"]).sample(frac=1.0, random_state=1)
    assert pages.failing(table) == [
        "1, 2: from 0.5 (unsettled, exploded)",
        "3: up to 0.1 (exploded)",
        "4: everywhere (refused)",
        "5: at 0.1, 2 (exploded)",
    ]


def test_the_committed_stability_page_is_that_of_its_table() -> None:
    docs = TEMPLATES.parents[1] / "docs"
    table = pd.read_csv(docs / "data" / "stability.csv")
    assert (with_fence(table)["fence"] == table["fence"]).all(), "make pages"
    page = pages.stability(TEMPLATES / "stability.md.j2", table)
    assert page == (docs / "stability.md").read_text(encoding="utf-8"), "make pages"


def test_the_fence_of_a_case_is_todays() -> None:
    table = with_fence(stress_rows())
    wild = table[(table["x_name"] == "time_step") & (table["x"] >= 1.0)]
    assert (wild["fence"] == "refused").all()


def test_figures_draw_every_case() -> None:
    with applied():
        maps = stability_maps.draw(with_fence(stress_rows()).replace({"outcome": {"exploded": "undecided"}}))
        maps.canvas.draw()
        assert "undecided" in [text.get_text() for text in maps.legends[0].get_texts()]
        plot = run_time_error.draw(error_rows(), references())
        plot.canvas.draw()
    assert len([axes for axes in maps.axes if axes.get_visible()]) == len(
        stress_rows()[["family", "engine"]].drop_duplicates()
    )
    labels = [text.get_text() for text in plot.legends[0].get_texts()]
    assert {"default", "as published, count", "analytic models", "LIGGGHTS, default"} <= set(labels)


def test_a_single_packing_as_published_stands_in_the_figure_by_its_distance() -> None:
    rows = error_rows()
    rows.loc[rows["axis"] == "as published", ["error", "bias"]] = [np.nan, -0.0026]
    with applied():
        plot = run_time_error.draw(rows, references())
    diamonds = [line for line in plot.axes[0].get_lines() if line.get_gid() == "published"]
    assert [line.get_ydata().tolist() for line in diamonds] == [[0.0026], [0.0026]]


def test_the_reliability_page_counts_a_sweep_once() -> None:
    good = {"lost": 0, "accepted": 0, "left": 0, "commands": 1, "equal": True}
    rows = [
        {"seed": 1, "round": 0, "family": "signals", "kind": "SIGKILL", "target": "group", **good},
        {"seed": 1, "round": 0, "family": "signals", "kind": "SIGINT", "target": "script", **good},
        {"seed": 1, "round": 1, "family": "damage", "kind": "bit_flipped", "target": "csd", **good},
    ]
    page = pages.reliability(TEMPLATES / "reliability.md.j2", pd.DataFrame(rows))
    assert "3 faults injected into 2 real small sweeps" in page
    assert "byte for byte | 3 of 3 |" in page
    assert "| a run was stopped or killed | SIGINT, SIGKILL | nothing | 2 | 1 | 0 | 0 | 0 | 2 |" in page
    rows[0] |= {"lost": 2, "equal": False}
    rows[1] |= {"lost": 2, "equal": False}
    page = pages.reliability(TEMPLATES / "reliability.md.j2", pd.DataFrame(rows))
    assert "made again though whole) | 2 |" in page
    assert "byte for byte | 1 of 3 |" in page


def test_the_committed_reliability_page_is_that_of_its_table() -> None:
    docs = TEMPLATES.parents[1] / "docs"
    page = pages.reliability(TEMPLATES / "reliability.md.j2", pd.read_csv(docs / "data" / "faults.csv"))
    assert page == (docs / "reliability.md").read_text(encoding="utf-8")
