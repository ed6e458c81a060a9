"""Run an outside program so that it never outlives its caller and never hangs."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from filtercake.errors import EngineError, TimeLimitReached

POLL_SECONDS = 0.1
GRACE_SECONDS = 5.0
_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None, use_errno=True) if sys.platform == "linux" else None


def run(
    command: Sequence[str],
    folder: Path,
    output: Path,
    time_limit: float = 0.0,
    on_poll: Callable[[], None] | None = None,
) -> int:
    """Run a program in its own process group, its output in a file; kill the whole group however this ends.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    folder : Path
        Working directory.
    output : Path
        Receives standard output and standard error.
    time_limit : float
        Seconds before the group is killed; 0 for none.
    on_poll : callable, optional
        Called a few times a second while the program runs.

    Returns
    -------
    int
        Exit status; negative for a signal.

    Raises
    ------
    EngineError
        If the program cannot be started.
    TimeLimitReached
        At the time limit.
    """
    # ranks that wait must yield: two of them on one core would otherwise hardly advance
    environment = {"OMPI_MCA_mpi_yield_when_idle": "1", **os.environ, "OMP_NUM_THREADS": "1"}
    # a program that is killed leaves its temporary files: here they go with the folder
    environment["TMPDIR"] = str(folder.resolve())
    with output.open("wb") as stream:
        try:
            process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                env=environment,
                start_new_session=True,
                preexec_fn=_die_with_parent if sys.platform == "linux" else None,
            )
        except OSError as error:
            raise EngineError(f"{command[0]} cannot be started: {error.strerror}", may_pass=True) from None
        try:
            return _wait(process, time_limit, on_poll)
        finally:
            _kill_group(process)


def _wait(process: subprocess.Popen[bytes], time_limit: float, on_poll: Callable[[], None] | None) -> int:
    deadline = time.monotonic() + time_limit if time_limit > 0.0 else None
    while True:
        try:
            return process.wait(timeout=POLL_SECONDS)
        except subprocess.TimeoutExpired:
            pass
        if on_poll is not None:
            on_poll()
        if deadline is not None and time.monotonic() > deadline:
            raise TimeLimitReached(time_limit)


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    """End whatever is left of the group: politely, then for good."""
    for sign in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, sign)
        except (ProcessLookupError, PermissionError):
            break
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=GRACE_SECONDS)
    process.wait()


def _die_with_parent() -> None:
    """Ask the kernel to end this child when its parent dies, even by SIGKILL."""
    if _LIBC is not None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
