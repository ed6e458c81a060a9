"""The workflow on a real Slurm of two nodes: whatever becomes of a job, the tables are those of a local run."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest

TESTS = Path(__file__).resolve().parents[1]


def load(name: str, path: Path):
    """Import a file that is not on the path."""
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


slurm = load("filtercake_test_cluster", TESTS / "slurm" / "cluster.py")
project = load("filtercake_test_project", TESTS / "workflow" / "checkouts.py")

pytestmark = pytest.mark.slurm

STUDY = "config/test/cluster.yaml"
SITE = "slurm-status-command: squeue\nslurm-init-seconds-before-status-checks: 3\n"
"""What a site without an accounting database sets; and tests do not wait long for a status."""
TABLES = ("replicates.csv", "summary.csv", "tables/table1.csv", "tables/table2.csv", "tables/table4.csv")
SECONDS = 1800
"""Longest wait, on a machine that is busy with other things."""
PAGE = (project.PROJECT / "docs" / "cluster.md").read_text(encoding="utf-8")


class OnCluster:
    """A copy of the project whose jobs go to the cluster."""

    def __init__(self, root: Path, cluster: slurm.Cluster):
        self.cluster = cluster
        self.root = project.copy_project(root).root
        for name in ("Makefile", "pyproject.toml"):
            shutil.copy(project.PROJECT / name, self.root)
        # a link, so that a setup that finds it too old replaces the link, not the environment that runs this test
        (self.root / ".venv").symlink_to(sys.prefix)
        site = self.root / "site"
        site.mkdir()
        (site / "profile.yaml").write_text(SITE)
        self.environment = {
            **cluster.environment,
            "PYTHONPATH": str(self.root / "src"),
            "SNAKEMAKE_PROFILE": str(site),
            "FILTERCAKE_NO_INSTALL": "1",
        }
        self.before = set(cluster.jobs())

    @property
    def results(self) -> Path:
        return self.root / "results" / "cluster"

    def start(self, *arguments: str) -> subprocess.Popen:
        """Start the study's tables on the cluster; its figures are left out, but for the sweep."""
        command = [sys.executable, "-m", "snakemake", "--workflow-profile", "slurm", "--config", f"studies={STUDY}"]
        return subprocess.Popen(
            [*command, *arguments, "--", "results/cluster/tables/table1.csv"],
            cwd=self.root,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )

    def make(self, target: str) -> subprocess.CompletedProcess:
        """Run one command of the page about clusters."""
        return self.shell(f"make {target} PROFILE=slurm STUDIES={STUDY}")

    def shell(self, commands: str) -> subprocess.CompletedProcess:
        """Run commands as a user types them."""
        return subprocess.run(
            ["bash", "-e", "-c", commands],
            cwd=self.root,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=SECONDS,
        )

    def jobs(self) -> dict[str, str]:
        """State of the cluster's jobs since this copy was made."""
        return {job: state for job, state in self.cluster.jobs().items() if job not in self.before}

    def in_the_middle(self) -> str:
        """Wait until a packing is finished and its job goes on; the job's number."""
        slurm.wait_for(lambda: list(self.results.glob("packings/*/r0.json")), SECONDS, "a packing")
        return slurm.wait_for(self.cluster.running, 60, "a running job")

    def finished(self) -> dict[Path, int]:
        """Finished packings, and when they were made."""
        found = self.results.glob("packings/*/r*.npz")
        return {path: path.stat().st_mtime_ns for path in found if path.with_suffix(".json").exists()}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[slurm.Cluster]:
    if slurm.missing():
        pytest.fail(f"Slurm is not installed ({', '.join(slurm.missing())}): make slurm-test installs it")
    made = slurm.Cluster(tmp_path_factory.mktemp("slurm"))
    try:
        made.start()
        yield made
    finally:
        made.stop()


@pytest.fixture(scope="module")
def local_tables(tmp_path_factory: pytest.TempPathFactory) -> dict[str, pd.DataFrame]:
    """Tables of a run on this machine alone."""
    checkout = project.copy_project(tmp_path_factory.mktemp("local") / "project")
    done = checkout.run("--", "results/cluster/tables/table1.csv", study=STUDY, timeout=SECONDS)
    assert done.returncode == 0, done.stderr
    return tables_in(checkout.root / "results" / "cluster")


@pytest.fixture
def here(tmp_path: Path, cluster: slurm.Cluster) -> Iterator[OnCluster]:
    made = OnCluster(tmp_path / "project", cluster)
    yield made
    for job, state in made.jobs().items():
        if state in ("RUNNING", "PENDING"):
            cluster.ask("scancel", job)


def tables_in(folder: Path) -> dict[str, pd.DataFrame]:
    found = {name: pd.read_csv(folder / name) for name in TABLES}
    return {name: table.drop(columns="wall_s", errors="ignore") for name, table in found.items()}


def assert_same_tables(folder: Path, expected: dict[str, pd.DataFrame]) -> None:
    for name, table in tables_in(folder).items():
        pd.testing.assert_frame_equal(table, expected[name], check_exact=True, obj=name)


def end(run: subprocess.Popen) -> str:
    """Wait for a run that ought to succeed; what it said."""
    output, _ = run.communicate(timeout=SECONDS)
    assert run.returncode == 0, output
    return output


def test_a_sweep(here: OnCluster) -> None:
    study = here.root / STUDY
    study.write_text(study.read_text().replace("[50]", "[0, 50]"))
    done = here.make("run")
    output = done.stdout + done.stderr
    assert done.returncode == 0, output
    assert output.index("estimate: ") < output.index("has been submitted")
    target = "alone/cluster/tables/table1.csv"
    alone = project.Checkout(here.root).run("results=alone", "--", target, study=STUDY, timeout=SECONDS)
    assert alone.returncode == 0, alone.stderr
    assert_same_tables(here.results, tables_in(here.root / "alone" / "cluster"))
    assert list(here.results.glob("figures/*.png"))
    # both points in one submission, then the measurements, then the figures; nothing is left in the queue
    assert list(here.jobs().values()) == ["COMPLETED"] * 3
    again = here.make("resume")
    assert again.returncode == 0, again.stdout + again.stderr
    assert len(here.jobs()) == 3


def test_the_commands_of_the_page(here: OnCluster) -> None:
    """One after the other, on the page's own study, cut down to one small point."""
    study = re.search(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)[1]
    cut = re.sub(r"\[0(\.\d)?,.*\]", r"[0\1]", study).replace("replicates: 8", "replicates: 2\n  particles: 400")
    (here.root / "config" / "studies" / "sweep.yaml").write_text(cut)
    blocks = re.findall(r"```sh\n(.*?)```", PAGE, flags=re.DOTALL)
    done = here.shell("".join([*blocks, "squeue --me\n"]))
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(pd.read_csv(here.root / "results" / "sweep" / "summary.csv")) == 1
    assert set(here.jobs().values()) == {"COMPLETED"}


def test_a_failing_job_is_tried_again(here: OnCluster, local_tables: dict[str, pd.DataFrame]) -> None:
    (here.cluster.folder / "fail").touch()
    end(here.start())
    assert sorted(here.jobs().values()) == ["COMPLETED", "COMPLETED", "FAILED"]
    assert_same_tables(here.results, local_tables)


def test_a_job_that_keeps_failing_names_point_and_log(here: OnCluster, local_tables: dict[str, pd.DataFrame]) -> None:
    table = here.results / "csd" / "bimodal.csv"
    table.parent.mkdir(parents=True)
    table.write_text("garbage\n")
    made = here.start("--cleanup-metadata", str(table.relative_to(here.root)))
    made.communicate(timeout=SECONDS)
    run = here.start("--retries", "1", "--rerun-triggers", "mtime")
    output, _ = run.communicate(timeout=SECONDS)
    assert run.returncode != 0
    assert "failed: packing bimodal_s" in output
    assert "reason: the table of a size distribution lacks the columns size_um" in output
    assert "make resume" in output
    assert list(here.jobs().values()) == ["FAILED"] * 2
    table.unlink()
    end(here.start())
    assert_same_tables(here.results, local_tables)


def test_a_cancelled_job(here: OnCluster, local_tables: dict[str, pd.DataFrame]) -> None:
    run = here.start()
    job = here.in_the_middle()
    kept = here.finished()
    here.cluster.ask("scancel", job)
    end(run)
    assert here.jobs()[job] == "CANCELLED"
    assert all(path.stat().st_mtime_ns == made for path, made in kept.items())
    assert_same_tables(here.results, local_tables)


def test_a_run_that_is_interrupted_takes_its_jobs_along_and_resumes(
    here: OnCluster, local_tables: dict[str, pd.DataFrame]
) -> None:
    run = here.start()
    job = here.in_the_middle()
    os.kill(run.pid, 2)  # Ctrl-C
    run.communicate(timeout=SECONDS)
    assert run.returncode != 0
    slurm.wait_for(lambda: here.jobs()[job] == "CANCELLED", 60, "the job to be cancelled")
    kept = here.finished()
    end(here.start())
    assert all(path.stat().st_mtime_ns == made for path, made in kept.items())
    assert_same_tables(here.results, local_tables)


def test_a_job_out_of_time_is_given_twice_the_time(here: OnCluster, local_tables: dict[str, pd.DataFrame]) -> None:
    (here.cluster.folder / "delay").touch()
    run = here.start()
    job = slurm.wait_for(here.cluster.running, SECONDS, "a running job")
    asked = here.cluster.ask("squeue", "-h", "-j", job, "-o", "%l")
    here.cluster.ask("scontrol", "update", f"JobId={job}", "TimeLimit=1")
    again = slurm.wait_for(lambda: [j for j in here.jobs() if int(j) > int(job)], SECONDS, "the job to be tried again")
    given = here.cluster.ask("squeue", "-h", "--states=all", "-j", again[0], "-o", "%l")
    end(run)
    assert here.jobs()[job] == "TIMEOUT"
    assert minutes(given) == 2 * minutes(asked)
    assert_same_tables(here.results, local_tables)


def minutes(text: str) -> int:
    """Walltime as squeue writes it: [hours:]minutes:seconds."""
    parts = [int(part) for part in text.split(":")]
    return 60 * parts[-3] + parts[-2] if len(parts) == 3 else parts[-2]


def test_a_lost_node(here: OnCluster, local_tables: dict[str, pd.DataFrame]) -> None:
    run = here.start()
    job = here.in_the_middle()
    node, kept = here.cluster.node_of(job), here.finished()
    here.cluster.lose_node(node, job)
    try:
        end(run)
        # put back into the queue by Slurm, and run by the node that is left
        assert here.jobs()[job] == "COMPLETED"
        log = (here.cluster.folder / "log" / "slurmctld.log").read_text()
        assert f"requeue job JobId={job} due to failure of node {node}" in log
    finally:
        here.cluster.start_node(node)
        slurm.wait_for(lambda: node in here.cluster.idle(), 60, f"{node} to come back")
    assert all(path.stat().st_mtime_ns == made for path, made in kept.items())
    assert_same_tables(here.results, local_tables)
