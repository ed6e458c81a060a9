"""The paper's tables with our values beside the published ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from filtercake.config import Published, Study
from filtercake.csd import CrystalSizeDistribution
from filtercake.packing.cloud import box_length
from filtercake.resistance import kozeny_carman
from filtercake.study import base_rows
from filtercake.units import MICROMETRE

Csds = dict[str, tuple[CrystalSizeDistribution, CrystalSizeDistribution]]

COMPARISON_COLUMNS = (
    "csd",
    "cohesion_kJ_m3",
    "friction",
    "engine",
    "source",
    "published",
    "n",
    "porosity_as_published",
    "sd",
    "deviation_sd",
    "porosity",
)


def published_value(study: Study, csd: str, quantity: str, kind: str) -> Published | None:
    """First published value of a quantity for a distribution, None where there is none."""
    found = (p for p in study.published if (p.csd, p.quantity, p.kind) == (csd, quantity, kind))
    return next(found, None)


def table1(study: Study, csds: Csds) -> pd.DataFrame:
    """Tabulate the system dimension L of every distribution (paper, Table 1).

    The paper gives whole micrometres; ``system_dimension_whole_um`` is ours rounded down.
    """
    rows = []
    for name, (_, truncated) in csds.items():
        length = box_length(truncated, study.packing.particles, study.packing.void_fraction) / MICROMETRE
        rows.append(
            {
                "csd": name,
                "label": study.csds[name].label or name,
                "particles": study.packing.particles,
                "void_fraction": study.packing.void_fraction,
                "system_dimension_um": round(length, 2),
                "system_dimension_whole_um": int(length),
                "published_um": _value(published_value(study, name, "system_dimension_um", "simulation")),
            }
        )
    return pd.DataFrame(rows)


def table4(study: Study, csds: Csds, summary: pd.DataFrame) -> pd.DataFrame:
    """Tabulate porosity and resistance at the base material (paper, Table 4).

    For every distribution: the published simulation, our estimate by the paper's own count, the interior slab
    (the answer), and the measurement; resistances by eq. 3 with the full distribution.
    """
    rows = []
    for name, (full, _) in csds.items():
        point = _base_point(study, name, summary)
        if point is None:
            continue
        material = study.material
        as_published = float(point["porosity_as_published"])
        rows.append(
            {
                "csd": name,
                "label": study.csds[name].label or name,
                "n": int(point["n"]),
                "n_failed": int(point["n_failed"]),
                "engine": point["engine"],
                "porosity_measured": _value(published_value(study, name, "porosity", "measurement")),
                "porosity_published": _value(published_value(study, name, "porosity", "simulation")),
                "porosity_as_published": as_published,
                "porosity_as_published_ci95": point["porosity_as_published_ci95"],
                "porosity": point["porosity"],
                "porosity_ci95": point["porosity_ci95"],
                **_measured_resistance(published_value(study, name, "resistance_m_kg", "measurement")),
                "resistance_published_m_kg": _value(published_value(study, name, "resistance_m_kg", "simulation")),
                "resistance_as_published_m_kg": (
                    kozeny_carman(as_published, full, material.density, material.sphericity)
                    if np.isfinite(as_published)
                    else np.nan
                ),
                "resistance_m_kg": point["resistance_m_kg"],
                "resistance_ci95_m_kg": point["resistance_ci95_m_kg"],
                "resistance_sauter_m_kg": point["resistance_sauter_m_kg"],
            }
        )
    return pd.DataFrame(rows)


def _base_point(study: Study, csd: str, summary: pd.DataFrame) -> pd.Series[Any] | None:
    """Row of a distribution at the study's base material, None where no sweep visits it."""
    found = base_rows(study, summary[summary["csd"] == csd])
    return None if found.empty else found.iloc[0]


def _measured_resistance(published: Published | None) -> dict[str, float]:
    """Return a measured resistance, or the range where only that is known."""
    names = ("resistance_measured_m_kg", "resistance_measured_low_m_kg", "resistance_measured_high_m_kg")
    if published is None:
        return dict.fromkeys(names, np.nan)
    if published.low is None or published.high is None:
        return dict(zip(names, (published.value, np.nan, np.nan), strict=True))
    return dict(zip(names, (np.nan, published.low, published.high), strict=True))


def _value(published: Published | None) -> float:
    return float("nan") if published is None else published.value


def comparison(study: Study, replicates: pd.DataFrame) -> pd.DataFrame:
    """Set every published porosity simulated at a visited point beside ours by the same estimator.

    ``sd`` is the standard deviation of one packing, pooled over the study's points of the same engine: a few
    replicates of one point say little about it. ``deviation_sd`` is the published value's distance from our mean
    in these: a published value is one packing (or a few), so that within three of them it is no different.
    """
    good = replicates[replicates["status"] == "ok"]
    spread = good.groupby(["engine", "point"])["porosity_as_published"].agg(["var", "count"]).dropna()
    weight = spread["count"] - 1
    pooled = np.sqrt((spread["var"] * weight).groupby("engine").sum() / weight.groupby("engine").sum())
    rows = []
    for entry in study.published:
        if entry.quantity != "porosity" or entry.cohesion_kJ_m3 is None or entry.friction is None:
            continue
        here = (replicates["csd"] == entry.csd) & (replicates["status"] == "ok")
        here &= np.isclose(replicates["cohesion_kJ_m3"], entry.cohesion_kJ_m3)
        here &= np.isclose(replicates["friction"], entry.friction)
        for name in ("poisson_ratio", "restitution", "youngs_modulus_MPa"):
            here &= np.isclose(replicates[name], getattr(study.material, name))
        values = replicates.loc[here, "porosity_as_published"].to_numpy(np.float64)
        if values.size < 2:
            continue
        mean, sd = float(values.mean()), float(pooled[replicates.loc[here, "engine"].iloc[0]])
        rows.append(
            (
                *(entry.csd, entry.cohesion_kJ_m3, entry.friction, replicates.loc[here, "engine"].iloc[0]),
                *(entry.source, entry.value, values.size, mean, sd, (entry.value - mean) / sd),
                float(replicates.loc[here, "porosity"].mean()),
            )
        )
    return pd.DataFrame(rows, columns=list(COMPARISON_COLUMNS))
