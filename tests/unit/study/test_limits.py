"""What the fence refuses and warns about, by its own limits."""

from __future__ import annotations

from dataclasses import replace

import pytest

from filtercake.crystals.csd import mixture
from filtercake.packing.scene import Scene
from filtercake.study import limits

SCENE = Scene(
    csd=mixture([20e-6, 50e-6], [0.5, 0.5]),
    particles=2000,
    initial_void_fraction=0.65,
    settling_velocity=0.01,
    density=1180.0,
    youngs_modulus=5e6,
    poisson_ratio=0.2,
    restitution=0.3,
    friction=0.0,
    cohesion=50e3,
    time_step=0.0,
    engine="auto",
).with_time_step(limits.FRICTIONLESS_TIME_STEP)
RAYLEIGH = SCENE.rayleigh_time_step


def test_the_papers_scene_passes_without_a_word() -> None:
    assert limits.verdict(SCENE) == "allowed"
    assert not list(limits.refusals(SCENE))
    assert not list(limits.doubts(SCENE))


def test_defaults_are_inside() -> None:
    for friction in (0.0, 0.05, 0.3, 1.0):
        scene = replace(SCENE, friction=friction).with_time_step(limits.default_time_step(friction))
        assert limits.verdict(scene) == "allowed"


@pytest.mark.parametrize(
    ("changed", "key", "says"),
    [
        ({"cohesion": 250e3}, "cohesion", "must be at most 206 kJ/m3 at E = 5 MPa, nu = 0.2"),
        ({"youngs_modulus": 1e6}, "cohesion", "must be at most 41 kJ/m3 at E = 1 MPa"),
        ({"density": 118e3, "time_step": 3e-6}, "density", "at most 25000 kg/m3"),
        ({"time_step": 1.01 * RAYLEIGH}, "time_step", "Rayleigh time step 0.8223 us"),
    ],
)
def test_outside_is_refused(changed: dict[str, float], key: str, says: str) -> None:
    scene = replace(SCENE, **changed)
    found = [finding for finding in limits.refusals(scene) if finding.key == key]
    assert len(found) == 1
    assert says in found[0].text
    assert limits.PAGE in found[0].text
    assert limits.verdict(scene) == "refused"


def test_restitution_too_small_for_liggghts_is_refused_with_that_engine_alone() -> None:
    scene = replace(SCENE, restitution=0.05)
    (finding,) = limits.refusals(replace(scene, engine="liggghts"))
    assert finding.key == "restitution"
    assert "engine: auto" in finding.text and limits.PAGE in finding.text
    assert limits.verdict(replace(scene, engine="liggghts", restitution=0.051)) == "allowed"
    assert limits.verdict(replace(scene, engine="embedded")) == limits.verdict(scene) == "allowed"


@pytest.mark.parametrize(
    ("changed", "key", "says"),
    [
        ({"restitution": 0.96}, "restitution", "hardly come to rest"),
    ],
)
def test_what_may_not_end_well_is_warned_about(changed: dict[str, float], key: str, says: str) -> None:
    (finding,) = limits.doubts(replace(SCENE, **changed))
    assert finding.key == key
    assert says in finding.text
    assert limits.PAGE in finding.text


@pytest.mark.parametrize(
    ("changed", "limit", "says"),
    [
        ({"friction": 0.05}, 0.36, "with friction"),
        ({"cohesion": 150e3}, 0.5, "overlap by 1.8% of the diameter"),
        ({"restitution": 0.06}, 0.5, "a restitution under 0.1"),
    ],
)
def test_some_scenes_take_shorter_steps(changed: dict[str, float], limit: float, says: str) -> None:
    scene = replace(SCENE, **changed)
    (finding,) = limits.refusals(replace(scene, time_step=(limit + 0.01) * RAYLEIGH))
    assert finding.key == "time_step"
    assert f"at most {limit:g} of the Rayleigh time step 0.8223 us" in finding.text and says in finding.text
    assert limits.PAGE in finding.text
    assert limits.verdict(replace(scene, time_step=limit * RAYLEIGH)) != "refused"


def test_soft_contacts_are_warned_about() -> None:
    scene = replace(SCENE, cohesion=150e3)
    (finding,) = limits.doubts(scene)
    assert finding.key == "cohesion"
    assert "1.8% of the diameter" in finding.text  # (150/50)^2 * 0.205 %
    assert limits.verdict(scene) == "warned"


def findings(scene: Scene, key: str) -> tuple[list[str], list[str]]:
    """What is refused and what is warned about one number of a scene."""
    refused = [*limits.refusals(scene), *limits.small_beds(scene)]
    warned = [*limits.doubts(scene), *limits.merged_classes(scene)]
    return [item.text for item in refused if item.key == key], [item.text for item in warned if item.key == key]


def test_a_large_crystal_that_no_sphere_stands_for_is_refused() -> None:
    wide = replace(SCENE, csd=mixture([5e-6, 100e-6], [0.5, 0.5]), bed_depth_factor=2.0)
    refused, _ = findings(wide.with_time_step(0.5), "particles")
    words = next(text for text in refused if "one size class" in text)
    assert "holds less than one sphere each (50.00% of the volume)" in words
    assert "off by about +0.127" in words
    assert "use at least 8,00" in words
    # of the paper's own protocol, the engine draws the spheres
    assert not any(
        "size class" in text for text in findings(replace(wide, engine="liggghts_as_published"), "particles")[0]
    )


def test_rare_classes_that_change_nothing_are_merged_with_a_word() -> None:
    rare = replace(SCENE, csd=mixture([20e-6, 50e-6, 60e-6], [0.5, 0.4995, 0.0005]))
    assert limits.representation(rare).merged == 1
    refused, warned = findings(rare, "particles")
    assert not refused
    assert len(warned) == 1
    assert "less than one sphere each (0.05% of the volume); they are merged" in warned[0]


def test_a_bed_too_shallow_for_its_slab_is_refused_before_it_is_made() -> None:
    few = replace(SCENE, particles=100)
    assert "less than the 150 um of 3 of its largest spheres; use more particles" in findings(few, "particles")[0][0]
    assert not findings(replace(few, particles=1000), "particles")[0]
    assert not findings(replace(few, particles=300, bed_depth_factor=3.0), "particles")[0]


def test_a_cohesion_that_does_nothing_is_warned_about() -> None:
    """The pull-off falls with E^2: at the modulus of the real crystal, 50 kJ/m3 holds no crystal."""
    stiff = replace(SCENE, youngs_modulus=3e9).with_time_step(0.5)
    assert stiff.pull_off_over_weight == pytest.approx(SCENE.pull_off_over_weight / 600.0**2, rel=1e-12)
    text = findings(stiff, "cohesion")[1][0]
    assert "does nothing at E = 3000 MPa: its pull-off is 0.00055 times the weight of the smallest crystal" in text
    assert not findings(replace(stiff, cohesion=0.0), "cohesion")[1]
    assert not findings(replace(SCENE, cohesion=10e3), "cohesion")[1]
    # 24 Pa at 50 kJ/m3 and 5 MPa, whatever the size, on about 1 Pa of solids
    assert 15.0 < SCENE.strength_over_load < 30.0
