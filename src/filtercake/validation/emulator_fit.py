"""Train the instant estimate on packings: what each Gaussian process knows before and how packings scatter.

Both follow from the packings by the largest posterior density of the processes' parameters. How far the intervals then
hold is measured on the packings themselves, each left out in turn with all others of its distribution and friction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy

from filtercake.design.emulator import ADHESION, AT_ONCE, FEATURES, FRICTION, Emulator, Part
from filtercake.design.gaussian_process import Covariance, Process, Scatter
from filtercake.packing.scene import FILTRATION_PROTOCOL
from filtercake.statistics import CONFIDENCE, quantile
from filtercake.units import FloatArray, IntArray

SHAPES: Final = 3
"""Shapes that the curves of pressed cakes are added up from."""
MOST_WIDENING: Final = 5.0


@dataclass(frozen=True, eq=False)
class Training:
    """Packings that a model is trained on.

    Attributes
    ----------
    features : ndarray, shape (n, p)
        Their features.
    porosity : ndarray, shape (n, m)
        Porosities by load; nan where a cake was pressed without attraction, but for the last.
    spheres : ndarray, shape (n,)
        Spheres that count for the scatter.
    group : ndarray of int, shape (n,)
        Packings of one distribution and friction.
    """

    features: FloatArray
    porosity: FloatArray
    spheres: FloatArray
    group: IntArray


@dataclass(frozen=True, eq=False)
class _Output:
    """What one process is trained on: scaled inputs (n, p), outputs (n,), friction and spheres (n,)."""

    inputs: FloatArray
    outputs: FloatArray
    friction: FloatArray
    spheres: FloatArray

    def process(self, parameters: FloatArray) -> tuple[Process, Scatter]:
        """Make the process of parameters: logarithms of deviation, slope, lengths, scatter; then its two powers."""
        p = self.inputs.shape[1]
        deviation, slope = np.exp(parameters[:2])
        length = tuple(np.exp(parameters[2 : 2 + p]).tolist())
        scatter = Scatter(math.exp(parameters[2 + p]), float(parameters[3 + p]), float(parameters[4 + p]))
        covariance = Covariance(float(deviation), length, float(slope))
        noise = scatter.at(self.friction, self.spheres) ** 2
        return Process(covariance, self.inputs, self.outputs, noise), scatter

    def objective(self, parameters: FloatArray, middle: FloatArray, width: FloatArray) -> float:
        """Return minus the logarithm of the posterior density, but for a constant."""
        prior = 0.5 * float(np.sum(((parameters - middle) / width) ** 2))
        try:
            return prior - self.process(parameters)[0].log_evidence
        except np.linalg.LinAlgError:
            return 1e10

    def best(self) -> tuple[Process, Scatter]:
        """Return the process of the largest posterior density."""
        p, spread = self.inputs.shape[1], float(self.outputs.std())
        # lengths about the width of the features' ranges; scatter as that of cells: docs/pressure.md
        middle = np.array([math.log(spread), math.log(spread), *[math.log(2.0)] * p, math.log(0.1 * spread), 1.0, 0.5])
        width = np.array([1.5, 1.5, *[1.0] * p, 1.5, 0.7, 0.25])
        found = scipy.optimize.minimize(
            self.objective, middle, args=(middle, width), method="L-BFGS-B", options={"maxiter": 80}
        )
        return self.process(found.x)


def train(protocol: str, load: FloatArray, data: Training) -> Emulator:
    """Train the model of a protocol on its packings.

    Parameters
    ----------
    protocol : {"filtration", "gravity"}
        How the packings were made.
    load : ndarray, shape (m,)
        Loads of the porosities, the last infinite.
    data : Training
        The packings.
    """
    lowest, highest = data.features.min(axis=0), data.features.max(axis=0)
    inputs = 2.0 * (data.features - lowest) / (highest - lowest) - 1.0
    friction = data.features[:, FEATURES[protocol].index(FRICTION)]
    led = np.isfinite(data.porosity[:, 0])
    looser = data.porosity[led, :-1] - data.porosity[led, -1:]
    shapes = np.linalg.svd(looser, full_matrices=False)[2][: SHAPES if led.any() and load.size > 1 else 0]
    weights = looser @ shapes.T
    rest = np.append(np.sqrt(np.mean((looser - weights @ shapes) ** 2, axis=0)), 0.0)
    outputs = [(np.arange(len(led)), data.porosity[:, -1]), *((np.flatnonzero(led), column) for column in weights.T)]
    parts = tuple(
        _part(_columns(protocol, number), _Output(inputs[rows], output, friction[rows], data.spheres[rows]))
        for number, (rows, output) in enumerate(outputs)
    )
    made = Emulator(
        protocol=protocol,
        lowest=lowest,
        highest=highest,
        load=load,
        shapes=np.hstack([shapes, np.zeros((len(shapes), 1))]),
        parts=parts,
        rest=rest,
        widening=1.0,
        packings=len(led),
    )
    return replace(made, widening=_widening(left_out(made, data)))


def _columns(protocol: str, number: int) -> tuple[int, ...]:
    """Features that an output depends on: the porosity at the last load, or the weight of a shape."""
    # under the last load the attraction is nothing, but whether the load came at once counts; otherwise it never does
    idle = {FILTRATION_PROTOCOL: (ADHESION, AT_ONCE)[min(number, 1)]}.get(protocol)
    return tuple(k for k, name in enumerate(FEATURES[protocol]) if name != idle)


def _part(columns: tuple[int, ...], data: _Output) -> Part:
    offset = float(data.outputs.mean())
    own = replace(data, inputs=data.inputs[:, columns], outputs=data.outputs - offset)
    process, scatter = own.best()
    return Part(columns, offset, process, scatter)


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Packings estimated without those of their own group; shapes (n, m) by packing and load, nan where not pressed.

    Attributes
    ----------
    porosity, mean : ndarray
        What was found, and what was estimated.
    unknown, scatter : ndarray
        Standard deviations of the estimate and of one packing about the truth.
    """

    porosity: FloatArray
    mean: FloatArray
    unknown: FloatArray
    scatter: FloatArray


def left_out(model: Emulator, data: Training) -> LeftOut:
    """Estimate each packing without all of its distribution and friction."""
    led = np.isfinite(data.porosity[:, 0])
    mean, unknown, scatter = (np.full(data.porosity.shape, np.nan) for _ in range(3))
    for number, part in enumerate(model.parts):
        rows = np.arange(len(led)) if number == 0 else np.flatnonzero(led)
        found = part.process.left_out(data.group[rows])
        share = np.ones(model.load.size) if number == 0 else model.shapes[number - 1]
        noise = part.process.noise[rows if number == 0 else slice(None)]
        if number == 0:
            mean[:] = (part.offset + found.mean)[:, None]
            unknown[:], scatter[:] = (found.deviation**2)[:, None], noise[:, None] + model.rest**2
        else:
            mean[rows] += (part.offset + found.mean)[:, None] * share
            unknown[rows] += (found.deviation**2)[:, None] * share**2
            scatter[rows] += noise[:, None] * share**2
    known = np.isfinite(data.porosity)
    return LeftOut(data.porosity, *(np.where(known, x, np.nan) for x in (mean, np.sqrt(unknown), np.sqrt(scatter))))


def _widening(found: LeftOut) -> float:
    """Factor on what is unknown, at least 1, with which 95 % of packings left out are in their intervals."""
    off = (found.porosity - found.mean)[np.isfinite(found.porosity)]
    unknown, scatter = (x[np.isfinite(found.porosity)] for x in (found.unknown, found.scatter))

    def short(factor: float) -> float:
        half = quantile() * np.hypot(factor * unknown, scatter)
        return float(np.quantile(np.abs(off) / half, CONFIDENCE)) - 1.0

    if short(1.0) <= 0.0:
        return 1.0
    return float(scipy.optimize.brentq(short, 1.0, MOST_WIDENING)) if short(MOST_WIDENING) < 0.0 else MOST_WIDENING
