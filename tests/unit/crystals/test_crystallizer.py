"""The MSMPR crystallizer against closed forms and the paper's alum case (Figs 12 and 13, Tables 1 and 2)."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from filtercake.crystals.crystallizer import (
    MOST_CLASSES,
    NUCLEATION_UNITS,
    Kinetics,
    SteadyState,
    crystal_size_distribution,
    cumulative_volume,
    get_kinetics,
    load_kinetics,
    steady_state,
    volume_density,
)
from filtercake.crystals.csd import Truncation, truncate
from filtercake.errors import CrystallizerError, CsdError, FiltercakeError
from filtercake.packing.cloud import box_length

UM = 1e-6
MINUTE = 60.0


def number_density(state: SteadyState, size: Any) -> Any:
    """Paper eq. 11: b(L) = (B0/G) exp(-L/(G tau)), #/(m3 m)."""
    return state.nucleation_rate / state.growth_rate * np.exp(-np.asarray(size) / state.size_scale)


def sum_x_over_d2(size_scale: float) -> float:
    """Integral of w/L^2 over all sizes, 1/m2."""
    return 1.0 / (6.0 * size_scale**2)


SLURRY_DENSITY = 200.0  # of the paper's case study, kg/m3
PER_LITRE, PER_M3 = NUCLEATION_UNITS

# residence time (min): G tau (um), G (m/s), B0 (#/(L s)), at four to five digits (physics.md, section 2)
STEADY_STATES = {
    15: (58.417, 6.4907e-8, 7.5833e4),
    30: (67.103, 3.7279e-8, 2.5016e4),
    45: (72.771, 2.6952e-8, 1.3076e4),
    60: (77.081, 2.1411e-8, 8.2521e3),
}
# Table 2 of the paper (um), and the volume each truncation keeps
TABLE_2 = {15: (32.5, 543.3, 0.981), 30: (37.6, 613.4, 0.979), 45: (42.6, 653.4, 0.977), 60: (42.5, 688.2, 0.976)}
# Table 1 of the paper: box length (um) of 100 000 spheres at void fraction 0.60
TABLE_1 = {15: 5046, 30: 5808, 45: 6352, 60: 6658}


@pytest.fixture(scope="module")
def alum_kinetics() -> Kinetics:
    return get_kinetics("ammonium_alum")


def alum_state(minutes: float) -> SteadyState:
    return steady_state(get_kinetics("ammonium_alum"), minutes * MINUTE, SLURRY_DENSITY)


def alum_packed(minutes: float) -> Truncation:
    """The distribution that is packed: bins under 0.1 vol% dropped."""
    return truncate(crystal_size_distribution(alum_state(minutes).size_scale), 1e-3)


def some_kinetics(**changes: object) -> Kinetics:
    values: dict[str, object] = {
        "name": "salt",
        "nucleation_coefficient": 1e17,
        "units": PER_LITRE,
        "slurry_concentration_exponent": 1.0,
        "growth_rate_exponent": 2.0,
        "shape_factor": 0.5,
        "density": 2000.0,
        "source": "a test",
    }
    return Kinetics(**{**values, **changes})  # type: ignore[arg-type]


@st.composite
def kinetics(draw: st.DrawFn) -> Kinetics:
    """Kinetics of any order, in either unit, over twenty decades of K_R."""
    return some_kinetics(
        nucleation_coefficient=10.0 ** draw(st.floats(0.0, 20.0)),
        units=draw(st.sampled_from(sorted(NUCLEATION_UNITS))),
        slurry_concentration_exponent=draw(st.floats(-1.0, 3.0)),
        growth_rate_exponent=draw(st.floats(-1.0, 6.0)),
        shape_factor=draw(st.floats(0.01, 2.0)),
        density=draw(st.floats(500.0, 20_000.0)),
    )


residence_times = st.floats(1.0, 1e6)
slurry_concentrations = st.floats(0.1, 1000.0)


# --- the paper's case study ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("minutes", sorted(STEADY_STATES))
def test_alum_steady_states(minutes: int) -> None:
    size_scale_um, growth_rate, nucleation_rate_per_litre = STEADY_STATES[minutes]
    state = alum_state(minutes)
    # half a unit of the last digit given
    assert state.size_scale / UM == pytest.approx(size_scale_um, abs=0.5e-3)
    assert state.growth_rate == pytest.approx(growth_rate, abs=0.5e-12)
    digits = math.floor(math.log10(nucleation_rate_per_litre))
    assert state.nucleation_rate / 1000.0 == pytest.approx(nucleation_rate_per_litre, abs=0.5 * 10.0 ** (digits - 4))


@pytest.mark.parametrize("minutes", sorted(TABLE_2))
def test_table_2_of_the_paper(minutes: int) -> None:
    smallest, largest, kept = TABLE_2[minutes]
    packed = alum_packed(minutes)
    assert round(packed.csd.smallest / UM, 1) == smallest
    assert round(packed.csd.largest / UM, 1) == largest
    assert packed.kept_volume == pytest.approx(kept, abs=0.001)  # of these, 15 min (0.98163) is rounded down


@pytest.mark.parametrize("minutes", sorted(TABLE_1))
def test_table_1_of_the_paper(minutes: int) -> None:
    assert round(box_length(alum_packed(minutes).csd, 100_000, 0.60) / UM) == TABLE_1[minutes]


def test_alum_nucleates_less_and_grows_larger_with_time_as_the_paper_says() -> None:
    # section 3.3: with i > 1 the nucleation rate falls faster than the growth rate
    early, late = alum_state(15), alum_state(60)
    assert late.nucleation_rate / early.nucleation_rate < late.growth_rate / early.growth_rate < 1.0
    assert late.size_scale > early.size_scale


# --- steady state --------------------------------------------------------------------------------------------------


@given(kinetics(), residence_times, slurry_concentrations)
def test_a_steady_state_satisfies_both_equations(salt: Kinetics, tau: float, slurry_concentration: float) -> None:
    state = steady_state(salt, tau, slurry_concentration)
    g, b0 = state.growth_rate, state.nucleation_rate
    factor = {PER_LITRE: 1000.0, PER_M3: 1.0}[salt.units]
    law = factor * salt.nucleation_coefficient * slurry_concentration**salt.slurry_concentration_exponent
    # rounding grows with the exponents: a few hundred units in the last place
    assert b0 == pytest.approx(law * g**salt.growth_rate_exponent, rel=1e-12)
    assert 6.0 * salt.shape_factor * salt.density * b0 * g**3 * tau**4 == pytest.approx(slurry_concentration, rel=1e-12)
    assert state.size_scale == pytest.approx(g * tau, rel=1e-12)


@given(kinetics(), residence_times, slurry_concentrations, st.floats(1.01, 100.0))
def test_growth_slows_with_residence_time(
    salt: Kinetics, tau: float, slurry_concentration: float, longer: float
) -> None:
    first, second = (
        steady_state(salt, tau, slurry_concentration),
        steady_state(salt, longer * tau, slurry_concentration),
    )
    exponent = -4.0 / (salt.growth_rate_exponent + 3.0)
    assert second.growth_rate < first.growth_rate
    assert second.growth_rate / first.growth_rate == pytest.approx(longer**exponent, rel=1e-11)


@given(residence_times, slurry_concentrations, st.floats(1.1, 10.0))
def test_at_j_1_more_slurry_means_more_crystals_of_the_same_size(tau: float, density: float, more: float) -> None:
    thin, thick = (steady_state(some_kinetics(), tau, density * k) for k in (1.0, more))
    assert thick.size_scale == pytest.approx(thin.size_scale, rel=1e-12)
    assert thick.nucleation_rate == pytest.approx(more * thin.nucleation_rate, rel=1e-11)


def test_a_steady_state_by_hand() -> None:
    # i = -2, j = 1: G = 1/(6 kv rho K_R tau^4) = 1/(6 * 0.5 * 2000 * 1e3 * 10^4), B0 = K_R MT / G^2
    salt = some_kinetics(nucleation_coefficient=1e3, units=PER_M3, growth_rate_exponent=-2.0)
    state = steady_state(salt, 10.0, 7.0)
    assert state.growth_rate == pytest.approx(1.0 / 6e10, rel=1e-13)
    assert state.nucleation_rate == pytest.approx(1e3 * 7.0 * 3.6e21, rel=1e-13)
    assert (state.residence_time, state.slurry_concentration, state.kinetics) == (10.0, 7.0, "salt")


def test_the_same_kinetics_in_either_unit_are_the_same_crystallizer() -> None:
    per_litre = steady_state(some_kinetics(nucleation_coefficient=1e14, units=PER_LITRE), 600.0, 150.0)
    per_m3 = steady_state(some_kinetics(nucleation_coefficient=1e17, units=PER_M3), 600.0, 150.0)
    assert dataclasses.astuple(per_litre)[:-1] == pytest.approx(dataclasses.astuple(per_m3)[:-1], rel=1e-13)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, -math.inf, "long", True, None])
@pytest.mark.parametrize("argument", ["residence_time_s", "slurry_concentration_kg_m3"])
def test_bad_operating_points_are_refused_by_name(alum_kinetics: Kinetics, argument: str, value: object) -> None:
    values = {"residence_time_s": 900.0, "slurry_concentration_kg_m3": 200.0, argument: value}
    with pytest.raises(CrystallizerError) as caught:
        steady_state(alum_kinetics, **values)  # type: ignore[arg-type]
    assert str(caught.value) == f"{argument} = {value!r}: must be a positive and finite number"


def test_numbers_from_arrays_are_shown_plainly(alum_kinetics: Kinetics) -> None:
    assert steady_state(alum_kinetics, np.float64(900.0), np.int64(200)) == alum_state(15)
    with pytest.raises(CrystallizerError, match=r"residence_time_s = -1\.0: must"):
        steady_state(alum_kinetics, np.float64(-1.0), 200.0)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"growth_rate_exponent": -2.9999}, "the growth rate (m/s) would be 10^"),
        ({"slurry_concentration_exponent": 1e4}, "the growth rate (m/s) would be 10^"),
        ({"slurry_concentration_exponent": 1e308}, "the growth rate (m/s) would be 10^"),
        ({"growth_rate_exponent": 1e308, "slurry_concentration_exponent": 1e308}, "rate"),
    ],
)
def test_rates_beyond_the_numbers_are_refused(changes: dict[str, object], says: str) -> None:
    with pytest.raises(CrystallizerError) as caught:
        steady_state(some_kinetics(**changes), 900.0, 200.0)
    assert says in str(caught.value)
    assert "kinetics salt" in str(caught.value)
    assert "check nucleation_coefficient = 1e+17" in str(caught.value)


@given(
    st.floats(-3.0, 1e308, exclude_min=True),
    st.floats(allow_nan=False, allow_infinity=False),
    *[st.floats(0.0, exclude_min=True, allow_infinity=False)] * 5,
)
def test_any_allowed_numbers_give_a_steady_state_or_a_clear_error(
    i: float, j: float, k_r: float, kv: float, density: float, tau: float, slurry_concentration: float
) -> None:
    salt = some_kinetics(
        growth_rate_exponent=i,
        slurry_concentration_exponent=j,
        nucleation_coefficient=k_r,
        shape_factor=kv,
        density=density,
    )
    try:
        state = steady_state(salt, tau, slurry_concentration)
    except CrystallizerError:
        return
    assert all(math.isfinite(x) and x > 0.0 for x in (state.growth_rate, state.nucleation_rate, state.size_scale))


# --- kinetics ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, "much", False])
@pytest.mark.parametrize("attribute", ["nucleation_coefficient", "shape_factor", "density"])
def test_bad_kinetics_are_refused_by_name(attribute: str, value: object) -> None:
    with pytest.raises(CrystallizerError) as caught:
        some_kinetics(**{attribute: value})
    assert str(caught.value) == f"kinetics salt: {attribute} = {value!r}: must be a positive and finite number"


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"growth_rate_exponent": -3.0}, "growth_rate_exponent = -3.0: must be a finite number above -3"),
        ({"growth_rate_exponent": -4.0}, "growth_rate_exponent = -4.0: must be a finite number above -3"),
        ({"growth_rate_exponent": math.inf}, "growth_rate_exponent = inf: must be a finite number above -3"),
        ({"growth_rate_exponent": math.nan}, "growth_rate_exponent = nan: must be a finite number above -3"),
        ({"slurry_concentration_exponent": math.nan}, "slurry_concentration_exponent = nan: must be a finite number"),
        ({"units": "#/(L min)"}, f"units = '#/(L min)': allowed: '{PER_LITRE}' or '{PER_M3}'"),
        ({"source": " "}, "source = ' ': must be text"),
        ({"residence_time_range": (900.0,)}, "the shortest and the longest residence time"),
        ({"residence_time_range": (3600.0, 900.0)}, "the shortest residence time must come first"),
        ({"residence_time_range": (0.0, 900.0)}, "must be a positive and finite number"),
    ],
)
def test_other_bad_kinetics(changes: dict[str, object], says: str) -> None:
    with pytest.raises(CrystallizerError) as caught:
        some_kinetics(**changes)
    assert says in str(caught.value)
    assert str(caught.value).startswith("kinetics salt: ")


def test_crystallizer_errors_are_for_the_user() -> None:
    assert issubclass(CrystallizerError, FiltercakeError)


def test_the_range_is_a_statement_not_a_limit() -> None:
    limited, free = some_kinetics(residence_time_range=(900.0, 3600.0)), some_kinetics()
    assert [limited.covers(tau) for tau in (899.0, 900.0, 3600.0, 3601.0)] == [False, True, True, False]
    assert free.covers(1e9)
    assert steady_state(limited, 60.0, 200.0).size_scale > 0.0


# --- size distribution ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("minutes", sorted(STEADY_STATES))
def test_the_densities_carry_the_number_and_the_mass(alum_kinetics: Kinetics, minutes: int) -> None:
    state = alum_state(minutes)
    a = state.size_scale

    def moment(order: int) -> float:
        # of b(L), in size scales so that quad sees numbers near 1
        return quad(lambda x: x**order * float(number_density(state, x * a)), 0.0, 80.0)[0] * a ** (order + 1)

    assert moment(0) == pytest.approx(state.nucleation_rate * state.residence_time, rel=1e-9)
    assert alum_kinetics.shape_factor * alum_kinetics.density * moment(3) == pytest.approx(SLURRY_DENSITY, rel=1e-9)
    assert moment(1) / moment(0) == pytest.approx(state.number_mean, rel=1e-9)
    assert moment(3) / moment(2) == pytest.approx(state.sauter_mean, rel=1e-9)
    assert moment(4) / moment(3) == pytest.approx(state.volume_mean, rel=1e-9)
    assert moment(1) / moment(3) == pytest.approx(sum_x_over_d2(a), rel=1e-9)


def test_volume_density_is_the_share_of_mass_at_a_size(alum_kinetics: Kinetics) -> None:
    state = alum_state(30)
    size = np.linspace(0.0, 1e-3, 7).reshape(7, 1)
    mass = alum_kinetics.shape_factor * alum_kinetics.density * size**3 * number_density(state, size)
    assert volume_density(state, size).shape == (7, 1)
    assert volume_density(state, size) == pytest.approx(mass / SLURRY_DENSITY, rel=1e-11)


def test_cumulative_volume_is_the_integral_of_the_density() -> None:
    state = alum_state(45)
    a = state.size_scale
    for upper in (0.5, 3.67, 10.0):
        integral = quad(lambda x: float(volume_density(state, x * a)) * a, 0.0, upper)[0]
        assert float(cumulative_volume(a, upper * a)) == pytest.approx(integral, rel=1e-10)
    # P(4, x) = 1 - exp(-x) (1 + x + x^2/2 + x^3/6)
    assert float(cumulative_volume(a, 3.0 * a)) == pytest.approx(1.0 - 13.0 * math.exp(-3.0), rel=1e-12)


@given(st.floats(1e-7, 1e-2), st.floats(1e-3, 1e3))
def test_only_the_size_over_the_scale_matters(a: float, k: float) -> None:
    assert float(cumulative_volume(k * a, k * 2.5 * a)) == pytest.approx(
        float(cumulative_volume(a, 2.5 * a)), rel=1e-12
    )
    assert sum_x_over_d2(k * a) == pytest.approx(sum_x_over_d2(a) / k**2, rel=1e-12)


@given(st.floats(1e-5, 1e-3), st.integers(20, 400), st.floats(0.01, 60.0))
def test_classes_scale_with_the_size_scale(a: float, bins: int, k: float) -> None:
    # half a bin away from a whole number of bins, so that rounding cannot change their number
    width = 15.0 * a / (bins + 0.5)
    one, other = crystal_size_distribution(a, width), crystal_size_distribution(k * a, k * width)
    assert one.size.size == bins
    assert other.size == pytest.approx(k * one.size, rel=1e-12)
    assert other.volume_fraction == pytest.approx(one.volume_fraction, rel=1e-9)


@given(st.floats(10.0, 70.0))
def test_truncated_classes_over_the_size_scale_hardly_depend_on_time(minutes: float) -> None:
    # what is left is the 5 um bin against a size scale of 54 to 79 um: a bin more or less at either end
    a, packed = alum_state(minutes).size_scale, alum_packed(minutes)
    assert packed.csd.smallest / a == pytest.approx(0.55, abs=0.08)
    assert packed.csd.largest / a == pytest.approx(9.1, abs=0.5)
    assert packed.kept_volume == pytest.approx(0.978, abs=0.008)
    assert packed.csd.sum_x_over_d2 / sum_x_over_d2(a) == pytest.approx(0.924, abs=0.02)  # truncation lowers it by 8 %


@given(st.floats(20e-6, 640e-6), st.floats(1e-6, 20e-6))
def test_the_classes_have_the_analytic_sums(a: float, width: float) -> None:
    csd = crystal_size_distribution(a, width)
    assert csd.sum_x_over_d2 == pytest.approx(sum_x_over_d2(a), rel=1e-5)  # 5e-6 is beyond 15 a
    assert csd.sum_x_over_d == pytest.approx(1.0 / (3.0 * a), rel=1e-4)
    assert csd.sauter_mean == pytest.approx(3.0 * a, rel=1e-4)
    assert float(csd.volume_fraction @ csd.size) == pytest.approx(4.0 * a, rel=2e-3 + (width / a) ** 2)


def test_a_class_adds_what_its_crystals_do() -> None:
    a = 60e-6
    csd = crystal_size_distribution(a)
    width = csd.size[1] - csd.size[0]
    for k in (0, 1, 40):
        size = np.linspace(k * width, (k + 1) * width, 2001)
        share = size * np.exp(-size / a) / (6.0 * a**4)  # w/L^2
        assert csd.x_over_d2 is not None and csd.x_over_d is not None
        assert csd.x_over_d2[k] == pytest.approx(np.trapezoid(share, size), rel=1e-4)
        assert csd.x_over_d[k] == pytest.approx(np.trapezoid(share * size, size), rel=1e-4)


@pytest.mark.parametrize("minutes", TABLE_2)
def test_what_is_packed_is_of_spheres_at_the_bins_centres(minutes: int) -> None:
    packed = alum_packed(minutes).csd
    assert packed.x_over_d is None and packed.x_over_d2 is None
    assert packed.sum_x_over_d2 == pytest.approx(float(np.sum(packed.volume_fraction / packed.size**2)), rel=1e-14)


def test_the_bin_width_divides_fifteen_size_scales() -> None:
    a = alum_state(15).size_scale
    csd = crystal_size_distribution(a)
    assert csd.size.size == int(15.0 * a / 5e-6)
    assert np.diff(csd.size) == pytest.approx(15.0 * a / csd.size.size, rel=1e-9)
    assert csd.volume_fraction.sum() == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("value", [0.0, -1e-6, math.nan, math.inf])
@pytest.mark.parametrize("argument", ["size_scale", "bin_width"])
def test_bad_discretisations_are_refused_by_name(argument: str, value: float) -> None:
    values = {"size_scale": 60e-6, "bin_width": 5e-6, argument: value}
    with pytest.raises(CrystallizerError, match=f"{argument} = .*: must be a positive and finite number"):
        crystal_size_distribution(**values)


def test_too_many_and_too_few_classes_are_refused() -> None:
    with pytest.raises(CrystallizerError, match=f"size_scale = 60 m: .* at most {MOST_CLASSES} classes"):
        crystal_size_distribution(60.0)  # um taken for m
    with pytest.raises(CsdError, match="leaves no bin"):
        crystal_size_distribution(60e-6, bin_width=1e-3)


@pytest.mark.parametrize("size", [-1e-6, math.nan, math.inf])
def test_bad_sizes_are_refused(size: float) -> None:
    with pytest.raises(CrystallizerError, match=f"size = {size:g}: must be finite and not negative"):
        volume_density(alum_state(15), [1e-6, size])
    with pytest.raises(CrystallizerError, match=f"size = {size:g}: must be finite and not negative"):
        cumulative_volume(60e-6, [1e-6, size])


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_bad_size_scales_are_refused(value: float) -> None:
    with pytest.raises(CrystallizerError, match="size_scale = "):
        cumulative_volume(value, 1e-6)


# --- presets and users' files --------------------------------------------------------------------------------------


def test_the_presets() -> None:
    presets = load_kinetics()
    assert sorted(presets) == ["ammonium_alum", "potassium_nitrate"]
    alum, nitrate = presets["ammonium_alum"], presets["potassium_nitrate"]
    assert (alum.nucleation_coefficient, alum.slurry_concentration_exponent, alum.growth_rate_exponent) == (
        9.00e16,
        1.0,
        2.0,
    )
    assert (alum.shape_factor, alum.density, alum.nucleation_factor) == (1.0, 2450.0, 1000.0)
    assert nitrate.nucleation_coefficient == 4.45e10
    assert (nitrate.slurry_concentration_exponent, nitrate.growth_rate_exponent) == (1.0, 1.348)
    assert (nitrate.shape_factor, nitrate.density, nitrate.nucleation_factor) == (1.0, 2110.0, 1000.0)
    assert all(preset.name == name and preset.source for name, preset in presets.items())
    assert alum.residence_time_range == (900.0, 3600.0)
    assert nitrate.residence_time_range is None


@pytest.mark.parametrize("minutes", [15, 30, 45, 60])
def test_potassium_nitrate_runs(minutes: int) -> None:
    nitrate = get_kinetics("potassium_nitrate")
    state = steady_state(nitrate, minutes * MINUTE, SLURRY_DENSITY)
    # far fewer nuclei than alum, so two to three times the size
    assert 1.9 < state.size_scale / alum_state(minutes).size_scale < 2.5
    packed = truncate(crystal_size_distribution(state.size_scale), 1e-3)
    # the same 0.1 % of a 5 um bin cuts more of a coarser distribution
    assert packed.kept_volume == pytest.approx(0.95, abs=0.005)


GOOD = """\
borax:
  nucleation_coefficient: 2.5e12
  units: "B0 #/(m3 s), MT kg/m3, G m/s"
  slurry_concentration_exponent: 0.5
  growth_rate_exponent: 1.7
  shape_factor: 0.6
  density_kg_m3: 1730
  residence_time_range_min: [10, 90]
  source: made up
"""


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "kinetics.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_of_the_user(tmp_path: Path) -> None:
    own = load_kinetics(write(tmp_path, GOOD))
    assert own == {
        "borax": Kinetics("borax", 2.5e12, PER_M3, 0.5, 1.7, 0.6, 1730.0, "made up", (600.0, 5400.0))
    }  # 2.5e12 without a sign is text to YAML 1.1
    assert get_kinetics("borax", own) is own["borax"]
    assert get_kinetics("ammonium_alum", own).density == 2450.0


def test_the_range_may_be_left_out(tmp_path: Path) -> None:
    text = "".join(line for line in GOOD.splitlines(keepends=True) if "range" not in line)
    assert load_kinetics(write(tmp_path, text))["borax"].residence_time_range is None


def test_kinetics_of_the_user_come_first() -> None:
    mine = some_kinetics(name="ammonium_alum")
    assert get_kinetics("ammonium_alum", {"ammonium_alum": mine}) is mine


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("2.5e12", "-1", "borax.nucleation_coefficient = -1: must be a positive and finite number"),
        ("2.5e12", "much", "borax.nucleation_coefficient = 'much': must be a positive and finite number"),
        ("2.5e12", ".nan", "borax.nucleation_coefficient = nan: must be a positive and finite number"),
        ("2.5e12", "1e999", "borax.nucleation_coefficient = '1e999': must be a positive and finite number"),
        ("2.5e12", "true", "borax.nucleation_coefficient = True: must be a positive and finite number"),
        ("2.5e12", "[1, 2]", "borax.nucleation_coefficient = [1, 2]: must be a positive and finite number"),
        ("1.7", "-3", "borax.growth_rate_exponent = -3: must be a finite number above -3"),
        ("0.5", ".inf", "borax.slurry_concentration_exponent = inf: must be a finite number"),
        ("0.6", "0", "borax.shape_factor = 0: must be a positive and finite number"),
        ("1730", "", "borax.density_kg_m3 = None: must be a positive and finite number"),
        ("[10, 90]", "[90, 10]", "borax.residence_time_range_min = [90, 10]: the shortest residence time must come"),
        ("[10, 90]", "15", "borax.residence_time_range_min = 15: must be the shortest and the longest"),
        ("B0 #/(m3 s), MT kg/m3, G m/s", "SI", f"borax.units = 'SI': allowed: '{PER_LITRE}' or '{PER_M3}'"),
        ("made up", "1999", "borax.source = 1999: must be text"),
        ("shape_factor", "shape_facter", "borax.shape_facter = 0.6: no such key; allowed: nucleation_coefficient,"),
        ("shape_factor", "shape_facter", "did you mean shape_factor?"),
        ("shape_factor", "shape_facter", "borax.shape_factor = (missing): must be given"),
        ("borax", "' '", "(name) = ' ': must be text; put quotes around it"),
    ],
)
def test_a_bad_entry_is_refused_with_file_key_and_value(tmp_path: Path, old: str, new: str, says: str) -> None:
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(CrystallizerError) as caught:
        load_kinetics(path)
    message = str(caught.value)
    assert says in message
    assert all(line.startswith(f"{path}: ") for line in message.splitlines())


def test_all_problems_are_said_at_once(tmp_path: Path) -> None:
    bad = GOOD.replace("2.5e12", "0").replace("1730", "heavy")
    with pytest.raises(CrystallizerError) as caught:
        load_kinetics(write(tmp_path, bad + bad.replace("borax", "potash")))
    keys = [line.split(" = ")[0].rsplit(": ", 1)[1] for line in str(caught.value).splitlines()]
    wrong = ("nucleation_coefficient", "density_kg_m3")
    assert keys == [f"{name}.{key}" for name in ("borax", "potash") for key in wrong]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "holds no kinetics"),
        ("- borax\n", "holds no kinetics"),
        ("borax: 3\n", "borax = 3: must be a mapping with the keys nucleation_coefficient, units"),
        ("borax: {a: [}\n", "not valid YAML"),
        ("borax: !!python/object/apply:os.getcwd []\n", "not valid YAML"),
        ("? [a]\n: 1\n", "not valid YAML"),
        ("[" * 5000, "not valid YAML"),
        ("a: &a [*a]\n", "line 1, column 8: not valid YAML: aliases (*name) are not allowed here"),
    ],
)
def test_a_file_that_is_no_kinetics_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(CrystallizerError) as caught:
        load_kinetics(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert says in str(caught.value)


def test_a_missing_folder_or_binary_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CrystallizerError, match=r"nowhere\.yaml: cannot be read \(No such file"):
        load_kinetics(tmp_path / "nowhere.yaml")
    with pytest.raises(CrystallizerError, match="cannot be read"):
        load_kinetics(tmp_path)
    (tmp_path / "binary.yaml").write_bytes(bytes(range(256)))
    with pytest.raises(CrystallizerError, match=r"binary\.yaml: line 2: must be UTF-8"):
        load_kinetics(tmp_path / "binary.yaml")


@given(st.binary(max_size=200))
def test_any_bytes_are_kinetics_or_a_crystallizer_error(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.yaml"
    path.write_bytes(content)
    with pytest.raises(CrystallizerError):
        load_kinetics(path)


def test_unknown_kinetics_are_refused_with_a_suggestion() -> None:
    with pytest.raises(CrystallizerError) as caught:
        get_kinetics("amonium_alum")
    assert str(caught.value) == (
        "kinetics = 'amonium_alum': no such kinetics; allowed: ammonium_alum, potassium_nitrate; "
        "did you mean ammonium_alum?"
    )
    with pytest.raises(CrystallizerError, match=r"allowed: ammonium_alum, potassium_nitrate, salt$"):
        get_kinetics("xyz", {"salt": some_kinetics()})
