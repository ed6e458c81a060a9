"""Whether two packing engines, or beds of two sizes, are the same: mean porosities over ensembles, case by case.

Packings are chaotic: the same cloud settles to another bed with another rounding. Only ensembles can be compared.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from filtercake.statistics import difference_half_width, half_width, standard_error
from filtercake.study.config.sweep import OF_BEDS

LARGEST_STANDARD_ERROR = 0.001
"""Combined standard error of the porosity up to which a comparison says anything."""


def compare_engines(replicates: pd.DataFrame, reference: str, other: str) -> pd.DataFrame:
    """Compare the mean interior porosity of two engines in every case that both made.

    Parameters
    ----------
    replicates : DataFrame
        Rows of ``replicates.csv`` of both engines.
    reference, other : str
        Names of the engines.

    Returns
    -------
    DataFrame
        One row per case: n, mean and standard error of each engine, their difference (other minus reference), its
        standard error and half-width of its 95 % interval (Welch), the number of failed packings, and two verdicts:
        ``sharp`` (the standard error is small enough to say anything) and ``agree`` (sharp, and the interval holds 0).
    """
    rows = []
    for case, group in replicates.groupby(["csd", *OF_BEDS], sort=False):
        good = group[group["status"] == "ok"]
        ours, theirs = (good.loc[good["engine"] == engine, "porosity"] for engine in (other, reference))
        errors = standard_error(theirs), standard_error(ours)
        error, half = math.hypot(*errors), difference_half_width(ours, theirs)
        difference = float(ours.mean() - theirs.mean())
        sharp = error <= LARGEST_STANDARD_ERROR
        rows.append(
            {
                **dict(zip(("csd", *OF_BEDS), case, strict=True)),
                "particles": int(good["particles"].max()) if len(good) else 0,
                f"n_{reference}": len(theirs),
                f"porosity_{reference}": theirs.mean(),
                f"se_{reference}": errors[0],
                f"n_{other}": len(ours),
                f"porosity_{other}": ours.mean(),
                f"se_{other}": errors[1],
                "difference": difference,
                "difference_se": error,
                "difference_ci95": half,
                "n_failed": len(group) - len(good),
                "sharp": sharp,
                "agree": sharp and abs(difference) <= half,
            }
        )
    return pd.DataFrame(rows)


def compare_sizes(small: pd.DataFrame, large: pd.DataFrame) -> pd.DataFrame:
    """Hold the mean of a study's beds against one larger bed (or a few) of the same points.

    Parameters
    ----------
    small, large : DataFrame
        Rows of ``replicates.csv`` of both studies, of which points at the same distribution and material are compared.

    Returns
    -------
    DataFrame
        One row per point of ``large`` and porosity estimator: number of beds and of spheres of both, the means, the
        half-width of the smaller beds' 95 % interval, the difference (large minus small), and whether it is
        ``within`` that interval.
    """
    same = ["csd", *OF_BEDS]
    rows = []
    for case, beds in large[large["status"] == "ok"].groupby(same, sort=False):
        here = (small[same] == list(case)).all(axis="columns") & (small["status"] == "ok")
        for estimator in ("porosity", "porosity_paper_count"):
            ours, theirs = (table[estimator].to_numpy(np.float64) for table in (small[here], beds))
            mean, half = float(ours.mean()), half_width(ours)
            difference = float(theirs.mean()) - mean
            rows.append(
                {
                    **dict(zip(same, case, strict=True)),
                    "estimator": estimator,
                    "n_small": ours.size,
                    "particles_small": int(small.loc[here, "particles"].max()) if ours.size else 0,
                    "mean_small": mean,
                    "ci95_small": half,
                    "n_large": theirs.size,
                    "particles_large": int(beds["particles"].max()),
                    "mean_large": float(theirs.mean()),
                    "difference": difference,
                    "within": abs(difference) <= half,
                }
            )
    return pd.DataFrame(rows)
