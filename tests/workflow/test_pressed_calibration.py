"""A tiny calibration of pressed cakes, from resistances at two pressures to predictions and the report's pages."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
from checkouts import copy_project

TINY = "config/test/calibration/tiny_pressed.yaml"


def test_friction_and_adhesion_come_from_resistances_at_two_pressures(tmp_path: Path) -> None:
    checkout = copy_project(tmp_path / "project")
    done = checkout.snakemake("calibrate", "--config", f"calibrations={TINY}")
    assert done.returncode == 0, done.stderr + done.stdout
    folder = checkout.root / "results" / "calibration_tiny_pressed"
    record = json.loads((folder / "calibration.json").read_text())
    assert list(record["parameters"]) == ["friction", "adhesion_mJ_m2"] and record["fixed"] is None
    friction = record["parameters"]["friction"]
    assert 0.0 <= friction["low"] < friction["value"] < friction["high"] < 0.5
    # one packing serves every pressure and adhesion
    packings = [path for path in (folder / "packings").iterdir() if path.is_dir()]
    simulated = pd.read_csv(folder / "tables" / "simulated.csv")
    assert len(packings) == 4 and len(simulated) == 4 * 2 * 3 * 9
    assert 0.0 < record["packed_correlation"] <= 1.0
    (row,) = pd.read_csv(folder / "tables" / "pressures.csv").to_dict("records")
    assert row["exponent_modelled_low"] < row["exponent_modelled"] < row["exponent_modelled_high"]
    predictions = pd.read_csv(folder / "tables" / "predictions.csv")
    assert predictions["pressure_kPa"].tolist() == [50.0]
    figures = {path.stem for path in (folder / "figures").glob("*.png")}
    assert {"calibration_objective", "calibration_resistance", "compressibility"} <= figures
    done = checkout.snakemake("results/calibration_tiny_pressed/report/pages", "--config", f"calibrations={TINY}")
    assert done.returncode == 0, done.stderr + done.stdout
    front = (folder / "report" / "captions" / "front.html").read_text()
    assert "which friction makes the model describe 2 measurements" in front and "n = 8 packings accepted" in front
    assert (folder / "report" / "pages" / "pressures.html").exists()
    again = checkout.snakemake("calibrate", "--config", f"calibrations={TINY}", "--dry-run")
    assert "Nothing to be done" in again.stdout + again.stderr
