"""Packings of one distribution without Snakemake: pack, measure, average."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from filtercake.api.arguments import ORIGIN, PRESSURE
from filtercake.api.steps import Distribution, csd_name, load, resistance
from filtercake.errors import ConfigError, PackingRejected, Problem
from filtercake.filtration.resistance import CARMAN
from filtercake.packing.pack import MANIFEST, Outcome, Report, pack_replicates, point_key
from filtercake.packing.replication import UntilNarrow
from filtercake.packing.result import read_sealed, write_json
from filtercake.packing.scene import FILTRATION_PROTOCOL
from filtercake.results.replicates import REPLICATE_COLUMNS, replicate_rows, summarise
from filtercake.run.provenance import packing_code, versions
from filtercake.study import engine_choice
from filtercake.study.config.material import Material
from filtercake.study.points import Point, base_point
from filtercake.units import MICROSECOND

SUMMARY = "summary.json"
_OWN = re.compile(rf"r\d+\..*|\.r\d+\..*|\.work|{re.escape(MANIFEST)}|{re.escape(SUMMARY)}")
"""Names that packings and their records have."""


@dataclass(frozen=True)
class Bed:
    """Packings of one distribution, measured.

    Attributes
    ----------
    summary : dict
        Means, 95 % half-widths, counts: the columns of ``summary.csv`` (docs: config/README.md); None where there is
        no value.
    replicates : DataFrame
        One row per packing: the columns of ``replicates.csv``.
    files : tuple of Path
        The accepted packings.
    failures : tuple of str
        Reasons of the failed packings.
    warnings : tuple of str
        Doubts about allowed arguments.
    """

    summary: dict[str, Any]
    replicates: pd.DataFrame
    files: tuple[Path, ...]
    failures: tuple[str, ...]
    warnings: tuple[str, ...]


def pack(
    source: Distribution,
    folder: str | Path,
    *,
    law: str = CARMAN,
    say: Report = lambda _: None,
    replace: bool = False,
    **options: Any,
) -> Bed:
    """Pack spheres of a size distribution, and measure porosity and resistance.

    Packings that ``folder`` holds of the same arguments are kept, so that more of them, or a narrower interval, may be
    asked for later.

    Parameters
    ----------
    source : Distribution
        The size distribution.
    folder : str or Path
        Receives the packings, ``r<k>.npz`` and ``.json``; new, empty, or of an earlier call.
    law : str
        Law of the resistance (see :func:`resistance`), which decides nothing of the packings.
    say : callable
        Receives a line per packing.
    replace : bool
        Whether packings of other options, or of another version of the program, may be lost; an error otherwise.
    **options
        The keys of the configuration's blocks ``material`` and ``packing``. Without a ``protocol`` the cake is pressed
        as in a filter (``filtration``), at ``PRESSURE`` where no pressure is given, and without attraction where
        neither ``adhesion_mJ_m2`` nor ``cohesion_kJ_m3`` is given; ``gravity`` drops the crystals, as the paper does.

    Raises
    ------
    ConfigError
        With every problem.
    EngineMissing
        If the engine asked for is not installed.
    """
    given = {name: value for name, value in options.items() if name in Material.model_fields}
    rest = {name: value for name, value in options.items() if name not in given}
    material, packing = as_packed_by_default(given, rest)
    study = load(source.options, material, packing, law)
    path, name = Path(folder), csd_name(study)
    _check_folder(path)
    point = base_point(study, name, engine_choice.choose)
    made = point.scene.as_packed()
    csd = study.csds[name]
    # a resistance beyond floating point is found before the packings are made, not after
    sphericity = study.model.material.sphericity
    resistance(source, porosity=0.01, density_kg_m3=point.scene.density, sphericity=sphericity, law=law)
    if not replace:
        _check_packings(path, point_key(packing_code(made.engine), made))
    outcomes = _make(point, path, say)
    rows = list(replicate_rows(point, outcomes, path, (csd.full, csd.truncated), sphericity, law))
    table = pd.DataFrame(rows, columns=list(REPLICATE_COLUMNS))
    summary = _summary(table, point)
    write_json(path / SUMMARY, {**summary, "versions": versions()})
    return Bed(
        summary=summary,
        replicates=table,
        files=tuple(path / f"r{outcome.replicate}.npz" for outcome in outcomes if outcome.status == "ok"),
        failures=tuple(f"r{outcome.replicate}: {outcome.reason}" for outcome in outcomes if outcome.status != "ok"),
        warnings=study.warnings,
    )


def as_packed_by_default(
    material: Mapping[str, Any], packing: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Fill in the blocks ``material`` and ``packing`` where nothing is said: pressed, without attraction."""
    crystals, made = dict(material), dict(packing)
    if made.setdefault("protocol", FILTRATION_PROTOCOL) == FILTRATION_PROTOCOL:
        made.setdefault("pressure_kPa", PRESSURE)
        if crystals.keys().isdisjoint({"adhesion_mJ_m2", "cohesion_kJ_m3"}):
            crystals["adhesion_mJ_m2"] = 0.0
    return crystals, made


def _make(point: Point, folder: Path, say: Report) -> list[Outcome]:
    def report(outcome: Outcome, record: dict[str, Any]) -> None:
        if outcome.status == "ok":
            say(f"r{outcome.replicate}: {record['steps']:,} steps, {record['wall_s']:.1f} s")
        else:
            say(f"r{outcome.replicate} failed: {outcome.reason}")

    made = point.scene.as_packed()
    interval, code = point.porosity_ci95_target, packing_code(point.scene.engine)
    enough: Callable[[Path], bool] = lambda _: False  # noqa: E731 - the other branch is an object
    if interval is not None:
        enough = UntilNarrow(made, interval, point.replicates)
    return pack_replicates(made, point.most_replicates, folder, code, report, say, enough)


def _summary(table: pd.DataFrame, point: Point) -> dict[str, Any]:
    """Averages and what was packed, as plain values."""
    row = summarise(table).iloc[0].drop(["point", "study", "csd"]).to_dict()
    plain = {name: value.item() if hasattr(value, "item") else value for name, value in row.items()}
    for name, value in plain.items():
        if isinstance(value, float) and not math.isfinite(value):
            plain[name] = None
    bed = {
        "particles": point.scene.particles,
        "bed_depth_factor": point.scene.bed_depth_factor,
        "seed": point.scene.seed,
    }
    return {**plain, **bed, "density_kg_m3": point.scene.density, "time_step_us": point.scene.time_step / MICROSECOND}


def _check_folder(folder: Path) -> None:
    """Refuse a folder with other files: packings replace those of the same name, and tidy up around them."""
    if not folder.exists():
        return
    foreign = sorted(path.name for path in folder.iterdir() if not _OWN.fullmatch(path.name))
    if foreign:
        allowed = f"must be new, empty, or a folder of packings; it holds {foreign[0]}"
        raise ConfigError([Problem(str(ORIGIN), "output", str(folder), allowed)])


def _check_packings(folder: Path, key: str) -> None:
    """Refuse a folder whose packings follow from anything else than ``key``; damaged ones are made again anyway."""
    for path in sorted(folder.glob("r*.json")):
        try:
            same = read_sealed(path).get("key") == key
        except (PackingRejected, OSError):
            continue
        if not same:
            whose = f"holds {path.stem} of other options or of another version"
            allowed = f"{whose}: choose another folder, or replace its packings"
            raise ConfigError([Problem(str(ORIGIN), "output", str(folder), allowed)])
