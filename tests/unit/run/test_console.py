"""What a run says at its start and its end: numbers of what is to be made, answers, and files that exist."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pandas as pd

from filtercake.run import console
from filtercake.run.answers import MOST_ROWS, answers


def study_of(folder: Path, points: int, **columns: object) -> Path:
    """Results of a study of so many points, whose third has no accepted packing."""
    folder.mkdir(exist_ok=True)
    k = np.arange(points)
    known = np.where(k == 2, np.nan, 1.0)
    table = {
        "point": [f"p{number}" for number in k],
        "porosity": (0.35 + 0.001 * k) * known,
        "porosity_ci95": 0.0123 * known,
        "resistance_m_kg": (1.5e9 - 1e7 * k) * known,
        "resistance_ci95_m_kg": 3.21e7 * known,
        "interval_reached": "yes",
    }
    pd.DataFrame({**table, **columns}).to_csv(folder / "summary.csv", index=False)
    return folder


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split("  ") if cell.strip()]


def test_a_study_ends_with_its_numbers(tmp_path: Path) -> None:
    folder = study_of(tmp_path / "mine", 3)
    said = console.success(tmp_path, {"mine": {}}).splitlines()
    assert said[:2] == ["", "mine, +- the half-width of the 95 % interval over the packings:"]
    assert [cells(line) for line in said[2:6]] == [
        ["point", "porosity", "resistance, m/kg"],
        ["p0", "0.35 +- 0.012", "1.5e+09 +- 3.2e+07"],
        ["p1", "0.351 +- 0.012", "1.49e+09 +- 3.2e+07"],
        ["p2", "no accepted packing", "-"],
    ]
    assert len({line.index(cells(line)[1]) for line in said[2:6]}) == 1  # one column below the other
    assert said[6:] == [f"mine: numbers in {folder}/summary.csv"]


def test_a_design_ends_with_its_answer_in_words(tmp_path: Path) -> None:
    folder = study_of(tmp_path / "mine", 1)
    (folder / "design").mkdir()
    findings = [{"kind": "optimum", "text": "the least is here"}, {"kind": "medium", "text": "it decides"}]
    (folder / "design" / "design.json").write_text(json.dumps({"findings": findings}))
    said = console.success(tmp_path, {"mine": {}}).splitlines()
    assert said[:3] == ["", "mine: optimum: the least is here", "mine: medium: it decides"]
    assert said[-1] == f"mine: numbers in {folder}/summary.csv, design in {folder}/design"


def test_a_single_packing_has_no_interval(tmp_path: Path) -> None:
    _, row = answers(study_of(tmp_path, 1, porosity_ci95=[np.nan], resistance_ci95_m_kg=[np.nan]))
    assert cells(row) == ["p0", "0.35 +- -", "1.5e+09 +- -"]


def test_the_area_of_the_filter_stands_beside_its_point(tmp_path: Path) -> None:
    folder = study_of(tmp_path, 3)
    (folder / "tables").mkdir()
    areas = {
        "filter_area_m2": [np.nan, 3.436],
        "filter_area_low_m2": [np.nan, 3.2],
        "filter_area_high_m2": [np.nan, 3.7],
    }
    pd.DataFrame({"point": ["p2", "p1"], **areas}).to_csv(folder / "tables" / "filter.csv", index=False)
    titles, *rows = map(cells, answers(folder))
    assert titles[-1] == "filter area, m2"
    assert [row[-1] for row in rows] == ["-", "3.44 (3.2 to 3.7)", "-"]


def test_of_many_points_the_first_are_listed(tmp_path: Path) -> None:
    assert len(list(answers(study_of(tmp_path, MOST_ROWS)))) == MOST_ROWS + 1
    *_, last, more = answers(study_of(tmp_path, MOST_ROWS + 5))
    assert cells(last)[0] == f"p{MOST_ROWS - 1}" and more == f"... and 5 more in {tmp_path}/summary.csv"


def test_the_report_is_named_where_there_is_one(tmp_path: Path) -> None:
    summary = study_of(tmp_path / "mine", 3) / "summary.csv"
    assert "report:" not in console.success(tmp_path, {"mine": {}})
    report = tmp_path / "report.html"
    report.touch()
    os.utime(summary, (1e9, 1e9))
    assert console.success(tmp_path, {"mine": {}}).splitlines()[-1] == f"report: {report}"
    os.utime(report, (0.9e9, 0.9e9))
    last = console.success(tmp_path, {"mine": {}}).splitlines()[-1]
    assert last == f"report: {report} (older than these results: make report)"


def test_a_calibration_ends_with_its_answer_its_findings_and_its_files(tmp_path: Path) -> None:
    folder = tmp_path / "calibration_mine"
    (folder / "tables").mkdir(parents=True)
    record = {
        "parameters": {"cohesion_kJ_m3": {"value": 37.94, "low": 30.1, "high": 45.26}},
        "beside": "friction",
        "fixed": 0.1,
        "findings": [{"kind": "failed", "text": "3 points without an accepted packing: the rest decides"}],
    }
    (folder / "calibration.json").write_text(json.dumps(record))
    said = console.success(tmp_path, {"calibration_mine": {}}).splitlines()
    assert said == [
        "",
        "calibration_mine: cohesion_kJ_m3 = 37.9 (95 %: 30.1 to 45.3), at friction = 0.1",
        "calibration_mine: failed: 3 points without an accepted packing: the rest decides",
        f"calibration_mine: tables in {folder}/tables, numbers in {folder}/calibration.json",
    ]


def test_no_file_is_named_that_does_not_exist(tmp_path: Path) -> None:
    folder = tmp_path / "study" / "packings" / "p"
    folder.mkdir(parents=True)
    failed = {"replicates": [{"replicate": 0, "status": "failed", "reason": "not settled"}]}
    (folder / "replicates.json").write_text(json.dumps(failed))
    said = console.success(tmp_path, {"study": {"p": None}})
    assert "p r0: not settled" in said
    named = [word.strip("(),;:") for word in said.split() if str(tmp_path) in word]
    assert named and all(Path(name).exists() for name in named)
