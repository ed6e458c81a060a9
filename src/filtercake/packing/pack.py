"""Make packings: cloud, settling, acceptance; and all replicates of a point, without redoing finished ones."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filtercake.errors import CellError, CloudError, EngineError, EngineMissing, PackingRejected
from filtercake.packing.accept import accept
from filtercake.packing.cloud import Cloud, make_cloud
from filtercake.packing.compression import press_cake
from filtercake.packing.engines import Engine, SettleRequest, get_engine
from filtercake.packing.result import Packing, SettledState, read_sealed, sealed, sha256, write_json
from filtercake.packing.scene import Scene, digest, stage_seed
from filtercake.packing.settling import StopRule

ATTEMPTS = 3
"""Times a packing is tried when it fails for a reason that may pass (killed, output cut short)."""
MANIFEST = "replicates.json"
WORK = ".work"
"""Scratch folder of a point's packings."""

Report = Callable[[str], None]
"""Receives a line of progress."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of one replicate.

    Attributes
    ----------
    replicate : int
        Number of the replicate, from 0.
    status : {"ok", "failed"}
        Whether there is an accepted packing.
    reason : str
        Reason of the failure; empty for an accepted packing.
    seed : int
        Seed of the initial cloud.
    sha256 : str
        Checksum of the geometry file; empty where there is none.
    attempts : int
        Number of attempts.
    may_pass : bool
        Whether it failed for a reason outside the packing (program killed or missing, disk full, time limit), so that
        another run may make it.
    """

    replicate: int
    status: str
    reason: str
    seed: int
    sha256: str
    attempts: int
    may_pass: bool = False


def cloud_seed(scene: Scene, replicate: int) -> int:
    """Seed of a replicate's cloud.

    It follows from what the cloud is made of, not from friction, cohesion or engine: common random numbers
    make the differences between those sharp.
    """
    classes = [[f"{size:.12e}" for size in scene.csd.size], [f"{x:.12e}" for x in scene.csd.volume_fraction]]
    return stage_seed(scene.seed, classes, scene.particles, scene.initial_void_fraction, replicate, "cloud")


def pack(
    scene: Scene,
    replicate: int,
    folder: Path,
    *,
    engine: Engine | None = None,
    progress: Report = lambda _: None,
    state_file: Path | None = None,
) -> Packing:
    """Make one packing.

    Parameters
    ----------
    scene : Scene
        Distribution, material, time step, protocol.
    replicate : int
        Number of the replicate; decides the seed.
    folder : Path
        Empty scratch folder for the engine's files.
    engine, progress : Engine, callable, optional
        Used instead of the engine that the scene names; receives a line about a long packing.
    state_file : Path, optional
        Keeps the state of a long packing, which goes on from there when it was stopped.

    Raises
    ------
    CloudError, EngineError, PackingRejected
        If the spheres cannot be placed, the engine fails, or its result is not acceptable.
    """
    if scene.is_pressed:
        return press_cake(scene, replicate, cloud_seed(scene, replicate), progress, state_file)
    settled = settle(scene, replicate, folder, engine=engine, progress=progress, state_file=state_file)
    state = settled.state
    diagnostics = {
        **accept(state, scene, settled.cloud, settled.rule),
        "replicate": replicate,
        "seed": settled.seed,
        "rayleigh_fraction": scene.rayleigh_fraction,
        "scene": scene.as_dict(),
    }
    return Packing(state.position, state.radius, state.length, diagnostics)


@dataclass(frozen=True)
class Settled:
    """Result of an engine with what it started from, accepted or not.

    Attributes
    ----------
    state : SettledState
        The engine's result.
    cloud : Cloud
        Initial cloud.
    rule : StopRule
        Stop rule.
    seed : int
        Seed of the cloud.
    """

    state: SettledState
    cloud: Cloud
    rule: StopRule
    seed: int


def settle(
    scene: Scene,
    replicate: int,
    folder: Path,
    *,
    engine: Engine | None = None,
    progress: Report = lambda _: None,
    state_file: Path | None = None,
) -> Settled:
    """Make a cloud and let an engine settle it; the parameters are those of :func:`pack`.

    Raises
    ------
    CloudError, EngineError
        If the spheres cannot be placed, or the engine fails.
    """
    seed = cloud_seed(scene, replicate)
    cloud = make_cloud(scene.csd, scene.particles, scene.initial_void_fraction, seed, scene.bed_depth_factor)
    rule = StopRule.for_bed(scene, cloud.length)
    request = SettleRequest(scene, cloud, rule, stage_seed(seed, "engine"), folder, progress, state_file)
    return Settled((engine or get_engine(scene.engine)).settle(request), cloud, rule, seed)


def pack_replicates(
    scene: Scene,
    replicates: int,
    folder: Path,
    code: str,
    report: Callable[[Outcome, dict[str, Any]], None] = lambda _outcome, _record: None,
    progress: Report = lambda _: None,
    enough: Callable[[Path], bool] = lambda _: False,
) -> list[Outcome]:
    """Make the replicates of a point in ``folder`` and write their manifest last.

    Finished replicates are kept when the same point is run again, unless what decides the packing or the code (whose
    hash is ``code``) changed; a packing that fails is an outcome with a reason, not an error.

    Parameters
    ----------
    scene, progress
        As for :func:`pack`.
    replicates : int
        Largest number of packings.
    folder : Path
        Receives r<k>.npz, r<k>.json and the manifest.
    report : callable
        Receives the outcome of every packing that is made, and its record.
    enough : callable
        Called with the geometry file of every accepted packing; says whether no further one is needed.

    Raises
    ------
    EngineMissing
        If the engine is not installed: no replicate could be made.
    """
    key = point_key(code, scene)
    engine = get_engine(scene.engine)
    work = folder / WORK
    shutil.rmtree(work, ignore_errors=True)
    outcomes = []
    for replicate in range(replicates):
        npz = folder / f"r{replicate}.npz"
        kept = finished(npz, key, replicate)
        if kept is not None:
            outcome = kept[0]
            progress(f"r{replicate} is kept")
        else:
            outcome, record = _attempt(scene, replicate, npz, key, engine, work, progress)
            report(outcome, record)
        outcomes.append(outcome)
        if outcome.status == "ok" and enough(npz):
            break
    shutil.rmtree(work, ignore_errors=True)
    write_json(folder / MANIFEST, sealed({"key": key, "replicates": [vars(outcome) for outcome in outcomes]}))
    return outcomes


def point_key(code: str, scene: Scene) -> str:
    """Hash of all that a point's packings follow from."""
    return digest(code, scene.decisive())


def finished(npz: Path, key: str, replicate: int) -> tuple[Outcome, dict[str, Any]] | None:
    """Outcome and record of a replicate that was made before from the same inputs and is still whole."""
    try:
        record = read_sealed(npz.with_suffix(".json"))
        if record.get("key") != key or record.get("sha256") != sha256(npz):
            return None
    except (PackingRejected, OSError):
        return None
    outcome = Outcome(replicate, "ok", "", record["seed"], record["sha256"], record["attempts"])
    return outcome, record


def count_kept(folder: Path, key: str, replicates: int) -> int:
    """Count the replicates that will be kept, by their records alone, which is quick."""
    count = 0
    for replicate in range(replicates):
        try:
            count += read_sealed(folder / f"r{replicate}.json").get("key") == key
        except (PackingRejected, OSError):
            continue
    return count


def whole(manifest: Path) -> bool:
    """Whether a manifest and every packing that it lists as accepted are what was written."""
    try:
        for entry in read_sealed(manifest)["replicates"]:
            npz = manifest.parent / f"r{entry['replicate']}.npz"
            if entry["status"] == "ok" and (
                read_sealed(npz.with_suffix(".json")).get("sha256") != entry["sha256"] or sha256(npz) != entry["sha256"]
            ):
                return False
    except (PackingRejected, OSError):
        return False
    return True


def _attempt(
    scene: Scene,
    replicate: int,
    npz: Path,
    key: str,
    engine: Engine,
    work: Path,
    progress: Report,
) -> tuple[Outcome, dict[str, Any]]:
    seed = cloud_seed(scene, replicate)
    state_file = _state_file(npz, key)
    for attempt in range(1, ATTEMPTS + 1):
        scratch = work / f"r{replicate}"
        shutil.rmtree(scratch, ignore_errors=True)
        scratch.mkdir(parents=True)
        try:
            made = pack(scene, replicate, scratch, engine=engine, progress=progress, state_file=state_file)
        except EngineMissing:
            raise
        except (CellError, CloudError, EngineError, PackingRejected) as error:
            if getattr(error, "transient", False) and attempt < ATTEMPTS:
                progress(f"replicate {replicate}: {error}; trying again")
                continue
            _keep_evidence(scratch, npz, engine.evidence)
            may_pass = bool(getattr(error, "may_pass", False))
            if not may_pass:  # what was stopped goes on from there when it is given more
                state_file.unlink(missing_ok=True)
            return Outcome(replicate, "failed", str(error), seed, "", attempt, may_pass), {}
        record = {**made.diagnostics, "key": key, "attempts": attempt}
        checksum = Packing(made.position, made.radius, made.length, record).save(npz)
        _keep_pictures(scratch, npz)
        state_file.unlink(missing_ok=True)
        return Outcome(replicate, "ok", "", seed, checksum, attempt), record
    raise AssertionError("unreachable")


def _state_file(npz: Path, key: str) -> Path:
    """Where a replicate's unfinished state is kept; states of other inputs or code are removed."""
    wanted = npz.with_name(f"{npz.stem}.{key[:16]}.state.npz")
    for path in npz.parent.glob(f"{npz.stem}.*.state.npz"):
        if path != wanted:
            path.unlink(missing_ok=True)
    return wanted


def _keep_evidence(scratch: Path, npz: Path, names: Iterable[str]) -> None:
    """Keep the engine's input and output of a failed packing; drop what an earlier run left for it."""
    kept = npz.with_suffix(".failed")
    shutil.rmtree(kept, ignore_errors=True)
    kept.mkdir(parents=True)
    for name in names:
        if (scratch / name).exists():
            shutil.move(scratch / name, kept / name)
    npz.unlink(missing_ok=True)
    npz.with_suffix(".json").unlink(missing_ok=True)


def _keep_pictures(scratch: Path, npz: Path) -> None:
    shutil.rmtree(npz.with_suffix(".failed"), ignore_errors=True)
    pictures = sorted(scratch.glob("*.vtk"))
    if pictures:
        folder = npz.with_suffix(".vtk")
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for picture in pictures:
            shutil.move(picture, folder / picture.name)
