"""Jobs: a log, an orderly end, and a word about progress that needs no lock."""

from __future__ import annotations

import json
import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from filtercake.errors import ConfigError, EngineError, PackingRejected, Problem
from filtercake.run import console
from filtercake.run.job import FAILURE, PROGRESS_VARIABLE, Progress, failure_reason, job

# --- the job -------------------------------------------------------------------------------------------------------


def test_a_good_job_leaves_its_words_in_the_log(tmp_path: Path) -> None:
    log = tmp_path / "deep" / "job.log"
    with job(log) as logger:
        logger.info("packed %d", 3)
        logging.getLogger("filtercake.crystals.csd").warning("from below")
    text = log.read_text(encoding="utf-8")
    assert "packed 3" in text
    assert "from below" in text
    assert failure_reason(log) == ""


@pytest.mark.parametrize(
    "error",
    [
        EngineError("LIGGGHTS: Unknown command: untis"),
        PackingRejected(["not settled", "2 spheres ended below the floor"]),
        ConfigError([Problem("study.yaml", "material.friction", "-1", "must be at least 0")]),
    ],
)
def test_an_error_meant_for_the_user_is_one_line_and_status_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], error: Exception
) -> None:
    log = tmp_path / "job.log"
    with pytest.raises(SystemExit) as caught, job(log):
        raise error
    assert caught.value.code == 1
    assert failure_reason(log) == str(error)
    assert capsys.readouterr().err == f"filtercake: {error}\n"
    assert "Traceback" not in log.read_text(encoding="utf-8")


def test_an_unexpected_error_keeps_its_traceback(tmp_path: Path) -> None:
    log = tmp_path / "job.log"
    with pytest.raises(SystemExit), job(log):
        1 / 0  # noqa: B018
    text = log.read_text(encoding="utf-8")
    assert "Traceback" in text
    assert "test_job.py" in text
    assert failure_reason(log) == "ZeroDivisionError: division by zero"


def test_a_job_leaves_the_process_as_it_was(tmp_path: Path) -> None:
    logger, before = logging.getLogger("filtercake"), signal.getsignal(signal.SIGTERM)
    handlers = list(logger.handlers)
    with job(tmp_path / "good.log"):
        assert signal.getsignal(signal.SIGTERM) is not before
    with pytest.raises(SystemExit), job(tmp_path / "bad.log"):
        raise EngineError("no")
    assert logger.handlers == handlers
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_second_run_starts_a_new_log(tmp_path: Path) -> None:
    log = tmp_path / "job.log"
    with pytest.raises(SystemExit), job(log):
        raise EngineError("first")
    with job(log) as logger:
        logger.info("second")
    assert failure_reason(log) == ""
    assert "first" not in log.read_text(encoding="utf-8")


def test_sigterm_ends_a_job_in_order(tmp_path: Path) -> None:
    code = (
        "import sys, time\n"
        "from filtercake.run.job import job\n"
        f"with job({str(tmp_path / 'job.log')!r}):\n"
        "    try:\n"
        "        print('ready', flush=True)\n"
        "        time.sleep(60)\n"
        "    finally:\n"
        f"        open({str(tmp_path / 'cleaned')!r}, 'w').close()\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    started = time.monotonic()
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=20) == 128 + signal.SIGTERM
    process.stdout.close()
    assert time.monotonic() - started < 10.0
    assert (tmp_path / "cleaned").exists()


# --- reasons -------------------------------------------------------------------------------------------------------


def test_the_last_reason_counts(tmp_path: Path) -> None:
    log = tmp_path / "job.log"
    log.write_text(f"a {FAILURE}first\nnoise\nb {FAILURE}second: a: b\nmore\n", encoding="utf-8")
    assert failure_reason(log) == "second: a: b"


def test_a_log_that_is_missing_or_no_text_gives_no_reason(tmp_path: Path) -> None:
    assert failure_reason(tmp_path / "nowhere.log") == ""
    (tmp_path / "bytes.log").write_bytes(b"\xff\x00\xfe")
    assert failure_reason(tmp_path / "bytes.log") == ""


def test_a_reason_of_several_lines_is_read_back_whole(tmp_path: Path) -> None:
    error = ConfigError([Problem("a.yaml", "x", "1", "no"), Problem("b.yaml", "y", "2", "no")])
    with pytest.raises(SystemExit), job(tmp_path / "job.log"):
        raise error
    assert "b.yaml" in failure_reason(tmp_path / "job.log")


# --- progress ------------------------------------------------------------------------------------------------------


def test_without_a_run_only_the_line_is_printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv(PROGRESS_VARIABLE, raising=False)
    Progress().packed("point r0: done")
    Progress().note("step 5")
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == ["point r0: done", "          step 5"]


def test_progress_counts_and_foretells(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run" / "progress"
    monkeypatch.setenv(PROGRESS_VARIABLE, str(path))
    Progress.begin(path, 10)
    # as if the run had begun two minutes ago
    path.write_text(json.dumps({"total": 10, "started": time.time() - 120.0}) + "\n", encoding="utf-8")
    for _ in range(4):
        Progress().packed("x")
    # 4 in 2 min: 2 per minute, 6 left take 3 min
    assert capsys.readouterr().err.splitlines()[-1] == "[4/10 packings, 2 per minute, 3 min left] x"


@pytest.mark.parametrize(
    ("minutes_gone", "done", "total", "left"), [(1.0, 2, 3, "30 s"), (60.0, 1, 3, "2.0 h"), (10.0, 5, 5, "0 s")]
)
def test_the_time_left_is_in_a_fitting_unit(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    minutes_gone: float,
    done: int,
    total: int,
    left: str,
) -> None:
    path = tmp_path / "progress"
    monkeypatch.setenv(PROGRESS_VARIABLE, str(path))
    header = json.dumps({"total": total, "started": time.time() - 60.0 * minutes_gone})
    path.write_text(header + "\n" + "." * (done - 1), encoding="utf-8")
    Progress().packed("x")
    assert f"{left} left] x" in capsys.readouterr().err


def test_beyond_the_plan_nothing_is_foretold(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "progress"
    monkeypatch.setenv(PROGRESS_VARIABLE, str(path))
    Progress.begin(path, 1)
    for _ in range(3):
        Progress().packed("x")
    assert capsys.readouterr().err.splitlines()[-1].startswith("[3 packings, ")


def test_a_new_run_starts_from_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = tmp_path / "progress"
    monkeypatch.setenv(PROGRESS_VARIABLE, str(path))
    Progress.begin(path, 5)
    Progress().packed("x")
    Progress.begin(path, 7)
    header, _, ticks = path.read_text(encoding="utf-8").partition("\n")
    assert (json.loads(header)["total"], ticks) == (7, "")


@pytest.mark.parametrize("content", [None, b"", b"not json\n..", b"{\n"])
def test_a_damaged_or_missing_count_is_left_out(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes | None
) -> None:
    path = tmp_path / "nowhere" / "progress"
    if content is not None:
        path = tmp_path / "progress"
        path.write_bytes(content)
    monkeypatch.setenv(PROGRESS_VARIABLE, str(path))
    Progress().packed("the line")
    assert capsys.readouterr().err == "the line\n"


def test_processes_at_once_lose_no_count(tmp_path: Path) -> None:
    path = tmp_path / "progress"
    Progress.begin(path, 400)
    code = "from filtercake.run.job import Progress\nfor _ in range(100): Progress().packed('x')"
    environment = {**os.environ, PROGRESS_VARIABLE: str(path)}
    running = [
        subprocess.Popen([sys.executable, "-c", code], env=environment, stderr=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    lines = [line for process in running for line in process.communicate(timeout=60)[1].splitlines()]
    assert all(process.returncode == 0 for process in running)
    assert path.read_text(encoding="utf-8").partition("\n")[2] == "." * 400
    counts = [int(line.partition("/")[0].lstrip("[")) for line in lines]
    assert len(counts) == 400
    assert max(counts) == 400


def test_the_schedulers_chatter_is_left_out() -> None:
    def shown(text: str, level: int = logging.INFO) -> bool:
        return console.worth_reading(logging.makeLogRecord({"msg": text, "levelno": level}))

    assert not shown("Select jobs to execute...")
    assert not shown("Execute 1 jobs...")
    assert shown("Building DAG")
    assert shown("Execute failed", logging.ERROR)
