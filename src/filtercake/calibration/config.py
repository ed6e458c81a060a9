"""The file that describes a calibration, and everything it refers to, checked."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from filtercake.calibration.fit import ADVISED_FRICTIONS, Finding, Observation, Parameter, advised_friction
from filtercake.calibration.measurements import (
    Measurement,
    Measurements,
    compressibility_by_csd,
    load_measurements,
    pressure_effects,
    same_pressure,
)
from filtercake.calibration.rounds import BATCHES, Candidate, Settings
from filtercake.calibration.units_check import unit_problems
from filtercake.errors import ConfigError, Problem, shown
from filtercake.filtration.constant_pressure import CompressibilityFit
from filtercake.filtration.resistance import implied_porosity, law_of
from filtercake.packing import contact_law
from filtercake.packing.scene import GRAVITY_PROTOCOL
from filtercake.statistics import quantile
from filtercake.study.config.packing import EngineName
from filtercake.study.config.study import MOST_DISTRIBUTIONS, Workflow
from filtercake.study.config.sweep import Sweep
from filtercake.study.config.values import (
    MOST_POINTS,
    NAME,
    TO_NUMBER,
    TO_TEXT,
    TO_WHOLE,
    Cohesion,
    Friction,
    Model,
    Name,
    PathText,
)
from filtercake.study.limits import DOUBTFUL_RELATIVE_OVERLAP, LARGEST_RELATIVE_OVERLAP
from filtercake.study.loading import LoadedStudy, find_studies, load_study
from filtercake.study.parsing import parse
from filtercake.study.points import ChooseEngine, expand
from filtercake.units import KILOJOULE_PER_M3, KILOPASCAL, MEGAPASCAL
from filtercake.user_files import is_file, read_yaml

Pressure = Annotated[float, Field(ge=0.001, le=10_000, allow_inf_nan=False), TO_NUMBER]
MOST_FRICTIONS = 50
"""Coefficients of friction that a calibration packs at."""


class CohesionRange(Model):
    """Range of cohesions that are tried."""

    low: Cohesion = Field(default=0.0, description="Lowest cohesion energy density, kJ/m3.")
    high: Cohesion = Field(default=100.0, description="Highest cohesion energy density, kJ/m3.")
    step: Annotated[float, Field(ge=1e-6, le=1e7, allow_inf_nan=False), TO_NUMBER] = Field(
        default=5.0, description="Packings are made at multiples of this from low on, kJ/m3."
    )

    @model_validator(mode="after")
    def _ascending(self) -> CohesionRange:
        if not self.low < self.high:
            raise ValueError("low must be below high")
        if not 2 <= (self.high - self.low) / self.step <= 200:
            raise ValueError("step must divide the range into 2 to 200 parts")
        return self

    def values(self) -> list[float]:
        """Return the cohesions at which packings may be made, kJ/m3."""
        count = round((self.high - self.low) / self.step)
        return [float(f"{value:.10g}") for value in np.linspace(self.low, self.high, count + 1)]


class Calibration(Model):
    """What is fitted to which measurements."""

    title: Annotated[str, Field(max_length=120), TO_TEXT] = Field(default="", description="One line for figures.")
    study: PathText = Field(description="Study whose distributions, material and packing hold: a name or a path.")
    measurements: PathText = Field(description="YAML with the measurements; path relative to this file.")
    cohesion_kJ_m3: CohesionRange = Field(  # noqa: N815
        default=CohesionRange(), description="Range of cohesions that are tried."
    )
    pressure_kPa: Pressure | None = Field(  # noqa: N815
        default=None,
        description="Pressure drop to calibrate at, kPa: resistances measured at several are brought to it by their "
        "compressibility. If left out, all are taken as they are, and a change with pressure is said.",
    )
    friction: Friction | Literal["advised"] = Field(
        default="advised",
        description="Coefficient of friction; advised takes none where the measured resistances imply a mean porosity "
        "under 0.4, and 0.05 above.",
    )
    fit_friction: Annotated[list[Friction], Field(min_length=3, max_length=MOST_FRICTIONS)] | None = Field(
        default=None, description="Fit the friction too, with packings at these values (at least 3)."
    )
    rival_friction: Annotated[list[Friction], Field(max_length=MOST_FRICTIONS)] | None = Field(
        default=None,
        description="Other fixed frictions for which the cohesion is fitted too, to compare; [] for none. If left out, "
        "the other one of 0 and 0.05, or the advised one of them, where two or more distributions were measured.",
    )
    estimator: Literal["interior", "paper_count"] = Field(
        default="interior",
        description="Porosity that the measured resistance is held against: the interior slab's, or the paper's count.",
    )
    engine: EngineName | None = Field(default=None, description="Packing engine; the study's if left out.")
    replicates: Annotated[int, Field(ge=2, le=1000), TO_WHOLE] = Field(
        default=6, description="Packings per point and batch."
    )
    rounds: Annotated[int, Field(ge=1, le=10), TO_WHOLE] = Field(
        default=4, description="At most so many rounds of packings; later ones are made near the optimum."
    )
    relative_ci95_target: Annotated[float, Field(ge=1e-4, lt=10, allow_inf_nan=False), TO_NUMBER] = Field(
        default=0.1, description="Half-width of the cohesion's 95 % interval, over its value, that ends the rounds."
    )
    predict: Annotated[list[Name], Field(max_length=MOST_DISTRIBUTIONS)] = Field(
        default=[], description="Distributions of the study, never tested, whose resistance is predicted."
    )

    @model_validator(mode="after")
    def _one_friction(self) -> Calibration:
        if self.fit_friction is not None and (self.rival_friction or self.friction != "advised"):
            raise ValueError("fit_friction goes without friction and rival_friction")
        if self.fit_friction is not None and sorted(set(self.fit_friction)) != list(self.fit_friction):
            raise ValueError("fit_friction must be ascending, every value once")
        return self


@dataclass(frozen=True)
class LoadedCalibration:
    """A calibration whose every value has been checked.

    Attributes
    ----------
    name : str
        The file's stem.
    path : Path
        The file.
    model : Calibration
        Its contents.
    study : LoadedStudy
        The study, under the calibration's name and with its replicates and warnings.
    measurements : Measurements
        Contents of the file of measurements.
    observations : tuple of Observation
        Measurements as the fit takes them.
    doubts : tuple of Finding
        Doubts about the measurements.
    implied_porosity : float
        Mean porosity that the measured resistances imply.
    frictions : tuple of float
        Those packed: one and its rivals, or all that the fit of the friction needs.
    """

    name: str
    path: Path
    model: Calibration
    study: LoadedStudy
    measurements: Measurements
    observations: tuple[Observation, ...]
    doubts: tuple[Finding, ...]
    implied_porosity: float
    frictions: tuple[float, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is allowed but doubtful."""
        return self.study.warnings

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The fitted parameters."""
        cohesion = self.model.cohesion_kJ_m3
        found = (Parameter("cohesion_kJ_m3", cohesion.low, cohesion.high),)
        if self.model.fit_friction is None:
            return found
        return (*found, Parameter("friction", self.frictions[0], self.frictions[-1]))

    @property
    def packed(self) -> tuple[str, ...]:
        """Distributions that packings are made of: the measured ones, then those to predict."""
        return (*self.measured, *(name for name in self.model.predict if name not in self.measured))

    @property
    def measured(self) -> tuple[str, ...]:
        """Distributions that were measured, in the study's order."""
        names = {item.csd for item in self.measurements.measurements}
        return tuple(name for name in self.study.csds if name in names)


def load_calibrations(names: Iterable[str], folder: Path, studies: Path, file: str) -> list[LoadedCalibration]:
    """Load calibrations by name (in ``folder``) or path.

    Raises
    ------
    ConfigError
        With every problem of every file.
    """
    problems: list[Problem] = []
    loaded: list[LoadedCalibration] = []
    paths: dict[str, Path] = {}
    for index, name in enumerate(names):
        path = Path(name) if name.endswith((".yaml", ".yml")) else folder / f"{name}.yaml"
        allowed = _path_problem(path, paths.get(path.stem), folder)
        if allowed:
            problems.append(Problem(file, f"calibrations[{index}]", repr(name), allowed))
            continue
        paths[path.stem] = path
        try:
            loaded.append(load_calibration(path, studies))
        except ConfigError as error:
            problems += error.problems
    if problems:
        raise ConfigError(problems)
    return loaded


def _path_problem(path: Path, same: Path | None, folder: Path) -> str:
    """Message about an invalid path of a calibration, or one of the same name (``same``); empty for a valid one."""
    if not NAME.match(path.stem):
        return "the file's name must be letters, digits, - and _, starting with a letter or digit, at most 64 long"
    if not is_file(path):
        known = sorted(entry.stem for entry in folder.glob("*.yaml"))
        return f"no such calibration; allowed: {', '.join(known)}, or the path of a calibration file"
    if same is not None:
        return f"{same} and {path} would both be called calibration_{path.stem}; rename one file"
    return ""


def load_calibration(path: Path, studies: Path) -> LoadedCalibration:
    """Read and check a calibration, its study (looked up by name in ``studies``) and its measurements.

    Raises
    ------
    ConfigError
        With every problem found.
    """
    model = parse(Calibration, read_yaml(path), str(path))
    study = _load_study(model, path, studies)
    if not is_file(path.parent / model.measurements):
        allowed = "no such file; must be the path of a file of measurements, relative to this file"
        raise ConfigError([Problem(str(path), "measurements", shown(model.measurements), allowed)])
    measurements = load_measurements(path.parent / model.measurements)
    problems = list(_problems(model, study, measurements, path))
    if problems:
        raise ConfigError(problems)
    observations = tuple(_observations(measurements, model.pressure_kPa))
    porosity = _implied_porosity(study, observations)
    name = f"calibration_{path.stem}"
    warnings = (*measurements.warnings, *_doubts(model, study, path))
    asked = {"replicates": model.replicates, "engine": model.engine or study.model.packing.engine}
    packing = study.model.packing.model_copy(update=asked)
    own = study.model.model_copy(update={"packing": packing})
    return LoadedCalibration(
        name=name,
        path=path,
        model=model,
        study=replace(study, name=name, model=own, warnings=warnings),
        measurements=measurements,
        observations=observations,
        doubts=tuple(_measured_doubts(measurements, model.pressure_kPa)),
        implied_porosity=porosity,
        frictions=_frictions(model, porosity, len({item.csd for item in observations})),
    )


def candidates(calibration: LoadedCalibration, choose_engine: ChooseEngine) -> list[Candidate]:
    """List every point that a calibration may come to need.

    A batch of more replicates is the same point with another base seed.
    """
    found: list[Candidate] = []
    sweep = Sweep(
        csd=list(calibration.packed),
        cohesion_kJ_m3=calibration.model.cohesion_kJ_m3.values(),
        friction=list(calibration.frictions),
    )
    for batch in range(BATCHES):
        packing = calibration.study.model.packing
        packing = packing.model_copy(update={"seed": packing.seed + batch})
        model = calibration.study.model.model_copy(update={"packing": packing, "sweeps": [sweep]})
        points = expand(replace(calibration.study, model=model), choose_engine)
        found += [Candidate(point, batch) for point in points]
    return found


def settings_of(calibration: LoadedCalibration) -> Settings:
    """Return what the calibration's jobs need to know."""
    model, material = calibration.model, calibration.study.model.material
    return Settings(
        parameters=calibration.parameters,
        frictions=calibration.frictions,
        measured=calibration.measured,
        predicted=tuple(model.predict),
        cohesions=tuple(model.cohesion_kJ_m3.values()),
        estimator=model.estimator,
        rounds=model.rounds,
        relative_ci95_target=model.relative_ci95_target,
        density=material.density,
        sphericity=material.sphericity,
        implied_porosity=calibration.implied_porosity,
        soft_above=_cohesion_at(DOUBTFUL_RELATIVE_OVERLAP, calibration.study),
        doubts=calibration.doubts,
        resistance_law=calibration.study.model.resistance_law,
    )


def _observations(measurements: Measurements, pressure: float | None) -> Iterable[Observation]:
    """Measurements as the fit takes them; those at several pressures as one at the pressure asked for, in kPa."""
    if pressure is not None:
        for csd, fit in _brought(measurements, pressure).items():
            value, _, high = (float(end) for end in fit.resistance_at(pressure * KILOPASCAL))
            yield Observation(f"{csd} at {pressure:g} kPa", csd, math.log(value), math.log(high / value) / quantile())
    for item in _as_they_are(measurements, pressure):
        yield Observation(item.name, item.csd, math.log(item.resistance), item.relative_se)


def _brought(measurements: Measurements, pressure: float | None) -> dict[str, CompressibilityFit]:
    """Compressibility of the distributions whose resistance is brought to a pressure."""
    return {} if pressure is None else compressibility_by_csd(measurements)


def _as_they_are(measurements: Measurements, pressure: float | None) -> list[Measurement]:
    """Measurements that enter as they are."""
    brought = _brought(measurements, pressure)
    return [item for item in measurements.measurements if item.pressure_drop is None or item.csd not in brought]


def _measured_doubts(measurements: Measurements, pressure: float | None) -> Iterable[Finding]:
    yield from (Finding("contradiction", text) for text in measurements.contradictions)
    if pressure is None:
        for text in pressure_effects(measurements).values():
            yield Finding("pressure", f"{text}, which packings do not: give a pressure_kPa to calibrate at")
        return
    wanted = pressure * KILOPASCAL
    for item in _as_they_are(measurements, pressure):
        if item.pressure_drop is None or not same_pressure(item.pressure_drop, wanted):
            at = "an unknown pressure" if item.pressure_drop is None else f"{item.pressure_drop / KILOPASCAL:g} kPa"
            yield Finding("pressure", f"{item.name} of {item.csd} is of {at}, and taken as it is for {pressure:g} kPa")


def _study_path(model: Calibration, path: Path, studies: Path) -> Path:
    near = path.parent / model.study
    if model.study.endswith((".yaml", ".yml")) and is_file(near):
        return near
    try:
        return find_studies(Workflow(studies=[model.study]), studies, str(path))[0]
    except ConfigError as error:
        raise ConfigError([replace(problem, key="study") for problem in error.problems]) from None


def _load_study(model: Calibration, path: Path, studies: Path) -> LoadedStudy:
    try:
        return load_study(_study_path(model, path, studies))
    except ConfigError as error:
        if error.problems[0].file == str(path):
            raise
        own = Problem(str(path), "study", shown(model.study), "this study cannot be used:")
        raise ConfigError([own, *error.problems]) from None


def _problems(model: Calibration, study: LoadedStudy, measurements: Measurements, path: Path) -> Iterable[Problem]:
    known = ", ".join(study.csds)
    packed = len({*model.predict, *(item.csd for item in measurements.measurements)})
    frictions = len(model.fit_friction or [0, *(model.rival_friction or [0])])
    points = packed * len(model.cohesion_kJ_m3.values()) * frictions * BATCHES
    if law_of(study.model.resistance_law).needs_kozeny_constant:
        allowed = (
            f"its resistance_law is {study.model.resistance_law}, which no calibration solves: use carman or additive"
        )
        yield Problem(str(path), "study", shown(model.study), allowed)
    if study.model.packing.protocol != GRAVITY_PROTOCOL:
        allowed = (
            f"its packing.protocol is {study.model.packing.protocol}, whose packings no calibration fits yet: "
            f"use {GRAVITY_PROTOCOL}"
        )
        yield Problem(str(path), "study", shown(model.study), allowed)
    if points > MOST_POINTS:
        allowed = f"must be at most {MOST_POINTS} points: use a larger step, fewer frictions or distributions"
        yield Problem(str(path), "cohesion_kJ_m3.step", f"{points} points", allowed)
    for item in measurements.measurements:
        if item.csd not in study.csds:
            yield Problem(
                model.measurements, f"csd of {item.name}", repr(item.csd), f"not in the study; allowed: {known}"
            )
    for index, name in enumerate(model.predict):
        if name not in study.csds:
            yield Problem(str(path), f"predict[{index}]", repr(name), f"not in the study; allowed: {known}")
    yield from unit_problems(measurements, study, model.measurements)
    for csd, fit in _brought(measurements, model.pressure_kPa).items():
        if not math.isfinite(fit.exponent_ci95):
            text = f"two measurements of {csd} give no interval at another pressure: add a third, or leave the key out"
            yield Problem(str(path), "pressure_kPa", f"{model.pressure_kPa:g}", text)
    limit = _cohesion_at(LARGEST_RELATIVE_OVERLAP, study)
    if model.cohesion_kJ_m3.high > limit:
        text = f"must be at most {int(limit)} kJ/m3 at the study's Young's modulus: above it contacts are too soft"
        yield Problem(str(path), "cohesion_kJ_m3.high", f"{model.cohesion_kJ_m3.high:g}", text)


def _doubts(model: Calibration, study: LoadedStudy, path: Path) -> Iterable[str]:
    limit = _cohesion_at(DOUBTFUL_RELATIVE_OVERLAP, study)
    if model.cohesion_kJ_m3.high > limit:
        yield (
            f"{path}: above {limit:.0f} kJ/m3 contacts overlap by more than {DOUBTFUL_RELATIVE_OVERLAP:.0%} of the "
            "diameter: the answer depends on their softness there"
        )


def _cohesion_at(overlap: float, study: LoadedStudy) -> float:
    material = study.model.material
    modulus = material.youngs_modulus_MPa * MEGAPASCAL
    return contact_law.cohesion_at_overlap(overlap, modulus, material.poisson_ratio) / KILOJOULE_PER_M3


def _implied_porosity(study: LoadedStudy, observations: Iterable[Observation]) -> float:
    material, law = study.model.material, study.model.resistance_law
    found = [
        implied_porosity(
            math.exp(item.ln_resistance), study.csds[item.csd].full, material.density, material.sphericity, law
        )
        for item in observations
    ]
    return float(np.mean(found))


def _frictions(model: Calibration, porosity: float, distributions: int) -> tuple[float, ...]:
    if model.fit_friction is not None:
        return tuple(model.fit_friction)
    advised = advised_friction(porosity)
    main = advised if model.friction == "advised" else model.friction
    rivals = model.rival_friction
    if rivals is None:  # with one distribution a cohesion makes up for any friction
        others = [value for value in ADVISED_FRICTIONS if value != main]
        rival = others[0] if len(others) == 1 else advised
        rivals = [rival] if distributions > 1 else []
    return (main, *dict.fromkeys(value for value in rivals if value != main))
