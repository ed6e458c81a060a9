"""What a run says at its start and its end: numbers of what is to be made, answers, and files that exist."""

from __future__ import annotations

import json
from pathlib import Path

from filtercake.run import console


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
