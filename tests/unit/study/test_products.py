"""What a crystallizer gives a study, and what is said where the study does not fit it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from filtercake.errors import ConfigError
from filtercake.study.loading import LoadedStudy, load_study

STUDIES = Path(__file__).resolve().parents[3] / "config" / "studies"

TEXT = """
crystallizer:
  kinetics: ammonium_alum
  slurry_concentration_kg_m3: 200
material:
  cohesion_kJ_m3: 50
packing:
  initial_void_fraction: 0.6
sweeps:
  - residence_time_min: [15, 60]
"""


@pytest.fixture
def changed(tmp_path: Path) -> Callable[..., LoadedStudy]:
    """Load the study with one piece of its text replaced; each must be there."""

    def load(old: str = "", new: str = "", text: str = TEXT) -> LoadedStudy:
        assert old in text
        path = tmp_path / "mine.yaml"
        path.write_text(text.replace(old, new), encoding="utf-8")
        return load_study(path)

    return load


def problems(load: Callable[[], LoadedStudy]) -> dict[str, str]:
    """What is wrong, by key: the value and what is allowed."""
    with pytest.raises(ConfigError) as caught:
        load()
    return {problem.key: f"{problem.value}: {problem.allowed}" for problem in caught.value.problems}


def said(study: LoadedStudy) -> list[str]:
    """Warnings, but that of size classes too rare to stand alone."""
    return [warning for warning in study.warnings if "packing.particles" not in warning]


# --- published values ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["alum", "alum_full"])
def test_published_values_of_other_kinetics_are_not_shown(name: str, changed: Callable[..., LoadedStudy]) -> None:
    text = (STUDIES / f"{name}.yaml").read_text(encoding="utf-8")
    alum = changed(text=text)
    assert alum.model.published and not said(alum)
    other = changed("  kinetics: ammonium_alum\n", "  kinetics: potassium_nitrate\n", text)
    assert other.model.published == []
    (warning,) = said(other)
    count = f"{len(alum.model.published)} values of the kinetics ammonium_alum are not shown"
    assert count in warning and warning.endswith("crystallizer.kinetics = potassium_nitrate")


def test_published_values_of_no_or_the_same_kinetics_stay(changed: Callable[..., LoadedStudy]) -> None:
    entry = "  - {csd: tau_15min, quantity: porosity, value: 0.3, source: me, kind: measurement%s}\n"
    kinetics = ("", ", kinetics: ammonium_alum", ", kinetics: potassium_nitrate")
    study = changed(text=TEXT + "published:\n" + "".join(entry % item for item in kinetics))
    assert [value.kinetics for value in study.model.published] == [None, "ammonium_alum"]
    (warning,) = said(study)
    assert "1 value of the kinetics potassium_nitrate is not shown" in warning


def test_published_values_of_kinetics_need_a_crystallizer(good_study: str, changed: Callable[..., LoadedStudy]) -> None:
    entry = "{csd: bimodal, quantity: porosity, value: 0.3, source: me, kind: measurement, kinetics: ammonium_alum}"
    found = problems(lambda: changed(text=f"{good_study}\npublished: [{entry}]\n"))
    assert found == {"published[0].kinetics": ": needs a crystallizer in the study"}


# --- doubts --------------------------------------------------------------------------------------------------------


def test_residence_times_outside_the_kinetics_range_are_doubted(changed: Callable[..., LoadedStudy]) -> None:
    assert not said(changed())  # 15 and 60 min are the ends of the range
    (warning,) = said(changed("[15, 60]", "[14.9, 15, 300]"))
    assert "residence_time_min = 14.9, 300: the kinetics ammonium_alum are meant for 15 to 60 min" in warning
    (warning,) = said(changed("crystallizer:", "csds: {late: {residence_time_min: 61}}\ncrystallizer:"))
    assert "residence_time_min = 61:" in warning
    # no range is stated for these
    assert not said(changed(text=TEXT.replace("ammonium_alum", "potassium_nitrate").replace("60", "300")))


def test_another_density_than_that_of_the_kinetics_is_doubted(changed: Callable[..., LoadedStudy]) -> None:
    assert not said(changed("  cohesion", "  density_kg_m3: 2450.5\n  cohesion"))
    (warning,) = said(changed("  cohesion", "  density_kg_m3: 1640\n  cohesion"))
    assert "material.density_kg_m3 = 1640: the kinetics ammonium_alum have 2450" in warning


# --- truncation by size --------------------------------------------------------------------------------------------

SIZES = "truncate_below_um: 40\n  truncate_above_um: 500"


def test_the_crystallizer_s_products_are_truncated_by_size(changed: Callable[..., LoadedStudy]) -> None:
    whole, cut = changed().csds["tau_15min"], changed("  slurry", f"  {SIZES}\n  slurry").csds["tau_15min"]
    size = whole.truncated.size
    assert cut.truncated.size.tolist() == size[(size >= 40e-6) & (size <= 500e-6)].tolist()
    assert cut.full.size.tolist() == whole.full.size.tolist()


def test_a_distribution_s_own_truncation_holds_for_it(changed: Callable[..., LoadedStudy]) -> None:
    text = TEXT.replace(
        "crystallizer:", "csds: {late: {residence_time_min: 60, truncate_above_um: 400}}\ncrystallizer:"
    )
    study = changed("  slurry", f"  {SIZES}\n  slurry", text)
    assert study.csds["late"].truncated.largest < 400e-6 < study.csds["tau_60min"].truncated.largest
    assert study.csds["late"].truncated.smallest < 40e-6


@pytest.mark.parametrize(
    ("old", "new", "key", "says"),
    [
        ("  slurry", "  truncate_below_um: 900\n  slurry", "csds.tau_15min.residence_time_min", "none is between 900"),
        ("  slurry", "  truncate_below_um: 50\n  truncate_above_um: 50\n  slurry", "crystallizer", "must be below"),
        (
            "  slurry",
            "  truncate_above_um: 0\n  slurry",
            "crystallizer.truncate_above_um",
            "greater than or equal to 0.001",
        ),
        (
            "crystallizer:",
            "csds: {a: {residence_time_min: 60, truncate_above_um: 4, truncate_below_um: 9}}\ncrystallizer:",
            "csds.a",
            "truncate_below_um must be below truncate_above_um",
        ),
    ],
)
def test_a_wrong_truncation_by_size_is_refused(
    old: str, new: str, key: str, says: str, changed: Callable[..., LoadedStudy]
) -> None:
    assert says in problems(lambda: changed(old, new))[key]


# --- refusals ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("density", "most"), [(2450, 857.5), (1640, 574.0)])
def test_a_slurry_as_dense_as_a_cake_is_refused(density: int, most: float, changed: Callable[..., LoadedStudy]) -> None:
    text = TEXT.replace("  cohesion", f"  density_kg_m3: {density}\n  cohesion")
    changed("3: 200", f"3: {most - 0.1}", text)
    found = problems(lambda: changed("3: 200", f"3: {most}", text))
    assert f"{most:g}: must be below {most:g} kg/m3" in found["crystallizer.slurry_concentration_kg_m3"]


@pytest.mark.parametrize(
    ("old", "new", "key", "says"),
    [
        ("[15, 60]", "[15, 15.0000001]", "sweeps[0].residence_time_min[1]", "tau_15min, as that of 15.0 min is"),
        (
            "crystallizer:",
            "csds: {tau_60min: {mixture: [{size_um: 20, volume_fraction: 1}]}}\ncrystallizer:",
            "sweeps[0].residence_time_min[1]",
            "tau_60min, as a distribution in csds is",
        ),
    ],
)
def test_two_products_of_one_name_are_refused(
    old: str, new: str, key: str, says: str, changed: Callable[..., LoadedStudy]
) -> None:
    found = problems(lambda: changed(old, new))
    assert says in found[key]


def test_a_residence_time_asked_for_twice_is_one_product(changed: Callable[..., LoadedStudy]) -> None:
    assert list(changed("[15, 60]", "[15, 60]\n  - residence_time_min: 15\n    friction: 0.1").csds) == [
        "tau_15min",
        "tau_60min",
    ]


def test_a_broken_kinetics_file_is_named_with_its_problems(tmp_path: Path, changed: Callable[..., LoadedStudy]) -> None:
    mine = tmp_path / "own.yaml"
    mine.write_text("salt: {nucleation_coefficient: -1, colour: red}\n", encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        changed("kinetics: ammonium_alum", "kinetics: salt\n  kinetics_file: own.yaml")
    found = caught.value.problems
    assert {(problem.key, problem.value) for problem in found} == {("crystallizer.kinetics_file", "'own.yaml'")}
    assert any("own.yaml: salt.colour = 'red': no such key" in problem.allowed for problem in found)
    assert any("salt.nucleation_coefficient = -1: must be a positive" in problem.allowed for problem in found)


def test_unknown_kinetics_beside_a_good_file_are_named(tmp_path: Path, changed: Callable[..., LoadedStudy]) -> None:
    presets = Path(__file__).resolve().parents[3] / "src" / "filtercake" / "crystals" / "kinetics.yaml"
    text = presets.read_text(encoding="utf-8").replace("potassium_nitrate", "salt")
    (tmp_path / "own.yaml").write_text(text, encoding="utf-8")
    found = problems(lambda: changed("kinetics: ammonium_alum", "kinetics: slat\n  kinetics_file: own.yaml"))
    assert "did you mean salt" in found["crystallizer.kinetics"]
