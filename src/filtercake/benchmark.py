"""Run time against the paper's protocol: the same packing both ways, in turn, on one core."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from filtercake.csd import CrystalSizeDistribution
from filtercake.packing.pack import pack
from filtercake.packing.spec import PackingSpec
from filtercake.porosity import measure
from filtercake.study import half_width

PAPER_TIME_STEP = 1e-7
"""Time step of the as-published protocol, s (paper, Table 3)."""

Report = Callable[[str], None]


def as_published(spec: PackingSpec) -> PackingSpec:
    """Return the same scene by the paper's protocol."""
    return replace(spec, engine="liggghts_as_published", time_step=PAPER_TIME_STEP)


def time_in_turn(
    specs: Iterable[PackingSpec], csd: CrystalSizeDistribution, replicates: int, report: Report = lambda _: None
) -> pd.DataFrame:
    """Make every spec's replicate k before any replicate k + 1, so that a change of the machine's pace hits all alike.

    Returns
    -------
    DataFrame
        Columns engine, replicate, wall_s (the engine's own), steps, porosity, porosity_as_published.
    """
    rows: list[dict[str, Any]] = []
    listed = list(specs)
    for replicate in range(replicates):
        for spec in listed:
            with tempfile.TemporaryDirectory(prefix="filtercake-") as folder:
                packing = pack(spec, csd, replicate, Path(folder))
            found, record = measure(packing, spec), packing.diagnostics
            rows.append(
                {
                    "engine": spec.engine,
                    "replicate": replicate,
                    "wall_s": record["wall_s"],
                    "steps": record["steps"],
                    "porosity": found.interior,
                    "porosity_as_published": found.as_published,
                }
            )
            report(f"{spec.engine} r{replicate}: {record['wall_s']:.1f} s, porosity {found.interior:.4f}")
    return pd.DataFrame(rows)


def compare(timings: pd.DataFrame, baseline: str) -> pd.DataFrame:
    """Summarise timings: per engine the median time, the ratio to the baseline and the porosity with its interval.

    ``same_porosity`` says whether the difference of the mean porosities is within its own 95 % interval.
    """
    base = timings[timings["engine"] == baseline]
    rows = []
    for engine, group in timings.groupby("engine", sort=False):
        values, reference = group["porosity"].to_numpy(np.float64), base["porosity"].to_numpy(np.float64)
        difference = float(values.mean() - reference.mean())
        interval = float(np.hypot(half_width(values), half_width(reference)))
        rows.append(
            {
                "engine": engine,
                "n": len(group),
                "median_s": group["wall_s"].median(),
                "times_faster": base["wall_s"].median() / group["wall_s"].median(),
                "porosity": values.mean(),
                "porosity_ci95": half_width(values),
                "difference": difference,
                "difference_ci95": interval,
                "same_porosity": abs(difference) <= interval,
            }
        )
    return pd.DataFrame(rows)
