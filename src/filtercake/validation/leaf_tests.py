"""Synthetic filtration tests with every known fault at random places: how often the interval holds the truth.

Each test is of one kind, written as a file of readings and read and analysed as a user's file is. Its volumes, or every
other time its times, err by 2 %, independently. ``python -m filtercake.validation.leaf_tests`` makes the table.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd

from filtercake.calibration.measurements import FiltrationConditions, filtration_test_of, said
from filtercake.errors import FiltrationError
from filtercake.filtration.analysis import analyse
from filtercake.units import FloatArray

NOISE: Final = 0.02
"""Relative standard deviation of what errs."""
LARGE: Final = 0.10
"""Relative error that must not pass in silence."""
CONDITIONS: Final = {
    "area_cm2": 50.0,
    "pressure_drop_kPa": 70.0,
    "viscosity_mPa_s": 1.0,
    "solids_per_filtrate_kg_m3": 100.0,
}
RESISTANCE, MEDIUM_RESISTANCE = 3.5e9, 1.75e10
"""The truth, m/kg and 1/m: t = 0.05 V + 1e-4 V^2 (s, mL)."""
COLUMNS: Final = ("kind", "seed", "answered", "resistance_m_kg", "ci95_m_kg", "relative_error", "covered", "silent")

_SLOPE, _CURVATURE = 0.05, 1e-4
_LARGEST = 1200.0
"""Filtrate of an undisturbed test, mL."""
_LONGEST = _SLOPE * _LARGEST + _CURVATURE * _LARGEST**2
_ETHANOL = 789.0


class Readings(NamedTuple):
    """Times (s) and volumes (mL) of a test, and how they are written."""

    time: FloatArray
    volume: FloatArray
    form: str = "s"


Change = Callable[[Readings, np.random.Generator], Readings]


def _undisturbed(readings: Readings, _random: np.random.Generator) -> Readings:
    return readings


def _early_clock(readings: Readings, random: np.random.Generator) -> Readings:
    return readings._replace(time=readings.time + random.uniform(0.02, 0.3) * _LONGEST)


def _late_clock(readings: Readings, random: np.random.Generator) -> Readings:
    time = readings.time - random.uniform(0.02, 0.3) * _LONGEST
    return readings._replace(time=time[time > 0.5], volume=readings.volume[time > 0.5])


def _vessel(readings: Readings, random: np.random.Generator) -> Readings:
    there = random.uniform(0.03, 0.3) * _LARGEST
    return readings._replace(
        time=np.concatenate([[0.0], readings.time]), volume=np.concatenate([[0.0], readings.volume]) + there
    )


def _pump_ramp(readings: Readings, random: np.random.Generator) -> Readings:
    # the pressure rises in proportion to time until the end of the ramp: the integral of it is what counts
    ramp = random.uniform(0.05, 0.35) * _LONGEST
    time = np.where(readings.time < 0.5 * ramp, np.sqrt(2.0 * ramp * readings.time), readings.time + 0.5 * ramp)
    return readings._replace(time=time)


def _end(random: np.random.Generator) -> tuple[float, float, float]:
    """Volume and time of a random end of filtration, and the slope dt/dV there."""
    volume = random.uniform(0.55, 0.92) * _LARGEST
    return volume, _SLOPE * volume + _CURVATURE * volume**2, _SLOPE + 2.0 * _CURVATURE * volume


def _cake_dry(readings: Readings, random: np.random.Generator) -> Readings:
    volume, time, slope = _end(random)
    left = random.uniform(0.08, 0.25) * _LARGEST
    dry = volume + left * (1.0 - np.exp(-(readings.time - time) / (slope * left)))
    return readings._replace(volume=np.where(readings.time > time, dry, readings.volume))


def _chamber_full(readings: Readings, random: np.random.Generator) -> Readings:
    volume, time, slope = _end(random)
    beyond = np.maximum(readings.volume - volume, 0.0)
    slower = random.uniform(10.0, 40.0) * _CURVATURE
    full = time + slope * beyond + slower * beyond**2
    return readings._replace(time=np.where(beyond > 0.0, full, readings.time))


def _solids_used_up(readings: Readings, random: np.random.Generator) -> Readings:
    volume, time, slope = _end(random)
    straight = time + slope * (readings.volume - volume)
    return readings._replace(time=np.where(readings.volume > volume, straight, readings.time))


def _start_and_end(readings: Readings, random: np.random.Generator) -> Readings:
    starts, ends = (_early_clock, _late_clock, _pump_ramp), (_cake_dry, _chamber_full, _solids_used_up)
    ended = ends[random.integers(3)](readings, random)
    return starts[random.integers(3)](ended, random)


def _whole_seconds(readings: Readings, _random: np.random.Generator) -> Readings:
    return readings._replace(form="whole")


def _over_midnight(readings: Readings, random: np.random.Generator) -> Readings:
    before = random.uniform(0.0, _LONGEST)
    return Readings(
        np.concatenate([[0.0], readings.time]) + 86_400.0 - before, np.concatenate([[0.0], readings.volume]), "clock"
    )


def _by_mass(readings: Readings, _random: np.random.Generator) -> Readings:
    return readings._replace(form="mass")


def _two_readings(readings: Readings, _random: np.random.Generator) -> Readings:
    chosen = [readings.time.size // 2, -1]
    return readings._replace(time=readings.time[chosen], volume=readings.volume[chosen])


KINDS: Final[dict[str, Change]] = {
    "undisturbed": _undisturbed,
    "early clock": _early_clock,
    "late clock": _late_clock,
    "vessel not empty": _vessel,
    "pump ramp": _pump_ramp,
    "cake dry": _cake_dry,
    "chamber full": _chamber_full,
    "solids used up": _solids_used_up,
    "start and end": _start_and_end,
    "whole seconds": _whole_seconds,
    "over midnight": _over_midnight,
    "by mass": _by_mass,
    "two readings": _two_readings,
}
"""What may be wrong with a test."""


def write_readings(kind: str, seed: int) -> str:
    """Write the file of a test: 10 to 40 readings, at even volumes or even times, with noise."""
    random = np.random.default_rng([seed, list(KINDS).index(kind)])
    count = int(random.integers(10, 41))
    if random.random() < 0.5:
        volume = np.linspace(0.0, _LARGEST, count + 1)[1:]
        time = _SLOPE * volume + _CURVATURE * volume**2
    else:
        time = np.linspace(0.0, _LONGEST, count + 1)[1:]
        volume = (np.sqrt(_SLOPE**2 + 4.0 * _CURVATURE * time) - _SLOPE) / (2.0 * _CURVATURE)
    # the noise is of what has flown and passed; neither clock nor vessel goes back
    factor = 1.0 + NOISE * random.standard_normal(count)
    made = KINDS[kind](Readings(time, volume), random)
    size, first = made.time.size, made.time[0]
    factor = np.concatenate([np.ones(max(size - count, 0)), factor])[:size]
    if seed % 2:
        return _text(made._replace(volume=np.sort(made.volume * factor)))
    start = first if made.form == "clock" else 0.0
    return _text(made._replace(time=np.sort(start + (made.time - start) * factor)))


def _text(made: Readings) -> str:
    names = {"mass": "time_s;mass_g", "clock": "clock;volume_mL"}
    rows = [names.get(made.form, "time_s;volume_mL")]
    for time, volume in zip(made.time.tolist(), made.volume.tolist(), strict=True):
        if made.form == "clock":
            seconds = round(time) % 86_400
            rows.append(f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d};{volume:.1f}")
        elif made.form == "mass":
            rows.append(f"{time:.1f};{volume * _ETHANOL / 1000.0:.2f}")
        else:
            rows.append(f"{time:.0f};{volume:.1f}" if made.form == "whole" else f"{time:.1f};{volume:.1f}")
    return "\n".join(rows) + "\n"


def analyse_all(seeds: Sequence[int], kinds: Sequence[str] = tuple(KINDS)) -> pd.DataFrame:
    """Analyse a test of every kind for every seed.

    Returns
    -------
    DataFrame
        ``COLUMNS``: answered, or refused; the resistance with the half-width of its 95 % interval; its relative error;
        whether the interval holds the truth; and whether it is off by more than ``LARGE`` with nothing said.
    """
    with tempfile.TemporaryDirectory() as folder:
        rows = [_row(kind, seed, Path(folder) / "test.csv") for kind in kinds for seed in seeds]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _row(kind: str, seed: int, file: Path) -> tuple[str, int, bool, float, float, float, bool, bool]:
    file.write_text(write_readings(kind, seed), encoding="utf-8")
    conditions = FiltrationConditions(**CONDITIONS, filtrate_density_kg_m3=_ETHANOL)
    try:
        test = filtration_test_of(conditions, kind, "crystals", file)
        found = analyse(test)
    except FiltrationError:
        return kind, seed, False, np.nan, np.nan, np.nan, False, False
    error = found.resistance / RESISTANCE - 1.0
    covered = abs(found.resistance - RESISTANCE) <= found.resistance_ci95
    return (
        kind,
        seed,
        True,
        found.resistance,
        found.resistance_ci95,
        error,
        covered,
        abs(error) > LARGE and not said(test, found),
    )


def summarise(table: pd.DataFrame) -> pd.DataFrame:
    """Count by kind, and over all: tests, refusals, coverage of those answered, medians (relative), silent errors."""
    groups = [(str(kind), rows) for kind, rows in table.groupby("kind", sort=False)]
    lines = []
    for kind, rows in [*groups, ("all", table)]:
        good = rows[rows["answered"]]
        lines.append(
            {
                "kind": kind,
                "tests": len(rows),
                "refused": len(rows) - len(good),
                "covered": float(good["covered"].mean()),
                "median_relative_error": float(good["relative_error"].abs().median()),
                "median_relative_ci95": float((good["ci95_m_kg"] / good["resistance_m_kg"]).median()),
                "silent": int(good["silent"].sum()),
            }
        )
    return pd.DataFrame(lines)


def main() -> None:
    """Make the table of the documentation."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args()
    summary = summarise(analyse_all(range(options.seeds)))
    summary.round(4).to_csv(options.output, index=False)
    print(summary.round(3).to_string(index=False))


if __name__ == "__main__":
    main()
