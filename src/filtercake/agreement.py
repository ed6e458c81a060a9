"""Whether two packing engines make the same beds: mean porosities over ensembles, case by case.

Packings are chaotic: the same cloud settles to another bed with another rounding. Only ensembles can be compared.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from filtercake.study import SWEPT

STANDARD_ERRORS = 2.0
"""Combined standard errors within which two means agree."""
LARGEST_STANDARD_ERROR = 0.001
"""Combined standard error of the porosity up to which a comparison says anything."""
CASE = ("csd", *SWEPT, "particles")


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
        standard error, the number of failed packings, and two verdicts: ``sharp`` (the standard error is small
        enough to say anything) and ``agree`` (sharp, and the difference is within two of them).
    """
    rows = []
    for case, group in replicates.groupby(["csd", *SWEPT], sort=False):
        good = group[group["status"] == "ok"]
        ours, theirs = (good.loc[good["engine"] == engine, "porosity"] for engine in (other, reference))
        error = float(np.hypot(_standard_error(ours), _standard_error(theirs)))
        difference = float(ours.mean() - theirs.mean())
        sharp = error <= LARGEST_STANDARD_ERROR
        rows.append(
            {
                **dict(zip(("csd", *SWEPT), case, strict=True)),
                "particles": int(good["particles"].max()) if len(good) else 0,
                f"n_{reference}": len(theirs),
                f"porosity_{reference}": theirs.mean(),
                f"se_{reference}": _standard_error(theirs),
                f"n_{other}": len(ours),
                f"porosity_{other}": ours.mean(),
                f"se_{other}": _standard_error(ours),
                "difference": difference,
                "difference_se": error,
                "n_failed": len(group) - len(good),
                "sharp": sharp,
                "agree": sharp and abs(difference) <= STANDARD_ERRORS * error,
            }
        )
    return pd.DataFrame(rows)


def _standard_error(values: pd.Series[float]) -> float:
    """Return the standard error of a mean; nan for fewer than two values."""
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else float("nan")
