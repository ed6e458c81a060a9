"""Cake resistance, filter area and the medium's share against the crystallizer's volume (paper, Fig. 14)."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import selection, style
from filtercake.figures.filtered import filtered
from filtercake.figures.selection import StudyData
from filtercake.results.resistance_columns import ALWAYS, others

VOLUME = "crystallizer_volume_m3"
ASIDE = 2
"""Places that published values stand to the right of ours."""
QUANTITIES = ("resistance_m_kg", "filter_area_m2")
OURS = "this work, 95 % interval"


def draw(data: StudyData) -> Figure:
    """Draw three panels over one abscissa, with published values and those by the other laws beside ours."""
    figure, panels = style.panels(3, width=style.SINGLE, height=5.6, sharex=True)
    resistance, area, share = panels
    table = filtered(data)
    percent = table.assign(**{name: 100.0 * table[name] for name in table.columns if name.startswith("medium_share")})
    _series(resistance, table, "resistance_m_kg", "resistance_ci95_m_kg")
    _series(area, table, "filter_area_m2", ("filter_area_low_m2", "filter_area_high_m2"))
    _series(share, percent, "medium_share", ("medium_share_low", "medium_share_high"))
    for law in others(data.study.resistance_law):
        _beside(resistance, table, f"resistance_{law}_m_kg", law)
        _beside(area, table, f"filter_area_{law}_m2", law)
        _beside(share, percent, f"medium_share_{law}", law)
    for protocol in sorted(data.study.protocols - {data.study.packing.protocol}):
        _by_protocol(panels, filtered(data, protocol), protocol)
    published(resistance, data, table, "resistance_m_kg")
    published(area, data, table, "filter_area_m2")
    published(share, data, table, "medium_share", scale=100.0)
    style.resistance_axis(resistance, table["resistance_m_kg"].to_numpy())
    resistance.set_ylabel(resistance.get_ylabel().replace("Specific cake", "Specific cake\n"))
    area.set_ylabel("Filter area (m²)")
    share.set_ylabel("Share of the medium\nin the resistance (%)")
    style.volume_axis(share, float(table[VOLUME].max()))
    style.legend(figure, panels, columns=1)
    notes = ["error bars: 95 % intervals of the mean", selection.law_note(data), operating_point(data), fall(table)]
    notes.append(change(table))
    if any(line.get_gid() == "published" for axes in panels for line in axes.get_lines()):
        notes.append("published values are set a little to the right")
    style.footer(figure, table, *notes)
    return figure


def published(axes: Axes, data: StudyData, table: pd.DataFrame, quantity: str, scale: float = 1.0) -> None:
    """Plot the published values of a quantity, times ``scale``, at the volumes of the products they belong to."""
    for csd, volume in zip(table["csd"], table[VOLUME], strict=True):
        for value in selection.published(data, str(csd), quantity):
            if value.low is not None and value.high is not None:
                style.published_range(axes, float(volume), scale * value.low, scale * value.high, colour=style.INK)
            else:
                style.published_point(axes, float(volume), scale * value.value, value)
                style.shift(axes.get_lines()[-1:], axes, ASIDE, 1)  # beside ours, which it would cover


def fall(table: pd.DataFrame) -> str:
    """Change of resistance and area from the smallest to the largest crystallizer, in words."""
    good = table[table["resistance_m_kg"].notna()]
    if len(good) < 2:
        return ""
    ends = good.iloc[[0, -1]]
    resistance, area = (100.0 * (ends[name].iloc[1] / ends[name].iloc[0] - 1.0) for name in QUANTITIES)
    first, last = ends[VOLUME]
    return (
        f"from {first:g} to {last:g} m³ the resistance changes by {resistance:+.0f} % and the area by {area:+.0f} %"
    ).replace("-", "−")


def change(table: pd.DataFrame) -> str:
    """Change of the area by Carman's law instead of the additive one, in words; empty where there is no area."""
    found = 100.0 * table["area_change_by_carman"].dropna()
    if found.empty:
        return ""
    ends = dict.fromkeys(f"{value:+.0f}" for value in (found.min(), found.max()))
    return f"by Carman instead of eq. 3 the area changes by {' to '.join(ends)} %".replace("-", "−")


def operating_point(data: StudyData) -> str:
    """Operating point of the filter, in words."""
    drum = data.study.filter
    if drum is None:
        return ""
    return (
        f"{drum.pressure_drop_kPa:g} kPa, medium {style.scientific(drum.medium_resistance_1_m)} 1/m, "
        f"{drum.rotation_rate_rpm:g} rpm, {100.0 * drum.submerged_fraction:g} % immersed"
    )


def _beside(axes: Axes, table: pd.DataFrame, column: str, law: str) -> None:
    """Plot what another law gives of the same packings."""
    look = style.colour(1 + ALWAYS.index(law))
    axes.plot(
        table[VOLUME],
        table[column],
        "--",
        color=look,
        linewidth=0.9,
        label=f"same packings by {selection.law_title(law)}",
        gid="beside",
    )


def _by_protocol(panels: list[Axes], table: pd.DataFrame, protocol: str) -> None:
    """Plot what packings made by the other protocol say, by the study's law."""
    percent = table.assign(medium_share=100.0 * table["medium_share"])
    for axes, column in zip(panels, ("resistance_m_kg", "filter_area_m2", "medium_share"), strict=True):
        axes.plot(
            table[VOLUME],
            percent[column],
            "^:",
            color=style.colour(3),
            markersize=3.0,
            linewidth=0.9,
            label=f"packed by {protocol}",
            gid="beside",
        )


def _series(axes: Axes, table: pd.DataFrame, column: str, interval: str | tuple[str, str]) -> None:
    style.error_line(axes, table, VOLUME, column, interval, label=OURS, index=0)
    for line in axes.get_lines():
        line.set_markersize(3.0)  # the intervals are small
    if table[column].isna().all():
        style.nothing(axes, style.ALL_FAILED if len(table) else "no point at the base material")
