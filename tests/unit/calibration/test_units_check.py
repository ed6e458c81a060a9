"""Measurements whose units cannot be are refused, and the likely unit is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from filtercake.calibration.config import LoadedCalibration, load_calibration
from filtercake.errors import ConfigError, Problem

FILES = Path(__file__).resolve().parents[2] / "data" / "leaf_tests"
STUDY = """\
csds:
  half_and_half:
    mixture:
      - {size_um: 20, volume_fraction: 0.5}
      - {size_um: 50, volume_fraction: 0.5}
material: {density_kg_m3: 1180}
packing: {engine: embedded}
sweeps:
  - {csd: half_and_half}
"""
TEST = f"""\
tests:
  - csd: half_and_half
    file: {FILES / "base.csv"}
    area_cm2: 50
    pressure_drop_kPa: 70
    viscosity_mPa_s: 1
    solids_per_filtrate_kg_m3: 100
"""
VALUE = "resistances:\n  - {csd: half_and_half, resistance_m_kg: 3.5e9, relative_uncertainty: 0.1, source: a}\n"
CALIBRATION = "study: study.yaml\nmeasurements: measured.yaml\nrival_friction: []\n"


def load(folder: Path, measured: str, study: str = STUDY) -> LoadedCalibration:
    for name, text in (("study", study), ("measured", measured), ("mine", CALIBRATION)):
        (folder / f"{name}.yaml").write_text(text)
    return load_calibration(folder / "mine.yaml", folder)


def refused(folder: Path, measured: str, study: str = STUDY) -> Problem:
    with pytest.raises(ConfigError) as caught:
        load(folder, measured, study)
    (problem,) = caught.value.problems
    return problem


def test_the_study_s_law_is_what_units_are_judged_by(tmp_path: Path) -> None:
    assert load(tmp_path, VALUE, f"resistance_law: carman\n{STUDY}").implied_porosity == pytest.approx(0.324, abs=0.001)
    off = VALUE.replace("3.5e9", "3.5")
    by_carman, by_eq_3 = (refused(tmp_path, off, law + STUDY) for law in ("resistance_law: carman\n", ""))
    assert "in 1e9 m/kg? (3.5e+09 gives 0.324)" in by_carman.allowed
    assert "in 1e9 m/kg? (3.5e+09 gives 0.346)" in by_eq_3.allowed


def test_right_units_pass(tmp_path: Path) -> None:
    assert load(tmp_path, TEST + VALUE).implied_porosity == pytest.approx(0.346, abs=0.001)


@pytest.mark.parametrize(
    ("old", "new", "porosity", "likely"),
    [
        ("kPa: 70", "kPa: 0.7", "0.889", "is pressure_drop_kPa in bar? (70 gives 0.346)"),
        ("kPa: 70", "kPa: 0.07", "0.985", "is pressure_drop_kPa in MPa? (70 gives 0.346)"),
        ("mPa_s: 1", "mPa_s: 0.001", "0.0393", "is viscosity_mPa_s in Pa s? (1 gives 0.346)"),
        ("cm2: 50", "cm2: 0.005", "0.99999984", "is area_cm2 in m2? (50 gives 0.346)"),
        ("cm2: 50", "cm2: 5000", "0.0184", "is area_cm2 in mm2? (50 gives 0.346)"),
        ("kg_m3: 100", "kg_m3: 0.1", "0.0393", "is solids_per_filtrate_kg_m3 in g/mL (kg/L)? (100 gives 0.346)"),
    ],
)
def test_the_likely_unit_of_a_test_is_named(tmp_path: Path, old: str, new: str, porosity: str, likely: str) -> None:
    problem = refused(tmp_path, TEST.replace(old, new))
    assert problem.file == "measured.yaml"
    assert problem.key.startswith("resistance of base, ")
    assert "base.csv" in problem.key
    assert problem.allowed.startswith(
        f"implies a porosity of {porosity} for half_and_half, outside 0.15 to 0.85: {likely}"
    )
    assert "trust_units: true" in problem.allowed


@pytest.mark.parametrize(("value", "unit"), [("3.5", "1e9 m/kg"), ("3.5e+6", "m/g")])
def test_the_likely_unit_of_a_value_is_named(tmp_path: Path, value: str, unit: str) -> None:
    assert (
        f"is resistance_m_kg in {unit}? (3.5e+09 gives 0.346)"
        in refused(tmp_path, VALUE.replace("3.5e9", value)).allowed
    )


def test_what_no_unit_explains_is_refused_all_the_same(tmp_path: Path) -> None:
    assert ": check the units of the test" in refused(tmp_path, VALUE.replace("3.5e9", "3.5e17")).allowed


def test_units_may_be_trusted(tmp_path: Path) -> None:
    trusting = STUDY.replace("{density_kg_m3: 1180}", "{density_kg_m3: 1180, trust_units: true}")
    assert load(tmp_path, TEST.replace("kPa: 70", "kPa: 0.7"), trusting).implied_porosity == pytest.approx(
        0.889, abs=1e-3
    )


@pytest.mark.parametrize(
    ("old", "new", "key", "likely"),
    [
        ("density_kg_m3: 1180", "density_kg_m3: 1.18", "material.density_kg_m3", "in g/cm3? (1180 kg/m3)"),
        ("density_kg_m3: 1180", "density_kg_m3: 118", "material.density_kg_m3", "lighter than any solid"),
        (
            "20, volume_fraction: 0.5}\n      - {size_um: 50",
            "0.02, volume_fraction: 0.5}\n      - {size_um: 0.05",
            "csds.half_and_half.mixture",
            "0.02 to 0.05 um: no filter holds crystals so fine: were they in mm or cm?",
        ),
        (
            "20, volume_fraction: 0.5}\n      - {size_um: 50",
            "20000, volume_fraction: 0.5}\n      - {size_um: 50000",
            "csds.half_and_half.mixture",
            "no filter is for crystals so coarse: were they in nm?",
        ),
        (
            "size_um: 20,",
            "size_um: 0.002,",
            "csds.half_and_half.mixture",
            "over 10000 times the smallest; in one unit?",
        ),
    ],
)
def test_sizes_and_density_of_a_study(tmp_path: Path, old: str, new: str, key: str, likely: str) -> None:
    study = STUDY.replace("packing: {engine: embedded}", "packing: {engine: embedded, particles: 1000}")
    with pytest.raises(ConfigError) as caught:  # a bed of such sizes may be refused as well
        load(tmp_path, VALUE, study.replace(old, new))
    (said,) = (problem.allowed for problem in caught.value.problems if problem.key == key)
    assert likely in said and "trust_units: true" in said
