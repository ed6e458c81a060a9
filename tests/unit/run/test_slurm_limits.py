"""Questions to a Slurm that is made up: what its partitions grant, and which jobs will never start."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

from filtercake.run import slurm

PARTITIONS = """\
PartitionName=short AllowGroups=ALL Default=YES DefaultTime=NONE MaxNodes=UNLIMITED MaxTime=01:30:30 State=UP
PartitionName=long Default=NO MaxTime=7-00:00:00 State=UP
PartitionName=endless Default=NO MaxTime=UNLIMITED State=UP
"""
Program = Callable[[str, str], None]


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Program:
    """Put a program that prints a text on the path, and nothing else."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))

    def write(name: str, text: str) -> None:
        (folder / f"{name}.txt").write_text(text)
        (folder / name).write_text(f"#!/bin/sh\n/bin/cat '{folder}/{name}.txt'\n")
        (folder / name).chmod(0o755)

    return write


def test_partitions_and_their_limits(program: Program) -> None:
    program("scontrol", PARTITIONS)
    known = slurm.partitions()
    assert [(item.name, item.longest_minutes) for item in known] == [("short", 90), ("long", 10080), ("endless", None)]
    assert slurm.partition_of(None, known) == known[0]
    assert slurm.partition_of("endless", known) == known[2]
    assert slurm.partition_of("other", known) is None
    said = slurm.too_long(known[0], known, 3, 7200.0)
    assert "3 points are estimated to take up to 120 min, where partition short grants 90 min" in said
    assert "slurm_partition=NAME" in said and "longer ones: long, endless" in said


def test_without_slurm_nothing_is_known(program: Program, tmp_path: Path) -> None:
    assert slurm.partitions() == []
    assert list(slurm.waiting_for_ever(tmp_path)) == []


@pytest.mark.parametrize("text", ["", "90", "1:30", "soon"])
def test_a_limit_that_cannot_be_read_is_an_error(text: str) -> None:
    with pytest.raises(ValueError, match="no time limit"):
        slurm.minutes(text)


def test_jobs_that_will_never_start_are_told_once(
    program: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = tmp_path / "a user's | own"
    lines = [
        f"1|PartitionTimeLimit|short|3:00:00|{ours}",
        f"2|Priority|short|3:00:00|{ours}",
        "3|PartitionTimeLimit|short|3:00:00|/elsewhere",
        "",
    ]
    program("squeue", "\n".join(lines))
    ((job, text),) = slurm.waiting_for_ever(ours)
    assert job == "1" and "asks partition short for 3:00:00 and will never start (PartitionTimeLimit)" in text
    monkeypatch.setattr(slurm, "LOOK_SECONDS", 0.05)
    said: list[str] = []
    end = slurm.watch(ours, said.append)
    deadline = time.monotonic() + 30.0
    while not said and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.3)  # several looks more
    end.set()
    assert len(said) == 1
    assert "job 1" in said[0] and "slurm_partition=NAME" in said[0]
