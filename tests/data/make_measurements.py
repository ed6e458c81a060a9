"""Make the example of measurements, config/measurements: ``python tests/data/make_measurements.py``.

The tests are synthetic: cakes of 50/50 wt% 20/50 um PMMA spheres with one and the same resistance at every pressure,
timed with an error of a second. In one of them air in the outlet holds the first filtrate back for a while.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parents[2] / "config" / "measurements"

RESISTANCE, MEDIUM = 3.29e9, 5e9
AREA, VISCOSITY, CONCENTRATION = 45e-4, 1e-3, 100.0
TIME_ERROR = 1.0
HELD_BACK, RELEASED = 100e-6, 45.0
"""Filtrate (m3) that the outlet holds back where the start-up is disturbed, and when it lets go (s)."""

TESTS = (
    # name, kPa, first volume, step, last volume (mL), seed, disturbed start-up
    ("synthetic_25kPa", 25, 150, 50, 1200, 1, True),
    ("synthetic_50kPa_a", 50, 150, 50, 1000, 6, False),
    ("synthetic_50kPa_b", 50, 150, 50, 1000, 5, False),
    ("synthetic_100kPa", 100, 200, 100, 2000, 4, False),
)

YAML = """\
# yaml-language-server: $schema=../../workflow/schemas/measurements.schema.json
# An example of measured resistances. The tests are synthetic, not measurements: tests/data/make_measurements.py makes
# them, and this file, from a cake resistance of 3.29e9 m/kg and a medium resistance of 5e9 1/m.
title: Synthetic tests of 50/50 wt% 20/50 um PMMA (made by a script)

tests:
"""

ENTRY = """\
  - csd: pmma_50_50
    file: {name}.csv
    area_cm2: {area:g}
    pressure_drop_kPa: {pressure:g}
    viscosity_mPa_s: {viscosity:g}
    slurry_concentration_kg_m3: {concentration:g}      # dry cake per volume of filtrate
"""

CSV = """\
# Synthetic, not a measurement: cake resistance {resistance:g} m/kg, medium resistance {medium:g} 1/m, {pressure:g} kPa.
# Times err by {error:g} s (one standard deviation){disturbed}.
# Made by tests/data/make_measurements.py
time_s,volume_mL
"""


def text_of_test(pressure: float, volume: np.ndarray, seed: int, disturbed: bool) -> str:
    """Text of one test's CSV; pressure in kPa, volume in m3."""
    driving = AREA * pressure * 1e3 / VISCOSITY
    time = RESISTANCE * CONCENTRATION / (2.0 * AREA * driving) * volume**2 + MEDIUM / driving * volume
    if disturbed:
        volume = np.where(time < RELEASED, volume - HELD_BACK, volume)
    time += np.random.default_rng(seed).normal(0.0, TIME_ERROR, volume.size)
    note = f"; the outlet holds {HELD_BACK * 1e6:g} mL back until {RELEASED:g} s" if disturbed else ""
    head = CSV.format(resistance=RESISTANCE, medium=MEDIUM, pressure=pressure, error=TIME_ERROR, disturbed=note)
    return head + "".join(f"{t:.1f},{v * 1e6:.0f}\n" for t, v in zip(time, volume, strict=True))


def make(folder: Path) -> None:
    """Write the tests and the YAML that lists them."""
    folder.mkdir(parents=True, exist_ok=True)
    text = YAML
    for name, pressure, first, step, last, seed, disturbed in TESTS:
        volume = 1e-6 * np.arange(first, last + step, step)
        (folder / f"{name}.csv").write_text(text_of_test(pressure, volume, seed, disturbed), encoding="utf-8")
        text += ENTRY.format(
            name=name, area=AREA * 1e4, pressure=pressure, viscosity=VISCOSITY * 1e3, concentration=CONCENTRATION
        )
    (folder / "synthetic_tests.yaml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
