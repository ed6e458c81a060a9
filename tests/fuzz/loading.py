"""What a run does with a user's files before its first job, on a copy of the project's configuration."""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import math
import os
import random
import re
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import mutation

from filtercake.calibration.config import LoadedCalibration, candidates, load_calibrations, settings_of
from filtercake.calibration.measurements import compressibility_table, fits_table
from filtercake.cli import commands as cli
from filtercake.crystals.csd import to_table
from filtercake.design.loading import load_designs
from filtercake.errors import FiltercakeError, PackingRejected
from filtercake.study.loading import LoadedStudy, find_studies, load_studies, load_workflow
from filtercake.study.points import Point, expand
from filtercake.user_files import read_yaml

PROJECT = Path(__file__).resolve().parents[2]
CONFIG, STUDIES, CALIBRATIONS = "config/config.yaml", Path("config/studies"), Path("config/calibrations")
OWN_KINETICS = """\
crystallizer: {kinetics: mine, kinetics_file: kinetics.yaml, slurry_concentration_kg_m3: 200}
filter: {pressure_drop_kPa: 53, submerged_fraction: 0.3, rotation_rate_rpm: 0.2, medium_resistance_1_m: 5.0e+9}
material: {}
sweeps: [{residence_time_min: [15, 30], cohesion_kJ_m3: [0, 50]}]
"""
KINETICS = """\
mine: {nucleation_coefficient: 9.0e+16, units: "B0 #/(L s), MT g/L, G m/s", slurry_concentration_exponent: 1,
  growth_rate_exponent: 2, shape_factor: 1, density_kg_m3: 2450, residence_time_range_min: [15, 60], source: made up}
"""
TRICKS = ("config", "config/test", "config/studies", "config/test/calibration", "config/measurements")


@dataclass(frozen=True)
class Kind:
    """A kind of file: which of the copy it is, valid contents, how to spoil it, and how a run reads it."""

    file: str
    bases: tuple[str, ...]
    spoil: Callable[[bytes, random.Random], bytes]
    load: Callable[[], None]


def make_scratch(folder: Path) -> None:
    """Copy the configuration, and put a pipe, a loop of links, a device and a huge file beside every file."""
    shutil.copytree(PROJECT / "config", folder / "config")
    (folder / STUDIES / "own_kinetics.yaml").write_text(OWN_KINETICS)
    (folder / STUDIES / "kinetics.yaml").write_text(KINETICS)
    for name in TRICKS:
        where = folder / name
        os.mkfifo(where / "fifo")
        os.mkfifo(where / "fifo.yaml")
        (where / "loop.yaml").symlink_to("loop.yaml")
        (where / "zero.csv").symlink_to("/dev/zero")
        (where / "folder").mkdir()
        with (where / "huge.csv").open("wb") as stream:
            stream.truncate(10**12)


def load_run(**values: Any) -> None:
    """Do what workflow/rules/common.smk does, and check what comes out."""
    settings = load_workflow(values, CONFIG)
    studies = load_studies(find_studies(settings, STUDIES, CONFIG))
    calibrations = load_calibrations(settings.calibrations, CALIBRATIONS, STUDIES, CONFIG)
    designs = load_designs(studies)
    for study in studies:
        _check_study(study, expand(study, _engine))
    for design in designs.values():
        json.dumps(design.params(_engine), allow_nan=False)
    for calibration in calibrations:
        _check_calibration(calibration)


def load_config() -> None:
    """Read config.yaml as the workflow does."""
    values = read_yaml(Path(CONFIG))
    load_workflow(values, CONFIG)
    load_run(**{str(key): value for key, value in values.items()})


def _engine(*_: Any) -> str:
    return "embedded"


def _check_study(study: LoadedStudy, points: Iterable[Point]) -> None:
    """Make sure that what is loaded can be computed with, and named in the file system."""
    json.dumps(study.model.model_dump(mode="json"), allow_nan=False)
    for name, csd in study.csds.items():
        _require(re.fullmatch(r"[A-Za-z0-9_-]{1,64}", name), f"name {name!r}")
        _require(all(map(math.isfinite, (csd.full.sum_x_over_d2, csd.truncated.mean_particle_volume))), "sums")
        to_table(csd.full, csd.truncated)
    for point in points:
        _require(re.fullmatch(r"[A-Za-z0-9_.-]{1,200}", point.name) and point.name.strip("."), f"name {point.name!r}")
        json.dumps(point.as_dict(), allow_nan=False)
        _require(0.0 < point.scene.time_step < math.inf and point.scene.particles <= 2_000_000, "scene")


def _check_calibration(calibration: LoadedCalibration) -> None:
    _check_study(calibration.study, (item.point for item in candidates(calibration, _engine)))
    json.dumps(settings_of(calibration).as_dict(), allow_nan=False)
    json.dumps([vars(item) for item in calibration.observations], allow_nan=False)
    fits_table(calibration.measurements)
    compressibility_table(calibration.measurements)


def _require(holds: object, what: str) -> None:
    if not holds:
        raise AssertionError(f"loaded, but its {what} cannot be used")


TINY, TINY_CALIBRATION = "config/test/tiny.yaml", "config/test/calibration/tiny.yaml"


def _calibration() -> None:
    load_run(studies=[TINY], calibrations=[TINY_CALIBRATION])


KINDS = {
    "config.yaml": Kind(CONFIG, (CONFIG,), mutation.spoil_yaml, load_config),
    "study": Kind(
        TINY,
        (TINY, TINY, "config/studies/pmma.yaml", "config/studies/alum.yaml", "config/template.yaml"),
        mutation.spoil_yaml,
        lambda: load_run(studies=[TINY]),
    ),
    "kinetics": Kind(
        "config/studies/kinetics.yaml",
        ("config/studies/kinetics.yaml",),
        mutation.spoil_yaml,
        lambda: load_run(studies=["own_kinetics"]),
    ),
    "calibration": Kind(TINY_CALIBRATION, (TINY_CALIBRATION,), mutation.spoil_yaml, _calibration),
    "measurements": Kind(
        "config/test/calibration/tiny_measurements.yaml",
        ("config/test/calibration/tiny_measurements.yaml",),
        mutation.spoil_yaml,
        _calibration,
    ),
    "measurement CSV": Kind(
        "config/test/calibration/tiny_test.csv",
        ("config/test/calibration/tiny_test.csv", "config/measurements/synthetic_50kPa_a.csv"),
        mutation.spoil_table,
        _calibration,
    ),
    "CSD CSV": Kind(
        "config/test/tiny.csv",
        ("config/test/tiny.csv", "config/csd/example.csv"),
        mutation.spoil_table,
        lambda: load_run(studies=[TINY]),
    ),
}

COMMANDS = (
    "csd --mixture 20:0.5,50:0.5 --output out/x.csv",
    "csd config/test/tiny.csv --truncate-below-volume-fraction 0.01 --json",
    "csd --kinetics ammonium_alum --residence-time-min 15 --slurry-concentration-kg-m3 200 --bin-width-um 5",
    "csd --kinetics mine --kinetics-file config/studies/kinetics.yaml --residence-time-min 15 "
    "--slurry-concentration-kg-m3 9",
    "pack --mixture 20:0.5,50:0.5 --density-kg-m3 1180 --porosity-ci95-target 0.003 --particles 50 --output out/beds",
    "pack config/test/tiny.csv --density-kg-m3 1180 --youngs-modulus-MPa 5 --seed 3 --time-step-us 0.1 --output out/p",
    "predict --mixture 20:0.5,50:0.5 --density-kg-m3 1180 --friction 0.1 --adhesion-mJ-m2 10 --pressure-kPa 50 --json",
    "resistance --porosity 0.36 --density-kg-m3 1180 --mixture 20:0.5,50:0.5 --sphericity 0.9 --json",
    "filter-area --resistance-m-kg 1e8 --slurry-flow-m3-h 20 --slurry-concentration-kg-m3 200 --pressure-drop-kPa 53.3 "
    "--submerged-fraction 0.3 --rotation-rate-rpm 0.2 --medium-resistance-1-m 5e9 --porosity 0.3 --density-kg-m3 2450",
    "filter-batch --resistance-m-kg 1e10 --porosity 0.4 --density-kg-m3 1500 --slurry-flow-m3-h 1 --wash-ratio 2 "
    "--slurry-concentration-kg-m3 100 --pressure-drop-kPa 200 --medium-resistance-1-m 1e10 --turnaround-time-min 20",
    "deliquor --resistance-m-kg 1e9 --porosity 0.4 --density-kg-m3 1300 --sauter-mean-um 50 --cake-height-mm 20 "
    "--pressure-drop-kPa 50 --moisture 0.15",
    "crystallizer --kinetics ammonium_alum --residence-time-min 15 --slurry-concentration-kg-m3 200 --fines-ratio 5 "
    "--fines-size-um 50 --output out/product.csv",
    "cost --equipment drum_filter --filter-area-m2 3.44 --cost-index 800",
    "porosity config/test/tiny.npz --profile",
    "export pmma pmma_50_50 --results out --output out/export",
    "rerun out/nothing",
)


def spoil_command(chance: random.Random) -> list[str]:
    """Draw a command line with one to three changes."""
    words = chance.choice(COMMANDS).split()
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        at = chance.randrange(1, len(words)) if len(words) > 1 else 0
        kind = chance.choice(("value", "value", "value", "delete", "twice", "swap", "insert", "join"))
        drawn = mutation.scalar(chance)
        text = drawn.text if isinstance(drawn, mutation.Raw) else str(drawn)
        text = text.replace("\0", "")  # no process can be given one
        if kind == "value":
            words[at] = text
        elif kind == "delete":
            del words[at]
        elif kind == "twice":
            words[at:at] = words[at : at + 2]
        elif kind == "swap":
            other = chance.randrange(len(words))
            words[at], words[other] = words[other], words[at]
        elif kind == "insert":
            words.insert(at, text)
        elif kind == "join":
            words[at] = words[at] + chance.choice((":", ",", "=", ".", "-")) + text
        if not words:
            break
    return words


class Refused(FiltercakeError):  # noqa: N818
    """The command line said no, in words."""


def run_command(words: list[str]) -> None:
    """Run a command in this process; nothing is packed."""
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace", write_through=True) for _ in range(2))
    rejected = PackingRejected(["nothing is packed here"])
    with (
        mock.patch.object(importlib.import_module("filtercake.api.packings"), "pack_replicates", side_effect=rejected),
        mock.patch.object(importlib.import_module("filtercake.api.exports"), "pack", side_effect=rejected),
        mock.patch.dict(os.environ, {cli.TRACEBACK_VARIABLE: "1"}),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        status = cli.main(words)
    said = err.buffer.getvalue().decode()
    if status:
        lines = [line for line in said.splitlines() if not line.startswith("warning:")]
        if len(lines) != 1 or not lines[0].startswith("filtercake: "):
            raise AssertionError(f"status {status}, and not one line: {said[:300]!r}")
        raise Refused(lines[0])
