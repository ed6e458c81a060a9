"""The analysis of solved packings finds what synthetic ones were made with."""

from __future__ import annotations

import doctest

import numpy as np
import pandas as pd
import pytest

from filtercake.validation import resistance_law
from filtercake.validation.permeability import BED, CELL, COLUMNS, LATTICE, LAYERED
from filtercake.validation.resistance_law import by_case, fit, fit_table, layers_by_law, overall, spread


def rows(constant: float, exponent: float, width: float, *, noise: float = 0.0, cases: int = 12) -> pd.DataFrame:
    """Packings with ``k (1 - eps)^2 / D^2 = eps^exponent ratio^width / constant``, and a spread between packings."""
    random = np.random.default_rng(5)
    made = []
    for case in range(cases):
        porosity, ratio = random.uniform(0.25, 0.48), random.uniform(1.0, 2.2)
        for replicate in range(3):
            law = constant * porosity ** (3.0 - exponent) * ratio**-width
            found = law * np.exp(noise / np.sqrt(900.0) * random.standard_normal())
            row = dict.fromkeys(COLUMNS, 0.0) | {"case": f"c{case}", "kind": BED, "label": f"bed {case}"}
            row |= {"replicate": replicate, "spheres": 2000, "effective_spheres": 900.0, "porosity": porosity}
            row |= {"ratio": ratio, "kozeny_constant": found, "kozeny_constant_eq3": found / ratio}
            made.append(row | {"resolution": 0.004, "convergence": 0.003})
    return pd.DataFrame(made)


@pytest.mark.parametrize(("exponent", "width"), [(3.0, 0.0), (3.2, 0.05), (3.0, -1.0)])
def test_the_fit_finds_exponents_and_constant(exponent: float, width: float) -> None:
    found = fit(by_case(rows(170.0, exponent, width)))
    assert found.exponent == pytest.approx(exponent, abs=1e-6)
    assert found.width == pytest.approx(width, abs=1e-6)
    assert found.bare_constant == pytest.approx(170.0, rel=1e-6)
    assert found.constant == pytest.approx(170.0 * 0.35 ** (3.0 - exponent), rel=1e-6)
    assert found.scatter == 0.0


def test_the_intervals_of_a_noisy_fit_hold_the_truth() -> None:
    found = fit(by_case(rows(170.0, 3.2, 0.0, noise=0.6, cases=40)))
    assert abs(found.exponent - 3.2) < found.exponent_ci95 < 0.2
    assert abs(found.width) < found.width_ci95 < 0.05


def test_cases_that_scatter_more_than_their_errors_say_so() -> None:
    cases = by_case(rows(170.0, 3.0, 0.0, cases=30))
    cases["constant"] *= np.exp(0.05 * np.random.default_rng(2).standard_normal(len(cases)))
    assert fit(cases).scatter == pytest.approx(0.05, rel=0.4)


def test_a_given_exponent_is_kept() -> None:
    found = fit(by_case(rows(170.0, 3.0, -0.3)), exponent=3.0)
    assert (found.exponent, found.exponent_ci95) == (3.0, 0.0)
    assert found.width == pytest.approx(-0.3, abs=1e-6)


def test_the_spread_is_that_of_one_packing_times_the_root_of_its_spheres() -> None:
    found = spread(rows(170.0, 3.0, 0.0, noise=0.5, cases=200))
    assert found.sd == pytest.approx(0.5, rel=0.1)
    assert found.freedom == 400.0


def test_averages_have_both_parts_of_the_error() -> None:
    cases = by_case(rows(170.0, 3.0, 0.0, noise=0.5))
    row = cases.iloc[0]
    assert row["n"] == 3
    assert row["numerical_ci95"] == pytest.approx(0.005)
    assert row["packings_ci95"] == pytest.approx(2.06 * 0.5 / np.sqrt(2700.0), rel=0.3)
    assert row["ci95"] == pytest.approx(row["constant"] * np.hypot(row["packings_ci95"], 0.005))
    assert row["too_high"] == pytest.approx(180.0 * row["ratio"] / row["constant"] - 1.0)


def test_the_one_constant_covers_a_distribution_taken_at_random() -> None:
    random = np.random.default_rng(3)
    covered = 0
    for _ in range(2000):
        values = random.normal(170.0, 5.0, 11)
        found = overall(pd.DataFrame({"constant": values[:10], "numerical_ci95": 0.0}), "constant")
        covered += abs(values[10] - found.value) <= found.ci95
    assert covered / 2000 == pytest.approx(0.95, abs=0.02)


def test_layers_and_their_mixture_are_held_against_three_laws() -> None:
    cases = pd.DataFrame(
        {
            "case": ["hard_0.50", "layers_2", "hard_mixed"],
            "kind": [CELL, LAYERED, CELL],
            "ratio": [1.0, 1.25, 1.25],
            "series": [1.0, 1.2, 1.03],
            "constant": [180.0, 216.0, 185.0],
        }
    )
    found = layers_by_law(cases)
    assert found["case"].tolist() == ["layers_2", "hard_mixed"]
    assert found["carman"].tolist() == [180.0, 180.0]
    assert found["additive"].tolist() == [225.0, 225.0]
    assert found["slices"].tolist() == pytest.approx([216.0, 185.4])


def test_lattices_and_layers_take_no_part_in_the_fits() -> None:
    table = rows(170.0, 3.0, 0.0)
    strange = table.head(6).assign(kozeny_constant=300.0, kind=[LAYERED] * 3 + [LATTICE] * 3, label="strange")
    both = pd.concat([table, strange.assign(case=["s"] * 3 + ["t"] * 3)])
    pd.testing.assert_frame_equal(fit_table(by_case(both)), fit_table(by_case(table)))


def test_all_of_a_crystallizers_product_has_a_ratio_of_three_halves() -> None:
    assert pytest.approx(1.5, abs=1e-12) == resistance_law.MSMPR_RATIO


def test_examples() -> None:
    assert doctest.testmod(resistance_law).failed == 0
