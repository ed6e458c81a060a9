"""Filter area and resistance of a design against the residence time, with the packings that confirm them."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from filtercake.figures import designed, style
from filtercake.figures.designed import TIME, DesignData
from filtercake.figures.selection import law_title
from filtercake.units import FloatArray

AREA = ("filter_area_m2", "filter_area_low_m2", "filter_area_high_m2")
WIDE = 2.5
"""Factor between the ends of an ordinate from which it is logarithmic."""
RESISTANCE = ("resistance_m_kg", "resistance_low_m_kg", "resistance_high_m_kg")


def draw(data: DesignData) -> Figure:
    """Draw two panels over one abscissa: bands of what is known, packings with error bars, the estimate alone."""
    figure, panels = style.panels(2, width=style.MEDIUM, height=5.0, sharex=True)
    area, resistance = panels
    rows = designed.known(data.search)
    for axes, columns in ((area, AREA), (resistance, RESISTANCE)):
        if rows.empty:
            style.nothing(axes, designed.NOTHING)
            continue
        designed.band(axes, rows, columns, 0, "estimate and packings, 95 % interval")
        _packings(axes, data, columns)
        designed.optimum_span(axes, data)
    if len(rows):
        resistance.plot(
            rows[TIME], rows["estimated_resistance_m_kg"], ":", color=style.colour(1), label="instant estimate alone"
        )
    known = rows[RESISTANCE[0]].to_numpy(np.float64)
    style.resistance_axis(resistance, known, log=_wide(known))
    area.set_ylabel("Filter area (m²)")
    if _wide(rows[AREA[0]].to_numpy(np.float64)):
        area.set_yscale("log")
        area.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
        area.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        area.yaxis.set_minor_formatter(NullFormatter())
    designed.time_axis(resistance, data)
    style.legend(figure, panels, columns=2)
    notes = ["error bars: 95 % intervals of the mean", "grey: interval of the optimum"] if len(rows) else []
    designed.footer(figure, data, *notes, f"resistances by {law_title(data.summary['resistance_law'])}")
    return figure


def _wide(values: FloatArray) -> bool:
    """Whether values are better shown by their ratio."""
    return values.size > 0 and bool(values.max() > WIDE * values.min())


def _packings(axes: Axes, data: DesignData, columns: tuple[str, str, str]) -> None:
    if len(data.levels):
        style.error_line(axes, data.levels, TIME, columns[0], columns[1:], label="packings", index=2)
        for line in axes.get_lines():
            if line.get_marker() == style.marker(2):
                line.set_linestyle("none")
