"""Averages of compressible cakes against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.filtration.compressible import cake_average, cake_profile, shape
from filtercake.units import FloatArray


def porosity_of(value: float) -> float:
    """Porosity of a value of (1 - eps)/eps^3, by bisection."""
    low, high = 1e-3, 1.0 - 1e-9
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (1.0 - middle) / middle**3 > value else (low, middle)
    return 0.5 * (low + high)


def power_law(n: float, first: float = 15.0):
    """A cake whose local resistance rises as the n-th power of the load above 1."""

    def porosity(load: FloatArray) -> FloatArray:
        return np.array([porosity_of(first * max(x, 1.0) ** n) for x in load])

    return porosity


@pytest.mark.parametrize("load", [1.0, 3.0, 1e3, math.inf])
def test_an_even_cake_is_its_own_average(load: float) -> None:
    found = cake_average(load, lambda x: np.full(np.shape(x), 0.37))
    assert found.porosity == pytest.approx(0.37, rel=1e-12)
    assert found.porosity_at_medium == pytest.approx(0.37, rel=1e-12)
    assert found.exponent == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("n", [0.05, 0.2, 0.6])
@pytest.mark.parametrize("load", [2.0, 50.0, 5e3])
def test_a_power_law_has_its_closed_form(n: float, load: float) -> None:
    found = cake_average(load, power_law(n))
    # alpha = a x^n above 1 and a below: the integral of dp/alpha is 1 + (X^(1-n) - 1)/(1-n), over a
    integral = 1.0 + (load ** (1.0 - n) - 1.0) / (1.0 - n)
    average = 15.0 * load / integral
    assert (1.0 - found.porosity) / found.porosity**3 == pytest.approx(average, rel=1e-4)
    assert (1.0 - found.porosity_at_medium) / found.porosity_at_medium**3 == pytest.approx(15.0 * load**n, rel=1e-9)
    # the exponent is the slope of the average itself
    further = 15.0 * load * 1.001 / (1.0 + ((1.001 * load) ** (1.0 - n) - 1.0) / (1.0 - n))
    assert found.exponent == pytest.approx(math.log(further / average) / math.log(1.001), abs=2e-3)


def test_the_exponent_tends_to_that_of_the_power_law() -> None:
    assert cake_average(1e7, power_law(0.3)).exponent == pytest.approx(0.3, abs=1e-3)


@given(
    load=st.floats(1.0, 1e6),
    loose=st.floats(0.35, 0.7),
    fall=st.floats(0.0, 0.15),
    scale=st.floats(1.0, 1e3),
)
def test_the_average_lies_between_surface_and_medium(load: float, loose: float, fall: float, scale: float) -> None:
    def porosity(x: FloatArray) -> FloatArray:
        return np.asarray(loose - fall * x / (x + scale))

    found = cake_average(load, porosity)
    assert found.porosity_at_medium - 1e-9 <= found.porosity <= loose + 1e-9
    assert -1e-9 <= found.exponent < 1.0
    profile = cake_profile(load, porosity)
    assert profile.height[0] == 1.0
    assert profile.height[-1] == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(profile.height) <= 0.0).all()
    assert (np.diff(profile.porosity) <= 1e-12).all()
    # solids over the height are those of the average by volume, between the two ends
    solids = np.trapezoid(1.0 - profile.porosity, -profile.height)
    assert 1.0 - loose - 1e-9 <= solids <= 1.0 - found.porosity_at_medium + 1e-9


def test_the_profile_carries_the_stress() -> None:
    """The stress falls from the medium by drag: dp = alpha (1 - eps) dz, but for a factor."""
    porosity = power_law(0.4)
    profile = cake_profile(100.0, porosity)
    drag = shape(profile.porosity) * (1.0 - profile.porosity)
    carried = np.append(0.0, np.cumsum(0.5 * (drag[1:] + drag[:-1]) * -np.diff(profile.height)))
    loads = np.append(0.0, np.geomspace(1.0, 100.0, profile.height.size - 1))
    assert np.allclose(carried / carried[-1], loads / 100.0, atol=2e-3)


@pytest.mark.parametrize("load", [0.5, 0.0, -1.0, math.nan])
def test_loads_below_one_are_refused(load: float) -> None:
    with pytest.raises(ValueError, match=r"load = .*: must be at least 1"):
        cake_average(load, power_law(0.1))
