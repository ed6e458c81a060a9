"""Filtration tests without a calibration: the resistances that they give, and what was left out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filtercake.api.arguments import ORIGIN
from filtercake.calibration.measurements import FiltrationConditions, filtration_test_of, load_measurements, said
from filtercake.filtration.analysis import FiltrationAnalysis, analyse
from filtercake.filtration.constant_pressure import FiltrationTest
from filtercake.study.parsing import parse


@dataclass(frozen=True)
class FiltrationResult:
    """What a filtration test says of cake and medium.

    Attributes
    ----------
    name : str
        The test's name.
    resistance_m_kg, resistance_ci95_m_kg : float
        Specific cake resistance alpha and the half-width of its 95 % interval, m/kg.
    medium_resistance_1_m, medium_resistance_ci95_1_m : float
        The same of the medium's resistance Rm, 1/m.
    time_zero_s : float
        Time of the clock at which the filtration began, s.
    form : str
        ``integral`` or ``differential``: what the answer is of.
    readings, readings_left_out : int
        Readings of the file that count, and those of them that were left out of the fit.
    notes : tuple of str
        Repairs, what was left out and why, and what is in doubt.
    """

    name: str
    resistance_m_kg: float
    resistance_ci95_m_kg: float
    medium_resistance_1_m: float
    medium_resistance_ci95_1_m: float
    time_zero_s: float
    form: str
    readings: int
    readings_left_out: int
    notes: tuple[str, ...]


def filtration_test(file: str | Path, **conditions: Any) -> FiltrationResult:
    """Fit a filtration test at constant pressure.

    Parameters
    ----------
    file : str or Path
        CSV with a column of times and one of filtrate volumes or masses, units in the header.
    **conditions
        ``area_cm2``, ``pressure_drop_kPa``, ``viscosity_mPa_s``, ``solids_per_filtrate_kg_m3``; where a balance was
        read, ``filtrate_density_kg_m3``; for tests of two to four readings, ``relative_reading_error``.

    Raises
    ------
    ConfigError, FiltrationError
        With every problem of the conditions, or what is wrong with the readings.
    """
    path = Path(file)
    test = filtration_test_of(parse(FiltrationConditions, conditions, str(ORIGIN)), path.stem, "", path)
    return _result(test, analyse(test))


def filtration_tests(file: str | Path) -> list[FiltrationResult]:
    """Fit all tests of a file of measurements (YAML).

    Raises
    ------
    ConfigError
        With every problem found in the file and the files it names.
    """
    found = load_measurements(Path(file))
    return [_result(test, result) for test, result in zip(found.tests, found.results, strict=True)]


def _result(test: FiltrationTest, found: FiltrationAnalysis) -> FiltrationResult:
    return FiltrationResult(
        name=test.name,
        resistance_m_kg=found.resistance,
        resistance_ci95_m_kg=found.resistance_ci95,
        medium_resistance_1_m=found.medium_resistance,
        medium_resistance_ci95_1_m=found.medium_resistance_ci95,
        time_zero_s=found.time_zero,
        form=found.form,
        readings=int(test.time.size),
        readings_left_out=found.integral.left_out,
        notes=said(test, found),
    )
