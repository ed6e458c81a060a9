"""Rounds of packings, tables and predictions of a calibration, on packings made up by a law."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pandas as pd
import pytest

from filtercake.calibration import rounds as study
from filtercake.calibration import tables
from filtercake.calibration.fit import Finding, Observation, pooled
from filtercake.calibration.response import Parameter
from filtercake.calibration.rounds import BATCHES, Candidate, Settings, Task, choose_round, conclude
from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.errors import CalibrationError
from filtercake.filtration.drum_filter import DrumFilter, area
from filtercake.filtration.resistance import CARMAN, kozeny_carman, resistance
from filtercake.packing.scene import Scene
from filtercake.study.points import Point
from filtercake.units import KILOJOULE_PER_M3

COHESIONS = tuple(float(value) for value in range(0, 101, 5))
OFFSETS = {"fine": 0.2, "coarse": -0.4, "new": 0.5}
TRUTH = 37.0
CSDS: dict[str, CrystalSizeDistribution] = {
    name: mixture([20e-6, 50e-6], [x, 1.0 - x]) for name, x in (("fine", 0.75), ("coarse", 0.25), ("new", 0.5))
}


def settings(**changes: object) -> Settings:
    values: dict[str, object] = {
        "parameters": (Parameter("cohesion_kJ_m3", 0.0, 100.0),),
        "levels": COHESIONS,
        "beside": "friction",
        "beside_levels": (0.0,),
        "measured": ("fine", "coarse"),
        "predicted": ("new",),
        "estimator": "interior",
        "rounds": 4,
        "relative_ci95_target": 0.1,
        "density": 1180.0,
        "sphericity": 1.0,
        "implied_porosity": 0.35,
        "soft_above": 60.0,
    }
    return Settings(**{**values, **changes})  # type: ignore[arg-type]


def candidates(frictions: tuple[float, ...] = (0.0,)) -> list[Candidate]:
    found = []
    for batch in range(BATCHES):
        for csd in OFFSETS:
            for friction in frictions:
                for s in COHESIONS:
                    numbers = (2000, 0.65, 0.01, 1180.0, 5e6, 0.2, 0.3, friction, s * KILOJOULE_PER_M3, 3e-7)
                    scene = Scene(mixture([20e-6], [1.0]), *numbers, "embedded")
                    name = f"{csd}_s{s:g}_mu{friction:g}_b{batch}"
                    found.append(Candidate(Point(name, "calibration_x", csd, None, 4, scene), batch))
    return found


def law(csd: str, cohesion: float, friction: float) -> float:
    fall = 0.7 / (1.0 + math.exp(-(cohesion - 55.0) / 14.0))
    return math.log(4.6e9) + OFFSETS[csd] - fall - (3.0 + 8.0 * OFFSETS[csd]) * friction


def packed(points: list[Candidate], failed: str = "") -> pd.DataFrame:
    rows = []
    for c in points:
        random = np.random.default_rng([ord(ch) for ch in c.point.name])
        s, mu = c.point.row()["cohesion_kJ_m3"], c.point.scene.friction
        for replicate in range(c.point.replicates):
            bad = c.point.name == failed
            value = law(c.point.csd, s, mu) + 0.025 * random.standard_normal()
            rows.append(
                {
                    **c.point.row(),
                    "batch": c.batch,
                    "replicate": replicate,
                    "status": "failed" if bad else "ok",
                    "ln_resistance": math.nan if bad else value,
                }
            )
    return pd.DataFrame(rows)


OBSERVATIONS = [Observation(name, name, law(name, TRUTH, 0.0), 0.02) for name in ("fine", "coarse")]


def run_rounds(
    chosen: Settings, observations: list[Observation], most: int = 20
) -> tuple[list[study.Round], list[str]]:
    everything = candidates(chosen.beside_levels)
    visited: list[str] = []
    rounds: list[study.Round] = []
    while not (rounds and rounds[-1].finished):
        assert len(rounds) < most
        table = packed([c for c in everything if c.point.name in visited]) if visited else None
        rounds.append(choose_round(len(rounds), chosen, everything, visited, observations, table))
        assert not set(rounds[-1].points) & set(visited)
        visited += rounds[-1].points
    return rounds, visited


class TestRounds:
    def test_first_round_is_coarse_and_leaves_predictions_alone(self) -> None:
        first = choose_round(0, settings(), candidates(), [], OBSERVATIONS, None)
        assert not first.finished and len(first.points) == 2 * study.COARSE
        assert all(name.endswith("_b0") and not name.startswith("new") for name in first.points)

    def test_refines_near_the_optimum_and_ends(self) -> None:
        sharp = [Observation(o.name, o.csd, o.ln_resistance, 0.005) for o in OBSERVATIONS]
        rounds, _ = run_rounds(settings(relative_ci95_target=0.1, rounds=9), sharp)
        assert rounds[-1].finished and not rounds[-1].points and "within 10 %" in rounds[-1].why
        assert len(rounds) > 2
        later = [name for made in rounds[1:] for name in made.points]
        assert later and all(15.0 <= float(name.split("_s")[1].split("_")[0]) <= 60.0 for name in later)

    def test_ends_where_more_packings_would_not_help(self) -> None:
        vague = [Observation(o.name, o.csd, o.ln_resistance, 0.3) for o in OBSERVATIONS]
        rounds, _ = run_rounds(settings(), vague)
        assert "more packings would not narrow it" in rounds[-1].why

    def test_is_bounded(self) -> None:
        exact = [Observation(o.name, o.csd, o.ln_resistance, 1e-4) for o in OBSERVATIONS]
        rounds, _ = run_rounds(settings(relative_ci95_target=1e-4, rounds=3), exact)
        assert len(rounds) == 4 and "the last of 3 rounds" in rounds[-1].why
        rounds, visited = run_rounds(settings(relative_ci95_target=1e-4, rounds=30), exact)
        assert any(name.endswith("_b2") for name in visited)
        assert f"every candidate has its {BATCHES} batches" in rounds[-1].why

    def test_rivals_are_packed_once_only(self) -> None:
        rounds, _ = run_rounds(settings(beside_levels=(0.0, 0.05), relative_ci95_target=0.05), OBSERVATIONS)
        assert any("mu0.05" in name for name in rounds[0].points)
        assert not any("mu0.05" in name for made in rounds[1:] for name in made.points)


class TestOutcome:
    def outcome(self, chosen: Settings | None = None) -> tuple[study.Outcome, pd.DataFrame]:
        chosen = chosen or settings()
        _, visited = run_rounds(chosen, OBSERVATIONS)
        table = packed([c for c in candidates(chosen.beside_levels) if c.point.name in visited])
        return conclude(chosen, OBSERVATIONS, table), table

    def test_finds_the_truth_and_says_so(self) -> None:
        outcome, _ = self.outcome()
        record = tables.summary(outcome, settings(), "because")
        found = record["parameters"]["cohesion_kJ_m3"]
        assert found["low"] < TRUTH < found["high"] and found["high"] - found["low"] < 25.0
        assert record["fixed"] == 0.0 and record["ended"] == "because" and record["findings"] == []
        assert set(outcome.left_out) == {"fine", "coarse"} and max(map(abs, outcome.left_out.values())) < 0.1

    def test_a_failed_point_is_left_out(self) -> None:
        chosen, everything = settings(), candidates()
        first = choose_round(0, chosen, everything, [], OBSERVATIONS, None)
        table = packed([c for c in everything if c.point.name in first.points], failed="fine_s40_mu0_b0")
        outcome = conclude(chosen, OBSERVATIONS, table)
        assert outcome.responses["fine", 0.0].points.shape == (study.COARSE - 1, 1)
        assert outcome.fit.estimates[0].low < TRUTH < outcome.fit.estimates[0].high
        with pytest.raises(CalibrationError, match="fine has them at 0 of 0 points"):
            conclude(chosen, OBSERVATIONS, table[table["csd"] != "fine"])

    def test_too_few_packings_are_counted(self) -> None:
        """Two of six points are neither enough nor none."""
        everything = candidates()
        first = choose_round(0, settings(), everything, [], OBSERVATIONS, None)
        table = packed([c for c in everything if c.point.name in first.points])
        bad = (table["csd"] == "fine") & (table["cohesion_kJ_m3"] > 30.0)
        table.loc[bad, "status"] = "failed"
        for act in (conclude, study.fit_main):
            with pytest.raises(CalibrationError) as error:
                act(settings(), OBSERVATIONS, table)
            assert str(error.value) == (
                "not enough accepted packings for a fit: fine has them at 2 of 6 points; at least 3 are needed, one of "
                "them with two packings"
            )

    def test_a_rival_with_too_few_packings_is_said(self) -> None:
        chosen = settings(beside_levels=(0.0, 0.05))
        _, table = self.outcome(chosen)
        bad = (table["friction"] == 0.05) & (table["csd"] == "coarse") & (table["cohesion_kJ_m3"] < 90.0)
        table.loc[bad, "status"] = "failed"
        outcome = conclude(chosen, OBSERVATIONS, table)
        assert set(outcome.rivals) == {0.0} and outcome.fit.estimates[0].low < TRUTH < outcome.fit.estimates[0].high
        (said,) = (finding.text for finding in outcome.findings if finding.kind == "friction")
        assert said.startswith(
            "a friction of 0.05 is not compared, for want of accepted packings: coarse has them at 1 "
        )
        assert "of 6 points" in said and "fine" not in said

    def test_one_distribution_cannot_test_the_friction(self) -> None:
        alone = settings(measured=("fine",))
        outcome = conclude(alone, OBSERVATIONS[:1], self.outcome()[1])
        (said,) = (finding.text for finding in outcome.findings if finding.kind == "friction")
        assert "one measured distribution cannot test the friction taken, 0" in said

    def test_one_distribution_and_two_parameters_are_reported_as_confounded(self) -> None:
        chosen = settings(
            parameters=(Parameter("cohesion_kJ_m3", 0.0, 100.0), Parameter("friction", 0.0, 0.1)),
            beside_levels=(0.0, 0.05, 0.1),
            measured=("fine",),
        )
        truth = OBSERVATIONS[:1]
        first = choose_round(0, chosen, candidates(chosen.beside_levels), [], truth, None)
        table = packed([c for c in candidates(chosen.beside_levels) if c.point.name in first.points])
        record = tables.summary(conclude(chosen, truth, table), chosen, "")
        said = {finding["kind"]: finding["text"] for finding in record["findings"]}
        assert said["confounded"] == (
            "1 measured distribution cannot determine 2 parameters: cohesion energy density and coefficient of "
            "friction trade off against each other; measure more distributions or fix one of them"
        )
        # the interval of the cohesion is not that of a friction known to be the best
        found = record["parameters"]["cohesion_kJ_m3"]
        fixed = conclude(settings(measured=("fine",)), truth, table).fit.estimates[0]
        assert found["high"] - found["low"] > 2.0 * 2.0 * fixed.half_width

    def test_doubts_of_the_measurements_come_first(self) -> None:
        doubt = Finding("pressure", "the resistance rises with pressure")
        outcome = conclude(settings(doubts=(doubt,)), OBSERVATIONS, self.outcome()[1])
        assert tables.summary(outcome, settings(), "")["findings"][0] == {"kind": "pressure", "text": doubt.text}

    def test_rivals_are_compared(self) -> None:
        chosen = settings(beside_levels=(0.0, 0.05))
        outcome, _ = self.outcome(chosen)
        assert set(outcome.rivals) == {0.0, 0.05}
        assert any("friction" in finding.text for finding in outcome.findings)
        objective = tables.objective_table(outcome, chosen)
        assert sorted(objective["friction"].unique()) == [0.0, 0.05]
        assert objective.groupby("friction")["deviance"].min().tolist() == [0.0, 0.0]
        against = conclude(settings(implied_porosity=0.45), OBSERVATIONS, self.outcome()[1])
        assert any("the paper advises 0.05" in finding.text for finding in against.findings)

    def test_soft_contacts_are_said(self) -> None:
        outcome, table = self.outcome()
        assert not any(finding.kind == "soft" for finding in outcome.findings)
        assert any(f.kind == "soft" for f in conclude(settings(soft_above=20.0), OBSERVATIONS, table).findings)

    def test_points_that_failed_are_the_reason_of_what_is_not_known(self) -> None:
        """Nothing was packed under 40 kJ/m3: it is not the measurements that do not tell the cohesion from zero."""
        _, table = self.outcome()
        lost = table["cohesion_kJ_m3"] < 40.0
        table.loc[lost, "status"], table.loc[lost, "ln_resistance"] = "failed", math.nan
        vague = [dataclasses.replace(item, standard_error=0.5) for item in OBSERVATIONS]
        outcome = conclude(settings(), vague, table)
        assert {"zero", "several", "flat"} & {finding.kind for finding in outcome.fit.findings}
        kinds = [finding.kind for finding in outcome.findings]
        assert "failed" in kinds and not {"zero", "several", "flat"} & set(kinds)
        (text,) = (finding.text for finding in outcome.findings if finding.kind == "failed")
        values = sorted({float(s) for s in table.loc[lost, "cohesion_kJ_m3"]})
        assert f"coarse at {', '.join(f'{s:g}' for s in values)} kJ/m3, fine at " in text
        assert "below 40 kJ/m3 the interval is the smooth model's guess, not what the measurements say" in text

    def test_a_failed_point_beyond_the_interval_is_named_without_blame(self) -> None:
        outcome, table = self.outcome()
        assert not any(finding.kind == "failed" for finding in outcome.findings)
        far = (table["csd"] == "fine") & (table["cohesion_kJ_m3"] == 100.0)
        table.loc[far, "status"], table.loc[far, "ln_resistance"] = "failed", math.nan
        found = {finding.kind: finding.text for finding in conclude(settings(), OBSERVATIONS, table).findings}
        assert found["failed"] == "no packing was accepted of fine at 100 kJ/m3 (column reason of replicates.csv)"

    def test_friction_can_be_fitted(self) -> None:
        chosen = settings(
            parameters=(Parameter("cohesion_kJ_m3", 0.0, 100.0), Parameter("friction", 0.0, 0.1)),
            beside_levels=(0.0, 0.05, 0.1),
        )
        truth = [Observation(n, n, law(n, TRUTH, 0.04), 0.01) for n in ("fine", "coarse")]
        first = choose_round(0, chosen, candidates(chosen.beside_levels), [], truth, None)
        assert len(first.points) == 2 * 3 * study.COARSE
        table = packed([c for c in candidates(chosen.beside_levels) if c.point.name in first.points])
        outcome = conclude(chosen, truth, table)
        cohesion, friction = outcome.fit.estimates
        assert cohesion.low < TRUTH < cohesion.high and friction.low < 0.04 < friction.high
        assert tables.summary(outcome, chosen, "")["fixed"] is None
        assert len(tables.objective_table(outcome, chosen)) == outcome.fit.deviance.size
        assert set(tables.response_table(outcome, chosen, OBSERVATIONS)["csd"]) == {"fine", "coarse"}

    def test_tables_hold_what_was_fitted(self) -> None:
        outcome, _ = self.outcome()
        parity = tables.parity_table(outcome, settings(), OBSERVATIONS)
        assert parity["measured_m_kg"].to_numpy() == pytest.approx([math.exp(o.ln_resistance) for o in OBSERVATIONS])
        assert (parity["modelled_low_m_kg"] < parity["modelled_m_kg"]).all()
        assert np.log(parity["modelled_m_kg"] / parity["measured_m_kg"]).abs().max() < 0.06
        curve = tables.response_table(outcome, settings(), OBSERVATIONS)
        fine = curve[curve["csd"] == "fine"]
        exact = [law("fine", s, 0.0) for s in fine["cohesion_kJ_m3"]]
        assert np.abs(np.log(fine["resistance_m_kg"]) - exact).max() < 0.08

    def test_the_parity_table_has_the_errors_of_the_fit(self) -> None:
        """Measurements that contradict each other carry their scatter; figures average them with it."""
        twice = [*OBSERVATIONS, Observation("again", "fine", law("fine", 80.0, 0.0), 0.01)]
        _, table = self.outcome()
        outcome = conclude(settings(), twice, table)
        assert "contradiction" in {finding.kind for finding in outcome.findings}
        parity = tables.parity_table(outcome, settings(), twice)
        own = parity[parity["csd"] == "fine"]
        scatter = pooled(twice)["fine"].scatter
        assert own["relative_uncertainty"].tolist() == pytest.approx([math.hypot(scatter, e) for e in (0.02, 0.01)])
        assert parity.loc[1, "relative_uncertainty"] == 0.02
        mean = np.average(np.log(own["measured_m_kg"]), weights=own["relative_uncertainty"] ** -2)
        assert np.log(own["left_out_m_kg"]).tolist() == pytest.approx([mean + outcome.left_out["fine"]] * 2)


class TestPrediction:
    def test_of_a_distribution_never_tested(self) -> None:
        outcome, _ = TestOutcome().outcome()
        names = study.prediction_points(settings(), candidates(), outcome.fit)
        assert names and all(name.startswith("new") and name.endswith("_b0") for name in names)
        assert 4 <= len(names) <= study.COARSE
        new = packed([c for c in candidates() if c.point.name in names])
        drum = DrumFilter(
            pressure_drop=5e4,
            submerged_fraction=0.3,
            rotation_rate=1 / 300,
            medium_resistance=5e9,
            viscosity=1e-3,
            slurry_concentration=200.0,
        )
        (row,) = tables.prediction_table(outcome, settings(), new, CSDS, drum, 20.0 / 3600.0).to_dict("records")
        truth = math.exp(law("new", TRUTH, 0.0))
        assert row["resistance_low_m_kg"] < truth < row["resistance_high_m_kg"]
        assert row["high_over_resistance"] == pytest.approx(row["resistance_high_m_kg"] / row["resistance_m_kg"])
        assert row["resistance_with_safety_factor_m_kg"] == pytest.approx(2.0 * row["resistance_m_kg"])
        for end in ("", "_low", "_high"):
            alpha, size = row[f"resistance{end}_m_kg"], row[f"filter_area{end}_m2"]
            assert size == pytest.approx(float(area(drum, np.array([alpha]), 20.0 / 3600.0)[0]))
        assert row["porosity_low"] < row["porosity"] < row["porosity_high"]
        assert kozeny_carman(row["porosity_low"], CSDS["new"], 1180.0) == pytest.approx(row["resistance_high_m_kg"])

    def test_by_another_law_the_same_resistance_is_another_porosity(self) -> None:
        outcome, _ = TestOutcome().outcome()
        names = study.prediction_points(settings(), candidates(), outcome.fit)
        new = packed([c for c in candidates() if c.point.name in names])
        (row,) = tables.prediction_table(outcome, settings(resistance_law=CARMAN), new, CSDS).to_dict("records")
        found = resistance(CARMAN, row["porosity_low"], CSDS["new"], 1180.0)
        assert found == pytest.approx(row["resistance_high_m_kg"])

    def test_needs_packings(self) -> None:
        outcome, table = TestOutcome().outcome()
        with pytest.raises(CalibrationError, match="for a prediction: new has them at 0 of 0"):
            tables.prediction_table(outcome, settings(), table, CSDS)


def test_settings_and_task_survive_being_params() -> None:
    import json

    whole = {
        "settings": settings(doubts=(Finding("pressure", "said"),)).as_dict(),
        "observations": [vars(item) for item in OBSERVATIONS],
        "candidates": [{"point": c.point.as_dict(), "batch": c.batch} for c in candidates()[:3]],
    }
    task = Task.from_params(json.loads(json.dumps(whole)))
    assert task.settings == settings(doubts=(Finding("pressure", "said"),)) and list(task.observations) == OBSERVATIONS
    assert list(task.candidates) == candidates()[:3]


FRICTIONS = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7)
DROPS = (20.0, 50.0, 200.0)


def pressed_settings(adhesions: tuple[float, ...] = (10.0,), **changes: object) -> Settings:
    parameters = [Parameter("friction", 0.0, 0.7)]
    if len(adhesions) > 1:
        parameters.append(Parameter("adhesion_mJ_m2", adhesions[0], adhesions[-1]))
    return settings(
        parameters=tuple(parameters),
        levels=FRICTIONS,
        beside="adhesion_mJ_m2",
        beside_levels=adhesions,
        pressures_kPa=DROPS,
        predicted_pressure_kPa=50.0,
        soft_above=math.inf,
        **changes,
    )


def pressed_candidates() -> list[Candidate]:
    found = []
    for batch in range(BATCHES):
        for csd in OFFSETS:
            for mu in FRICTIONS:
                numbers = (2000, 0.65, 0.01, 1180.0, 5e6, 0.2, 0.3, mu, 0.0, 3e-7)
                scene = Scene(mixture([20e-6], [1.0]), *numbers, "embedded")
                scene = dataclasses.replace(
                    scene, protocol="filtration", pressure=2e5, adhesion=0.01, crystal_modulus=3e9
                )
                found.append(Candidate(Point(f"{csd}_mu{mu:g}_b{batch}", "calibration_x", csd, None, 4, scene), batch))
    return found


def pressed_law(csd: str, mu: float, drop: float, adhesion: float) -> float:
    """ln(alpha) of a pressed cake: friction loosens it, and adhesion does, the less the harder it is pressed."""
    return 22.0 + OFFSETS[csd] - mu / (mu + 0.2) - 0.3 * (1.0 + mu) * (adhesion / (20.0 * drop)) ** 0.5


def pressed_packings(points: list[Candidate], adhesions: tuple[float, ...] = (10.0,)) -> pd.DataFrame:
    rows = []
    for c in points:
        random = np.random.default_rng([ord(ch) for ch in c.point.name])
        for replicate in range(c.point.replicates):
            own = 0.02 * random.standard_normal()
            for drop in DROPS:
                apart = 0.004 * random.standard_normal()
                for adhesion in adhesions:
                    value = pressed_law(c.point.csd, c.point.scene.friction, drop, adhesion) + own + apart
                    row = {**c.point.row(), "adhesion_mJ_m2": adhesion, "pressure_kPa": drop, "batch": c.batch}
                    rows.append({**row, "replicate": replicate, "status": "ok", "ln_resistance": value})
    return pd.DataFrame(rows)


def pressed_observations(mu: float, adhesion: float, csds=("fine", "coarse"), drops=DROPS) -> list[Observation]:
    return [
        Observation(f"{csd} {drop:g}", csd, pressed_law(csd, mu, drop, adhesion), 0.01, drop)
        for csd in csds
        for drop in drops
    ]


class TestPressedCakes:
    def test_rounds_are_along_the_friction_whatever_the_attraction(self) -> None:
        everything, chosen = pressed_candidates(), pressed_settings(rounds=6, relative_ci95_target=0.02)
        truth = pressed_observations(0.15, 10.0)
        first = choose_round(0, chosen, everything, [], truth, None)
        assert len(first.points) == 2 * study.COARSE
        table = pressed_packings([c for c in everything if c.point.name in first.points])
        second = choose_round(1, chosen, everything, list(first.points), truth, table)
        assert second.points and not set(second.points) & set(first.points)
        assert second.why.startswith("friction 0.1") and "kJ/m3" not in second.why

    def test_friction_and_adhesion_are_found_from_several_pressures(self) -> None:
        adhesions = (0.0, 1.0, 4.0, 10.0, 25.0, 60.0)
        chosen = pressed_settings(adhesions)
        simulated = pressed_packings(pressed_candidates(), adhesions)
        outcome = conclude(chosen, pressed_observations(0.15, 10.0), simulated)
        friction, adhesion = outcome.fit.estimates
        assert friction.low < 0.15 < friction.high and friction.value == pytest.approx(0.15, abs=0.03)
        assert adhesion.low < 10.0 < adhesion.high and adhesion.high < 60.0
        assert outcome.packed_correlation == pytest.approx(0.02**2 / (0.02**2 + 0.004**2), abs=0.02)
        assert "confounded" not in {finding.kind for finding in outcome.findings}
        alone = pressed_observations(0.15, 10.0, ("fine",), (50.0,))
        said = {f.kind: f.text for f in conclude(chosen, alone, simulated).findings}
        assert "1 measured cake cannot determine 2 parameters" in said["confounded"]
        assert "at more pressures" in said["confounded"]

    def test_compressibility_is_compared_and_a_wrong_one_said(self) -> None:
        chosen, simulated = pressed_settings(), pressed_packings(pressed_candidates())
        outcome = conclude(chosen, pressed_observations(0.15, 10.0), simulated)
        table = tables.pressures_table(outcome)
        assert table["csd"].tolist() == ["fine", "coarse"] and (table["lowest_pressure_kPa"] == 20.0).all()
        expected = np.polyfit(np.log(DROPS), [pressed_law("fine", 0.15, drop, 10.0) for drop in DROPS], 1)[0]
        assert table["exponent_measured"].iloc[0] == pytest.approx(expected)
        assert table["exponent_modelled"].iloc[0] == pytest.approx(expected, abs=0.005)
        assert "pressure" not in {finding.kind for finding in outcome.findings}
        faster = [
            dataclasses.replace(o, ln_resistance=o.ln_resistance + 0.15 * math.log((o.pressure_kPa or 0.0) / 50.0))
            for o in pressed_observations(0.15, 10.0)
        ]
        broken = conclude(chosen, faster, simulated)
        said = [finding.text for finding in broken.findings if finding.kind == "pressure"]
        assert len(said) == 2 and "rises faster with pressure than that of the calibrated packings" in said[0]

    def test_tables_name_the_pressures(self) -> None:
        chosen, truth, simulated = (
            pressed_settings(),
            pressed_observations(0.15, 10.0),
            pressed_packings(pressed_candidates()),
        )
        outcome = conclude(chosen, truth, simulated)
        parity = tables.parity_table(outcome, chosen, truth)
        assert parity["pressure_kPa"].tolist() == [*DROPS, *DROPS] and parity["left_out_ln_error"].notna().all()
        curve = tables.response_table(outcome, chosen, truth)
        assert set(zip(curve["csd"], curve["pressure_kPa"], strict=True)) == {
            (c, p) for c in ("fine", "coarse") for p in DROPS
        }
        record = tables.summary(outcome, chosen, "done")
        assert (record["beside"], record["fixed"], record["rivals"]["10"]["friction"]) == (
            "adhesion_mJ_m2",
            10.0,
            outcome.fit.best[0],
        )
        (row,) = tables.prediction_table(outcome, chosen, simulated, CSDS).to_dict("records")
        assert row["pressure_kPa"] == 50.0
        assert row["resistance_low_m_kg"] < math.exp(pressed_law("new", 0.15, 50.0, 10.0)) < row["resistance_high_m_kg"]

    def test_a_shortage_is_counted_in_packings_not_in_what_they_serve(self) -> None:
        few = pressed_packings([c for c in pressed_candidates() if c.batch == 0 and c.point.scene.friction < 0.06])
        with pytest.raises(CalibrationError, match="fine has them at 2 of 2 points"):
            conclude(pressed_settings(), pressed_observations(0.15, 10.0), few)
