"""Accuracy on demand: packings are added one by one until the porosity's interval is as narrow as asked."""

from __future__ import annotations

from pathlib import Path

from filtercake.packing.porosity import measure
from filtercake.packing.result import Packing
from filtercake.packing.scene import Scene
from filtercake.packing.spread import known_spread
from filtercake.statistics import informed_half_width

LEAST_REPLICATES = 3
"""Packings before an interval is believed: with fewer, a scene that scatters unlike those known is not found out."""


class UntilNarrow:
    """Tells after each accepted packing whether the porosity's interval is narrow enough.

    The spread of packings is that of the few made and of what is known of packings of the kind
    (:func:`filtercake.packing.spread.known_spread`), so that few are needed, and stopping as soon as an interval is
    narrow does not make it cover the truth less often than it says (:func:`filtercake.statistics.informed_spread`).
    """

    def __init__(self, scene: Scene, interval: float, least: int = LEAST_REPLICATES):
        """Ask for a half-width of the 95 % interval of the mean interior porosity, with at least so many packings."""
        self.scene, self.interval, self.least = scene, interval, max(least, LEAST_REPLICATES)
        self.known = known_spread(scene)
        self.values: list[float] = []

    def __call__(self, npz: Path) -> bool:
        """Take one more accepted packing into account; say whether that is enough."""
        return self.add(measure(Packing.load(npz), self.scene).interior)

    def add(self, porosity: float) -> bool:
        """Take one more porosity into account; say whether that is enough."""
        self.values.append(porosity)
        return len(self.values) >= self.least and self.half_width <= self.interval

    @property
    def half_width(self) -> float:
        """Half-width of the interval so far; nan before the first packing."""
        return informed_half_width(self.values, self.known)
