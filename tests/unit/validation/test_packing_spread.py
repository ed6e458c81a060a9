"""What is known of a packing's spread: how it goes with the scene, and that it is what the committed ensembles say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL
from filtercake.packing.spread import (
    COUNT_POWER,
    FREEDOM,
    SD,
    effective_spheres,
    interior_share,
    known_spread,
)
from filtercake.validation import packing_spread
from filtercake.validation.pressure import bed

REPOSITORY = Path(__file__).resolve().parents[3]
PMMA = bed({"mixture": {20.0: 0.5, 50.0: 0.5}}, particles=2000)


def test_equal_spheres_count_as_many_as_they_are() -> None:
    assert effective_spheres(mixture([20e-6], [1.0]), 700) == pytest.approx(700.0)


def test_uneven_spheres_count_as_fewer() -> None:
    """Of 2000 spheres 1880 hold one half of the volume and 120 the other: 1/(0.25/1880 + 0.25/120)."""
    assert effective_spheres(PMMA.csd, 2000) == pytest.approx(1.0 / (0.25 / 1879.7 + 0.25 / 120.3), rel=1e-4)


@given(
    sizes=st.lists(st.floats(1e-6, 1e-3), min_size=1, max_size=6, unique=True),
    particles=st.integers(10, 100_000),
)
def test_never_more_count_than_there_are(sizes: list[float], particles: int) -> None:
    csd = CrystalSizeDistribution.from_classes(sizes, np.full(len(sizes), 1.0 / len(sizes)))
    assert 0.0 < effective_spheres(csd, particles) <= particles * (1.0 + 1e-9)


def test_pressed_cakes_are_interior_throughout() -> None:
    assert interior_share(replace(PMMA, protocol=FILTRATION_PROTOCOL, pressure=1.0, crystal_modulus=1.0)) == 1.0
    # 282 um of cloud twice at 0.35 solids settle to 282 um at 0.7, less 50 um at floor and surface
    assert interior_share(PMMA) == pytest.approx(1.0 - 100.0 / 282.0, abs=0.01)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_larger_beds_scatter_less(friction: float) -> None:
    scene = replace(PMMA, friction=friction)
    spreads = [known_spread(replace(scene, particles=n)).sd for n in (500, 1000, 2000, 8000, 100_000)]
    assert np.all(np.diff(spreads) < 0.0)
    assert known_spread(replace(scene, friction=0.0)).sd <= spreads[2]


def test_it_is_what_the_committed_packings_scatter() -> None:
    """Of 64 packings without friction and 64 with it, known beforehand within their own uncertainty."""
    table, _ = packing_spread.ensembles(REPOSITORY / "docs" / "data")
    here = table[(table["particles"] == 2000) & table["source"].isin(["agreement_replicates", "reference_replicates"])]
    for _, group in here.groupby(here["friction"] > 0.0):
        ratio = np.sqrt(np.average((group["sd"] / group["known_sd"]) ** 2, weights=group["freedom"]))
        assert ratio == pytest.approx(1.0, abs=0.15)


def test_the_constants_are_those_of_the_fit() -> None:
    found = packing_spread.fit(*packing_spread.ensembles(REPOSITORY / "docs" / "data"))
    assert 0.0 <= 2.0 * found.gain < chi2.ppf(0.95, len(SD) + len(found.powers))
    for kind, sd in SD.items():
        assert found.sd[kind] == pytest.approx(sd, rel=0.15)
    assert found.freedom > max(FREEDOM.values())


def test_the_fit_finds_a_known_law() -> None:
    table, scenes = packing_spread.ensembles(REPOSITORY / "docs" / "data")
    random, freedom = np.random.default_rng(3), table["freedom"].to_numpy()
    true = known_spread(PMMA).freedom
    variance = random.chisquare(freedom) / freedom / (random.chisquare(true, len(table)) / true)
    found = packing_spread.fit(table.assign(sd=table["known_sd"] * np.sqrt(variance)), scenes)
    assert found.sd[GRAVITY_PROTOCOL, False] == pytest.approx(SD[GRAVITY_PROTOCOL, False], rel=0.25)
    assert found.powers[0] == pytest.approx(COUNT_POWER, abs=0.2)
    assert 12.0 < found.freedom < 100.0
