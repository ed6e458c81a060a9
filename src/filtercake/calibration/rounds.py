"""A calibration as a series of packings: what to pack next, the fit of what is there, and its tables."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from filtercake.calibration.fit import (
    Calibration,
    Finding,
    Observation,
    Slope,
    advised_friction,
    cake_of,
    calibrate,
    compare_friction,
    good_enough,
    leave_one_out,
    next_values,
    slope,
    with_unit,
    words_of,
)
from filtercake.calibration.measurements import exponent_limit
from filtercake.calibration.response import Parameter, Responds, Response, SharedResponse
from filtercake.crystals.csd import CrystalSizeDistribution, FullAndTruncated, read_tables
from filtercake.errors import CalibrationError
from filtercake.filtration.constant_pressure import compressibility
from filtercake.filtration.resistance import ADDITIVE, resistance
from filtercake.packing.pack import MANIFEST
from filtercake.packing.pack import Outcome as Packed
from filtercake.packing.result import read_record
from filtercake.results.replicates import REPLICATE_COLUMNS, replicate_rows, replicates_table
from filtercake.study.points import Point
from filtercake.units import KILOJOULE_PER_M3, KILOPASCAL, MILLIJOULE_PER_M2

BATCHES = 3
"""Sets of replicates that a point may get, one after the other, where the first do not suffice."""
COARSE = 6
"""Values of the first parameter in the first round."""
MOST = 4
"""Values added by a later one."""
ATTRACTIONS = {"adhesion_mJ_m2": (MILLIJOULE_PER_M2, "adhesion"), "cohesion_kJ_m3": (KILOJOULE_PER_M3, "cohesion")}
"""Units of what makes pressed crystals stick, and what a scene calls it."""


@dataclass(frozen=True)
class Settings:
    """Settings of a calibration's jobs.

    Attributes
    ----------
    parameters : tuple of Parameter
        The fitted ones; packings are made along the first: the cohesion of beds, the friction of pressed cakes.
    levels : tuple of float
        All values of the first that may be packed, ascending.
    beside : str
        Property held beside it: the friction of beds, the attraction of pressed cakes.
    beside_levels : tuple of float
        Values of that; unless it is fitted, the first is the one taken, the rest its rivals.
    measured, predicted : tuple of str
        Distributions with measurements, and those whose resistance is predicted.
    estimator : {"interior", "paper_count"}
        Porosity that the measured resistance is held against.
    rounds : int
        Largest number of rounds of packings.
    relative_ci95_target : float
        Half-width of the first parameter's interval over its value that ends them.
    density, sphericity : float
        Density (kg/m3) and sphericity of the crystals.
    implied_porosity : float
        Mean porosity that the measured resistances imply.
    soft_above : float
        Cohesion from which the softness of the contacts matters, kJ/m3.
    doubts : tuple of Finding
        Doubts about the measurements.
    resistance_law : str
        Law between porosity and resistance: the study's.
    pressures_kPa : tuple of float
        Pressure drops at which pressed cakes are evaluated, kPa; empty for beds, which know none.
    predicted_pressure_kPa : float or None
        Pressure drop that pressed cakes are predicted at, kPa.
    """

    parameters: tuple[Parameter, ...]
    levels: tuple[float, ...]
    beside: str
    beside_levels: tuple[float, ...]
    measured: tuple[str, ...]
    predicted: tuple[str, ...]
    estimator: str
    rounds: int
    relative_ci95_target: float
    density: float
    sphericity: float
    implied_porosity: float
    soft_above: float
    doubts: tuple[Finding, ...] = ()
    resistance_law: str = ADDITIVE
    pressures_kPa: tuple[float, ...] = ()  # noqa: N815
    predicted_pressure_kPa: float | None = None  # noqa: N815

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Settings:
        """Build from plain values, e.g. a rule's params."""
        found: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in values.items()
        }
        found["parameters"] = tuple(Parameter(**item) for item in values["parameters"])
        found["doubts"] = tuple(Finding(**item) for item in values["doubts"])
        return cls(**found)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, fit for a rule's params."""
        return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()}

    @property
    def first(self) -> str:
        """Name of the parameter along which packings are made."""
        return self.parameters[0].name

    @property
    def is_pressed(self) -> bool:
        """Whether the packings are pressed cakes."""
        return bool(self.pressures_kPa)

    @property
    def fits_both(self) -> bool:
        """Whether the property held beside the first is a fitted parameter."""
        return len(self.parameters) > 1

    @property
    def fixed(self) -> float | None:
        """Value of that property in the fit that counts; None where it is fitted."""
        return None if self.fits_both else self.beside_levels[0]

    @property
    def main_levels(self) -> tuple[float, ...]:
        """Values of that property in the fit that counts, without rivals."""
        return self.beside_levels if self.fits_both else self.beside_levels[:1]

    @property
    def predicted_cakes(self) -> tuple[Cake, ...]:
        """Cakes to predict."""
        return tuple((csd, self.predicted_pressure_kPa) for csd in self.predicted)


Cake = tuple[str, float | None]
"""A distribution, and the pressure drop in kPa where its packings know one."""


@dataclass(frozen=True)
class Candidate:
    """A point that a calibration may come to need, and its batch of replicates."""

    point: Point
    batch: int


@dataclass(frozen=True)
class Round:
    """One round of packings.

    Attributes
    ----------
    points : tuple of str
        Names of the points to pack.
    finished : bool
        Whether it is the last: then there is nothing to pack.
    why : str
        The reason, for the log and the report.
    """

    points: tuple[str, ...]
    finished: bool
    why: str


@dataclass(frozen=True)
class Compressibility:
    """How the resistance of a distribution's cakes changes with the pressure drop.

    Attributes
    ----------
    csd : str
        The distribution.
    lowest, highest : float
        Pressure drops between which it was measured, kPa.
    measured, measured_ci95 : float
        Exponent of the power law through the measured resistances, and the half-width of its 95 % interval.
    modelled : Slope
        Exponent of the calibrated packings, at the same pressures.
    """

    csd: str
    lowest: float
    highest: float
    measured: float
    measured_ci95: float
    modelled: Slope

    @property
    def agree(self) -> bool:
        """Whether the intervals of both exponents overlap."""
        return self.modelled.low - self.measured_ci95 <= self.measured <= self.modelled.high + self.measured_ci95


@dataclass(frozen=True)
class Outcome:
    """A calibration with all that follows from it.

    Attributes
    ----------
    fit : Calibration
        The one that counts.
    rivals : dict of float to Calibration
        Fits of the first parameter for every fixed value of the other, the one that counts included; empty where both
        are fitted.
    left_out : dict of str to float
        Error of predicting each cake from those of other distributions, in ln(alpha).
    findings : tuple of Finding
        Findings about the fit.
    responses : dict of (str, float or None) to Response or SharedResponse
        ln(alpha) by cake and fixed value (None where it is fitted).
    packed_correlation : float
        Correlation of the packings' errors between cakes of one distribution.
    compressibilities : tuple of Compressibility
        Of the distributions that were measured at several pressures, where the packings know pressures.
    """

    fit: Calibration
    rivals: dict[float, Calibration]
    left_out: dict[str, float]
    findings: tuple[Finding, ...]
    responses: dict[tuple[str, float | None], Responds]
    packed_correlation: float = 0.0
    compressibilities: tuple[Compressibility, ...] = ()


@dataclass(frozen=True)
class Task:
    """Input of a calibration's job."""

    settings: Settings
    observations: tuple[Observation, ...]
    candidates: tuple[Candidate, ...]

    @classmethod
    def from_params(cls, values: Mapping[str, Any]) -> Task:
        """Build from plain values, e.g. a rule's params."""
        return cls(
            Settings.from_dict(values["settings"]),
            tuple(Observation(**item) for item in values["observations"]),
            tuple(Candidate(Point.from_dict(item["point"]), item["batch"]) for item in values["candidates"]),
        )

    def simulate(self, names: Iterable[str], packings: Path, tables: Iterable[str]) -> pd.DataFrame:
        """Tabulate the packings of the points named (see :func:`simulate`); ``tables`` are the CSD files."""
        wanted = set(names)
        chosen = [c for c in self.candidates if c.point.name in wanted]
        return simulate(chosen, packings, read_tables(tables), self.settings)

    def full_csds(self, tables: Iterable[str]) -> dict[str, CrystalSizeDistribution]:
        """Read the full distributions from their files, by name."""
        return {name: full for name, (full, _) in read_tables(tables).items()}


def simulate(
    candidates: Iterable[Candidate],
    packings: Path,
    csds: Mapping[str, FullAndTruncated],
    settings: Settings,
) -> pd.DataFrame:
    """Tabulate every packing made, with its ln(alpha) by the estimator asked for.

    The columns are those of :func:`filtercake.results.replicates.replicates_table`, batch and ln_resistance. A pressed
    packing has a row for each pressure and attraction that it serves.
    """
    listed = list(candidates)
    table = (_pressed_table if settings.is_pressed else _beds_table)(listed, packings, csds, settings)
    batches = {c.point.name: c.batch for c in listed}
    table["batch"] = table["point"].map(batches)
    law, material = settings.resistance_law, (settings.density, settings.sphericity)
    porosity = table["porosity" if settings.estimator == "interior" else "porosity_paper_count"]
    table["ln_resistance"] = [
        math.log(resistance(law, value, csds[str(csd)][0], *material)) if np.isfinite(value) else np.nan
        for value, csd in zip(porosity.to_list(), table["csd"], strict=True)
    ]
    return table


def _beds_table(
    candidates: Sequence[Candidate], packings: Path, csds: Mapping[str, FullAndTruncated], settings: Settings
) -> pd.DataFrame:
    points = [c.point for c in candidates]
    return replicates_table(points, packings, csds, settings.sphericity, settings.resistance_law)


def _pressed_table(
    candidates: Sequence[Candidate], packings: Path, csds: Mapping[str, FullAndTruncated], settings: Settings
) -> pd.DataFrame:
    """Measure pressed packings at every pressure and attraction."""
    unit, attraction = ATTRACTIONS[settings.beside]
    rows: list[dict[str, Any]] = []
    for point in (c.point for c in candidates):
        outcomes = [Packed(**entry) for entry in read_record(packings / point.packings / MANIFEST)["replicates"]]
        for pressure, value in itertools.product(settings.pressures_kPa, settings.beside_levels):
            changed: dict[str, Any] = {"pressure": pressure * KILOPASCAL, attraction: value * unit}
            cake = replace(point, scene=replace(point.scene, **changed))
            folder, law = packings / point.packings, settings.resistance_law
            rows += replicate_rows(cake, outcomes, folder, csds[point.csd], settings.sphericity, law)
    return pd.DataFrame(rows, columns=list(REPLICATE_COLUMNS))


def choose_round(
    number: int,
    settings: Settings,
    candidates: Sequence[Candidate],
    visited: Sequence[str],
    observations: Sequence[Observation],
    simulated: pd.DataFrame | None,
) -> Round:
    """Decide what to pack in a round (numbered from 0), given the points of earlier rounds and what they gave.

    The first round is coarse. Later ones refine the first parameter where the interval still is, and, when every
    candidate there has been packed, add a batch of replicates.
    """
    own = [c for c in candidates if c.point.csd in settings.measured]
    if number == 0 or simulated is None:
        values = next_values(None, settings.levels, [], COARSE, MOST)
        names = _named(own, values, settings.beside_levels, settings, batch=0)
        return Round(names, finished=False, why="first look at the range")
    fit = fit_main(settings, observations, simulated)
    found = fit.estimates[0]
    value, low, high = (f"{end:.3g}" for end in (found.value, found.low, found.high))
    name = words_of(settings.first).removesuffix(" energy density").removeprefix("coefficient of ")
    so_far = f"{name} {with_unit(settings.first, value)}, 95 % interval {low} to {high}"
    if good_enough(fit, settings.relative_ci95_target):
        return Round((), finished=True, why=f"{so_far}: {_enough(fit, settings.relative_ci95_target)}")
    if number >= settings.rounds:
        return Round((), finished=True, why=f"{so_far}: the last of {settings.rounds} rounds")
    seen = sorted({_level(c, settings) for c in own if c.point.name in visited})
    wanted = next_values(fit, settings.levels, seen, COARSE, MOST)
    if wanted:
        why = f"{so_far}: look closer at {_listed(wanted, settings)}"
        names = _named(own, wanted, settings.main_levels, settings, batch=0)
        return Round(names, finished=False, why=why)
    near = next_values(fit, settings.levels, [], COARSE, len(settings.levels))
    for batch in range(1, BATCHES):
        every = _named(own, near, settings.main_levels, settings, batch)
        points = tuple(name for name in every if name not in visited)
        if points:
            why = f"{so_far}: more replicates at {_listed(near, settings)}"
            return Round(points, finished=False, why=why)
    return Round((), finished=True, why=f"{so_far}: every candidate has its {BATCHES} batches")


def _listed(values: Sequence[float], settings: Settings) -> str:
    return with_unit(settings.first, ", ".join(f"{value:g}" for value in values))


def _enough(fit: Calibration, target: float) -> str:
    first = fit.estimates[0]
    if first.half_width <= target * first.value:
        return f"within {100.0 * target:g} %"
    return f"more packings would not narrow it, they make {100.0 * fit.model_share:.0f} % of the variance"


def _named(
    candidates: Sequence[Candidate],
    levels: Sequence[float],
    beside: Sequence[float],
    settings: Settings,
    batch: int,
) -> tuple[str, ...]:
    """Name the points at some values of the first parameter and of what is held beside it; all serve pressed cakes."""
    return tuple(
        c.point.name
        for c in candidates
        if c.batch == batch
        and np.isclose(levels, _level(c, settings)).any()
        and (settings.is_pressed or np.isclose(beside, c.point.row()[settings.beside]).any())
    )


def _level(candidate: Candidate, settings: Settings) -> float:
    """Value of the first parameter."""
    return float(candidate.point.row()[settings.first])


def prediction_points(settings: Settings, candidates: Sequence[Candidate], fit: Calibration) -> tuple[str, ...]:
    """Points at which the distributions to predict are packed: those that the interval spans, and their neighbours."""
    near = next_values(fit, settings.levels, [], COARSE, len(settings.levels))
    values = list(settings.levels)
    while len(near) < min(4, len(values)):  # a curve needs more than two points
        near = sorted({*near, *(values[k] for k in _beside(values, near))})
    if len(near) > COARSE:
        near = [near[k] for k in np.unique(np.round(np.linspace(0, len(near) - 1, COARSE)).astype(int))]
    own = [c for c in candidates if c.point.csd in settings.predicted]
    return _named(own, near, settings.main_levels, settings, batch=0)


def _beside(values: Sequence[float], near: Sequence[float]) -> set[int]:
    places = [k for k, value in enumerate(values) if np.isclose(near, value).any()]
    return {min(max(k, 0), len(values) - 1) for k in (places[0] - 1, places[-1] + 1)}


def responses_at(
    settings: Settings, simulated: pd.DataFrame, cakes: Iterable[Cake], beside: float | None
) -> dict[str, Responds]:
    """Smooth models of ln(alpha) by cake, at one value of what is held beside the first parameter or (None) over both.

    Cakes without enough accepted packings are left out.
    """
    good = simulated[simulated["status"] == "ok"]
    found = {cake_of(*cake): _responds(settings, _of_cake(good, *cake), beside) for cake in cakes}
    return {name: response for name, response in found.items() if response is not None}


def _responds(settings: Settings, rows: pd.DataFrame, beside: float | None) -> Responds | None:
    if beside is None and not settings.is_pressed:
        return _response(settings.parameters, rows)
    levels = settings.beside_levels if beside is None else (beside,)
    parts = [_response(settings.parameters[:1], rows[np.isclose(rows[settings.beside], at)]) for at in levels]
    along = [part for part in parts if part is not None]
    if len(along) < len(levels):
        return None
    if beside is not None:
        return along[0]
    return SharedResponse((settings.parameters[0], settings.parameters[1]), levels, along)


def _of_cake(rows: pd.DataFrame, csd: str, pressure: float | None) -> pd.DataFrame:
    own = rows[rows["csd"] == csd]
    return own if pressure is None else own[np.isclose(own["pressure_kPa"], pressure)]


def _response(parameters: Sequence[Parameter], rows: pd.DataFrame) -> Response | None:
    """Smooth model of accepted packings over some parameters; None where they are too few."""
    groups = rows.groupby([parameter.name for parameter in parameters])["ln_resistance"]
    samples = [(key, values.to_numpy(np.float64)) for key, values in groups]
    if len(samples) < 3 or not any(values.size > 1 for _, values in samples):
        return None
    return Response(
        parameters, np.array([key for key, _ in samples], dtype=np.float64), [values for _, values in samples]
    )


def measured_cakes(observations: Sequence[Observation]) -> tuple[Cake, ...]:
    """List the cakes that were measured, each once."""
    return tuple(dict.fromkeys((item.csd, item.pressure_kPa) for item in observations))


def packed_correlation(settings: Settings, simulated: pd.DataFrame) -> float:
    """Correlation of one packing's ln(alpha) between the pressures that it was evaluated at, 0 to 1.

    Pooled over distributions and frictions, about their means, at one attraction; 0 where there is one pressure or
    none.
    """
    if len(settings.pressures_kPa) < 2:
        return 0.0
    rows = simulated[simulated["status"] == "ok"]
    rows = rows[np.isclose(rows[settings.beside], settings.beside_levels[-1])]
    who = ["csd", settings.first]
    wide = rows.pivot_table(index=[*who, "batch", "replicate"], columns="pressure_kPa", values="ln_resistance")
    apart = (wide - wide.groupby(level=who).transform("mean")).dropna()
    matrix = np.corrcoef(apart.to_numpy(np.float64).T)
    pairs = matrix[np.triu_indices_from(matrix, 1)]
    mean = float(np.mean(pairs[np.isfinite(pairs)])) if np.isfinite(pairs).any() else 1.0
    return min(max(mean, 0.0), 1.0)


def fit_main(settings: Settings, observations: Sequence[Observation], simulated: pd.DataFrame) -> Calibration:
    """Fit what counts, without rivals.

    Raises
    ------
    CalibrationError
        If a measured distribution has not enough packings.
    """
    responses = _main_responses(settings, observations, simulated)
    return calibrate(observations, responses, packed_correlation(settings, simulated))


def _main_responses(
    settings: Settings, observations: Sequence[Observation], simulated: pd.DataFrame
) -> dict[str, Responds]:
    cakes = measured_cakes(observations)
    responses = responses_at(settings, simulated, cakes, settings.fixed)
    shortage = shortage_of(cakes, responses, simulated, settings, settings.fixed)
    if shortage:
        raise CalibrationError(f"not enough accepted packings for a fit: {shortage}")
    return responses


def shortage_of(
    wanted: Sequence[Cake],
    found: Mapping[str, Responds],
    simulated: pd.DataFrame,
    settings: Settings,
    beside: float | None,
) -> str:
    """Distributions with too few accepted packings for a smooth model, in words; empty if none."""
    rows = simulated if beside is None else simulated[np.isclose(simulated[settings.beside], beside)]
    names = [settings.first] if settings.is_pressed else [settings.first, settings.beside]
    counts = []
    for csd in dict.fromkeys(csd for csd, pressure in wanted if cake_of(csd, pressure) not in found):
        own = rows[rows["csd"] == csd]
        made, good = (len(part[names].drop_duplicates()) for part in (own, own[own["status"] == "ok"]))
        counts.append(f"{csd} has them at {good} of {made} points")
    return f"{', '.join(counts)}; at least 3 are needed, one of them with two packings" if counts else ""


def conclude(settings: Settings, observations: Sequence[Observation], simulated: pd.DataFrame) -> Outcome:
    """Fit, compare with rivals, leave out one distribution at a time, and say what must be known.

    Raises
    ------
    CalibrationError
        If a measured distribution has not enough packings.
    """
    main = _main_responses(settings, observations, simulated)
    correlation = packed_correlation(settings, simulated)
    fit = calibrate(observations, main, correlation)
    by_level: dict[float | None, dict[str, Responds]] = {settings.fixed: main}
    rivals = {} if settings.fits_both else {settings.beside_levels[0]: fit}
    skipped = []
    cakes = measured_cakes(observations)
    for mu in () if settings.fits_both else settings.beside_levels[1:]:
        responses = by_level[mu] = responses_at(settings, simulated, cakes, mu)
        shortage = shortage_of(cakes, responses, simulated, settings, mu)
        if shortage:
            skipped.append(
                Finding("friction", f"a friction of {mu:g} is not compared, for want of accepted packings: {shortage}")
            )
        else:
            rivals[mu] = calibrate(observations, responses)
    compressibilities = tuple(_compressibilities(observations, fit, main, correlation))
    compared = compare_friction(rivals) if len(rivals) > 1 else ()
    friction = (*compared, *skipped, *_untested(settings), *_advice(settings))
    return Outcome(
        fit=fit,
        rivals=rivals,
        left_out=leave_one_out(observations, main, correlation),
        findings=(
            *settings.doubts,
            *_explained(settings, fit, simulated),
            *friction,
            *_soft(settings, fit),
            *_pressed_apart(compressibilities),
        ),
        responses={(name, mu): r for mu, responses in by_level.items() for name, r in responses.items()},
        packed_correlation=correlation,
        compressibilities=compressibilities,
    )


def _compressibilities(
    observations: Sequence[Observation], fit: Calibration, responses: Mapping[str, Responds], correlation: float
) -> Iterable[Compressibility]:
    """Compare measured and modelled exponents of the distributions that were measured at several pressures."""
    for csd in dict.fromkeys(item.csd for item in observations):
        own = [item for item in observations if item.csd == csd]
        drops = sorted({item.pressure_kPa for item in own if item.pressure_kPa is not None})
        if len(drops) < 2:
            continue
        modelled = slope(fit, np.log(drops), [responses[cake_of(csd, drop)] for drop in drops], correlation)
        pressures, errors = [item.pressure_kPa or math.nan for item in own], [item.standard_error for item in own]
        law = compressibility(pressures, [math.exp(item.ln_resistance) for item in own], errors)
        half = exponent_limit(law, pressures, errors)
        yield Compressibility(csd, drops[0], drops[-1], law.exponent, half, modelled)


def _pressed_apart(found: Iterable[Compressibility]) -> Iterable[Finding]:
    """Say which measured cakes change with pressure otherwise than pressed spheres do."""
    for item in found:
        if item.agree:
            continue
        more = item.measured > item.modelled.value
        why = "crystals that break, bend or are no spheres do" if more else "nothing in the packings explains that"
        yield Finding(
            "pressure",
            f"the resistance of {item.csd} rises {'faster' if more else 'more slowly'} with pressure than that of the "
            f"calibrated packings (exponent {item.measured:.2g} ± {item.measured_ci95:.1g} measured, "
            f"{item.modelled.value:.2g} from {item.modelled.low:.2g} to {item.modelled.high:.2g} packed): {why}",
        )


def _explained(settings: Settings, fit: Calibration, simulated: pd.DataFrame) -> tuple[Finding, ...]:
    """Return the findings of the fit, but for what points without accepted packings explain; those are named instead.

    Outside the values that were packed, only the smooth model's guess keeps a value in or out of the interval: what is
    not known there is no fault of the measurements.
    """
    first = settings.first
    rows = simulated[simulated["csd"].isin(settings.measured)]
    if not settings.fits_both:
        rows = rows[np.isclose(rows[settings.beside], settings.beside_levels[0])]
    good = rows[rows["status"] == "ok"]
    points = ["csd", first]
    failed = sorted(
        set(rows[points].itertuples(index=False, name=None)) - set(good[points].itertuples(index=False, name=None))
    )
    if not failed:
        return fit.findings
    packed = good.groupby("csd")[first]
    lowest, highest = float(packed.min().max()), float(packed.max().min())
    below = any(value < lowest for _, value in failed) and fit.estimates[0].low < lowest
    above = any(value > highest for _, value in failed) and fit.estimates[0].high > highest
    names = ", ".join(
        f"{csd} at {_listed([value for name, value in failed if name == csd], settings)}"
        for csd in dict.fromkeys(name for name, _ in failed)
    )
    text = f"no packing was accepted of {names} (column reason of replicates.csv)"
    if below or above:
        where = " and ".join([f"below {lowest:g}"] * below + [f"above {highest:g}"] * above)
        text += (
            f": {with_unit(first, where)} the interval is the smooth model's guess, not what the measurements say; "
            "make these packings possible (make retry, or the study's packing settings)"
        )
    explained = {"several", "flat"} if below or above else set()
    kept = [
        finding
        for finding in fit.findings
        if finding.kind not in explained
        and not (below and (finding.kind == "zero" or "lower end" in finding.text))
        and not (above and "upper end" in finding.text)
    ]
    return (Finding("failed", text), *kept)


def _untested(settings: Settings) -> tuple[Finding, ...]:
    """Return the finding that the measurements cannot test the friction taken, where they cannot."""
    if settings.is_pressed or len(settings.measured) > 1 or len(settings.beside_levels) > 1:
        return ()
    text = f"one measured distribution cannot test the friction taken, {settings.beside_levels[0]:g}: a cohesion makes"
    return (Finding("friction", f"{text} up for another one"),)


def _advice(settings: Settings) -> tuple[Finding, ...]:
    """Return the finding that the friction taken is not the one the paper advises, where it is not."""
    advised, taken = advised_friction(settings.implied_porosity), settings.beside_levels[0]
    if settings.is_pressed or settings.fits_both or np.isclose(taken, advised):
        return ()
    text = (
        f"the friction taken is {taken:g}; for the porosity that the measurements imply "
        f"({settings.implied_porosity:.3f}) the paper advises {advised:g}"
    )
    return (Finding("friction", text),)


def _soft(settings: Settings, fit: Calibration) -> tuple[Finding, ...]:
    high = fit.estimates[0].high
    if high <= settings.soft_above:
        return ()
    text = (
        f"the interval reaches {high:.3g} kJ/m3: above {settings.soft_above:.3g} kJ/m3 the softness of the contacts "
        "takes part in the answer; use a larger Young's modulus"
    )
    return (Finding("soft", text),)
