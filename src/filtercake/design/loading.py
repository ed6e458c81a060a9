"""A study's section ``design``, checked against the rest of the study before any job starts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from filtercake.crystals.crystallizer import Kinetics
from filtercake.design.confirm import BATCHES
from filtercake.design.costs import Correlation, load_correlations
from filtercake.design.emulator_file import shipped
from filtercake.errors import ConfigError, Problem, did_you_mean
from filtercake.filtration.resistance import RESISTANCE_LAWS, law_of
from filtercake.packing.scene import FILTRATION_PROTOCOL
from filtercake.study.config.design import DRUM, LEAF, PLATE_AND_FRAME, Costs, Design
from filtercake.study.config.study import Study
from filtercake.study.config.sweep import SWEPT, Sweep
from filtercake.study.loading import LoadedStudy, check_study
from filtercake.study.points import ChooseEngine, Point, expand
from filtercake.study.products import SETTLED_SOLIDS, product_name, resolve
from filtercake.study.scenes import scene_of
from filtercake.user_files import read_yaml

EQUIPMENT: Final = {DRUM: "drum_filter", LEAF: "leaf_filter", PLATE_AND_FRAME: "plate_and_frame_filter"}
"""What the cost correlations call each filter type."""
BESIDE: Final = ("published", "cross_check", "permeability")
"""Sections of a study that its design has no use for."""
DIGITS: Final = 3
"""Significant digits of the residence times between the ends of the range."""

TIMES = "design.variables.residence_time_min"


@dataclass(frozen=True)
class Ask:
    """A set of packings that may be made: its point, and which level and set it is."""

    point: Point
    level: int
    batch: int


@dataclass(frozen=True)
class LoadedDesign:
    """A design whose every value has been checked.

    Attributes
    ----------
    study : LoadedStudy
        The study, with the residence times that may be packed as its points.
    model : Design
        Contents of the section.
    kinetics : Kinetics
        The crystallizer's.
    correlations : dict of str to Correlation
        Cost correlations that it needs, by name.
    levels : tuple of float
        Residence times that may be packed, min.
    warnings : tuple of str
        Doubts about allowed values, besides those about the study.
    """

    study: LoadedStudy
    model: Design
    kinetics: Kinetics
    correlations: dict[str, Correlation]
    levels: tuple[float, ...]
    warnings: tuple[str, ...]

    @property
    def products(self) -> list[str]:
        """Names of the distributions that may be packed."""
        return [product_name(time) for time in self.levels]

    def params(self, choose_engine: ChooseEngine) -> dict[str, Any]:
        """Return plain values that :meth:`filtercake.design.task.Task.from_params` takes, fit for a rule's params."""
        asks = self.asks(choose_engine)
        kinetics = dict(vars(self.kinetics))
        if kinetics["residence_time_range"] is not None:
            kinetics["residence_time_range"] = list(kinetics["residence_time_range"])
        return {
            "study": self.study.model.model_dump(mode="json"),
            "kinetics": kinetics,
            "correlations": {name: item.model_dump(mode="json") for name, item in self.correlations.items()},
            "levels": list(self.levels),
            "asks": [{"point": ask.point.as_dict(), "level": ask.level, "batch": ask.batch} for ask in asks],
        }

    def asks(self, choose_engine: ChooseEngine) -> list[Ask]:
        """List every set of packings that may come to be needed; a further one of a level has another base seed."""
        found = []
        for batch in range(BATCHES):
            packing = self.study.model.packing
            packing = packing.model_copy(update={"seed": packing.seed + batch})
            model = self.study.model.model_copy(update={"packing": packing, "sweeps": self._sweeps()})
            points = expand(replace(self.study, model=model), choose_engine)
            at = {float(point.residence_time_min or 0.0): point for point in points}
            found += [Ask(at[time], level, batch) for level, time in enumerate(self.levels)]
        return found

    def _sweeps(self) -> list[Sweep]:
        """One block: pressed packings serve every pressure drop."""
        return [sweep.model_copy(update={"pressure_kPa": None}) for sweep in self.study.model.sweeps]


def load_designs(studies: Iterable[LoadedStudy]) -> dict[str, LoadedDesign]:
    """Check the designs of those studies that have one, by the study's name.

    Raises
    ------
    ConfigError
        With every problem of every design.
    """
    designs: dict[str, LoadedDesign] = {}
    problems: list[Problem] = []
    for study in studies:
        if study.model.design is not None:
            try:
                designs[study.name] = load_design(study)
            except ConfigError as error:
                problems += error.problems
    if problems:
        raise ConfigError(problems)
    return designs


def load_design(study: LoadedStudy) -> LoadedDesign:
    """Check a study's design.

    Raises
    ------
    ConfigError
        With every problem.
    """
    design, file = study.model.design, str(study.path)
    if design is None:
        raise ConfigError([Problem(file, "design", "(missing)", "must be given for a design")])
    problems = [*_problems(study.model, design, file)]
    if problems:
        raise ConfigError(problems)
    levels = levels_of(design)
    derived = _with_levels(study, design, levels)
    _, kinetics, _ = resolve(derived.model, study.path)
    if kinetics is None:
        raise ConfigError([Problem(file, "crystallizer", "(missing)", "must be given for a design")])
    problems = [*_kinetic_problems(design, kinetics, derived.model, file), *_estimate_problems(derived, design)]
    correlations, more = _correlations(design, study.path)
    if problems or more:
        raise ConfigError([*problems, *more])
    return LoadedDesign(
        study=replace(derived, name=study.name),
        model=design,
        kinetics=kinetics,
        correlations=correlations,
        levels=levels,
        warnings=tuple(text for text in derived.warnings if text not in study.warnings),
    )


def levels_of(design: Design) -> tuple[float, ...]:
    """Residence times that may be packed, min: evenly by ratio, the ends as they are given."""
    low, high = design.variables.residence_time_min
    inner = [float(f"{value:.{DIGITS}g}") for value in np.geomspace(low, high, design.levels)[1:-1]]
    return tuple(sorted({low, high, *(value for value in inner if low < value < high)}))


def pressures_of(design: Design, study: Study) -> list[float]:
    """Lowest and highest pressure drop, kPa, or the one that there is."""
    if design.variables.pressure_drop_kPa is not None:
        return list(design.variables.pressure_drop_kPa)
    pressed = study.packing.protocol == FILTRATION_PROTOCOL
    own = study.base("pressure_kPa") if pressed else None
    if own is None and study.filter is not None:
        own = study.filter.pressure_drop_kPa
    return [float(own or math.nan)]


def _problems(study: Study, design: Design, file: str) -> Iterator[Problem]:
    """Find what can be told from the study's file alone."""
    for name in ("crystallizer", "filter"):
        if getattr(study, name) is None:
            yield Problem(file, name, "(missing)", "must be given for a design")
    if law_of(study.resistance_law).needs_kozeny_constant:
        usable = " or ".join(law.name for law in RESISTANCE_LAWS.values() if not law.needs_kozeny_constant)
        yield Problem(file, "resistance_law", repr(study.resistance_law), f"no design solves the flow: use {usable}")
    if design.packings < study.packing.replicates:
        allowed = f"must be at least packing.replicates, {study.packing.replicates}"
        yield Problem(file, "design.packings", str(design.packings), allowed)
    share = (design.variables.submerged_fraction or [0.0 if study.filter is None else study.filter.submerged_fraction])[
        -1
    ]
    if design.deliquoring_share is not None and share + design.deliquoring_share >= 1.0:
        allowed = f"must leave room beside the {share:g} of the drum that is immersed"
        yield Problem(file, "design.deliquoring_share", f"{design.deliquoring_share:g}", allowed)


def _with_levels(study: LoadedStudy, design: Design, levels: Sequence[float]) -> LoadedStudy:
    """Check the study once more, with the residence times that may be packed instead of its sweeps."""
    block: dict[str, Any] = {"residence_time_min": list(levels)}
    if study.model.packing.protocol == FILTRATION_PROTOCOL:
        block["pressure_kPa"] = pressures_of(design, study.model)
    values = {name: value for name, value in read_yaml(study.path).items() if name not in BESIDE}
    try:
        return check_study({**values, "sweeps": [block]}, study.path)
    except ConfigError as error:
        raise ConfigError([_own(problem) for problem in error.problems]) from None


def _own(problem: Problem) -> Problem:
    """Name the key that a problem of the levels comes from."""
    for key, own in (("sweeps[0].residence_time_min", TIMES), ("sweeps[0].", "design.variables.")):
        if problem.key.startswith(key):
            return replace(problem, key=own if own == TIMES else own + "pressure_drop_kPa")
    return problem


def _kinetic_problems(design: Design, kinetics: Kinetics, study: Study, file: str) -> Iterator[Problem]:
    """Slurries that make other crystals, or are none."""
    slurry, key = design.variables.slurry_concentration_kg_m3, "design.variables.slurry_concentration_kg_m3"
    if slurry is None:
        return
    if kinetics.slurry_concentration_exponent != 1.0:
        allowed = (
            f"must be left out: by the kinetics {kinetics.name} (slurry_concentration_exponent "
            f"{kinetics.slurry_concentration_exponent:g}, not 1) the crystals themselves depend on it"
        )
        yield Problem(file, key, f"{slurry[0]:g}, {slurry[1]:g}", allowed)
    most = SETTLED_SOLIDS * study.material.density
    if slurry[1] >= most:
        yield Problem(
            file, f"{key}[1]", f"{slurry[1]:g}", f"must be below {most:.4g} kg/m3: more is no slurry but a cake"
        )


def _estimate_problems(study: LoadedStudy, design: Design) -> Iterator[Problem]:
    """Find ends of the range at which there is no estimate."""
    for end, time in enumerate(design.variables.residence_time_min):
        csd = study.csds[product_name(time)]
        swept = {name: study.model.base(name) for name in SWEPT}
        for pressure in pressures_of(design, study.model):
            scene = scene_of(
                study.model, csd.truncated, {**swept, "pressure_kPa": pressure}, study.model.packing.protocol
            )
            try:
                shipped()[scene.protocol].estimate(scene)
            except ConfigError as error:
                text = error.problems[0].allowed.removesuffix("; use pack")
                yield Problem(str(study.path), f"{TIMES}[{end}]", f"{time:g}", text)
                break


def _correlations(design: Design, path: Path) -> tuple[dict[str, Correlation], list[Problem]]:
    """Cost correlations that a design needs, and what is wrong with those it names."""
    costs = design.costs
    known = load_correlations(None if costs.file is None else path.parent / costs.file)
    wanted = {EQUIPMENT[kind] for kind in design.variables.filter_type}
    problems = [*_cost_problems(costs, known, wanted, str(path))]
    if problems:
        return {}, problems
    kept = {name: item for name, item in known.items() if item.equipment in wanted or name == costs.crystallizer}
    return kept, []


def _cost_problems(costs: Costs, known: dict[str, Correlation], wanted: Iterable[str], file: str) -> Iterator[Problem]:
    vessels = [name for name, item in known.items() if item.si_unit in ("m3", "kg/s")]
    filters = [name for name, item in known.items() if item.equipment in set(wanted) and item.si_unit == "m2"]
    asked = [("crystallizer", costs.crystallizer, vessels)]
    asked += [] if costs.filter is None else [("filter", costs.filter, filters)]
    for key, name, allowed in asked:
        if name not in allowed:
            text = f"allowed: {', '.join(allowed)}{did_you_mean(name, allowed)}"
            yield Problem(file, f"design.costs.{key}", repr(name), text)
