"""A calibration as a series of packings: what to pack next, the fit of what is there, and its tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from filtercake.calibration.fit import (
    Calibration,
    Finding,
    Observation,
    Parameter,
    Prediction,
    Response,
    advised_friction,
    calibrate,
    compare_friction,
    good_enough,
    leave_one_out,
    next_cohesions,
    pooled,
    predict,
)
from filtercake.crystals.csd import CrystalSizeDistribution, FullAndTruncated, read_tables
from filtercake.errors import CalibrationError
from filtercake.filtration.drum_filter import DrumFilter, area
from filtercake.filtration.resistance import ADDITIVE, implied_porosity, resistance
from filtercake.results.replicates import replicates_table
from filtercake.study.points import Point

BATCHES = 3
"""Sets of replicates that a point may get, one after the other, where the first do not suffice."""
COARSE = 6
"""Cohesions of the first round."""
MOST = 4
"""Cohesions added by a later one."""
SAFETY_FACTOR = 2.0
"""The paper's, on the predicted resistance."""
CURVE_POINTS = 101


@dataclass(frozen=True)
class Settings:
    """Settings of a calibration's jobs.

    Attributes
    ----------
    parameters : tuple of Parameter
        The fitted ones.
    frictions : tuple of float
        Frictions of the packings; unless the friction is fitted, the first is the one taken, the rest its rivals.
    measured, predicted : tuple of str
        Distributions with measurements, and those whose resistance is predicted.
    cohesions : tuple of float
        All that may be packed, ascending, kJ/m3.
    estimator : {"interior", "paper_count"}
        Porosity that the measured resistance is held against.
    rounds : int
        Largest number of rounds of packings.
    relative_ci95_target : float
        Half-width of the cohesion's interval over its value that ends them.
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
    """

    parameters: tuple[Parameter, ...]
    frictions: tuple[float, ...]
    measured: tuple[str, ...]
    predicted: tuple[str, ...]
    cohesions: tuple[float, ...]
    estimator: str
    rounds: int
    relative_ci95_target: float
    density: float
    sphericity: float
    implied_porosity: float
    soft_above: float
    doubts: tuple[Finding, ...] = ()
    resistance_law: str = ADDITIVE

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
    def fits_friction(self) -> bool:
        """Whether the friction is a fitted parameter."""
        return len(self.parameters) > 1

    @property
    def fixed_friction(self) -> float | None:
        """Coefficient of friction of the fit that counts; None where it is fitted."""
        return None if self.fits_friction else self.frictions[0]

    @property
    def main_frictions(self) -> tuple[float, ...]:
        """Frictions of the fit that counts, without rivals."""
        return self.frictions if self.fits_friction else self.frictions[:1]


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
class Outcome:
    """A calibration with all that follows from it.

    Attributes
    ----------
    fit : Calibration
        The one that counts.
    rivals : dict of float to Calibration
        Fits of the cohesion for every fixed friction, the one that counts included; empty where it is fitted.
    left_out : dict of str to float
        Error of predicting each distribution from the others, in ln(alpha).
    findings : tuple of Finding
        Findings about the fit.
    responses : dict of (str, float or None) to Response
        ln(alpha) by distribution and fixed friction (None where it is fitted).
    """

    fit: Calibration
    rivals: dict[float, Calibration]
    left_out: dict[str, float]
    findings: tuple[Finding, ...]
    responses: dict[tuple[str, float | None], Response]


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

    The columns are those of :func:`filtercake.results.replicates.replicates_table`, batch and ln_resistance.
    """
    listed = list(candidates)
    table = replicates_table([c.point for c in listed], packings, csds, settings.sphericity, settings.resistance_law)
    batches = {c.point.name: c.batch for c in listed}
    table["batch"] = table["point"].map(batches)
    law, material = settings.resistance_law, (settings.density, settings.sphericity)
    porosity = table["porosity" if settings.estimator == "interior" else "porosity_paper_count"]
    table["ln_resistance"] = [
        math.log(resistance(law, value, csds[str(csd)][0], *material)) if np.isfinite(value) else np.nan
        for value, csd in zip(porosity.to_list(), table["csd"], strict=True)
    ]
    return table


def choose_round(
    number: int,
    settings: Settings,
    candidates: Sequence[Candidate],
    visited: Sequence[str],
    observations: Sequence[Observation],
    simulated: pd.DataFrame | None,
) -> Round:
    """Decide what to pack in a round (numbered from 0), given the points of earlier rounds and what they gave.

    The first round is coarse. Later ones refine the cohesion where the interval still is, and, when every candidate
    there has been packed, add a batch of replicates.
    """
    own = [c for c in candidates if c.point.csd in settings.measured]
    if number == 0 or simulated is None:
        first = next_cohesions(None, settings.cohesions, [], COARSE, MOST)
        return Round(_named(own, first, settings.frictions, batch=0), finished=False, why="first look at the range")
    fit = fit_main(settings, observations, simulated)
    cohesion = fit.estimates[0]
    so_far = f"cohesion {cohesion.value:.3g} kJ/m3, 95 % interval {cohesion.low:.3g} to {cohesion.high:.3g}"
    if good_enough(fit, settings.relative_ci95_target):
        return Round((), finished=True, why=f"{so_far}: {_enough(fit, settings.relative_ci95_target)}")
    if number >= settings.rounds:
        return Round((), finished=True, why=f"{so_far}: the last of {settings.rounds} rounds")
    seen = sorted({_cohesion(c) for c in own if c.point.name in visited})
    wanted = next_cohesions(fit, settings.cohesions, seen, COARSE, MOST)
    if wanted:
        why = f"{so_far}: look closer at {', '.join(f'{value:g}' for value in wanted)} kJ/m3"
        return Round(_named(own, wanted, settings.main_frictions, batch=0), finished=False, why=why)
    near = next_cohesions(fit, settings.cohesions, [], COARSE, len(settings.cohesions))
    for batch in range(1, BATCHES):
        points = tuple(name for name in _named(own, near, settings.main_frictions, batch) if name not in visited)
        if points:
            why = f"{so_far}: more replicates at {', '.join(f'{value:g}' for value in near)} kJ/m3"
            return Round(points, finished=False, why=why)
    return Round((), finished=True, why=f"{so_far}: every candidate has its {BATCHES} batches")


def _enough(fit: Calibration, target: float) -> str:
    cohesion = fit.estimates[0]
    if cohesion.half_width <= target * cohesion.value:
        return f"within {100.0 * target:g} %"
    return f"more packings would not narrow it, they make {100.0 * fit.model_share:.0f} % of the variance"


def _named(
    candidates: Sequence[Candidate], cohesions: Sequence[float], frictions: Sequence[float], batch: int
) -> tuple[str, ...]:
    return tuple(
        c.point.name
        for c in candidates
        if c.batch == batch
        and np.isclose(cohesions, _cohesion(c)).any()
        and np.isclose(frictions, c.point.scene.friction).any()
    )


def _cohesion(candidate: Candidate) -> float:
    return float(candidate.point.row()["cohesion_kJ_m3"])


def prediction_points(settings: Settings, candidates: Sequence[Candidate], fit: Calibration) -> tuple[str, ...]:
    """Points at which the distributions to predict are packed: those that the interval spans, and their neighbours."""
    near = next_cohesions(fit, settings.cohesions, [], COARSE, len(settings.cohesions))
    values = list(settings.cohesions)
    while len(near) < min(4, len(values)):  # a curve needs more than two points
        near = sorted({*near, *(values[k] for k in _beside(values, near))})
    if len(near) > COARSE:
        near = [near[k] for k in np.unique(np.round(np.linspace(0, len(near) - 1, COARSE)).astype(int))]
    own = [c for c in candidates if c.point.csd in settings.predicted]
    return _named(own, near, settings.main_frictions, batch=0)


def _beside(values: Sequence[float], near: Sequence[float]) -> set[int]:
    places = [k for k, value in enumerate(values) if np.isclose(near, value).any()]
    return {min(max(k, 0), len(values) - 1) for k in (places[0] - 1, places[-1] + 1)}


def responses_at(
    settings: Settings, simulated: pd.DataFrame, names: Iterable[str], friction: float | None
) -> dict[str, Response]:
    """Smooth models of ln(alpha) by distribution, at one friction or (None) over cohesion and friction.

    Distributions without enough accepted packings are left out.
    """
    columns = [parameter.name for parameter in settings.parameters]
    parameters = settings.parameters if friction is None else settings.parameters[:1]
    good = simulated[simulated["status"] == "ok"]
    if friction is not None:
        good = good[np.isclose(good["friction"], friction)]
    found = {}
    for name in names:
        groups = good[good["csd"] == name].groupby(columns[: len(parameters)])["ln_resistance"]
        samples = [(key, values.to_numpy(np.float64)) for key, values in groups]
        if len(samples) >= 3 and any(values.size > 1 for _, values in samples):
            found[name] = Response(
                parameters, np.array([key for key, _ in samples], dtype=np.float64), [values for _, values in samples]
            )
    return found


def fit_main(settings: Settings, observations: Sequence[Observation], simulated: pd.DataFrame) -> Calibration:
    """Fit what counts, without rivals.

    Raises
    ------
    CalibrationError
        If a measured distribution has not enough packings.
    """
    return calibrate(observations, _main_responses(settings, simulated))


def _main_responses(settings: Settings, simulated: pd.DataFrame) -> dict[str, Response]:
    friction = settings.fixed_friction
    responses = responses_at(settings, simulated, settings.measured, friction)
    shortage = _shortage(settings.measured, responses, simulated, friction)
    if shortage:
        raise CalibrationError(f"not enough accepted packings for a fit: {shortage}")
    return responses


def _shortage(
    wanted: Sequence[str], found: Mapping[str, Response], simulated: pd.DataFrame, friction: float | None
) -> str:
    """Distributions with too few accepted packings for a smooth model, in words; empty if none."""
    rows = simulated if friction is None else simulated[np.isclose(simulated["friction"], friction)]
    counts = []
    for name in [name for name in wanted if name not in found]:
        own = rows[rows["csd"] == name]
        made, good = (
            len(part[["cohesion_kJ_m3", "friction"]].drop_duplicates()) for part in (own, own[own["status"] == "ok"])
        )
        counts.append(f"{name} has them at {good} of {made} points")
    return f"{', '.join(counts)}; at least 3 are needed, one of them with two packings" if counts else ""


def conclude(settings: Settings, observations: Sequence[Observation], simulated: pd.DataFrame) -> Outcome:
    """Fit, compare with rivals, leave out one distribution at a time, and say what must be known.

    Raises
    ------
    CalibrationError
        If a measured distribution has not enough packings.
    """
    main = _main_responses(settings, simulated)
    fit = calibrate(observations, main)
    by_friction: dict[float | None, dict[str, Response]] = {settings.fixed_friction: main}
    rivals = {} if settings.fits_friction else {settings.frictions[0]: fit}
    skipped = []
    for mu in () if settings.fits_friction else settings.frictions[1:]:
        responses = by_friction[mu] = responses_at(settings, simulated, settings.measured, mu)
        shortage = _shortage(settings.measured, responses, simulated, mu)
        if shortage:
            skipped.append(
                Finding("friction", f"a friction of {mu:g} is not compared, for want of accepted packings: {shortage}")
            )
        else:
            rivals[mu] = calibrate(observations, responses)
    compared = compare_friction(rivals) if rivals else ()
    friction = (*compared, *skipped, *_untested(settings), *_advice(settings, fit))
    return Outcome(
        fit=fit,
        rivals=rivals,
        left_out=leave_one_out(observations, main),
        findings=(*settings.doubts, *_explained(settings, fit, simulated), *friction, *_soft(settings, fit)),
        responses={(name, mu): r for mu, responses in by_friction.items() for name, r in responses.items()},
    )


def _explained(settings: Settings, fit: Calibration, simulated: pd.DataFrame) -> tuple[Finding, ...]:
    """Return the findings of the fit, but for what points without accepted packings explain; those are named instead.

    Outside the cohesions that were packed, only the smooth model's guess keeps a cohesion in or out of the interval:
    what is not known there is no fault of the measurements.
    """
    rows = simulated[simulated["csd"].isin(settings.measured)]
    if not settings.fits_friction:
        rows = rows[np.isclose(rows["friction"], settings.frictions[0])]
    good = rows[rows["status"] == "ok"]
    points = ["csd", "cohesion_kJ_m3"]
    failed = sorted(
        set(rows[points].itertuples(index=False, name=None)) - set(good[points].itertuples(index=False, name=None))
    )
    if not failed:
        return fit.findings
    packed = good.groupby("csd")["cohesion_kJ_m3"]
    lowest, highest = float(packed.min().max()), float(packed.max().min())
    below = any(value < lowest for _, value in failed) and fit.estimates[0].low < lowest
    above = any(value > highest for _, value in failed) and fit.estimates[0].high > highest
    names = ", ".join(
        f"{csd} at {', '.join(f'{value:g}' for name, value in failed if name == csd)} kJ/m3"
        for csd in dict.fromkeys(name for name, _ in failed)
    )
    text = f"no packing was accepted of {names} (column reason of replicates.csv)"
    if below or above:
        where = " and ".join([f"below {lowest:g}"] * below + [f"above {highest:g}"] * above)
        text += (
            f": {where} kJ/m3 the interval is the smooth model's guess, not what the measurements say; make these "
            "packings possible (make retry, or the study's packing settings)"
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
    """Return the finding that the measurements cannot test the friction, where they cannot."""
    if len(settings.measured) > 1 or len(settings.frictions) > 1:
        return ()
    text = f"one measured distribution cannot test the friction taken, {settings.frictions[0]:g}: a cohesion makes up"
    return (Finding("friction", f"{text} for another one"),)


def _advice(settings: Settings, fit: Calibration) -> tuple[Finding, ...]:
    """Return the finding that the friction taken is not the one the paper advises, where it is not."""
    advised = advised_friction(settings.implied_porosity)
    taken = fit.best[1] if settings.fits_friction else settings.frictions[0]
    if settings.fits_friction or np.isclose(taken, advised):
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


def summary(outcome: Outcome, settings: Settings, why: str) -> dict[str, Any]:
    """Return the outcome as plain values, fit for JSON."""
    fit = outcome.fit
    return {
        "parameters": {
            e.parameter.name: {"value": e.value, "low": e.low, "high": e.high, "regions": e.regions}
            for e in fit.estimates
        },
        "friction": settings.fixed_friction,
        "threshold": fit.threshold,
        "scale_freedom": fit.scale_freedom if math.isfinite(fit.scale_freedom) else None,
        "chi_square": fit.chi_square,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "discrepancy": fit.discrepancy,
        "share_of_packings_in_variance": fit.model_share,
        "implied_porosity": settings.implied_porosity,
        "resistance_law": settings.resistance_law,
        "estimator": settings.estimator,
        "ended": why,
        "findings": [asdict(finding) for finding in outcome.findings],
        "rivals": {
            f"{mu:g}": {
                "chi_square": rival.chi_square,
                "cohesion_kJ_m3": rival.best[0],
                "low": rival.estimates[0].low,
                "high": rival.estimates[0].high,
            }
            for mu, rival in outcome.rivals.items()
        },
    }


def parity_table(outcome: Outcome, settings: Settings, observations: Sequence[Observation]) -> pd.DataFrame:
    """Tabulate measured against modelled resistances at the calibrated parameters, one row per measurement.

    ``relative_uncertainty`` is as the fit takes it: with the scatter of measurements that contradict each other.
    ``left_out_m_kg`` is the resistance that the other distributions predict for this one; ``left_out_ln_error`` its
    error, in ln(alpha), against the weighted mean of the distribution's measurements. ``scatter_freedom`` are the
    degrees of freedom of that scatter; blank where the errors are known.
    """
    friction = settings.fixed_friction
    means = pooled(observations)
    rows = []
    for item in observations:
        response = outcome.responses[item.csd, friction]
        mean, variance = response(np.array([outcome.fit.best]))
        whole = predict(outcome.fit, response)
        rows.append(
            {
                "measurement": item.name,
                "csd": item.csd,
                "measured_m_kg": math.exp(item.ln_resistance),
                "relative_uncertainty": math.hypot(item.standard_error, means[item.csd].scatter),
                "scatter_freedom": freedom if math.isfinite(freedom := means[item.csd].freedom) else math.nan,
                "modelled_m_kg": math.exp(float(mean[0])),
                "modelled_low_m_kg": whole.low,
                "modelled_high_m_kg": whole.high,
                "packings_relative_error": math.sqrt(float(variance[0])),
                "left_out_m_kg": math.exp(means[item.csd].mean + outcome.left_out[item.csd])
                if item.csd in outcome.left_out
                else math.nan,
                "left_out_ln_error": outcome.left_out.get(item.csd, math.nan),
            }
        )
    return pd.DataFrame(rows)


def objective_table(outcome: Outcome, settings: Settings) -> pd.DataFrame:
    """Tabulate the objective: cohesion_kJ_m3, friction, deviance; for every fixed friction, or over both."""
    parts = []
    if settings.fits_friction:
        cohesion, friction = np.meshgrid(*outcome.fit.axes, indexing="ij")
        columns = {"cohesion_kJ_m3": cohesion.ravel(), "friction": friction.ravel()}
        return pd.DataFrame({**columns, "deviance": outcome.fit.deviance.ravel()})
    for mu, fit in outcome.rivals.items():
        parts.append(pd.DataFrame({"cohesion_kJ_m3": fit.axes[0], "friction": mu, "deviance": fit.deviance}))
    return pd.concat(parts, ignore_index=True)


def response_table(outcome: Outcome, settings: Settings) -> pd.DataFrame:
    """Tabulate the smooth models: csd, friction, cohesion_kJ_m3, resistance_m_kg and its relative standard error."""
    cohesion = settings.parameters[0]
    values = np.linspace(cohesion.low, cohesion.high, CURVE_POINTS)
    parts = []
    for (name, mu), response in outcome.responses.items():
        at = outcome.fit.best[1] if mu is None else mu
        points = values[:, None] if mu is not None else np.column_stack([values, np.full(values.size, at)])
        mean, variance = response(points)
        parts.append(
            pd.DataFrame(
                {
                    "csd": name,
                    "friction": at,
                    "cohesion_kJ_m3": values,
                    "resistance_m_kg": np.exp(mean),
                    "relative_error": np.sqrt(variance),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def prediction_table(
    outcome: Outcome,
    settings: Settings,
    simulated: pd.DataFrame,
    csds: Mapping[str, CrystalSizeDistribution],
    drum: DrumFilter | None = None,
    slurry_flow: float = 0.0,
) -> pd.DataFrame:
    """Predict the distributions never tested, with the safety factor of the paper beside the interval's upper end.

    Parameters
    ----------
    outcome, settings : Outcome, Settings
        The calibration.
    simulated : DataFrame
        Packings of the distributions to predict (see :func:`simulate`).
    csds : mapping of str to CrystalSizeDistribution
        The full distributions.
    drum, slurry_flow : DrumFilter or None, float
        Filter whose area is wanted, and the slurry that it must take, m3/s.

    Raises
    ------
    CalibrationError
        If a distribution has not enough packings.
    """
    friction = settings.fixed_friction
    responses = responses_at(settings, simulated, settings.predicted, friction)
    shortage = _shortage(settings.predicted, responses, simulated, friction)
    if shortage:
        raise CalibrationError(f"not enough accepted packings for a prediction: {shortage}")
    return pd.DataFrame(
        [
            _prediction_row(name, predict(outcome.fit, responses[name]), csds[name], settings, drum, slurry_flow)
            for name in settings.predicted
        ]
    )


def _prediction_row(
    name: str,
    found: Prediction,
    csd: CrystalSizeDistribution,
    settings: Settings,
    drum: DrumFilter | None,
    slurry_flow: float,
) -> dict[str, Any]:
    ends = (found.resistance, found.low, found.high)
    row: dict[str, Any] = {"csd": name}
    row.update(zip(("resistance_m_kg", "resistance_low_m_kg", "resistance_high_m_kg"), ends, strict=True))
    # the porosity falls as the resistance rises: its ends change places
    material = (settings.density, settings.sphericity, settings.resistance_law)
    porosities = [implied_porosity(alpha, csd, *material) for alpha in ends]
    row.update(zip(("porosity", "porosity_high", "porosity_low"), porosities, strict=True))
    row["high_over_resistance"] = found.high / found.resistance
    row["resistance_with_safety_factor_m_kg"] = SAFETY_FACTOR * found.resistance
    if drum is not None:
        areas = area(drum, np.array([*ends, SAFETY_FACTOR * found.resistance]), slurry_flow)
        names = ("filter_area_m2", "filter_area_low_m2", "filter_area_high_m2", "filter_area_with_safety_factor_m2")
        row.update(zip(names, (float(value) for value in areas), strict=True))
    return row
