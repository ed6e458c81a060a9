"""The instant estimate as it comes with the package: symmetries, order, its hull, and packings that were held out."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.design import emulator, emulator_file
from filtercake.design.emulator import FARTHEST, FEATURES, MEANINGS, CurveEstimate, Emulator, features_of
from filtercake.design.emulator_file import MODELS, read, shipped, write
from filtercake.design.packing_features import SHAPE_FEATURES, counting_spheres, friction_feature, shape_features
from filtercake.errors import ConfigError
from filtercake.packing.compression import LOADS
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL, Scene
from filtercake.statistics import quantile
from filtercake.units import MICROMETRE
from filtercake.validation.emulator_design import cell_scene, settled_scene
from filtercake.validation.emulator_evidence import accepted, half_widths, read_packings, scene_of

DATA = Path(__file__).parents[3] / "docs" / "data"
FRICTIONS = (0.0, 0.03, 0.1, 0.3, 0.6, 1.0)


def bimodal(fine: float = 0.5, ratio: float = 2.5, size: float = 20.0) -> CrystalSizeDistribution:
    sizes = np.array([size, size * ratio]) * MICROMETRE
    return CrystalSizeDistribution.from_classes(sizes, [fine, 1.0 - fine])


def pressed(csd: CrystalSizeDistribution, friction: float = 0.1, attraction: str = "adhesion") -> CurveEstimate:
    return shipped()[FILTRATION_PROTOCOL].estimate(cell_scene(csd, friction, attraction, 2000, 1))


def bed(friction: float = 0.0, cohesion: float = 50.0, sauter_um: float = 30.0) -> Scene:
    material = {"friction": friction, "cohesion_kJ_m3": cohesion, "density_kg_m3": 1180.0}
    return settled_scene(bimodal(), sauter_um, material, 1)


classes = st.lists(
    st.tuples(st.floats(1.0, 6.0), st.floats(0.05, 1.0)),
    min_size=1,
    max_size=5,
    unique_by=lambda pair: round(pair[0], 3),
)


@given(classes=classes, unit=st.floats(1e-7, 1e-3), order=st.randoms(use_true_random=False))
@settings(max_examples=25, deadline=None)
def test_neither_unit_nor_order_of_the_classes_counts(
    classes: list[tuple[float, float]], unit: float, order: object
) -> None:
    total = sum(share for _, share in classes)
    shuffled = list(classes)
    order.shuffle(shuffled)  # type: ignore[attr-defined]
    one, other = (
        CrystalSizeDistribution.from_classes([scale * d for d, _ in listed], [share / total for _, share in listed])
        for listed, scale in ((classes, 1e-5), (shuffled, unit))
    )
    assert shape_features(one) == pytest.approx(shape_features(other), abs=1e-9)
    assert counting_spheres(one, 2000) == pytest.approx(counting_spheres(other, 2000))


def test_features_of_one_size() -> None:
    one = CrystalSizeDistribution.from_classes([3e-5], [1.0])
    found = dict(zip(SHAPE_FEATURES, shape_features(one), strict=True))
    assert found.pop("close_packing") == pytest.approx(0.3565, abs=1e-3)
    assert list(found.values()) == [0.0] * 4
    assert counting_spheres(one, 1234) == pytest.approx(1234)
    assert (friction_feature(0.0), friction_feature(0.18)) == (0.0, 0.5)


def test_a_split_class_is_the_same_distribution() -> None:
    split = CrystalSizeDistribution.from_classes(np.array([20.0, 20.0, 50.0]) * MICROMETRE, [0.2, 0.3, 0.5])
    assert shape_features(split) == pytest.approx(shape_features(bimodal()))


def test_few_coarse_spheres_count_for_less() -> None:
    assert counting_spheres(bimodal(0.05, 5.0), 2000) < 0.5 * counting_spheres(bimodal(0.5, 1.2), 2000)


@pytest.mark.parametrize("attraction", ["none", "adhesion", "cohesion"])
@pytest.mark.parametrize("csd", [bimodal(), bimodal(0.3, 4.0), bimodal(1.0, 1.0)], ids=["2.5", "4", "one"])
def test_more_friction_packs_looser(csd: CrystalSizeDistribution, attraction: str) -> None:
    found = np.array([pressed(csd, mu, attraction).porosity for mu in FRICTIONS])
    known = np.array([half_widths(pressed(csd, mu, attraction))[0] for mu in FRICTIONS])
    assert (np.diff(found, axis=0) > -np.hypot(known[1:], known[:-1])).all()
    assert (found[-1] > found[0] + 0.03).all()


@pytest.mark.parametrize("friction", FRICTIONS)
def test_a_higher_load_packs_denser(friction: float) -> None:
    found = pressed(bimodal(), friction)
    step, (half, _) = np.diff(found.porosity), half_widths(found)
    assert (step < half[1:]).all()
    assert found.porosity[0] > found.porosity[-1] + 0.01


def test_cohesive_beds_are_looser() -> None:
    model = shipped()[GRAVITY_PROTOCOL]
    found = [model.estimate(bed(cohesion=s)) for s in (0.0, 40.0, 80.0)]
    porosity = [float(each.porosity[0]) for each in found]
    assert porosity[0] < porosity[1] < porosity[2]


def test_without_attraction_there_is_the_last_load_alone() -> None:
    found = pressed(bimodal(), attraction="none")
    assert found.load.tolist() == [math.inf]
    assert found.unknown.shape == found.scatter.shape == (1, 1)
    assert pressed(bimodal()).load.tolist() == list(LOADS)


def test_a_number_of_the_curve_has_the_interval_of_its_load() -> None:
    found = pressed(bimodal())
    mean, one = found.half_widths(lambda curve: float(curve.porosity[3]))
    assert (mean, one) == pytest.approx([half[3] for half in half_widths(found)])
    # the difference of two loads is better known than both together, which are wrong alike
    spread, _ = found.half_widths(lambda curve: float(curve.porosity[3] - curve.porosity[4]))
    assert spread < math.hypot(*half_widths(found)[0][3:5])


def test_larger_packings_scatter_less_but_are_as_unknown() -> None:
    csd = bimodal()
    few, many = (
        shipped()[FILTRATION_PROTOCOL].estimate(cell_scene(csd, 0.1, "adhesion", spheres, 1)) for spheres in (500, 8000)
    )
    assert few.unknown == pytest.approx(many.unknown)
    assert few.scatter[-1, -1] > 2.0 * many.scatter[-1, -1]


def test_inside_the_hull_nothing_is_said_and_outside_the_interval_is_wider() -> None:
    assert pressed(bimodal(), 0.3).outside == ()
    inside, outside = pressed(bimodal(), 0.9), pressed(bimodal(), 1.6)
    assert len(outside.outside) == 1 and outside.outside[0].startswith("friction is 1.6")
    assert half_widths(outside)[0][-1] > 1.2 * half_widths(inside)[0][-1]


def test_the_interval_widens_steadily_outside() -> None:
    model = shipped()[FILTRATION_PROTOCOL]
    widths = []
    for ratio in (4.0, 40.0, 400.0):
        csd = bimodal(0.3, ratio)
        try:
            widths.append(half_widths(model.estimate(cell_scene(csd, 0.1, "none", 2000, 1)))[0][-1])
        except ConfigError as error:
            assert "too far off for an estimate" in str(error)
            widths.append(math.inf)
    assert widths == sorted(widths)
    assert widths[-1] == math.inf


def test_beyond_the_process_s_own_doubt_the_interval_widens_by_the_distance(monkeypatch: pytest.MonkeyPatch) -> None:
    wide = half_widths(pressed(bimodal(), 1.6))[0]
    inside = half_widths(pressed(bimodal(), 0.3))[0]
    monkeypatch.setattr(emulator, "WIDENING", 0.0)
    assert np.all(wide > 1.05 * half_widths(pressed(bimodal(), 1.6))[0])
    np.testing.assert_allclose(half_widths(pressed(bimodal(), 0.3))[0], inside)


def test_too_far_outside_is_refused_with_the_feature_its_value_and_range() -> None:
    with pytest.raises(ConfigError, match=r"friction is 2, the packings' is 0 to .*too far off"):
        shrunk(shipped()[FILTRATION_PROTOCOL]).estimate(cell_scene(bimodal(), 2.0, "adhesion", 2000, 1))


def shrunk(model: Emulator) -> Emulator:
    """Return the model with half the range of friction."""
    k = FEATURES[model.protocol].index("friction")
    highest = model.highest.copy()
    highest[k] *= 0.5
    return replace(model, highest=highest)


def test_every_feature_that_is_a_number_has_a_meaning() -> None:
    named = {name for names in FEATURES.values() for name in names}
    assert named - set(MEANINGS) == {"pressed_at_once", "adhesion", "slight_friction"}
    assert 0.0 < FARTHEST <= 1.0


@pytest.mark.parametrize("protocol", [FILTRATION_PROTOCOL, GRAVITY_PROTOCOL])
def test_the_shipped_models_hold_for_what_was_held_out(protocol: str) -> None:
    table = read_packings(DATA / "emulator_packings.csv")
    held = accepted(table, protocol, "held out").to_dict("records")
    assert len(held) >= 10
    inside, off = [], []
    for row in held:
        try:
            found = shipped()[protocol].estimate(scene_of(row))
        except ConfigError:
            inside.append(False)
            continue
        half = quantile() * math.sqrt(found.unknown[-1, -1] + found.scatter[-1, -1])
        off.append(abs(row["porosity"] - found.porosity[-1]))
        inside.append(off[-1] <= half)
    assert np.mean(inside) >= 0.85
    assert np.median(off) < 0.012


def test_the_committed_estimates_are_those_of_the_shipped_models() -> None:
    table = pd.read_csv(DATA / "emulator_held_out.csv").dropna(subset=["estimate"])
    for row in table[table["drawn"]].head(8).to_dict("records"):
        found = shipped()[row["protocol"]].estimate(scene_of({**row, "seed": 1}))
        k = list(found.load).index(row["load"])
        assert found.porosity[k] == pytest.approx(row["estimate"], abs=2e-6)
        assert half_widths(found)[1][k] == pytest.approx(row["packing_ci95"], rel=1e-3)


def test_the_features_of_the_training_are_those_of_the_code() -> None:
    """The models must be trained anew (make pages) when a feature changes."""
    table = read_packings(DATA / "emulator_packings.csv")
    for protocol, model in shipped().items():
        rows = accepted(table, protocol, "training")
        assert len(rows) == model.packings
        scaled = model.scaled(features_of(scene_of(rows.iloc[3].to_dict())))
        assert scaled[list(model.parts[0].columns)] == pytest.approx(model.parts[0].process.inputs[3], abs=1e-5)


def test_models_are_written_as_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "models.json"
    write(path, shipped())
    again = read(path)
    assert again.keys() == shipped().keys()
    scene = cell_scene(bimodal(), 0.2, "cohesion", 2000, 1)
    one, other = (models[FILTRATION_PROTOCOL].estimate(scene) for models in (shipped(), again))
    assert one.porosity.tolist() == other.porosity.tolist()
    assert path.read_text(encoding="utf-8") == MODELS.read_text(encoding="utf-8")


@pytest.mark.parametrize("text", ["", "[]", "{}x", '{"filtration": {}}', '{"filtration": {"load": 3}}', "\0"])
def test_a_damaged_file_of_models_is_named(text: str, tmp_path: Path) -> None:
    path = tmp_path / "models.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"models\.json"):
        read(path)


def test_a_truncated_file_of_models_is_named(tmp_path: Path) -> None:
    values = json.loads(MODELS.read_text(encoding="utf-8"))
    values["gravity"]["parts"][0]["inputs"] = "none"
    path = tmp_path / "models.json"
    path.write_text(json.dumps(values), encoding="utf-8")
    with pytest.raises(ConfigError, match="as `make emulator` writes it"):
        emulator_file.read(path)
