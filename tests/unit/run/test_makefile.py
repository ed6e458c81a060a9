"""The Makefile takes the variables that it says it takes, and no others."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[3]
pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


def make(*words: str) -> subprocess.CompletedProcess[str]:
    plain = {"PATH": os.environ["PATH"]}  # a make above this one must not pass its own values on
    return subprocess.run(["make", "--dry-run", *words], cwd=PROJECT, env=plain, capture_output=True, text=True)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["run", "STUDY=a"], "STUDY is no variable of `make run`; it takes CORES PROFILE STUDIES"),
        (["run", "studies=a"], "studies is no variable"),
        (["calibrate", "CALIBRATIONS=a"], "it takes CORES PROFILE CALIBRATION."),
        (["report", "CALIBRATION=a"], "it takes CORES PROFILE STUDIES CALIBRATIONS REPORT"),
        (["run", "CALIBRATION=a"], "CALIBRATION is no variable"),
        (["design", "STUDIES=a"], "STUDIES is no variable of `make design`; it takes CORES PROFILE STUDY"),
        (["benchmark", "QIUCK=1"], "it takes CORES PROFILE QUICK"),
    ],
)
def test_a_variable_that_would_be_ignored_is_an_error(words: list[str], says: str) -> None:
    done = make(*words)
    assert done.returncode != 0 and done.stdout == ""
    assert says in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ["run", "STUDIES=a,b", "CORES=3", "VENV=x", "PYTHON=python3", "FILTERCAKE_NO_INSTALL=1"],
        ["retry", "resume", "STUDIES=a", "PROFILE=slurm"],
        ["fuzz", "COUNT=1", "SEED=2"],
        ["setup"],
        [],
    ],
)
def test_a_variable_that_is_used_is_none(words: list[str]) -> None:
    done = make(*words)
    assert done.returncode == 0, done.stderr


def test_a_report_s_name_may_hold_a_blank() -> None:
    assert '--report "my report.html"' in make("report", "REPORT=my report.html").stdout


def test_a_design_is_that_of_the_study_named_and_resumed_as_such() -> None:
    assert make("design").stdout.splitlines()[-1].endswith("design --config studies=fine_design")
    for goal in ("design", "resume"):
        assert make(goal, "STUDY=mine").stdout.splitlines()[-1].endswith("design --config studies=mine")
    assert "design" not in make("resume").stdout.splitlines()[-1]


def test_a_calibration_without_a_name_is_the_synthetic_one() -> None:
    assert make("calibrate").stdout.splitlines()[-1].endswith("calibrations=synthetic")
