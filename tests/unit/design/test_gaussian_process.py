"""Gaussian processes against closed forms: conjugate normals, another library's density, refits without a group."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from filtercake.design.gaussian_process import SCATTER_SPHERES, Covariance, Process, Scatter
from filtercake.units import FloatArray

COVARIANCE = Covariance(deviation=0.7, length=(0.6, 1.4), slope=0.3)


def observed(points: int = 25, noise: float = 0.05, seed: int = 3) -> Process:
    """Points of a smooth function with noise."""
    random = np.random.default_rng(seed)
    inputs = random.uniform(-1.0, 1.0, (points, 2))
    truth = np.sin(2.0 * inputs[:, 0]) + 0.3 * inputs[:, 1]
    return Process(COVARIANCE, inputs, truth + noise * random.normal(size=points), np.full(points, noise**2))


def whole(process: Process) -> FloatArray:
    return process.covariance(process.inputs, process.inputs) + np.diag(process.noise)


def test_one_observation_is_a_conjugate_normal() -> None:
    here = np.zeros((1, 2))
    process = Process(Covariance(2.0, (1.0, 1.0), 0.0), here, np.array([3.0]), np.array([1.0]))
    found = process.at(here)
    # prior variance 4, noise 1
    assert found.mean == pytest.approx([3.0 * 4.0 / 5.0])
    assert found.deviation == pytest.approx([np.sqrt(4.0 / 5.0)])


def test_materns_covariance_at_a_distance() -> None:
    found = Covariance(1.0, (0.5,), 0.0)(np.array([[0.0]]), np.array([[0.5], [1e3]]))
    root = np.sqrt(5.0)
    assert found[0] == pytest.approx([(1.0 + root + 5.0 / 3.0) * np.exp(-root), 0.0])


def test_the_plane_of_random_slopes() -> None:
    flat = Covariance(1e-9, (1.0, 1.0), 0.5)
    one, other = np.array([[1.0, 2.0]]), np.array([[-1.0, 3.0]])
    assert flat(one, other)[0, 0] == pytest.approx(0.25 * (1.0 - 1.0 + 6.0))
    assert flat.variance(one) == pytest.approx([0.25 * 6.0])


def test_the_evidence_is_the_density_of_the_observations() -> None:
    process = observed()
    density = scipy.stats.multivariate_normal(np.zeros(25), whole(process)).logpdf(process.outputs)
    assert process.log_evidence - 12.5 * np.log(2.0 * np.pi) == pytest.approx(density, abs=1e-5)


def test_far_away_nothing_is_known_but_the_plane() -> None:
    process = observed()
    far = np.array([[50.0, -50.0]])
    assert process.at(far).deviation[0] > COVARIANCE.deviation


def test_leaving_a_group_out_is_training_without_it() -> None:
    process = observed()
    groups = np.repeat(np.arange(5), 5)
    found = process.left_out(groups)
    for group in range(5):
        rest = groups != group
        without = Process(COVARIANCE, process.inputs[rest], process.outputs[rest], process.noise[rest])
        expected = without.at(process.inputs[~rest])
        assert found.mean[~rest] == pytest.approx(expected.mean, abs=1e-6)
        assert found.deviation[~rest] == pytest.approx(expected.deviation, abs=1e-6)


def test_an_interval_covers_the_truth_as_often_as_it_says() -> None:
    inside = []
    for seed in range(40):
        random = np.random.default_rng(seed)
        inputs = random.uniform(-1.0, 1.0, (40, 2))
        truth = np.linalg.cholesky(COVARIANCE(inputs, inputs) + 1e-9 * np.eye(40)) @ random.normal(size=40)
        noise = np.full(40, 0.01)
        seen, asked = slice(0, 30), slice(30, 40)
        noisy = truth[seen] + 0.1 * random.normal(size=30)
        found = Process(COVARIANCE, inputs[seen], noisy, noise[seen]).at(inputs[asked])
        inside += (np.abs(truth[asked] - found.mean) <= 1.96 * found.deviation).tolist()
    assert 0.92 < np.mean(inside) < 0.98


def test_scatter_grows_with_friction_and_falls_with_spheres() -> None:
    scatter = Scatter(0.002, 1.5, 0.5)
    found = scatter.at(np.array([0.0, 1.0, 0.0]), np.array([SCATTER_SPHERES, SCATTER_SPHERES, 4.0 * SCATTER_SPHERES]))
    assert found == pytest.approx([0.002, 0.002 * np.exp(1.5), 0.001])
