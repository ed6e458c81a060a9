"""What a killed run leaves is cleared away, what is damaged is found, and a run that goes on is left alone."""

import fcntl
import os
import random
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from filtercake.errors import PackingRejected
from filtercake.packing.engines import process
from filtercake.packing.pack import MANIFEST, whole
from filtercake.packing.result import Packing, publish, read_sealed, sealed, write_json
from filtercake.run import checksums, resume
from filtercake.run.job import FOLDER_VARIABLE, job
from filtercake.run.retry import forget_failures

PROJECT = Path(__file__).resolve().parents[3]
SLEEP = "import time; print('ready', flush=True); time.sleep(60)"
STUBBORN = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); " + SLEEP


@pytest.fixture
def sleeper():
    """Start a process that sleeps, in a folder and with variables of its own; ends it after the test."""
    started = []

    def start(code, folder, *command, **variables):
        running = subprocess.Popen(
            [*(command or (sys.executable, "-c", code))],
            cwd=folder,
            env={**os.environ, **variables},
            stdout=subprocess.PIPE,
        )
        started.append(running)
        assert running.stdout.readline()
        return running

    yield start
    for each in started:
        each.kill()
        each.wait()
        each.stdout.close()


@pytest.fixture
def study(tmp_path, settled_lattice):
    """Results of a study, as its jobs leave them: two packings of a point, a distribution, two tables."""
    folder = tmp_path / "results" / "demo"
    state = settled_lattice.state
    entries = []
    for k in (0, 1):
        packing = Packing(state.position, state.radius, state.length, {"replicate": k, "overlap_max": 0.01})
        checksum = packing.save(folder / f"packings/p/r{k}.npz")
        entries.append({"replicate": k, "status": "ok", "reason": "", "sha256": checksum})
    write_json(folder / "packings/p" / MANIFEST, sealed({"key": "key", "replicates": entries}))
    for name in ("csd/demo.csv", "replicates.csv", "summary.csv"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(f"{name}\n1,2,3\n")
        with job(folder / "logs" / f"{name}.log", [folder / name]):
            pass
    with job(folder / "logs/packing/p.log", [folder / "packings/p" / MANIFEST]):
        pass
    (folder / "provenance.json").write_text("{}\n")
    return folder


def flip(path):
    """Flip one bit of a file and leave its date."""
    before, data = path.stat(), bytearray(path.read_bytes())
    data[random.Random(path.name).randrange(len(data))] ^= 4
    path.write_bytes(data)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def names(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_results_that_are_whole_are_left_alone(study):
    before = names(study)
    assert list(resume.prepare(study.parents[1], study.parent)) == []
    assert names(study) == before


@pytest.mark.parametrize("name", ["csd/demo.csv", "replicates.csv", "summary.csv"])
@pytest.mark.parametrize("damage", [flip, lambda path: path.write_text(""), lambda path: path.unlink()])
def test_a_damaged_file_goes_with_what_is_made_of_it_but_no_packing(study, name, damage):
    damage(study / name)
    (line,) = resume.prepare(study.parents[1], study.parent)
    assert f"results/demo/{name} is not what was made" in line
    left = names(study)
    assert not left & {"csd/demo.csv", "replicates.csv", "summary.csv", "provenance.json"}
    assert {f"packings/p/{file}" for file in ("r0.npz", "r0.json", "r1.npz", "r1.json", MANIFEST)} <= left


@pytest.mark.parametrize("name", ["r1.npz", "r1.json", MANIFEST])
def test_a_flipped_bit_of_a_packing_costs_its_manifest(study, name):
    flip(study / "packings/p" / name)
    assert not whole(study / "packings/p" / MANIFEST)
    lines = list(resume.prepare(study.parents[1], study.parent))
    assert len(lines) == 1 and MANIFEST in lines[0]
    left = names(study)
    assert not left & {f"packings/p/{MANIFEST}", "replicates.csv", "provenance.json"}
    assert {"packings/p/r0.npz", "packings/p/r0.json"} <= left


def test_a_changed_number_in_a_record_is_noticed(study):
    record = study / "packings/p/r0.json"
    record.write_text(record.read_text().replace('"overlap_max": 0.01', '"overlap_max": 0.02'))
    with pytest.raises(PackingRejected, match=r"r0\.json is not the record that was written"):
        Packing.load(study / "packings/p/r0.npz")
    with pytest.raises(PackingRejected):
        read_sealed(record)


def test_checksums_are_those_of_sha256sum(study):
    done = subprocess.run(["sha256sum", "-c", "p.sha256"], cwd=study / "logs/packing", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("damage", [flip, lambda path: path.write_text(""), lambda path: path.write_bytes(b"\xff\x00")])
def test_damaged_checksums_vouch_for_nothing(study, damage):
    noted = study / "logs/summary.csv.sha256"
    damage(noted)
    with pytest.raises(checksums.ChecksumsDamaged):
        checksums.read(noted)
    (study / "notes.txt").write_text("the user's own")
    list(resume.prepare(study.parents[1], study.parent))
    left = names(study)
    assert not left & {"summary.csv", "replicates.csv", "provenance.json", "logs/summary.csv.sha256"}
    assert {"notes.txt", "packings/p/r0.npz", f"packings/p/{MANIFEST}"} <= left


def test_a_job_that_fails_notes_no_checksums(study):
    with pytest.raises(SystemExit), job(study / "logs/other.log", [study / "summary.csv"]):
        raise OSError(28, "No space left on device")
    assert not (study / "logs/other.sha256").exists()


def test_remains_of_a_killed_run_are_removed(study, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda _: os._exit(9))
    if (child := os.fork()) == 0:
        with publish(study / "summary.csv") as temporary:
            temporary.write_text("half")
    os.waitpid(child, 0)
    (study / "packings/p/.work/r1").mkdir(parents=True)
    folder = study.parents[1]
    for name in ("locks/0.input.lock", "scripts/tmpabc.packing.py"):
        (folder / ".snakemake" / name).parent.mkdir(parents=True)
        (folder / ".snakemake" / name).write_text("x")
    assert len(resume.remains(study.parent)) == 2
    assert len(list(resume.prepare(folder, study.parent))) == 3
    assert resume.remains(study.parent) == []
    assert not list(folder.glob(".snakemake/*/*"))
    assert (study / "summary.csv").read_text() == "summary.csv\n1,2,3\n"


def test_damaged_notes_of_snakemake_are_removed(tmp_path, study):
    notes = tmp_path / ".snakemake/metadata"
    notes.mkdir(parents=True)
    for name, text in {"good": b'{"rule": "csd"}', "empty": b"", "list": b"[1]", "binary": b"\xff\xfe"}.items():
        (notes / name).write_bytes(text)
    list(resume.prepare(tmp_path, study.parent))
    assert [path.name for path in notes.iterdir()] == ["good"]


def test_dates_in_the_future_are_set_to_now(study):
    os.utime(study / "summary.csv", (time.time() + 1e5,) * 2)
    (line,) = resume.prepare(study.parents[1], study.parent)
    assert "dated in the future" in line
    assert (study / "summary.csv").stat().st_mtime <= time.time() + 1


def test_orphans_are_ended_even_stubborn_ones(study, sleeper, monkeypatch):
    monkeypatch.setattr(resume, "GRACE_SECONDS", 0.5)
    folder = study.parents[1]
    ours = [sleeper(code, "/", **{FOLDER_VARIABLE: str(folder)}) for code in (SLEEP, STUBBORN)]
    other = sleeper(SLEEP, "/", **{FOLDER_VARIABLE: str(folder / "another")})
    lines = list(resume.prepare(folder, study.parent))
    assert [f"process {orphan.pid}" in " ".join(lines) for orphan in ours] == [True, True]
    # reaped by the wait for them: their status is not known here
    assert all(orphan.wait(5) is not None for orphan in ours)
    assert other.poll() is None


def test_a_live_run_is_not_disturbed(study, sleeper):
    folder = study.parents[1]
    program = folder / "snakemake"
    program.write_text(SLEEP)
    lock = folder / ".snakemake/locks/0.output.lock"
    lock.parent.mkdir(parents=True)
    lock.write_text("x")
    running = sleeper("", folder, sys.executable, str(program))
    sleeper("", "/", sys.executable, str(program))
    assert [found.pid for found in resume.live_runs(folder)] == [running.pid]
    with pytest.raises(resume.RunGoesOn, match=f"process {running.pid}"):
        list(resume.prepare(folder, study.parent))
    assert lock.exists() and running.poll() is None
    (folder / "config").mkdir()
    (folder / "config/config.yaml").write_text("studies: [demo]\n")
    done = subprocess.run([sys.executable, "-m", "filtercake.run.resume"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 1 and lock.exists()
    why = f"a run is going on in {folder} (process {running.pid}); wait for it, or end it first"
    assert done.stderr == f"filtercake cannot resume: {why}\n"


def test_results_folder_is_that_of_the_command_or_the_configuration(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text("studies: [demo]\nresults: elsewhere\n")
    assert str(resume.results_folder(["--config", "studies=a"])) == "elsewhere"
    assert str(resume.results_folder(["--config", "studies=a", "results=/data/r"])) == "/data/r"


def test_only_failures_that_may_pass_are_forgotten(study):
    manifest = study / "packings/p" / MANIFEST
    for may_pass in (False, True):
        entries = [{"replicate": 0, "status": "failed", "reason": "x", "may_pass": may_pass}]
        write_json(manifest, {"key": "key", "replicates": entries})
        assert forget_failures(study.parent, may_pass=True) == (["demo/p"] if may_pass else [])
    write_json(manifest, {"key": "key", "replicates": [{"replicate": 0, "status": "failed", "may_pass": False}]})
    assert forget_failures(study.parent) == ["demo/p"]
    # what was made of the failure must go too, or nothing would ask for the packing
    assert not names(study) & {"replicates.csv", "provenance.json"}


def test_temporary_files_of_a_program_go_with_its_folder(tmp_path):
    process.run(["sh", "-c", "echo $TMPDIR"], tmp_path, tmp_path / "out")
    assert (tmp_path / "out").read_text().strip() == str(tmp_path)


def test_of_two_that_resume_at_once_one_goes_on(tmp_path):
    (tmp_path / ".snakemake").mkdir()
    with (tmp_path / ".snakemake/resume.lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        command = [sys.executable, "-m", "filtercake.run.resume"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == f"filtercake cannot resume: a run is going on in {tmp_path}\n"


@pytest.mark.parametrize(
    ("given", "arguments"),
    [
        ([], "--cores 2"),
        (["STUDIES=a,b", "CORES=3"], "--cores 3 --config studies=a,b"),
        (["CALIBRATION=pmma"], "--cores 2 calibrate --config calibrations=pmma"),
    ],
)
@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_make_resume_takes_what_the_run_took(given, arguments):
    command = ["make", "--dry-run", "resume", *given]
    plain = {"PATH": os.environ["PATH"]}  # a make above this one must not pass its own values on
    done = subprocess.run(command, cwd=PROJECT, env=plain, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1].split("filtercake.run.resume ")[1].strip() == arguments
