"""The twin experiment: calibrations whose answer is known, and how often their intervals hold it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from filtercake.calibration.fit import Observation, calibrate
from filtercake.calibration.response import Parameter, Response
from filtercake.calibration.rounds import Settings, fit_main
from filtercake.units import FloatArray

CASE = ("friction", "truth_kJ_m3", "distributions", "discrepancy")
COLUMNS = (*CASE, "repeat", "value_kJ_m3", "low_kJ_m3", "high_kJ_m3", "covered", "relative_error")
PRESSED_COLUMNS = ("truth", "pressures", "repeat", "friction", "low", "high", "covered", "error")
"""Of calibrations of pressed cakes: the friction to be found, how many pressures measured, and what was found."""


@dataclass(frozen=True)
class Experiment:
    """How the cakes are measured.

    Attributes
    ----------
    tests : int
        Measurements of every distribution.
    noise : float
        Relative standard deviation of a measurement, which the calibration is told.
    distributions : int
        How many are measured, other ones in turn; 0 for all.
    discrepancy : float
        Relative standard deviation, between distributions, of what no packing explains, which it is not told.
    shares : int
        Calibrations that share out a point's packings, the next ones taking them again; 0 for all, so that each has its
        own. Beside a discrepancy, packings hardly count.
    """

    tests: int
    noise: float
    distributions: int = 0
    discrepancy: float = 0.0
    shares: int = 0


def repeat_calibrations(
    pool: pd.DataFrame, truth: pd.DataFrame, repeats: int, asked: Experiment, seed: int = 0
) -> pd.DataFrame:
    """Calibrate again and again, each time with packings of its own and measurements with noise of their own.

    Parameters
    ----------
    pool : DataFrame
        Rows of ``replicates.csv``: packings at several cohesions and one friction; every repeat takes its share of each
        point's replicates.
    truth : DataFrame
        Packings, from other seeds, at the one cohesion to be found; their mean resistance is what is measured.
    repeats : int
        Number of calibrations.
    asked : Experiment
        How they are measured.
    seed : int
        Of the noise and the discrepancy.

    Returns
    -------
    DataFrame
        One row per repeat, ``COLUMNS``.

    Raises
    ------
    ValueError
        If a point has fewer than two packings per repeat, or the truth is not at one cohesion and friction.
    """
    good, real = pool[pool["status"] == "ok"], truth[truth["status"] == "ok"]
    cohesion, friction = (_only(real, name) for name in ("cohesion_kJ_m3", "friction"))
    if _only(good, "friction") != friction:
        raise ValueError("pool and truth have different frictions")
    values = np.sort(good["cohesion_kJ_m3"].unique())
    parameter = Parameter("cohesion_kJ_m3", float(values[0]), float(values[-1]))
    rows = []
    every = sorted(str(name) for name in good["csd"].unique())
    count = asked.distributions or len(every)
    case = (friction, cohesion, count, asked.discrepancy)
    for repeat in range(repeats):
        names = np.roll(every, repeat)[:count]
        responses = {
            str(csd): Response((parameter,), values[:, None], _shares(rows_of, values, repeat, asked.shares or repeats))
            for csd, rows_of in good[good["csd"].isin(names)].groupby("csd")
        }
        observations = _measure(real[real["csd"].isin(names)], asked, [seed, repeat])
        (found,) = calibrate(observations, responses).estimates
        covered = found.low <= cohesion <= found.high
        error = abs(found.value - cohesion) / cohesion
        rows.append((*case, repeat, found.value, found.low, found.high, covered, error))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def repeat_pressed(pool: pd.DataFrame, truth: pd.DataFrame, repeats: int, asked: Experiment) -> pd.DataFrame:
    """Calibrate the friction of pressed cakes again and again, from tests at every pressure of the tables.

    Parameters
    ----------
    pool, truth : DataFrame
        Rows of ``replicates.csv``: packings at several frictions, and, from other seeds, at the one to be found; each
        packing at every pressure, at one adhesion.
    repeats : int
        Number of calibrations.
    asked : Experiment
        How they are measured; ``shares`` as there.

    Returns
    -------
    DataFrame
        One row per repeat, ``PRESSED_COLUMNS``.

    Raises
    ------
    ValueError
        If the truth is not at one friction and adhesion, or the pool not at that adhesion.
    """
    good, real = (rows[rows["status"] == "ok"] for rows in (pool, truth))
    friction, adhesion = _only(real, "friction"), _only(real, "adhesion_mJ_m2")
    if _only(good, "adhesion_mJ_m2") != adhesion:
        raise ValueError("pool and truth have different adhesions")
    settings = _pressed_settings(good, adhesion)
    good = good.assign(ln_resistance=np.log(good["resistance_m_kg"].to_numpy(np.float64)), batch=0)
    shares = asked.shares or repeats
    rows = []
    for repeat in range(repeats):
        own = good[good["replicate"] % shares == repeat % shares]
        observations = _measure_pressed(real, asked, repeat)
        (found,) = fit_main(settings, observations, own).estimates
        covered, error = found.low <= friction <= found.high, abs(found.value - friction)
        rows.append((friction, len(settings.pressures_kPa), repeat, found.value, found.low, found.high, covered, error))
    return pd.DataFrame(rows, columns=list(PRESSED_COLUMNS))


def _pressed_settings(packings: pd.DataFrame, adhesion: float) -> Settings:
    levels = tuple(sorted(float(mu) for mu in packings["friction"].unique()))
    return Settings(
        parameters=(Parameter("friction", levels[0], levels[-1]),),
        levels=levels,
        beside="adhesion_mJ_m2",
        beside_levels=(adhesion,),
        measured=tuple(sorted(str(name) for name in packings["csd"].unique())),
        predicted=(),
        estimator="interior",
        rounds=1,
        relative_ci95_target=0.1,
        density=1.0,
        sphericity=1.0,
        implied_porosity=math.nan,
        soft_above=math.inf,
        pressures_kPa=tuple(sorted(float(drop) for drop in packings["pressure_kPa"].unique())),
    )


def _measure_pressed(real: pd.DataFrame, asked: Experiment, repeat: int) -> list[Observation]:
    noise = np.random.default_rng([0, repeat])
    found = []
    for cake, rows in real.groupby(["csd", "pressure_kPa"])["resistance_m_kg"]:
        csd, drop = str(np.asarray(cake)[0]), float(np.asarray(cake)[1])
        for k in range(asked.tests):
            value = math.log(float(rows.mean())) + asked.noise * noise.standard_normal()
            found.append(Observation(f"{csd} {drop:g} {k}", csd, value, asked.noise, drop))
    return found


def summarise(table: pd.DataFrame) -> pd.DataFrame:
    """Count, case by case, how often the interval covered the truth; the median error and half-width are relative."""
    rows = []
    for case, group in table.groupby(list(CASE)):
        truth = float(group["truth_kJ_m3"].iloc[0])
        half = 0.5 * (group["high_kJ_m3"] - group["low_kJ_m3"]) / truth
        covered, error = int(group["covered"].sum()), float(group["relative_error"].median())
        rows.append((*case, len(group), covered, error, float(half.median())))
    names = [*CASE, "repeats", "covered", "median_relative_error", "median_relative_half_width"]
    return pd.DataFrame(rows, columns=names)


def _only(table: pd.DataFrame, name: str) -> float:
    found = table[name].unique()
    if len(found) != 1:
        raise ValueError(f"{name} must have one value, not {len(found)}")
    return float(found[0])


def _shares(rows: pd.DataFrame, values: FloatArray, repeat: int, shares: int) -> list[FloatArray]:
    """ln(alpha) of a repeat's own replicates at every cohesion."""
    found = []
    for value in values:
        own = rows.loc[np.isclose(rows["cohesion_kJ_m3"], value)].sort_values("replicate")
        share = own.loc[own["replicate"] % shares == repeat % shares, "resistance_m_kg"].to_numpy(np.float64)
        if share.size < 2:
            raise ValueError(f"{value:g} kJ/m3 has {share.size} packings for repeat {repeat}: at least 2 are needed")
        found.append(np.log(share))
    return found


def _measure(real: pd.DataFrame, asked: Experiment, seed: Sequence[int]) -> list[Observation]:
    noise, apart = (np.random.default_rng([*seed, *more]) for more in ((), (1,)))
    found = []
    for csd, rows in real.groupby("csd")["resistance_m_kg"]:
        true = math.log(float(rows.mean())) + asked.discrepancy * apart.standard_normal()
        for k in range(asked.tests):
            value = true + asked.noise * noise.standard_normal()
            found.append(Observation(f"{csd} {k}", str(csd), value, asked.noise))
    return found
