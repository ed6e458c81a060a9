"""Run time against error: variants of one scene settled in turn, each ensemble held against a reference ensemble.

Packings are chaotic: an error is a property of an ensemble. Each variant's bias is its mean porosity minus the
reference's, its spread that of one packing; the root mean square of both is the error of a single packing.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution, truncate
from filtercake.packing.analytic_models import PEERS
from filtercake.packing.engines import ENGINES
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.engines.liggghts import Liggghts
from filtercake.packing.engines.liggghts_as_published import LiggghtsAsPublished
from filtercake.packing.pack import Report
from filtercake.packing.scene import Scene
from filtercake.statistics import (
    difference_half_width,
    effective_freedom,
    paired_half_width,
    pooled_spread,
    quantile,
    standard_error,
)
from filtercake.study import limits
from filtercake.units import GRAVITY, MEGAPASCAL, MICROMETRE, MICROSECOND, FloatArray
from filtercake.validation.timing import Contender, contender, settle_timed, warm_up

ESTIMATORS = {
    "porosity": "interior slab",
    "porosity_from_floor": "slab from the floor",
    "porosity_paper_count": "count",
}
"""Estimators of the porosity by column: all are measured on the same packings."""
DEFAULT, ANALYTIC = "default", "analytic"
"""Axes of the variant that the configuration's defaults make, and of models without packings."""
AS_PUBLISHED_STEP = {"pmma": 0.1 * MICROSECOND, "alum": 0.5 * MICROSECOND}
ALUM_STEPS = 120_000
ALUM_SKIN = 10.0 * MICROMETRE
TOLERANCE = 0.2
"""Relative uncertainty of a measured time, within which no variant counts as better than another."""
PEER_CALLS = 20

VARIANT_COLUMNS = ("case", "axis", "value", "engine", "particles")
COLUMNS = (
    *VARIANT_COLUMNS,
    "estimator",
    "n",
    "n_failed",
    "seconds",
    "porosity",
    "sd",
    "bias",
    "bias_se",
    "bias_ci95",
    "error",
    "resistance_error",
)

REFERENCE_COLUMNS = (
    "study",
    "csd",
    "cohesion_kJ_m3",
    "friction",
    "engine",
    "particles",
    "replicate",
    "seed",
    "status",
    "reason",
    "porosity",
    "porosity_paper_count",
    "overlap_max",
    "steps",
    "wall_s",
)
"""Columns of ``replicates.csv`` that are kept of the reference ensembles."""


@dataclass(frozen=True)
class Variant:
    """One way to make packings of a scene.

    Attributes
    ----------
    axis : str
        What differs from the default.
    value : float
        How much of it.
    contender : Contender
        What is packed and by what.
    replicates : int
        Packings of the ensemble.
    """

    axis: str
    value: float
    contender: Contender
    replicates: int


@dataclass(frozen=True)
class Reference:
    """Porosity that errors are measured against.

    Attributes
    ----------
    porosity, standard_error : float
        Mean of the reference ensemble's interior porosity, and its standard error.
    freedom : float
        Degrees of freedom of the latter; infinite where it is known.
    """

    porosity: float
    standard_error: float
    freedom: float = math.inf


def variants(case: str, base: Scene, full: CrystalSizeDistribution, quick: bool = False) -> list[Variant]:
    """List a case's variants, the default first.

    Parameters
    ----------
    case : {"pmma", "pmma_friction", "alum", "alum_wide"}
        Which case.
    base : Scene
        The scene at the configuration's defaults.
    full : CrystalSizeDistribution
        The whole distribution.
    quick : bool
        A quarter of the packings, and of the slow variants none.
    """
    make = _Maker(base, full)
    listed = {"pmma": _pmma, "pmma_friction": _pmma_friction, "alum": _alum, "alum_wide": _alum_wide}[case](make)
    if not quick:
        return listed
    kept = [variant for variant in listed if variant.replicates >= QUICK_LEAST or variant.axis == DEFAULT]
    return [replace(variant, replicates=max(2, variant.replicates // 4)) for variant in kept]


QUICK_LEAST = 8
"""Replicates under which a variant is left out of a quick run: those that take long have few."""


class _Maker:
    """Makes variants of one scene."""

    def __init__(self, base: Scene, full: CrystalSizeDistribution):
        self.base, self.full = replace(base, engine=Embedded.name, processes=1), full

    def default(self, replicates: int) -> Variant:
        return self.one(DEFAULT, self.base.rayleigh_fraction, replicates)

    def one(self, axis: str, value: float, replicates: int, *, engine: str = Embedded.name, **changed: Any) -> Variant:
        return Variant(axis, value, contender(engine, replace(self.base, **changed)), replicates)

    def time_steps(self, given: Mapping[float, int], engine: str = Embedded.name) -> list[Variant]:
        return [
            self.one("time step", value, n, engine=engine, time_step=self.base.with_time_step(value).time_step)
            for value, n in given.items()
        ]

    def narrower(self, given: Mapping[int, int]) -> list[Variant]:
        """Fewer spheres in a narrower box, as deep: what the porosity depends on stays."""
        return [
            self.one(
                "narrower bed",
                particles,
                replicates,
                particles=particles,
                bed_depth_factor=self.base.bed_depth_factor * math.sqrt(self.base.particles / particles),
            )
            for particles, replicates in given.items()
        ]

    def truncations(self, given: Mapping[float, int]) -> list[Variant]:
        found = []
        for value, replicates in given.items():
            scene = replace(self.base, csd=truncate(self.full, value).csd).with_time_step(self.base.rayleigh_fraction)
            found.append(Variant("truncation", value, contender(Embedded.name, scene), replicates))
        return found

    def softer(self, given: Mapping[float, int]) -> list[Variant]:
        """Softer contacts of the same sticking speed."""
        return [
            self.one("softer contacts", value, replicates, **_of_modulus(self.base, value * MEGAPASCAL))
            for value, replicates in given.items()
        ]

    def liggghts(self, replicates: int) -> list[Variant]:
        return [self.one("engine", 0.0, replicates, engine=Liggghts.name)] if _runs(Liggghts.name) else []

    def as_published(self, replicates: int, step: float, steps: int, skin: float = 0.0) -> list[Variant]:
        if not _runs(LiggghtsAsPublished.name):
            return []
        made = contender(LiggghtsAsPublished.name, self.base, step, skin, steps)
        return [Variant("as published", float(steps), made, replicates)]


def _of_modulus(scene: Scene, youngs_modulus: float) -> dict[str, Any]:
    """Contacts of another stiffness (Pa) and the same sticking speed: s ~ E^0.8, at the same Rayleigh fraction."""
    cohesion = scene.cohesion * (youngs_modulus / scene.youngs_modulus) ** 0.8
    made = replace(scene, youngs_modulus=youngs_modulus, cohesion=cohesion).with_time_step(scene.rayleigh_fraction)
    return {name: getattr(made, name) for name in ("youngs_modulus", "cohesion", "time_step")}


def _runs(engine: str) -> bool:
    return ENGINES[engine]().why_missing() is None


def _pmma(make: _Maker) -> list[Variant]:
    listed = [make.default(32)]
    listed += make.time_steps({0.06: 4, 0.12: 6, 0.2: 8, 0.36: 16, 0.65: 16, 0.8: 16, 0.95: 16})
    listed += [make.one("spheres", n, k, particles=n) for n, k in {500: 32, 1000: 24, 4000: 8}.items()]
    listed += make.narrower({500: 32, 1000: 24})
    listed += [make.one("stop tolerance", value, 12, porosity_tolerance=value) for value in (1e-3, 3e-4, 3e-5)]
    listed += [make.one("skin", value, 8, skin=value * MICROMETRE) for value in (1.0, 5.0)]
    listed += make.softer({2.5: 16, 1.0: 16})
    listed += make.liggghts(10)
    if _runs(Liggghts.name):
        listed += make.time_steps({0.2: 4}, Liggghts.name)
        listed += [make.one("skin", 10.0, 4, engine=Liggghts.name, skin=10.0 * MICROMETRE)]
    return listed + make.as_published(3, AS_PUBLISHED_STEP["pmma"], LiggghtsAsPublished.fixed_steps)


def _pmma_friction(make: _Maker) -> list[Variant]:
    listed = [make.default(20)]
    listed += make.time_steps({0.12: 6, 0.28: 12, 0.36: 12, 0.5: 12})
    listed += [make.one("spheres", 1000, 16, particles=1000)]
    return listed + make.liggghts(4)


def _alum(make: _Maker) -> list[Variant]:
    listed = [make.default(48)]
    listed += make.time_steps({0.2: 4, 0.36: 8, 0.65: 8, 0.8: 8})
    # a few thousand spheres hold no large one when the countless small ones take part: less truncation needs millions
    listed += make.truncations({0.003: 8, 0.01: 8})
    return listed + make.liggghts(2)


def _alum_wide(make: _Maker) -> list[Variant]:
    listed = [make.default(12)]
    listed += make.time_steps({0.65: 8, 0.8: 8})
    listed += make.narrower({5000: 24, 10_000: 16})
    return listed + make.as_published(1, AS_PUBLISHED_STEP["alum"], ALUM_STEPS, ALUM_SKIN)


def time_variants(listed: Iterable[Variant], report: Report = lambda _: None) -> pd.DataFrame:
    """Settle every variant's replicate k before any replicate k + 1, so that a change of the machine's pace hits all.

    Returns
    -------
    DataFrame
        One row per packing: axis, value, engine, particles and what
        :func:`filtercake.validation.timing.settle_timed` measures.
    """
    chosen = list(listed)
    for variant in chosen:
        warm_up(variant.contender)
    rows = []
    for replicate in range(max(variant.replicates for variant in chosen)):
        for variant in chosen:
            if replicate >= variant.replicates:
                continue
            scene = variant.contender.scene
            row = {"axis": variant.axis, "value": variant.value, "engine": scene.engine, "particles": scene.particles}
            rows.append({**row, **settle_timed(variant.contender, replicate)})
            last = rows[-1]
            report(
                f"{scene.engine}, {variant.axis} {variant.value:g}, r{replicate}: {last['wall_s']:.1f} s, "
                f"porosity {last['porosity']:.4f} {'' if last['status'] == 'ok' else last['status']}"
            )
    return pd.DataFrame(rows)


def time_peers(csd: CrystalSizeDistribution) -> pd.DataFrame:
    """Evaluate the analytic packing models, in the columns of :func:`time_variants`."""
    rows = []
    for name, model in PEERS.items():
        model(csd)
        started = time.perf_counter()
        for _ in range(PEER_CALLS):
            porosity = model(csd)
        seconds = (time.perf_counter() - started) / PEER_CALLS
        row = {"axis": ANALYTIC, "value": 0.0, "engine": name, "particles": 0, "replicate": 0, "steps": 0}
        rows.append({**row, "status": "ok", "wall_s": seconds, "porosity": porosity})
    return pd.DataFrame(rows)


def errors(case: str, timings: pd.DataFrame, reference: Reference) -> pd.DataFrame:
    """Measure every variant's error, by every estimator of the porosity.

    Parameters
    ----------
    case : str
        For the table.
    timings : DataFrame
        Of :func:`time_variants` and :func:`time_peers`.
    reference : Reference
        What the interior porosity should be.

    Returns
    -------
    DataFrame
        One row per variant and estimator, ``COLUMNS``: seconds (median of one packing), porosity (mean), sd (of one
        packing), bias, its standard error and the half-width of its 95 % interval (Welch), error (root mean square of
        bias and sd), resistance_error (root mean square relative error of a Kozeny-Carman resistance). What needs the
        spread is nan for a single packing.
    """
    rows = []
    for key, group in timings.groupby(list(VARIANT_COLUMNS[1:]), sort=False):
        good = group[group["status"] == "ok"]
        for column, name in ESTIMATORS.items():
            if column not in good:
                continue
            values = good[column].dropna().to_numpy(np.float64)
            if not values.size and column != "porosity":
                continue  # one line says that nothing was accepted
            rows.append(
                {
                    "case": case,
                    **dict(zip(VARIANT_COLUMNS[1:], key, strict=True)),
                    "estimator": name,
                    "n": values.size,
                    "n_failed": len(group) - len(good),
                    "seconds": float(group["wall_s"].median()),
                    # a model's value has no spread
                    **_error(np.repeat(values, 2) if key[0] == ANALYTIC else values, reference),
                }
            )
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _error(values: FloatArray, reference: Reference) -> dict[str, float]:
    if not values.size:
        return dict.fromkeys(COLUMNS[-7:], math.nan)
    spread, own = pooled_spread([values]), standard_error(values)
    freedom = effective_freedom([own**2, reference.standard_error**2], [spread.freedom, reference.freedom])
    bias_se = math.hypot(own, reference.standard_error)
    bias = float(values.mean()) - reference.porosity
    squared = bias**2 - bias_se**2  # the noise of the mean is no bias
    resistance = np.array([_flow_factor(value) for value in values]) / _flow_factor(reference.porosity) - 1.0
    return {
        "porosity": float(values.mean()),
        "sd": spread.sd,
        "bias": bias,
        "bias_se": bias_se,
        "bias_ci95": quantile(freedom) * bias_se,
        "error": math.sqrt((0.0 if squared < 0.0 else squared) + spread.sd**2),
        "resistance_error": float(np.sqrt(np.mean(resistance**2))),
    }


def _flow_factor(porosity: float) -> float:
    """Return what the resistance depends on: (1 - eps) / eps^3."""
    return (1.0 - porosity) / porosity**3


def reference_of(table: pd.DataFrame, study: str, friction: float) -> Reference:
    """Mean interior porosity of a reference ensemble.

    Parameters
    ----------
    table : DataFrame
        The committed reference: rows of ``replicates.csv``.
    study : str
        Name of the study that made it.
    friction : float
        Which of its points.

    Raises
    ------
    ValueError
        If the table holds no such ensemble.
    """
    here = (table["study"] == study) & np.isclose(table["friction"], friction) & (table["status"] == "ok")
    values = table.loc[here, "porosity"].to_numpy(np.float64)
    if values.size < 2:
        raise ValueError(f"the reference holds no ensemble of {study} at friction {friction:g}")
    return Reference(float(values.mean()), standard_error(values), values.size - 1.0)


def on_front(table: pd.DataFrame, tolerance: float = TOLERANCE) -> pd.Series[bool]:
    """Say which rows no other beats in both time and error by more than such a measurement can tell.

    That is a tolerance, and of the error at least one standard error of the ratio of two spreads, from as many packings
    as there are. Analytic models neither count nor beat: they know nothing of cohesion and friction, and what they hit
    they hit by chance.

    Parameters
    ----------
    table : DataFrame
        Rows with the columns axis, n, seconds and error.
    tolerance : float
        Relative.
    """
    seconds, error = table["seconds"].to_numpy(np.float64), table["error"].to_numpy(np.float64)
    packed = (table["axis"] != ANALYTIC).to_numpy()
    # relative variance of a standard deviation
    variance = 0.5 / np.maximum(table["n"].to_numpy(np.float64) - 1.0, 0.5)
    margin = np.maximum(tolerance, np.sqrt(variance[:, None] + variance[None, :]))
    faster = seconds[None, :] < (1.0 - tolerance) * seconds[:, None]
    better = packed[None, :] & faster & (error[None, :] < (1.0 - margin) * error[:, None])
    return pd.Series(~better.any(axis=1) & packed & np.isfinite(error), index=table.index)


@dataclass(frozen=True)
class Choice:
    """One choice that the model leaves open, and another way to make it."""

    choice: str
    base: str
    other: str
    variant: Variant
    against: Variant


def choices(base: Scene, replicates: int) -> list[Choice]:
    """List what the paper's model leaves open, each with the ensemble that shows what it does.

    Parameters
    ----------
    base : Scene
        The scene at the defaults.
    replicates : int
        Packings of each ensemble.
    """
    make = _Maker(base, base.csd)
    default = make.default(replicates)

    def dropped(times: float) -> float:
        return math.sqrt(base.settling_velocity**2 + 2.0 * GRAVITY * (times - 1.0) * base.cloud_height)

    stiffer = _of_modulus(base, 50.0 * MEGAPASCAL)
    frictional = base.with_time_step(limits.default_time_step(0.05))
    listed: list[tuple[str, str, str, dict[str, Any]]] = [
        ("drop height", "the paper's", "2 times", {"settling_velocity": dropped(2.0)}),
        ("drop height", "the paper's", "10 times", {"settling_velocity": dropped(10.0)}),
        ("initial speed", "0.01 m/s", "0", {"settling_velocity": 0.0}),
        ("initial void fraction", f"{base.initial_void_fraction:g}", "0.55", {"initial_void_fraction": 0.55}),
        ("initial void fraction", f"{base.initial_void_fraction:g}", "0.8", {"initial_void_fraction": 0.8}),
        ("depth of the bed", "2 L of cloud", "4 L of cloud, as many spheres", {"bed_depth_factor": 2.0}),
        ("number of spheres", f"{base.particles:,}", f"{4 * base.particles:,}", {"particles": 4 * base.particles}),
        (
            "soft contacts",
            f"E = 5 MPa ({base.relative_overlap:.2%} overlap)",
            "E = 50 MPa, same sticking speed",
            stiffer,
        ),
        ("friction of the crystals", "0", "0.05", {"friction": 0.05, "time_step": frictional.time_step}),
    ]
    return [
        Choice(choice, own, other, make.one(choice, float(k), replicates, **changed), default)
        for k, (choice, own, other, changed) in enumerate(listed)
    ]


def choice_table(
    timings: pd.DataFrame, listed: Iterable[Choice], full: CrystalSizeDistribution, packed: CrystalSizeDistribution
) -> pd.DataFrame:
    """Tabulate what each choice changes: porosity and resistance, with 95 % intervals.

    Parameters
    ----------
    timings : DataFrame
        Of :func:`time_variants`, of the choices' variants and the default.
    listed : iterable of Choice
        The choices.
    full, packed : CrystalSizeDistribution
        A distribution whole and as it is packed: what truncation changes in the resistance law itself.
    """
    good = timings[timings["status"] == "ok"]
    default = good[good["axis"] == DEFAULT]
    own = default["porosity"].to_numpy(np.float64)
    rows = []
    for k, item in enumerate(listed):
        mine = good[(good["axis"] == item.choice) & (good["value"] == float(k))]["porosity"].to_numpy(np.float64)
        rows.append(
            {
                "choice": item.choice,
                "model": item.base,
                "other": item.other,
                **_change(own, mine, difference_half_width),
            }
        )
    for column, name in list(ESTIMATORS.items())[1:]:
        counted = default[column].to_numpy(np.float64)  # of the same packings
        rows.append(
            {
                "choice": "floor layer" if column == "porosity_from_floor" else "whole spheres by centre",
                "model": "interior slab",
                "other": name,
                **_change(own, counted, paired_half_width),
            }
        )
    rows.append(
        {
            "choice": "truncation, in the resistance law",
            "model": "full distribution",
            "other": "as packed",
            "porosity_change": 0.0,
            "porosity_change_ci95": 0.0,
            "resistance_change": packed.sum_x_over_d2 / full.sum_x_over_d2 - 1.0,
        }
    )
    return pd.DataFrame(rows)


def _change(
    own: FloatArray, other: FloatArray, half_width: Callable[[FloatArray, FloatArray], float]
) -> dict[str, float]:
    mean, changed = float(own.mean()), float(other.mean())
    return {
        "porosity_change": changed - mean,
        "porosity_change_ci95": half_width(own, other),
        "resistance_change": _flow_factor(changed) / _flow_factor(mean) - 1.0,
    }
