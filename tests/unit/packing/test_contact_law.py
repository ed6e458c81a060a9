"""The contact law's closed forms against the numbers of the paper and against the force law itself."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar

from filtercake.packing import contact_law

E, NU = 5e6, 0.2

moduli = st.floats(5e5, 1e11)
poissons = st.floats(0.0, 0.49)
cohesions = st.floats(1e3, 2e5)
radii = st.floats(1e-6, 1e-3)


def attraction(overlap: float, s: float, modulus: float, radius: float) -> float:
    """SJKR cohesion at small overlap less the Hertz repulsion, N, with effective modulus and radius."""
    return s * 2.0 * math.pi * radius * overlap - 4.0 / 3.0 * modulus * math.sqrt(radius) * overlap**1.5


def test_effective_quantities_by_hand() -> None:
    assert contact_law.effective_modulus(E, NU) == pytest.approx(5e6 / 1.92, rel=1e-14)  # two equal materials
    assert contact_law.shear_modulus(E, NU) == pytest.approx(5e6 / 2.4, rel=1e-14)
    assert contact_law.effective_radius(10e-6, 25e-6) == pytest.approx(250 / 35 * 1e-6, rel=1e-14)
    assert contact_law.effective_radius(10e-6, math.inf) == 10e-6


@given(radii, radii)
def test_effective_radius_is_symmetric_and_below_both(a: float, b: float) -> None:
    assert contact_law.effective_radius(a, b) == pytest.approx(contact_law.effective_radius(b, a), rel=1e-14)
    assert contact_law.effective_radius(a, b) < min(a, b)
    assert contact_law.effective_radius(a, 1e9) == pytest.approx(contact_law.effective_radius(a, math.inf), rel=1e-9)


@pytest.mark.parametrize(("diameter_um", "density", "microseconds"), [(20.0, 1180.0, 0.822), (32.5, 2450.0, 1.92)])
def test_rayleigh_time_steps_of_the_paper(diameter_um: float, density: float, microseconds: float) -> None:
    step = contact_law.rayleigh_time_step(0.5e-6 * diameter_um, density, E, NU)
    assert step * 1e6 == pytest.approx(microseconds, rel=0.003)  # three figures printed


def test_the_rayleigh_step_by_hand() -> None:
    # pi 10e-6 sqrt(1180 / (5e6/2.4)) / (0.1631*0.2 + 0.8766) s
    assert contact_law.rayleigh_time_step(10e-6, 1180.0, E, NU) == pytest.approx(
        math.pi * 10e-6 * math.sqrt(1180.0 * 2.4 / 5e6) / 0.90922, rel=1e-12
    )


@pytest.mark.parametrize(("step_us", "diameter_um", "density", "percent"), [(0.1, 20, 1180, 12), (0.5, 32.5, 2450, 26)])
def test_the_paper_s_steps_as_shares_of_rayleigh(
    step_us: float, diameter_um: float, density: float, percent: float
) -> None:
    share = step_us * 1e-6 / contact_law.rayleigh_time_step(0.5e-6 * diameter_um, density, E, NU)
    assert 100 * share == pytest.approx(percent, abs=0.5)


@given(radii, st.floats(100, 10_000), moduli, poissons, st.floats(0.1, 10))
def test_the_rayleigh_step_scales_as_it_must(r: float, density: float, modulus: float, nu: float, k: float) -> None:
    step = contact_law.rayleigh_time_step(r, density, modulus, nu)
    assert contact_law.rayleigh_time_step(k * r, density, modulus, nu) == pytest.approx(k * step, rel=1e-12)
    assert contact_law.rayleigh_time_step(r, k**2 * density, modulus, nu) == pytest.approx(k * step, rel=1e-12)
    assert contact_law.rayleigh_time_step(r, density, k**2 * modulus, nu) == pytest.approx(step / k, rel=1e-12)


def test_damping_ratio() -> None:
    assert contact_law.damping_ratio(1.0) == 0.0
    # a damped harmonic contact rebounds with e = exp(-pi b / sqrt(1 - b^2)): the definition turned round
    for e in (0.1, 0.3, 0.6, 0.9):
        b = contact_law.damping_ratio(e)
        assert b > 0.0
        assert math.exp(-math.pi * b / math.sqrt(1.0 - b**2)) == pytest.approx(e, rel=1e-12)


@pytest.mark.parametrize(
    ("kj_m3", "percent", "decimals"), [(15, 0.02, 2), (50, 0.20, 2), (100, 0.82, 2), (200, 3.3, 1)]
)
def test_equilibrium_overlaps_of_physics_md(kj_m3: float, percent: float, decimals: int) -> None:
    relative = contact_law.relative_overlap(kj_m3 * 1e3, E, NU)
    assert round(100 * relative, decimals) == percent
    of_spheres = contact_law.equilibrium_overlap(kj_m3 * 1e3, E, NU, 3e-6, 3e-6) / 6e-6
    assert relative == pytest.approx(of_spheres, rel=1e-12)


@pytest.mark.parametrize(("kj_m3", "percent"), [(50, 0.4), (100, 1.6), (200, 6.0)])
def test_soft_contacts_compact_the_bed_as_physics_md_says(kj_m3: float, percent: float) -> None:
    # -0.004, -0.016, -0.06 at porosity 0.36, one figure or two printed
    found = 100 * contact_law.soft_contact_compaction(0.36, kj_m3 * 1e3, E, NU)
    assert found == pytest.approx(percent, rel=0.07)


@given(cohesions, moduli, poissons, radii, radii)
def test_equilibrium_is_the_root_of_the_force(s: float, modulus: float, nu: float, a: float, b: float) -> None:
    star, radius = contact_law.effective_modulus(modulus, nu), contact_law.effective_radius(a, b)
    overlap = contact_law.equilibrium_overlap(s, modulus, nu, a, b)
    root = brentq(lambda d: attraction(d, s, star, radius), 0.5 * overlap, 2.0 * overlap, xtol=1e-30, rtol=1e-12)
    assert overlap == pytest.approx(root, rel=1e-9)


@given(cohesions, moduli, poissons, radii, radii)
def test_pull_off_is_the_largest_attraction(s: float, modulus: float, nu: float, a: float, b: float) -> None:
    star, radius = contact_law.effective_modulus(modulus, nu), contact_law.effective_radius(a, b)
    overlap = contact_law.equilibrium_overlap(s, modulus, nu, a, b)
    best = minimize_scalar(
        lambda share: -attraction(share * overlap, s, star, radius) / contact_law.pull_off_force(s, modulus, nu, a, b),
        bounds=(0.0, 1.0),
        method="bounded",
        options={"xatol": 1e-10},
    )
    assert -best.fun == pytest.approx(1.0, rel=1e-9)
    assert best.x == pytest.approx(4.0 / 9.0, rel=1e-5)  # dF/dd = 0 at (s pi sqrt(R*)/E*)^2 = 4/9 of equilibrium


@given(st.floats(1e-4, 0.1), moduli, poissons)
def test_cohesion_at_overlap_inverts_relative_overlap(relative: float, modulus: float, nu: float) -> None:
    s = contact_law.cohesion_at_overlap(relative, modulus, nu)
    assert contact_law.relative_overlap(s, modulus, nu) == pytest.approx(relative, rel=1e-12)


@given(cohesions, moduli, poissons, st.floats(1.1, 10.0))
def test_relative_overlap_goes_as_cohesion_over_modulus_squared(s: float, modulus: float, nu: float, k: float) -> None:
    once = contact_law.relative_overlap(s, modulus, nu)
    assert contact_law.relative_overlap(k * s, modulus, nu) == pytest.approx(k**2 * once, rel=1e-12)
    assert contact_law.relative_overlap(k * s, k * modulus, nu) == pytest.approx(once, rel=1e-12)


def test_no_cohesion_means_no_overlap_and_no_pull() -> None:
    assert contact_law.equilibrium_overlap(0.0, E, NU, 1e-5, 1e-5) == 0.0
    assert contact_law.pull_off_force(0.0, E, NU, 1e-5, 1e-5) == 0.0
    assert contact_law.soft_contact_compaction(0.36, 0.0, E, NU) == 0.0


@given(cohesions, moduli, poissons)
def test_cohesion_of_a_strength_is_the_inverse(s: float, youngs: float, poisson: float) -> None:
    strength = contact_law.cohesive_strength(s, youngs, poisson)
    assert contact_law.cohesion_of_strength(strength, youngs, poisson) == pytest.approx(s, rel=1e-12)
    assert contact_law.cohesion_of_strength(0.0, youngs, poisson) == 0.0


def test_adhesive_strength_by_hand() -> None:
    # pull-off 1.5 pi 0.01 J/m2 5 um = 0.2356 uN over (20 um)^2
    assert contact_law.adhesive_force(0.01, 10e-6, 10e-6) == pytest.approx(0.23562e-6, rel=1e-5)
    assert contact_law.adhesive_strength(0.01, 20e-6) == pytest.approx(589.05, rel=1e-5)


adhesions = st.floats(1e-5, 1.0)


@given(adhesions, radii)
def test_adhesion_of_a_strength_is_the_inverse(w: float, r: float) -> None:
    strength = contact_law.adhesive_strength(w, 2.0 * r)
    assert contact_law.adhesion_of_strength(strength, 2.0 * r) == pytest.approx(w, rel=1e-12)
    assert contact_law.adhesive_force(w, r, r) == pytest.approx(strength * (2.0 * r) ** 2, rel=1e-12)


@given(adhesions, radii, radii)
def test_adhesive_force_goes_as_the_effective_radius(w: float, a: float, b: float) -> None:
    force = contact_law.adhesive_force(w, a, b)
    assert force / contact_law.adhesive_force(w, a, a) == pytest.approx(2.0 * b / (a + b), rel=1e-12)


@given(adhesions, moduli, poissons, radii, radii)
def test_adhesive_overlap_balances_hertz(w: float, modulus: float, nu: float, a: float, b: float) -> None:
    star, radius = contact_law.effective_modulus(modulus, nu), contact_law.effective_radius(a, b)
    overlap = contact_law.adhesive_overlap(w, modulus, nu, a, b)
    assert 4.0 / 3.0 * star * math.sqrt(radius) * overlap**1.5 == pytest.approx(
        contact_law.adhesive_force(w, a, b), rel=1e-12
    )


@given(moduli, poissons)
def test_tangential_constants_depend_on_poissons_ratio_alone(youngs: float, poisson: float) -> None:
    shear = (1.0 - poisson) / (2.0 * (2.0 - poisson))  # G* over E*
    assert contact_law.shear_stiffness_ratio(youngs, poisson) == pytest.approx(6.0 * shear, rel=1e-12)
    assert contact_law.shear_damping_ratio(youngs, poisson) == pytest.approx(2.0 * math.sqrt(shear), rel=1e-12)
