"""What :mod:`filtercake.packing.spread` knows, fitted to every committed ensemble of packings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL, Scene
from filtercake.packing.spread import (
    COUNT_POWER,
    EVENNESS_POWER,
    FRICTION_COUNTS,
    INTERIOR_POWER,
    REFERENCE_SPHERES,
    SD,
    effective_spheres,
    interior_share,
    known_spread,
)
from filtercake.statistics import pooled_spread
from filtercake.units import FloatArray
from filtercake.validation import emulator_evidence
from filtercake.validation.pressure import ONE_SIZE, alum, mixture, pmma

COLUMNS: Final = ("source", "protocol", "particles", "friction", "sd", "freedom", "known_sd")
PMMA: Final = {"pmma_75_25": 0.75, "pmma_50_50": 0.5, "pmma_25_75": 0.25}
LABELS: Final = {"alum": "alum_15min", "one size": "one_size", "75/25": "pmma_75_25", "25/75": "pmma_25_75"}
"""Distributions by what stands in a cell's label; 50/50 PMMA where nothing does."""
CELL_LOAD: Final = "porosity_x4"
"""Load, over the contacts' strength, at which pairs of pressed cells are compared."""

Table = dict[str, Any]


@dataclass(frozen=True)
class Fitted:
    """Standard deviations by protocol and friction, as ``SD``; powers of count, evenness, interior; freedom.

    ``gain`` is the logarithm of the likelihood over that of the constants in use. They follow the tables only where
    they must: where twice the gain is beyond chance (chi-square, a degree of freedom per constant).
    """

    sd: Mapping[tuple[str, bool], float]
    powers: tuple[float, float, float]
    freedom: float
    gain: float


def ensembles(data: Path) -> tuple[pd.DataFrame, list[Scene]]:
    """Collect the ensembles of the tables in ``data`` (docs/data): a row of ``COLUMNS`` and a scene of each.

    Where both engines, or two variants, packed the same clouds, one of them is taken.
    """
    rows, scenes = [], []
    for source, scene, values in _ensembles(data):
        spread = pooled_spread([values])
        if spread.freedom > 0.0 and spread.sd > 0.0:
            place = (source, scene.protocol, scene.particles, scene.friction)
            rows.append((*place, spread.sd, spread.freedom, known_spread(scene).sd))
            scenes.append(scene)
    return pd.DataFrame(rows, columns=list(COLUMNS)), scenes


def fit(table: pd.DataFrame, scenes: list[Scene]) -> Fitted:
    """Fit the law by maximum likelihood: an ensemble's variance over that of the law has an F distribution.

    Its degrees of freedom are the ensemble's and those that the law counts as, which are fitted too (Smyth 2004).
    """
    from scipy import optimize

    factors = np.array([_factors(scene) for scene in scenes])
    logs, freedom = 2.0 * np.log(table["sd"].to_numpy(np.float64)), table["freedom"].to_numpy(np.float64)
    start = [*(2.0 * np.log(list(SD.values()))), 1.0, 0.0, 2.0, np.log(20.0)]
    found = optimize.minimize(_unlikelihood, start, args=(factors, logs, freedom), method="BFGS").x
    count, evenness, interior = 0.5 * found[4:7]
    sd = {kind: float(np.exp(0.5 * value)) for kind, value in zip(SD, found, strict=False)}
    in_use = 2.0 * np.array([*np.log(list(SD.values())), COUNT_POWER, EVENNESS_POWER, INTERIOR_POWER, 0.5 * found[7]])
    gain = _unlikelihood(in_use, factors, logs, freedom) - _unlikelihood(found, factors, logs, freedom)
    return Fitted(sd, (float(count), float(evenness), float(interior)), float(np.exp(found[7])), gain)


def _factors(scene: Scene) -> list[float]:
    """Give what multiplies the parameters in the logarithm of a scene's variance."""
    kind = (scene.protocol, scene.friction > FRICTION_COUNTS)
    shares = (
        scene.particles / REFERENCE_SPHERES,
        effective_spheres(scene.csd, scene.particles) / REFERENCE_SPHERES,
        interior_share(scene),
    )
    return [*(float(kind == other) for other in SD), *(-float(np.log(share)) for share in shares)]


def _unlikelihood(parameters: FloatArray, factors: FloatArray, logs: FloatArray, freedom: FloatArray) -> float:
    """Return -log(likelihood) of the logarithms of variances, by the density of the F distribution."""
    from scipy.special import gammaln

    known = np.exp(parameters[-1])
    ratio, both = logs - factors @ parameters[:-1], freedom + known
    constant = gammaln(0.5 * both) - gammaln(0.5 * freedom) - gammaln(0.5 * known)
    shape = 0.5 * freedom * (np.log(freedom / known) + ratio) - 0.5 * both * np.log1p(freedom / known * np.exp(ratio))
    return -float(np.sum(constant + shape))


def _ensembles(data: Path) -> Iterator[tuple[str, Scene, FloatArray]]:
    for name, key in {"agreement_replicates": "engine", "reference_replicates": "study"}.items():
        table = pd.read_csv(data / f"{name}.csv").query("status == 'ok'")
        for _, group in table.groupby(["csd", "friction", "cohesion_kJ_m3", key]):
            row = {"particles": 20_000 if group["csd"].iloc[0] == "alum_15min" else 2000, **group.iloc[0].to_dict()}
            if row[key] != "liggghts":
                scene = _scene(row["csd"], row["particles"], row["friction"])
                yield name, scene, group["porosity"].to_numpy(np.float64)
    yield from _variants(data)
    yield from _cells(data)
    yield from _pairs(data)


def _variants(data: Path) -> Iterator[tuple[str, Scene, FloatArray]]:
    """Beds of other numbers of spheres, of which means and spreads are kept."""
    table = pd.read_csv(data / "run_time_error.csv").query("estimator == 'interior slab' and engine == 'embedded'")
    for row in table[table["axis"].isin(["default", "spheres"])].to_dict("records"):
        csd = "alum_15min" if row["case"].startswith("alum") else "pmma_50_50"
        scene = _scene(csd, int(row["particles"]), 0.3 if "friction" in row["case"] else 0.0)
        yield "run_time_error", scene, _with_spread(row["porosity"], row["sd"], int(row["n"]))


def _cells(data: Path) -> Iterator[tuple[str, Scene, FloatArray]]:
    """Pressed cells and settled beds of the evidence on pressure."""
    table = pd.read_csv(data / "pressure_cells.csv")
    kept = table[table["reason"].isna() & (table["section"] != "column") & ~table["label"].str.contains(":")]
    key = ["section", "case", "label", "spheres", "friction", "cohesion_kJ_m3", "stress_Pa"]
    for _, group in kept.groupby(key, dropna=False):
        row = group.iloc[0].to_dict()
        settled = "gravity" in (row["section"], *row["case"].split("_"))
        protocol = GRAVITY_PROTOCOL if settled else FILTRATION_PROTOCOL
        known = [name for label, name in LABELS.items() if label in row["label"]]
        scene = _scene((*known, "pmma_50_50")[0], row["spheres"], row["friction"], protocol)
        yield "pressure_cells", scene, group["porosity"].to_numpy(np.float64)


def _pairs(data: Path) -> Iterator[tuple[str, Scene, FloatArray]]:
    """Second packings of points that the instant estimate is trained on: distributions of every kind."""
    table = pd.read_csv(data / "emulator_packings.csv")
    kept = table[table["reason"].isna()]
    for _, group in kept.groupby(["protocol", "friction", "cohesion_kJ_m3", "mixture", "attraction"], dropna=False):
        row = group.iloc[0].to_dict()
        column = "porosity" if row["protocol"] == GRAVITY_PROTOCOL else CELL_LOAD
        if len(group) > 1:
            yield "emulator_packings", emulator_evidence.scene_of(row), group[column].to_numpy(np.float64)


def _with_spread(mean: float, sd: float, count: int) -> FloatArray:
    """Give values with a mean and a standard deviation."""
    values = np.linspace(-1.0, 1.0, count)
    return np.asarray(mean + sd * values / np.std(values, ddof=1) if count > 1 else np.array([mean]))


def _scene(csd: str, particles: int, friction: float, protocol: str = GRAVITY_PROTOCOL) -> Scene:
    """Give what the spread depends on; the rest of the scene is PMMA's."""
    return Scene(
        csd=_distribution(csd),
        particles=int(particles),
        initial_void_fraction=0.60 if csd == "alum_15min" else 0.65,
        settling_velocity=0.01,
        density=1180.0,
        youngs_modulus=5e6,
        poisson_ratio=0.2,
        restitution=0.3,
        friction=float(friction),
        cohesion=50e3,
        time_step=4e-7,
        engine="embedded",
        protocol=protocol,
    )


def _distribution(name: str) -> CrystalSizeDistribution:
    if name == "alum_15min":
        return alum()
    return pmma(PMMA[name]) if name in PMMA else mixture(ONE_SIZE)
