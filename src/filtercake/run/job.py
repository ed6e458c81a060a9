"""Frame of every job of a workflow: log, orderly end, progress."""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
import time
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from filtercake.errors import FiltercakeError
from filtercake.run import checksums
from filtercake.units import MINUTE, duration

FAILURE = "FAILED: "
"""Starts the log line that says why a job failed."""
PROGRESS_VARIABLE = "FILTERCAKE_PROGRESS"
FOLDER_VARIABLE = "FILTERCAKE_FOLDER"
"""Working directory of the run that started a process: tells what a killed run left."""


@contextmanager
def job(log: str | Path, outputs: Iterable[str | Path] = ()) -> Iterator[logging.Logger]:
    """Run a job's body and yield its logger: SIGTERM is an orderly end, a failure's reason is one line.

    The checksums of the job's ``outputs`` are kept beside its log.
    """
    path = Path(log)
    path.parent.mkdir(parents=True, exist_ok=True)
    handler = logging.FileHandler(path, mode="w", encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%Y-%m-%d %H:%M:%S"))
    logger = logging.getLogger("filtercake")
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)
    previous = signal.signal(signal.SIGTERM, _end)
    try:
        yield logger
        checksums.write(path.with_suffix(checksums.SUFFIX), outputs)
    except FiltercakeError as error:
        logger.error("%s%s", FAILURE, "; ".join(str(error).splitlines()))
        print(f"filtercake: {error}", file=sys.stderr)
        sys.exit(1)
    except Exception as error:
        # the traceback is for whoever mends the program: it goes to the log, the user gets one line
        logger.error("%s", traceback.format_exc())
        logger.error("%s%s: %s", FAILURE, type(error).__name__, error)
        print(f"filtercake: unexpected {type(error).__name__}: {error} (traceback in {path})", file=sys.stderr)
        sys.exit(1)
    finally:
        signal.signal(signal.SIGTERM, previous)
        logger.removeHandler(handler)
        handler.close()


def _end(signum: int, frame: FrameType | None) -> None:  # noqa: ARG001 - the signature of a signal handler
    sys.exit(128 + signum)


class Progress:
    """Counts finished packings over all jobs of a run and prints how far it is.

    The run's file is named by an environment variable; one byte is appended per packing, which is atomic, so
    that jobs need no lock. Where the variable is not set (a job on another machine) only the job's own line
    is printed.
    """

    def __init__(self) -> None:
        named = os.environ.get(PROGRESS_VARIABLE)
        self.path = Path(named) if named else None

    @classmethod
    def begin(cls, path: Path, total: int) -> None:
        """Start counting a run of ``total`` packings."""
        path.parent.mkdir(parents=True, exist_ok=True)
        header = json.dumps({"total": total, "started": time.time()})
        path.write_text(header + "\n", encoding="utf-8")

    def packed(self, line: str) -> None:
        """Count one packing and print its line."""
        print(f"{self._share()}{line}", file=sys.stderr, flush=True)

    def note(self, line: str) -> None:
        """Print a line about a packing that is still settling."""
        print(f"          {line}", file=sys.stderr, flush=True)

    def _share(self) -> str:
        if self.path is None:
            return ""
        try:
            with self.path.open("ab") as stream:
                stream.write(b".")
            header, _, ticks = self.path.read_text(encoding="utf-8").partition("\n")
            plan = json.loads(header)
        except (OSError, ValueError):
            return ""
        done, total = len(ticks), int(plan["total"])
        minutes = max(time.time() - float(plan["started"]), 1e-3) / 60.0
        pace = f"{done / minutes:.0f} per minute"
        if done > total:  # intervals and calibrations ask for packings as they go
            return f"[{done} packings, {pace}] "
        return f"[{done}/{total} packings, {pace}, {duration(MINUTE * (total - done) * minutes / done)} left] "


def failure_reason(log: Path) -> str:
    """Last reason a job's log gives for its failure; empty where it gives none."""
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    reasons = [line.partition(FAILURE)[2] for line in lines if FAILURE in line]
    return reasons[-1] if reasons else ""
