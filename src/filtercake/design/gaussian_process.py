"""Regression by a Gaussian process whose noise differs from one observation to the next; numpy only.

The covariance of two inputs is Matern's with smoothness 5/2 and a length for each input, plus that of a plane with
random slopes (C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006,
eq. 2.25, 4.17 and section 2.7). Lengths and slopes refer to inputs as they are given: scale them first.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from filtercake.units import FloatArray, IntArray

JITTER: Final = 1e-9
"""Share of the variance on the diagonal that keeps equal inputs apart."""
SCATTER_SPHERES: Final = 1000.0
"""Spheres that count, of the packing whose scatter is the unit of others."""


@dataclass(frozen=True)
class Covariance:
    """What is known before the first observation.

    Attributes
    ----------
    deviation : float
        Standard deviation of the curved part, in units of the output.
    length : tuple of float
        Distance in each input over which the curved part stays alike.
    slope : float
        Standard deviation of the plane's value at 0, and of its change per unit of each input.
    """

    deviation: float
    length: tuple[float, ...]
    slope: float

    def __call__(self, one: FloatArray, other: FloatArray) -> FloatArray:
        """Covariance of inputs (n, p) with others (m, p), shape (n, m)."""
        scale = np.asarray(self.length)
        distance = np.sqrt(5.0 * _squares(one / scale, other / scale))
        curved = (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)
        return np.asarray(self.deviation**2 * curved + self.slope**2 * (1.0 + one @ other.T))

    def variance(self, inputs: FloatArray) -> FloatArray:
        """Variance at inputs (n, p), shape (n,)."""
        return np.asarray(self.deviation**2 + self.slope**2 * (1.0 + np.sum(inputs**2, axis=1)))


def _squares(one: FloatArray, other: FloatArray) -> FloatArray:
    """Squared distances of rows."""
    mixed = np.sum(one**2, axis=1)[:, None] + np.sum(other**2, axis=1)[None, :] - 2.0 * one @ other.T
    return np.asarray(np.maximum(mixed, 0.0))


@dataclass(frozen=True)
class Estimate:
    """Mean of the true output at inputs, and the standard deviation of what is not known of it; shapes (m,)."""

    mean: FloatArray
    deviation: FloatArray


@dataclass(frozen=True, eq=False)
class Process:
    """A Gaussian process after its observations.

    Attributes
    ----------
    covariance : Covariance
        What was known before.
    inputs : ndarray, shape (n, p)
        Where it was observed.
    outputs : ndarray, shape (n,)
        What was observed.
    noise : ndarray, shape (n,)
        Variance of each observation about the truth.
    """

    covariance: Covariance
    inputs: FloatArray
    outputs: FloatArray
    noise: FloatArray

    def at(self, inputs: FloatArray) -> Estimate:
        """Estimate the true outputs at inputs, shape (m, p)."""
        cross = self.covariance(inputs, self.inputs)
        left = self.covariance.variance(inputs) - np.sum((cross @ self._root.T) ** 2, axis=1)
        return Estimate(cross @ self._weights, np.sqrt(np.maximum(left, 0.0)))

    @property
    def log_evidence(self) -> float:
        """Logarithm of the probability density of the observations, but for a constant (eq. 5.8 there)."""
        return -0.5 * float(self.outputs @ self._weights) + float(np.sum(np.log(np.diag(self._root))))

    def left_out(self, groups: IntArray) -> Estimate:
        """Estimate each observation's truth without the observations of its own group (n,); shapes (n,)."""
        inverse = self._root.T @ self._root
        mean, deviation = np.empty_like(self.outputs), np.empty_like(self.outputs)
        for group in np.unique(groups):
            own = np.flatnonzero(groups == group)
            spread = np.linalg.inv(inverse[np.ix_(own, own)])
            mean[own] = self.outputs[own] - spread @ self._weights[own]
            deviation[own] = np.sqrt(np.maximum(np.diag(spread) - self.noise[own], 0.0))
        return Estimate(mean, deviation)

    @cached_property
    def _root(self) -> FloatArray:
        """Inverse of the Cholesky factor of the observations' covariance: lower triangular, shape (n, n)."""
        whole = self.covariance(self.inputs, self.inputs)
        jitter = JITTER * (self.covariance.deviation**2 + self.covariance.slope**2)
        whole[np.diag_indices_from(whole)] += self.noise + jitter
        return np.asarray(np.linalg.inv(np.linalg.cholesky(whole)))

    @cached_property
    def _weights(self) -> FloatArray:
        return np.asarray(self._root.T @ (self._root @ self.outputs))


@dataclass(frozen=True)
class Scatter:
    """Standard deviation of an observation about the truth: ``deviation exp(friction f) (spheres/N)^size``.

    Attributes
    ----------
    deviation : float
        At no friction and ``SCATTER_SPHERES`` spheres.
    friction : float
        Change of its logarithm with the friction's feature f.
    size : float
        Power of the number of spheres that count.
    """

    deviation: float
    friction: float
    size: float

    def at(self, friction: FloatArray, spheres: FloatArray) -> FloatArray:
        """Return standard deviations, shape (n,)."""
        return np.asarray(self.deviation * np.exp(self.friction * friction) * (SCATTER_SPHERES / spheres) ** self.size)
