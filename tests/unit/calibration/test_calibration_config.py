"""Calibration files: what they lead to, and what is refused."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from filtercake.calibration.config import (
    PRESSED_FRICTIONS,
    candidates,
    load_calibration,
    load_calibrations,
    settings_of,
)
from filtercake.calibration.fit import pooled
from filtercake.calibration.measurements import compressibility_by_csd
from filtercake.calibration.rounds import BATCHES, Settings
from filtercake.errors import ConfigError
from filtercake.filtration.resistance import implied_porosity

ROOT = Path(__file__).parents[3]
STUDIES = ROOT / "config" / "studies"
TINY = (ROOT / "config/test/calibration/tiny.yaml").read_text()
CSV = ROOT / "config/test/tiny.csv"
MEASUREMENTS = "resistances:\n  - {csd: bimodal, resistance_m_kg: VALUE, relative_uncertainty: 0.05, source: made up}\n"


def load(folder: Path, text: str = TINY, resistance: str = "1.4e+9", measured: str = MEASUREMENTS):
    study = ROOT / "config/test/tiny.yaml"
    (folder / "measured.yaml").write_text(measured.replace("VALUE", resistance))
    text = text.replace("../tiny.yaml", str(study)).replace("tiny_measurements.yaml", "measured.yaml")
    (folder / "mine.yaml").write_text(text)
    return load_calibration(folder / "mine.yaml", STUDIES)


def test_a_calibration_is_a_study_of_its_own(tmp_path: Path) -> None:
    found = load(tmp_path)
    assert found.name == found.study.name == "calibration_mine"
    assert found.study.model.packing.engine == "embedded" and found.study.model.packing.replicates == 2
    assert found.measured == ("bimodal",) and found.packed == ("bimodal", "from_file")
    (observation,) = found.observations
    assert observation.ln_resistance == pytest.approx(math.log(1.4e9)) and observation.standard_error == 0.05
    settings = settings_of(found)
    assert settings.levels == tuple(float(s) for s in range(0, 81, 10))
    assert settings.density == 1180.0 and settings.beside == "friction" and settings.beside_levels == (0.0, 0.1)


def test_candidates_are_every_point_in_every_batch(tmp_path: Path) -> None:
    found = candidates(load(tmp_path), lambda *_: "")
    assert len(found) == BATCHES * 2 * 9 * 2
    assert len({item.point.name for item in found}) == len(found)
    assert {item.point.scene.seed for item in found if item.batch == 0} == {1}
    assert {item.point.scene.seed for item in found if item.batch == 2} == {3}
    assert {item.point.replicates for item in found} == {2}


@pytest.mark.parametrize(("resistance", "friction"), [("1.4e+9", 0.0), ("0.7e+9", 0.05)])
def test_friction_follows_the_papers_advice(tmp_path: Path, resistance: str, friction: float) -> None:
    found = load(tmp_path, TINY.replace("friction: 0\n", "").replace("rival_friction: [0.1]\n", ""), resistance)
    assert found.frictions == (friction,)
    assert (found.implied_porosity < 0.4) == (friction == 0.0)


def test_the_study_s_law_says_what_a_resistance_implies(tmp_path: Path) -> None:
    found = load(tmp_path)
    (tmp_path / "study.yaml").write_text(found.study.path.read_text().replace("file: tiny.csv", f"file: {CSV}"))
    (tmp_path / "law.yaml").write_text("resistance_law: carman\n" + (tmp_path / "study.yaml").read_text())
    for name, law in (("study", "additive"), ("law", "carman")):
        text = TINY.replace("../tiny.yaml", f"{name}.yaml").replace("tiny_measurements.yaml", "measured.yaml")
        (tmp_path / "mine.yaml").write_text(text)
        found = load_calibration(tmp_path / "mine.yaml", STUDIES)
        full = found.study.csds["bimodal"].full
        assert found.implied_porosity == pytest.approx(implied_porosity(1.4e9, full, 1180.0, law=law))
        assert settings_of(found).resistance_law == law


BOTH = MEASUREMENTS + MEASUREMENTS.partition("\n")[2].replace("bimodal", "from_file")
FREE = TINY.replace("friction: 0\n", "").replace("rival_friction: [0.1]\n", "")


@pytest.mark.parametrize(
    ("keys", "frictions"),
    [
        ("", (0.0, 0.05)),
        ("friction: 0.05\n", (0.05, 0.0)),
        ("friction: 0.2\n", (0.2, 0.0)),
        ("rival_friction: []\n", (0.0,)),
        ("rival_friction: [0.3, 0.3, 0]\n", (0.0, 0.3)),
    ],
)
def test_the_advice_is_tested_where_the_distributions_can(tmp_path: Path, keys: str, frictions: tuple) -> None:
    assert load(tmp_path, FREE + keys, measured=BOTH).frictions == frictions
    alone = load(tmp_path, FREE + keys)
    assert alone.frictions == (frictions if "rival" in keys else frictions[:1])


AT = "  - {csd: bimodal, resistance_m_kg: VALUE, relative_uncertainty: 0.02, source: a, pressure_drop_kPa: KPA}\n"


def pressed(*values: tuple[float, float], more: str = "") -> str:
    return "resistances:\n" + "".join(AT.replace("VALUE", f"{v}").replace("KPA", f"{p}") for p, v in values) + more


RISING = [(p, 1.4e9 * (p / 50) ** 0.3 * (1.0 + 0.005 * (-1) ** k)) for k, p in enumerate((25, 50, 75, 100))]


def test_a_change_with_pressure_is_said(tmp_path: Path) -> None:
    found = load(tmp_path, measured=pressed(*RISING))
    assert len(found.observations) == 4 and not found.warnings
    (doubt,) = settings_of(found).doubts
    assert doubt.kind == "pressure" and "give a pressure_kPa to calibrate at" in doubt.text
    assert "the resistance of bimodal rises with pressure from 25 to 100 kPa (exponent 0.3" in doubt.text
    # what the pressures change is in the error of the mean
    assert pooled(found.observations)["bimodal"].scatter > 0.1
    assert load(tmp_path, measured=pressed(*[(p, 1.4e9) for p, _ in RISING])).doubts == ()


def test_resistances_are_brought_to_one_pressure(tmp_path: Path) -> None:
    more = MEASUREMENTS.partition("\n")[2].replace("VALUE", "1.3e+9")
    found = load(tmp_path, TINY + "pressure_kPa: 60\n", measured=pressed(*RISING, more=more))
    brought, unknown = found.observations
    (fit,) = compressibility_by_csd(found.measurements).values()
    value, low, high = (float(end) for end in fit.resistance_at(60e3))
    assert (brought.name, brought.csd, unknown.name) == ("bimodal at 60 kPa", "bimodal", "bimodal (5)")
    assert math.exp(brought.ln_resistance) == pytest.approx(value) == pytest.approx(1.4e9 * 1.2**0.3, rel=0.01)
    assert 2.0 * 1.96 * brought.standard_error == pytest.approx(math.log(high / low), rel=1e-4)
    # what has no pressure stays as it is, and is named
    (doubt,) = found.doubts
    assert doubt.text == "bimodal (5) of bimodal is of an unknown pressure, and taken as it is for 60 kPa"
    mean = 0.5 * sum(implied_porosity(alpha, found.study.csds["bimodal"].full, 1180.0, 1.0) for alpha in (value, 1.3e9))
    assert found.implied_porosity == pytest.approx(mean)


def test_one_pressure_cannot_be_brought_to_another(tmp_path: Path) -> None:
    text = TINY + "pressure_kPa: 60\n"
    (doubt,) = load(tmp_path, text, measured=pressed((50, 1.4e9))).doubts
    assert "is of 50 kPa, and taken as it is for 60 kPa" in doubt.text
    assert load(tmp_path, text, measured=pressed((60.2, 1.4e9))).doubts == ()
    with pytest.raises(ConfigError, match=r"pressure_kPa = 60: two measurements of bimodal .* add a third"):
        load(tmp_path, text, measured=pressed((50, 1.4e9), (100, 1.5e9)))


def test_contradictions_are_said_at_once_and_in_the_outcome(tmp_path: Path) -> None:
    found = load(tmp_path, measured=pressed((50, 1.0e9), (50, 1.8e9)))
    (doubt,) = found.doubts
    assert doubt.kind == "contradiction" and "contradict each other" in doubt.text
    assert len(found.warnings) == 1 and doubt.text in found.warnings[0]


def test_friction_may_be_fitted(tmp_path: Path) -> None:
    text = TINY.replace("friction: 0\n", "").replace("rival_friction: [0.1]", "fit_friction: [0, 0.05, 0.3]")
    found = load(tmp_path, text)
    assert [p.name for p in found.parameters] == ["cohesion_kJ_m3", "friction"]
    assert (found.parameters[1].low, found.parameters[1].high) == (0.0, 0.3)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rival_friction: [0.1]", "fit_friction: [0, 0.1]", "must hold at least 3 values"),
        ("rival_friction: [0.1]", "fit_friction: [0, 0.1, 0.3]", "fit_friction goes without friction"),
        ("low: 0, high: 80", "low: 80, high: 0", "low must be below high"),
        ("step: 10", "step: 60", "step must divide the range"),
        ("tiny_measurements.yaml", "nowhere.yaml", "no such file"),
        ("title:", "titel:", "did you mean title?"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(ConfigError) as error:
        load(tmp_path, TINY.replace(old, new))
    assert said in str(error.value)


def test_a_wide_range_is_doubted_and_one_too_wide_refused(tmp_path: Path) -> None:
    assert not load(tmp_path).warnings
    wide = load(tmp_path, TINY.replace("high: 80", "high: 120"))
    assert len(wide.warnings) == 1 and wide.study.warnings == wide.warnings
    with pytest.raises(ConfigError, match="must be at most"):
        load(tmp_path, TINY.replace("high: 80", "high: 600"))


def test_unknown_calibrations_are_listed(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as error:
        load_calibrations(["pmmma", "pmma"], ROOT / "config/calibrations", STUDIES, "config/config.yaml")
    known = "pmma, pmma_filtration, pmma_paper, synthetic"
    assert f"calibrations[0] = 'pmmma': no such calibration; allowed: {known}" in str(error.value)


def test_calibrations_of_one_name_are_refused(tmp_path: Path) -> None:
    paths = [tmp_path / folder / "mine.yaml" for folder in ("a", "b")]
    for path in paths:
        path.parent.mkdir()
        load(path.parent)
    with pytest.raises(ConfigError) as error:
        load_calibrations(map(str, paths), tmp_path, STUDIES, "config/config.yaml")
    (problem,) = error.value.problems
    assert problem.key == "calibrations[1]"
    assert f"{paths[0]} and {paths[1]} would both be called calibration_mine" in problem.allowed


def test_the_name_of_a_calibration_s_file_must_be_allowed(tmp_path: Path) -> None:
    path = tmp_path / "my file.yaml"
    path.write_text(TINY)
    with pytest.raises(ConfigError) as error:
        load_calibrations([str(path)], tmp_path, STUDIES, "config/config.yaml")
    assert "'" + str(path) + "': the file's name must be letters, digits" in str(error.value)


def test_a_study_that_cannot_be_used_is_named_with_the_file_that_names_it(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"mine.yaml: study = 'measured.yaml': this study cannot") as found:
        load(tmp_path, TINY.replace("../tiny.yaml", "measured.yaml"))
    assert any(problem.file.endswith("measured.yaml") for problem in found.value.problems)


PRESSED = """study: ../tiny_pressed.yaml
measurements: measured.yaml
"""


def load_pressed(folder: Path, text: str = PRESSED, measured: str | None = None, study: str | None = None):
    file = ROOT / "config/test/tiny_pressed.yaml"
    if study is not None:
        file = folder / "study.yaml"
        file.write_text(study)
    (folder / "measured.yaml").write_text(measured or pressed((20, 1.1e9), (100, 1.2e9)))
    (folder / "mine.yaml").write_text(text.replace("../tiny_pressed.yaml", str(file)))
    return load_calibration(folder / "mine.yaml", STUDIES)


class TestPressedCakes:
    def test_friction_is_fitted_to_cakes_at_their_own_pressures(self, tmp_path: Path) -> None:
        found = load_pressed(tmp_path)
        assert [p.name for p in found.parameters] == ["friction"] and found.doubts == ()
        assert [item.cake for item in found.observations] == ["bimodal at 20 kPa", "bimodal at 100 kPa"]
        settings = settings_of(found)
        assert settings.levels == PRESSED_FRICTIONS and settings.pressures_kPa == (20.0, 50.0, 100.0)
        assert (settings.beside, settings.beside_levels, settings.fixed) == ("adhesion_mJ_m2", (10.0,), 10.0)
        assert Settings.from_dict(json.loads(json.dumps(settings.as_dict()))) == settings

    def test_one_packing_serves_every_pressure_and_attraction(self, tmp_path: Path) -> None:
        found = load_pressed(tmp_path, PRESSED + "adhesion_mJ_m2: {low: 0, high: 20}\nfit_friction: [0, 0.1, 0.3]\n")
        assert [p.name for p in found.parameters] == ["friction", "adhesion_mJ_m2"]
        assert settings_of(found).beside_levels[0] == 0.0 and settings_of(found).beside_levels[-1] == 20.0
        points = candidates(found, lambda *_: "")
        assert len(points) == BATCHES * 3 == len({item.point.packings for item in points})
        assert {item.point.scene.attraction for item in points} == {"adhesion"}

    def test_pressures_a_little_apart_are_the_same(self, tmp_path: Path) -> None:
        found = load_pressed(tmp_path, measured=pressed((50, 1.1e9), (50.2, 1.2e9)))
        assert {item.cake for item in found.observations} == {"bimodal at 50 kPa"}

    def test_a_resistance_without_a_pressure_is_taken_at_the_study_s_and_said(self, tmp_path: Path) -> None:
        found = load_pressed(tmp_path, measured=MEASUREMENTS.replace("VALUE", "1.1e+9"))
        assert [item.pressure_kPa for item in found.observations] == [50.0]
        (doubt,) = found.doubts
        assert doubt.kind == "pressure" and "taken for one at the study's 50 kPa" in doubt.text
        study = (ROOT / "config/test/tiny_pressed.yaml").read_text().replace("  pressure_kPa: 50\n", "", 1)
        with pytest.raises(ConfigError, match="bimodal has no pressure_drop_kPa: give the study"):
            load_pressed(tmp_path, measured=MEASUREMENTS.replace("VALUE", "1.1e+9"), study=study)
        with pytest.raises(ConfigError, match="predict needs the pressure to predict at"):
            load_pressed(tmp_path, PRESSED + "predict: [bimodal]\n", study=study)

    def test_a_study_with_cohesion_keeps_it(self, tmp_path: Path) -> None:
        study = (ROOT / "config/test/tiny_pressed.yaml").read_text()
        study = study.replace("  adhesion_mJ_m2: 10\n", "  cohesion_kJ_m3: 30\n", 1).replace(
            "    adhesion_mJ_m2: [1, 10]\n", ""
        )
        settings = settings_of(load_pressed(tmp_path, study=study))
        assert (settings.beside, settings.fixed) == ("cohesion_kJ_m3", 30.0)

    @pytest.mark.parametrize(
        ("line", "says"),
        [
            (
                "cohesion_kJ_m3: {low: 0, high: 80}",
                "cohesion_kJ_m3 = given: .* is filtration",
            ),
            ("friction: 0.1", "friction = given: .*fit_friction names the values packed"),
            ("rival_friction: [0.1]", "rival_friction = given"),
            ("pressure_kPa: 50", "compared with cakes at its own pressure drop"),
            ("estimator: paper_count", "pressed cakes have an interior only"),
            ("engine: liggghts", "cakes are pressed by the embedded engine"),
            ("adhesion_mJ_m2: {low: 5, high: 1}", "low must be below high"),
            ("adhesion_mJ_m2: 90000", "adhesion_mJ_m2"),
            ("fit_friction: [0, 0.1]", "at least 3"),
            ("fit_friction: [0, 0.3, 0.1]", "ascending"),
        ],
    )
    def test_what_they_do_not_know_is_refused(self, tmp_path: Path, line: str, says: str) -> None:
        with pytest.raises(ConfigError, match=says):
            load_pressed(tmp_path, f"{PRESSED}{line}\n")

    def test_a_cake_that_cannot_be_pressed_is_named_with_its_pressure(self, tmp_path: Path) -> None:
        with pytest.raises(ConfigError, match=r"bimodal at 0.05 kPa and 10 mJ/m2: holds 0.\d+ kPa, more than"):
            load_pressed(tmp_path, measured=pressed((0.05, 1.1e9), (100, 1.2e9)))

    def test_beds_know_no_adhesion(self, tmp_path: Path) -> None:
        with pytest.raises(ConfigError, match="adhesion_mJ_m2 = given: the study's packing"):
            load(tmp_path, TINY + "adhesion_mJ_m2: 5\n")
