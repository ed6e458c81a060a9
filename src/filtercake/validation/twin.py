"""The twin experiment: calibrations of a cohesion that is known, and how often their intervals hold it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from filtercake.calibration.fit import Observation, Parameter, Response, calibrate
from filtercake.units import FloatArray

COLUMNS = ("friction", "truth_kJ_m3", "repeat", "value_kJ_m3", "low_kJ_m3", "high_kJ_m3", "covered", "relative_error")


def repeat_calibrations(
    pool: pd.DataFrame, truth: pd.DataFrame, repeats: int, tests: int, noise: float, seed: int = 0
) -> pd.DataFrame:
    """Calibrate again and again, each time with packings of its own and measurements with noise of their own.

    Parameters
    ----------
    pool : DataFrame
        Rows of ``replicates.csv``: packings at several cohesions and one friction; every repeat takes its share of each
        point's replicates.
    truth : DataFrame
        Packings, from other seeds, at the one cohesion to be found; their mean resistance is what is measured.
    repeats, tests : int
        Number of calibrations, and of measurements of every distribution.
    noise, seed : float, int
        Relative standard deviation of a measurement, which the calibration is told, and the seed of the noise.

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
    for repeat in range(repeats):
        random = np.random.default_rng([seed, repeat])
        responses = {
            str(csd): Response((parameter,), values[:, None], _shares(rows_of, values, repeat, repeats))
            for csd, rows_of in good.groupby("csd")
        }
        observations = _measure(real, tests, noise, random)
        (found,) = calibrate(observations, responses).estimates
        covered = found.low <= cohesion <= found.high
        error = abs(found.value - cohesion) / cohesion
        rows.append((friction, cohesion, repeat, found.value, found.low, found.high, covered, error))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def summarise(table: pd.DataFrame) -> pd.DataFrame:
    """Count, per truth, how often the interval covered it, and the median error and half-width, both relative."""
    rows = []
    for _, group in table.groupby(["friction", "truth_kJ_m3"]):
        friction, truth = (float(group[name].iloc[0]) for name in ("friction", "truth_kJ_m3"))
        half = 0.5 * (group["high_kJ_m3"] - group["low_kJ_m3"]) / truth
        covered, error = int(group["covered"].sum()), float(group["relative_error"].median())
        rows.append((friction, truth, len(group), covered, error, float(half.median())))
    names = ["friction", "truth_kJ_m3", "repeats", "covered", "median_relative_error", "median_relative_half_width"]
    return pd.DataFrame(rows, columns=names)


def _only(table: pd.DataFrame, name: str) -> float:
    found = table[name].unique()
    if len(found) != 1:
        raise ValueError(f"{name} must have one value, not {len(found)}")
    return float(found[0])


def _shares(rows: pd.DataFrame, values: FloatArray, repeat: int, repeats: int) -> list[FloatArray]:
    """ln(alpha) of a repeat's own replicates at every cohesion."""
    shares = []
    for value in values:
        own = rows.loc[np.isclose(rows["cohesion_kJ_m3"], value)].sort_values("replicate")
        share = own.loc[own["replicate"] % repeats == repeat, "resistance_m_kg"].to_numpy(np.float64)
        if share.size < 2:
            raise ValueError(f"{value:g} kJ/m3 has {share.size} packings for repeat {repeat}: at least 2 are needed")
        shares.append(np.log(share))
    return shares


def _measure(real: pd.DataFrame, tests: int, noise: float, random: np.random.Generator) -> Sequence[Observation]:
    return [
        Observation(f"{csd} {k}", str(csd), math.log(float(rows.mean())) + noise * random.standard_normal(), noise)
        for csd, rows in real.groupby("csd")["resistance_m_kg"]
        for k in range(tests)
    ]
