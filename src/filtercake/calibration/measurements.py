"""Measured cake resistances: constant-pressure tests from the user's CSV files, or resistances given directly."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from filtercake.calibration.pooling import chi_square, improbable, scatter
from filtercake.errors import ConfigError, FiltrationError, Problem
from filtercake.filtration.analysis import FiltrationAnalysis, analyse
from filtercake.filtration.constant_pressure import (
    MINIMUM_READINGS,
    READING_ERROR,
    BoolArray,
    CompressibilityFit,
    FiltrationFit,
    FiltrationTest,
    compressibility,
)
from filtercake.statistics import quantile
from filtercake.study.config.values import MOST_VALUES, TO_NUMBER, TO_TEXT, Model, Name, PathText
from filtercake.study.parsing import parse
from filtercake.units import HOUR, KILOPASCAL, MILLIPASCAL_SECOND, MINUTE, NUMBER, FloatArray, IntArray
from filtercake.user_files import Unusable, read_text, read_yaml

if TYPE_CHECKING:
    import pandas as pd

TIME_UNITS: Final[dict[str, float]] = {"s": 1.0, "min": MINUTE, "h": HOUR}
MASS_UNITS: Final[dict[str, float]] = {"kg": 1.0, "g": 1e-3, "mg": 1e-6}
VOLUME_UNITS: Final[dict[str, float]] = {"m3": 1.0, "L": 1e-3, "mL": 1e-6, "cm3": 1e-6, "uL": 1e-9}

LARGEST_FILE: Final = 10_000_000
"""Bytes of a CSV beyond which it is surely not a filtration test."""

MOST_TESTS: Final = 100
"""Filtration tests of a file."""

BALANCE_RESOLUTION: Final = 0.005
"""Share of the final volume by which a reading may fall below an earlier one and is left out, not refused."""

SAME_PRESSURE: Final = 0.01
"""Pressure drops that differ by less than this share are the same."""

SAME_TIME: Final = 0.10
"""Share of the larger by which volumes read at the same time may differ and are averaged, not refused; in any case
they may by ``BALANCE_RESOLUTION`` of the final volume."""

REPEATABILITY: Final = 0.05
"""Relative standard deviation from run to run that contradicts nothing; a test's fit knows nothing of it."""

SMALLEST_RELATIVE_SE: Final = 1e-6
"""Relative standard error of a resistance from data without noise."""

STAMPED: Final = 1.5
"""Steps of the clock's resolution that volumes read at the same time may lie apart, at the flow around them."""

LONG_RUNNING: Final = 1e6
"""Lengths of the test in a clock's first reading that show a count from long before (1970)."""

DAY: Final = 86_400.0
"""Seconds of a day."""

FIT_COLUMNS: Final = (
    "test",
    "csd",
    "form",
    "resistance_m_kg",
    "resistance_ci95_m_kg",
    "medium_resistance_1_m",
    "medium_resistance_ci95_1_m",
    "points",
    "points_left_out",
    "pressure_drop_kPa",
    "notes",
)

COMPRESSIBILITY_COLUMNS: Final = (
    "csd",
    "reference_pressure_kPa",
    "resistance_m_kg",
    "resistance_low_m_kg",
    "resistance_high_m_kg",
    "exponent",
    "exponent_ci95",
    "points",
    "notes",
)

Kind = Literal["time", "volume", "mass"]

_SQUARE_CENTIMETRE: Final = 1e-4
_SEPARATORS: Final = ("\t", ";", ",")
_NAMES: Final[dict[Kind, tuple[str, ...]]] = {
    "time": ("t", "time", "filtration_time", "elapsed_time", "time_elapsed", "clock", "clock_time", "timestamp"),
    "mass": ("m", "mass", "filtrate_mass", "mass_of_filtrate", "mass_filtrate", "m_filtrate", "weight", "balance"),
    "volume": ("v", "volume", "filtrate", "filtrate_volume", "volume_of_filtrate", "volume_filtrate", "v_filtrate"),
}
_OTHER_CASE: Final = ("T", "v")
"""As likely temperature and velocity: taken for time and volume only if their unit is one of those."""
_EXAMPLE: Final = "for example time_s,volume_mL or t [s];V [L]"
_WANTED_HEADER: Final = f"names a column of times and one of filtrate volumes with their units, {_EXAMPLE}"
_WITH_UNIT: Final = re.compile(r"(?P<name>[^\[(/]*?)\s*(?:[\[(]\s*(?P<unit>[^\])]*?)\s*[\])]|/\s*(?P<slash>\S+))")

_CLOCK_UNIT: Final = re.compile(r"h+:m+(:s+)?|m+(in)?:s+")
"""What a header may give as the unit of clock times."""
_CLOCK: Final = re.compile(
    r"(?:(?P<date>[0-9]{4}-[0-9]{2}-[0-9]{2}|[0-9]{1,2}\.[0-9]{1,2}\.[0-9]{4})[T ]\s*)?"
    r"(?P<first>[0-9]{1,3}):(?P<second>[0-5][0-9])(?::(?P<third>[0-5][0-9](?:\.[0-9]+)?))?\s*(?P<half>[AaPp][Mm])?Z?"
)


class FiltrationConditions(Model):
    """At what a filtration test was made, and how its readings are to be understood."""

    area_cm2: Annotated[float, Field(ge=1e-4, le=1e8, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Filter area, cm2."
    )
    pressure_drop_kPa: Annotated[float, Field(ge=0.001, le=10_000, allow_inf_nan=False), TO_NUMBER] = Field(  # noqa: N815
        description="Pressure drop across cake and medium, kPa."
    )
    viscosity_mPa_s: Annotated[float, Field(ge=0.001, le=1e6, allow_inf_nan=False), TO_NUMBER] = Field(  # noqa: N815
        description="Viscosity of the filtrate, mPa s."
    )
    solids_per_filtrate_kg_m3: Annotated[float, Field(ge=0.001, le=1e5, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Dry cake mass per volume of filtrate, kg/m3 (= g/L)."
    )
    filtrate_density_kg_m3: Annotated[float, Field(ge=300, le=20_000, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None, description="Density of the filtrate, kg/m3, where a balance gave its mass instead of its volume."
    )
    relative_reading_error: Annotated[float, Field(ge=1e-4, le=0.5, allow_inf_nan=False), TO_NUMBER] = Field(
        default=READING_ERROR,
        description="Standard error of a time or volume over its value, for tests of two to four readings; more tell "
        "their errors by their scatter.",
    )


class ConstantPressureTest(FiltrationConditions):
    """A filtration test at constant pressure, whose readings are in a CSV file."""

    name: Annotated[str, Field(min_length=1, max_length=60), TO_TEXT] | None = Field(
        default=None, description="Name in tables and figures; the file's name without its ending if left out."
    )
    csd: Name = Field(description="Name of a distribution of the study.")
    file: PathText = Field(
        description="CSV with a column of times and one of filtrate volumes or masses, units in the header "
        "(time_s,volume_mL); path relative to this file."
    )


class KnownResistance(Model):
    """A cake resistance that was measured elsewhere."""

    name: Annotated[str, Field(min_length=1, max_length=60), TO_TEXT] | None = Field(
        default=None, description="Name in tables and figures; the distribution's if left out."
    )
    csd: Name = Field(description="Name of a distribution of the study.")
    resistance_m_kg: Annotated[float, Field(ge=1, le=1e20, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Specific cake resistance, m/kg."
    )
    relative_uncertainty: Annotated[float, Field(ge=1e-6, le=1, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Its standard deviation over its value."
    )
    source: Annotated[str, Field(max_length=120), TO_TEXT] = Field(description="Where it is from.")
    pressure_drop_kPa: Annotated[float, Field(ge=0.001, le=10_000, allow_inf_nan=False), TO_NUMBER] | None = Field(  # noqa: N815
        default=None, description="Pressure drop it was measured at, kPa."
    )


class MeasurementFile(Model):
    """Measured cake resistances: filtration tests, values, or both."""

    title: Annotated[str, Field(max_length=120), TO_TEXT] = Field(default="", description="One line for figures.")
    tests: Annotated[list[ConstantPressureTest], Field(max_length=MOST_TESTS)] = Field(
        default=[], description="Filtration tests at constant pressure."
    )
    resistances: Annotated[list[KnownResistance], Field(max_length=MOST_VALUES)] = Field(
        default=[], description="Resistances that are known already."
    )

    @model_validator(mode="after")
    def _something(self) -> MeasurementFile:
        if not self.tests and not self.resistances:
            raise ValueError("needs at least one entry in tests or in resistances")
        return self


class Readings(NamedTuple):
    """The readings of a test and what was done to them.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Times, s.
    volume : ndarray, shape (n,)
        Volumes of filtrate, m3.
    notes : tuple of str
        Every repair.
    lines : tuple of int
        Line of each reading in its file.
    known_zero : bool
        Whether time 0 is, as far as the file tells, when the filtration began.
    """

    time: FloatArray
    volume: FloatArray
    notes: tuple[str, ...]
    lines: tuple[int, ...]
    known_zero: bool


class BothForms(NamedTuple):
    """The fits of one test."""

    integral: FiltrationFit
    differential: FiltrationFit


@dataclass(frozen=True)
class Measurement:
    """A measured specific cake resistance.

    Attributes
    ----------
    name : str
        Its name, different from all others.
    csd : str
        Name of the crystals' size distribution.
    resistance : float
        Specific cake resistance, m/kg.
    relative_se : float
        Its standard error over its value, positive (see :func:`load_measurements`).
    pressure_drop : float or None
        Pressure drop, Pa, where it is known.
    source : str
        Where it is from.
    """

    name: str
    csd: str
    resistance: float
    relative_se: float
    pressure_drop: float | None
    source: str


@dataclass(frozen=True, eq=False)
class Measurements:
    """Everything a file of measurements says.

    Attributes
    ----------
    title : str
        One line for figures.
    tests : tuple of FiltrationTest
        The filtration tests.
    fits : tuple of BothForms
        Their fits, in the same order.
    results : tuple of FiltrationAnalysis
        What each of them says.
    measurements : tuple of Measurement
        All measured resistances: the tests', then those given directly.
    warnings : tuple of str
        Every repair, and all that is doubtful.
    files : tuple of Path
        The file itself and the tests' readings.
    contradictions : tuple of str
        Measurements of one distribution at one pressure that contradict each other, in sentences; warnings too.
    """

    title: str
    tests: tuple[FiltrationTest, ...]
    fits: tuple[BothForms, ...]
    measurements: tuple[Measurement, ...]
    warnings: tuple[str, ...]
    files: tuple[Path, ...] = ()
    contradictions: tuple[str, ...] = ()
    results: tuple[FiltrationAnalysis, ...] = ()


def load_measurements(path: Path) -> Measurements:
    """Read and check a file of measurements and the tests it names, and fit the tests.

    The relative error of a test's resistance is that of its analysis, with all that its readings leave in doubt (see
    :mod:`filtercake.filtration.analysis`); that of a value given directly is the one stated. Where other measurements,
    tests or values, have the same distribution and pressure drop (within 1 %), the scatter of ln(alpha) between them is
    added, since a fit's own error says nothing of what differs from run to run (see
    :func:`filtercake.calibration.pooling.scatter`).

    Parameters
    ----------
    path : Path
        YAML with the keys of :class:`MeasurementFile`.

    Raises
    ------
    ConfigError
        With every problem found in the file and the files it names.
    """
    model = parse(MeasurementFile, read_yaml(path), str(path))
    problems = list(_name_problems(model, str(path)))
    tests: list[FiltrationTest] = []
    results: list[FiltrationAnalysis] = []
    for index, entry in enumerate(model.tests):
        try:
            test = _load_test(entry, path.parent)
            results.append(analyse(test))
            tests.append(test)
        except FiltrationError as error:
            problems.append(Problem(str(path), f"tests[{index}].file", repr(entry.file), str(error)))
    if problems:
        raise ConfigError(problems)
    files = (path, *(path.parent / entry.file for entry in model.tests))
    sources = [f"{entry.file} ({found.form} form)" for entry, found in zip(model.tests, results, strict=True)]
    alone = [*_of_tests(tests, results, sources), *_of_values(model.resistances, [test.name for test in tests])]
    measured = tuple(_with_scatter(alone))
    contradictions = tuple(_contradictions(alone, [test.name for test in tests]))
    doubts = [f"{test.name}: {text}" for test, found in zip(tests, results, strict=True) for text in said(test, found)]
    fits = tuple(BothForms(found.integral, found.differential) for found in results)
    warnings = tuple(f"{path}: {text}" for text in (*doubts, *contradictions))
    return Measurements(model.title, tuple(tests), fits, measured, warnings, files, contradictions, tuple(results))


def said(test: FiltrationTest, found: FiltrationAnalysis) -> tuple[str, ...]:
    """Return all that must be known of a test: repairs of its readings, what was left out, what is in doubt."""
    return (*test.notes, *found.notes)


def compressibility_by_csd(measurements: Measurements) -> dict[str, CompressibilityFit]:
    """Fit the compressibility of every distribution that was measured at different pressures.

    Resistances without a pressure are left out.

    Raises
    ------
    FiltrationError
        As :func:`filtercake.filtration.constant_pressure.compressibility`.
    """
    fits = {}
    for csd, entries in with_pressure(measurements).items():
        pressure = [entry.pressure_drop or math.nan for entry in entries]
        if max(pressure) > (1.0 + SAME_PRESSURE) * min(pressure):
            errors = [entry.relative_se for entry in entries]
            fits[csd] = compressibility(pressure, [entry.resistance for entry in entries], errors)
    return fits


def pressure_effects(measurements: Measurements) -> dict[str, str]:
    """Say by distribution, in a sentence, where the resistance changes with pressure beyond its errors.

    Raises
    ------
    FiltrationError
        As :func:`filtercake.filtration.constant_pressure.compressibility`.
    """
    pressed = with_pressure(measurements)
    found = {}
    for csd, fit in compressibility_by_csd(measurements).items():
        pressures = [(entry.pressure_drop or math.nan) / KILOPASCAL for entry in pressed[csd]]
        half = exponent_limit(fit, pressures, [entry.relative_se for entry in pressed[csd]])
        if abs(fit.exponent) > half:
            found[csd] = (
                f"the resistance of {csd} {'rises' if fit.exponent > 0.0 else 'falls'} with pressure from "
                f"{min(pressures):g} to {max(pressures):g} kPa (exponent {fit.exponent:.2g} ± {half:.1g})"
            )
    return found


def exponent_limit(fit: CompressibilityFit, pressures: Sequence[float], errors: Sequence[float]) -> float:
    """Half-width of the 95 % interval of a fit's exponent; of two points' by their own relative errors."""
    if math.isfinite(fit.exponent_ci95):
        return fit.exponent_ci95
    one, other = pressures
    return quantile() * math.hypot(*errors) / abs(math.log(one / other))


def with_pressure(measurements: Measurements) -> dict[str, list[Measurement]]:
    """Return the measurements whose pressure is known by distribution, in the order of the file."""
    found: dict[str, list[Measurement]] = {}
    for entry in measurements.measurements:
        if entry.pressure_drop is not None:
            found.setdefault(entry.csd, []).append(entry)
    return found


def fits_table(measurements: Measurements) -> pd.DataFrame:
    """Tabulate both forms' fits of every test, over the readings used and from the time zero found.

    Returns
    -------
    DataFrame
        The columns of ``FIT_COLUMNS``, two rows per test; notes on readings and fit are joined by ``"; "``.
    """
    import pandas as pd  # who looks at one test needs no table

    rows = [
        (
            test.name,
            test.csd,
            fit.form,
            fit.resistance,
            fit.resistance_ci95,
            fit.medium_resistance,
            fit.medium_resistance_ci95,
            fit.n,
            fit.left_out,
            test.pressure_drop / KILOPASCAL,
            "; ".join(said(test, found)),
        )
        for test, found in zip(measurements.tests, measurements.results, strict=True)
        for fit in (found.integral, found.differential)
    ]
    return pd.DataFrame(rows, columns=list(FIT_COLUMNS))


def compressibility_table(measurements: Measurements) -> pd.DataFrame:
    """Tabulate the compressibility of every distribution that was measured at different pressures.

    Returns
    -------
    DataFrame
        The columns of ``COMPRESSIBILITY_COLUMNS``: resistance and 95 % interval at the reference pressure, exponent and
        half-width (blank where two points determine it); notes are joined by ``"; "``.
    """
    import pandas as pd

    rows = [
        (
            csd,
            fit.reference_pressure / KILOPASCAL,
            fit.alpha0,
            fit.alpha0_low,
            fit.alpha0_high,
            fit.exponent,
            fit.exponent_ci95,
            fit.n,
            "; ".join(fit.notes),
        )
        for csd, fit in compressibility_by_csd(measurements).items()
    ]
    return pd.DataFrame(rows, columns=list(COMPRESSIBILITY_COLUMNS))


def read_test(path: Path, filtrate_density: float | None = None) -> Readings:
    """Read times and volumes of filtrate from a CSV.

    Columns are separated by tabs, semicolons or commas; their names and units stand in one line (``time_s,volume_mL``,
    ``t [s];V [L]``, ``time_s;mass_g``), other columns are ignored. Times may be clock times (HH:MM:SS, with or without
    a date). Blank lines and lines that begin with # are skipped. Repairs, each with a note: lines of text above the
    columns' names are skipped; decimal commas are read where the separator is no comma; clock times go on over
    midnight; a volume at time zero was there before, and is taken off all; volumes read at the same time are averaged
    if they hardly differ (``SAME_TIME``) or the clock's resolution explains it (``STAMPED``); a volume below an earlier
    one is left out if it falls by at most ``BALANCE_RESOLUTION`` of the largest; readings without time or volume are
    left out (the first one silently).

    Parameters
    ----------
    path : Path
        UTF-8 text, at most ``LARGEST_FILE`` bytes.
    filtrate_density : float, optional
        Density of the filtrate, kg/m3, which makes volumes of masses.

    Raises
    ------
    FiltrationError
        For anything else, with file, line, value and what is allowed.
    """
    lines = _lines(path)
    header = _header(path, lines)
    notes = []
    if header.position:
        notes.append(f"{_lines_text([n for n, _ in lines[: header.position]])} above the column header skipped")
    cells = _cells(path, header, lines[header.position + 1 :])
    if _has_decimal_commas(path, header, cells):
        cells = [(line, time.replace(",", "."), amount.replace(",", ".")) for line, time, amount in cells]
        notes.append("decimal commas read as decimal points")
    line = np.array([n for n, _, _ in cells], dtype=np.int64)
    clock = _times(path, header, cells)
    amount = np.array([_number(path, n, header.kind, text) for n, _, text in cells])
    readings = _Rows(line, clock.time, amount * _volume_factor(path, header, filtrate_density))
    notes += clock.notes
    known_zero = clock.known_zero(readings.volume)
    for repair in (_ascending, _begun, _merged, _rising, _started):
        readings, found = repair(path, readings, clock)
        notes += found
    if readings.time.size < MINIMUM_READINGS:
        raise FiltrationError(
            f"{path}: {readings.time.size} usable readings: must be at least {MINIMUM_READINGS} with time and volume "
            "above zero"
        )
    return Readings(readings.time, readings.volume, tuple(notes), tuple(readings.line.tolist()), known_zero)


class _Rows(NamedTuple):
    """Readings under repair, with the line each stands in; all of shape (n,)."""

    line: IntArray
    time: FloatArray
    volume: FloatArray


class _Header(NamedTuple):
    """Where and what the column header is: line, columns, the columns of time and filtrate, and their units."""

    position: int
    line: int
    separator: str
    columns: int
    time: int
    time_unit: str | None
    kind: Kind
    amount: int
    amount_unit: str | None


class _Clock(NamedTuple):
    """Times of the readings, shape (n,), and how they were given."""

    time: FloatArray
    resolution: float
    of_day: bool
    notes: tuple[str, ...]

    def known_zero(self, volume: FloatArray) -> bool:
        """Whether time zero is when the filtration began: by a stopwatch, or a first reading without filtrate."""
        return not self.of_day or (volume.size > 0 and volume[0] == 0.0)


def _lines(path: Path) -> list[tuple[int, str]]:
    """Lines that hold something, with their numbers."""
    try:
        text = read_text(path, LARGEST_FILE)
    except Unusable as error:
        raise FiltrationError(f"{path}: {error}") from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise FiltrationError(f"{path}: line {line}: must be text, not binary data")
    lines = enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1)
    return [(n, line) for n, line in lines if line.strip(" \t;,") and not line.lstrip().startswith("#")]


def _split(path: Path, line: int, text: str, separator: str) -> list[str]:
    try:
        cells = next(csv.reader([text], delimiter=separator)) if '"' in text else text.split(separator)
    except csv.Error as error:
        raise FiltrationError(f"{path}: line {line}: is not CSV ({error})") from None
    return [cell.strip() for cell in cells]


def _header(path: Path, lines: Sequence[tuple[int, str]]) -> _Header:
    """Find the first line that names a column of times and one of volumes, or of masses."""
    for position, (line, text) in enumerate(lines):
        for separator in _SEPARATORS:
            cells = _split(path, line, text, separator)
            columns = [_column(cell) for cell in cells]
            kinds = {kind for kind, _ in columns}
            amount: Kind = "volume" if "volume" in kinds else "mass"
            if {"time", amount} <= kinds:
                at, of = (_the_column(path, line, columns, wanted) for wanted in ("time", amount))
                return _Header(position, line, separator, len(cells), *at, amount, *of)
            if len(cells) > 1 and all(NUMBER.fullmatch(cell.replace(",", ".")) for cell in cells):
                raise FiltrationError(
                    f"{path}: line {line}: {_shown(text)}: numbers, but no line above {_WANTED_HEADER}"
                )
    raise FiltrationError(f"{path}: no line {_WANTED_HEADER}; separators: comma, semicolon or tab")


def _column(cell: str) -> tuple[Kind | None, str | None]:
    """Tell whether a column holds times, volumes or masses, and the unit its header states."""
    match = _WITH_UNIT.fullmatch(cell)
    name, unit = (match["name"], match["unit"] or match["slash"]) if match else (cell, None)
    kind = _kind(name)
    if kind is None and unit is None:
        words = re.split(r"[\s_]+", name)
        stem, unit = "_".join(words[:-1]), words[-1]
        name, kind = stem, _kind(stem)
    if kind is not None and name.strip() in _OTHER_CASE and _factor(unit, _units(kind)) is None:
        return None, None
    return kind, unit if kind is not None else None


def _kind(name: str) -> Kind | None:
    plain = re.sub(r"[\s_-]+", "_", name.strip().lower())
    return next((kind for kind, names in _NAMES.items() if plain in names), None)


def _units(kind: Kind) -> dict[str, float]:
    return {"time": TIME_UNITS, "volume": VOLUME_UNITS, "mass": MASS_UNITS}[kind]


def _factor(unit: str | None, units: dict[str, float]) -> float | None:
    """SI factor of a unit in any case; not of ML, which is a megalitre."""
    plain = (unit or "").replace("^", "").translate(str.maketrans("³µμ", "3uu"))
    if plain in ("ML", "Ml"):
        return None
    return units.get(plain) or {name.lower(): factor for name, factor in units.items()}.get(plain.lower())


def _the_column(
    path: Path, line: int, columns: Sequence[tuple[Kind | None, str | None]], wanted: Kind
) -> tuple[int, str | None]:
    """Index of the one column of a kind, and its unit."""
    found = [(index, unit) for index, (kind, unit) in enumerate(columns) if kind == wanted]
    if len(found) > 1:
        raise FiltrationError(f"{path}: line {line}: {len(found)} columns of {wanted}: must be exactly one")
    return found[0]


def _known_factor(path: Path, line: int, kind: Kind, unit: str | None) -> float:
    """SI factor of the unit of a column."""
    units = _units(kind)
    factor = _factor(unit, units)
    if factor is None:
        says = f"has the unit {unit!r}" if unit else "has no unit"
        raise FiltrationError(
            f"{path}: line {line}: the column of {kind} {says}: must be one of {', '.join(units)}, {_EXAMPLE}"
        )
    return factor


def _volume_factor(path: Path, header: _Header, density: float | None) -> float:
    """Return what makes m3 of the column of filtrate."""
    factor = _known_factor(path, header.line, header.kind, header.amount_unit)
    if header.kind == "volume":
        return factor
    if density is None:
        raise FiltrationError(
            f"{path}: line {header.line}: holds masses of filtrate: give filtrate_density_kg_m3, the filtrate's "
            "density (water 998, ethanol 789 at 20 C), or a column of volumes"
        )
    return factor / density


def _times(path: Path, header: _Header, cells: Sequence[tuple[int, str, str]]) -> _Clock:
    """Read times in s: numbers with the header's unit, or clock times; those of the day from the first reading on."""
    as_clock = any(":" in text for _, text, _ in cells)
    if as_clock:
        time, of_day, notes = _clock_times(path, header, cells)
        resolution = _resolution(text.partition(".")[2].rstrip("AaPpMmZ ") for _, text, _ in cells)
    else:
        factor = _known_factor(path, header.line, "time", header.time_unit)
        given = np.array([_number(path, n, "time", text) for n, text, _ in cells])
        decimals = ("9" * 9 if set(text) & set("eE") else text.partition(".")[2] for _, text, _ in cells)
        time, of_day, notes = given * factor, False, []
        resolution = factor * _resolution(decimals)
    if not of_day and time.size > 1 and time[0] > LONG_RUNNING * (time[-1] - time[0]):
        of_day = True  # a clock that was not started for the test
    if of_day and time.size:
        time = time - time[0]
        notes.append(f"times are counted from line {cells[0][0]}")
    return _Clock(time, resolution, of_day, tuple(notes))


def _resolution(decimals: Iterable[str]) -> float:
    """Step of numbers with these decimals, in their unit."""
    return float(10.0 ** -max((len(text) for text in decimals), default=0))


def _clock_times(
    path: Path, header: _Header, cells: Sequence[tuple[int, str, str]]
) -> tuple[FloatArray, bool, list[str]]:
    """Seconds of clock times, whether they are of the day, and notes."""
    matches = [_CLOCK.fullmatch(text) for _, text, _ in cells]
    for match, (line, text, _) in zip(matches, cells, strict=True):
        if match is None:
            raise FiltrationError(f"{path}: line {line}: time = {_shown(text)}: must be a clock time, HH:MM:SS")
    found = [match for match in matches if match is not None]
    unit = (header.time_unit or "").lower().replace(" ", "")
    short = [cell for match, cell in zip(found, cells, strict=True) if match["third"] is None]
    if short and not _CLOCK_UNIT.fullmatch(unit):
        line, text, _ = short[0]
        raise FiltrationError(
            f"{path}: line {line}: time = {_shown(text)}: hours and minutes, or minutes and seconds? The header must "
            "say it: time [hh:mm] or time [mm:ss]"
        )
    time = np.array([_seconds(match, in_minutes=unit.startswith("m")) for match in found])
    dated = all(match["date"] for match in found)
    of_day = any(match["date"] or match["half"] for match in found) or (time.size > 0 and time[0] >= HOUR)
    if not of_day or dated:
        return time, of_day, []
    day = DAY if any(match["half"] or int(match["first"]) > 12 for match in found) else 0.5 * DAY
    falls = np.diff(time, prepend=time[0]) < -0.5 * day
    over = "midnight" if day == DAY else "12"
    notes = [
        f"line {line}: the clock went over {over}" for (line, _, _), fell in zip(cells, falls, strict=True) if fell
    ]
    return time + day * np.cumsum(falls), of_day, notes


def _seconds(match: re.Match[str], *, in_minutes: bool) -> float:
    """Seconds of one clock time; from 1970 with a date."""
    first, second, third = float(match["first"]), float(match["second"]), float(match["third"] or 0.0)
    if match["third"] is None and in_minutes:
        return MINUTE * first + second
    if match["half"]:
        first = first % 12.0 + (12.0 if match["half"].lower() == "pm" else 0.0)
    seconds = HOUR * first + MINUTE * second + third
    if match["date"] is None:
        return seconds
    day = (
        match["date"]
        if "-" in match["date"]
        else "-".join(part.zfill(2) for part in reversed(match["date"].split(".")))
    )
    return seconds + DAY * float(np.datetime64(day, "D").astype(np.int64))


def _cells(path: Path, header: _Header, lines: Iterable[tuple[int, str]]) -> list[tuple[int, str, str]]:
    """Texts of time and volume of every row, with its line."""
    rows = []
    for line, text in lines:
        cells = _split(path, line, text, header.separator)
        more = cells[header.columns :]
        # with commas even empty ones: 0,5,1,2 under four columns may be two numbers
        if any(more) or (more and header.separator == ","):
            raise FiltrationError(
                f"{path}: line {line}: {_shown(text)}: {len(cells)} values under {header.columns} columns"
                + (" (decimal commas? separate the columns by semicolons)" if header.separator == "," else "")
            )
        cells += [""] * (header.columns - len(cells))
        rows.append((line, cells[header.time], cells[header.amount]))
    return rows


def _has_decimal_commas(path: Path, header: _Header, cells: Sequence[tuple[int, str, str]]) -> bool:
    """Whether numbers are written with commas; refused beside points, where either may part thousands."""
    commas = [(line, text) for line, *texts in cells for text in texts if "," in text]
    if header.separator == "," or not commas:
        return False
    if any("." in text for _, *texts in cells for text in texts):
        line, text = commas[0]
        raise FiltrationError(f"{path}: line {line}: {text!r}: decimal commas and points in one file; use one of them")
    return True


def _number(path: Path, line: int, name: str, text: str) -> float:
    value = float(text) if NUMBER.fullmatch(text) else math.nan
    if 0.0 <= value < math.inf:
        return value
    allowed = "must not be negative" if value < 0.0 else "must be a finite number, with a decimal point if any"
    raise FiltrationError(f"{path}: line {line}: {name} = {_shown(text)}: {allowed}")


def _ascending(path: Path, rows: _Rows, _clock: _Clock) -> tuple[_Rows, list[str]]:
    """Refuse times that go back."""
    back = np.flatnonzero(np.diff(rows.time) < 0.0)
    if back.size:
        k = back[0]
        raise FiltrationError(
            f"{path}: line {rows.line[k + 1]}: time = {rows.time[k + 1]:g} s, after {rows.time[k]:g} s in line "
            f"{rows.line[k]}: times must ascend"
        )
    return rows, []


def _begun(_path: Path, rows: _Rows, clock: _Clock) -> tuple[_Rows, list[str]]:
    """Begin with the one reading at time zero, and take the filtrate that was there off all volumes.

    Of a clock that was not started with the test, time zero is the last reading without filtrate, or not known.
    """
    if not (rows.time.size and rows.time[0] == 0.0):
        return rows, []
    if clock.of_day:
        last = int(np.argmax(rows.volume > 0.0)) - 1 if rows.volume[0] == 0.0 and rows.volume.any() else 0
        return _Rows(rows.line[last:], rows.time[last:] - rows.time[last], rows.volume[last:]), []
    there, at_zero = float(rows.volume[0]), rows.time == 0.0
    keep, notes = ~at_zero, []
    keep[0] = True
    if at_zero.sum() > 1:
        notes.append(f"{_lines_text(rows.line[at_zero][1:])}: at time zero as the line before, left out")
    if there > 0.0:
        notes.append(
            f"line {rows.line[0]}: {there / VOLUME_UNITS['mL']:.4g} mL at time zero, taken off all volumes (if the "
            "clock was started late instead, the cake's resistance is the same, the medium's is not)"
        )
    chosen = _chosen(rows, keep)
    return chosen._replace(volume=np.maximum(chosen.volume - there, 0.0)), notes


def _merged(path: Path, rows: _Rows, clock: _Clock) -> tuple[_Rows, list[str]]:
    """Average what was read at the same time."""
    time, first, where, count = np.unique(rows.time, return_index=True, return_inverse=True, return_counts=True)
    if time.size == rows.time.size:
        return rows, []
    volume = np.bincount(where, weights=rows.volume) / count
    largest = np.full(time.size, -np.inf)
    np.maximum.at(largest, where, rows.volume)
    _require_alike(path, rows, largest[where], clock.resolution * _flow(time, volume)[where])
    again = rows.line[np.concatenate([[False], np.diff(rows.time) == 0.0])]
    note = f"{_lines_text(again)}: read at the same time as the line before, volumes averaged"
    return _Rows(rows.line[first], time, volume), [note]


def _flow(time: FloatArray, volume: FloatArray) -> FloatArray:
    """Flow about each time from its neighbours, m3/s; 0 where there are none."""
    if time.size < 2:
        return np.zeros_like(time)
    return np.abs(np.gradient(volume, time))


def _require_alike(path: Path, rows: _Rows, largest: FloatArray, step: FloatArray) -> None:
    """Refuse volumes that differ too much from the largest of their time, beyond what flows while the clock stands."""
    allowed = np.maximum(np.maximum(SAME_TIME * largest, BALANCE_RESOLUTION * rows.volume.max()), STAMPED * step)
    apart = (rows.time > 0.0) & (largest - rows.volume > allowed)
    if apart.any():
        k = int(np.argmax(apart))
        same = np.flatnonzero(rows.time == rows.time[k])
        other = same[np.argmax(rows.volume[same])]
        one, more = (rows.volume[i] / VOLUME_UNITS["mL"] for i in (k, other))
        raise FiltrationError(
            f"{path}: line {rows.line[k]}: volume = {one:.6g} mL, but {more:.6g} mL at the same time, "
            f"{rows.time[k]:g} s, in line {rows.line[other]}: must differ by at most {100.0 * SAME_TIME:g} %, "
            f"or {100.0 * BALANCE_RESOLUTION:g} % of the final volume"
        )


def _rising(path: Path, rows: _Rows, _clock: _Clock) -> tuple[_Rows, list[str]]:
    """Leave out volumes a little below an earlier one; a real fall is an error."""
    if not rows.volume.size:
        return rows, []
    largest = np.maximum.accumulate(rows.volume)
    fall = largest - rows.volume
    worst = int(np.argmax(fall > BALANCE_RESOLUTION * largest[-1]))
    if fall[worst] > BALANCE_RESOLUTION * largest[-1]:
        before, now = (value / VOLUME_UNITS["mL"] for value in (largest[worst], rows.volume[worst]))
        raise FiltrationError(
            f"{path}: line {rows.line[worst]}: volume = {now:.6g} mL, after {before:.6g} mL: must not fall, or only by "
            f"{100.0 * BALANCE_RESOLUTION:g} % of the final volume"
        )
    falls = fall > 0.0
    if not falls.any():
        return rows, []
    note = f"{_lines_text(rows.line[falls])}: volume a little below an earlier one, left out"
    return _chosen(rows, ~falls), [note]


def _started(_path: Path, rows: _Rows, clock: _Clock) -> tuple[_Rows, list[str]]:
    """Leave out readings without time or volume, the first one silently."""
    empty = rows.volume == 0.0
    if not clock.of_day or empty[:1].any():
        empty |= rows.time == 0.0
    notes = [f"{_lines_text(rows.line[1:][empty[1:]])}: without time or volume, left out"] if empty[1:].any() else []
    return _chosen(rows, ~empty), notes


def _chosen(rows: _Rows, keep: BoolArray) -> _Rows:
    return _Rows(rows.line[keep], rows.time[keep], rows.volume[keep])


def _lines_text(lines: Sequence[int] | IntArray) -> str:
    """Name lines, the first few of many."""
    if len(lines) == 1:
        return f"line {lines[0]}"
    named = ", ".join(str(line) for line in lines[:5])
    return f"lines {named}" if len(lines) <= 5 else f"{len(lines)} lines ({named}, ...)"


def _shown(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")


def _name_problems(model: MeasurementFile, file: str) -> Iterator[Problem]:
    """Names given twice."""
    given = [(f"tests[{i}].name", entry.name or Path(entry.file).stem) for i, entry in enumerate(model.tests)]
    given += [(f"resistances[{i}].name", entry.name) for i, entry in enumerate(model.resistances) if entry.name]
    seen: dict[str, str] = {}
    for key, name in given:
        if name in seen:
            yield Problem(file, key, repr(name), f"is the name of {seen[name].removesuffix('.name')} too; give another")
        seen.setdefault(name, key)


def _load_test(entry: ConstantPressureTest, folder: Path) -> FiltrationTest:
    return filtration_test_of(entry, entry.name or Path(entry.file).stem, entry.csd, folder / entry.file)


def filtration_test_of(entry: FiltrationConditions, name: str, csd: str, file: Path) -> FiltrationTest:
    """Read a test's file and join it with the conditions.

    Raises
    ------
    FiltrationError
        As :func:`read_test`.
    """
    readings = read_test(file, entry.filtrate_density_kg_m3)
    return FiltrationTest(
        name=name,
        csd=csd,
        time=readings.time,
        volume=readings.volume,
        area=entry.area_cm2 * _SQUARE_CENTIMETRE,
        pressure_drop=entry.pressure_drop_kPa * KILOPASCAL,
        viscosity=entry.viscosity_mPa_s * MILLIPASCAL_SECOND,
        solids_per_filtrate=entry.solids_per_filtrate_kg_m3,
        notes=readings.notes,
        lines=readings.lines,
        known_zero=readings.known_zero,
        reading_error=entry.relative_reading_error,
    )


def _of_tests(
    tests: Sequence[FiltrationTest], results: Sequence[FiltrationAnalysis], sources: Sequence[str]
) -> Iterator[Measurement]:
    for test, found, source in zip(tests, results, sources, strict=True):
        error = max(found.resistance_se / found.resistance, SMALLEST_RELATIVE_SE)
        yield Measurement(test.name, test.csd, found.resistance, error, test.pressure_drop, source)


def _with_scatter(measured: Sequence[Measurement]) -> Iterator[Measurement]:
    """Add to each error the scatter between the measurements of the same distribution and pressure."""
    for entry in measured:
        peers = _peers(entry, measured)
        added = scatter(_logs(peers), [peer.relative_se for peer in peers])
        yield replace(entry, relative_se=math.hypot(entry.relative_se, added)) if added > 0.0 else entry


def _contradictions(measured: Sequence[Measurement], tests: Sequence[str]) -> Iterator[str]:
    """Say once where measurements of the same distribution and pressure differ by more than errors and runs do."""
    said: set[tuple[str, ...]] = set()
    for entry in measured:
        peers = _peers(entry, measured)
        names = tuple(peer.name for peer in peers)
        errors = [max(peer.relative_se, REPEATABILITY if peer.name in tests else 0.0) for peer in peers]
        squares = chi_square(_logs(peers), errors)
        if names in said or not improbable(squares, len(peers) - 1):
            continue
        said.add(names)
        added = scatter(_logs(peers), [peer.relative_se for peer in peers])
        pressure = (entry.pressure_drop or math.nan) / KILOPASCAL
        yield (
            f"the measurements of {entry.csd} at {pressure:g} kPa contradict each other ({', '.join(names)}; "
            f"chi-square {squares:.1f} for {len(peers)} measurements): a scatter of {100.0 * added:.0f} % is added to "
            "the error of each"
        )


def _peers(entry: Measurement, measured: Sequence[Measurement]) -> list[Measurement]:
    """Measurements of the same distribution and pressure, itself among them; itself alone without a pressure."""
    own = entry.pressure_drop
    if own is None:
        return [entry]
    return [
        peer
        for peer in measured
        if peer.csd == entry.csd and peer.pressure_drop is not None and same_pressure(peer.pressure_drop, own)
    ]


def _logs(measured: Sequence[Measurement]) -> list[float]:
    return [math.log(entry.resistance) for entry in measured]


def same_pressure(one: float, other: float) -> bool:
    """Whether two pressure drops are the same within ``SAME_PRESSURE``."""
    return max(one, other) <= (1.0 + SAME_PRESSURE) * min(one, other)


def _of_values(entries: Sequence[KnownResistance], taken: Sequence[str]) -> Iterator[Measurement]:
    """Values given directly; those without a name get their distribution's, numbered where it is taken."""
    used = {*taken, *(entry.name for entry in entries if entry.name)}
    for entry in entries:
        name = entry.name or next(name for name in _numbered(entry.csd) if name not in used)
        used.add(name)
        pressure = None if entry.pressure_drop_kPa is None else entry.pressure_drop_kPa * KILOPASCAL
        yield Measurement(name, entry.csd, entry.resistance_m_kg, entry.relative_uncertainty, pressure, entry.source)


def _numbered(stem: str) -> Iterator[str]:
    yield stem
    number = 2
    while True:
        yield f"{stem} ({number})"
        number += 1
