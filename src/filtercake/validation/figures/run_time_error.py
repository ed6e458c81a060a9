"""Error of one packing against its run time: the variants of a scene, the default, the published protocol, peers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import style
from filtercake.filtration.resistance import log_sensitivity
from filtercake.packing.engines import label_of
from filtercake.units import FloatArray
from filtercake.validation.error_against_time import ANALYTIC, DEFAULT

CASES = {
    "pmma": "PMMA 50/50, no friction, N = 2000",
    "pmma_friction": "PMMA 50/50, friction 0.3, N = 2000",
    "alum": "Alum 15 min, N = 4000",
    "alum_wide": "Alum 15 min, N = 20 000",
}
AXES = (
    "time step",
    "spheres",
    "stop tolerance",
    "skin",
    "engine",
    "softer contacts",
    "truncation",
    "narrower bed",
)
"""Properties in which variants differ, in the order of colours."""
AS_PUBLISHED = "as published"
INTERIOR, COUNT = "interior slab", "count"
REPLICATES = (1, 2, 4, 8, 16, 32)
LEAST_ERROR = 1e-4
STAR: dict[str, Any] = {
    "markersize": 12,
    "markerfacecolor": "#F0E442",
    "markeredgecolor": style.INK,
    "linestyle": "none",
}


def draw(table: pd.DataFrame, references: pd.DataFrame) -> Figure:
    """Draw one panel per case, from all cases of :func:`filtercake.validation.error_against_time.errors`.

    ``references`` has the columns case, porosity and standard_error.
    """
    cases = [case for case in CASES if case in set(table["case"])]
    figure, panels = style.panels(len(cases), width=style.DOUBLE, height=2.9 * -(-len(cases) // 2), columns=2)
    for axes, case in zip(panels, cases, strict=True):
        reference = references[references["case"] == case].iloc[0]
        _panel(axes, table[table["case"] == case], float(reference["standard_error"]))
        style.title(axes, CASES[case], 0)
        _resistance_scale(axes, float(reference["porosity"]))
    style.legend(figure, panels, columns=4)
    style.footer(
        figure,
        table.iloc[:0],
        "error: root mean square of the bias against the reference ensemble and the spread of one packing, of the "
        "interior slab unless it says count; of a single packing its distance from the reference",
        "line: the default's mean of 1 to 32 packings",
        "shaded: standard error of the reference",
    )
    return figure


def _panel(axes: Axes, rows: pd.DataFrame, noise: float) -> None:
    interior = rows[rows["estimator"] == INTERIOR]
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("Run time of one packing (s)")
    axes.set_ylabel("Error in porosity (–)")
    axes.axhspan(LEAST_ERROR, max(noise, LEAST_ERROR), color=style.FAINT, alpha=0.2, linewidth=0)
    default = interior[interior["axis"] == DEFAULT]
    own = "".join(default["engine"].head(1))
    for index, axis in enumerate(AXES):
        here = interior[interior["axis"] == axis]
        for engine, of in here.groupby("engine"):
            other = label_of(str(engine))
            label = axis if engine == own else f"{other}, default" if axis == "engine" else f"{axis}, {other}"
            marker = style.marker(index // len(style.PALETTE)) if engine == own else "s"
            axes.plot(of["seconds"], _shown(of["error"]), marker, color=style.colour(index), markersize=4, label=label)
    _default(axes, default, noise)
    for estimator, fill in ((COUNT, style.INK), (INTERIOR, "white")):
        label = f"{AS_PUBLISHED}, {estimator}"
        published = rows[(rows["axis"] == AS_PUBLISHED) & (rows["estimator"] == estimator)]
        axes.plot(
            published["seconds"],
            _shown(published["error"].fillna(published["bias"].abs())),
            "D",
            markerfacecolor=fill,
            markeredgecolor=style.INK,
            linestyle="none",
            label=label,
            gid="published",
        )
    peers = interior[interior["axis"] == ANALYTIC]
    axes.plot(peers["seconds"], _shown(peers["error"]), "x", color=style.INK, linestyle="none", label="analytic models")
    axes.set_ylim(bottom=LEAST_ERROR)


def _default(axes: Axes, rows: pd.DataFrame, noise: float) -> None:
    """Mark the default, and what the mean of several of its packings makes of time and error."""
    if rows.empty:
        return
    row = rows.iloc[0]
    bias = np.sqrt(max(float(row["bias"]) ** 2 - float(row["bias_se"]) ** 2, 0.0))
    counts = np.array(REPLICATES, dtype=np.float64)
    error = np.maximum(np.sqrt(bias**2 + float(row["sd"]) ** 2 / counts), min(noise, 1.0) * 0.5)
    axes.plot(float(row["seconds"]) * counts, error, "-", color=style.INK, linewidth=0.9, zorder=1)
    axes.plot([row["seconds"]], [row["error"]], "*", **STAR, label="default", zorder=6)


def _shown(error: pd.Series[float]) -> FloatArray:
    return np.maximum(error.to_numpy(np.float64), LEAST_ERROR)


def _resistance_scale(axes: Axes, porosity: float) -> None:
    """Say on the right what an error of the porosity is in resistance."""
    factor = 100.0 * abs(log_sensitivity(porosity))
    right = axes.secondary_yaxis("right", functions=(lambda x: np.multiply(x, factor), lambda x: np.divide(x, factor)))
    right.set_ylabel("Error in resistance (%)")
