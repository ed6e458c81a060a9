"""A calibration as its figures see it: tables, estimates, and the means of measurements and packings."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from filtercake.calibration.measurements import Measurements
from filtercake.figures import style
from filtercake.filtration.resistance import RESISTANCE_LAWS
from filtercake.packing.engines import label_of
from filtercake.statistics import half_width, quantile
from filtercake.units import FloatArray

ESTIMATORS = {"interior": "interior porosity", "paper_count": "porosity counted as in the paper"}
"""Names of estimators in figures; one that is not listed keeps its own."""


@dataclass(frozen=True)
class CalibrationData:
    """Everything a figure may show of a calibration.

    Attributes
    ----------
    name, title : str
        The calibration, and one line about it.
    summary : dict
        The outcome (see :func:`filtercake.calibration.rounds.summary`).
    parity, objective, response : DataFrame
        Its tables (see :mod:`filtercake.calibration.rounds`).
    simulated : DataFrame
        Every packing made (see :func:`filtercake.calibration.rounds.simulate`).
    predictions : DataFrame or None
        Predicted resistances, where any were asked for.
    labels : dict of str to str
        Names of the distributions for readers; their order chooses colours and markers.
    measurements : Measurements or None
        Measurements, for the figures of the tests.
    """

    name: str
    title: str
    summary: dict[str, Any]
    parity: pd.DataFrame
    objective: pd.DataFrame
    response: pd.DataFrame
    simulated: pd.DataFrame
    predictions: pd.DataFrame | None
    labels: dict[str, str]
    measurements: Measurements | None = None

    @property
    def measured(self) -> list[str]:
        """Distributions with measurements, in the order of the labels."""
        names = {str(csd) for csd in self.parity["csd"]}
        return sorted(names, key=self.number)

    @property
    def fits_friction(self) -> bool:
        """Whether the friction was fitted."""
        return self.summary["friction"] is None

    @property
    def friction(self) -> float:
        """Coefficient of friction: the one taken, or the best one."""
        return self.estimate("friction")[0] if self.fits_friction else float(self.summary["friction"])

    @property
    def cohesion(self) -> tuple[float, float, float]:
        """Best cohesion and the ends of its 95 % interval, kJ/m3."""
        return self.estimate("cohesion_kJ_m3")

    def estimate(self, parameter: str) -> tuple[float, float, float]:
        """Best value of a fitted parameter and the ends of its 95 % interval."""
        found = self.summary["parameters"][parameter]
        return float(found["value"]), float(found["low"]), float(found["high"])

    def number(self, csd: str) -> int:
        """Place of a distribution: it has the same colour in every figure."""
        known = list(self.labels)
        return known.index(csd) if csd in known else len(known)

    def label(self, csd: str, characters: int = 40) -> str:
        """Label of a distribution, wrapped to a number of characters."""
        return textwrap.fill(self.labels.get(csd) or csd, characters)


def measured_means(data: CalibrationData) -> pd.DataFrame:
    """Average the measurements of each distribution as the fit does: csd, measured_m_kg and the 95 % interval's ends.

    The column left_out_m_kg is the resistance that the other distributions' measurements predict; nan where none do.
    """
    rows = []
    for csd in data.measured:
        own = data.parity[data.parity["csd"] == csd]
        weight = own["relative_uncertainty"].to_numpy(np.float64) ** -2
        mean = float(np.average(np.log(own["measured_m_kg"].to_numpy(np.float64)), weights=weight))
        reach = float(reach_of(own)[0]) / math.sqrt(float(weight.sum()))
        row = {"csd": csd, "measured_m_kg": math.exp(mean), "modelled_m_kg": float(own["modelled_m_kg"].iloc[0])}
        row |= {"measured_low_m_kg": math.exp(mean - reach), "measured_high_m_kg": math.exp(mean + reach)}
        rows.append({**row, "left_out_m_kg": math.exp(mean + float(own["left_out_ln_error"].iloc[0]))})
    return pd.DataFrame(rows)


def reach_of(parity: pd.DataFrame) -> FloatArray:
    """Return the standard errors to the ends of each measurement's 95 % interval; Student's with a scatter."""
    return np.array([quantile(freedom) for freedom in parity["scatter_freedom"].fillna(math.inf)])


def packed_friction(data: CalibrationData) -> float:
    """Coefficient of friction of packings that is nearest to the one taken or fitted."""
    packed = data.simulated["friction"].to_numpy(np.float64)
    return float(packed[np.argmin(np.abs(packed - data.friction))])


def packed_at(data: CalibrationData, csd: str, friction: float) -> pd.DataFrame:
    """Average the accepted packings of a distribution and a friction by cohesion, all batches together.

    The columns are cohesion_kJ_m3, resistance_m_kg and resistance_ci95_m_kg, nan where no packing was accepted.
    """
    own = data.simulated[(data.simulated["csd"] == csd) & np.isclose(data.simulated["friction"], friction)]
    rows = []
    for cohesion, group in own.groupby("cohesion_kJ_m3"):
        values = np.exp(group.loc[group["status"] == "ok", "ln_resistance"].to_numpy(np.float64))
        mean = float(values.mean()) if values.size else math.nan
        rows.append(
            {"cohesion_kJ_m3": cohesion, "resistance_m_kg": mean, "resistance_ci95_m_kg": half_width(values)},
        )
    return pd.DataFrame(rows, columns=["cohesion_kJ_m3", "resistance_m_kg", "resistance_ci95_m_kg"])


def main_packings(data: CalibrationData, csds: Sequence[str]) -> pd.DataFrame:
    """Packings of some distributions without those of rival frictions."""
    rows = data.simulated[data.simulated["csd"].isin(csds)]
    return rows if data.fits_friction else rows[np.isclose(rows["friction"], data.friction)]


def fitted_packings(data: CalibrationData, *, rivals: bool = False) -> pd.DataFrame:
    """Packings of the measured distributions behind the fit; with ``rivals``, those of rival frictions too."""
    if rivals:
        return data.simulated[data.simulated["csd"].isin(data.measured)]
    return main_packings(data, data.measured)


def count(rows: pd.DataFrame) -> str:
    """Count packings, accepted and failed."""
    good = int((rows["status"] == "ok").sum())
    return f"{good} packing{'' if good == 1 else 's'}, {len(rows) - good or 'none'} failed"


def footer(figure: Figure, data: CalibrationData, packings: Sequence[str], engines: Iterable[str], *notes: str) -> None:
    """Write below a figure what was fitted, by which packings (see :func:`count`) and engines; and notes."""
    estimator = ESTIMATORS.get(data.summary["estimator"], data.summary["estimator"])
    what = "cohesion and friction fitted" if data.fits_friction else f"cohesion fitted at friction {data.friction:g}"
    names = ", ".join(label_of(name) for name in sorted({str(engine) for engine in engines}))
    law = RESISTANCE_LAWS[data.summary["resistance_law"]].title
    said = f"{what}, resistances from the {estimator} by {law}"
    style.footer(figure, pd.DataFrame(), said, *packings, names, *notes)


def panel_title(data: CalibrationData, characters: int) -> str:
    """Return the calibration's title in lines of so many characters."""
    return textwrap.fill(data.title, characters)


def with_interval(value: float, low: float, high: float, unit: str = "") -> str:
    """Write a value and its interval, as precisely as the interval is wide."""
    half = 0.5 * (high - low)
    digits = max(0, 1 - math.floor(math.log10(half))) if half > 0.0 else 3
    best, *ends = (f"{round(number, digits) + 0.0:.{digits}f}" for number in (value, low, high))
    return f"{best}{unit} (95 %: {ends[0]} to {ends[1]})"
