"""Numbers and column names as readers want them."""

from __future__ import annotations

import math
import re

import pandas as pd

from filtercake.figures.style import power_of_ten, scientific
from filtercake.packing.engines import label_of

UNITS = {
    "kJ_m3": "kJ/m³",
    "kg_m3": "kg/m³",
    "1_L_s": "1/(L s)",
    "mJ_m2": "mJ/m²",
    "mPa_s": "mPa s",
    "m3_h": "m³/h",
    "m_kg": "m/kg",
    "m_s": "m/s",
    "1_m": "1/m",
    "MPa": "MPa",
    "kPa": "kPa",
    "rpm": "rpm",
    "min": "min",
    "um": "µm",
    "us": "µs",
    "mm": "mm",
    "m2": "m²",
    "m3": "m³",
    "s": "s",
}
"""Units at the end of a column's name, longer ones first."""
NAMES = {
    "csd": "distribution",
    "n_failed": "failed",
    "sd": "standard deviation of one packing",
    "deviation_sd": "distance in standard deviations",
    "porosity": "porosity of the interior",
    "porosity_at_medium": "porosity at the medium",
    "compressibility": "compressibility n",
    "load_over_strength": "pressure over what the contacts hold",
    "porosity_paper_count": "porosity as the paper counts",
    "resistance_additive": "resistance by eq. 3 (additive)",
    "resistance_carman": "resistance by Carman (Sauter mean)",
    "resistance_sauter": "resistance by Carman's form with eq. 3's constant",
    "resistance_law": "law of the resistance",
    "resistance_law_ci95": "half-width of the law's own 95 % interval",
    "resistance_truncated": "resistance of the packed classes alone",
    "overlap_max": "largest overlap over diameter",
    "wall": "time of one packing",
}
"""Columns whose names say too little to a reader, without their unit."""
INTERVAL = "_ci95"
_UNIT = re.compile(rf"^(?P<name>.+?)_(?P<unit>{'|'.join(UNITS)})$")
LARGE, SMALL = 1e5, 1e-3
"""Numbers beyond these are written as multiples of a power of ten."""


def split_unit(column: str) -> tuple[str, str]:
    """Split a column's name into what it holds and its unit for readers ("" without one)."""
    found = _UNIT.match(column)
    return (found["name"], UNITS[found["unit"]]) if found else (column, "")


def heading(column: str) -> str:
    """Heading of a column: ``resistance_m_kg`` is "resistance (m/kg)"."""
    name, unit = split_unit(column)
    if name.endswith(INTERVAL) and name not in NAMES:
        return f"{heading(interval_owner(column))}: half-width of the 95 % interval"
    words = NAMES.get(name, name.replace("_", " "))
    return f"{words} ({unit})" if unit else words


def interval_owner(column: str) -> str:
    """Column that an interval's half-width belongs to: ``resistance_m_kg`` of ``resistance_ci95_m_kg``."""
    return column.replace(INTERVAL, "")


def number(value: float, digits: int = 4) -> str:
    """Write a number with so many digits, very large and small ones as multiples of a power of ten."""
    if not math.isfinite(value):
        return "–"
    if value and not SMALL <= abs(value) < LARGE:
        return scientific(value, digits).replace("-", "−")
    return f"{float(f'{value:.{digits}g}'):g}".replace("-", "−")


def with_interval(value: float, half: float, unit: str = "") -> str:
    """Write a value and the half-width of its 95 % interval, with two digits of the latter, and their unit.

    A half-width that is not known (a single packing) is a dash.
    """
    behind = f" {unit}" if unit else ""
    if not math.isfinite(value):
        return "no accepted packing"
    if not half > 0.0:
        return f"{number(value)} ± {number(half)}{behind}"
    largest = max(abs(value), half)
    exponent = math.floor(math.log10(largest)) if not SMALL <= largest < LARGE else 0
    digits = max(0, 1 - math.floor(math.log10(half / 10.0**exponent)))
    best, error = (f"{part / 10.0**exponent:.{digits}f}".replace("-", "−") for part in (value, half))
    if exponent:
        return f"({best} ± {error})·{power_of_ten(exponent)}{behind}"
    return f"{best} ± {error}{behind}"


def cell(value: object) -> str:
    """Write a value of a table; empty where there is none."""
    if isinstance(value, float):
        return number(value) if math.isfinite(value) else ""
    return "" if value is None or value is pd.NA else str(value)


def readable(table: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of a table for readers; empty columns are left out.

    The half-width of an interval, ``x_ci95_unit``, stands beside its value, ``x_unit``.
    """
    halves = {interval_owner(name): name for name in table.columns if INTERVAL in name}
    halves = {owner: name for owner, name in halves.items() if owner in table.columns}
    shown = [
        name for name in table.columns if name not in halves.values() and (table.empty or table[name].notna().any())
    ]
    headings = [f"{heading(name)}, ± 95 %" if name in halves else heading(name) for name in shown]
    rows = [
        [
            with_interval(float(row[name]), float(row[halves[name]]))
            if name in halves
            else cell(label_of(row[name]) if name == "engine" else row[name])
            for name in shown
        ]
        for row in table.to_dict("records")
    ]
    return headings, rows


def plural(count: int, noun: str) -> str:
    """Count something: "1 packing", "3 packings", "no packings"."""
    return f"{count or 'no'} {noun}{'' if count == 1 else 's'}"
