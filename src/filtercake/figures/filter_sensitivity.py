"""Filter area for other media and pressure drops, and the cake's share of the resistance (paper, section 4.2)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from filtercake.figures import selection, style
from filtercake.figures.filter_area import VOLUME, operating_point, published
from filtercake.figures.filtered import filtered
from filtercake.figures.selection import StudyData
from filtercake.filtration.drum_filter import DrumFilter, medium_share, resistance_for_cake_share
from filtercake.filtration.drum_filter import area as filter_area
from filtercake.results.filter_design import drum_of
from filtercake.units import HOUR, KILOPASCAL, FloatArray

MEDIA = (1e9, 5e9, 1e10, 5e10, 1e11)
"""Resistances of media in use, 1/m."""
PRESSURES = (20.0, 80.0)
"""Pressure drops of vacuum drums, kPa: the ends of their range."""
STATED_SHARE, STATED_RESISTANCE = 0.8, 1e9
"""The paper: above this resistance (m/kg) the cake holds more than this share of the overall resistance."""
SHOWN = (1e7, 1e11)
"""Specific cake resistances of the share's panel, m/kg."""

EMPTY = (1.0, 100.0)
"""Areas on the axes where none is known, m2."""


def draw(data: StudyData) -> Figure:
    """Draw the area per pressure drop and medium at our resistances, and the share of the cake against resistance."""
    drum = drum_of(data.study)
    own = drum.pressure_drop / KILOPASCAL
    pressures = sorted({*PRESSURES, float(f"{own:.12g}")})
    media = sorted({*MEDIA, float(drum.medium_resistance)})
    table = filtered(data)
    figure, panels = style.panels(len(pressures) + 1, width=style.DOUBLE, height=6.0, columns=2)
    *areas, share = panels
    for axes, pressure in zip(areas, pressures, strict=True):
        at_pressure = replace(drum, pressure_drop=pressure * KILOPASCAL)
        for k, medium in enumerate(media):
            rows = _areas(data, replace(at_pressure, medium_resistance=medium), table)
            label = _label(medium, drum)
            style.error_line(axes, rows, VOLUME, "area", ("low", "high"), label=label, index=k)
        if np.isclose(pressure, own):
            published(axes, data, table, "filter_area_m2")
        if table["resistance_m_kg"].isna().all():
            style.nothing(axes, style.ALL_FAILED if len(table) else "no point at the base material")
        chosen = " (the study's)" if np.isclose(pressure, own) else ""
        style.title(axes, f"Pressure drop {pressure:g} kPa{chosen}", 1)
        style.volume_axis(axes, float(table[VOLUME].max()))
        axes.set_ylabel("Filter area (m²)")
        _logarithmic(axes)
    _share(share, table, drum, media)
    _same_limits(areas, table)
    style.legend(figure, panels, columns=3)
    style.footer(
        figure,
        table,
        "error bars: 95 % intervals of the mean resistance",
        f"the study's filter: {operating_point(data)}",
        "areas by eq. 10 at our resistances; no further packings",
        selection.law_note(data),
    )
    return figure


def _label(medium: float, drum: DrumFilter) -> str:
    return f"medium {style.scientific(medium)} 1/m" + (" (the study's)" if medium == drum.medium_resistance else "")


def _areas(data: StudyData, drum: DrumFilter, table: pd.DataFrame) -> pd.DataFrame:
    """Areas at our mean resistances and at the ends of their intervals; nan where there is none."""
    crystallizer = data.study.crystallizer
    flow = crystallizer.slurry_flow_m3_h / HOUR if crystallizer else np.nan
    mean, half = table["resistance_m_kg"].to_numpy(np.float64), table["resistance_ci95_m_kg"].to_numpy(np.float64)
    columns = {"area": mean, "low": np.maximum(mean - half, 0.0), "high": mean + half}
    return table[[VOLUME]].assign(**{name: _known(drum, alpha, flow) for name, alpha in columns.items()})


def _known(drum: DrumFilter, resistance: FloatArray, flow: float) -> FloatArray:
    found = np.full(resistance.shape, np.nan)
    known = np.isfinite(resistance) & ((resistance > 0.0) | (drum.medium_resistance > 0.0))
    found[known] = filter_area(drum, resistance[known], flow)
    return found


def _share(axes: Axes, table: pd.DataFrame, drum: DrumFilter, media: list[float]) -> None:
    alpha = np.geomspace(*SHOWN, 201)
    for k, medium in enumerate(media):
        cake = 100.0 * (1.0 - medium_share(replace(drum, medium_resistance=medium), alpha))
        width = 1.8 if medium == drum.medium_resistance else 0.9
        axes.plot(alpha, cake, color=style.colour(k), linewidth=width, label="_", gid="share")
    axes.plot(
        [STATED_RESISTANCE, STATED_RESISTANCE, SHOWN[1]],
        [0.0, 100.0 * STATED_SHARE, 100.0 * STATED_SHARE],
        color=style.INK,
        linewidth=0.9,
        linestyle=(0, (4, 2)),
        label=f"paper: cake over {100.0 * STATED_SHARE:g} % above {style.scientific(STATED_RESISTANCE)} m/kg",
        gid="published",
    )
    if drum.medium_resistance > 0.0:
        exact = float(resistance_for_cake_share(drum, STATED_SHARE))
        axes.plot(
            [exact],
            [100.0 * STATED_SHARE],
            "*",
            color=style.INK,
            markersize=7.0,
            label=f"this filter: {100.0 * STATED_SHARE:g} % at {style.scientific(exact, 4)} m/kg",
            zorder=4,
            gid="exact",
        )
    good = table[table["resistance_m_kg"] > 0.0]
    resistance = good["resistance_m_kg"].to_numpy(np.float64)
    bars = axes.errorbar(
        resistance,
        100.0 * (1.0 - good["medium_share"].to_numpy(np.float64)),
        xerr=good["resistance_ci95_m_kg"].to_numpy(np.float64),
        fmt="o",
        color=style.INK,
        markerfacecolor="white",
        markersize=3.5,
        capsize=1.5,
        elinewidth=0.8,
        label="cakes of this work",
        zorder=4,
    )
    for artist in bars.get_children():
        artist.set_gid("ours")
    axes.set_xscale("log")
    axes.set_xlim(*SHOWN)
    axes.set_ylim(0.0, 100.0)
    axes.set_xlabel("Specific cake resistance (m/kg)")
    axes.set_ylabel("Share of the cake in all resistance (%)")
    axes.set_title(f"Pressure drop {drum.pressure_drop / KILOPASCAL:g} kPa (the study's)", loc="left")


def _logarithmic(axes: Axes) -> None:
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _same_limits(panels: list[Axes], table: pd.DataFrame) -> None:
    """Set the same ordinate in all panels, so that areas compare across pressure drops."""
    known = table["resistance_m_kg"].notna().any()
    limits = [axes.get_ylim() for axes in panels] if known else [EMPTY]
    lowest, highest = zip(*limits, strict=True)
    for axes in panels:
        axes.set_ylim(min(lowest), max(highest))
