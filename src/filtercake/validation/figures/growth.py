"""Run time of the embedded engine per particle and time step, against the number of spheres and the size ratio."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from filtercake.figures import style

REFERENCE = "first bed, before and after each"
COLUMNS = {"particles": "Number of spheres", "size_ratio": "Largest over smallest diameter"}


def draw(table: pd.DataFrame) -> Figure:
    """Draw both series side by side, from the table of :func:`filtercake.validation.growth.time_growth`."""
    figure, axes = style.panels(2, width=style.DOUBLE, height=2.7, columns=2, sharey=True)
    axes[0].set_ylabel("Time per sphere and step (ns)")
    for index, (panel, (column, label)) in enumerate(zip(axes, COLUMNS.items(), strict=True)):
        rows = table[table["series"] == column].sort_values(column)
        panel.set_xlabel(label)
        panel.set_xscale("log")
        if rows.empty:
            style.nothing(panel, "not timed")
            continue
        pace = rows["ns_per_particle_step"]
        panel.plot(rows[column], pace, marker=style.marker(index), color=style.colour(index), label="each bed")
        other = "size_ratio" if column == "particles" else "particles"
        fixed = f"size ratio {rows[other].iloc[0]:g}" if other == "size_ratio" else f"N = {rows[other].iloc[0]:,}"
        relative = pace / rows["reference_ns"]
        panel.plot(rows[column], rows["reference_ns"], ":", color=style.INK, label=REFERENCE)
        panel.set_title(f"{fixed}; last over first {relative.iloc[-1] / relative.iloc[0]:.2f}", loc="left")
    style.legend(figure, axes)
    axes[0].set_ylim(0.0, 1.15 * float(table["ns_per_particle_step"].max()))
    return figure
