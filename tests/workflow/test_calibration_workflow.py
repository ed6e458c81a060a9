"""A tiny calibration from measurements to predictions, run once; what breaks it says why before any job starts."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from checkouts import Checkout, copy_project

from filtercake.calibration.config import load_calibration, settings_of
from filtercake.calibration.response import Parameter
from filtercake.calibration.rounds import conclude
from filtercake.calibration.tables import summary
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


BROKEN = {
    "no_study": ("tiny.yaml", "study: ../tiny.yaml", "study: nowhere", "study = 'nowhere': no such study"),
    "replicates": ("tiny.yaml", "replicates: 2", "replicates: 1", "replicates = 1: must be greater than or equal to 2"),
    "key": ("tiny.yaml", "rounds: 2", "round: 2", "did you mean rounds?"),
    "prediction": (
        "tiny.yaml",
        "predict: [from_file]",
        "predict: [other]",
        "predict[0] = 'other': not in the study",
    ),
    "cohesion": ("tiny.yaml", "high: 80", "high: 500", "cohesion_kJ_m3.high = 500: must be at most"),
    "measured": (
        "tiny_measurements.yaml",
        "{csd: bimodal",
        "{csd: other",
        "not in the study; allowed: bimodal, from_file",
    ),
    "resistance": (
        "tiny_measurements.yaml",
        "1.5e+9",
        "-1",
        "resistances[0].resistance_m_kg = -1: must be greater than or equal to 1",
    ),
    "column": ("tiny_test.csv", "volume_mL", "volume", "tiny_test.csv"),
}
"""Which file of the tiny calibration is broken, how, and what must be said."""


@pytest.fixture(scope="module")
def refused(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What a start with all of the broken calibrations says; each has a folder of its own, where its name stands."""
    checkout = copy_project(tmp_path_factory.mktemp("refused") / "project")
    tiny = (checkout.root / TINY).parent
    for name, (file, old, new, _) in BROKEN.items():
        folder = tiny.with_name(name)
        shutil.copytree(tiny, folder)
        text = (folder / file).read_text()
        assert old in text
        (folder / file).write_text(text.replace(old, new))
        (folder / "tiny.yaml").rename(folder / f"{name}.yaml")
    names = ",".join(f"config/test/{name}/{name}.yaml" for name in BROKEN)
    done = checkout.snakemake("calibrate", "--config", f"calibrations={names}", "--dry-run")
    assert done.returncode != 0 and done.stderr.count("filtercake cannot start") == 1
    assert "Traceback" not in done.stderr and "Building DAG" not in done.stderr
    return done.stderr


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_wrong_is_said_before_any_job(refused: str, case: str) -> None:
    file, _, _, said = BROKEN[case]
    # the names of distributions are looked up last, and their file then named without its folder
    lines = [line for line in refused.splitlines() if line.startswith((f"config/test/{case}/", f"{file}: "))]
    assert any(said in line for line in lines), refused
