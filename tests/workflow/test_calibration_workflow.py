"""A tiny calibration from measurements to predictions, run once; what breaks it says why before any job starts."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from checkouts import Checkout, copy_project

from filtercake.calibration.config import load_calibration, settings_of
from filtercake.calibration.fit import Parameter
from filtercake.calibration.rounds import conclude, summary
from filtercake.figures.calibrated import with_interval

TINY = "config/test/calibration/tiny.yaml"


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Checkout:
    checkout = copy_project(tmp_path_factory.mktemp("calibrated") / "project")
    done = calibrate(checkout)
    assert done.returncode == 0, done.stderr + done.stdout
    return checkout


def calibrate(checkout: Checkout, *arguments: str):
    return checkout.snakemake("calibrate", "--config", f"calibrations={TINY}", *arguments)


def test_every_product_is_there_and_consistent(calibrated: Checkout) -> None:
    folder = calibrated.root / "results" / "calibration_tiny"
    record = json.loads((folder / "calibration.json").read_text())
    found = record["parameters"]["cohesion_kJ_m3"]
    assert 0.0 <= found["low"] <= found["value"] <= found["high"] <= 80.0
    assert record["estimator"] == "interior" and set(record["rivals"]) == {"0", "0.1"}
    parity = pd.read_csv(folder / "tables" / "parity.csv")
    assert parity["measurement"].tolist() == ["tiny_test", "bimodal"]
    assert parity["measured_m_kg"].iloc[0] == pytest.approx(1.4e9, rel=0.02)
    # one parameter fits one distribution exactly: the mean of its measurements, by weight
    weight = parity["relative_uncertainty"] ** -2
    mean = np.average(np.log(parity["measured_m_kg"]), weights=weight)
    error = np.hypot(parity["packings_relative_error"][0], weight.sum() ** -0.5)
    assert (np.abs(np.log(parity["modelled_m_kg"]) - mean) < 0.2 * error).all()
    assert record["chi_square"] < 0.04 and record["degrees_of_freedom"] == 0
    (said,) = (finding["text"] for finding in record["findings"] if finding["kind"] == "friction")
    assert "do not tell a friction of 0.1 from 0, as a cohesion makes up for either" in said
    predictions = pd.read_csv(folder / "tables" / "predictions.csv")
    assert predictions["csd"].tolist() == ["from_file"]
    assert (predictions["resistance_low_m_kg"] < predictions["resistance_m_kg"]).all()
    assert len(pd.read_csv(folder / "tables" / "fits.csv")) == 2  # both forms of one test
    assert pd.read_csv(folder / "tables" / "compressibility.csv")["csd"].tolist() == ["bimodal"]
    for figure in ("objective", "parity", "resistance", "predictions"):
        assert (folder / "figures" / f"calibration_{figure}.png").stat().st_size > 10_000
    assert (folder / "figures" / "filtration_fits.pdf").exists()
    assert (folder / "figures" / "compressibility.pdf").exists()


def test_two_parameters_of_one_distribution_are_reported_as_confounded(calibrated: Checkout) -> None:
    """The packings of a finished calibration, fitted for the friction too."""
    folder = calibrated.root / "results" / "calibration_tiny"
    simulated = pd.read_csv(folder / "tables" / "simulated.csv")
    calibration = load_calibration(calibrated.root / TINY, calibrated.root / "config" / "studies")
    fitted = replace(settings_of(calibration), parameters=(*calibration.parameters, Parameter("friction", 0.0, 0.1)))
    record = summary(conclude(fitted, calibration.observations, simulated), fitted, "")
    assert "1 measured distribution cannot determine 2 parameters" in " ".join(
        finding["text"] for finding in record["findings"] if finding["kind"] == "confounded"
    )


def test_rounds_follow_each_other(calibrated: Checkout) -> None:
    folder = calibrated.root / "results" / "calibration_tiny"
    rounds = [json.loads(path.read_text()) for path in sorted((folder / "rounds").glob("*.json"))]
    assert len(rounds) >= 2 and [made["finished"] for made in rounds] == [False] * (len(rounds) - 1) + [True]
    visited = [name for made in rounds for name in made["points"]]
    assert len(visited) == len(set(visited))
    simulated = pd.read_csv(folder / "tables" / "simulated.csv")
    assert set(simulated["point"]) == set(visited)
    assert (simulated["engine"] == "embedded").all()


def test_its_part_of_the_report_holds_the_outcome(calibrated: Checkout) -> None:
    folder = calibrated.root / "results" / "calibration_tiny"
    done = calibrated.snakemake(
        f"{folder.relative_to(calibrated.root)}/report/pages", "--config", f"calibrations={TINY}"
    )
    assert done.returncode == 0, done.stderr + done.stdout
    record = json.loads((folder / "calibration.json").read_text())
    front = (folder / "report" / "captions" / "front.html").read_text()
    value = with_interval(*(record["parameters"]["cohesion_kJ_m3"][key] for key in ("value", "low", "high")))
    assert value in front and front.count("<li>") == len(record["findings"])
    figures = {path.stem for path in (folder / "figures").glob("*.png")}
    assert figures < {path.stem for path in (folder / "report" / "captions").glob("*.html")}
    pages = {path.stem for path in (folder / "report" / "pages").glob("*.html")}
    assert pages == {"parity", "predictions", "fits", "compressibility", "table3", "failed", "provenance"}


def test_nothing_is_left_to_do(calibrated: Checkout) -> None:
    again = calibrate(calibrated, "--dry-run")
    assert "Nothing to be done" in again.stdout + again.stderr


def test_other_measurements_keep_the_packings(calibrated: Checkout) -> None:
    file = calibrated.root / "config/test/calibration/tiny_measurements.yaml"
    before = file.read_text()
    manifests = list((calibrated.root / "results/calibration_tiny/packings").glob("*/replicates.json"))
    times = {path: path.stat().st_mtime_ns for path in manifests}
    try:
        file.write_text(before.replace("1.5e+9", "1.6e+9"))
        parity = "results/calibration_tiny/tables/parity.csv"
        done = calibrated.snakemake(parity, "--config", f"calibrations={TINY}")
        assert done.returncode == 0, done.stderr
    finally:
        file.write_text(before)
    assert {path: path.stat().st_mtime_ns for path in manifests} == times
    parity = pd.read_csv(calibrated.root / "results/calibration_tiny/tables/parity.csv")
    assert parity["measured_m_kg"].iloc[1] == pytest.approx(1.6e9)


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("tiny.yaml", "study: ../tiny.yaml", "study: nowhere", "study = 'nowhere': no such study"),
        ("tiny.yaml", "replicates: 2", "replicates: 1", "replicates = 1: must be greater than or equal to 2"),
        ("tiny.yaml", "rounds: 2", "round: 2", "did you mean rounds?"),
        ("tiny.yaml", "predict: [from_file]", "predict: [other]", "predict[0] = 'other': not in the study"),
        ("tiny.yaml", "high: 80", "high: 500", "cohesion_kJ_m3.high = 500: must be at most"),
        ("tiny_measurements.yaml", "{csd: bimodal", "{csd: other", "not in the study; allowed: bimodal, from_file"),
        (
            "tiny_measurements.yaml",
            "1.5e+9",
            "-1",
            "resistances[0].resistance_m_kg = -1: must be greater than or equal to 1",
        ),
        ("tiny_test.csv", "volume_mL", "volume", "tiny_test.csv"),
    ],
)
def test_what_is_wrong_is_said_before_any_job(checkout: Checkout, file: str, old: str, new: str, said: str) -> None:
    path = checkout.root / "config/test/calibration" / file
    path.write_text(path.read_text().replace(old, new))
    done = calibrate(checkout, "--dry-run")
    assert done.returncode != 0 and "filtercake cannot start" in done.stderr
    assert said in done.stderr and "Traceback" not in done.stderr
