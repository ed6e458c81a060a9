"""A job that fails says why; a run that is killed goes on without losing a finished packing."""

import os
import signal
import subprocess
import sys
import time

import pandas as pd
import pytest

STUDY = "config/test/resumed.yaml"


@pytest.fixture
def embedded(checkout):
    """The tiny study with the embedded engine, which is always there, and three points, of two distributions."""
    text = (checkout.root / "config/test/tiny.yaml").read_text()
    text = text.replace("cohesion_kJ_m3: [0, 50]\n    friction: [0, 0.1]\n", "cohesion_kJ_m3: 0\n")
    (checkout.root / STUDY).write_text(text.replace("packing:\n", "packing:\n  engine: embedded\n"))
    return checkout


def test_a_failing_job_names_point_reason_log_and_command(embedded):
    results = embedded.root / "results/resumed"
    made = embedded.run("--", "results/resumed/csd/bimodal.csv", study=STUDY)
    assert made.returncode == 0, made.stderr
    (results / "csd/bimodal.csv").write_text("garbage\n")
    done = embedded.run(study=STUDY)
    output = done.stdout + done.stderr
    assert done.returncode != 0
    assert "failed: packing bimodal_s50_mu0" in output
    assert (
        "reason: results/resumed/csd/bimodal.csv: the table of a size distribution lacks the columns size_um" in output
    )
    assert "Traceback" not in output
    assert "log:    results/resumed/logs/packing/bimodal_s50_mu0" in output
    assert "failed: packing from_file" not in output
    assert "make resume" in output
    # the other distribution's packings were made all the same
    assert len(list(results.glob("packings/from_file*/r*.npz"))) == 2
    assert not list(results.glob("packings/bimodal*/replicates.json"))


def test_a_killed_run_resumes_and_gives_the_tables_of_an_undisturbed_one(embedded, tmp_path_factory):
    results = embedded.root / "results/resumed"
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "--config", f"studies={STUDY}"]
    environment = {**os.environ, "PYTHONPATH": str(embedded.root / "src")}
    killed = subprocess.Popen(
        command,
        cwd=embedded.root,
        env=environment,
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        deadline = time.monotonic() + 300
        while len(list(results.glob("packings/*/r[0-9].json"))) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
    finally:
        os.killpg(killed.pid, signal.SIGKILL)
        killed.wait()
    finished = {path: path.stat().st_mtime_ns for path in results.glob("packings/*/r[0-9].npz")}
    complete = {path for path in finished if path.with_suffix(".json").exists()}
    assert len(complete) >= 2
    table = "results/resumed/summary.csv"
    done = embedded.snakemake(table, "--config", f"studies={STUDY}", module="filtercake.run.resume")
    assert done.returncode == 0, done.stderr
    assert all(path.stat().st_mtime_ns == finished[path] for path in complete)
    assert not list(results.rglob(".work")) and not list(results.rglob(".r*.npz.*"))
    resumed = pd.read_csv(results / "summary.csv").drop(columns="wall_s")
    fresh = embedded.run("results=undisturbed", "--", "undisturbed/resumed/summary.csv", study=STUDY)
    assert fresh.returncode == 0, fresh.stderr
    undisturbed = pd.read_csv(embedded.root / "undisturbed/resumed/summary.csv").drop(columns="wall_s")
    pd.testing.assert_frame_equal(resumed, undisturbed, check_exact=True)
