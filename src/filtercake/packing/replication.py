"""Accuracy on demand: packings are added one by one until the porosity's interval is as narrow as asked."""

from __future__ import annotations

from pathlib import Path

from filtercake.packing.porosity import measure
from filtercake.packing.result import Packing
from filtercake.packing.scene import Scene
from filtercake.statistics import half_width

LEAST_REPLICATES = 6
"""Packings before an interval is believed: with fewer, a lucky small spread ends the search too soon."""
TIMES_NARROW = 2
"""Packings on end after which the interval must be narrow enough, for the same reason."""


class UntilNarrow:
    """Tells after each accepted packing whether the porosity's interval is narrow enough.

    Stopping as soon as an interval looks narrow makes it cover the truth less often than it says. With at least
    ``LEAST_REPLICATES`` packings, and the interval narrow after ``TIMES_NARROW`` of them on end, simulated sequences of
    normal porosities are covered in 94 to 99 % of cases, whatever the spread.
    """

    def __init__(self, scene: Scene, interval: float, least: int = LEAST_REPLICATES):
        """Ask for a half-width of the 95 % interval of the mean interior porosity, with at least so many packings."""
        self.scene, self.interval, self.least = scene, interval, max(least, LEAST_REPLICATES)
        self.values: list[float] = []
        self.narrow = 0

    def __call__(self, npz: Path) -> bool:
        """Take one more accepted packing into account; say whether that is enough."""
        return self.add(measure(Packing.load(npz), self.scene).interior)

    def add(self, porosity: float) -> bool:
        """Take one more porosity into account; say whether that is enough."""
        self.values.append(porosity)
        self.narrow = self.narrow + 1 if self.half_width <= self.interval else 0
        return len(self.values) >= self.least and self.narrow >= TIMES_NARROW

    @property
    def half_width(self) -> float:
        """Half-width of the interval so far; nan before the second packing."""
        return half_width(self.values)
