"""ln(alpha) of packings as a smooth function of the fitted parameters: Gaussian processes through their means."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from filtercake.errors import CalibrationError
from filtercake.statistics import pooled_spread
from filtercake.units import FloatArray

if TYPE_CHECKING:
    from sklearn.gaussian_process import GaussianProcessRegressor

SHRINKAGE = 8.0
"""Degrees of freedom that the pooled variance of replicates weighs against a point's own."""
LENGTH_SCALES = (0.1, 3.0)
"""Shortest and longest correlation length of ln(alpha), over the range of the parameter."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of the packings, with its range.

    Attributes
    ----------
    name : str
        ``cohesion_kJ_m3``, ``friction`` or ``adhesion_mJ_m2``.
    low, high : float
        Its range, in the unit the name says.
    """

    name: str
    low: float
    high: float

    @property
    def span(self) -> float:
        """Width of the range."""
        return self.high - self.low


class Responds(Protocol):
    """ln(alpha) of one cake at any parameters."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The axes of the points."""
        ...

    def __call__(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and variance of ln(alpha) at points (n, d), each of shape (n,)."""
        ...


class Response:
    """ln(alpha) of one distribution as a smooth function of the parameters, with its standard error."""

    def __init__(self, parameters: Sequence[Parameter], points: FloatArray, ln_resistance: Sequence[FloatArray]):
        """Fit a Gaussian process (Matern 5/2) to the means of replicates.

        Parameters
        ----------
        parameters : sequence of Parameter
            The axes of ``points``.
        points : ndarray, shape (n, d)
            Where packings were made.
        ln_resistance : sequence of n ndarrays
            ln(alpha), alpha in m/kg, of the replicates at each point.

        Raises
        ------
        CalibrationError
            With fewer than three points, or without any point of two replicates.
        """
        if len(points) < 3:
            raise CalibrationError(f"{len(points)} points with packings are too few: at least 3 are needed")
        self.parameters = tuple(parameters)
        self.points = np.asarray(points, dtype=np.float64)
        self.mean = np.array([values.mean() for values in ln_resistance])
        self.standard_error = np.sqrt(_variances(ln_resistance) / [values.size for values in ln_resistance])
        self.centre = float(self.mean.mean())
        self.scale = max(float(self.mean.std()), 1e-6)
        self.process = self._fitted()

    def _fitted(self) -> GaussianProcessRegressor:
        # here, because parsing the workflow must not cost this import
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import ConstantKernel, Matern

        kernel = ConstantKernel(1.0, (0.05, 50.0)) * Matern(
            np.full(len(self.parameters), 0.5), [LENGTH_SCALES] * len(self.parameters), nu=2.5
        )
        noise = np.maximum((self.standard_error / self.scale) ** 2, 1e-10)
        process = GaussianProcessRegressor(kernel, alpha=noise, n_restarts_optimizer=1, random_state=0)
        with warnings.catch_warnings():
            # a length at the end of its range is an answer, not a failure
            warnings.simplefilter("ignore", ConvergenceWarning)
            process.fit(self._unit(self.points), (self.mean - self.centre) / self.scale)
        return process

    def __call__(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and variance of ln(alpha) at points (n, d), each of shape (n,)."""
        mean, deviation = self.process.predict(self._unit(points), return_std=True)
        return self.centre + self.scale * mean, (self.scale * deviation) ** 2

    def _unit(self, points: FloatArray) -> FloatArray:
        low = np.array([parameter.low for parameter in self.parameters])
        span = np.array([parameter.span for parameter in self.parameters])
        return np.asarray((np.atleast_2d(points) - low) / span, dtype=np.float64)


class SharedResponse:
    """ln(alpha) over two parameters where one packing serves every value of the second.

    A pressed packing knows its porosity under every strength of the attraction, so packings are made along the first
    parameter only, and what they scatter is the same at all values of the second. Their variance must not shrink with
    the number of values that they were evaluated at, as it would if those counted as points of their own.
    """

    def __init__(self, parameters: tuple[Parameter, Parameter], values: Sequence[float], along: Sequence[Response]):
        """Join responses along the first parameter, each at one value of the second.

        Parameters
        ----------
        parameters : tuple of two Parameters
            The one along which packings were made, and the one whose values they share.
        values : sequence of n floats
            Ascending values of the second.
        along : sequence of n Responses
            Responses over the first at those.

        Raises
        ------
        CalibrationError
            With fewer than two values.
        """
        if len(values) < 2:
            raise CalibrationError(f"{len(values)} value of {parameters[1].name} is too few: at least 2 are needed")
        self.parameters: tuple[Parameter, ...] = parameters
        self.values = np.asarray(values, dtype=np.float64)
        self.along = tuple(along)

    def __call__(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and variance of ln(alpha) at points (n, 2), each of shape (n,)."""
        # who plans a calibration need not wait for it
        from scipy.interpolate import PchipInterpolator

        first, second = np.atleast_2d(points).T
        asked, place = np.unique(first, return_inverse=True)
        found = [response(asked[:, None]) for response in self.along]
        mean, variance = (np.array([part[k] for part in found]) for k in (0, 1))
        at, where = np.unique(np.clip(second, self.values[0], self.values[-1]), return_inverse=True)
        curves = PchipInterpolator(self.values, mean, axis=0)(at)
        spread = PchipInterpolator(self.values, variance, axis=0)(at)
        return curves[where, place], spread[where, place]


def _variances(samples: Sequence[FloatArray]) -> FloatArray:
    """Variance of one replicate at each point: its own, drawn towards that of all points."""
    freedom = np.array([values.size - 1.0 for values in samples])
    squares = np.array([float(np.sum((values - values.mean()) ** 2)) for values in samples])
    pooled = pooled_spread(samples)
    if not pooled.freedom > 0.0:
        raise CalibrationError("no point has two accepted packings: their spread is not known; ask for more replicates")
    return np.asarray((SHRINKAGE * pooled.sd**2 + squares) / (SHRINKAGE + freedom), dtype=np.float64)
