"""Pressed cakes: porosity and resistance against the pressure drop, and the porosity through one cake."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.filtration.compressible import cake_average, cake_profile, shape
from filtercake.packing.compression import CompressionCurve
from filtercake.packing.similarity import LEAST_LOAD
from filtercake.statistics import half_width
from filtercake.study.points import base_rows
from filtercake.units import FloatArray

FREE: Final = ("friction", "pressure_kPa")
PRESSURES: Final = (10.0, 500.0)
"""Pressure drops of the abscissa at least, kPa."""
PLACES: Final = 40


@dataclass(frozen=True, eq=False)
class Family:
    """Points that share their packings and differ in the pressure drop alone.

    Attributes
    ----------
    label, index : str, int
        Name in legends; number that chooses the colour.
    rows : DataFrame
        Rows of the summary, by pressure.
    curves : list of CompressionCurve
        One per accepted packing.
    note : str
        What could not be read.
    """

    label: str
    index: int
    rows: pd.DataFrame
    curves: list[CompressionCurve]
    note: str

    @property
    def strength(self) -> float:
        """Stress that the contacts hold, kPa; 0 without attraction."""
        row = self.rows.iloc[0]
        return float(row["pressure_kPa"] / row["load_over_strength"])

    def load(self, pressure: float) -> float:
        """Load at a pressure, kPa."""
        return pressure / self.strength if self.strength > 0.0 else math.inf

    def resistance(self, porosity: FloatArray) -> FloatArray:
        """Resistance of an even cake of a porosity by the study's law, m/kg."""
        row = self.rows.iloc[0]
        return np.asarray(row["resistance_m_kg"] / shape(np.array(row["porosity"])) * shape(porosity))


def draw(data: StudyData) -> Figure:
    """Draw porosity and resistance against the pressure, and the porosity from the medium to the surface."""
    figure, panels = style.panels(3, width=style.SINGLE, height=6.6)
    porosity, resistance, through = panels
    listed = list(families(data))
    for family in listed:
        _against_pressure(porosity, resistance, family)
        _through(through, family, _base_pressure(data, family))
    if not listed:
        style.nothing(porosity, style.ALL_FAILED)
    porosity.set(xscale="log", xlabel="Pressure drop (kPa)", ylabel="Porosity (–)")
    resistance.set(xscale="log", yscale="log", xlabel="Pressure drop (kPa)")
    values = np.concatenate([family.rows["resistance_m_kg"].to_numpy(np.float64) for family in listed] or [np.ones(1)])
    style.resistance_axis(resistance, values, log=True)
    through.set(xlabel="Porosity (–)", ylabel="Height over the medium\n/ cake thickness (–)", ylim=(0.0, 1.0))
    style.legend(figure, panels, columns=1)
    rows = pd.concat([family.rows for family in listed]) if listed else data.summary.iloc[:0]
    notes = ["bands: 95 % intervals of the mean; dashed: at the medium", selection.law_note(data)]
    if listed:
        notes.append(f"below: at {_base_pressure(data, listed[0]):g} kPa")
    style.footer(figure, rows, *notes, *dict.fromkeys(family.note for family in listed))
    return figure


def families(data: StudyData) -> Iterator[Family]:
    """Families of pressed points at the base material, friction apart."""
    rows = base_rows(data.study, data.summary, FREE)
    rows = rows[(rows["protocol"] == "filtration") & rows["resistance_m_kg"].notna()]
    several = rows["friction"].nunique() > 1
    for index, ((csd, friction), own) in enumerate(rows.groupby(["csd", "friction"], sort=False)):
        found, note = selection.records(data, str(own["point"].iloc[0]))
        label = selection.label(data, str(csd)) + (f", friction {friction:g}" if several else "")
        if found:
            curves = [CompressionCurve.of(record) for _, record in found]
            yield Family(label, index, own.sort_values("pressure_kPa"), curves, note)


def _base_pressure(data: StudyData, family: Family) -> float:
    asked, had = data.study.base("pressure_kPa"), family.rows["pressure_kPa"]
    return float(had.iloc[-1] if asked is None else asked)


def _against_pressure(porosity: Axes, resistance: Axes, family: Family) -> None:
    low = min(PRESSURES[0], float(family.rows["pressure_kPa"].min()))
    high = max(PRESSURES[1], float(family.rows["pressure_kPa"].max()))
    pressure = np.geomspace(max(low, LEAST_LOAD * family.strength), high, PLACES)
    average, medium = (
        np.array([[pick(family.load(p), curve) for p in pressure] for curve in family.curves])
        for pick in (_average, _medium)
    )
    ink = style.colour(family.index)
    exponent = float(family.rows["compressibility"].iloc[-1])
    _band(porosity, pressure, average, ink)
    porosity.plot(pressure, medium.mean(axis=0), "--", color=ink, linewidth=0.9)
    _band(resistance, pressure, family.resistance(average), ink)
    for axes, name in ((porosity, "porosity"), (resistance, "resistance_m_kg")):
        interval = "porosity_ci95" if name == "porosity" else "resistance_ci95_m_kg"
        style.error_line(
            axes,
            family.rows,
            "pressure_kPa",
            name,
            interval,
            label=f"{family.label}: n = {exponent:.3f}".replace("-", "−"),
            index=family.index,
        )


def _average(load: float, curve: CompressionCurve) -> float:
    return cake_average(load, curve.at).porosity


def _medium(load: float, curve: CompressionCurve) -> float:
    return cake_average(load, curve.at).porosity_at_medium


def _band(axes: Axes, x: FloatArray, values: FloatArray, ink: str) -> None:
    """Plot the mean of the packings and its interval."""
    mean = values.mean(axis=0)
    axes.plot(x, mean, color=ink, linewidth=1.0)
    if len(values) > 1:
        half = np.array([half_width(column) for column in values.T])
        axes.fill_between(x, mean - half, mean + half, color=ink, alpha=0.15, linewidth=0.0)


def _through(axes: Axes, family: Family, pressure: float) -> None:
    heights = np.linspace(0.0, 1.0, PLACES)
    found = []
    for curve in family.curves:
        profile = cake_profile(family.load(pressure), curve.at)
        found.append(np.interp(heights, profile.height[::-1], profile.porosity[::-1]))
    axes.plot(np.mean(found, axis=0), heights, color=style.colour(family.index))
