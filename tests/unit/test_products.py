"""What a crystallizer gives a study, and what is said where the study does not fit it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from filtercake.config_loading import LoadedStudy, load_study
from filtercake.errors import ConfigError

STUDIES = Path(__file__).resolve().parents[2] / "config" / "studies"

TEXT = """
crystallizer:
  kinetics: ammonium_alum
  slurry_density_kg_m3: 200
material:
  cohesion_kJ_m3: 50
packing:
  void_fraction: 0.6
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


# --- published values ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["alum", "alum_full"])
def test_published_values_of_other_kinetics_are_not_shown(name: str, changed: Callable[..., LoadedStudy]) -> None:
    text = (STUDIES / f"{name}.yaml").read_text(encoding="utf-8")
    alum = changed(text=text)
    assert alum.model.published and not alum.warnings
    other = changed("  kinetics: ammonium_alum\n", "  kinetics: potassium_nitrate\n", text)
    assert other.model.published == []
    (warning,) = other.warnings
    count = f"{len(alum.model.published)} values of the kinetics ammonium_alum are not shown"
    assert count in warning and warning.endswith("crystallizer.kinetics = potassium_nitrate")


def test_published_values_of_no_or_the_same_kinetics_stay(changed: Callable[..., LoadedStudy]) -> None:
    entry = "  - {csd: tau_15min, quantity: porosity, value: 0.3, source: me, kind: measurement%s}\n"
    kinetics = ("", ", kinetics: ammonium_alum", ", kinetics: potassium_nitrate")
    study = changed(text=TEXT + "published:\n" + "".join(entry % item for item in kinetics))
    assert [value.kinetics for value in study.model.published] == [None, "ammonium_alum"]
    (warning,) = study.warnings
    assert "1 value of the kinetics potassium_nitrate is not shown" in warning


def test_published_values_of_kinetics_need_a_crystallizer(good_study: str, changed: Callable[..., LoadedStudy]) -> None:
    entry = "{csd: bimodal, quantity: porosity, value: 0.3, source: me, kind: measurement, kinetics: ammonium_alum}"
    found = problems(lambda: changed(text=f"{good_study}\npublished: [{entry}]\n"))
    assert found == {"published[0].kinetics": ": needs a crystallizer in the study"}
