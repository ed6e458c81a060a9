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
from filtercake.calibration.rounds import Cake
from filtercake.figures import style
from filtercake.filtration.resistance import RESISTANCE_LAWS
from filtercake.packing.engines import label_of
from filtercake.statistics import half_width, quantile
from filtercake.units import FloatArray

PROPERTIES = {
    "cohesion_kJ_m3": ("cohesion", " kJ/m³"),
    "friction": ("friction", ""),
    "adhesion_mJ_m2": ("adhesion", " mJ/m²"),
}
"""Names of fitted properties in figures, with their units."""
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
        The outcome (see :func:`filtercake.calibration.tables.summary`).
    parity, objective, response : DataFrame
        Its tables (see :mod:`filtercake.calibration.tables`).
    simulated : DataFrame
        Every packing made (see :func:`filtercake.calibration.rounds.simulate`).
    predictions : DataFrame or None
        Predicted resistances, where any were asked for.
    labels : dict of str to str
        Names of the distributions for readers; their order chooses colours and markers.
    measurements : Measurements or None
        Measurements, for the figures of the tests.
    pressures : DataFrame or None
        Measured and modelled exponents over the pressure, where packings know pressures.
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
    pressures: pd.DataFrame | None = None

    @property
    def measured(self) -> list[str]:
        """Distributions with measurements, in the order of the labels."""
        names = {str(csd) for csd in self.parity["csd"]}
        return sorted(names, key=self.number)

    @property
    def cakes(self) -> list[Cake]:
        """Measured cakes: each distribution, in the order of the labels, at its pressures."""
        found = self.parity[["csd", "pressure_kPa"]].drop_duplicates().to_dict("records")
        cakes = [(str(row["csd"]), _known(row["pressure_kPa"])) for row in found]
        return sorted(cakes, key=lambda cake: (self.number(cake[0]), cake[1] or 0.0))

    @property
    def packings(self) -> pd.DataFrame:
        """Every packing once: pressed ones serve several pressures and attractions."""
        return self.simulated.drop_duplicates(["point", "replicate"])

    @property
    def axis(self) -> str:
        """Property along which packings were made: the cohesion of beds, the friction of pressed cakes."""
        return str(next(iter(self.summary["parameters"])))

    @property
    def beside(self) -> str:
        """Property held beside it, or fitted with it."""
        return str(self.summary["beside"])

    @property
    def fits_both(self) -> bool:
        """Whether both were fitted."""
        return self.summary["fixed"] is None

    @property
    def held(self) -> float:
        """Value of the property beside: the one taken, or the best one."""
        return self.estimate(self.beside)[0] if self.fits_both else float(self.summary["fixed"])

    @property
    def found(self) -> tuple[float, float, float]:
        """Best value of the property along which packings were made, and the ends of its 95 % interval."""
        return self.estimate(self.axis)

    def estimate(self, parameter: str) -> tuple[float, float, float]:
        """Best value of a fitted parameter and the ends of its 95 % interval."""
        found = self.summary["parameters"][parameter]
        return float(found["value"]), float(found["low"]), float(found["high"])

    def number(self, csd: str) -> int:
        """Place of a distribution: it has the same colour in every figure."""
        known = list(self.labels)
        return known.index(csd) if csd in known else len(known)

    def shade(self, cake: Cake) -> int:
        """Return the number of a cake's colour and marker: its distribution's, or its own where it has a pressure."""
        return self.number(cake[0]) if cake[1] is None else self.cakes.index(cake)

    def label(self, csd: str, characters: int = 40) -> str:
        """Label of a distribution, wrapped to a number of characters."""
        return textwrap.fill(self.labels.get(csd) or csd, characters)


def _known(pressure: float) -> float | None:
    return None if math.isnan(pressure) else float(pressure)


def of_cake(table: pd.DataFrame, csd: str, pressure: float | None) -> pd.DataFrame:
    """Rows of a table that are of a distribution, and of a pressure drop in kPa where there is one."""
    own = table[table["csd"] == csd]
    return own if pressure is None else own[np.isclose(own["pressure_kPa"].to_numpy(np.float64), pressure)]


def measured_means(data: CalibrationData) -> pd.DataFrame:
    """Average the measurements of each cake as the fit does, with the ends of the 95 % interval.

    The column left_out_m_kg is the resistance that the other distributions' measurements predict; nan where none do.
    """
    rows = []
    for csd, pressure in data.cakes:
        own = of_cake(data.parity, csd, pressure)
        weight = own["relative_uncertainty"].to_numpy(np.float64) ** -2
        mean = float(np.average(np.log(own["measured_m_kg"].to_numpy(np.float64)), weights=weight))
        reach = float(reach_of(own)[0]) / math.sqrt(float(weight.sum()))
        row: dict[str, Any] = {"csd": csd, "pressure_kPa": math.nan if pressure is None else pressure}
        row |= {"measured_m_kg": math.exp(mean), "modelled_m_kg": float(own["modelled_m_kg"].iloc[0])}
        row |= {"measured_low_m_kg": math.exp(mean - reach), "measured_high_m_kg": math.exp(mean + reach)}
        rows.append({**row, "left_out_m_kg": math.exp(mean + float(own["left_out_ln_error"].iloc[0]))})
    return pd.DataFrame(rows)


def reach_of(parity: pd.DataFrame) -> FloatArray:
    """Return the standard errors to the ends of each measurement's 95 % interval; Student's with a scatter."""
    return np.array([quantile(freedom) for freedom in parity["scatter_freedom"].fillna(math.inf)])


def packed_level(data: CalibrationData) -> float:
    """Value of the property beside that packings have and that is nearest to the one taken or fitted."""
    packed = data.simulated[data.beside].to_numpy(np.float64)
    return float(packed[np.argmin(np.abs(packed - data.held))])


def packed_at(data: CalibrationData, cake: Cake, level: float) -> pd.DataFrame:
    """Average the accepted packings of a cake at a value of the property beside, all batches together.

    The columns are the property along which they were made, resistance_m_kg and resistance_ci95_m_kg, nan where no
    packing was accepted.
    """
    own = of_cake(data.simulated, *cake)
    rows = []
    for value, group in own[np.isclose(own[data.beside], level)].groupby(data.axis):
        values = np.exp(group.loc[group["status"] == "ok", "ln_resistance"].to_numpy(np.float64))
        mean = float(values.mean()) if values.size else math.nan
        rows.append(
            {data.axis: value, "resistance_m_kg": mean, "resistance_ci95_m_kg": half_width(values)},
        )
    return pd.DataFrame(rows, columns=[data.axis, "resistance_m_kg", "resistance_ci95_m_kg"])


def main_packings(data: CalibrationData, csds: Sequence[str]) -> pd.DataFrame:
    """Packings of some distributions without those of rival frictions, each once."""
    rows = data.packings[data.packings["csd"].isin(csds)]
    return rows if data.fits_both else rows[np.isclose(rows[data.beside], data.held)]


def fitted_packings(data: CalibrationData, *, rivals: bool = False) -> pd.DataFrame:
    """Packings of the measured distributions behind the fit; with ``rivals``, those of rival frictions too."""
    if rivals:
        return data.packings[data.packings["csd"].isin(data.measured)]
    return main_packings(data, data.measured)


def count(rows: pd.DataFrame) -> str:
    """Count packings, accepted and failed."""
    good = int((rows["status"] == "ok").sum())
    return f"{good} packing{'' if good == 1 else 's'}, {len(rows) - good or 'none'} failed"


def footer(figure: Figure, data: CalibrationData, packings: Sequence[str], engines: Iterable[str], *notes: str) -> None:
    """Write below a figure what was fitted, by which packings (see :func:`count`) and engines; and notes."""
    estimator = ESTIMATORS.get(data.summary["estimator"], data.summary["estimator"])
    names_of = {name: said for name, (said, _) in PROPERTIES.items()}
    what = (
        f"{names_of[data.axis]} and {names_of[data.beside]} fitted"
        if data.fits_both
        else f"{names_of[data.axis]} fitted at {held_words(data, data.held)}"
    )
    names = ", ".join(label_of(name) for name in sorted({str(engine) for engine in engines}))
    law = RESISTANCE_LAWS[data.summary["resistance_law"]].title
    said = f"{what}, resistances from the {estimator} by {law}"
    style.footer(figure, pd.DataFrame(), said, *packings, names, *notes)


def found_words(data: CalibrationData, parameter: str) -> str:
    """Write a fitted property with its value, its interval and its unit."""
    name, unit = PROPERTIES[parameter]
    return f"{name} {with_interval(*data.estimate(parameter), unit=unit)}"


def held_words(data: CalibrationData, value: float) -> str:
    """Write a value of the property held beside the fitted one."""
    name, unit = PROPERTIES[data.beside]
    return f"{name} {value:.3g}{unit}"


def cake_label(data: CalibrationData, cake: Cake, characters: int = 40) -> str:
    """Label of a cake: its distribution's, with the pressure where packings know one."""
    csd, pressure = cake
    label = data.label(csd, characters)
    return label if pressure is None else f"{label}, {pressure:g} kPa"


def panel_title(data: CalibrationData, characters: int) -> str:
    """Return the calibration's title in lines of so many characters."""
    return textwrap.fill(data.title, characters)


def with_interval(value: float, low: float, high: float, unit: str = "") -> str:
    """Write a value and its interval, as precisely as the interval is wide."""
    half = 0.5 * (high - low)
    digits = max(0, 1 - math.floor(math.log10(half))) if half > 0.0 else 3
    best, *ends = (f"{round(number, digits) + 0.0:.{digits}f}" for number in (value, low, high))
    return f"{best}{unit} (95 %: {ends[0]} to {ends[1]})"
