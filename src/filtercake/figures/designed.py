"""A design as its figures see it, and what they share."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from filtercake.design.words import COSTS, OBJECTIVES
from filtercake.figures import style
from filtercake.packing.result import read_record
from filtercake.results.tables import read_table
from filtercake.units import FloatArray

TIME = "residence_time_min"
LABEL = "Residence time (min)"
THOUSAND = 1e3
SHORT_RANGE = 12.0
"""Factor between the ends of an axis up to which more of its ticks have numbers."""
NOTHING = "no design keeps to the limits"


@dataclass(frozen=True)
class DesignData:
    """Everything a figure may show of a design.

    Attributes
    ----------
    name, title : str
        The study, and one line about it.
    summary : dict
        The outcome (see :func:`filtercake.design.tables.summary`).
    search, levels, packings, pareto, safety, costs : DataFrame
        Its tables (see :mod:`filtercake.design.tables`).
    """

    name: str
    title: str
    summary: dict[str, Any]
    search: pd.DataFrame
    levels: pd.DataFrame
    packings: pd.DataFrame
    pareto: pd.DataFrame
    safety: pd.DataFrame
    costs: pd.DataFrame

    @classmethod
    def read(cls, name: str, title: str, summary: Path, tables: Iterable[str]) -> DesignData:
        """Read a design's record and tables."""
        read = {Path(table).stem: read_table(table) for table in tables}
        return cls(name=name, title=title, summary=read_record(summary), **read)

    @property
    def possible(self) -> bool:
        """Whether any design keeps to the limits."""
        return bool(self.summary["possible"])

    @property
    def best(self) -> dict[str, Any]:
        """The best design, by the columns of the search."""
        return dict(self.summary["best"])


def sentence(text: str) -> str:
    """Write a finding as a sentence."""
    return f"{text[:1].upper()}{text[1:]}."


def objective_label(data: DesignData, name: str) -> str:
    """Label of an axis of an objective."""
    words = OBJECTIVES[name]
    unit = {"filter_area": "m²", "cake_moisture": "mass %"}.get(name, f"thousand {data.summary['currency']}")
    return f"{words[0].upper()}{words[1:]} ({unit})"


def scaled(name: str, values: FloatArray) -> FloatArray:
    """Values of an objective in the unit of its label."""
    return np.asarray(values / THOUSAND if name in COSTS else 100.0 * values if name == "cake_moisture" else values)


def known(table: pd.DataFrame) -> pd.DataFrame:
    """Residence times at which a design keeps to the limits."""
    keep: list[bool] = np.isfinite(table["objective"].to_numpy(np.float64)).tolist()
    return table[keep]


def band(
    axes: Axes, rows: pd.DataFrame, columns: tuple[str, str, str], index: int, label: str, scale: float = 1.0
) -> None:
    """Plot a line with its 95 % interval as a band, over the residence time."""
    middle, low, high = (rows[name].to_numpy(np.float64) / scale for name in columns)
    axes.fill_between(rows[TIME], low, high, color=style.colour(index), alpha=0.25, linewidth=0.0, gid="band")
    axes.plot(rows[TIME], middle, color=style.colour(index), label=label)


def time_axis(axes: Axes, data: DesignData) -> None:
    """Make the abscissa the residence time, by ratio."""
    times = data.search[TIME].to_numpy(np.float64)
    axes.set_xscale("log")
    few = times.max() < SHORT_RANGE * times.min()
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 4.0, 6.0) if few else (1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(times.min() / 1.03, times.max() * 1.03)
    axes.set_xlabel(LABEL)


def optimum_span(axes: Axes, data: DesignData) -> None:
    """Shade the 95 % interval of the best residence time."""
    if not data.possible:
        return
    found = data.summary[TIME]
    axes.axvspan(found["low"], found["high"], color=style.FAINT, alpha=0.18, linewidth=0.0, zorder=0, gid="interval")
    axes.axvline(found["value"], color=style.FAINT, linewidth=0.8, linestyle=(0, (4, 2)), zorder=0.5, gid="best")


def footer(figure: Figure, data: DesignData, *notes: str) -> None:
    """Write below a figure the packings and how the answer stands."""
    standing = f"optimum: {data.summary['kind']}" if data.possible else NOTHING
    packed = "" if len(data.levels) else "no packings: the instant estimate alone"
    style.footer(figure, data.levels, packed, standing, *notes)
