"""A real small sweep to be hurt: start it, look at what it holds, resume it, compare it with an undisturbed one."""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
import psutil

from filtercake.errors import PackingRejected
from filtercake.packing.result import Packing, sha256
from filtercake.run.job import FOLDER_VARIABLE
from filtercake.run.resume import live_runs, remains

PROJECT = Path(__file__).resolve().parents[2]
PARTS = ("Snakefile", "Makefile", "config", "workflow", "profiles", "liggghts_templates", "src")
NAME = "faults"
STUDY = f"config/test/{NAME}.yaml"
TABLES_ONLY = ("results/faults/tables/table1.csv", "results/faults/points.csv")
"""Targets of a run that draws no figures: half the time."""
LONGEST = 900.0
"""Seconds after which a run is given up."""


@dataclass
class Sweep:
    """A copy of the project with one study, and the tables of an undisturbed run of it."""

    root: Path
    engine: str
    targets: tuple[str, ...] = ()
    reference: dict[str, str] = field(default_factory=dict)
    running: subprocess.Popen[bytes] | None = None

    @classmethod
    def make(cls, root: Path, engine: str) -> Sweep:
        """Copy the project; the sweep is run once, undisturbed, for its tables."""
        root.mkdir(parents=True, exist_ok=True)
        for part in PARTS:
            source = PROJECT / part
            if source.is_dir():
                ignore = shutil.ignore_patterns("__pycache__", "*.egg-info")
                shutil.copytree(source, root / part, ignore=ignore, dirs_exist_ok=True)
            else:
                shutil.copy(source, root / part)
        study = root / STUDY
        study.write_text(study.read_text().replace("engine: liggghts", f"engine: {engine}"))
        (root / "tmp").mkdir(exist_ok=True)
        sweep = cls(root, engine, TABLES_ONLY)
        undisturbed = root / "undisturbed.json"
        if not undisturbed.exists():
            sweep.clear()
            if sweep.resume() != 0:
                raise RuntimeError(f"the undisturbed run failed: {sweep.output()}")
            undisturbed.write_text(json.dumps(sweep.tables()))
        sweep.reference = json.loads(undisturbed.read_text())
        return sweep

    @property
    def results(self) -> Path:
        """Folder of the study's results."""
        return self.root / "results" / NAME

    def environment(self, **extra: str) -> dict[str, str]:
        """Environment of a run: the copy's library, temporary files where they are seen."""
        return {**os.environ, "PYTHONPATH": str(self.root / "src"), "TMPDIR": str(self.root / "tmp"), **extra}

    def start(self, *prefix: str, module: str = "filtercake.run.resume", **extra: str) -> None:
        """Start a run in a process group of its own."""
        command = [*prefix, sys.executable, "-m", module, "--cores", "2", *self.targets, "--config", f"studies={STUDY}"]
        with (self.root / "output.log").open("wb") as stream:
            self.running = subprocess.Popen(
                command,
                cwd=self.root,
                env=self.environment(**extra),
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def wait(self, timeout: float = LONGEST) -> int:
        """Wait for the run's end; a run that does not end is killed, and says so by status 124."""
        assert self.running is not None
        try:
            return self.running.wait(timeout)
        except subprocess.TimeoutExpired:
            self.signal_group(signal.SIGKILL)
            self.running.wait()
            return 124

    def resume(self, *prefix: str, **extra: str) -> int:
        """Resume to the end; return the exit status."""
        self.start(*prefix, **extra)
        return self.wait()

    def alive(self) -> bool:
        """Whether the run goes on."""
        return self.running is not None and self.running.poll() is None

    def signal_group(self, sign: int) -> None:
        """Send a signal to the run's whole process group."""
        assert self.running is not None
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.running.pid, sign)

    def output(self) -> str:
        """What the last run printed."""
        return (self.root / "output.log").read_text(errors="replace")

    def jobs(self) -> list[psutil.Process]:
        """Python processes of the run's scripts."""
        found = [process for process in self.members() if "/.snakemake/scripts/" in _words(process)]
        return [process for process in found if "python" in _words(process).split(" ")[0]]

    def programs(self) -> list[psutil.Process]:
        """Running LIGGGHTS processes."""
        return [process for process in self.members() if "packing.in" in _words(process)]

    def members(self) -> list[psutil.Process]:
        """Every process that was started by a run in this folder."""
        return [process for process in psutil.process_iter() if _mark(process) == str(self.root.resolve())]

    def packings(self) -> dict[str, str]:
        """Checksum of the record of every packing that is finished and whole; made again, it has another run time."""
        found = {}
        for npz in self.results.glob("packings/*/r*.npz"):
            if npz.name.startswith("r") and npz.stem[1:].isdigit():
                try:
                    Packing.load(npz)
                    found[npz.name] = sha256(npz.with_suffix(".json"))
                except (PackingRejected, FileNotFoundError):
                    continue
        return found

    def tables(self) -> dict[str, str]:
        """Every table as text, without run times."""
        files = [self.results / name for name in ("replicates.csv", "summary.csv", "points.csv")]
        files += sorted((self.results / "tables").glob("*.csv"))
        found = {}
        for path in files:
            if path.exists():
                try:
                    lines = pd.read_csv(path, dtype=str, keep_default_na=False)
                except ValueError:
                    continue
                found[path.name] = lines.drop(columns="wall_s", errors="ignore").to_csv(index=False)
        return found

    def wrong(self) -> int:
        """Rows that are called ok and differ from those of the undisturbed run."""
        try:
            found = _good_rows((self.results / "replicates.csv").read_text())
        except (OSError, ValueError, KeyError):
            return 0  # no table that anybody could take for a result
        return len(found - _good_rows(self.reference["replicates.csv"]))

    def differing(self) -> list[str]:
        """Tables that are not those of the undisturbed run, byte for byte."""
        found = self.tables()
        return [name for name, text in self.reference.items() if found.get(name) != text]

    def left(self) -> list[str]:
        """Processes, locks, markers and temporary files that a run has left."""
        state = self.root / ".snakemake"
        files = [*remains(self.root / "results"), *state.glob("locks/*"), *state.glob("scripts/tmp*")]
        files += [path for path in state.glob("incomplete/**/*") if path.is_file()]
        # a killed Snakemake leaves its scratch folder, empty
        files += [path for path in (self.root / "tmp").rglob("*") if path.is_file() or path.parent.name != "tmp"]
        files += [path for path in (self.root / "tmp").iterdir() if not path.name.startswith("snakemake")]
        processes = [f"process {process.pid}" for process in (*self.members(), *live_runs(self.root))]
        return [*processes, *(str(path.relative_to(self.root)) for path in files)]

    def clear(self) -> None:
        """Forget the results."""
        shutil.rmtree(self.root / "results", ignore_errors=True)


def wait_for(condition, seconds: float, step: float = 0.02):
    """Wait until something is true or the time is over; return what it is then."""
    deadline = time.monotonic() + seconds
    while not (found := condition()) and time.monotonic() < deadline:
        time.sleep(step)
    return found


def _good_rows(text: str) -> set[str]:
    """Rows of a table that are called ok; beside a blank, pandas writes 80 as 80.0."""
    table = pd.read_csv(io.StringIO(text), keep_default_na=False, dtype=str)
    good = table[table["status"] == "ok"].drop(columns="wall_s", errors="ignore")
    return {",".join(cell.removesuffix(".0") for cell in row) for row in good.itertuples(index=False)}


def _words(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
        return ""


def _mark(process: psutil.Process) -> str | None:
    try:
        return process.environ().get(FOLDER_VARIABLE)
    except (psutil.Error, OSError):
        return None
