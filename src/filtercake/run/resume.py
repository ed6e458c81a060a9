"""Go on after whatever stopped a run: ``python -m filtercake.run.resume [arguments of snakemake]``.

Ends what a killed run left running, removes its lock and its temporary files, and forgets what is damaged or failed for
a reason that may have passed; then runs Snakemake, which makes what is missing. Finished packings are kept.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil

from filtercake.errors import FiltercakeError
from filtercake.packing.pack import MANIFEST, WORK, whole
from filtercake.packing.result import TEMPORARY
from filtercake.run import checksums
from filtercake.run.job import FOLDER_VARIABLE
from filtercake.run.retry import forget, forget_failures
from filtercake.study.config.study import Workflow
from filtercake.study.loading import load_workflow
from filtercake.user_files import read_yaml

GRACE_SECONDS = 15.0
"""Wall time that a process left over has to end by itself."""
MADE = ("*.csv", "*.json", "csd/*", "tables/*", "figures/*", "rounds/*", "design/*.json", "design/*/*")
"""What the jobs of a study or calibration make in its folder, besides packings."""
CONFIG_FILE = "config/config.yaml"


class RunGoesOn(FiltercakeError):  # noqa: N818 - reads better where it is raised
    """Another run works in this folder: it must not be disturbed."""


def prepare(folder: Path, results: Path) -> Iterator[str]:
    """Make the working directory of a workflow fit to run in again, whatever stopped the last run.

    Yields
    ------
    str
        A line about each thing done.

    Raises
    ------
    RunGoesOn
        If a run is alive in the folder.
    """
    for process in live_runs(folder):
        raise RunGoesOn(f"a run is going on in {folder} (process {process.pid}); wait for it, or end it first")
    for process in end_orphans(folder):
        yield f"ended process {process.pid}, which a killed run had left"
    shutil.rmtree(folder / ".snakemake" / "locks", ignore_errors=True)
    for path in [*remains(results), *(folder / ".snakemake" / "scripts").glob("tmp*")]:
        _remove(path)
        yield f"removed {_short(path, folder)}, which a killed run had left"
    for path in broken_metadata(folder / ".snakemake"):
        path.unlink()
        yield f"removed Snakemake's damaged note {path.name}"
    for path in from_the_future(results):
        os.utime(path)
        yield f"{_short(path, folder)} was dated in the future: set to now"
    for path in forget_spoiled(results):
        yield f"{_short(path, folder)} is not what was made: to be made again"
    for point in forget_failures(results, may_pass=True):
        yield f"{point} has packings that failed for a reason that may have passed: to be made again"


def live_runs(folder: Path) -> list[psutil.Process]:
    """Snakemake processes that work in a folder."""
    return [process for process in _others() if _is_snakemake(process) and _in_folder(process, folder)]


def end_orphans(folder: Path) -> list[psutil.Process]:
    """End every process that a run in the folder started and did not live to end: politely, then for good."""
    orphans = [process for process in _others() if _started_from(process, folder)]
    for process in orphans:
        process.terminate()
    _, stubborn = psutil.wait_procs(orphans, timeout=GRACE_SECONDS)
    for process in stubborn:
        process.kill()
    psutil.wait_procs(stubborn, timeout=GRACE_SECONDS)
    return orphans


def remains(results: Path) -> list[Path]:
    """Temporary files and scratch folders in the results."""
    found = []
    for parent, folders, files in os.walk(results):
        if WORK in folders:
            folders.remove(WORK)
            found.append(Path(parent, WORK))
        found += [Path(parent, name) for name in files if TEMPORARY.fullmatch(name)]
    return found


def broken_metadata(snakemake: Path) -> list[Path]:
    """Snakemake's own notes that are not the JSON object it wrote: some stop it, some mislead it."""
    files = [path for name in ("metadata", "incomplete") for path in (snakemake / name).rglob("*") if path.is_file()]
    return [path for path in files if not _is_object(path)]


def from_the_future(results: Path) -> list[Path]:
    """Results dated after now, as a clock set back leaves them; whatever depends on them would be made for ever."""
    limit = time.time() + 1.0
    return [path for path in results.rglob("*") if path.is_file() and path.stat().st_mtime > limit]


def forget_spoiled(results: Path) -> list[Path]:
    """Remove every file that is no longer what its job made, with what was made from it.

    Packings are checked by their own checksums; a damaged one costs its point's manifest, and is the only one made
    again.
    """
    found = []
    for manifest in sorted(results.glob(f"*/packings/*/{MANIFEST}")):
        if not whole(manifest):
            found.append(manifest)
    for noted in damaged_checksums(results):
        found += [noted, *unverified(noted)]
        noted.unlink()
    for path in found:
        forget(path)
    for noted in sorted(results.glob(f"*/logs/**/*{checksums.SUFFIX}")):
        bad = checksums.spoiled(noted) if noted.exists() else []
        found += bad
        for path in bad:
            forget(path)
    return found


def damaged_checksums(results: Path) -> list[Path]:
    """Files of checksums that are not what was written."""
    return [path for path in sorted(results.glob(f"*/logs/**/*{checksums.SUFFIX}")) if not _readable(path)]


def unverified(noted: Path) -> list[Path]:
    """Files of a study that no checksum vouches for when that file of checksums is damaged."""
    study = next(parent.parent for parent in noted.parents if parent.name == "logs")
    good = [path for path in (study / "logs").rglob(f"*{checksums.SUFFIX}") if _readable(path)]
    known = {output for path in good for output in checksums.read(path)}
    made = [path for pattern in MADE for path in study.glob(pattern) if path.is_file()]
    return [path for path in made if path not in known] if (study / "packings").is_dir() else []


def results_folder(arguments: list[str]) -> Path:
    """Folder of the results: ``results=...`` among the arguments, what the folder's configuration says, or the default.

    Raises
    ------
    ConfigError
        If that is not usable.
    """
    for argument in arguments:
        if argument.startswith("results="):
            return Path(argument.removeprefix("results="))
    if not Path(CONFIG_FILE).exists():  # the workflow was started from elsewhere, with its own
        return Path(Workflow.model_fields["results"].default)
    return Path(load_workflow(read_yaml(Path(CONFIG_FILE)), CONFIG_FILE).results)


def main(arguments: list[str]) -> None:
    """Prepare the working directory and become Snakemake."""
    if any(argument.split("=")[0] in ("--directory", "-d") for argument in arguments):
        sys.exit("filtercake cannot resume: start it in the folder that --directory names, without --directory")
    folder = Path.cwd()
    state = folder / ".snakemake"
    state.mkdir(exist_ok=True)
    try:
        # inherited by Snakemake and let go when it ends: of two that resume at once, one goes on
        lock = os.open(state / "resume.lock", os.O_CREAT | os.O_RDWR)
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        for line in prepare(folder, results_folder(arguments)):
            print(f"resume: {line}", file=sys.stderr, flush=True)
    except BlockingIOError:
        sys.exit(f"filtercake cannot resume: a run is going on in {folder}")
    except FiltercakeError as error:
        sys.exit(f"filtercake cannot resume: {error}")
    except OSError as error:
        sys.exit(f"filtercake cannot resume: {error.filename}: {error.strerror}")
    os.set_inheritable(lock, True)
    os.execv(sys.executable, [sys.executable, "-m", "snakemake", *arguments, "--rerun-incomplete"])


def _others() -> Iterator[psutil.Process]:
    return (process for process in psutil.process_iter() if process.pid != os.getpid())


def _is_snakemake(process: psutil.Process) -> bool:
    try:
        words = process.cmdline()
    except psutil.Error:
        return False
    # as a module, as the program, or as the program run by its interpreter
    return "snakemake" in [Path(word).name for word in words[:2]] or words[1:3] == ["-m", "snakemake"]


def _in_folder(process: psutil.Process, folder: Path) -> bool:
    try:
        return Path(process.cwd()) == folder.resolve()
    except psutil.Error:
        return False


def _started_from(process: psutil.Process, folder: Path) -> bool:
    try:
        return process.environ().get(FOLDER_VARIABLE) == str(folder.resolve())
    except (psutil.Error, OSError):
        return False


def _readable(noted: Path) -> bool:
    try:
        checksums.read(noted)
    except checksums.ChecksumsDamaged:
        return False
    return True


def _is_object(path: Path) -> bool:
    try:
        return isinstance(json.loads(path.read_text(encoding="utf-8")), dict)
    except ValueError:
        return False


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _short(path: Path, folder: Path) -> Path:
    return path.relative_to(folder) if path.is_relative_to(folder) else path


if __name__ == "__main__":
    main(sys.argv[1:])
