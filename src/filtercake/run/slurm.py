"""What a cluster grants, and what waits in its queue for ever; asked of Slurm's own programs."""

from __future__ import annotations

import re
import subprocess
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from filtercake.units import MINUTE

FOR_EVER: Final = (
    "PartitionTimeLimit",
    "PartitionNodeLimit",
    "QOSMaxWallDurationPerJobLimit",
    "AssocMaxWallDurationPerJobLimit",
)
"""Reasons of Slurm's that no waiting removes."""
ASK_SECONDS: Final = 10.0
"""Longest wait for an answer."""
LOOK_SECONDS: Final = 60.0
"""Between two looks at the queue."""
CURE: Final = (
    "choose a partition that grants more (slurm_partition in profiles/slurm/profile.yaml, or --default-resources "
    "slurm_partition=NAME), or let fewer points share a submission (--group-components packing_32=8 packing_8=2)"
)


@dataclass(frozen=True)
class Partition:
    """A partition of a cluster.

    Attributes
    ----------
    name : str
        Its name.
    is_default : bool
        Whether jobs go there that name none.
    longest_minutes : int or None
        Longest walltime it grants, min; None where there is no limit.
    """

    name: str
    is_default: bool
    longest_minutes: int | None


def partitions() -> list[Partition]:
    """List the cluster's partitions; none where Slurm does not answer."""
    return [
        Partition(values["PartitionName"], values.get("Default") == "YES", minutes(values.get("MaxTime", "UNLIMITED")))
        for line in _ask("scontrol", "show", "partition", "--oneliner").splitlines()
        if "PartitionName" in (values := dict(re.findall(r"(\w+)=(\S*)", line)))
    ]


def partition_of(name: str | None, known: list[Partition]) -> Partition | None:
    """Return the partition of a name, or the default one; None where it is not known."""
    return next((item for item in known if (item.is_default if name is None else item.name == name)), None)


def minutes(text: str) -> int | None:
    """Read a time limit of Slurm's (``[days-]hours:minutes:seconds``) in whole minutes; None for no limit.

    Raises
    ------
    ValueError
        If it is none.
    """
    if text in ("UNLIMITED", "INFINITE"):
        return None
    found = re.fullmatch(r"(?:(\d+)-)?(\d+):(\d+):(\d+)", text)
    if found is None:
        raise ValueError(f"{text!r} is no time limit of Slurm's")
    days, hours, rest = (int(part or 0) for part in found.groups()[:3])
    return (24 * days + hours) * 60 + rest


def waiting_for_ever(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the number of every job from a working directory that will never start, and a line that says why."""
    for line in _ask("squeue", "--me", "--states=PENDING", "--noheader", "--format=%i|%r|%P|%l|%Z").splitlines():
        job, reason, partition, asked, place = (line.split("|", 4) + [""] * 5)[:5]
        if reason in FOR_EVER and Path(place) == folder:
            yield job, f"job {job} asks partition {partition} for {asked} and will never start ({reason})"


def watch(folder: Path, say: Callable[[str], None]) -> threading.Event:
    """Say once of each job that will never start that it won't; ends with the process, or when the event is set."""
    end = threading.Event()

    def look() -> None:
        told: set[str] = set()
        while not end.wait(LOOK_SECONDS):
            for job, text in waiting_for_ever(folder):
                if job not in told:
                    told.add(job)
                    say(f"warning: {text}: end this run (Ctrl-C), and {CURE}")

    threading.Thread(target=look, name="queue", daemon=True).start()
    return end


def too_long(partition: Partition, others: list[Partition], points: int, seconds: float) -> str:
    """Say, before anything is submitted, that points are expected to take longer than their partition grants."""
    longer = [
        item.name
        for item in others
        if item.longest_minutes is None or item.longest_minutes > (partition.longest_minutes or 0)
    ]
    instead = f" (longer ones: {', '.join(longer)})" if longer else ""
    grants = f"partition {partition.name} grants {partition.longest_minutes} min"
    return (
        f"{points} points are estimated to take up to {seconds / MINUTE:.0f} min, where {grants}: "
        f"choose another (slurm_partition in profiles/slurm/profile.yaml, or --default-resources slurm_partition=NAME)"
        f"{instead}, or ask for fewer packings or spheres"
    )


def _ask(*command: str) -> str:
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=ASK_SECONDS).stdout
    except (OSError, subprocess.SubprocessError):
        return ""
