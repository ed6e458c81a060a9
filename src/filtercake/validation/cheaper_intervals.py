"""What would make intervals cheaper: control variates, arranged clouds, other estimators, wider and deeper beds.

From the packings of :mod:`filtercake.validation.cheaper_packings`, one row each, :func:`methods` says what share of the
packings an equally narrow interval would take by each, and by how much the mean porosity would change.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake.packing.analytic_models import yu_zou_standish
from filtercake.statistics import difference_half_width, half_width, paired_half_width, quantile
from filtercake.units import FloatArray
from filtercake.validation.cheaper_packings import (
    DEEPER,
    MIRRORED,
    OTHER_STEP,
    PLAIN,
    STRATIFIED,
    WIDER,
    pack_all,
)
from filtercake.validation.pressure import pmma

FOLDS: Final = 20
OTHERS: Final = {"larger_slab": "slab from half a diameter", "tapered": "weights that taper off", "bed": "whole bed"}
COLUMNS: Final = ("friction", "method", "n", "packings", "bias", "bias_ci95")

Row = dict[str, Any]


def methods(table: pd.DataFrame) -> pd.DataFrame:
    """Weigh what might make intervals cheaper, against packings as they are asked for.

    Parameters
    ----------
    table : DataFrame
        Of :func:`filtercake.validation.cheaper_packings.pack_all`.

    Returns
    -------
    DataFrame
        ``COLUMNS``: number of packings behind it, ``packings`` (share of packings that an equally narrow interval
        takes: the ratio of variances of one packing's estimate), change of the mean porosity and its half-width.
    """
    rows = [
        {"friction": friction, **row}
        for friction in sorted(set(table["friction"]))
        for row in _methods(_by_way(table[(table["friction"] == friction) & (table["way"] != DEEPER)]))
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _by_way(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    return {str(name): group.set_index("replicate") for name, group in table.groupby("way")}


def _methods(ways: dict[str, pd.DataFrame]) -> Iterator[Row]:
    base = ways[PLAIN]
    own, interior, cloud = base["interior"], base["model_interior"], base["model_cloud"]
    nominal = yu_zou_standish(pmma())
    yield _paired("model of the interior's composition, nominal mean", own, own - interior + nominal)
    fitted = 1.0 - explained(interior.to_numpy(), own.to_numpy())
    yield _row("the same, coefficient and mean fitted", len(own), fitted)
    yield _paired("model of the composition of the cloud's middle", own, own - cloud + float(cloud.mean()))
    for column, name in OTHERS.items():
        yield _paired(name, own, base[column])
    for way in (MIRRORED, STRATIFIED, WIDER):
        if way in ways:
            yield _unpaired(way, own, ways[way]["interior"])
    again, same = ways[OTHER_STEP]["interior"].align(own, join="inner")
    yield _row("all that follows from the cloud", len(same), 1.0 - again.corr(same))


def _row(method: str, n: int, packings: float, bias: float = 0.0, bias_ci95: float = 0.0) -> Row:
    return {"method": method, "n": n, "packings": packings, "bias": bias, "bias_ci95": bias_ci95}


def _paired(method: str, own: pd.Series[float], other: pd.Series[float]) -> Row:
    """Weigh another estimate of the same packings."""
    bias, unsure = float(other.mean() - own.mean()), paired_half_width(other, own)
    return _row(method, len(own), float(other.var() / own.var()), bias, unsure)


def _unpaired(way: str, own: pd.Series[float], other: pd.Series[float]) -> Row:
    """Weigh other packings: of pairs the mean counts as two, of beds four times as wide one counts as four."""
    share = float(other.var() / own.var()) * (4.0 if way == WIDER else 1.0)
    if way == MIRRORED:
        one, two = own.align(other, join="inner")
        share = 1.0 + one.corr(two)
    return _row(way, len(other), share, float(other.mean() - own.mean()), difference_half_width(other, own))


def explained(variate: FloatArray, values: FloatArray) -> float:
    """Share of the variance of values (n,) that a line in a variate (n,) explains in cross-validation."""
    order, left = np.random.default_rng(1).permutation(values.size), np.empty(values.size)
    for fold in range(FOLDS):
        held = order[fold::FOLDS]
        kept = np.setdiff1d(order, held)
        slope, offset = np.polyfit(variate[kept], values[kept], 1)
        left[held] = values[held] - offset - slope * variate[held]
    return 1.0 - float(left.var() / values.var())


def depths(table: pd.DataFrame) -> pd.DataFrame:
    """Average the interior porosity by depth, the paper's (1) included: depth, n, porosity, porosity_ci95."""
    rows = []
    kept = table[(table["friction"] == 0.0) & table["way"].isin([PLAIN, DEEPER])]
    for depth, group in kept.groupby("bed_depth_factor"):
        rows.append((depth, len(group), group["interior"].mean(), half_width(group["interior"])))
    return pd.DataFrame(rows, columns=["depth", "n", "porosity", "porosity_ci95"])


def extrapolated(means: pd.DataFrame, deepest: float) -> tuple[float, float]:
    """Extrapolate beds up to a depth linearly in 1/depth to no end: the porosity there, and its 95 % half-width.

    Parameters
    ----------
    means : DataFrame
        Of :func:`depths`.
    deepest : float
        Depth of the deepest beds that take part.
    """
    used = means[means["depth"] <= deepest]
    weight = quantile() / used["porosity_ci95"]  # nearly one over the standard error
    design = np.column_stack([np.ones(len(used)), 1.0 / used["depth"]])
    covariance = np.linalg.inv((design.T * weight.to_numpy() ** 2) @ design)
    found = covariance @ (design.T * weight.to_numpy() ** 2) @ used["porosity"].to_numpy()
    return float(found[0]), quantile() * float(np.sqrt(covariance[0, 0]))


def main() -> None:
    """Make the packings behind docs/data/cheaper_intervals.csv and say what they show."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args()
    table = pack_all(print)
    table.to_csv(options.output, index=False, float_format="%.6g")
    print(methods(table).round(4).to_string(index=False))
    print(depths(table).round(4).to_string(index=False))


if __name__ == "__main__":
    main()
