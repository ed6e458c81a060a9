"""Estimates without a packing: options, units, resistances, one clear error for bad ones."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filtercake import api
from filtercake.errors import ConfigError
from filtercake.filtration.resistance import log_sensitivity

PMMA = api.distribution(mixture={20: 0.5, 50: 0.5})
CRYSTALS: dict[str, Any] = {"density_kg_m3": 1180, "friction": 0.1}


def test_an_estimate_in_full() -> None:
    found = api.predict(PMMA, **CRYSTALS, adhesion_mJ_m2=10)
    assert found.protocol == "filtration"
    assert 0.33 < found.porosity < 0.42
    assert 0.0 < found.porosity_ci95 < found.porosity_packing_ci95 < 0.03
    assert found.porosity_at_medium is not None and found.porosity_at_medium < found.porosity
    assert found.compressibility is not None and 0.0 < found.compressibility < 0.3
    assert found.load_over_strength == pytest.approx(50e3 / 400.0, rel=0.6)
    assert found.packings > 100
    assert found.outside == found.warnings == ()


def test_resistances_are_those_of_the_estimated_porosity() -> None:
    found = api.predict(PMMA, **CRYSTALS, law="additive", sphericity=0.8)
    same = api.resistance(
        PMMA,
        porosity=found.porosity,
        porosity_ci95=found.porosity_ci95,
        density_kg_m3=1180,
        sphericity=0.8,
        law="additive",
    )
    shared = asdict(found).keys() & asdict(same).keys()
    assert {"resistance_m_kg", "resistance_ci95_m_kg", "resistance_law_ci95_m_kg"} <= shared
    assert {name: getattr(found, name) for name in shared} == {name: getattr(same, name) for name in shared}
    slope = abs(log_sensitivity(found.porosity))
    assert found.resistance_ci95_m_kg == pytest.approx(found.resistance_m_kg * slope * found.porosity_ci95)


def test_no_adhesion_is_an_adhesion_of_nothing() -> None:
    assert api.predict(PMMA, **CRYSTALS) == api.predict(PMMA, **CRYSTALS, adhesion_mJ_m2=0)
    bare = api.predict(PMMA, **CRYSTALS)
    assert (bare.load_over_strength, bare.compressibility) == (None, 0.0)
    assert bare.porosity == bare.porosity_at_medium


def test_finer_crystals_of_the_same_adhesion_pack_looser() -> None:
    found = [
        api.predict(api.distribution(mixture={d: 0.5, 2.5 * d: 0.5}), **CRYSTALS, adhesion_mJ_m2=1).porosity
        for d in (2, 20, 200)
    ]
    assert found == sorted(found, reverse=True)


@given(factor=st.floats(0.1, 30.0))
@settings(max_examples=15, deadline=None)
def test_sizes_and_adhesion_scaled_alike_change_nothing(factor: float) -> None:
    scaled = api.distribution(mixture=[(50 * factor, 0.5), (20 * factor, 0.5)])
    one = api.predict(PMMA, **CRYSTALS, adhesion_mJ_m2=2)
    other = api.predict(scaled, **CRYSTALS, adhesion_mJ_m2=2 * factor)
    assert other.porosity == pytest.approx(one.porosity, abs=1e-6)
    assert other.porosity_ci95 == pytest.approx(one.porosity_ci95, rel=1e-3)
    assert other.resistance_m_kg * factor**2 == pytest.approx(one.resistance_m_kg, rel=1e-4)


def test_more_pressure_packs_denser_and_resists_more() -> None:
    found = [api.predict(PMMA, **CRYSTALS, adhesion_mJ_m2=50, pressure_kPa=p) for p in (5, 20, 80, 320)]
    assert [each.porosity for each in found] == sorted((each.porosity for each in found), reverse=True)
    assert [each.resistance_m_kg for each in found] == sorted(each.resistance_m_kg for each in found)


def test_a_crystallizers_product_brings_its_density() -> None:
    alum = api.distribution(kinetics="ammonium_alum", residence_time_min=15, slurry_concentration_kg_m3=200)
    found = api.predict(alum)
    # cells of 8000 without friction and cohesion: 0.2852 (docs/pressure.md), at six times the stress
    assert found.porosity == pytest.approx(0.288, abs=0.008)
    assert 5e7 < found.resistance_m_kg < 2e8


def test_settled_beds_are_the_papers() -> None:
    found = api.predict(PMMA, density_kg_m3=1180, protocol="gravity")
    # settled beds of 2000 at 50 kJ/m3: 0.3528 (docs/pressure.md)
    assert abs(found.porosity - 0.3528) < found.porosity_ci95 + 0.003
    assert (found.porosity_at_medium, found.compressibility, found.load_over_strength) == (None, None, None)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"friction": -1}, r"friction"),
        ({"friction": float("nan")}, r"friction"),
        ({"friction": "much"}, r"friction"),
        ({"restitution": 0.3}, r"restitution.*unknown key"),
        ({"particles": 100}, r"particles.*unknown key"),
        ({"pressure_kPa": 0}, r"pressure_kPa"),
        ({"pressure_kPa": 50, "protocol": "gravity"}, r"pressure"),
        ({"adhesion_mJ_m2": 10, "protocol": "gravity"}, r"adhesion"),
        ({"protocol": "centrifuge"}, r"protocol"),
        ({"law": "stokes"}, r"law.*additive, carman"),
        ({"law": "darcy"}, r"law"),
        ({"adhesion_mJ_m2": 1e6}, r"adhesion"),
        ({"density_kg_m3": 1.18}, r"density_kg_m3.*g/cm3"),
        ({"density_kg_m3": None}, r"density_kg_m3"),
        ({"sphericity": 2}, r"sphericity"),
        ({"friction": 100}, r"friction"),
    ],
)
def test_a_wrong_option_is_named(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        api.predict(PMMA, **{**CRYSTALS, **options})


def test_sizes_too_far_apart_are_refused() -> None:
    wide = api.distribution(mixture={1: 0.3, 1000: 0.7})
    with pytest.raises(ConfigError, match=r"distribution.*too far off for an estimate; use pack"):
        api.predict(wide, **CRYSTALS)
