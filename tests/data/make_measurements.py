"""Make the example of measurements, config/measurements: ``python tests/data/make_measurements.py [summary.csv]``.

The cakes are packings of the workflow's own, made at a known cohesion from a seed of their own
(config/benchmarks/synthetic_truth.yaml); ``make synthetic`` packs them and runs this. Their mean resistances, taken
from the study's summary if one is given, are kept in synthetic_truth.csv. The tests of the 50/50 mixture are made of
its resistance, the same at every pressure, and timed with an error of a second. In one of them air in the outlet holds
the first filtrate back for a while. The other mixtures are there to be predicted.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parents[2] / "config" / "measurements"
TRUTH = Path(__file__).with_name("synthetic_truth.csv")
COLUMNS = ("csd", "cohesion_kJ_m3", "friction", "n", "porosity", "resistance_m_kg", "resistance_ci95_m_kg")

CSD, MEDIUM = "pmma_50_50", 5e9
AREA, VISCOSITY, CONCENTRATION = 45e-4, 1e-3, 100.0
TIME_ERROR = 1.0
HELD_BACK, RELEASED = 100e-6, 50.0
"""Filtrate (m3) that the outlet holds back where the start-up is disturbed, and when it lets go (s)."""

TESTS = (
    # name, kPa, first volume, step, last volume (mL), seed, disturbed start-up
    ("synthetic_25kPa", 25, 150, 50, 1200, 1, True),
    ("synthetic_50kPa_a", 50, 150, 50, 1000, 6, False),
    ("synthetic_50kPa_b", 50, 150, 50, 1000, 7, False),
    ("synthetic_100kPa", 100, 200, 100, 2000, 4, False),
)

YAML = """\
# yaml-language-server: $schema=../../workflow/schemas/measurements.schema.json
# An example of measured resistances. The tests are synthetic, not measurements: tests/data/make_measurements.py makes
# them, and this file, from packings at {cohesion:g} kJ/m3 without friction, whose resistance is {resistance:.4g} m/kg,
# and a medium resistance of {medium:g} 1/m (make synthetic).
title: Synthetic tests of 50/50 wt% 20/50 um PMMA (made by a script)

tests:
"""

ENTRY = """\
  - csd: {csd}
    file: {name}.csv
    area_cm2: {area:g}
    pressure_drop_kPa: {pressure:g}
    viscosity_mPa_s: {viscosity:g}
    solids_per_filtrate_kg_m3: {concentration:g}      # dry cake per volume of filtrate
"""

CSV = """\
# Synthetic, not a measurement: cake resistance {resistance:g} m/kg, medium resistance {medium:g} 1/m, {pressure:g} kPa.
# Times err by {error:g} s (one standard deviation){disturbed}.
# Made by tests/data/make_measurements.py
time_s,volume_mL
"""


def store(summary: Path) -> None:
    """Keep the mean resistances of a study's summary."""
    with summary.open(encoding="utf-8", newline="") as file:
        rows = [{name: row[name] for name in COLUMNS} for row in csv.DictReader(file)]
    for row in rows:
        row["porosity"] = f"{float(row['porosity']):.4f}"
        row |= {name: f"{float(row[name]):.4g}" for name in COLUMNS[-2:]}
    with TRUTH.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def truth() -> tuple[float, float]:
    """Cohesion (kJ/m3) and resistance (m/kg) of the cakes that are tested."""
    with TRUTH.open(encoding="utf-8", newline="") as file:
        (row,) = (row for row in csv.DictReader(file) if row["csd"] == CSD)
    return float(row["cohesion_kJ_m3"]), float(row["resistance_m_kg"])


def text_of_test(resistance: float, pressure: float, volume: np.ndarray, seed: int, disturbed: bool) -> str:
    """Text of one test's CSV; resistance in m/kg, pressure in kPa, volume in m3."""
    driving = AREA * pressure * 1e3 / VISCOSITY
    time = resistance * CONCENTRATION / (2.0 * AREA * driving) * volume**2 + MEDIUM / driving * volume
    if disturbed:
        volume = np.where(time < RELEASED, volume - HELD_BACK, volume)
    time += np.random.default_rng(seed).normal(0.0, TIME_ERROR, volume.size)
    note = f"; the outlet holds {HELD_BACK * 1e6:g} mL back until {RELEASED:g} s" if disturbed else ""
    head = CSV.format(resistance=resistance, medium=MEDIUM, pressure=pressure, error=TIME_ERROR, disturbed=note)
    return head + "".join(f"{t:.1f},{v * 1e6:.0f}\n" for t, v in zip(time, volume, strict=True))


def make(folder: Path) -> None:
    """Write the tests and the YAML that lists them."""
    folder.mkdir(parents=True, exist_ok=True)
    cohesion, resistance = truth()
    text = YAML.format(cohesion=cohesion, resistance=resistance, medium=MEDIUM)
    for name, pressure, first, step, last, seed, disturbed in TESTS:
        volume = 1e-6 * np.arange(first, last + step, step)
        content = text_of_test(resistance, pressure, volume, seed, disturbed)
        (folder / f"{name}.csv").write_text(content, encoding="utf-8")
        text += ENTRY.format(
            csd=CSD,
            name=name,
            area=AREA * 1e4,
            pressure=pressure,
            viscosity=VISCOSITY * 1e3,
            concentration=CONCENTRATION,
        )
    (folder / "synthetic_tests.yaml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        store(Path(sys.argv[1]))
    make(FOLDER)
