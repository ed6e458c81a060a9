"""Maps of the stress tests: what became of each case, and where the fence stands."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from filtercake.figures import style
from filtercake.packing.engines import label_of
from filtercake.validation.stability import OUTCOMES, SI_UNITS

COLOURS = {
    "ok": "#009E73",
    "undecided": "#999999",
    "inaccurate": "#E69F00",
    "unsettled": "#56B4E9",
    "exploded": "#D55E00",
    "refused": "#CC79A7",
}
SHAPES = {"ok": "o", "undecided": "P", "inaccurate": "^", "unsettled": "s", "exploded": "X", "refused": "D"}
NAMES = {
    "time_step": "Time step / Rayleigh step",
    "cohesion_kJ_m3": "Cohesion (kJ/m³)",
    "friction": "Friction",
    "youngs_modulus_MPa": "Young's modulus (MPa)",
    "restitution": "Restitution",
    "size_ratio": "Size ratio",
    "skin": "Skin / smallest diameter",
    "density_kg_m3": "Density (kg/m³)",
    "drop_height": "Drop height / the paper's",
}


def draw(table: pd.DataFrame) -> Figure:
    """Draw one map per family and engine; cases are evenly spaced, whatever their values."""
    maps = list(table[["family", "engine"]].drop_duplicates().itertuples(index=False, name=None))
    figure, panels = style.panels(len(maps), width=style.DOUBLE, height=1.9 * -(-len(maps) // 3) + 0.5, columns=3)
    for axes, (family, engine) in zip(panels, maps, strict=True):
        _map(axes, table[(table["family"] == family) & (table["engine"] == engine)], str(engine))
    shown = [
        style.key(name, color=COLOURS[name], marker=SHAPES[name], linestyle="none")
        for name in OUTCOMES
        if name in set(table["outcome"])
    ]
    shown.append(
        style.key(
            "refused by the configuration",
            color="#000000",
            marker="s",
            markersize=9,
            markerfacecolor="#dddddd",
            markeredgewidth=0,
            linestyle="none",
        )
    )
    shown.append(
        style.key(
            "warned about",
            color="#000000",
            marker="s",
            markersize=9,
            markerfacecolor="none",
            markeredgecolor="#999999",
            linestyle="none",
        )
    )
    style.legend(figure, panels, columns=4, extra=shown)
    style.footer(
        figure,
        table.iloc[:0],
        f"{len(table)} cases; numbers: bias of the mean porosity in thousandths where packings were accepted",
    )
    return figure


def _map(axes: Axes, rows: pd.DataFrame, engine: str) -> None:
    xs, ys = (np.sort(rows[name].unique()) for name in ("x", "y"))
    for row in rows.to_dict("records"):
        x, y = int(np.searchsorted(xs, row["x"])), int(np.searchsorted(ys, row["y"]))
        outcome, bias = str(row["outcome"]), float(row["bias"])
        if row["fence"] != "allowed":
            looks = {"facecolor": "#dddddd"} if row["fence"] == "refused" else {"fill": False, "edgecolor": "#999999"}
            axes.add_patch(Rectangle((x - 0.48, y - 0.48), 0.96, 0.96, linewidth=0.8, zorder=0, **looks))
        axes.plot([x], [y + 0.12], SHAPES[outcome], color=COLOURS[outcome], markersize=5)
        if np.isfinite(bias):
            axes.text(x, y - 0.18, f"{1000 * bias:+.1f}", ha="center", va="top", fontsize=4.2, color=style.INK)
    axes.set_xticks(range(len(xs)), [f"{x:g}" for x in xs])
    axes.set_yticks(range(len(ys)), [f"{y:g}" for y in ys])
    axes.set_xlim(-0.6, len(xs) - 0.4)
    axes.set_ylim(-0.6, len(ys) - 0.4)
    axes.tick_params(labelsize=5.5)
    axes.set_xlabel(NAMES[rows["x_name"].iloc[0]], fontsize=7)
    axes.set_ylabel(NAMES[rows["y_name"].iloc[0]], fontsize=7)
    axes.set_title(
        f"{label_of(engine.removesuffix('_si'))}{', SI units' if engine == SI_UNITS else ''}", loc="left", fontsize=7
    )
