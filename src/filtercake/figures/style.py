"""House style of the figures: sizes, colours, markers, and shared parts."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import style as mpl_style
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from matplotlib.transforms import ScaledTranslation

from filtercake.packing.engines import label_of
from filtercake.packing.result import publish
from filtercake.study.config.published import Published
from filtercake.units import FloatArray

FOOTER = "Description"
"""Metadata of a PNG that holds the line below its figure: packings, failures, engine."""

SINGLE, MEDIUM, DOUBLE = 3.5, 5.0, 7.0
"""Widths of a figure, in: one column, one and a half, two."""

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
"""Okabe and Ito's colours, told apart by colour-blind readers; yellow last, it is faint on white."""
MARKERS = ("o", "^", "v", "P", "X", "<", ">")
SHIFT = 3.0
"""Points between series side by side."""
CROSS_HEIGHT = 6.0
"""Points between the crosses of failed points, one row per series."""
ALL_FAILED = "all packings failed"
FAILED = "failed"
"""Marks artists that stand for points without an accepted packing."""
INK, FAINT = "#222222", "#8c8c8c"
PUBLISHED_MARKERS = {"simulation": "D", "measurement": "s"}
PUBLISHED_WORDS = {"simulation": "simulated", "measurement": "measured"}

POROSITY = "Porosity (–)"
COHESION = "Cohesion energy density (kJ/m³)"
FRICTION = "Coefficient of friction (–)"
ADHESION = "Work of adhesion (mJ/m²)"
AXES = {"cohesion_kJ_m3": COHESION, "friction": FRICTION, "adhesion_mJ_m2": ADHESION}
"""Labels of axes by the column that they show."""

_RC: dict[str, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same figure on every machine
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.columnspacing": 1.2,
    "legend.labelspacing": 0.35,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.5,
    "pdf.fonttype": 42,  # text stays text
    "svg.hashsalt": "filtercake",
}


@contextmanager
def applied() -> Iterator[None]:
    """Draw and save in the house style; saving too, because matplotlib makes some ticks only then."""
    with mpl_style.context(_RC, after_reset=True):  # a reader's own matplotlibrc changes nothing
        yield


def save(figure: Figure, png: Path, pdf: Path) -> None:
    """Save a figure as PNG (300 dpi) and PDF; no date inside, so that the same figure is the same file.

    The PNG carries the line that stands below the figure, for its caption.
    """
    footer = " ".join(figure.get_supxlabel().split())
    with applied():
        with publish(png) as temporary:
            figure.savefig(temporary, format="png", dpi=300, metadata={FOOTER: footer})
        with publish(pdf) as temporary:
            figure.savefig(temporary, format="pdf", metadata={"CreationDate": None})


def panels(
    count: int = 1,
    *,
    width: float = SINGLE,
    height: float = 2.9,
    columns: int = 1,
    ratios: Sequence[float] | None = None,
    sharex: bool = False,
    sharey: bool = False,
) -> tuple[Figure, list[Axes]]:
    """Make a figure of ``width`` by ``height`` inches with ``count`` panels, row by row.

    ``ratios`` are the relative heights of the rows; ``sharex`` and ``sharey`` say whether all panels have the same
    axis.
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    rows = -(-count // columns)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey, height_ratios=ratios)
    axes: list[Axes] = list(grid.flat)
    for unused in axes[count:]:
        unused.remove()
    return figure, axes[:count]


def colour(index: int) -> str:
    """Colour of the n-th series."""
    return PALETTE[index % len(PALETTE)]


def marker(index: int) -> str:
    """Marker of the n-th series."""
    return MARKERS[index % len(MARKERS)]


def shift(artists: Iterable[Artist], axes: Axes, place: int, count: int) -> None:
    """Move one of several series sideways on the page, so that error bars are told apart; its data keep their x."""
    points = (place - 0.5 * (count - 1)) * SHIFT
    # set afterwards: matplotlib takes the limits of the axes from artists that are drawn at their data
    moved = axes.transData + ScaledTranslation(points / 72.0, 0.0, axes.figure.dpi_scale_trans)
    for artist in artists:
        artist.set_transform(moved)


def error_line(
    axes: Axes,
    rows: pd.DataFrame,
    x: str,
    y: str,
    interval: str | tuple[str, str],
    *,
    label: str,
    index: int,
    place: int = 0,
    count: int = 1,
) -> None:
    """Plot a series of means with their intervals; points without a mean are crosses above the axes.

    Parameters
    ----------
    axes : Axes
        Panel.
    rows : DataFrame
        Points of the series, in order.
    x, y : str
        Columns of the abscissa and the means.
    interval : str or tuple of str
        Column of the half-widths of the intervals, or columns of their lower and upper ends.
    label, index : str, int
        Name of the series; number that chooses its colour and marker.
    place, count : int
        Place of the series among ``count`` side by side.
    """
    positions, means = rows[x].to_numpy(np.float64), rows[y].to_numpy(np.float64)
    good = np.isfinite(means)
    if isinstance(interval, str):
        reach = rows[interval].to_numpy(np.float64)[good]
    else:
        low, high = (rows[name].to_numpy(np.float64) for name in interval)
        reach = np.stack([means - low, high - means])[:, good]
    drawn = axes.errorbar(
        positions[good],
        means[good],
        yerr=reach,
        color=colour(index),
        marker=marker(index),
        capsize=2.0,
        elinewidth=0.8,
        label=label,
        zorder=3,
    )
    shift(drawn.get_children(), axes, place, count)
    failed = positions[~good]
    if failed.size:
        edge = axes.get_xaxis_transform()
        (crosses,) = axes.plot(
            failed, np.ones(failed.size), "x", color=colour(index), transform=edge, clip_on=False, gid=FAILED
        )
        height = CROSS_HEIGHT * (place + 1) / 72.0
        crosses.set_transform(edge + ScaledTranslation(0.0, height, axes.figure.dpi_scale_trans))


def title(axes: Axes, text: str, series: int) -> None:
    """Put a panel's title over it, and over the crosses of its failed points where there are any."""
    failed = any(line.get_gid() == FAILED for line in axes.get_lines())
    axes.set_title(text, loc="left", pad=CROSS_HEIGHT * (series + 1) if failed else None)


def published_label(value: Published) -> str:
    """Legend entry of a published value: its source and whether it was simulated or measured."""
    return f"{value.source}, {PUBLISHED_WORDS[value.kind]}"


def published_point(axes: Axes, x: float, y: float, value: Published, *, fill: str = "white", label: str = "") -> None:
    """Plot a published value as a marker of its kind, named by its source unless a label is given."""
    axes.plot(
        [x],
        [y],
        PUBLISHED_MARKERS[value.kind],
        markerfacecolor=fill,
        markeredgecolor=INK,
        markeredgewidth=0.9,
        clip_on=False,
        label=label or published_label(value),
        zorder=5,
        gid="published",
    )


def published_range(axes: Axes, x: float, low: float, high: float, *, colour: str) -> None:
    """Plot a published value of which only a range is known as a bracket."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    bars = axes.errorbar([x], [middle], yerr=[half], fmt="none", ecolor=colour, elinewidth=1.2, capsize=4, zorder=4)
    for artist in bars.get_children():
        artist.set_gid("published")
    for segments in bars[2]:
        segments.set_linestyle(":")


def published_level(axes: Axes, value: Published) -> None:
    """Plot a published value that belongs to no abscissa: a horizontal line, or a band where only a range is known."""
    if value.low is not None and value.high is not None:
        label = f"{published_label(value)} (range)"
        axes.axhspan(
            value.low, value.high, color=FAINT, alpha=0.25, linewidth=0, label=label, zorder=0, gid="published"
        )
        return
    dashes = (0, (4, 2)) if value.kind == "simulation" else (0, (1, 1.5))
    axes.axhline(
        value.value, color=INK, linewidth=0.9, linestyle=dashes, label=published_label(value), zorder=1, gid="published"
    )


def resistance_axis(
    axes: Axes, values: FloatArray, *, log: bool = False, factor: str = "", abscissa: bool = False
) -> None:
    """Label the y axis, or the abscissa, as specific cake resistance in a power of ten of m/kg; the data stay in m/kg.

    The largest finite one of ``values`` chooses the power; ``factor`` is put before the unit.
    """
    axis = axes.xaxis if abscissa else axes.yaxis
    if log:
        axes.set(**{"xscale" if abscissa else "yscale": "log"})
        axis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)))
        axis.set_minor_formatter(NullFormatter())
    power_axis(axis, values, f"Specific cake resistance{factor}", "m/kg", otherwise=9)


def volume_axis(axes: Axes, largest: float) -> None:
    """Label the x axis as crystallizer volume, from zero to a little over the largest (m3)."""
    axes.set_xlabel("Crystallizer volume (m³)")
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    if np.isfinite(largest):
        axes.set_xlim(0.0, 1.06 * largest)


def power_axis(axis: Axis, values: FloatArray, name: str, unit: str, *, otherwise: int = 0) -> None:
    """Label an axis with a name and a power of ten of a unit; the data stay in the unit.

    The largest finite one of ``values`` chooses the power, ``otherwise`` where none is finite.
    """
    finite = values[np.isfinite(values)]
    exponent = int(np.floor(np.log10(finite.max()))) if finite.size else otherwise
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / 10.0**exponent:g}"))
    axis.set_label_text(f"{name} ({power_of_ten(exponent)} {unit})".replace("\n ", "\n"))


def power_of_ten(exponent: int) -> str:
    """Write a power of ten as readers know it."""
    return "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def scientific(value: float, digits: int = 3) -> str:
    """Write a number as a multiple of a power of ten; zero and powers of ten without a factor."""
    if value == 0.0:
        return "0"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    power = power_of_ten(int(exponent))
    return power if float(mantissa) == 1.0 else f"{float(mantissa):g}·{power}"


def legend(figure: Figure, axes: Iterable[Axes], columns: int = 2, extra: Sequence[Artist] = ()) -> None:
    """Put one legend of all panels above them, where it covers no data; equal labels appear once."""
    entries: dict[str, Artist] = {}
    for panel in axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
        if any(line.get_gid() == FAILED for line in panel.get_lines()):
            extra = [*extra, key(ALL_FAILED, color=FAINT, marker="x", linewidth=0.0)]
    for handle in extra:
        entries.setdefault(str(handle.get_label()), handle)
    # sorted() keeps the order within both kinds: our series come first
    shown = sorted(entries.items(), key=lambda entry: not isinstance(entry[1], ErrorbarContainer))
    if shown:
        figure.legend(
            [handle for _, handle in shown], [name for name, _ in shown], loc="outside upper left", ncols=columns
        )


def key(label: str, **properties: Any) -> Line2D:
    """Entry of a legend that stands for no single artist."""
    return Line2D([], [], label=label, **properties)


def footer(figure: Figure, rows: pd.DataFrame, *notes: str) -> None:
    """Write below a figure what the summary's rows hold: packings, failures, engines; and notes."""
    parts = [describe_counts(rows), *notes] if len(rows) else list(notes)
    characters = int(figure.get_figwidth() * 21.0)
    text = "\n".join(textwrap.wrap("; ".join(part for part in parts if part), characters))
    figure.supxlabel(text, x=0.012, ha="left", fontsize=6.0, color="#555555", linespacing=1.3)


def describe_counts(rows: pd.DataFrame) -> str:
    """Count the packings of some points: how many each, how many failed, and the engine's name."""
    least, most, failed = int(rows["n"].min()), int(rows["n"].max()), int(rows["n_failed"].sum())
    each = f"n = {least}" if least == most else f"n = {least} to {most}"
    per_point = " per point" if len(rows) > 1 else ""
    engines = ", ".join(label_of(name) for name in sorted(set(rows["engine"].astype(str))))
    return f"{each} packing{'' if most == 1 else 's'}{per_point}, {failed or 'none'} failed; {engines}"


def nothing(axes: Axes, reason: str) -> None:
    """Write into empty axes why they are empty."""
    sentence = "\n".join(textwrap.wrap(reason, 38))
    plate = {"facecolor": "white", "edgecolor": "none"}
    axes.text(0.5, 0.5, sentence, transform=axes.transAxes, ha="center", va="center", color=FAINT, bbox=plate, zorder=9)
