"""Porosity of the paper's sample region and kinetic energy against time, for the base point (paper, Fig. 3)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.packing.engines import kind_of
from filtercake.units import FloatArray

MILLISECOND = 1e-3
INSET_SPAN = 0.03
"""Porosity shown in the inset, at least."""


def draw(data: StudyData) -> Figure:
    """Draw every replicate's trajectory, their mean and where each was found at rest."""
    figure, (upper, lower) = style.panels(2, height=4.3, ratios=(3.0, 2.0), sharex=True)
    upper.set_ylabel("Porosity of the region 0..L (–)")
    lower.set_ylabel("Kinetic energy (J)")
    lower.set_xlabel("Time since release (ms)")
    point = selection.main_point(data)
    if point is None:
        style.nothing(upper, "no point at the base material")
        return figure
    found, note = selection.records(data, str(point["point"]))
    runs = [record["trajectory"] for _, record in found if record.get("trajectory", {}).get("time_s")]
    rows = data.summary[data.summary["point"] == point["point"]]
    if not runs:
        style.nothing(upper, "no accepted packing at the base material")
        style.footer(figure, rows, note)
        return figure
    stopped = "end of the fixed run" if kind_of(point["engine"]).fixed_steps else "stopped: bed at rest"
    inset = upper.inset_axes((0.52, 0.46, 0.37, 0.52))
    for axes in (upper, inset):
        _lines(axes, runs, "porosity_sample", stopped)
        for value in selection.published(data, str(point["csd"]), "porosity"):
            if value.kind == "simulation":
                style.published_level(axes, value)
    _lines(lower, runs, "kinetic_energy_J", stopped)
    lower.set_yscale("log")
    _zoom(inset, runs)
    upper.indicate_inset_zoom(inset, edgecolor=style.FAINT, linewidth=0.6)
    style.legend(figure, [upper])
    style.footer(figure, rows, selection.label(data, str(point["csd"])), note)
    return figure


def mean_trajectory(runs: list[dict[str, Any]], quantity: str) -> tuple[FloatArray, FloatArray]:
    """Average a quantity of trajectories of different lengths; a bed keeps its last value when its run has stopped.

    Returns
    -------
    tuple of ndarray
        Times (s) and means, shape (m,).
    """
    times = np.unique(np.concatenate([np.asarray(run["time_s"], np.float64) for run in runs]))
    held = [np.interp(times, run["time_s"], run[quantity]) for run in runs]
    return times, np.asarray(np.mean(held, axis=0))


def _lines(axes: Axes, runs: list[dict[str, Any]], quantity: str, stopped: str) -> None:
    for run in runs:
        axes.plot(
            np.asarray(run["time_s"]) / MILLISECOND,
            run[quantity],
            color=style.colour(5),
            linewidth=0.6,
            label="one packing",
            gid="replicate",
        )
    times, mean = mean_trajectory(runs, quantity)
    axes.plot(times / MILLISECOND, mean, color=style.colour(0), linewidth=1.6, label="mean", gid="mean")
    axes.plot(
        [run["time_s"][-1] / MILLISECOND for run in runs],
        [run[quantity][-1] for run in runs],
        "o",
        color=style.colour(1),
        markersize=3.2,
        markeredgewidth=0.0,
        linestyle="none",
        label=stopped,
        zorder=4,
        gid="stopped",
    )


def _zoom(inset: Axes, runs: list[dict[str, Any]]) -> None:
    """Frame the end of all runs, wide enough that the spread is seen for what it is."""
    ends = np.array([run["time_s"][-1] for run in runs]) / MILLISECOND
    final = np.array([run["porosity_sample"][-1] for run in runs])
    half = max(0.5 * INSET_SPAN, 0.75 * float(np.ptp(final)))
    middle = 0.5 * float(final.min() + final.max())
    inset.set_ylim(middle - half, middle + half)
    inset.set_xlim(0.72 * ends.min(), ends.max() + 0.04 * (ends.max() - 0.72 * ends.min()))
    inset.yaxis.tick_right()
    inset.tick_params(labelsize=6.0, length=2.0)
    for side in inset.spines.values():
        side.set(visible=True, color=style.FAINT)
