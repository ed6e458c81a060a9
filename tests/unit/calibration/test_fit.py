"""Calibration against made-up responses whose truth is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from filtercake.calibration.fit import (
    Calibration,
    Observation,
    _Groups,
    _scale,
    advised_friction,
    calibrate,
    compare_friction,
    good_enough,
    leave_one_out,
    next_values,
    predict,
    slope,
)
from filtercake.calibration.response import Parameter, Response, SharedResponse, _variances
from filtercake.errors import CalibrationError

COHESION = Parameter("cohesion_kJ_m3", 0.0, 100.0)
FRICTION = Parameter("friction", 0.0, 0.3)
VALUES = np.arange(0.0, 101.0, 10.0)
SPREAD = 0.025
"""Standard deviation of ln(alpha) of one packing, as 2000 PMMA spheres have it."""


def law(cohesion: np.ndarray | float, offset: float = 0.0) -> np.ndarray:
    """ln(alpha), falling in an S as that of the PMMA mixtures does."""
    return np.log(4.6e9) + offset - 0.7 / (1.0 + np.exp(-(np.asarray(cohesion) - 55.0) / 14.0))


def response(seed: int, offset: float = 0.0, replicates: int = 6, curve=law, values: np.ndarray = VALUES) -> Response:
    random = np.random.default_rng(seed)
    samples = [curve(value, offset) + SPREAD * random.standard_normal(replicates) for value in values]
    return Response((COHESION,), values[:, None], samples)


def measured(seed: int, truth: float, csds: dict[str, float], tests: int = 2, error: float = 0.05) -> list[Observation]:
    random = np.random.default_rng([seed, 1])
    return [
        Observation(f"{name} {k}", name, float(law(truth, offset)) + error * random.standard_normal(), error)
        for name, offset in csds.items()
        for k in range(tests)
    ]


CSDS = {"fine": 0.2, "middle": 0.0, "coarse": -0.4}


def fitted(seed: int, truth: float = 35.0, **more: float) -> Calibration:
    responses = {name: response(10 * seed + k, offset) for k, (name, offset) in enumerate(CSDS.items())}
    return calibrate(measured(seed, truth, CSDS, **more), responses)


def kinds(calibration: Calibration) -> set[str]:
    return {finding.kind for finding in calibration.findings}


class TestFit:
    def test_interval_covers_the_truth_as_often_as_it_says(self) -> None:
        repeats = 60
        fits = [fitted(seed).estimates[0] for seed in range(repeats)]
        covered = sum(fit.low <= 35.0 <= fit.high for fit in fits)
        # 57 expected; fewer than 51 has a chance of 1e-3
        assert covered >= 51
        errors = [abs(fit.value - 35.0) / 35.0 for fit in fits]
        assert np.median(errors) < 0.10
        # neither is the interval so wide that it covers anything
        assert np.median([fit.half_width for fit in fits]) < 10.0

    def test_is_weighted_least_squares_where_the_packings_are_exact(self) -> None:
        """Straight responses without noise: the answer is that of a weighted mean, in closed form."""
        slope = -0.01

        def line(value, offset):
            return 22.0 + offset + slope * np.asarray(value)

        values = np.linspace(0.0, 100.0, 21)
        offsets = {"one": 0.0, "other": 0.3}
        random = np.random.default_rng(0)
        responses = {
            name: Response(
                (COHESION,), values[:, None], [line(v, c) + 1e-6 * random.standard_normal(4) for v in values]
            )
            for name, c in offsets.items()
        }
        observations = [
            Observation("a", "one", float(line(50.0, 0.0)) + 0.02, 0.05),
            Observation("b", "other", float(line(50.0, 0.3)) - 0.01, 0.02),
            Observation("c", "other", float(line(50.0, 0.3)) - 0.03, 0.04),
        ]
        found = calibrate(observations, responses)
        weights = np.array([0.05, 0.02, 0.04]) ** -2.0
        mean = np.average([0.02, -0.01, -0.03], weights=weights)
        (estimate,) = found.estimates
        assert estimate.value == pytest.approx(50.0 + mean / slope, abs=0.05)
        # Student's, by how far the two distributions are apart
        squares = (0.02 + 0.014) ** 2 / (0.05**2 + 1.0 / weights[1:].sum())
        assert found.chi_square == pytest.approx(squares, rel=0.02)
        reach = math.sqrt(squares) * 12.706 / math.sqrt(weights.sum())
        assert estimate.half_width == pytest.approx(reach / abs(slope), rel=0.02)
        assert found.model_share < 1e-3 and not found.findings

    def test_noise_of_the_packings_widens_the_interval(self) -> None:
        few, many = (
            calibrate(measured(0, 45.0, {"one": 0.0}, error=0.002), {"one": response(3, replicates=n)}) for n in (2, 50)
        )
        assert few.estimates[0].half_width > 2.0 * many.estimates[0].half_width
        assert few.model_share > many.model_share > 0.5

    def test_measurements_of_one_distribution_share_the_error_of_its_packings(self) -> None:
        """A hundred exact measurements of one cake cannot beat the packings it is compared with."""
        responses = {"one": response(3)}
        one, hundred = (calibrate(measured(0, 45.0, {"one": 0.0}, tests=n, error=0.001), responses) for n in (1, 100))
        assert hundred.estimates[0].half_width == pytest.approx(one.estimates[0].half_width, rel=0.05)

    def test_two_parameters_are_found_where_the_distributions_tell_them_apart(self) -> None:
        grid = np.array([[s, mu] for s in np.linspace(0, 100, 7) for mu in (0.0, 0.1, 0.2, 0.3)])
        slopes = {"one": (-0.01, -0.5), "other": (-0.002, -3.0)}
        random = np.random.default_rng(1)
        responses = {
            name: Response(
                (COHESION, FRICTION),
                grid,
                [22.0 + a * s + b * mu + 0.01 * random.standard_normal(6) for s, mu in grid],
            )
            for name, (a, b) in slopes.items()
        }
        observations = [Observation(name, name, 22.0 + a * 40.0 + b * 0.12, 0.02) for name, (a, b) in slopes.items()]
        found = calibrate(observations, responses)
        cohesion, friction = found.estimates
        assert cohesion.low < 40.0 < cohesion.high and friction.low < 0.12 < friction.high
        assert cohesion.half_width < 10.0 and friction.half_width < 0.05
        assert not kinds(found) & {"confounded", "flat"}
        alone = calibrate(observations[:1], responses)
        assert {"confounded", "flat"} <= kinds(alone)

    def test_few_replicates_are_drawn_towards_the_spread_of_all(self) -> None:
        samples = [np.array([-0.01, 0.01]), np.array([-0.03, 0.0, 0.03])]
        own, freedom = np.array([2e-4, 18e-4]), np.array([1.0, 2.0])
        pooled = 20e-4 / 3.0
        assert _variances(samples) == pytest.approx((8.0 * pooled + own) / (8.0 + freedom))

    def test_errors(self) -> None:
        with pytest.raises(CalibrationError, match="no measurement"):
            calibrate([], {})
        with pytest.raises(CalibrationError, match="not enough packings of other"):
            calibrate([Observation("a", "other", 22.0, 0.1)], {"one": response(0)})
        with pytest.raises(CalibrationError, match="at least 3"):
            Response((COHESION,), VALUES[:2, None], [np.ones(3)] * 2)
        with pytest.raises(CalibrationError, match="two accepted packings"):
            Response((COHESION,), VALUES[:, None], [np.ones(1)] * VALUES.size)


class TestFindings:
    def test_none_for_good_data(self) -> None:
        assert not fitted(1).findings

    def test_flat(self) -> None:
        flat = {"one": response(1, curve=lambda value, offset: 22.0 + 1e-4 * np.asarray(value))}
        found = calibrate([Observation("a", "one", 22.005, 0.05)], flat)
        assert "flat" in kinds(found)
        assert "do not determine the cohesion" in " ".join(finding.text for finding in found.findings)

    def test_two_minima(self) -> None:
        def valley(value, offset):
            return 22.0 + 1e-3 * (np.asarray(value) - 50.0) ** 2

        found = calibrate([Observation("a", "one", 22.4, 0.02)], {"one": response(1, curve=valley)})
        assert found.estimates[0].regions == 2 and "several" in kinds(found)
        assert found.estimates[0].low < 30.0 and found.estimates[0].high > 70.0

    def test_beyond_the_range_and_not_to_be_told_from_zero(self) -> None:
        low, high = float(law(0.0)) + 0.1, float(law(100.0)) - 0.1
        responses = {"one": response(1)}
        assert "zero" in kinds(calibrate([Observation("a", "one", low, 0.02)], responses))
        edge = calibrate([Observation("a", "one", high, 0.02)], responses)
        assert "edge" in kinds(edge)
        assert any("upper end" in finding.text for finding in edge.findings)

    def test_misfit_is_said_and_added_to_the_errors(self) -> None:
        responses = {name: response(k, offset) for k, (name, offset) in enumerate(CSDS.items())}
        observations = [
            Observation(name, name, float(law(45.0, offset)) + shift, 0.02)
            for (name, offset), shift in zip(CSDS.items(), (0.25, -0.25, 0.0), strict=True)
        ]
        found = calibrate(observations, responses)
        assert "misfit" in kinds(found) and 0.15 < found.discrepancy < 0.4
        consistent = calibrate(
            [Observation(name, name, float(law(45.0, offset)), 0.02) for name, offset in CSDS.items()], responses
        )
        assert consistent.discrepancy == 0.0
        assert found.estimates[0].half_width > 3.0 * consistent.estimates[0].half_width

    @pytest.mark.parametrize(("count", "limit"), [(2, 161.4), (3, 18.51)])
    def test_an_estimated_discrepancy_is_held_against_f(self, count: int, limit: float) -> None:
        """Straight responses, known exactly: the interval is Student's, of the distributions alone."""
        values = np.linspace(-900.0, 1000.0, 21)
        wide = Parameter("cohesion_kJ_m3", -900.0, 1000.0)
        lines = [22.0 - 0.01 * value + 1e-4 * np.array([-1.0, 1.0]) for value in values]
        shifts = [0.2, -0.1, -0.2][:count]
        responses = {f"{k}": Response((wide,), values[:, None], lines) for k in range(count)}
        found = calibrate([Observation(f"{k}", f"{k}", 21.5 + s, 0.01) for k, s in enumerate(shifts)], responses)
        assert found.discrepancy > 0.0
        assert found.threshold == pytest.approx(limit, rel=1e-3)
        error = np.std(shifts, ddof=1) / math.sqrt(count) / 0.01
        assert found.estimates[0].half_width == pytest.approx(math.sqrt(limit) * error, rel=0.02)

    def test_distributions_that_agree_may_do_so_by_chance(self) -> None:
        """Their spread is in the interval though it is no discrepancy, but never makes it narrower than the errors."""
        fits = [fitted(seed) for seed in range(12)]
        for found in fits:
            expected = max(3.8415, 18.513 * min(found.chi_square / 2.0, 1.0))
            assert found.threshold == pytest.approx(expected, rel=1e-3)
        assert {found.threshold > 3.85 for found in fits if found.discrepancy == 0.0} == {True, False}
        one = calibrate(measured(1, 45.0, {"one": 0.0}), {"one": response(3)})
        assert one.threshold == pytest.approx(3.8415, abs=1e-4)  # nothing but its own errors to go by

    def test_a_measurement_out_of_reach_is_said(self) -> None:
        found = calibrate([Observation("a", "one", float(law(0.0)) + 0.25, 0.05)], {"one": response(1)})
        assert "misfit" in kinds(found) and found.degrees_of_freedom == 0
        assert "outside what the packings reach" in " ".join(finding.text for finding in found.findings)

    def test_friction_is_told_apart_or_not(self) -> None:
        observations = measured(0, 45.0, CSDS, error=0.02)
        right = {name: response(k, offset) for k, (name, offset) in enumerate(CSDS.items())}
        # the other friction changes the three cakes unequally: no cohesion makes up for it
        wrong = {
            name: response(k, offset + shift)
            for k, ((name, offset), shift) in enumerate(zip(CSDS.items(), (0.3, -0.3, 0.0), strict=True))
        }
        fits = {0.0: calibrate(observations, right), 0.05: calibrate(observations, wrong)}
        (finding,) = compare_friction(fits)
        assert "prefer a friction of 0 to 0.05" in finding.text
        (other,) = compare_friction(dict(reversed(fits.items())))
        assert "prefer a friction of 0 to 0.05" in other.text
        assert len(compare_friction({0.0: fits[0.0], 0.05: fits[0.05], 0.3: fits[0.05]})) == 2
        assert compare_friction({0.0: fits[0.0]}) == ()

    @pytest.mark.parametrize("csds", [CSDS, {"one": 0.0}], ids=["three", "one"])
    def test_a_friction_does_not_win_by_more_packings(self, csds: dict[str, float]) -> None:
        """Same cakes at both frictions, but one is packed ten times as often."""
        observations = measured(0, 45.0, csds, error=0.002)

        def fit(replicates: int) -> Calibration:
            either = SPREAD * np.array([-1.0, 1.0] * (replicates // 2))  # their mean is the law exactly
            return calibrate(
                observations,
                {
                    name: Response((COHESION,), VALUES[:, None], [law(value, offset) + either for value in VALUES])
                    for name, offset in csds.items()
                },
            )

        few, many = fit(4), fit(40)
        variances = [found.packed_variance + found.measured_variance for found in (few, many)]
        # the ratio of the likelihoods would prefer it
        assert np.sum(np.log(variances[0] / variances[1])) > len(csds) * 3.84 / 3.0
        for fits in ({0.0: many, 0.05: few}, {0.0: few, 0.05: many}):
            (finding,) = compare_friction(fits)
            assert "do not tell a friction of 0.05 from 0" in finding.text
            assert ("a cohesion makes up for either" in finding.text) == (len(csds) == 1)

    def test_the_number_that_decides_is_said(self) -> None:
        right = fitted(1)
        # the larger of both packings' variances counts, whichever fit it belongs to
        errors = right.measured_variance + 4.0 * right.packed_variance
        squares = float(np.sum(right.residual**2 / errors))
        for more, said in ((3.0, "do not tell"), (5.0, "prefer a friction of 0 to 0.05")):
            shift = np.sqrt(errors * (right.residual**2 / errors + more / 3.0))
            vague = replace(right, residual=shift, packed_variance=4.0 * right.packed_variance)
            (finding,) = compare_friction({0.0: right, 0.05: vague})
            assert said in finding.text
            assert f"chi-square {squares + more:.1f} with 0.05 and {squares:.1f} with 0; " in finding.text
            assert "it takes a difference of 3.8 to tell them apart" in finding.text

    def test_frictions_that_both_fail_are_hard_to_tell_apart(self) -> None:
        """Where the errors are known from the distributions alone, seven times the squares say nothing."""
        bad = replace(fitted(1), discrepancy=0.2)
        worse = replace(bad, residual=np.array([0.6, -0.4, 0.4]), discrepancy=0.3)
        bad = replace(bad, residual=np.array([0.2, -0.2, 0.1]))
        (finding,) = compare_friction({0.0: bad, 0.05: worse})
        assert "do not tell" in finding.text
        (finding,) = compare_friction({0.0: bad, 0.05: replace(worse, residual=np.array([2.0, -2.0, 1.0]))})
        assert "prefer a friction of 0 to 0.05" in finding.text


class TestContradictions:
    """Measurements of one distribution that ask for different cohesions."""

    def fit(self, *wanted: float, error: float = 0.01) -> Calibration:
        observations = [Observation(f"{k}", "one", float(law(s)), error) for k, s in enumerate(wanted)]
        return calibrate(observations, {"one": response(3)})

    def test_are_said_and_widen_the_interval_over_both(self) -> None:
        found = self.fit(30.0, 80.0)
        (finding,) = (finding for finding in found.findings if finding.kind == "contradiction")
        assert "the 2 measurements of one contradict each other" in finding.text
        apart = float(law(30.0) - law(80.0))
        assert f"chi-square {apart**2 / (2 * 0.01**2):.1f} with 1 degree of freedom" in finding.text
        assert f"a scatter of {100 * apart / math.sqrt(2.0):.0f} %" in finding.text
        (estimate,) = found.estimates
        assert estimate.low < 35.0 and estimate.high > 75.0

    def test_their_scatter_is_held_against_f(self) -> None:
        """Two measurements know their scatter from one degree of freedom, three from two."""
        assert self.fit(30.0, 80.0).threshold == pytest.approx(161.4, rel=1e-3)
        assert self.fit(30.0, 80.0, 60.0).threshold == pytest.approx(18.51, rel=1e-3)
        assert self.fit(50.0, 51.0).threshold == pytest.approx(3.8415, abs=1e-4)
        # beside a sharp one of another cake, the doubtful two count for little
        errors, freedom = np.array([0.1, 0.01]) ** 2, np.array([1.0, math.inf])
        groups = _Groups(("doubtful", "sharp"), errors, freedom, np.zeros((2, 1)), np.eye(2), np.eye(2))
        assert _scale(groups, 0.0, 1) == (1.0, pytest.approx((1.0 + 100.0) ** 2))
        assert _scale(groups, 0.5, 1) == (0.5, 1.0)
        assert _scale(groups, 1.0, 1) == (1.0, 1.0)

    def test_within_the_errors_are_none(self) -> None:
        assert "contradiction" not in kinds(self.fit(50.0, 51.0))
        # 0.0175 per kJ/m3 at most: five apart is nothing at 5 %
        assert "contradiction" not in kinds(self.fit(50.0, 55.0, error=0.05))
        assert "contradiction" in kinds(self.fit(50.0, 55.0, error=0.005))

    def test_a_precise_one_is_not_believed_alone(self) -> None:
        """With the scatter in the weights, one of 1 % does not outvote four of 3 % that agree with each other."""
        observations = [Observation(f"{k}", "one", float(law(60.0)), 0.03) for k in range(4)]
        observations.append(Observation("odd", "one", float(law(30.0)), 0.01))
        (estimate,) = calibrate(observations, {"one": response(3)}).estimates
        assert estimate.high > 60.0 and estimate.value > 45.0


class TestUse:
    def test_left_out_distributions_are_predicted(self) -> None:
        responses = {name: response(k, offset) for k, (name, offset) in enumerate(CSDS.items())}
        observations = measured(3, 50.0, CSDS, error=0.02)
        errors = leave_one_out(observations, responses)
        assert set(errors) == set(CSDS) and max(map(abs, errors.values())) < 0.1
        biased = [
            Observation(o.name, o.csd, o.ln_resistance + (0.3 if o.csd == "fine" else 0.0), o.standard_error)
            for o in observations
        ]
        assert leave_one_out(biased, responses)["fine"] == pytest.approx(errors["fine"] - 0.3, abs=1e-9)
        assert leave_one_out(observations[:2], responses) == {}

    def test_prediction_covers_the_truth(self) -> None:
        repeats, covered = 40, 0
        for seed in range(repeats):
            found = predict(fitted(seed), response(1000 + seed, 0.7))
            covered += found.low <= math.exp(law(35.0, 0.7)) <= found.high
            assert found.low < found.resistance < found.high
        assert covered >= 33  # 38 expected; fewer than 33 has a chance of 4e-3

    def test_prediction_holds_what_the_parameter_leaves_open(self) -> None:
        sharp, vague = (fitted(2, error=error) for error in (0.01, 0.15))
        new = response(77, 0.7)
        widths = [math.log(found.high / found.low) for found in (predict(sharp, new), predict(vague, new))]
        assert widths[1] > 2.0 * widths[0]

    @pytest.mark.parametrize(("freedom", "student"), [(2.0, 4.3027), (5.0, 2.5706), (math.inf, 1.95996)])
    def test_prediction_is_students_where_the_errors_were_estimated(self, freedom: float, student: float) -> None:
        line = Response((COHESION,), VALUES[:, None], [22.0 - 0.01 * s + 1e-5 * np.array([-1.0, 1.0]) for s in VALUES])
        found = fitted(1)
        for spread, discrepancy, expected in ((1.5, 0.0, 0.015), (0.5, 0.1, 0.1), (1.5, 0.02, 0.025)):
            deviance = ((found.axes[0] - 50.0) / spread) ** 2
            known = replace(found, deviance=deviance, discrepancy=discrepancy, scale=1.0, scale_freedom=freedom)
            made = predict(known, line)
            reach = 0.5 * math.log(made.high / made.low)
            assert reach == pytest.approx(student * expected, rel=0.06)

    def test_prediction_holds_the_discrepancy(self) -> None:
        found, new = replace(fitted(1), scale=1.0, scale_freedom=math.inf), response(77, 0.7)
        plain, doubted = predict(found, new), predict(replace(found, discrepancy=0.25), new)
        reach = math.log(doubted.high / doubted.low)
        assert reach == pytest.approx(math.hypot(math.log(plain.high / plain.low), 2.0 * 1.96 * 0.25), rel=0.03)

    def test_next_values_refine_where_the_interval_is(self) -> None:
        candidates = list(np.arange(0.0, 101.0, 5.0))
        first = next_values(None, candidates, [], 6, 4)
        assert first == [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]
        found = fitted(1)
        more = next_values(found, candidates, first, 6, 4)
        (estimate,) = found.estimates
        assert more and not set(more) & set(first) and len(more) <= 4
        assert all(estimate.low - 5.0 <= value <= estimate.high + 5.0 for value in more)
        assert next_values(found, candidates, candidates, 6, 4) == []

    def test_good_enough(self) -> None:
        found = fitted(1)
        relative = found.estimates[0].half_width / found.estimates[0].value
        assert good_enough(found, 1.01 * relative)
        assert good_enough(found, 0.99 * relative) == (found.model_share < 0.1)

    def test_paper_advises_friction_by_porosity(self) -> None:
        assert advised_friction(0.35) == 0.0 and advised_friction(0.45) == 0.05


class Curve:
    """Packings by a law of the friction and, where there are two parameters, of the adhesion; with an error."""

    def __init__(self, parameters: tuple[Parameter, ...], law, deviation: float) -> None:
        self.parameters = parameters
        self.law, self.deviation = law, deviation

    def __call__(self, points):
        return self.law(*np.atleast_2d(points).T), np.full(len(points), self.deviation**2)


class TestCakesOfOneDistribution:
    """Cakes at several pressures are of the same packings, whose errors do not average out."""

    MU = Parameter("friction", 0.0, 0.7)

    def found(self, correlation: float, drops=(20.0, 200.0), error: float = 0.01, packed: float = 0.05, shift=0.0):
        observations = [
            Observation(f"{p:g}", "a", -1.0 * 0.2 + 0.05 * math.log(p) + shift * k, error, p)
            for k, p in enumerate(drops)
        ]
        responses = {
            f"a at {p:g} kPa": Curve((self.MU,), lambda mu, p=p: -1.0 * mu + 0.05 * math.log(p), packed) for p in drops
        }
        return calibrate(observations, responses, correlation), responses

    @pytest.mark.parametrize(("correlation", "variance"), [(0.0, 0.5), (1.0, 1.0), (0.5, 0.75)])
    def test_the_interval_is_that_of_the_mean_of_correlated_errors(self, correlation: float, variance: float) -> None:
        fit, _ = self.found(correlation)
        (estimate,) = fit.estimates
        assert estimate.value == pytest.approx(0.2, abs=1e-4)
        # by the errors, or by Student's with one degree of freedom where they scatter less
        assert fit.scale_freedom == math.inf
        half = 1.959964 * math.sqrt(0.05**2 * variance + 0.01**2 / 2.0)
        assert estimate.half_width == pytest.approx(half, rel=2e-3)

    def test_the_squares_are_those_of_a_normal_distribution(self) -> None:
        fit, _ = self.found(0.8, shift=0.03)
        covariance = np.array([[0.05**2, 0.8 * 0.05**2], [0.8 * 0.05**2, 0.05**2]]) + 0.01**2 * np.eye(2)
        residual = np.array([0.2 - fit.best[0], 0.2 - fit.best[0]]) * -1.0 + np.array([0.0, 0.03])
        assert fit.chi_square == pytest.approx(residual @ np.linalg.solve(covariance, residual), rel=1e-3)
        assert fit.degrees_of_freedom == 1

    def test_the_deviance_is_minus_twice_the_ln_of_the_likelihood(self) -> None:
        """With variances that change along the friction, the determinant of the covariance takes part."""

        class Widening(Curve):
            def __call__(self, points):
                mean, variance = super().__call__(points)
                return mean, variance * (1.0 + 20.0 * np.atleast_2d(points)[:, 0])

        observations = [Observation(f"{p:g}", "a", -0.2, 0.02, p) for p in (20.0, 200.0)]
        responses = {item.cake: Widening((self.MU,), lambda mu: -1.0 * mu, 0.05) for item in observations}
        fit = calibrate(observations, responses, 0.6)

        def minus_twice_ln(mu: float) -> float:
            covariance = 0.05**2 * (1.0 + 20.0 * mu) * np.array([[1.0, 0.6], [0.6, 1.0]]) + 0.02**2 * np.eye(2)
            return -2.0 * float(multivariate_normal.logpdf([-0.2, -0.2], [-mu, -mu], covariance))

        (axis,) = fit.axes
        expected = np.array([minus_twice_ln(mu) for mu in axis[::40]])
        assert np.ptp(fit.deviance[::40] - expected) < 1e-6

    def test_a_wrong_compressibility_is_a_misfit_with_a_discrepancy(self) -> None:
        """Errors shared by both pressures do not hide that the measured resistance rises faster."""
        fit, _ = self.found(0.95, shift=0.2)
        assert fit.discrepancy > 0.05 and "misfit" in {finding.kind for finding in fit.findings}
        assert self.found(0.0, shift=0.2)[0].chi_square < fit.chi_square

    def test_a_distribution_is_left_out_with_all_its_cakes(self) -> None:
        _, responses = self.found(0.9)
        drops = (20.0, 200.0)
        observations = [
            Observation(f"{c}{p:g}", c, -0.2 + 0.05 * math.log(p) + (0.1 if c == "b" else 0.0), 0.01, p)
            for c in ("a", "b")
            for p in drops
        ]
        both = {**responses, **{name.replace("a at", "b at"): own for name, own in responses.items()}}
        errors = leave_one_out(observations, both, 0.9)
        assert errors == {name: pytest.approx(0.1 if name[0] == "a" else -0.1, abs=1e-3) for name in both}
        assert leave_one_out(observations[:2], responses, 0.9) == {}

    @pytest.mark.parametrize("correlation", [0.0, 0.9])
    def test_the_slope_s_interval_knows_that_errors_are_alike(self, correlation: float) -> None:
        fit, responses = self.found(correlation)
        found = slope(fit, np.log([20.0, 200.0]), list(responses.values()), correlation)
        assert found.value == pytest.approx(0.05, abs=1e-3)
        # the law's slope does not depend on the friction: what is left is the packings' own difference
        expected = 1.96 * 0.05 * math.sqrt(2.0 * (1.0 - correlation)) / math.log(10.0)
        assert 0.5 * (found.high - found.low) == pytest.approx(expected, rel=0.03)


class TestSharedResponse:
    FRICTION, ADHESION = Parameter("friction", 0.0, 0.5), Parameter("adhesion_mJ_m2", 0.0, 10.0)
    MU, W = np.array([0.0, 0.1, 0.2, 0.35, 0.5]), (0.0, 2.5, 10.0)

    def shared(self) -> SharedResponse:
        random = np.random.default_rng(1)
        noise = 0.03 * random.standard_normal((self.MU.size, 4))  # that of a packing, whatever the adhesion
        along = [
            Response(
                (self.FRICTION,),
                self.MU[:, None],
                [-mu - 0.02 * w + row for mu, row in zip(self.MU, noise, strict=True)],
            )
            for w in self.W
        ]
        return SharedResponse((self.FRICTION, self.ADHESION), self.W, along)

    def test_is_exact_at_its_values_and_smooth_between(self) -> None:
        shared = self.shared()
        for w, response in zip(self.W, shared.along, strict=True):
            points = np.column_stack([self.MU, np.full(self.MU.size, w)])
            for mine, own in zip(shared(points), response(self.MU[:, None]), strict=True):
                np.testing.assert_allclose(mine, own)
        between = shared(np.array([[0.2, 1.25]]))[0] - shared(np.array([[0.2, 0.0]]))[0]
        assert between == pytest.approx(-0.025, abs=0.005)

    def test_packings_count_once_however_many_adhesions_they_serve(self) -> None:
        shared = self.shared()
        variance = shared(np.array([[0.2, 2.5]]))[1][0]
        alone = shared.along[1](np.array([[0.2]]))[1][0]
        assert variance == pytest.approx(alone)

    def test_needs_two_values(self) -> None:
        with pytest.raises(CalibrationError, match="1 value of adhesion_mJ_m2 is too few"):
            SharedResponse((self.FRICTION, self.ADHESION), (1.0,), self.shared().along[:1])
