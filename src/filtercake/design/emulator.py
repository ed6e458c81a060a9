"""The instant estimate: porosity of a packing that nobody has made, with an interval, from a few hundred that were.

Two models, one of pressed cakes and one of beds settled as the paper settles them, were trained on packings
(docs/emulator.md). Each is a handful of Gaussian processes over features without dimension
(:mod:`filtercake.design.packing_features`): the porosity at the last load, and how much looser a cake is under lower
ones. The file ``emulator.json`` holds what they were trained on; it is remade by ``make emulator``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from filtercake.design.gaussian_process import Estimate, Process, Scatter
from filtercake.design.packing_features import (
    FALL_FEATURES,
    HALF_FRICTION,
    SHAPE_FEATURES,
    SLIGHT,
    counting_spheres,
    fall_features,
    friction_feature,
    shape_features,
)
from filtercake.errors import ConfigError, Problem
from filtercake.filtration.compressible import CakeAverage, cake_average
from filtercake.packing.compression import CompressionCurve
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL, Scene
from filtercake.statistics import quantile
from filtercake.units import FloatArray

FRICTION, SLIGHT_FRICTION = "friction", "slight_friction"
AT_ONCE, ADHESION = "pressed_at_once", "adhesion"
"""Features of pressed cakes that are 0 or 1: without attraction, so that the load is there at once; the attraction is
a size-true adhesion, not a cohesion."""
FEATURES: Final = {
    FILTRATION_PROTOCOL: (*SHAPE_FEATURES, FRICTION, AT_ONCE, ADHESION),
    GRAVITY_PROTOCOL: (*SHAPE_FEATURES, FRICTION, SLIGHT_FRICTION, *FALL_FEATURES),
}
FARTHEST: Final = 0.5
"""How far outside the range of a feature, in widths of that range, an estimate is still given."""
WIDENING: Final = 4.0
"""Growth of the interval with that distance: at ``FARTHEST`` it is three times as wide."""
STEP: Final = 1e-4
"""Change of a porosity by which slopes are taken."""

ROUNDING: Final = 1e-9
"""Share of a feature's range by which it may be exceeded."""


def _as_it_is(value: float) -> float:
    return value


def _from_share(share: float) -> float:
    """Value t of a feature t/(1 + t)."""
    return share / (1.0 - share)


MEANINGS: Final[dict[str, tuple[str, str, Callable[[float], float]]]] = {
    "close_packing": ("distribution", "close-packed porosity of the sizes", _as_it_is),
    "linear_packing": ("distribution", "change of a loose porosity by the spread of the sizes", _as_it_is),
    "spread": ("distribution", "standard deviation of ln d by volume", _as_it_is),
    "skew": ("distribution", "third moment's cube root of ln d by volume", _as_it_is),
    "surface_spread": ("distribution", "standard deviation of ln d by surface", _as_it_is),
    FRICTION: (FRICTION, "friction", lambda share: HALF_FRICTION * _from_share(share)),
    "stickiness": (
        "cohesion_kJ_m3",
        "strength of the contacts over the stress of impact",
        lambda share: _from_share(share) ** 1.5,
    ),
    "impact": ("distribution", "stress of impact over E*", math.exp),
    "depth": ("distribution", "depth of the solids over the Sauter mean", math.exp),
}
"""Option, meaning and way back of each feature by which what lies outside is told."""

OfCurve = Callable[[CompressionCurve], float]
"""A number that follows from the porosity against the load."""


def cake_of(scene: Scene, curve: CompressionCurve) -> CakeAverage:
    """Average a pressed cake from its surface to the medium; a settled bed has one porosity."""
    return cake_average(scene.load_over_strength if scene.is_pressed else math.inf, curve.at)


def features_of(scene: Scene) -> FloatArray:
    """Return the features of a scene that its protocol's model has, shape (p,)."""
    shared = [*shape_features(scene.csd), friction_feature(scene.friction)]
    if not scene.is_pressed:
        return np.array([*shared, friction_feature(scene.friction, SLIGHT), *fall_features(scene)])
    attraction = scene.attraction
    return np.array([*shared, float(attraction == "none"), float(attraction == "adhesion")])


@dataclass(frozen=True, eq=False)
class Part:
    """One output of a model.

    Attributes
    ----------
    columns : tuple of int
        Features that it depends on.
    offset : float
        Mean of the output, which the process knows nothing of.
    process : Process
        The rest of it, over scaled features.
    scatter : Scatter
        Of a single packing about the truth.
    """

    columns: tuple[int, ...]
    offset: float
    process: Process
    scatter: Scatter

    def at(self, inputs: FloatArray) -> Estimate:
        """Estimate the true output at scaled features (m, p)."""
        found = self.process.at(inputs[:, list(self.columns)])
        return Estimate(self.offset + found.mean, found.deviation)


@dataclass(frozen=True, eq=False)
class CurveEstimate:
    """Porosity at the loads of a model.

    Attributes
    ----------
    load : ndarray, shape (n,)
        Loads x = p/p_c, the last infinite; that one alone for a settled bed or a cake without attraction.
    porosity : ndarray, shape (n,)
        Estimated mean of many packings.
    unknown : ndarray, shape (n, n)
        Covariance of what is not known of that mean.
    scatter : ndarray, shape (n, n)
        Covariance of one packing about the mean.
    outside : tuple of str
        Where the point lies outside what the model was trained on, in words.
    """

    load: FloatArray
    porosity: FloatArray
    unknown: FloatArray
    scatter: FloatArray
    outside: tuple[str, ...]

    @property
    def curve(self) -> CompressionCurve:
        """Porosity against the load."""
        return CompressionCurve(self.load, self.porosity)

    def half_widths(self, number: OfCurve) -> tuple[float, float]:
        """Half-widths of the 95 % intervals of a number of the curve: of many packings' mean, and of one packing's.

        To first order in the porosities.
        """
        middle = number(self.curve)
        slope = np.array(
            [
                (number(CompressionCurve(self.load, self.porosity + STEP * unit)) - middle) / STEP
                for unit in np.eye(self.load.size)
            ]
        )
        unknown, scatter = (float(slope @ part @ slope) for part in (self.unknown, self.scatter))
        return quantile() * math.sqrt(unknown), quantile() * math.sqrt(unknown + scatter)


@dataclass(frozen=True)
class Doubt:
    """A feature outside of what a model was trained on.

    Attributes
    ----------
    name : str
        Of the feature.
    value, lowest, highest : float
        Its value, and its range in the training.
    distance : float
        How far outside, in widths of that range.
    """

    name: str
    value: float
    lowest: float
    highest: float
    distance: float

    @property
    def words(self) -> str:
        """What lies outside, in words."""
        _, meaning, shown = MEANINGS[self.name]
        value, lowest, highest = (f"{shown(x):.3g}" for x in (self.value, self.lowest, self.highest))
        return f"{meaning} is {value}, the packings' is {lowest} to {highest}"

    def problem(self) -> Problem:
        """Refuse an estimate."""
        return Problem("options", MEANINGS[self.name][0], "", f"{self.words}: too far off for an estimate; use pack")


@dataclass(frozen=True, eq=False)
class Emulator:
    """The trained model of one protocol.

    Attributes
    ----------
    protocol : str
        How the packings were made.
    lowest, highest : ndarray, shape (p,)
        Range of each feature among them; features are scaled to -1 to 1 in it.
    load : ndarray, shape (n,)
        Loads of a pressed cake; infinity alone for a settled bed.
    shapes : ndarray, shape (k, n)
        How much looser than at the last load a cake is, by load: the shapes that are added up.
    parts : tuple of Part
        The porosity at the last load, then the weight of each shape.
    rest : ndarray, shape (n,)
        Standard deviation of what the shapes leave out, by load.
    widening : float
        Factor on what the processes say that is not known, so that of packings left out in turn 95 % are covered.
    packings : int
        Packings that it was trained on.
    """

    protocol: str
    lowest: FloatArray
    highest: FloatArray
    load: FloatArray
    shapes: FloatArray
    parts: tuple[Part, ...]
    rest: FloatArray
    widening: float
    packings: int

    def scaled(self, features: FloatArray) -> FloatArray:
        """Scale features (..., p) to -1 to 1 in their ranges."""
        return np.asarray(2.0 * (features - self.lowest) / (self.highest - self.lowest) - 1.0)

    def estimate(self, scene: Scene) -> CurveEstimate:
        """Estimate the porosity of a scene's packings.

        Raises
        ------
        ConfigError
            If the scene lies too far outside what the model was trained on.
        """
        features = features_of(scene)
        doubts = self._doubts(features)
        farthest = max((doubt.distance for doubt in doubts), default=0.0)
        if farthest > FARTHEST:
            raise ConfigError([max(doubts, key=lambda doubt: doubt.distance).problem()])
        scaled = self.scaled(features)[np.newaxis]
        found = [part.at(scaled) for part in self.parts]
        friction, spheres = friction_feature(scene.friction), counting_spheres(scene.csd, scene.particles)
        scatter = [part.scatter.at(np.array([friction]), np.array([spheres])) for part in self.parts]
        stretch = self.widening * (1.0 + WIDENING * farthest)
        loads = slice(None) if scene.attraction != "none" and scene.is_pressed else slice(-1, None)
        adds_up = np.vstack([np.ones(self.load.size), self.shapes]).T[loads]
        mean, deviation = (np.concatenate([getattr(each, name) for each in found]) for name in ("mean", "deviation"))
        return CurveEstimate(
            load=self.load[loads],
            porosity=adds_up @ mean,
            unknown=_spread(adds_up, stretch * deviation),
            scatter=_spread(adds_up, np.concatenate(scatter)) + np.diag(self.rest[loads] ** 2),
            outside=tuple(doubt.words for doubt in doubts),
        )

    def _doubts(self, features: FloatArray) -> list[Doubt]:
        """Say which features lie outside of what the model was trained on."""
        width = self.highest - self.lowest
        distance = np.maximum(self.lowest - features, features - self.highest) / width
        names = FEATURES[self.protocol]
        return [
            Doubt(names[k], float(features[k]), float(self.lowest[k]), float(self.highest[k]), float(distance[k]))
            for k in np.flatnonzero(distance > ROUNDING)
            if names[k] in MEANINGS
        ]


def _spread(adds_up: FloatArray, deviation: FloatArray) -> FloatArray:
    """Covariance of sums of independent parts."""
    weighted = adds_up * deviation
    return np.asarray(weighted @ weighted.T)
