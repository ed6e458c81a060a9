"""Named units a user meets, as SI factors, and the helpers that read them from column headers."""

from __future__ import annotations

import re
from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MICROMETRE: Final = 1e-6
MICROSECOND: Final = 1e-6
MINUTE: Final = 60.0
HOUR: Final = 3600.0
LITRE: Final = 1e-3
KILOJOULE_PER_M3: Final = 1e3
MEGAPASCAL: Final = 1e6
KILOPASCAL: Final = 1e3
GIGAPASCAL: Final = 1e9
MILLIJOULE_PER_M2: Final = 1e-3
MILLIPASCAL_SECOND: Final = 1e-3
GRAVITY: Final = 9.81
"""Gravitational acceleration, m/s2 (physical constant used by the paper's script)."""

LENGTH_UNITS: Final[dict[str, float]] = {
    "m": 1.0,
    "mm": 1e-3,
    "um": 1e-6,
    "µm": 1e-6,  # micro sign U+00B5
    "μm": 1e-6,  # Greek mu U+03BC
    "micron": 1e-6,
    "nm": 1e-9,
}
FRACTION_UNITS: Final[dict[str, float]] = {"": 1.0, "-": 1.0, "1": 1.0, "%": 0.01, "percent": 0.01}

NUMBER: Final = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
"""A number as text: plain digits, without the underscores, infinities and NaN that Python would take."""

_HEADER = re.compile(r"^\s*(?P<name>.*?)\s*(?:[\[(]\s*(?P<bracket>[^\])]*)\s*[\])])?\s*$")


def tidy(value: float) -> float:
    """Undo the last bit lost in a change of unit, so that 50 kJ/m3 is written 50.0."""
    return float(f"{value:.12g}")


def duration(seconds: float) -> str:
    """Write a time as a reader would say it."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = seconds / MINUTE
    return f"{minutes:.0f} min" if minutes < 90.0 else f"{minutes / 60.0:.1f} h"


def split_header(header: str) -> tuple[str, str | None]:
    """Split a column header into its name and unit.

    Parameters
    ----------
    header : str
        For example ``size_um``, ``size (um)``, ``size [mm]`` or ``volume_fraction``.

    Returns
    -------
    tuple of str and (str or None)
        The bare name in lower case and the unit, None where the header states none.
    """
    match = _HEADER.match(header)
    name, unit = (match["name"], match["bracket"]) if match else (header, None)
    name = name.strip().lower().replace(" ", "_")
    if unit is None and "_" in name:
        stem, last = name.rsplit("_", 1)
        if last in LENGTH_UNITS or last in ("percent", "%"):
            return stem, last
    return name, unit.strip() if unit is not None else None
