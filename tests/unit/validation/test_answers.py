"""Ways to a resistance and a filter area, on made-up packings."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from filtercake import api
from filtercake.filtration.resistance import ADDITIVE, CARMAN
from filtercake.validation import answers as module
from filtercake.validation.answers import ESTIMATED, SLURRY, SOLVED, answers


def made(csd: object, protocol: str, *_: object) -> pd.DataFrame:
    """Two packings each; the flow solved resists twice as much in what is pressed."""
    porosity = np.array([0.30, 0.31]) if protocol == "filtration" else np.array([0.35, 0.36])
    table = pd.DataFrame({"porosity": porosity, "packed_s": [2.0, 2.0], "solved_s": [5.0, 5.0]})
    table[ADDITIVE], table[CARMAN] = [4.0e9, 4.0e9], [2.2e9, 2.2e9]
    return table.assign(**{SOLVED: [1.9e9, 2.1e9] if protocol == "filtration" else [0.9e9, 1.1e9]})


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch) -> pd.DataFrame:
    monkeypatch.setattr(module, "_packings", made)
    estimate = SimpleNamespace(resistance_m_kg=2.5e9, porosity=0.305)
    monkeypatch.setattr(api, "predict", lambda *_, **__: estimate)
    return answers({20: 0.5, 50: 0.5}, 0.0, 2).set_index(["protocol", "law"])


def test_errors_are_relative_to_the_flow_solved_in_pressed_cakes(table: pd.DataFrame) -> None:
    assert table.loc[("filtration", SOLVED), "resistance_error"] == 0.0
    assert table.loc[("gravity", SOLVED), "resistance_error"] == pytest.approx(-0.5)
    assert table.loc[("filtration", CARMAN), "resistance_error"] == pytest.approx(0.1)
    assert table.loc[("gravity", ADDITIVE), "resistance_error"] == pytest.approx(1.0)
    assert table.loc[("filtration", ESTIMATED), "resistance_error"] == pytest.approx(0.25)


def test_both_means_are_uncertain(table: pd.DataFrame) -> None:
    one = 12.706 * 0.1e9 / 2.0e9  # two values 0.2e9 apart, Student's with one degree of freedom
    assert table.loc[("filtration", SOLVED), "resistance_error_ci95"] == pytest.approx(one, rel=1e-3)
    both = 0.5 * np.hypot(one, 2.0 * one)
    assert table.loc[("gravity", SOLVED), "resistance_error_ci95"] == pytest.approx(both, rel=1e-3)
    assert table.loc[("filtration", CARMAN), "resistance_error_ci95"] == pytest.approx(1.1 * one, rel=1e-3)


def test_the_time_is_of_the_packing_and_of_what_follows(table: pd.DataFrame) -> None:
    assert table.loc[("filtration", SOLVED), "seconds"] == 7.0
    assert table.loc[("filtration", CARMAN), "seconds"] == 2.0
    assert table.loc[("filtration", ESTIMATED), "seconds"] < 1.0


def test_the_medium_makes_the_area_less_wrong_than_the_resistance(table: pd.DataFrame) -> None:
    true = api.filter_area(resistance_m_kg=2.0e9, **SLURRY).filter_area_m2
    wrong = table.loc[("gravity", ADDITIVE)]
    assert wrong["area_error"] == pytest.approx(wrong["filter_area_m2"] / true - 1.0)
    assert 0.0 < wrong["area_error"] < wrong["resistance_error"]
    assert np.isnan(table.loc[("filtration", ESTIMATED), "spread"])
