"""Outside programs never outlive their caller and never hang."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from filtercake.errors import EngineError, TimeLimitReached
from filtercake.packing.engines import process


def alive(pid: int) -> bool:
    """Whether a process runs (a zombie does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def gone(pid: int, seconds: float = 10.0) -> bool:
    """Wait for a process to end."""
    end = time.monotonic() + seconds
    while alive(pid) and time.monotonic() < end:
        time.sleep(0.05)
    return not alive(pid)


def sh(script: str, folder: Path, **more: object) -> int:
    return process.run(["sh", "-c", script], folder, folder / "out.log", **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("status", [0, 1, 77])
def test_the_exit_status_is_returned(tmp_path: Path, status: int) -> None:
    assert sh(f"exit {status}", tmp_path) == status


def test_a_signal_is_a_negative_status(tmp_path: Path) -> None:
    assert sh("kill -KILL $$", tmp_path) == -signal.SIGKILL


def test_output_errors_and_working_directory(tmp_path: Path) -> None:
    sh("pwd; echo told; echo complained >&2; cat", tmp_path)  # cat: nothing to read, or it would wait for ever
    assert (tmp_path / "out.log").read_text(encoding="utf-8").split() == [str(tmp_path), "told", "complained"]


def test_a_program_that_is_not_there_is_an_error_in_words(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match="/no/such/program cannot be started: No such file or directory"):
        process.run(["/no/such/program"], tmp_path, tmp_path / "out.log")


def test_a_program_that_may_not_run_is_an_error_in_words(tmp_path: Path) -> None:
    program = tmp_path / "program"
    program.write_text("#!/bin/sh\n", encoding="utf-8")
    with pytest.raises(EngineError, match="cannot be started: Permission denied"):
        process.run([str(program)], tmp_path, tmp_path / "out.log")


def test_the_time_limit_ends_the_program_and_its_children(tmp_path: Path) -> None:
    started = time.monotonic()
    with pytest.raises(EngineError, match=r"time limit of 0\.3 s reached") as caught:
        sh("sleep 100 & echo $! > child; echo $$ > own; wait", tmp_path, time_limit=0.3)
    assert isinstance(caught.value, TimeLimitReached)
    assert not caught.value.transient  # another try would be as long
    assert caught.value.may_pass
    assert time.monotonic() - started < process.GRACE_SECONDS + 2.0
    for name in ("own", "child"):
        assert gone(int((tmp_path / name).read_text(encoding="ascii")))


def test_a_program_deaf_to_sigterm_is_ended_for_good(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "GRACE_SECONDS", 0.3)
    with pytest.raises(EngineError, match="time limit"):
        sh("trap '' TERM; echo $$ > own; while true; do sleep 0.1; done", tmp_path, time_limit=0.3)
    assert gone(int((tmp_path / "own").read_text(encoding="ascii")))


def test_what_a_program_leaves_behind_is_ended_with_it(tmp_path: Path) -> None:
    assert sh("sleep 100 & echo $! > child; exit 0", tmp_path) == 0
    assert gone(int((tmp_path / "child").read_text(encoding="ascii")))


def test_an_interrupt_while_waiting_ends_the_program(tmp_path: Path) -> None:
    def interrupt() -> None:
        if (tmp_path / "own").exists():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sh("echo $$ > own; exec sleep 100", tmp_path, on_poll=interrupt)
    assert gone(int((tmp_path / "own").read_text(encoding="ascii")))


def test_on_poll_is_called_while_the_program_runs(tmp_path: Path) -> None:
    calls = []
    sh("sleep 0.5", tmp_path, on_poll=lambda: calls.append(1))
    assert 2 <= len(calls) <= 6


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's parent-death signal is Linux's")
def test_the_program_ends_when_its_caller_is_killed(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path\n"
        "from filtercake.packing.engines import process\n"
        "f = Path(sys.argv[1])\n"
        "process.run(['sh', '-c', 'echo $$ > own.part; mv own.part own; exec sleep 100'], f, f / 'out.log')\n"
    )
    caller = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)])
    end = time.monotonic() + 60.0
    while not (tmp_path / "own").exists() and time.monotonic() < end:
        time.sleep(0.05)
    pid = int((tmp_path / "own").read_text(encoding="ascii"))
    assert alive(pid)
    os.kill(caller.pid, signal.SIGKILL)
    caller.wait(timeout=10)
    assert gone(pid)


def test_one_process_uses_one_thread(tmp_path: Path) -> None:
    sh("echo $OMP_NUM_THREADS", tmp_path)
    assert (tmp_path / "out.log").read_text(encoding="utf-8").strip() == "1"
