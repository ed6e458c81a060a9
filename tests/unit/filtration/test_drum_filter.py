"""The rotary drum filter against the paper's Fig. 14, eq. 10 as printed, and its limits."""

from __future__ import annotations

import dataclasses
import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.crystals.csd import mixture
from filtercake.errors import FiltercakeError, FilterError
from filtercake.filtration.drum_filter import (
    DESIGN_COLUMNS,
    MAXIMUM_CAKE_VOLUME,
    MAXIMUM_REYNOLDS,
    MAXIMUM_THICKNESS,
    MINIMUM_LAYERS,
    MINIMUM_THICKNESS,
    Cake,
    DrumFilter,
    area,
    belt,
    cake_mass_per_area,
    cake_thickness,
    capacity,
    design_table,
    filtrate_velocity,
    forming_time,
    medium_share,
    model_warnings,
    on_filtrate_basis,
    particle_reynolds,
    resistance_for_cake_share,
)
from filtercake.filtration.resistance import kozeny_carman

UM = 1e-6
FLOW = 20.0 / 3600.0
PAPER = DrumFilter(
    pressure_drop=53.32e3,
    submerged_fraction=0.3,
    rotation_rate=1.0 / 300.0,
    medium_resistance=5e9,
    viscosity=1e-3,
    slurry_concentration=200.0,
)
ALUM = 2450.0

# crystallizer volume 5, 10, 15, 20 m3: G tau (um), porosity, alpha (m/kg), area (m2), medium share (%)
FIG_14 = [
    (58.417, 0.293, 1.009e8, 3.44, 51),
    (67.103, 0.2925, 7.69e7, 3.15, 55),
    (72.771, 0.2925, 6.54e7, 3.00, 58),
    (77.081, 0.292, 5.86e7, 2.905, 60),
]

resistances = st.floats(1e5, 1e13)
filters = st.builds(
    DrumFilter,
    pressure_drop=st.floats(1e3, 1e6),
    submerged_fraction=st.floats(0.05, 0.95),
    rotation_rate=st.floats(1e-4, 1.0),
    medium_resistance=st.floats(1e8, 1e12),
    viscosity=st.floats(1e-4, 1.0),
    slurry_concentration=st.floats(1.0, 500.0),
    filtrate_per_slurry=st.floats(0.1, 1.0),
)


def changed(drum: DrumFilter = PAPER, **values: float) -> DrumFilter:
    return dataclasses.replace(drum, **values)


def alum_cake(**values: float) -> Cake:
    """The cake of the 5 m3 crystallizer: d32 = 3 G tau, Table 2's largest crystals."""
    cake = Cake(resistance=1.009e8, porosity=0.293, density=ALUM, sauter_mean=175.25 * UM, largest=543.3 * UM)
    return dataclasses.replace(cake, **values)


def alum_resistance(a_um: float, porosity: float) -> float:
    """Resistance (m/kg) by eq. 3 of a whole MSMPR distribution, sum x/d^2 = 1/(6 a^2), as one class of its own."""
    return kozeny_carman(porosity, mixture([math.sqrt(6.0) * a_um * UM], [1.0]), ALUM)


# --- the paper ---


@pytest.mark.parametrize(("a_um", "porosity", "alpha", "filter_area", "percent"), FIG_14)
def test_fig_14(a_um: float, porosity: float, alpha: float, filter_area: float, percent: int) -> None:
    # a last digit of 0.01 m2 (0.3 %) and of 1 %
    assert float(area(PAPER, alpha, FLOW)) == pytest.approx(filter_area, abs=0.005)
    assert round(100.0 * float(medium_share(PAPER, alpha))) == percent


@pytest.mark.parametrize(("a_um", "porosity", "alpha", "filter_area", "percent"), FIG_14)
def test_fig_14_follows_from_porosities_and_growth(
    a_um: float, porosity: float, alpha: float, filter_area: float, percent: int
) -> None:
    found = alum_resistance(a_um, porosity)
    assert found == pytest.approx(alpha, rel=0.001)  # three or four figures are printed
    assert float(area(PAPER, found, FLOW)) == pytest.approx(filter_area, abs=0.005)


def test_areas_and_shares_as_the_paper_prints_them() -> None:
    alphas = np.array([alpha for _, _, alpha, _, _ in FIG_14])
    areas, shares = area(PAPER, alphas, FLOW), medium_share(PAPER, alphas)
    assert (round(float(areas[0]), 1), round(float(areas[-1]), 1)) == (3.4, 2.9)
    assert np.all((shares > 0.50) & (shares < 0.60))


def test_cake_holds_80_percent_at_1e9() -> None:
    # exactly 79.63 %, and 80 % at 1.042e9: both are the paper's figures to the digits it prints
    assert float(1.0 - medium_share(PAPER, 1e9)) == pytest.approx(0.7963, abs=5e-5)
    assert float(resistance_for_cake_share(PAPER, 0.8)) == pytest.approx(1.042e9, rel=5e-4)


def test_cake_of_the_paper_by_hand() -> None:
    # A = 3.436 m2, w = 200 * FLOW * 300 / A = 97.0 kg/m2; 97.0 / (2450 * 0.707) = 56.0 mm; u = FLOW / (0.3 A)
    assert float(cake_mass_per_area(PAPER, 1.009e8)) == pytest.approx(97.0, abs=0.05)
    assert float(cake_thickness(PAPER, 1.009e8, 0.293, ALUM)) == pytest.approx(56.0e-3, abs=0.05e-3)
    assert float(filtrate_velocity(PAPER, 1.009e8)) == pytest.approx(5.39e-3, abs=0.005e-3)
    assert float(particle_reynolds(PAPER, 1.009e8, 0.293, 175.25 * UM)) == pytest.approx(1.336, abs=0.002)


# --- eq. 10 ---


@given(filters, resistances, st.floats(1e-6, 10.0))
def test_area_is_eq_10_as_printed(drum: DrumFilter, alpha: float, flow: float) -> None:
    with localcontext() as context:
        context.prec = 60  # the printed form cancels
        dp, f, n, rm, mu, c, phi = (Decimal(v) for v in dataclasses.astuple(drum))
        a, v, c = Decimal(alpha), phi * Decimal(flow), c / phi  # filtrate, and crystals per volume of it
        root = (2 * c * a * dp * f * n / mu + (n * rm) ** 2).sqrt()
        printed = float(a * c * v / (root - n * rm))
    assert float(area(drum, alpha, flow)) == pytest.approx(printed, rel=1e-13)


@given(filters, resistances)
def test_shares_and_mass_follow_from_any_flow(drum: DrumFilter, alpha: float) -> None:
    for flow in (1e-4, 3.0):
        w = drum.slurry_concentration * flow / (drum.rotation_rate * float(area(drum, alpha, flow)))
        assert float(cake_mass_per_area(drum, alpha)) == pytest.approx(w, rel=1e-12)
        share = drum.medium_resistance / (drum.medium_resistance + 0.5 * alpha * w)
        assert float(medium_share(drum, alpha)) == pytest.approx(share, rel=1e-12)
        bare = float(area(drum, 0.0, flow) / area(drum, alpha, flow))
        assert float(medium_share(drum, alpha)) == pytest.approx(bare, rel=1e-11)


@given(filters, resistances)
def test_pressure_drop_filters_the_slurry_in_the_time_submerged(drum: DrumFilter, alpha: float) -> None:
    # Ruth: mu (alpha w / 2 + Rm) u = dP, with u the mean velocity, independent of eq. 10
    w, u = float(cake_mass_per_area(drum, alpha)), float(filtrate_velocity(drum, alpha))
    drop = drum.viscosity * (0.5 * alpha * w + drum.medium_resistance) * u
    assert drop == pytest.approx(drum.pressure_drop, rel=1e-11)


@given(filters, st.floats(0.0, 1e13), st.floats(1e-8, 1e3))
def test_capacity_inverts_area(drum: DrumFilter, alpha: float, flow: float) -> None:
    assert float(capacity(drum, alpha, area(drum, alpha, flow))) == pytest.approx(flow, rel=1e-12)


@given(filters, st.floats(0.001, 0.999))
def test_resistance_for_cake_share_inverts_medium_share(drum: DrumFilter, share: float) -> None:
    alpha = float(resistance_for_cake_share(drum, share))
    assert float(medium_share(drum, alpha)) == pytest.approx(1.0 - share, rel=1e-11)


def test_resistance_for_no_cake_share_is_zero() -> None:
    assert float(resistance_for_cake_share(PAPER, 0.0)) == 0.0


def test_arrays_broadcast() -> None:
    alphas, flows = np.array([1e8, 1e9, 1e10]), np.array([[0.001], [0.01]])
    found = area(PAPER, alphas, flows)
    assert found.shape == (2, 3)
    assert found[1, 2] == area(PAPER, 1e10, 0.01)
    assert capacity(PAPER, alphas, found) == pytest.approx(np.broadcast_to(flows, (2, 3)), rel=1e-14)
    assert cake_thickness(PAPER, alphas, [0.3, 0.35, 0.4], ALUM).shape == (3,)


# --- limits, dimensions, directions ---


def test_without_medium() -> None:
    drum, alpha = changed(medium_resistance=0.0), 1e8
    by_hand = FLOW * math.sqrt(1e-3 * alpha * 200.0 / (2.0 * 53.32e3 * 0.3 / 300.0))
    assert float(area(drum, alpha, FLOW)) == pytest.approx(by_hand, rel=1e-14)
    assert float(medium_share(drum, alpha)) == 0.0


def test_without_cake_the_medium_alone_remains() -> None:
    alone = FLOW * 1e-3 * 5e9 / (53.32e3 * 0.3)
    assert float(area(PAPER, 0.0, FLOW)) == pytest.approx(alone, rel=1e-15)
    assert float(medium_share(PAPER, 0.0)) == 1.0
    # to first order A / A0 = 1 + x with x = c alpha dP f / (2 mu n Rm^2), where eq. 10 as printed divides 0 by 0
    x = 1e-10
    alpha = x * 2.0 * 1e-3 * PAPER.rotation_rate * 5e9**2 / (200.0 * 53.32e3 * 0.3)
    assert float(area(PAPER, alpha, FLOW)) / alone - 1.0 == pytest.approx(x, rel=1e-5)  # rounding: 2e-16 / x


def test_a_slow_drum_needs_an_area_that_grows_as_one_over_the_root_of_its_speed() -> None:
    limit = FLOW * math.sqrt(1e-3 * 1e8 * 200.0 / (2.0 * 53.32e3 * 0.3))
    areas = [float(area(changed(rotation_rate=n), 1e8, FLOW)) * math.sqrt(n) for n in (1e-12, 1e-16, 1e-30)]
    assert areas == [pytest.approx(limit, rel=error) for error in (1e-4, 1e-6, 1e-12)]


def test_a_fast_drum_sees_the_medium_alone() -> None:
    assert float(area(changed(rotation_rate=1e12), 1e8, FLOW)) == pytest.approx(
        float(area(PAPER, 0.0, FLOW)), rel=1e-12
    )


@given(
    filters, resistances, st.floats(1e-6, 10.0), st.floats(0.01, 100.0), st.floats(0.01, 100.0), st.floats(0.01, 100.0)
)
def test_dimensions(drum: DrumFilter, alpha: float, flow: float, m: float, kg: float, s: float) -> None:
    """Any change of the units of length, mass and time changes each result as its own unit says."""
    other = DrumFilter(
        pressure_drop=drum.pressure_drop * kg / (m * s**2),
        submerged_fraction=drum.submerged_fraction,
        rotation_rate=drum.rotation_rate / s,
        medium_resistance=drum.medium_resistance / m,
        viscosity=drum.viscosity * kg / (m * s),
        slurry_concentration=drum.slurry_concentration * kg / m**3,
        filtrate_per_slurry=drum.filtrate_per_slurry,
    )
    beta, size, rho = alpha * m / kg, 1e-4, 1000.0
    pairs = [
        (area(other, beta, flow * m**3 / s), area(drum, alpha, flow), m**2),
        (capacity(other, beta, 2.0 * m**2), capacity(drum, alpha, 2.0), m**3 / s),
        (cake_mass_per_area(other, beta), cake_mass_per_area(drum, alpha), kg / m**2),
        (cake_thickness(other, beta, 0.4, ALUM * kg / m**3), cake_thickness(drum, alpha, 0.4, ALUM), m),
        (medium_share(other, beta), medium_share(drum, alpha), 1.0),
        (resistance_for_cake_share(other, 0.7), resistance_for_cake_share(drum, 0.7), m / kg),
        (filtrate_velocity(other, beta), filtrate_velocity(drum, alpha), m / s),
        (
            particle_reynolds(other, beta, 0.4, size * m, rho * kg / m**3),
            particle_reynolds(drum, alpha, 0.4, size, rho),
            1.0,
        ),
    ]
    for scaled, once, factor in pairs:
        assert float(scaled) == pytest.approx(float(once) * factor, rel=1e-11)


@given(filters, st.floats(0.05, 0.95), st.floats(1.01, 1.9))
def test_area_goes_up_and_down_with_the_right_things(drum: DrumFilter, cake_share: float, k: float) -> None:
    # where cake or medium holds next to nothing, its effect is lost in rounding
    alpha = float(resistance_for_cake_share(drum, cake_share))
    once = float(area(drum, alpha, FLOW))
    assert float(area(drum, k * alpha, FLOW)) > once
    assert float(area(drum, alpha, k * FLOW)) > once
    for name in ("medium_resistance", "viscosity", "slurry_concentration"):
        assert float(area(changed(drum, **{name: k * getattr(drum, name)}), alpha, FLOW)) > once
    for name in ("pressure_drop", "rotation_rate"):
        assert float(area(changed(drum, **{name: k * getattr(drum, name)}), alpha, FLOW)) < once
    assert float(area(changed(drum, submerged_fraction=drum.submerged_fraction / k), alpha, FLOW)) > once
    assert float(medium_share(drum, k * alpha)) < float(medium_share(drum, alpha))
    assert float(cake_mass_per_area(drum, k * alpha)) < float(cake_mass_per_area(drum, alpha))


# --- warnings ---

CALM = changed(rotation_rate=1.0 / 60.0)
"""The paper's drum at one turn a minute: the alum cake is 17 mm thick."""


def test_no_warning_where_all_is_well() -> None:
    assert model_warnings(CALM, alum_cake()) == []


def test_the_papers_own_cakes_are_unusually_thick() -> None:
    (text,) = model_warnings(PAPER, alum_cake())
    assert text == "the cake is 56 mm thick: over 50 mm is unusual on a drum (a faster one helps)"


def rate_for_thickness(thickness: float, cake: Cake) -> float:
    """Rotation rate (1/s) at which CALM makes a cake of a thickness (m): eq. 10 solved for n."""
    # Ruth: mu (alpha w / 2 + Rm) w / c = dP f / n
    w = thickness * cake.density * (1.0 - cake.porosity)
    resistance = CALM.viscosity * (0.5 * cake.resistance * w + CALM.medium_resistance) * w / CALM.slurry_concentration
    return CALM.pressure_drop * CALM.submerged_fraction / resistance


@pytest.mark.parametrize(
    ("limit", "inside", "says"),
    [
        (MINIMUM_THICKNESS, 1.001, "mm thick: under 5 mm it is hard to discharge"),
        (MAXIMUM_THICKNESS, 0.999, "mm thick: over 50 mm is unusual"),
    ],
)
def test_thickness_warnings_at_their_limits(limit: float, inside: float, says: str) -> None:
    cake = alum_cake(largest=100.0 * UM)
    for factor, expected in ((inside, False), (2.0 - inside, True)):
        drum = changed(CALM, rotation_rate=rate_for_thickness(factor * limit, cake))
        assert float(cake_thickness(drum, cake.resistance, cake.porosity, cake.density)) == pytest.approx(
            factor * limit, rel=1e-12
        )
        found = model_warnings(drum, cake)
        assert [says in text for text in found] == [True] * expected


def test_layers_warning_at_its_limit() -> None:
    thickness = float(cake_thickness(CALM, 1.009e8, 0.293, ALUM))
    assert model_warnings(CALM, alum_cake(largest=0.999 * thickness / MINIMUM_LAYERS)) == []
    (text,) = model_warnings(CALM, alum_cake(largest=2.0 * thickness / MINIMUM_LAYERS))
    assert "5 times as thick as its largest crystals (" in text
    assert "um): under 10 times it is no packed bed" in text


def test_reynolds_warning_at_its_limit() -> None:
    at_one = float(particle_reynolds(CALM, 1.009e8, 0.293, 1.0))
    assert model_warnings(CALM, alum_cake(sauter_mean=0.999 * MAXIMUM_REYNOLDS / at_one)) == []
    (text,) = model_warnings(CALM, alum_cake(sauter_mean=2.0 * MAXIMUM_REYNOLDS / at_one))
    assert text.startswith("the particle Reynolds number is 20 (filtrate at ")
    assert "mm/s): over 10 the flow leaves Darcy's law; inertia adds about 23% to the cake's resistance" in text


def test_a_light_liquid_lowers_the_reynolds_number() -> None:
    cake = alum_cake(sauter_mean=1.5 * MAXIMUM_REYNOLDS / float(particle_reynolds(CALM, 1.009e8, 0.293, 1.0)))
    assert len(model_warnings(CALM, cake)) == 1
    assert model_warnings(CALM, cake, liquid_density=600.0) == []


def test_slurry_warning_at_its_limit() -> None:
    limit = MAXIMUM_CAKE_VOLUME * ALUM * (1.0 - 0.293)
    assert model_warnings(changed(CALM, slurry_concentration=0.999 * limit), alum_cake()) == []
    (text,) = model_warnings(changed(CALM, slurry_concentration=1.5 * limit), alum_cake())
    assert text.startswith("0.3 of the slurry's volume stays in the cake (slurry of 519.6 kg/m3)")


def test_area_is_too_large_by_no_more_than_the_slurry_in_the_cake() -> None:
    phi = 1.0 - 200.0 / (ALUM * (1.0 - 0.293))
    exact = float(area(on_filtrate_basis(PAPER, 0.293, ALUM), 1.009e8, FLOW))
    assert phi == pytest.approx(0.885, abs=0.0005)
    assert phi < exact / float(area(PAPER, 1.009e8, FLOW)) < 1.0


# --- slurry or filtrate ---


def test_the_filtrate_basis_closes_the_volume() -> None:
    # a cubic metre of slurry: 200 kg of crystals in 200 / (2450 * 0.707) m3 of full cake, and the rest is filtrate
    drum = on_filtrate_basis(PAPER, 0.293, ALUM)
    cake = 200.0 / ALUM / (1.0 - 0.293)
    assert float(drum.filtrate_per_slurry) + cake == pytest.approx(1.0, rel=1e-14)
    # Ruth's law for that filtrate alone, V m3 of it per turn and m2, gives the time submerged
    w = float(cake_mass_per_area(drum, 1.009e8))
    volume = w / 200.0 * float(drum.filtrate_per_slurry)
    seconds = 1e-3 / 53.32e3 * (1.009e8 * (w / volume) * volume**2 / 2.0 + 5e9 * volume)
    assert seconds == pytest.approx(0.3 * 300.0, rel=1e-12)


@pytest.mark.parametrize(
    ("porosity", "alpha", "percent"), [(row[1], row[2], p) for row, p in zip(FIG_14, (8.5, 8.8, 8.9, 9.1), strict=True)]
)
def test_the_papers_areas_are_larger_by_8_to_9_percent(porosity: float, alpha: float, percent: float) -> None:
    larger = float(area(PAPER, alpha, FLOW) / area(on_filtrate_basis(PAPER, porosity, ALUM), alpha, FLOW)) - 1.0
    assert 100.0 * larger == pytest.approx(percent, abs=0.05)


def test_a_dilute_slurry_is_the_same_on_both_bases() -> None:
    thin = changed(slurry_concentration=1e-6)
    both = [float(area(drum, 1e9, FLOW)) for drum in (thin, on_filtrate_basis(thin, 0.3, ALUM))]
    assert both[0] == pytest.approx(both[1], rel=1e-8)


def test_many_cakes_at_once_on_the_filtrate_basis() -> None:
    porosity, alpha = np.array([0.293, 0.5]), np.array([1.009e8, 2e8])
    found = area(on_filtrate_basis(PAPER, porosity, ALUM), alpha, FLOW)
    for k in range(2):
        assert float(found[k]) == float(area(on_filtrate_basis(PAPER, porosity[k], ALUM), alpha[k], FLOW))
    with pytest.raises(FilterError, match=r"slurry_concentration = 1300 kg/m3: must be below the 1225 kg/m3"):
        on_filtrate_basis(changed(slurry_concentration=1300.0), porosity, ALUM)


# --- many drums at once ---


def test_drums_of_many_speeds_and_pressures() -> None:
    rates, drops = np.array([1e-3, 1e-2]), np.array([[2e4], [5e4], [8e4]])
    drums = changed(rotation_rate=rates, pressure_drop=drops)
    found, share = area(drums, 1e9, FLOW), resistance_for_cake_share(drums, 0.5)
    assert found.shape == share.shape == (3, 2)
    one = changed(rotation_rate=1e-2, pressure_drop=8e4)
    assert float(found[2, 1]) == float(area(one, 1e9, FLOW))
    assert float(share[2, 1]) == float(resistance_for_cake_share(one, 0.5))
    with pytest.raises(FilterError, match=r"rotation_rate = -1 1/s"):
        changed(rotation_rate=np.array([1.0, -1.0]))
    with pytest.raises(FilterError, match=r"resistance = 0 m/kg: must be positive where medium_resistance = 0"):
        area(changed(medium_resistance=np.array([1e9, 0.0])), 0.0, FLOW)


# --- belts ---


@given(filters, resistances, st.floats(0.05, 0.95), st.floats(1e-3, 1.0), st.floats(0.5, 50.0))
def test_a_belt_forms_its_cake_in_the_time_on_its_forming_zone(
    drum: DrumFilter, alpha: float, share: float, speed: float, length: float
) -> None:
    unrolled = belt(drum, share, speed, length)
    w = float(cake_mass_per_area(unrolled, alpha))
    assert float(forming_time(unrolled, alpha, w)) == pytest.approx(share * length / speed, rel=1e-11)
    # mass balance: what the belt carries off is what the slurry brings
    width = float(area(unrolled, alpha, FLOW)) / length
    assert w * speed * width == pytest.approx(drum.slurry_concentration * FLOW, rel=1e-12)


def test_a_belt_is_the_drum_of_its_share_and_turns() -> None:
    assert belt(PAPER, 0.3, 0.02, 6.0) == changed(rotation_rate=1.0 / 300.0)
    for name, values in {"form_share": (1.0, 0.02, 6.0), "belt_speed": (0.3, 0.0, 6.0)}.items():
        with pytest.raises(FilterError, match=f"{name} = "):
            belt(PAPER, *values)
    with pytest.raises(FilterError, match="belt_length = -1 m"):
        belt(PAPER, 0.3, 0.02, -1.0)


# --- the time a cake takes to form ---


@given(filters, resistances)
def test_the_cake_of_a_turn_forms_in_the_time_submerged(drum: DrumFilter, alpha: float) -> None:
    w = cake_mass_per_area(drum, alpha)
    assert float(forming_time(drum, alpha, w)) == pytest.approx(
        float(drum.submerged_fraction / drum.rotation_rate), rel=1e-11
    )


def test_a_slurry_too_slow_for_any_continuous_filter_is_said() -> None:
    # 3 mm are w = 3e-3 * 2450 * 0.707 kg/m2; without a medium they take mu alpha w^2 / (2 c dP)
    w = 3e-3 * ALUM * (1.0 - 0.293)
    at_limit = 300.0 * 2.0 * 200.0 * 53.32e3 / (1e-3 * w**2)
    drum = changed(CALM, medium_resistance=0.0)
    for factor, expected in ((0.999, False), (1.001, True)):
        found = model_warnings(drum, alum_cake(resistance=factor * at_limit, largest=1e-6))
        assert [text for text in found if "no continuous filter" in text] == [
            "3 mm of cake take 5 min to form: over 5 min no continuous filter should be tried; take a batch filter"
        ] * expected


def test_a_drum_on_the_filtrate_basis_is_not_warned_about_its_slurry() -> None:
    thick = changed(CALM, slurry_concentration=400.0)
    assert sum("slurry's volume" in text for text in model_warnings(thick, alum_cake())) == 1
    assert not any("slurry's" in text for text in model_warnings(on_filtrate_basis(thick, 0.293, ALUM), alum_cake()))


def test_every_warning_is_said() -> None:
    drum = changed(rotation_rate=1e4, medium_resistance=1e6, slurry_concentration=800.0)
    found = model_warnings(drum, alum_cake(resistance=1e6, largest=2e-3))
    for says in ("hard to discharge", "no packed bed", "Reynolds number", "slurry's volume"):
        assert sum(says in text for text in found) == 1


def test_no_cake_no_warning() -> None:
    assert model_warnings(PAPER, alum_cake(resistance=math.nan, porosity=math.nan)) == []


# --- the table ---


def test_design_table() -> None:
    cakes = [
        alum_cake(resistance=alpha, porosity=porosity, sauter_mean=3.0 * a_um * UM)
        for a_um, porosity, alpha, _, _ in FIG_14
    ]
    table = design_table(PAPER, cakes, FLOW)
    assert tuple(table.columns) == DESIGN_COLUMNS
    assert table["filter_area_m2"].to_numpy() == pytest.approx([row[3] for row in FIG_14], abs=0.005)
    assert (100.0 * table["medium_share"]).round().tolist() == [row[4] for row in FIG_14]
    assert table["cake_mass_kg_m2"].tolist() == [float(cake_mass_per_area(PAPER, row[2])) for row in FIG_14]
    assert table["cake_thickness_mm"].to_numpy() == pytest.approx([56.0, 61.1, 64.1, 66.2], abs=0.05)
    assert table["filtrate_velocity_mm_s"].to_numpy() == pytest.approx([5.39, 5.88, 6.18, 6.38], abs=0.006)
    assert table["particle_reynolds"].to_numpy() == pytest.approx([1.34, 1.67, 1.91, 2.08], abs=0.005)
    assert table["filter_warnings"].str.contains("unusual on a drum").all()


def test_design_table_keeps_the_row_of_a_failed_packing() -> None:
    failed = alum_cake(resistance=math.nan, porosity=math.nan)
    table = design_table(CALM, [failed, alum_cake()], [FLOW, 2.0 * FLOW])
    assert table.iloc[0, :-1].isna().all()
    assert table["filter_warnings"].tolist() == ["", ""]
    assert table["filter_area_m2"].iloc[1] == float(area(CALM, 1.009e8, 2.0 * FLOW))
    assert tuple(design_table(CALM, [], FLOW).columns) == DESIGN_COLUMNS


def test_design_table_refuses_flows_that_do_not_match() -> None:
    with pytest.raises(FilterError, match=r"slurry_flow has shape \(3,\): must be one number or one per cake \(2\)"):
        design_table(CALM, [alum_cake()] * 2, [FLOW] * 3)


# --- bad input ---


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("submerged_fraction", 1.2, "submerged_fraction = 1.2: must be above 0 and below 1"),
        ("submerged_fraction", 1.0, "submerged_fraction = 1: must be above 0 and below 1"),
        ("submerged_fraction", 0.0, "submerged_fraction = 0: must be above 0 and below 1"),
        ("submerged_fraction", -0.3, "submerged_fraction = -0.3: must"),
        ("pressure_drop", -5e4, "pressure_drop = -50000 Pa: must be positive and finite"),
        ("pressure_drop", 0.0, "pressure_drop = 0 Pa: must be positive"),
        ("pressure_drop", math.inf, "pressure_drop = inf Pa: must be positive and finite"),
        ("rotation_rate", 0.0, "rotation_rate = 0 1/s: must be positive and finite (a drum at rest"),
        ("rotation_rate", -0.01, "rotation_rate = -0.01 1/s: must be positive"),
        ("medium_resistance", -1.0, "medium_resistance = -1 1/m: must be zero or positive"),
        ("viscosity", 0.0, "viscosity = 0 Pa s: must be positive"),
        ("slurry_concentration", 0.0, "slurry_concentration = 0 kg/m3: must be positive"),
        ("filtrate_per_slurry", 1.01, "filtrate_per_slurry = 1.01: must be above 0 and at most 1"),
        ("filtrate_per_slurry", 0.0, "filtrate_per_slurry = 0: must be above 0"),
        *((field.name, math.nan, f"{field.name} = nan") for field in dataclasses.fields(DrumFilter)),
    ],
)
def test_bad_filters_are_refused(name: str, value: float, says: str) -> None:
    with pytest.raises(FilterError) as caught:
        changed(**{name: value})
    assert str(caught.value).startswith(says)
    assert "must be" in str(caught.value)
    assert isinstance(caught.value, FiltercakeError)


def test_all_bad_values_are_named_at_once() -> None:
    with pytest.raises(FilterError) as caught:
        changed(submerged_fraction=30.0, viscosity=-1.0)
    assert [line.split(" = ")[0] for line in str(caught.value).splitlines()] == ["submerged_fraction", "viscosity"]


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("resistance", -1e8, "resistance = -1e+08 m/kg: must be zero or positive"),
        ("resistance", math.inf, "resistance = inf m/kg"),
        ("porosity", 1.0, "porosity = 1: must be above 0 and below 1"),
        ("porosity", 29.3, "porosity = 29.3: must be above 0 and below 1"),
        ("density", 0.0, "density = 0 kg/m3: must be positive"),
        ("sauter_mean", math.nan, "sauter_mean = nan m: must be positive"),
        ("largest", -1.0, "largest = -1 m: must be positive"),
    ],
)
def test_bad_cakes_are_refused(name: str, value: float, says: str) -> None:
    with pytest.raises(FilterError) as caught:
        alum_cake(**{name: value})
    assert str(caught.value).startswith(says)


@pytest.mark.parametrize("bad", [math.nan, -1.0, math.inf])
def test_bad_arguments_are_refused(bad: float) -> None:
    calls = {
        "resistance": lambda: area(PAPER, [1e8, bad], FLOW),
        "slurry_flow": lambda: area(PAPER, 1e8, [FLOW, bad]),
        "filter_area": lambda: capacity(PAPER, 1e8, bad),
        "porosity": lambda: cake_thickness(PAPER, 1e8, bad, ALUM),
        "density": lambda: cake_thickness(PAPER, 1e8, 0.3, bad),
        "share": lambda: resistance_for_cake_share(PAPER, bad),
        "sauter_mean": lambda: particle_reynolds(PAPER, 1e8, 0.3, bad),
        "liquid_density": lambda: particle_reynolds(PAPER, 1e8, 0.3, 1e-4, bad),
    }
    for name, call in calls.items():
        with pytest.raises(FilterError) as caught:
            call()
        assert str(caught.value).startswith(f"{name} = {bad:g}")


def test_zero_flow_and_zero_area_are_refused() -> None:
    with pytest.raises(FilterError, match="slurry_flow = 0 m3/s: must be positive"):
        area(PAPER, 1e8, 0.0)
    with pytest.raises(FilterError, match="filter_area = 0 m2: must be positive"):
        capacity(PAPER, 1e8, 0.0)


def test_a_cake_that_holds_all_resistance_has_no_threshold() -> None:
    with pytest.raises(FilterError, match="medium_resistance = 0 1/m: must be positive"):
        resistance_for_cake_share(changed(medium_resistance=0.0), 0.8)
    with pytest.raises(FilterError, match="share = 1: must be at least 0 and below 1"):
        resistance_for_cake_share(PAPER, 1.0)


def test_nothing_that_resists_is_refused() -> None:
    with pytest.raises(FilterError, match="resistance = 0 m/kg: must be positive where medium_resistance = 0 1/m"):
        area(changed(medium_resistance=0.0), [1e8, 0.0], FLOW)


def test_a_slurry_as_dense_as_its_cake_is_refused() -> None:
    with pytest.raises(FilterError, match=r"slurry_concentration = 1800 kg/m3: must be below the 1732.15 kg/m3"):
        cake_thickness(changed(slurry_concentration=1800.0), 1e8, 0.293, ALUM)
