"""The file that describes a calibration, and everything it refers to, checked."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from filtercake.calibration.fit import ADVISED_FRICTIONS, UNITS, Finding, Observation, advised_friction, cake_of
from filtercake.calibration.measurements import (
    Measurement,
    Measurements,
    compressibility_by_csd,
    load_measurements,
    pressure_effects,
    same_pressure,
)
from filtercake.calibration.response import Parameter
from filtercake.calibration.rounds import BATCHES, Candidate, Settings
from filtercake.calibration.units_check import unit_problems
from filtercake.errors import ConfigError, Problem, shown
from filtercake.filtration.constant_pressure import CompressibilityFit
from filtercake.filtration.resistance import implied_porosity, law_of
from filtercake.packing import contact_law
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.scene import FILTRATION_PROTOCOL
from filtercake.statistics import quantile
from filtercake.study.config.packing import AUTO, EngineName
from filtercake.study.config.study import MOST_DISTRIBUTIONS, Study, Workflow
from filtercake.study.config.sweep import SWEPT, Sweep
from filtercake.study.config.values import (
    MOST_POINTS,
    NAME,
    TO_NUMBER,
    TO_TEXT,
    TO_WHOLE,
    Adhesion,
    Cohesion,
    Friction,
    Model,
    Name,
    PathText,
)
from filtercake.study.limits import DOUBTFUL_RELATIVE_OVERLAP, LARGEST_RELATIVE_OVERLAP, refusals, small_beds
from filtercake.study.loading import LoadedStudy, find_studies, load_study
from filtercake.study.parsing import parse
from filtercake.study.points import ChooseEngine, expand
from filtercake.study.scenes import scene_of
from filtercake.units import KILOJOULE_PER_M3, KILOPASCAL, MEGAPASCAL, tidy
from filtercake.user_files import is_file, read_yaml

Pressure = Annotated[float, Field(ge=0.001, le=10_000, allow_inf_nan=False), TO_NUMBER]
MOST_FRICTIONS = 50
"""Coefficients of friction that a calibration packs at."""
PRESSED_FRICTIONS = (0.0, 0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.7)
"""Frictions at which pressed cakes may be packed where a calibration names none; closer where porosity falls faster."""
ADHESIONS = 9
"""Works of adhesion at which a pressed packing is evaluated where a range is fitted."""
OF_BEDS = ("cohesion_kJ_m3", "friction", "rival_friction", "pressure_kPa")
"""Keys that calibrations of pressed cakes do not take."""


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


class AdhesionRange(Model):
    """Range of works of adhesion that are tried."""

    low: Adhesion = Field(default=0.0, description="Lowest work of adhesion, mJ/m2.")
    high: Adhesion = Field(description="Highest work of adhesion, mJ/m2.")

    @model_validator(mode="after")
    def _ascending(self) -> AdhesionRange:
        if not self.low < self.high:
            raise ValueError("low must be below high")
        return self

    def values(self) -> list[float]:
        """Return works of adhesion at which packings are evaluated, mJ/m2: closer where porosity changes faster."""
        share = np.linspace(0.0, 1.0, ADHESIONS) ** 2
        return [float(f"{self.low + (self.high - self.low) * part:.10g}") for part in share]


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
        default=None,
        description="Fit the friction too, with packings at these values (at least 3). Of pressed cakes the friction "
        f"is always fitted; if left out, with packings at some of {', '.join(f'{mu:g}' for mu in PRESSED_FRICTIONS)}.",
    )
    adhesion_mJ_m2: Adhesion | AdhesionRange | None = Field(  # noqa: N815
        default=None,
        description="Work of adhesion of pressed cakes, mJ/m2: a number to take, or a range (low, high) to fit it too; "
        "the study's attraction if left out.",
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
        default=0.1,
        description="Half-width of the 95 % interval of the cohesion (the friction of pressed cakes), over its value, "
        "that ends the rounds.",
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
        Those packed: one and its rivals, or all that the fit of the friction may need.
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
    def is_pressed(self) -> bool:
        """Whether the packings are pressed cakes."""
        return self.study.model.packing.protocol == FILTRATION_PROTOCOL

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The fitted parameters."""
        if self.is_pressed:
            friction = Parameter("friction", self.frictions[0], self.frictions[-1])
            wanted = self.model.adhesion_mJ_m2
            if not isinstance(wanted, AdhesionRange):
                return (friction,)
            return (friction, Parameter("adhesion_mJ_m2", wanted.low, wanted.high))
        cohesion = self.model.cohesion_kJ_m3
        found = (Parameter("cohesion_kJ_m3", cohesion.low, cohesion.high),)
        if self.model.fit_friction is None:
            return found
        return (*found, Parameter("friction", self.frictions[0], self.frictions[-1]))

    @property
    def attractions(self) -> tuple[str, tuple[float, ...]]:
        """What makes pressed crystals stick: the property and the values at which packings are evaluated."""
        wanted, material = self.model.adhesion_mJ_m2, self.study.model.material
        if isinstance(wanted, AdhesionRange):
            return "adhesion_mJ_m2", tuple(wanted.values())
        if wanted is None and material.adhesion_mJ_m2 is None:
            return "cohesion_kJ_m3", (material.cohesion_kJ_m3,)
        return "adhesion_mJ_m2", (float(wanted if wanted is not None else material.adhesion_mJ_m2 or 0.0),)

    @property
    def pressures(self) -> tuple[float, ...]:
        """Pressure drops at which pressed cakes are evaluated, ascending, kPa; the study's own is among them."""
        if not self.is_pressed:
            return ()
        own = self.study.model.base("pressure_kPa")
        return tuple(sorted({*(item.pressure_kPa or 0.0 for item in self.observations), float(own or 0.0)}))

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
    pressed = study.model.packing.protocol == FILTRATION_PROTOCOL
    observations = tuple(
        _pressed_observations(measurements, study.model.base("pressure_kPa"))
        if pressed
        else _observations(measurements, model.pressure_kPa)
    )
    porosity = _implied_porosity(study, observations)
    name = f"calibration_{path.stem}"
    warnings = (*measurements.warnings, *_doubts(model, study, path))
    asked = {"replicates": model.replicates, "engine": model.engine or study.model.packing.engine}
    packing = study.model.packing.model_copy(update=asked)
    own = study.model.model_copy(update={"packing": packing})
    doubts = _pressed_doubts(measurements, own) if pressed else _measured_doubts(measurements, model.pressure_kPa)
    loaded = LoadedCalibration(
        name=name,
        path=path,
        model=model,
        study=replace(study, name=name, model=own, warnings=warnings),
        measurements=measurements,
        observations=observations,
        doubts=tuple(doubts),
        implied_porosity=porosity,
        frictions=tuple(model.fit_friction or PRESSED_FRICTIONS)
        if pressed
        else _frictions(model, porosity, len({item.csd for item in observations})),
    )
    refused = list(_scene_problems(loaded)) if pressed else []
    if refused:
        raise ConfigError(refused)
    return loaded


def candidates(calibration: LoadedCalibration, choose_engine: ChooseEngine) -> list[Candidate]:
    """List every point that a calibration may come to need.

    A batch of more replicates is the same point with another base seed. A point of pressed cakes stands for its
    packings, which serve every pressure and attraction.
    """
    found: list[Candidate] = []
    sweep = Sweep(csd=list(calibration.packed), friction=list(calibration.frictions), **_swept(calibration))
    for batch in range(BATCHES):
        packing = calibration.study.model.packing
        packing = packing.model_copy(update={"seed": packing.seed + batch})
        model = calibration.study.model.model_copy(update={"packing": packing, "sweeps": [sweep]})
        points = expand(replace(calibration.study, model=model), choose_engine)
        found += [Candidate(point, batch) for point in points]
    return found


def _swept(calibration: LoadedCalibration) -> dict[str, list[float]]:
    """Values of a sweep over a calibration's points, besides distributions and frictions."""
    if not calibration.is_pressed:
        return {"cohesion_kJ_m3": calibration.model.cohesion_kJ_m3.values()}
    name, values = calibration.attractions
    # one that sticks stands for all that do, one that does not for itself
    return {name: [values[-1]], "pressure_kPa": [calibration.pressures[-1]]}


def settings_of(calibration: LoadedCalibration) -> Settings:
    """Return what the calibration's jobs need to know."""
    model, material, pressed = calibration.model, calibration.study.model.material, calibration.is_pressed
    beside, values = calibration.attractions if pressed else ("friction", calibration.frictions)
    return Settings(
        parameters=calibration.parameters,
        levels=calibration.frictions if pressed else tuple(model.cohesion_kJ_m3.values()),
        beside=beside,
        beside_levels=values,
        pressures_kPa=calibration.pressures,
        predicted_pressure_kPa=calibration.study.model.base("pressure_kPa") if pressed else None,
        measured=calibration.measured,
        predicted=tuple(model.predict),
        estimator=model.estimator,
        rounds=model.rounds,
        relative_ci95_target=model.relative_ci95_target,
        density=material.density,
        sphericity=material.sphericity,
        implied_porosity=calibration.implied_porosity,
        soft_above=math.inf if pressed else _cohesion_at(DOUBTFUL_RELATIVE_OVERLAP, calibration.study),
        doubts=calibration.doubts,
        resistance_law=calibration.study.model.resistance_law,
    )


def _pressed_observations(measurements: Measurements, own: float | None) -> Iterable[Observation]:
    """Measurements as the fit of pressed cakes takes them: each at its pressure drop, or at the study's, kPa."""
    known: list[float] = []
    for item in measurements.measurements:
        drop = own if item.pressure_drop is None else tidy(item.pressure_drop / KILOPASCAL)
        at = float(drop or 0.0)
        same = next((value for value in known if same_pressure(value, at)), at)
        known.append(same)
        yield Observation(item.name, item.csd, math.log(item.resistance), item.relative_se, same)


def _pressed_doubts(measurements: Measurements, study: Study) -> Iterable[Finding]:
    yield from (Finding("contradiction", text) for text in measurements.contradictions)
    for item in measurements.measurements:
        if item.pressure_drop is None:
            drop = study.base("pressure_kPa")
            text = f"{item.name} of {item.csd} is of an unknown pressure, and taken for one at the study's {drop:g} kPa"
            yield Finding("pressure", text)


def _scene_problems(calibration: LoadedCalibration) -> Iterable[Problem]:
    """Cakes that cannot be pressed: loads and attractions that leave what pressed cells are known for."""
    name, values = calibration.attractions
    measured = {(item.csd, float(item.pressure_kPa or 0.0)) for item in calibration.observations}
    own = float(calibration.study.model.base("pressure_kPa") or 0.0)
    cakes = sorted(measured | {(csd, own) for csd in calibration.model.predict})
    said: set[str] = set()
    for (csd, pressure), value in itertools.product(cakes, sorted({values[0], values[-1]})):
        swept = {prop: calibration.study.model.base(prop) for prop in SWEPT}
        swept |= {"friction": calibration.frictions[-1], "pressure_kPa": pressure, name: value}
        scene = scene_of(calibration.study.model, calibration.study.csds[csd].truncated, swept, FILTRATION_PROTOCOL)
        for finding in (*refusals(scene), *small_beds(scene)):
            text = f"{csd} at {pressure:g} kPa and {value:g} {UNITS[name]}: {finding.text}"
            if finding.text not in said:
                said.add(finding.text)
                yield Problem(str(calibration.path), finding.key, cake_of(csd, pressure), text)


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
    pressed = study.model.packing.protocol == FILTRATION_PROTOCOL
    points = packed * (1 if pressed else len(model.cohesion_kJ_m3.values())) * frictions * BATCHES
    if law_of(study.model.resistance_law).needs_kozeny_constant:
        allowed = (
            f"its resistance_law is {study.model.resistance_law}, which no calibration solves: use carman or additive"
        )
        yield Problem(str(path), "study", shown(model.study), allowed)
    yield from _protocol_problems(model, study, measurements, path)
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
    for csd, fit in _brought(measurements, None if pressed else model.pressure_kPa).items():
        if not math.isfinite(fit.exponent_ci95):
            text = f"two measurements of {csd} give no interval at another pressure: add a third, or leave the key out"
            yield Problem(str(path), "pressure_kPa", f"{model.pressure_kPa:g}", text)
    limit = math.inf if pressed else _cohesion_at(LARGEST_RELATIVE_OVERLAP, study)
    if model.cohesion_kJ_m3.high > limit:
        text = f"must be at most {int(limit)} kJ/m3 at the study's Young's modulus: above it contacts are too soft"
        yield Problem(str(path), "cohesion_kJ_m3.high", f"{model.cohesion_kJ_m3.high:g}", text)


def _protocol_problems(
    model: Calibration, study: LoadedStudy, measurements: Measurements, path: Path
) -> Iterable[Problem]:
    """Keys that the study's protocol does not know, or needs."""
    protocol = study.model.packing.protocol
    where = f"the study's packing.protocol is {protocol}"
    if protocol != FILTRATION_PROTOCOL:
        if model.adhesion_mJ_m2 is not None:
            yield Problem(str(path), "adhesion_mJ_m2", "given", f"{where}: its cohesion is fitted; leave the key out")
        return
    whys = {
        "cohesion_kJ_m3": "the friction is fitted, and adhesion_mJ_m2 with it where a range is given",
        "friction": "the friction is fitted: fit_friction names the values packed",
        "rival_friction": "the friction is fitted: fit_friction names the values packed",
        "pressure_kPa": "every resistance is compared with cakes at its own pressure drop",
    }
    for key in OF_BEDS:
        if key in model.model_fields_set and getattr(model, key) is not None:
            yield Problem(str(path), key, "given", f"{where}: {whys[key]}; leave the key out")
    if model.estimator != "interior":
        yield Problem(str(path), "estimator", model.estimator, f"{where}: pressed cakes have an interior only")
    if model.engine not in (None, AUTO, Embedded.name):
        allowed = f"{where}: cakes are pressed by the embedded engine; allowed: {AUTO!r}, {Embedded.name!r}"
        yield Problem(str(path), "engine", shown(model.engine), allowed)
    unknown = [item.name for item in measurements.measurements if item.pressure_drop is None]
    if study.model.base("pressure_kPa") is None and (unknown or model.predict):
        what = f"{unknown[0]} has no pressure_drop_kPa" if unknown else "predict needs the pressure to predict at"
        yield Problem(str(path), "study", shown(model.study), f"{what}: give the study a packing.pressure_kPa")


def _doubts(model: Calibration, study: LoadedStudy, path: Path) -> Iterable[str]:
    if study.model.packing.protocol == FILTRATION_PROTOCOL:
        return
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
