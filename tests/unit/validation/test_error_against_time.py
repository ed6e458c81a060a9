"""Run time against error: how errors are computed, what counts as better, and that the variants differ as they say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from filtercake.crystals.csd import mixture, truncate
from filtercake.packing.scene import Scene
from filtercake.statistics import difference_half_width, half_width
from filtercake.study.loading import load_study
from filtercake.study.points import base_point
from filtercake.validation import error_against_time
from filtercake.validation.error_against_time import (
    Reference,
    choices,
    errors,
    on_front,
    reference_of,
    time_peers,
    time_variants,
    variants,
)

CSD = mixture([20e-6, 50e-6], [0.5, 0.5])
SCENE = Scene(
    csd=CSD,
    particles=2000,
    initial_void_fraction=0.65,
    settling_velocity=0.01,
    density=1180.0,
    youngs_modulus=5e6,
    poisson_ratio=0.2,
    restitution=0.3,
    friction=0.0,
    cohesion=50e3,
    time_step=0.4e-6,
    engine="embedded",
)
REFERENCE = Reference(0.35, 0.0)


def packings(values: list[float], seconds: float = 1.0, status: str = "ok", value: float = 0.0) -> pd.DataFrame:
    rows = [
        {
            "axis": "time step",
            "value": value,
            "engine": "embedded",
            "particles": 2000,
            "status": status,
            "wall_s": seconds,
            "porosity": porosity,
            "porosity_paper_count": porosity + 0.01,
        }
        for porosity in values
    ]
    return pd.DataFrame(rows)


def test_an_error_is_bias_and_spread() -> None:
    random = np.random.default_rng(0)
    table = errors("pmma", packings(list(0.353 + 0.004 * random.standard_normal(20_000))), REFERENCE)
    interior, count = table.to_dict("records")
    assert interior["estimator"] == "interior slab"
    assert interior["bias"] == pytest.approx(0.003, abs=1e-4)
    assert interior["sd"] == pytest.approx(0.004, rel=0.02)
    assert interior["error"] == pytest.approx(0.005, rel=0.02)  # 3-4-5
    assert count["bias"] == pytest.approx(0.013, abs=1e-4)
    # d ln(alpha)/d eps = -1/0.65 - 3/0.35 = -10.1: 5e-3 in porosity is 5 % in resistance
    assert interior["resistance_error"] == pytest.approx(0.0505, rel=0.05)


def test_the_noise_of_a_mean_is_no_bias() -> None:
    table = errors("pmma", packings([0.349, 0.351, 0.3505, 0.3503]), Reference(0.35, 0.0))
    row = table.iloc[0]
    assert abs(row["bias"]) > 0
    assert row["error"] == pytest.approx(row["sd"])


def test_the_interval_of_a_bias_is_welchs() -> None:
    values, known = [0.353, 0.355, 0.351, 0.354], [0.349, 0.350, 0.352]
    table = pd.DataFrame({"study": "a", "friction": 0.0, "status": "ok", "porosity": known})
    row = errors("pmma", packings(values), reference_of(table, "a", 0.0)).iloc[0]
    assert row["bias_ci95"] == pytest.approx(difference_half_width(values, known))
    exact = errors("pmma", packings(values), REFERENCE).iloc[0]
    assert exact["bias_ci95"] == pytest.approx(half_width(values))


def test_one_packing_has_neither_spread_nor_error() -> None:
    row = errors("pmma", packings([0.353]), Reference(0.35, 0.0005, 20.0)).iloc[0]
    assert row["bias"] == pytest.approx(0.003)
    assert row[["sd", "bias_se", "bias_ci95", "error"]].isna().all()


def test_packings_that_were_not_accepted_do_not_count() -> None:
    table = pd.concat([packings([0.35, 0.351]), packings([0.9], status="not settled")], ignore_index=True)
    row = errors("pmma", table, REFERENCE).iloc[0]
    assert (row["n"], row["n_failed"]) == (2, 1)
    assert row["porosity"] == pytest.approx(0.3505)


def test_a_variant_of_which_nothing_was_accepted_is_told() -> None:
    table = errors("pmma", packings([0.9, 0.9], status="not settled"), REFERENCE)
    (row,) = table.to_dict("records")
    assert (row["n"], row["n_failed"]) == (0, 2)
    assert math.isnan(row["error"])
    assert not on_front(table).any()


def test_the_front() -> None:
    points = pd.DataFrame(
        {"axis": "skin", "n": 1000, "seconds": [1.0, 2.0, 0.5, 4.0, 1.1], "error": [1.0, 0.5, 3.0, 0.7, 0.95]}
    )
    # the fourth is beaten by the second; the last is not better than the first by more than can be measured
    assert list(on_front(points)) == [True, True, True, False, True]
    assert not on_front(pd.DataFrame({"axis": "skin", "n": 1000, "seconds": [1.0, 2.0], "error": [1.0, 2.0]})).iloc[1]
    lucky = pd.DataFrame({"axis": ["analytic", "skin"], "n": 1000, "seconds": [1e-3, 1.0], "error": [0.1, 1.0]})
    assert list(on_front(lucky)) == [False, True]
    # of eight packings each, a spread lower by a third is chance
    few = pd.DataFrame({"axis": "skin", "n": 8, "seconds": [1.0, 2.0, 2.0], "error": [0.7, 1.0, 1.5]})
    assert list(on_front(few)) == [True, True, False]


def test_references_are_found_by_study_and_friction() -> None:
    table = pd.DataFrame(
        {
            "study": ["a", "a", "a", "b"],
            "friction": [0.0, 0.0, 0.3, 0.0],
            "status": ["ok", "ok", "ok", "ok"],
            "porosity": [0.35, 0.36, 0.4, 0.5],
        }
    )
    found = reference_of(table, "a", 0.0)
    assert found.porosity == pytest.approx(0.355)
    assert found.standard_error == pytest.approx(0.005)
    with pytest.raises(ValueError, match=r"no ensemble of a at friction 0\.3"):
        reference_of(table, "a", 0.3)


@pytest.mark.parametrize("case", ["pmma", "pmma_friction", "alum", "alum_wide"])
def test_variants_differ_from_the_default_in_what_they_say(case: str) -> None:
    sizes = np.linspace(30e-6, 300e-6, 30)
    full = mixture(sizes, sizes**3 / np.sum(sizes**3)) if "alum" in case else CSD
    listed = variants(case, replace(SCENE, csd=truncate(full, 0.001).csd), full)
    default = listed[0]
    assert default.axis == "default"
    assert all(other.axis != "default" for other in listed[1:])
    changed = {
        "time step": {"time_step"},
        "spheres": {"particles"},
        "narrower bed": {"particles", "bed_depth_factor"},
        "stop tolerance": {"porosity_tolerance"},
        "skin": {"skin"},
        "softer contacts": {"youngs_modulus", "cohesion", "time_step"},
        "truncation": {"time_step", "size", "volume_fraction"},
        "engine": set(),
        "as published": {"time_step", "skin"},
    }
    for variant in listed[1:]:
        ours, theirs = (item.contender.scene.as_dict() for item in (variant, default))
        differ = {key for key in ours if ours[key] != theirs[key]} - {"engine"}
        assert differ <= changed[variant.axis], variant
        if variant.axis not in ("engine", "as published"):
            assert differ, variant
        if "time_step" in differ and variant.axis not in ("time step", "as published"):
            assert variant.contender.scene.rayleigh_fraction == pytest.approx(default.contender.scene.rayleigh_fraction)


def test_softer_contacts_keep_the_sticking_speed() -> None:
    for variant in variants("pmma", SCENE, CSD):
        if variant.axis == "softer contacts":
            scene = variant.contender.scene
            ratio = (scene.cohesion / SCENE.cohesion) ** 5 / (scene.youngs_modulus / SCENE.youngs_modulus) ** 4
            assert ratio == pytest.approx(1.0)  # v^2 = 37 s^5/(rho E*^4)
            assert scene.rayleigh_fraction == pytest.approx(SCENE.rayleigh_fraction)


def test_a_narrower_bed_is_as_deep() -> None:
    heights = [v.contender.scene.cloud_height for v in variants("pmma", SCENE, CSD) if v.axis == "narrower bed"]
    assert heights == pytest.approx([SCENE.cloud_height] * 2)


def test_a_quick_run_is_short() -> None:
    full, quick = (variants("pmma", SCENE, CSD, quick=quick) for quick in (False, True))
    assert len(quick) < len(full)
    assert quick[0].axis == "default"
    assert sum(v.replicates for v in quick) < 0.3 * sum(v.replicates for v in full)


def test_variants_are_settled_in_turn() -> None:
    small = replace(SCENE, csd=mixture([20e-6, 30e-6], [0.5, 0.5]), particles=150, initial_void_fraction=0.6)
    maker = error_against_time._Maker(small, small.csd)
    lines: list[str] = []
    table = time_variants([maker.default(2), *maker.time_steps({0.3: 1})], lines.append)
    assert list(table["axis"]) == ["default", "time step", "default"]
    assert (table["status"] == "ok").all()
    assert len(lines) == 3


def test_peers_take_milliseconds() -> None:
    table = time_peers(CSD)
    assert len(table) == len(error_against_time.PEERS)
    assert table["porosity"].between(0.2, 0.45).all()
    table = errors("pmma", table, Reference(0.3517, 0.0005))
    farr = table[table["engine"] == "Farr-Groot"].iloc[0]
    assert farr["bias"] == pytest.approx(0.308 - 0.3517, abs=0.003)
    assert farr["error"] == pytest.approx(abs(farr["bias"]), rel=1e-3)


def test_choices_stand_against_the_default() -> None:
    listed = choices(SCENE, 4)
    assert {item.choice for item in listed} >= {
        "drop height",
        "initial void fraction",
        "soft contacts",
        "depth of the bed",
    }
    rows = [{"axis": "default", "value": 0.5, "status": "ok", "porosity": p} for p in (0.35, 0.352)]
    for k, item in enumerate(listed):
        rows += [{"axis": item.choice, "value": float(k), "status": "ok", "porosity": p} for p in (0.36, 0.362)]
    timings = pd.DataFrame(rows).assign(
        porosity_from_floor=lambda t: t["porosity"] + 0.008, porosity_paper_count=lambda t: t["porosity"] + 0.009
    )
    # both ensembles of two, 0.002 apart: t(2) = 4.3027 and a standard error of 0.001 each
    full, packed = mixture([10e-6, 30e-6], [0.1, 0.9]), mixture([30e-6], [1.0])
    table = error_against_time.choice_table(timings, listed, full, packed).set_index("choice")
    assert table.loc["soft contacts", "porosity_change"] == pytest.approx(0.01)
    assert table.loc["soft contacts", "resistance_change"] == pytest.approx(
        (0.639 / 0.361**3) / (0.649 / 0.351**3) - 1.0
    )
    assert table.loc["soft contacts", "porosity_change_ci95"] == pytest.approx(4.3027 * math.sqrt(2.0) * 1e-3, rel=1e-4)
    assert table.loc["floor layer", "porosity_change_ci95"] == pytest.approx(0.0, abs=1e-12)  # the same packings
    assert table.loc["floor layer", "porosity_change"] == pytest.approx(0.008)
    law = packed.sum_x_over_d2 / full.sum_x_over_d2 - 1.0
    assert table.loc["truncation, in the resistance law", "resistance_change"] == pytest.approx(law)


def test_the_benchmarks_scenes_are_the_defaults() -> None:
    study = load_study(accuracy_study())
    scene = base_point(study, "pmma_50_50", lambda *_: "embedded").scene
    assert variants("pmma", scene, study.csds["pmma_50_50"].full)[0].contender.scene == replace(scene, processes=1)
    frictional = base_point(study, "pmma_50_50", lambda *_: "embedded", friction=0.3).scene
    assert frictional.friction == 0.3
    assert math.isclose(frictional.rayleigh_fraction, 0.2)


def accuracy_study():
    from pathlib import Path

    return Path(__file__).resolve().parents[3] / "config" / "studies" / "pmma.yaml"
