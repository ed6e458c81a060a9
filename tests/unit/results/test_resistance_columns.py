"""Resistances of a table's row by every law."""

from __future__ import annotations

import math

import pytest

from filtercake.crystals.csd import mixture
from filtercake.filtration.resistance import CARMAN_CONSTANT, KozenyConstant
from filtercake.results.resistance_columns import LAW_CI95, resistance_columns

SIZES = mixture([20e-6, 50e-6], [0.5, 0.5])


def test_the_solved_constant_gives_its_own_column_whatever_the_law() -> None:
    solved = KozenyConstant(160.0, 0.04)
    for law in ("additive", "carman", "stokes"):
        row = resistance_columns(law, 0.36, (SIZES, SIZES), 1180.0, 1.0, solved)
        assert row["resistance_stokes_m_kg"] == pytest.approx(160.0 / CARMAN_CONSTANT * row["resistance_carman_m_kg"])
        assert row["resistance_m_kg"] == row[f"resistance_{law}_m_kg"]
    assert row[LAW_CI95] == pytest.approx(0.04 * row["resistance_m_kg"])
    assert math.isnan(resistance_columns("carman", 0.36, (SIZES, SIZES), 1180.0, 1.0)["resistance_stokes_m_kg"])
