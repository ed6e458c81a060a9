"""Units that cannot be: every number of a measurement is in its range, but together they imply an impossible cake."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from filtercake.calibration.measurements import Measurements
from filtercake.errors import Problem
from filtercake.filtration.constant_pressure import FiltrationTest
from filtercake.filtration.resistance import implied_porosity
from filtercake.study.limits import LARGEST_POROSITY, SMALLEST_POROSITY
from filtercake.study.loading import LoadedStudy
from filtercake.units import KILOPASCAL, MILLIPASCAL_SECOND

LIKELY_POROSITY: Final = 0.4
"""Porosity that the right unit comes near."""


class Slip(NamedTuple):
    """A number that may have been given in another unit.

    Attributes
    ----------
    key : str
        Its key.
    unit : str
        The unit it may be in.
    factor : float
        From that unit to the key's.
    power : float
        Power of the number in the resistance.
    """

    key: str
    unit: str
    factor: float
    power: float


TEST_SLIPS: Final = (
    Slip("pressure_drop_kPa", "bar", 100.0, 1.0),
    Slip("pressure_drop_kPa", "MPa", 1000.0, 1.0),
    Slip("pressure_drop_kPa", "Pa", 1e-3, 1.0),
    Slip("pressure_drop_kPa", "mbar", 0.1, 1.0),
    Slip("pressure_drop_kPa", "psi", 6.895, 1.0),
    Slip("pressure_drop_kPa", "mmHg", 0.1333, 1.0),
    Slip("viscosity_mPa_s", "Pa s", 1000.0, -1.0),
    Slip("viscosity_mPa_s", "uPa s", 1e-3, -1.0),
    Slip("area_cm2", "m2", 1e4, 2.0),
    Slip("area_cm2", "mm2", 1e-2, 2.0),
    Slip("area_cm2", "dm2", 100.0, 2.0),
    Slip("solids_per_filtrate_kg_m3", "g/mL (kg/L)", 1000.0, -1.0),
    Slip("solids_per_filtrate_kg_m3", "mg/L", 1e-3, -1.0),
    Slip("solids_per_filtrate_kg_m3", "% (g/100 mL)", 10.0, -1.0),
)
"""What is mistaken in a test."""
VALUE_SLIPS: Final = (
    Slip("resistance_m_kg", "1e9 m/kg", 1e9, 1.0),
    Slip("resistance_m_kg", "1e10 m/kg", 1e10, 1.0),
    Slip("resistance_m_kg", "m/g", 1000.0, 1.0),
    Slip("resistance_m_kg", "cm/g", 10.0, 1.0),
    Slip("resistance_m_kg", "1/m2 (per volume of cake: divide by the solids' density and share)", 1e-3, 1.0),
)
"""What is mistaken in a resistance."""
USUAL: Final[dict[str, tuple[float, float]]] = {
    "pressure_drop_kPa": (2.0, 3000.0),
    "viscosity_mPa_s": (0.1, 500.0),
    "area_cm2": (0.5, 2e5),
    "solids_per_filtrate_kg_m3": (0.5, 2000.0),
}
"""What the keys of a test hold as a rule: a number outside is suspected first, and none is taken for right outside."""


def unit_problems(measurements: Measurements, study: LoadedStudy, file: str) -> Iterator[Problem]:
    """Say which measurements imply a porosity that no cake has, and the unit that explains it.

    Parameters
    ----------
    measurements : Measurements
        What was measured; distributions that the study lacks are passed over.
    study : LoadedStudy
        Whose distributions and material hold.
    file : str
        The file of measurements, for messages.
    """
    if study.model.material.trust_units:
        return
    tests = {test.name: test for test in measurements.tests}
    for entry in measurements.measurements:
        if entry.csd not in study.csds:
            continue
        porosity = _porosity(entry.resistance, entry.csd, study)
        if SMALLEST_POROSITY <= porosity <= LARGEST_POROSITY:
            continue
        given = _given(tests[entry.name]) if entry.name in tests else {"resistance_m_kg": entry.resistance}
        likely = _likely(entry.resistance, entry.csd, study, given)
        yield Problem(
            file,
            f"resistance of {entry.name}" + (f", {entry.source}" if entry.source else ""),
            f"{entry.resistance:.4g} m/kg",
            f"implies a porosity of {_shown(porosity)} for {entry.csd}, outside {SMALLEST_POROSITY:g} to "
            f"{LARGEST_POROSITY:g}: {_advice(likely)}; if all units are right, set material.trust_units: true in the "
            "study",
        )


def _shown(porosity: float) -> str:
    return f"{porosity:.3g}" if porosity < 0.999 else f"{porosity:.8g}"


def _given(test: FiltrationTest) -> dict[str, float]:
    return {
        "pressure_drop_kPa": test.pressure_drop / KILOPASCAL,
        "viscosity_mPa_s": test.viscosity / MILLIPASCAL_SECOND,
        "area_cm2": test.area * 1e4,
        "solids_per_filtrate_kg_m3": test.solids_per_filtrate,
    }


def _porosity(resistance: float, csd: str, study: LoadedStudy) -> float:
    material, law = study.model.material, study.model.resistance_law
    return implied_porosity(resistance, study.csds[csd].full, material.density, material.sphericity, law)


def _likely(
    resistance: float, csd: str, study: LoadedStudy, given: dict[str, float]
) -> list[tuple[Slip, float, float]]:
    """Slips that make the porosity possible, each with the number as it would be and that porosity, best first."""
    found = []
    for slip in (*TEST_SLIPS, *VALUE_SLIPS):
        if slip.key not in given:
            continue
        low, high = USUAL.get(slip.key, (0.0, math.inf))
        right = given[slip.key] * slip.factor
        porosity = _porosity(resistance * slip.factor**slip.power, csd, study)
        if low <= right <= high and SMALLEST_POROSITY <= porosity <= LARGEST_POROSITY:
            unusual = not low <= given[slip.key] <= high
            found.append((not unusual, abs(porosity - LIKELY_POROSITY), (slip, right, porosity)))
    return [entry for _, _, entry in sorted(found, key=lambda item: item[:2])]


def _advice(likely: Iterable[tuple[Slip, float, float]]) -> str:
    """Name the likeliest unit, and others that explain it as well."""
    said = [
        f"{slip.key} in {slip.unit}? ({right:.4g} gives {porosity:.3f})" for slip, right, porosity in list(likely)[:3]
    ]
    if not said:
        return "check the units of the test, of its readings, of the crystals' sizes and density"
    return "is " + ", or ".join(said)
