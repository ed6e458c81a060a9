"""What makes intervals cheaper: weighed on synthetic packings whose answer is known, and clouds as arranged."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from filtercake.packing.analytic_models import yu_zou_standish
from filtercake.packing.cloud import Cloud
from filtercake.packing.result import Packing
from filtercake.validation.cheaper_intervals import depths, explained, extrapolated, methods
from filtercake.validation.cheaper_packings import (
    DEEPER,
    MIRRORED,
    OTHER_STEP,
    PLAIN,
    STRATIFIED,
    WIDER,
    measured,
    mirrored,
    plain,
    stratified,
    ways,
)
from filtercake.validation.pressure import bed, pmma

SCENE = bed({"mixture": {20.0: 0.5, 50.0: 0.5}}, particles=300)
SPREAD, COUNT = 0.002, 4000


def rows(way: str, interior: np.ndarray, **others: np.ndarray) -> pd.DataFrame:
    table = {"way": way, "friction": 0.0, "bed_depth_factor": 1.0, "replicate": np.arange(interior.size)}
    return pd.DataFrame({**table, "interior": interior, **others})


@pytest.fixture(scope="module")
def weighed() -> pd.DataFrame:
    """Composition explains a quarter of the variance, the cloud three quarters; half the deviation is mirrored."""
    random = np.random.default_rng(1)
    composed, arranged, chance = (
        0.5 * SPREAD * np.array([[1.0], [np.sqrt(2.0)], [1.0]]) * random.standard_normal((3, COUNT))
    )
    own = 0.35 + composed + arranged + chance
    again = 0.35 + composed + arranged + 0.5 * SPREAD * random.standard_normal(COUNT)
    other = yu_zou_standish(pmma()) + composed
    columns = {"model_interior": other - 0.001, "model_cloud": other, "larger_slab": own + 0.001}
    base = rows(PLAIN, own, **columns, tapered=own, bed=0.35 + 0.5 * (own - 0.35))
    made = [
        base,
        rows(OTHER_STEP, again),
        rows(MIRRORED, 0.7 - own),
        rows(STRATIFIED, 0.351 + arranged + chance),
        rows(WIDER, 0.35 + 0.5 * (own - 0.35)),
    ]
    return methods(pd.concat(made, ignore_index=True)).set_index("method")


def test_every_method_is_weighed_by_its_variance(weighed: pd.DataFrame) -> None:
    share = weighed["packings"]
    assert share["model of the interior's composition, nominal mean"] == pytest.approx(0.75, abs=0.03)
    assert share["the same, coefficient and mean fitted"] == pytest.approx(0.75, abs=0.03)
    assert share["model of the composition of the cloud's middle"] == pytest.approx(0.75, abs=0.03)
    assert share["all that follows from the cloud"] == pytest.approx(0.25, abs=0.03)
    assert share["whole bed"] == pytest.approx(0.25)
    assert share[STRATIFIED] == pytest.approx(0.75, abs=0.05)
    assert share[WIDER] == pytest.approx(1.0)  # a quarter of the variance at four times the cost
    assert share[MIRRORED] == pytest.approx(0.0, abs=1e-9)


def test_every_bias_is_told(weighed: pd.DataFrame) -> None:
    bias = weighed["bias"]
    assert bias["model of the interior's composition, nominal mean"] == pytest.approx(0.001, abs=1e-4)
    assert bias["model of the composition of the cloud's middle"] == pytest.approx(0.0, abs=1e-12)
    assert bias["slab from half a diameter"] == pytest.approx(0.001)
    assert weighed.loc[STRATIFIED, "bias"] == pytest.approx(0.001, abs=weighed.loc[STRATIFIED, "bias_ci95"] * 1.5)


def test_noise_explains_nothing() -> None:
    random = np.random.default_rng(2)
    assert explained(random.standard_normal(200), random.standard_normal(200)) < 0.03


def test_beds_linear_in_one_over_depth_are_extrapolated() -> None:
    random = np.random.default_rng(3)
    made = [
        rows(PLAIN if depth == 1.0 else DEEPER, 0.33 + 0.02 / depth + 1e-4 * random.standard_normal(20)).assign(
            bed_depth_factor=depth
        )
        for depth in (0.75, 1.0, 2.0, 4.0)
    ]
    means = depths(pd.concat(made, ignore_index=True))
    assert list(means["depth"]) == [0.75, 1.0, 2.0, 4.0]
    for deepest in (2.0, 4.0):
        found, half = extrapolated(means, deepest)
        assert abs(found - 0.33) < 2.0 * half < 5e-4


def apart(cloud: Cloud) -> float:
    """Least gap between two spheres of a cloud, over the smallest radius."""
    away = cloud.position[:, None] - cloud.position[None]
    away[..., :2] -= cloud.length * np.round(away[..., :2] / cloud.length)
    gap = np.linalg.norm(away, axis=-1) - cloud.radius[:, None] - cloud.radius[None]
    return float(gap[np.triu_indices(cloud.radius.size, 1)].min() / cloud.radius.min())


def test_arranged_clouds_hold_the_same_spheres_without_overlap() -> None:
    own = plain(SCENE, 0)
    for place in (mirrored, stratified):
        cloud = place(SCENE, 0)
        assert np.array_equal(cloud.radius, own.radius)
        assert apart(cloud) >= -1e-9
        assert (cloud.position[:, 2] >= cloud.radius - 1e-12).all()
        assert (cloud.position[:, 2] <= cloud.height - cloud.radius + 1e-12).all()
    assert np.allclose(mirrored(SCENE, 0).position[:, 2] + own.position[:, 2], own.height)


def test_stratified_classes_stand_evenly() -> None:
    cloud = stratified(SCENE, 1)
    for radius in np.unique(cloud.radius):
        heights = np.sort(cloud.position[cloud.radius == radius, 2])
        share = (heights - radius) / (cloud.height - 2.0 * radius)
        assert np.array_equal(np.floor(share * share.size), np.arange(share.size))


def test_a_packing_is_measured_by_every_estimator() -> None:
    cloud = plain(SCENE, 0)
    found = measured(Packing(cloud.position, cloud.radius, cloud.length), SCENE, cloud)
    for name in ("interior", "larger_slab", "tapered", "bed"):
        assert found[name] == pytest.approx(cloud.void_fraction, abs=0.08)
    assert found["model_interior"] == pytest.approx(yu_zou_standish(pmma()), abs=0.03)


def test_ways_differ_from_what_is_asked_for_in_one_thing() -> None:
    listed = list(ways())
    assert {way.name for way in listed} == {PLAIN, OTHER_STEP, MIRRORED, STRATIFIED, WIDER, DEEPER}
    base = listed[0].scene
    wide = next(way.scene for way in listed if way.name == WIDER)
    assert wide.box_length == pytest.approx(2.0 * base.box_length)
    assert wide.cloud_height == pytest.approx(base.cloud_height)
    for way in listed:
        if way.name == DEEPER:
            assert way.scene.box_length == pytest.approx(base.box_length, rel=1e-3)
