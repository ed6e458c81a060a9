"""The instant estimate's design, training and evidence."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from filtercake.design.emulator import FEATURES, FRICTION, features_of
from filtercake.design.emulator_file import MODELS, shipped
from filtercake.packing.compression import LOADS
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL
from filtercake.validation import emulator_design as design
from filtercake.validation import emulator_evidence as evidence
from filtercake.validation import emulator_page as page
from filtercake.validation.emulator_design import FAMILIES, HELD_OUT, TRAINING, UNSEEN, Member, members
from filtercake.validation.emulator_fit import Training, left_out, train

DOCS = Path(__file__).parents[3] / "docs"
TEMPLATE = DOCS.parent / "workflow" / "report" / "emulator.md.j2"
DIMENSIONS = 6


@pytest.fixture(scope="module")
def listed() -> list[Member]:
    return list(members(1, 8))


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return evidence.read_packings(DOCS / "data" / page.PACKINGS)


def test_every_packing_of_the_design_is_another(listed: list[Member]) -> None:
    assert len({member.name for member in listed}) == len(listed)


def test_a_longer_design_begins_with_a_shorter_one(listed: list[Member]) -> None:
    assert [member.name for member in members(1, 3)] == [m.name for m in listed][: len(list(members(1, 3)))]


def test_what_is_held_out_is_another_draw(listed: list[Member]) -> None:
    other = list(members(7, 8))
    names = [{m.name for m in each if m.role == HELD_OUT} for each in (listed, other)]
    assert not names[0] & names[1]
    trained = [{m.name for m in each if m.role == TRAINING} for each in (listed, other)]
    assert trained[0] == trained[1]
    assert not names[0] & trained[0]


def test_each_beginning_of_the_design_has_all_kinds(listed: list[Member]) -> None:
    first = [member for member in listed if member.role == TRAINING]
    assert {member.family for member in first} == set(FAMILIES)
    assert not {member.family for member in first} & set(UNSEEN)
    assert {member.scene.attraction for member in first if member.scene.is_pressed} == {"adhesion", "cohesion", "none"}
    frictions = np.array([member.scene.friction for member in first])
    assert 0.1 < np.mean(frictions == 0.0) < 0.4 and frictions.max() > 0.5


def test_some_packings_are_second_ones(listed: list[Member]) -> None:
    again = [member for member in listed if member.replicate == 1 and member.scene.attraction != "none"]
    assert again
    for member in again:
        first = next(m for m in listed if m.scene == member.scene and m.replicate == 0)
        assert first.name != member.name


@pytest.mark.parametrize("family", [*FAMILIES, *UNSEEN])
@pytest.mark.parametrize("corner", list(itertools.product((0.0, 0.999), repeat=4))[::3])
def test_every_corner_of_a_family_is_a_distribution(family: str, corner: tuple[float, ...]) -> None:
    csd = {**FAMILIES, **UNSEEN}[family](*corner)
    assert csd.volume_fraction.sum() == pytest.approx(1.0)
    assert csd.largest / csd.smallest < 300.0


def test_friction_is_denser_where_it_counts_for_more() -> None:
    values = [design.friction_of(share) for share in np.linspace(0.0, 1.0, 101)]
    assert values == sorted(values)
    assert sum(value == 0.0 for value in values) == 21
    assert np.median(values) < 0.2 and values[-1] == 1.0


def test_a_packing_is_kept_and_not_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = design.cell_scene(design._one(), 0.0, "none", 60, 1)
    member = Member(TRAINING, "one size", scene, 0)
    design._keep(tmp_path / member.name, member)
    found = evidence.tabulate(tmp_path, [member])
    assert found["porosity"].iloc[0] == pytest.approx(0.36, abs=0.03)
    assert math.isnan(found["porosity_x1"].iloc[0])
    monkeypatch.setattr(design, "_keep", None)
    said: list[str] = []
    design.compute(tmp_path, [member], 1, said.append)
    assert said == []


def test_a_packing_that_cannot_be_made_is_a_row_with_its_reason() -> None:
    scene = design.cell_scene(design._two(0.99, 0.001), 0.0, "none", 60, 1)
    found = design.packed(Member(TRAINING, "two sizes", scene, 0))
    assert found["porosity"] == [] and found["reason"]


def synthetic(points: int, noise: float, seed: int = 1) -> Training:
    """Settled beds whose porosity is a smooth function of the features."""
    random = np.random.default_rng(seed)
    features = random.uniform(0.0, 1.0, (points, len(FEATURES[GRAVITY_PROTOCOL])))
    friction = features[:, FEATURES[GRAVITY_PROTOCOL].index(FRICTION)]
    truth = 0.36 + 0.08 * friction - 0.05 * features[:, 0] + 0.02 * np.sin(3.0 * features[:, 7])
    spheres = np.full(points, 1000.0)
    return Training(features, (truth + noise * random.normal(size=points))[:, None], spheres, np.arange(points))


def test_training_finds_a_known_function_and_its_noise() -> None:
    data = synthetic(90, 0.002)
    model = train(GRAVITY_PROTOCOL, np.array([math.inf]), data)
    found = left_out(model, data)
    assert np.sqrt(np.mean((found.porosity - found.mean) ** 2)) < 0.004
    noise = model.parts[0].scatter.at(np.full(1, 0.5), np.full(1, 1000.0))[0]
    assert 0.001 < noise < 0.004
    assert model.parts[0].columns == tuple(range(len(FEATURES[GRAVITY_PROTOCOL])))


def test_intervals_are_widened_until_packings_left_out_are_in_them() -> None:
    data = synthetic(60, 0.002, seed=4)
    data.porosity[::10] += 0.02
    model = train(GRAVITY_PROTOCOL, np.array([math.inf]), data)
    rows = evidence.by_load(model, data)
    assert rows["inside"].iloc[0] >= 0.93
    assert model.widening >= 1.0


def test_the_tables_scenes_have_the_designs_features(listed: list[Member], tmp_path: Path) -> None:
    for member in listed[:12]:
        row = evidence.tabulate(_stored(tmp_path, member), [member]).iloc[0].to_dict()
        assert features_of(evidence.scene_of(row)) == pytest.approx(features_of(member.scene), rel=1e-4, abs=1e-5)


def test_a_bed_is_that_which_was_made_whatever_the_last_digit_of_a_size() -> None:
    row = {"protocol": GRAVITY_PROTOCOL, "friction": 0.0, "cohesion_kJ_m3": 50.0, "density_kg_m3": 1180.0, "seed": 1}
    wide = {**row, "mixture": "10:0.5,40.00001:0.5", "particles": 2837, "bed_depth_factor": 2.174}
    rounded = {**wide, "mixture": "10:0.5,40:0.5"}
    assert features_of(evidence.scene_of(rounded)) == pytest.approx(features_of(evidence.scene_of(wide)), abs=1e-4)


def _stored(folder: Path, member: Member) -> Path:
    """Store a packing that was never made."""
    loads = len(LOADS) if member.scene.is_pressed and member.scene.attraction != "none" else 1
    row = {**design.described(member), "porosity": [0.4] * loads, "seconds": 1.0, "reason": ""}
    design.write_json(folder / member.name, row)
    return folder


def test_a_verdict_counts_and_compares() -> None:
    held = pd.DataFrame(
        {
            "protocol": [FILTRATION_PROTOCOL] * 4,
            "attraction": ["adhesion", "none", "adhesion", "adhesion"],
            "family": ["one size", "one size", "power law", "one size"],
            "friction": [0.0, 0.1, 0.1, 0.1],
            "drawn": [True, True, True, False],
            "inside": [True, True, False, True],
            "error": [0.001, -0.002, 0.03, 0.0],
            "packing_ci95": [0.01] * 4,
            "mean_ci95": [0.005] * 4,
        }
    )
    found = evidence.verdicts(held).set_index("label")
    assert (found.loc["all", "n"], found.loc["all", "inside"]) == (3, 2)
    assert found.loc["all", "error"] == pytest.approx(0.002)
    assert not found.loc["all", "holds"]
    assert found.loc["pressed cells without friction", "holds"]
    assert found.loc["pressed cells, every load", "n"] == 4
    assert "settled beds" not in found.index


def test_the_committed_table_is_that_of_the_design(table: pd.DataFrame) -> None:
    for member, row in zip(members(page.DRAW, 2), table.to_dict("records"), strict=False):
        expected = (member.role, member.family, member.scene.friction, member.scene.particles)
        assert (row["role"], row["family"], row["friction"], row["particles"]) == expected


def test_held_out_packings_are_no_part_of_the_training(table: pd.DataFrame) -> None:
    trained, held = (table[table["role"] == role] for role in (TRAINING, HELD_OUT))
    one_size = table["mixture"].str.count(":") == 1
    shared = set(trained["mixture"]) & set(held["mixture"]) - set(table["mixture"][one_size])
    assert not shared
    assert not set(trained["seed"]) & set(held["seed"])


def test_the_shipped_models_hold_as_the_page_says(table: pd.DataFrame) -> None:
    held = evidence.held_out(shipped(), table, page.DRAW)
    committed = pd.read_csv(DOCS / "data" / page.HELD_OUT)
    assert held["inside"].tolist() == committed["inside"].tolist()
    text = (DOCS / page.PAGE).read_text(encoding="utf-8")
    first = evidence.verdicts(held).iloc[0]
    assert f"| all | {first['n']} | {first['inside']} (" in text


def test_the_means_of_other_ensembles_are_estimated() -> None:
    means = pd.read_csv(DOCS / "data" / page.MEANS)
    found = evidence.ensembles(shipped(), means)
    assert len(found) == 29
    at_once = np.isinf(found["load"])
    assert found["inside"][at_once].sum() >= 6
    # led in another way: docs/pressure.md, "Load over strength decides"
    assert found["error"][~at_once].abs().max() < 0.0112


@pytest.mark.slow
def test_the_page_is_made_of_the_table(table: pd.DataFrame) -> None:
    text = page.render(TEMPLATE, DOCS, MODELS, page.DRAW)
    committed = (DOCS / page.PAGE).read_text(encoding="utf-8")

    def lasting(page_: str) -> list[str]:
        return [line for line in page_.splitlines() if not line.startswith("An estimate took")]

    assert lasting(text) == lasting(committed)
