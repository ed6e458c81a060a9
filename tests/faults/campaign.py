"""The fault campaign: hurt a real small sweep in every way there is, resume it by one command, and count what was lost.

``make faults`` runs it: ``python tests/faults/campaign.py --count 200 --seed 1``. One row per fault is added to a CSV
as each sweep has been compared with an undisturbed one; what stands in it already is not run again.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
import psutil
from sweep import TABLES_ONLY, Sweep, wait_for

from filtercake.packing.engines.liggghts import EXECUTABLE_VARIABLE, find_executable
from filtercake.validation import pages

TEMPLATE = Path(__file__).resolve().parents[2] / "workflow" / "report" / "reliability.md.j2"
SIGNALS = ("SIGINT", "SIGTERM", "SIGKILL")
FAKES = (
    *("garbage", "garbage_dump", "dies_with_status_0", "dies_with_status_3", "wrong_version", "not_a_program"),
    *("memory_limit", "memory_killed", "dump_truncated", "dump_empty", "sphere_missing", "not_a_number"),
    *("sphere_outside", "sphere_twice", "hangs"),
)
WAYS = ("empty", "truncated", "bit_flipped", "garbage")
PER_SWEEP = {"signals": 23, "damage": 32}
"""Faults that hit one sweep before it is compared; 40 where nothing is said."""
ENDED = 240.0
"""Seconds that a run which was hurt has to end."""


@dataclass
class Fault:
    """One injected fault and what came of it."""

    family: str
    kind: str
    target: str
    engine: str
    moment_s: float
    noticed: str = ""
    lost: int = 0
    accepted: int = 0
    left: int = 0
    commands: int = 0
    equal: bool = False


@dataclass
class Trial:
    """A sweep under attack: its faults since it was last compared, and the packings that must not be lost."""

    sweep: Sweep
    rng: random.Random
    family: str
    faults: list[Fault] = field(default_factory=list)
    finished: dict[str, str] = field(default_factory=dict)
    spoiled: set[str] = field(default_factory=set)
    accepted: int = 0
    until: float = math.inf

    def overdue(self) -> bool:
        """Whether the time for this sweep is over."""
        return time.monotonic() > self.until

    def hit(self, kind: str, target: str, since: float, noticed: str = "") -> Fault:
        """Note a fault."""
        fault = Fault(self.family, kind, target, self.sweep.engine, round(time.monotonic() - since, 2), noticed)
        self.faults.append(fault)
        return fault

    def remember(self) -> None:
        """Note which packings are finished: none may be made again."""
        self.finished |= self.sweep.packings()

    def judge(self) -> list[Fault]:
        """Resume by one command and compare; every fault of the sweep bears the outcome."""
        if self.family != "damage":  # there, a wrong row is the fault itself
            self.accepted += self.sweep.wrong()
        status = self.sweep.resume()
        now = self.sweep.packings()
        lost = sum(now.get(name) != known for name, known in self.finished.items() if name not in self.spoiled)
        differing, left = self.sweep.differing(), self.sweep.left()
        self.accepted += self.sweep.wrong()
        for fault in self.faults:
            fault.lost, fault.accepted, fault.left = lost, self.accepted, len(left)
            fault.commands, fault.equal = (1 if status == 0 else 0), status == 0 and not differing
        if status != 0 or differing or left or lost or self.accepted:
            print(f"PROBLEM: status {status}, differing {differing}, left {left}, lost {lost}", flush=True)
            print("\n".join(f"  {fault}" for fault in self.faults), flush=True)
            (self.sweep.root / f"problem-{time.time():.0f}.log").write_text(self.sweep.output())
        return self.faults


def signals(trial: Trial, count: int) -> None:
    """Signals to Snakemake, to a script's Python and to the whole group, at random moments; some hit a run again."""
    listed = list(itertools.product(("snakemake", "script", "group"), SIGNALS))
    trial.rng.shuffle(listed)
    pairs = itertools.cycle(listed)
    trial.sweep.clear()
    while len(trial.faults) < count and not trial.overdue():
        trial.sweep.start()
        started = time.monotonic()
        if trial.rng.random() < 0.7:
            wait_for(lambda: trial.sweep.jobs() or not trial.sweep.alive(), ENDED)
        while not wait_for(lambda: not trial.sweep.alive(), trial.rng.uniform(0.0, 6.0)) and len(trial.faults) < count:
            strike(trial, *next(pairs), started)
        if trial.sweep.wait(ENDED) == 0:  # at its end in spite of all: the next starts anew
            trial.sweep.clear()
            trial.finished.clear()


def strike(trial: Trial, target: str, name: str, started: float) -> None:
    """Send one signal, where its target is there."""
    jobs = trial.sweep.jobs()
    if target == "script" and not jobs:
        return
    trial.remember()
    sign = getattr(signal, name)
    with contextlib.suppress(psutil.Error):
        if target == "script":
            trial.rng.choice(jobs).send_signal(sign)
        elif target == "snakemake":
            trial.sweep.running.send_signal(sign)
        else:
            trial.sweep.signal_group(sign)
        trial.hit(name, target, started)


def killed_programs(trial: Trial, count: int) -> None:
    """Signals to LIGGGHTS while it packs; the job tries again, the sweep goes on."""
    trial.sweep.clear()
    trial.sweep.start()
    started = time.monotonic()
    while trial.sweep.alive() and len(trial.faults) < count:
        programs = trial.sweep.programs()
        if not programs:
            time.sleep(0.05)
            continue
        time.sleep(trial.rng.uniform(0.0, 0.8))
        name = trial.rng.choice(SIGNALS)
        with contextlib.suppress(psutil.Error):
            trial.rng.choice(programs).send_signal(getattr(signal, name))
            trial.hit(name, "liggghts", started)
    trial.sweep.wait(ENDED)
    trial.remember()


def failing_programs(trial: Trial, count: int) -> None:
    """A LIGGGHTS that fails in many ways: garbage, wrong version, hanging, out of memory, dead with status 0."""
    trial.sweep.clear()
    first, again = list(FAKES), [way for way in FAKES if way != "hangs"]  # hanging takes until the time limit: once
    trial.rng.shuffle(first)
    trial.rng.shuffle(again)
    fail_with(trial, [*first, *itertools.islice(itertools.cycle(again), max(0, count - len(first)))][:count])


def fail_with(trial: Trial, chosen: list[str]) -> None:
    """Run a sweep whose first LIGGGHTS processes fail in these ways, one after another."""
    listed = trial.sweep.root / "ways"
    listed.with_suffix(".used").unlink(missing_ok=True)
    listed.write_text("\n".join(chosen))
    fake = trial.sweep.root / "fake_liggghts.py"
    shutil.copy(Path(__file__).with_name("fake_liggghts.py"), fake)
    fake.chmod(0o755)
    began, started = time.time(), time.monotonic()
    variables = {
        EXECUTABLE_VARIABLE: str(fake),
        "FAULTS_REAL_LIGGGHTS": find_executable() or "",
        "FAULTS_LIST": str(listed),
    }
    trial.sweep.start(**variables)
    trial.sweep.wait(ENDED)
    trial.remember()
    used = [line.split() for line in listed.with_suffix(".used").read_text().splitlines()]
    for way, moment in used:
        trial.hit(way, "liggghts", started).moment_s = round(float(moment) - began, 2)


def missing_program(trial: Trial, count: int) -> None:
    """LIGGGHTS is not there when a run starts, or goes away while it runs."""
    trial.sweep.clear()
    copy = trial.sweep.root / "liggghts"
    for index in range(count):
        copy.unlink(missing_ok=True)
        if index % 2:
            copy.symlink_to(find_executable() or "")
        trial.sweep.start(**{EXECUTABLE_VARIABLE: str(copy)})
        started = time.monotonic()
        if index % 2:
            wait_for(lambda: trial.sweep.programs() or not trial.sweep.alive(), ENDED)
            time.sleep(trial.rng.uniform(0.0, 2.0))
            copy.unlink()
        fault = trial.hit("missing" if index % 2 == 0 else "goes_away", "liggghts", started)
        fault.noticed = "refused" if trial.sweep.wait(ENDED) else ""
        trial.remember()


def short_memory(trial: Trial, count: int) -> None:
    """A limit on the address space of a script's Python, or its end by the kernel's out-of-memory killer."""
    trial.sweep.clear()
    for _ in range(3 * count):  # a job may end before it is hurt
        if len(trial.faults) >= count:
            break
        trial.sweep.start()
        started = time.monotonic()
        jobs = wait_for(lambda: trial.sweep.jobs() or not trial.sweep.alive(), ENDED)
        if jobs is True or not jobs:
            trial.sweep.wait(ENDED)
            trial.sweep.clear()
            trial.finished.clear()
            continue
        time.sleep(trial.rng.uniform(0.0, 1.0))
        trial.remember()
        with contextlib.suppress(psutil.Error):
            trial.rng.choice(jobs).rlimit(psutil.RLIMIT_AS, (300_000_000, 300_000_000))
            trial.hit("memory_limit", "script", started)
        trial.sweep.wait(ENDED)


def damage(trial: Trial, count: int) -> None:
    """Damaged files at every stage, of a finished sweep or of one killed on its way."""
    started = time.monotonic()
    if trial.rng.random() < 0.4:
        trial.sweep.clear()
        trial.sweep.start()
        wait_for(lambda: trial.sweep.packings() or not trial.sweep.alive(), ENDED)
        wait_for(lambda: not trial.sweep.alive(), trial.rng.uniform(0.0, 40.0))
        trial.sweep.signal_group(signal.SIGKILL)
        trial.sweep.wait(ENDED)
        for process in trial.sweep.members():
            with contextlib.suppress(psutil.Error):
                process.kill()
    trial.remember()
    there = {name: files for name, find in STAGES.items() if (files := find(trial.sweep))}
    while there and count > len(trial.faults):
        name, way = trial.rng.choice(sorted(there)), trial.rng.choice(WAYS)
        path = there[name].pop(trial.rng.randrange(len(there[name])))
        there = {stage: files for stage, files in there.items() if files}
        spoil(path, way, trial.rng)
        if name in ("packing", "record"):
            trial.spoiled.add(f"{path.stem}.npz")
        trial.hit(way, name, started)


def spoil(path: Path, way: str, rng: random.Random) -> None:
    """Damage a file and leave its date; a flipped bit leaves its length too."""
    before, whole = path.stat(), path.read_bytes()
    if way == "empty" or not whole:
        spoiled = b""
    elif way == "truncated":
        spoiled = whole[: rng.randrange(1, max(2, len(whole)))]
    elif way == "garbage":
        spoiled = rng.randbytes(len(whole))
    else:
        place = rng.randrange(len(whole))
        spoiled = whole[:place] + bytes([whole[place] ^ (1 << rng.randrange(8))]) + whole[place + 1 :]
    path.write_bytes(spoiled)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def _results(pattern: str) -> Callable[[Sweep], list[Path]]:
    return lambda sweep: sorted(path for path in sweep.results.glob(pattern) if path.is_file())


def _notes(kind: str) -> Callable[[Sweep], list[Path]]:
    return lambda sweep: sorted(p for p in (sweep.root / ".snakemake" / kind).rglob("*") if p.is_file())


def _stale_marker(sweep: Sweep) -> list[Path]:
    """An incomplete marker: one that a kill left, or else one made for a finished file."""
    notes, markers = _notes("metadata")(sweep), _notes("incomplete")(sweep)
    if notes and not markers:
        marker = sweep.root / ".snakemake" / "incomplete" / notes[0].relative_to(sweep.root / ".snakemake" / "metadata")
        marker.parent.mkdir(parents=True, exist_ok=True)
        marker.write_text('{"external_jobid": null}')
        markers = [marker]
    return markers


STAGES: dict[str, Callable[[Sweep], list[Path]]] = {
    "csd": _results("csd/*.csv"),
    "packing": _results("packings/*/r*.npz"),
    "record": _results("packings/*/r[0-9]*.json"),
    "manifest": _results("packings/*/replicates.json"),
    "replicates.csv": _results("replicates.csv"),
    "summary.csv": _results("summary.csv"),
    "points.csv": _results("points.csv"),
    "tables": _results("tables/*.csv"),
    "figures": _results("figures/*"),
    "provenance.json": _results("provenance.json"),
    "checksums": _results("logs/**/*.sha256"),
    "snakemake_metadata": _notes("metadata"),
    "incomplete_marker": _stale_marker,
}


def full_disk(trial: Trial, count: int) -> None:
    """A small disk under the results, which grows a little each time and is full at a later stage."""
    trial.sweep.clear()
    with mounted(trial.sweep) as folder:
        for size in sorted(trial.rng.sample(range(8, 130, 4), count)):
            mount("-o", f"remount,size={size}k", str(folder))
            trial.sweep.start()
            started = time.monotonic()
            status = trial.sweep.wait(ENDED)
            trial.hit("disk_full", f"{size} kB", started, "refused" if status else "")
            trial.remember()
        mount("-o", "remount,size=200m", str(folder))
        trial.judge()


def read_only(trial: Trial, count: int) -> None:
    """The results become read-only before a run, or while it goes on."""
    trial.sweep.clear()
    with mounted(trial.sweep) as folder:
        for index in range(count):
            if index % 2:
                mount("-o", "remount,ro", str(folder))
            trial.sweep.start()
            started = time.monotonic()
            if index % 2 == 0:
                wait_for(lambda: not trial.sweep.alive(), trial.rng.uniform(6.0, 14.0))
                # a file that is being written keeps the disk writable: try again
                wait_for(lambda: mount("-o", "remount,ro", str(folder), check=False) == 0, 30.0)
            trial.remember()
            fault = trial.hit("read_only", "before" if index % 2 else "midway", started)
            fault.noticed = "refused" if trial.sweep.wait(ENDED) else ""
            mount("-o", "remount,rw", str(folder))
        trial.judge()


def clocks(trial: Trial, count: int) -> None:
    """Clocks that jump: files dated hours off, and runs under a clock that is hours or days off."""
    started = time.monotonic()
    trial.remember()
    for index in range(count):
        hours = trial.rng.choice((-48, -2, 2, 48))
        if index % 2 == 0 or not shutil.which("faketime"):
            listed = {name: files for name, find in STAGES.items() if (files := find(trial.sweep))}
            name = trial.rng.choice(sorted(set(listed) - {"incomplete_marker"}))
            for path in listed[name]:
                os.utime(path, (path.stat().st_atime, time.time() + 3600 * hours))
            trial.hit(f"files_{hours:+d}h", name, started)
            continue
        trial.sweep.start("faketime", "-f", f"{hours:+d}h")
        wait_for(lambda: not trial.sweep.alive(), trial.rng.uniform(4.0, 14.0))
        trial.sweep.signal_group(signal.SIGKILL)
        trial.hit(f"clock_{hours:+d}h_killed", "group", started)
        trial.sweep.wait(ENDED)
        trial.remember()
        for stale in ("summary.csv", "provenance.json"):
            (trial.sweep.results / stale).unlink(missing_ok=True)


def two_runs(trial: Trial, count: int) -> None:
    """A second run, or a resume, in the folder of one that goes on: refused, and the first is not disturbed."""
    trial.sweep.clear()
    trial.sweep.start()
    first, started = trial.sweep.running, time.monotonic()
    for _ in range(count):
        wait_for(lambda: first.poll() is not None, trial.rng.uniform(0.0, 4.0))
        if first.poll() is not None:
            break
        module = trial.rng.choice(("filtercake.run.resume", "filtercake.run.resume", "snakemake"))
        moment = time.monotonic()
        trial.sweep.start(module=module)
        fault = trial.hit("second_run", module.rpartition(".")[2], started)
        fault.moment_s = round(moment - started, 2)
        status = trial.sweep.wait(ENDED)
        fault.noticed = "refused" if status else ""
        if status == 0 and first.poll() is None:
            trial.accepted += 1
    trial.sweep.running = first
    if trial.sweep.wait() != 0:
        trial.accepted += 1
    trial.remember()


FAMILIES: dict[str, tuple[Callable[[Trial, int], None], tuple[str, ...], float]] = {
    # what is done, the engines it is done to, the share of all faults
    "signals": (signals, ("liggghts", "embedded"), 0.22),
    "killed_programs": (killed_programs, ("liggghts",), 0.14),
    "failing_programs": (failing_programs, ("liggghts",), 0.18),
    "missing_program": (missing_program, ("liggghts",), 0.02),
    "short_memory": (short_memory, ("embedded",), 0.03),
    "damage": (damage, ("liggghts", "embedded"), 0.30),
    "full_disk": (full_disk, ("liggghts",), 0.03),
    "read_only": (read_only, ("liggghts",), 0.03),
    "clocks": (clocks, ("embedded",), 0.04),
    "two_runs": (two_runs, ("embedded",), 0.04),
}
WITH_FIGURES = ("damage",)
SELF_JUDGED = ("full_disk", "read_only")
"""Families that are compared while their disk is mounted."""


def mount(*arguments: str, check: bool = True) -> int:
    """Call mount."""
    return subprocess.run(["mount", *arguments], check=check, stderr=subprocess.DEVNULL).returncode


@contextlib.contextmanager
def mounted(sweep: Sweep) -> Iterator[Path]:
    """A disk of its own under the results."""
    folder = sweep.root / "results"
    folder.mkdir(exist_ok=True)
    mount("-t", "tmpfs", "-o", "size=200m", "tmpfs", str(folder))
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def may_mount() -> bool:
    """Whether this process may mount a disk."""
    with tempfile.TemporaryDirectory() as folder:
        if os.geteuid() != 0 or mount("-t", "tmpfs", "tmpfs", folder, check=False) != 0:
            return False
        subprocess.run(["umount", folder], check=True)
    return True


def run_family(name: str, sweep: Sweep, count: int, rng: random.Random, minutes: float = math.inf) -> list[Fault]:
    """Inject a number of faults of one family into a sweep, compare, and return them; signals end after so long."""
    attack, _, _ = FAMILIES[name]
    sweep.targets = () if name in WITH_FIGURES else TABLES_ONLY
    trial = Trial(sweep, rng, name, until=time.monotonic() + 60.0 * minutes)
    attack(trial, count)
    if name not in SELF_JUDGED:
        trial.judge()
    return trial.faults


def main() -> None:
    """Run the campaign, or go on with it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="faults to inject (default: 200)")
    parser.add_argument("--seed", type=int, default=1, help="decides moments and kinds (default: 1)")
    parser.add_argument("--rows", type=Path, default=Path("results/faults.csv"), help="table to make or to go on with")
    parser.add_argument("--family", choices=tuple(FAMILIES), action="append", help="only these")
    parser.add_argument("--minutes", type=float, default=math.inf, help="time for the signals of one sweep")
    parser.add_argument("--engine", choices=("liggghts", "embedded"), help="only this one")
    parser.add_argument("--page", type=Path, help="page to make of the table")
    parser.add_argument("--work", type=Path, help="scratch folder (default: a temporary one)")
    options = parser.parse_args()
    with contextlib.ExitStack() as stack:
        work = options.work or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="filtercake-faults-")))
        run(options, work.resolve())
    if options.page:
        options.page.write_text(pages.reliability(TEMPLATE, pd.read_csv(options.rows)), encoding="utf-8")


def run(options: argparse.Namespace, work: Path) -> None:
    """Hurt sweeps until each family has its share of the faults; those in the table count.

    A sweep may come to its end before all of its faults have hit it: the rest go to another.
    """
    rows: list[dict[str, Any]] = pd.read_csv(options.rows).to_dict("records") if options.rows.exists() else []
    sweeps: dict[str, Sweep] = {}
    for name, (_, both, share) in FAMILIES.items():
        engines = [engine for engine in both if engine == (options.engine or engine)]
        if name not in (options.family or FAMILIES) or not engines or not possible(name, engines):
            continue
        while True:
            mine = [row for row in rows if (row["seed"], row["family"]) == (options.seed, name)]
            missing, before = max(1, round(share * options.count)) - len(mine), len({row["round"] for row in mine})
            if missing <= 0:
                break
            engine = engines[before % len(engines)]
            if engine not in sweeps:
                sweeps[engine] = Sweep.make(work / engine, engine)
            began, rng = time.monotonic(), random.Random(f"{options.seed} {name} {before}")
            faults = run_family(name, sweeps[engine], min(missing, PER_SWEEP.get(name, 40)), rng, options.minutes)
            number = 1 + max((row["round"] for row in rows if row["seed"] == options.seed), default=-1)
            rows += [{"seed": options.seed, "round": number, **asdict(fault)} for fault in faults]
            options.rows.parent.mkdir(parents=True, exist_ok=True)
            pd.DataFrame(rows).to_csv(options.rows, index=False)
            bad = sum(not fault.equal or fault.lost + fault.accepted + fault.left > 0 for fault in faults)
            took = f"{time.monotonic() - began:.0f} s; {len(rows)} in all"
            print(f"{name} ({engine}): {len(faults)} faults, {bad} with a problem, {took}", flush=True)
            if not faults:  # its time is over
                break


def possible(name: str, engines: list[str]) -> bool:
    """Whether a family can be run here; says why if not."""
    if engines[0] == "liggghts" and find_executable() is None:
        print(f"{name}: left out, LIGGGHTS is not installed", flush=True)
        return False
    if name in SELF_JUDGED and not may_mount():
        print(f"{name}: left out, only root may mount a disk", flush=True)
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
