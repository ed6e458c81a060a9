"""The paper's safety factor beside an interval's own upper end."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.errors import FilterError
from filtercake.filtration.resistance import log_sensitivity
from filtercake.filtration.safety import PAPER_FACTOR, design_resistance

resistances = st.floats(1e6, 1e13)
shares = st.floats(0.0, 3.0)


def test_the_papers_reason() -> None:
    # an error of 0.03 in a porosity of 0.36 is 35 % in resistance by its eq. 3
    ratio = (1.0 - 0.33) / 0.33**3 / ((1.0 - 0.36) / 0.36**3)
    assert ratio == pytest.approx(1.36, abs=0.01)
    assert math.exp(-0.03 * log_sensitivity(0.36)) == pytest.approx(ratio, rel=0.02)
    assert ratio < PAPER_FACTOR == 2.0


def test_independent_half_widths_add_as_squares() -> None:
    found = design_resistance(1e10, 3e9, 4e9)
    assert (float(found.found), float(found.upper), float(found.paper)) == (1e10, 1.5e10, 2e10)
    assert float(found.factor) == 1.5
    assert float(design_resistance(1e10).upper) == 1e10


@given(resistances, shares, shares)
def test_the_end_is_between_the_largest_and_the_sum(alpha: float, one: float, other: float) -> None:
    upper = float(design_resistance(alpha, one * alpha, other * alpha).upper)
    assert alpha * (1.0 + max(one, other)) * (1 - 1e-12) <= upper <= alpha * (1.0 + one + other) * (1 + 1e-12)


def test_words_say_which_asks_for_more() -> None:
    assert design_resistance(1e10, 2e9).words() == (
        "the 95 % interval ends at 1.2 times the resistance found; the paper's factor is 2, which leaves room for what "
        "no interval knows of: other crystals, another shape, compression"
    )
    assert design_resistance(1e10, 1.5e10).words() == (
        "the 95 % interval ends at 2.5 times the resistance found, beyond the paper's factor of 2: design for the "
        "interval's end"
    )


def test_arrays() -> None:
    found = design_resistance(np.array([1e9, 2e9]), np.array([[1e8], [2e8]]))
    assert found.upper.tolist() == [[1.1e9, 2.1e9], [1.2e9, 2.2e9]]
    assert found.paper.tolist() == [2e9, 4e9]


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ((0.0,), "resistance = 0 m/kg: must be positive"),
        ((math.nan,), "resistance = nan m/kg"),
        ((1e9, -1.0), "half_width = -1 m/kg: must be zero or positive"),
        ((1e9, 1e8, math.inf), "half_width = inf m/kg"),
    ],
)
def test_bad_values_are_refused(values: tuple[float, ...], says: str) -> None:
    with pytest.raises(FilterError, match=says):
        design_resistance(*values)
