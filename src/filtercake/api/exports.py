"""One packing of a study as a folder that stands alone: for a bug report, or to look into by hand."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from filtercake.api.measured import PackingPorosity, porosity
from filtercake.crystals.csd import FullAndTruncated, columns, from_table, read_table, to_table
from filtercake.errors import ConfigError, FiltercakeError, PackingRejected, Problem
from filtercake.packing.cloud import make_cloud
from filtercake.packing.engines import ENGINES, SettleRequest
from filtercake.packing.pack import MANIFEST, cloud_seed, pack
from filtercake.packing.result import read_record, write_json
from filtercake.packing.scene import Scene, stage_seed
from filtercake.packing.settling import StopRule
from filtercake.run.provenance import ROOT, describe, packing_code
from filtercake.study import engine_choice
from filtercake.study.config.values import NAME
from filtercake.study.loading import LoadedStudy, load_study
from filtercake.study.points import Point, expand, packed

STUDIES = Path("config/studies")
INPUT = "packing.json"
LARGEST_INPUT = 10_000_000
RERUN = "rerun"
MOST_REPLICATES = 100_000
ORIGIN = "options"


@dataclass(frozen=True)
class Exported:
    """An exported packing.

    Attributes
    ----------
    folder : Path
        Folder of the export.
    point : str
        Name of the point.
    replicate : int
        Number of the replicate.
    status : str
        ``ok``, ``failed`` or ``not made``.
    """

    folder: Path
    point: str
    replicate: int
    status: str


def export(study: str, point: str, results: str | Path, output: str | Path, replicate: int | None = None) -> Exported:
    """Write everything about one packing to a folder of its own.

    Parameters
    ----------
    study : str
        Name of a file in config/studies, or the path of a study file.
    point : str
        Name of one of its points.
    results : str or Path
        Folder of the results; what it holds about the packing is copied.
    output : str or Path
        The folder, which must not exist.
    replicate : int, optional
        Number of the packing; the first that failed, or 0, if left out.

    Raises
    ------
    ConfigError
        If there is no such study or point, or the output exists.
    """
    loaded = load_study(_study_file(study))
    chosen = _find(loaded, point)
    made = Path(results) / loaded.name
    outcomes = _outcomes(made / "packings" / chosen.name / MANIFEST)
    number = _choose(outcomes) if replicate is None else replicate
    if not 0 <= number < max(chosen.most_replicates, len(outcomes)):
        allowed = f"must be 0 to {max(chosen.most_replicates, len(outcomes)) - 1}"
        raise ConfigError([Problem(ORIGIN, "replicate", str(number), allowed)])
    folder = Path(output)
    if folder.exists():
        raise ConfigError([Problem(ORIGIN, "output", str(folder), "exists; name a new folder")])
    folder.mkdir(parents=True)
    outcome = outcomes.get(number, {})
    _write(folder, loaded, chosen, number, outcome, _sizes(loaded, chosen, made))
    _copy(made, chosen.name, number, folder / "as_run")
    return Exported(folder, chosen.name, number, str(outcome.get("status", "not made")))


def rerun(folder: str | Path) -> PackingPorosity:
    """Make an exported packing once more, in the folder ``rerun`` of the export.

    Raises
    ------
    ConfigError
        If the folder does not hold an export.
    CloudError, EngineError, PackingRejected
        If the packing fails, as it may have done before.
    """
    source = Path(folder) / INPUT
    scene, replicate = _read(source)
    scratch = Path(folder) / RERUN
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir()
    npz = scratch / f"r{replicate}.npz"
    pack(scene, replicate, scratch).save(npz)
    return porosity(npz)


def first_porosity(folder: str | Path) -> float | None:
    """Porosity of an exported packing as it was made first, None where it was not accepted."""
    for npz in (Path(folder) / "as_run").glob("r*.npz"):
        try:
            return porosity(npz).porosity
        except PackingRejected:
            return None
    return None


def _study_file(study: str) -> Path:
    if study.endswith((".yaml", ".yml")):
        return Path(study)
    if not NAME.match(study):
        allowed = f"must be the name of a file in {STUDIES}, or the path of a study file (.yaml)"
        raise ConfigError([Problem(ORIGIN, "study", repr(study), allowed)])
    return STUDIES / f"{study}.yaml"


def _find(study: LoadedStudy, name: str) -> Point:
    points = {point.name: point for point in expand(engine_choice.of_this_machine(study), engine_choice.choose)}
    if name not in points:
        allowed = f"no such point of the study {study.name} on this machine; points: {', '.join(points)}"
        raise ConfigError([Problem(ORIGIN, "point", repr(name), allowed)])
    # a pressed point's packings are those of all its pressures
    (found,) = packed([points[name]]).values()
    return found


def _outcomes(manifest: Path) -> dict[int, dict[str, Any]]:
    """Read what the results say of a point's packings; nothing where they are not made yet."""
    try:
        entries = read_record(manifest)["replicates"]
        return {int(entry["replicate"]): dict(entry) for entry in entries}
    except (PackingRejected, KeyError, TypeError, ValueError):
        return {}


def _choose(outcomes: dict[int, dict[str, Any]]) -> int:
    return next((number for number, entry in sorted(outcomes.items()) if entry.get("status") != "ok"), 0)


def _sizes(study: LoadedStudy, point: Point, made: Path) -> FullAndTruncated:
    """Sizes as the packing's job read them: those of the table, whose last digits decide the seed."""
    try:
        return read_table(made / "csd" / f"{point.csd}.csv")
    except (OSError, ValueError, FiltercakeError):
        csd = study.csds[point.csd]
        return from_table(columns(csd.full, csd.truncated))


def _write(
    folder: Path, study: LoadedStudy, point: Point, replicate: int, outcome: dict[str, Any], sizes: FullAndTruncated
) -> None:
    full, csd = sizes
    scene = replace(point.scene, csd=csd)
    seed = cloud_seed(scene, replicate)
    to_table(full, csd).to_csv(folder / "distribution.csv", index=False)
    found = {
        "study": study.name,
        "point": point.name,
        "replicate": replicate,
        "outcome": outcome,
        "scene": scene.as_dict(),
        "seeds": {"base": scene.seed, "cloud": seed, "engine": stage_seed(seed, "engine")},
        "code": packing_code(scene.engine),
    }
    write_json(folder / INPUT, found)
    write_json(folder / "versions.json", {**describe(ROOT), "engine": _engine_words(scene.engine)})
    shutil.copyfile(study.path, folder / "study.yaml")
    problem = _write_input(folder, scene, seed)
    inputs = [name for name in ENGINES[scene.engine].evidence if (folder / name).is_file()]
    (folder / "README.md").write_text(_readme(found, inputs, problem), encoding="utf-8")


def _write_input(folder: Path, scene: Scene, seed: int) -> str:
    """Write the cloud, and what the engine reads; say why not where that fails."""
    if scene.is_pressed:
        return ""  # the cell makes its own
    try:
        cloud = make_cloud(scene.csd, scene.particles, scene.initial_void_fraction, seed, scene.bed_depth_factor)
        with (folder / "cloud.npz").open("wb") as stream:
            np.savez(stream, position=cloud.position, radius=cloud.radius, length=cloud.length, height=cloud.height)
        rule = StopRule.for_bed(scene, cloud.length)
        request = SettleRequest(scene, cloud, rule, stage_seed(seed, "engine"), folder, lambda _: None)
        ENGINES[scene.engine]().write_input(request)
    except FiltercakeError as error:  # a cloud that cannot be made is what the report is about
        return str(error)
    return ""


def _engine_words(name: str) -> str:
    missing = ENGINES[name]().why_missing()
    return f"{name} (not on the machine that exported: {missing})" if missing else name


def _copy(made: Path, point: str, replicate: int, target: Path) -> None:
    """Copy what the results hold about the packing; links that lead out of them are left out."""
    home = made.resolve()
    packings = made / "packings" / point
    found = [made / "logs" / "packing" / f"{point}.log", made / "provenance.json", packings / MANIFEST]
    found += [packings / f"r{replicate}{end}" for end in (".npz", ".json")]
    found += sorted((packings / f"r{replicate}.failed").glob("*"))
    for path in found:
        if path.is_file() and path.resolve().is_relative_to(home):
            copy = target / ("failed" if path.parent.suffix == ".failed" else "") / path.name
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)


def _readme(found: dict[str, Any], inputs: list[str], problem: str) -> str:
    outcome, by_hand = found["outcome"], ENGINES[found["scene"]["engine"]].by_hand
    settles = "protocol" not in found["scene"]
    lines = [
        f"# {found['study']}: {found['point']}, replicate {found['replicate']}",
        "",
        f"Status: {outcome.get('status', 'not made')}. {outcome.get('reason', '')}".strip(),
        *(["", f"The cloud or the deck cannot be made: {problem}"] if problem else []),
        "",
        "To make this packing again, in this folder:",
        "",
        "    filtercake rerun .",
        "",
        "It goes to `rerun/`, beside the engine's own files, and its porosity is printed.",
    ]
    if inputs:
        lines += [f"The engine's input alone, without filtercake: `{by_hand}`."]
    lines += [
        "",
        "| file | holds |",
        "|---|---|",
        f"| `{INPUT}` | all that decides the packing (SI units): sizes, material, time step, seeds |",
        "| `versions.json` | versions and machine |",
        "| `study.yaml`, `distribution.csv` | the study; the size distribution, whole and as packed |",
        *(["| `cloud.npz` | the spheres before settling: position, radius, box (m) |"] if settles else []),
        *([f"| {', '.join(f'`{name}`' for name in inputs)} | what the engine reads |"] if inputs else []),
        "| `as_run/` | what the results hold: packing and record, log, and the engine's output where it failed |",
    ]
    return "\n".join(lines) + "\n"


def _read(source: Path) -> tuple[Scene, int]:
    """Read an export's input; it may come from anyone, so every value is checked."""
    try:
        if source.stat().st_size > LARGEST_INPUT:
            raise ValueError("is too large")
        values = json.loads(source.read_text(encoding="utf-8"))
        scene, replicate = Scene.from_dict(values["scene"]), int(values["replicate"])
    except OSError as error:
        raise _unusable(source, f"cannot be read: {error.strerror}") from None
    except (FiltercakeError, ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise _unusable(source, f"is not an exported packing ({type(error).__name__}: {error})") from None
    if not 0 <= replicate < MOST_REPLICATES or scene.engine not in ENGINES:
        raise _unusable(source, "is not an exported packing (replicate or engine)")
    return scene, replicate


def _unusable(source: Path, text: str) -> ConfigError:
    return ConfigError([Problem(str(source), "(file)", "", f"{source}: {text}")])
