"""Read and check configuration files; every problem is reported at once, with file, key, value and allowed values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filtercake.crystals.crystallizer import Kinetics, SteadyState, crystal_size_distribution, steady_state
from filtercake.crystals.csd import CrystalSizeDistribution, read_csd, truncate
from filtercake.crystals.size_laws import made
from filtercake.errors import ConfigError, CrystallizerError, CsdError, Problem, did_you_mean, shown
from filtercake.filtration.resistance import RESISTANCE_LAWS, law_of
from filtercake.packing.cloud import bed_for, cell_for
from filtercake.packing.engines import kind_of
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.scene import FILTRATION_PROTOCOL, Scene
from filtercake.study import limits
from filtercake.study.config.crystals import Crystallizer, Csd
from filtercake.study.config.packing import AUTO, Packing
from filtercake.study.config.study import MOST_DISTRIBUTIONS, Study, Workflow
from filtercake.study.config.sweep import OF_FILTRATION, SWEPT
from filtercake.study.config.values import MOST_PARTICLES, MOST_POINTS, NAME
from filtercake.study.parsing import parse
from filtercake.study.products import resolve, slurry_problems
from filtercake.study.scenes import scene_of
from filtercake.units import MICROMETRE, MINUTE
from filtercake.user_files import is_file, read_yaml

OWN_NAMES = ("benchmark", "benchmark_quick", "benchmark_redrawn", "benchmarks", "logs", "pages")
"""Folders of the results that are the workflow's own: no study can have such a name."""

OWN_PREFIXES = ("agreement_", "calibration_")
"""First parts of the names of studies that the workflow makes itself."""

_OWN = ", ".join([*OWN_NAMES, *(f"{prefix}..." for prefix in OWN_PREFIXES), "a file of config/benchmarks"])

NAMED_KEYS = ("studies", "calibrations", "results")
"""Keys of the workflow's configuration that hold names."""


@dataclass(frozen=True)
class LoadedCsd:
    """A distribution of a study, whole and as it is packed.

    Attributes
    ----------
    full, truncated : CrystalSizeDistribution
        The whole distribution and the one that is packed.
    label : str
        Name in figures.
    file : Path or None
        The user's CSV it was read from.
    crystallizer : SteadyState or None
        The crystallizer that makes it.
    """

    full: CrystalSizeDistribution
    truncated: CrystalSizeDistribution
    label: str
    file: Path | None
    crystallizer: SteadyState | None = None


@dataclass(frozen=True)
class LoadedStudy:
    """A study whose every value has been checked.

    Attributes
    ----------
    name : str
        The study file's stem.
    path : Path
        The study file.
    model : Study
        Its contents.
    csds : dict of str to LoadedCsd
        Its distributions.
    warnings : tuple of str
        Doubts about allowed values.
    """

    name: str
    path: Path
    model: Study
    csds: dict[str, LoadedCsd]
    warnings: tuple[str, ...]


def load_workflow(values: Any, file: str) -> Workflow:
    """Check the workflow's own configuration (already parsed).

    Raises
    ------
    ConfigError
        With every problem.
    """
    for key in ("studies", "calibrations") if isinstance(values, dict) else ():
        if isinstance(values.get(key), str):  # --config studies=a,b
            values = {**values, key: [name.strip() for name in values[key].split(",") if name.strip()]}
    return parse(Workflow, values, file)


def with_names_as_written(config: Mapping[str, Any], files: Iterable[Path], arguments: Iterable[str]) -> dict[str, Any]:
    """Give back the names that Snakemake has read as numbers: 007 as 7, 2024_05 as 202405, 1e5, nan.

    Parameters
    ----------
    config : mapping
        Snakemake's configuration.
    files : iterable of Path
        The files it is from; later ones win.
    arguments : iterable of str
        ``key=value``, as ``--config`` has them.

    Raises
    ------
    ConfigError
        If a file is not YAML.
    """
    found = dict(config)
    for file in files:
        given = read_yaml(file)
        for key in NAMED_KEYS if isinstance(given, dict) else ():
            if key in given and given[key] == found.get(key):
                found[key] = given[key]
    for argument in arguments:
        key, _, text = argument.partition("=")
        if key in NAMED_KEYS and isinstance(found.get(key), int | float):
            found[key] = text
    return found


def find_studies(workflow: Workflow, folder: Path, file: str) -> list[Path]:
    """Paths of the studies asked for; names are looked up in ``folder``.

    Raises
    ------
    ConfigError
        If a study does not exist, two have the same name, or one has a name of the workflow's own.
    """
    paths: list[Path] = []
    problems: list[Problem] = []
    known = sorted(path.stem for path in folder.glob("*.yaml"))
    for index, study in enumerate(workflow.studies):
        path = Path(study) if study.endswith((".yaml", ".yml")) else folder / f"{study}.yaml"
        key = f"studies[{index}]"
        if not NAME.match(path.stem):
            problems.append(Problem(file, key, repr(study), "a study's file name must be letters, digits, - and _"))
        elif not is_file(path):
            allowed = f"no such study; allowed: {', '.join(known)}, or the path of a study file"
            problems.append(Problem(file, key, repr(study), allowed + did_you_mean(study, known)))
        elif path.stem in [other.stem for other in paths]:
            problems.append(Problem(file, key, repr(study), "two studies of the same name; rename one file"))
        elif _is_own(path, folder.parent / "benchmarks"):
            problems.append(Problem(file, key, repr(study), f"the workflow's own name ({_OWN}); rename the file"))
        paths.append(path)
    if problems:
        raise ConfigError(problems)
    return paths


def _is_own(path: Path, benchmarks: Path) -> bool:
    """Whether a study's results would lie among those of the workflow's own; a benchmark itself may be asked for."""
    twin = benchmarks / f"{path.stem}.yaml"
    if twin.is_file():
        return not twin.samefile(path)
    return path.stem in OWN_NAMES or path.stem.startswith(OWN_PREFIXES)


def load_study(path: Path) -> LoadedStudy:
    """Read and check a study.

    Raises
    ------
    ConfigError
        With every problem found in the file and the files it names.
    """
    return check_study(read_yaml(path), path)


def check_study(values: Any, path: Path, *, packed: bool = True) -> LoadedStudy:
    """Check a study's values, however they were given; the path is for messages and for the files they name.

    Without ``packed``, no bed need be large enough for its distribution: it is only looked at.

    Raises
    ------
    ConfigError
        With every problem found in the values and the files they name.
    """
    model = parse(Study, values, str(path))
    model, kinetics, remarks = resolve(model, path)
    problems = list(_size_problems(model, str(path)))
    if problems:  # nothing that is too large is looked into
        raise ConfigError(problems)
    problems = [*_reference_problems(model, str(path)), *slurry_problems(model, str(path))]
    problems += _law_problems(model, str(path))
    problems += _engine_problems(model, str(path))
    of_protocols = dict.fromkeys(_protocol_problems(model, str(path)))
    problems += of_protocols
    if of_protocols:  # a scene needs a pressure
        raise ConfigError(problems)
    csds: dict[str, LoadedCsd] = {}
    for name, csd in model.csds.items():
        try:
            csds[name] = _load_csd(name, csd, path.parent, model.crystallizer, kinetics)
        except (CsdError, CrystallizerError) as error:
            problems.append(Problem(str(path), *_source_of(name, csd), str(error)))
    problems += _unit_problems(model, csds, str(path))
    problems += _findings(model, csds, str(path), limits.refusals)
    problems += _bed_problems(model, csds, str(path))
    if packed and not problems:
        problems += _findings(model, csds, str(path), limits.small_beds)
    if problems:
        raise ConfigError(problems)
    doubts = [*_findings(model, csds, str(path), limits.doubts)]
    doubts += _findings(model, csds, str(path), limits.merged_classes) if packed else []
    return LoadedStudy(path.stem, path, model, csds, (*remarks, *map(str, doubts)))


def load_studies(paths: Iterable[Path]) -> list[LoadedStudy]:
    """Load several studies and report the problems of all of them together.

    Raises
    ------
    ConfigError
        With every problem of every study.
    """
    studies: list[LoadedStudy] = []
    problems: list[Problem] = []
    for path in paths:
        try:
            studies.append(load_study(path))
        except ConfigError as error:
            problems += error.problems
    if problems:
        raise ConfigError(problems)
    return studies


def _source_of(name: str, csd: Csd) -> tuple[str, str]:
    """Key and value that a distribution comes from."""
    if csd.file:
        return f"csds.{name}.file", repr(csd.file)
    if csd.residence_time_min is not None:
        return f"csds.{name}.residence_time_min", f"{csd.residence_time_min:g}"
    law = csd.lognormal or csd.rosin_rammler
    if law is not None:
        key = "lognormal" if csd.lognormal else "rosin_rammler"
        return f"csds.{name}.{key}", ", ".join(f"{part} {value:g}" for part, value in law.model_dump().items())
    return f"csds.{name}.mixture", f"{len(csd.mixture or [])} classes"


def _load_csd(
    name: str, csd: Csd, folder: Path, crystallizer: Crystallizer | None, kinetics: Kinetics | None
) -> LoadedCsd:
    file = (folder / csd.file) if csd.file else None
    state: SteadyState | None = None
    if file is not None:
        full = read_csd(file)
    elif csd.residence_time_min is not None and crystallizer is not None and kinetics is not None:
        state = steady_state(kinetics, csd.residence_time_min * MINUTE, crystallizer.slurry_concentration_kg_m3)
        full = crystal_size_distribution(state.size_scale, crystallizer.bin_width_um * MICROMETRE)
    else:
        full = made(csd.recipe)
    truncated = truncate(full, **csd.truncation).csd
    return LoadedCsd(full, truncated, csd.label or name, file, state)


def _size_problems(model: Study, file: str) -> Iterable[Problem]:
    """Studies with more points or distributions than can be handled."""
    points = sum(
        len(sweep.csd or [])
        * len(sweep.protocol or [0])
        * len(sweep.engine or [0])
        * math.prod(len(getattr(sweep, name) or [0]) for name in SWEPT)
        for sweep in model.sweeps
    )
    if points > MOST_POINTS:
        yield Problem(file, "sweeps", f"{points} points", f"must be at most {MOST_POINTS} points; make several studies")
    if len(model.csds) > MOST_DISTRIBUTIONS:
        allowed = f"must be at most {MOST_DISTRIBUTIONS}, the crystallizer's products among them; make several studies"
        yield Problem(file, "csds", f"{len(model.csds)} distributions", allowed)


def _bed_problems(model: Study, csds: dict[str, LoadedCsd], file: str) -> Iterable[Problem]:
    """Swept distributions so broad that a deep enough bed holds too many spheres."""
    if model.packing.particles is not None:
        return
    for name in dict.fromkeys(name for sweep in model.sweeps for name in sweep.csd or [] if name in csds):
        truncated = csds[name].truncated
        needed = max(
            cell_for(truncated)
            if protocol == FILTRATION_PROTOCOL
            else bed_for(truncated, model.packing.initial_void_fraction).particles
            for protocol in model.protocols
        )
        if needed > MOST_PARTICLES:
            allowed = (
                f"needs {needed:.3g} spheres for a bed deep or a cell wide enough; at most {MOST_PARTICLES} are "
                "possible: leave small crystals out of the packing (truncate_below_um), or give packing.particles"
            )
            yield Problem(file, *_source_of(name, model.csds[name]), allowed)


def _law_problems(model: Study, file: str) -> Iterable[Problem]:
    """Laws that need a Kozeny constant, where nothing says that it is solved on the study's packings."""
    if law_of(model.resistance_law).needs_kozeny_constant and model.permeability is None:
        usable = [law.name for law in RESISTANCE_LAWS.values() if not law.needs_kozeny_constant]
        allowed = (
            f"needs the flow solved in the packings: use {' or '.join(usable)}, or give a study the section "
            "permeability (permeability: {packings: 2})"
        )
        yield Problem(file, "resistance_law", repr(model.resistance_law), allowed)


def _engine_problems(model: Study, file: str) -> Iterable[Problem]:
    """Engines of blocks that these do not suit."""
    for index, sweep in enumerate(model.sweeps):
        pressed = FILTRATION_PROTOCOL in (sweep.protocol or [model.packing.protocol])
        for place, name in enumerate(sweep.engine or []):
            key = f"sweeps[{index}].engine[{place}]"
            if pressed and name not in (AUTO, Embedded.name):
                allowed = "cakes are pressed by the embedded engine; give beds (protocol: gravity) a block of their own"
                yield Problem(file, key, repr(name), allowed)
            if kind_of(name).own_spheres and model.packing.bed_depth_factor not in (None, 1.0):
                yield Problem(file, key, repr(name), "it has the paper's own box: packing.bed_depth_factor must be 1")


def _protocol_problems(model: Study, file: str) -> Iterable[Problem]:
    """Keys that a study's protocols do not know, or need."""
    pressed, pressure = FILTRATION_PROTOCOL in model.protocols, model.base("pressure_kPa")
    keys = [
        (f"sweeps[{i}].", sweep, sweep.protocol or [model.packing.protocol]) for i, sweep in enumerate(model.sweeps)
    ]
    of_none = f"needs protocol: {FILTRATION_PROTOCOL}, in packing or in this block"
    for where, sweep, protocols in keys:
        for name in OF_FILTRATION:
            if getattr(sweep, name) is not None and FILTRATION_PROTOCOL not in protocols:
                yield Problem(file, where + name, shown(getattr(sweep, name)), of_none)
        sticks = model.material.adhesion_mJ_m2 is not None or sweep.adhesion_mJ_m2 is not None
        if sweep.cohesion_kJ_m3 is not None and sticks and protocols == [FILTRATION_PROTOCOL]:
            allowed = "does nothing where adhesion_mJ_m2 is given; use one of them"
            yield Problem(file, f"{where}cohesion_kJ_m3", shown(sweep.cohesion_kJ_m3), allowed)
        if FILTRATION_PROTOCOL in protocols and pressure is None and sweep.pressure_kPa is None:
            allowed = f"must be given with protocol: {FILTRATION_PROTOCOL} (or a filter with its pressure_drop_kPa)"
            yield Problem(file, "packing.pressure_kPa", "(missing)", allowed)
    if pressed:
        if model.packing.engine not in (AUTO, Embedded.name):
            allowed = (
                f"cakes are pressed by the embedded engine: use {AUTO!r} or {Embedded.name!r}, or protocol: gravity"
            )
            yield Problem(file, "packing.engine", repr(model.packing.engine), allowed)
        return
    for key, value in (
        ("material.adhesion_mJ_m2", model.material.adhesion_mJ_m2),
        ("packing.pressure_kPa", model.packing.pressure_kPa),
    ):
        if value is not None:
            yield Problem(file, key, f"{value:g}", of_none)


def _reference_problems(model: Study, file: str) -> Iterable[Problem]:
    """Names of distributions that the study does not define."""
    known = list(model.csds)
    named = [(f"sweeps[{i}].csd[{j}]", name) for i, s in enumerate(model.sweeps) for j, name in enumerate(s.csd or [])]
    named += [(f"published[{i}].csd", entry.csd) for i, entry in enumerate(model.published)]
    for key, name in named:
        if name not in model.csds:
            allowed = f"not in csds; allowed: {', '.join(known)}{did_you_mean(name, known)}"
            yield Problem(file, key, repr(name), allowed)


def _scenes(model: Study, csds: dict[str, LoadedCsd]) -> Iterable[tuple[str, dict[str, _Place], Scene]]:
    """Every scene of a study: its distribution, and the keys and values that a finding of the fence may be about."""
    for index, sweep in enumerate(model.sweeps):
        axes = [_values(model, index, name) for name in SWEPT]
        known = [name for name in sweep.csd or [] if name in csds]
        protocols = sweep.protocol or [model.packing.protocol]
        kinds = itertools.product(known, protocols, sweep.engine or [model.packing.engine])
        for (name, protocol, engine), places in itertools.product(kinds, itertools.product(*axes)):
            where = dict(zip(SWEPT, places, strict=True))
            swept = {axis: value for axis, (_, value) in where.items()}
            scene = scene_of(model, csds[name].truncated, swept, protocol, engine)
            keys = {
                "cohesion": where["cohesion_kJ_m3"],
                "adhesion": where["adhesion_mJ_m2"],
                "pressure": where["pressure_kPa"],
                "time_step": _time_step_key(model.packing, scene.rayleigh_fraction),
                "restitution": where["restitution"],
                "density": ("material.density_kg_m3", model.material.density),
                "particles": ("packing.particles", float(scene.particles)),
            }
            yield name, keys, scene


def _time_step_key(packing: Packing, fraction: float) -> tuple[str, float]:
    if packing.time_step_us is not None:
        return "packing.time_step_us", packing.time_step_us
    return "packing.time_step_rayleigh", fraction


_Place = tuple[str, float | None]
"""A key and its value."""


def _values(model: Study, index: int, name: str) -> list[_Place]:
    """Values of one property that a sweep visits, each with its key."""
    given = getattr(model.sweeps[index], name)
    if given is None:
        key = f"material.{name}"
        if name == "pressure_kPa":
            key = "filter.pressure_drop_kPa" if model.packing.pressure_kPa is None else "packing.pressure_kPa"
        return [(key, model.base(name))]
    return [(f"sweeps[{index}].{name}[{j}]", value) for j, value in enumerate(given)]


def _unit_problems(model: Study, csds: dict[str, LoadedCsd], file: str) -> Iterable[Problem]:
    """Densities and sizes that must be in another unit, one problem per key."""
    found: dict[str, Problem] = {}
    for name, csd in () if model.material.trust_units else csds.items():
        for finding in limits.unit_problems(csd.full, model.material.density):
            key, value = ("material.density_kg_m3", f"{model.material.density:g}")
            if finding.key == "sizes":
                key, value = _source_of(name, model.csds[name])
            text = f"{finding.text}; if the unit is right, set material.trust_units: true"
            found.setdefault(key, Problem(file, key, value, text))
    return found.values()


def _findings(
    model: Study, csds: dict[str, LoadedCsd], file: str, check: Callable[[Scene], Iterable[limits.Finding]]
) -> list[Problem]:
    """List what a check of the fence finds about all scenes, one problem per key."""
    found: dict[str, Problem] = {}
    for name, keys, scene in _scenes(model, csds):
        for finding in check(scene):
            key, value = keys[finding.key]
            text = finding.text
            if finding.key == "particles":  # too few of them for this distribution
                text = "{1} ({0[0]} = {0[1]})".format(_source_of(name, model.csds[name]), text)
            found.setdefault(key, Problem(file, key, f"{value:g}", text))
    return list(found.values())
