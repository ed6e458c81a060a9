"""Packings made by two engines from the same clouds: their difference in porosity."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from filtercake.crystals.csd import FullAndTruncated
from filtercake.packing.engines import label_of
from filtercake.results.replicates import replicates_table
from filtercake.statistics import half_width
from filtercake.study.points import Point

COLUMNS = ("point", "replicate", "engine", "porosity", "other_engine", "other_porosity", "difference")


@dataclass(frozen=True)
class Agreement:
    """Mean difference of paired packings.

    Attributes
    ----------
    engine, other : str
        The study's engine, and the other one.
    pairs : int
        Clouds of which both made an accepted packing.
    difference, ci95 : float
        Mean of the other's porosity less the study's, and the half-width of its 95 % interval (Student, paired); nan
        with fewer than two pairs.
    """

    engine: str
    other: str
    pairs: int
    difference: float
    ci95: float

    @property
    def is_nought(self) -> bool:
        """Whether the interval holds no difference; nothing is known without one."""
        return not abs(self.difference) > self.ci95

    @property
    def words(self) -> str:
        """The same in a sentence."""
        who = f"{label_of(self.other)} less {label_of(self.engine)}"
        if not np.isfinite(self.ci95):
            return f"cross-check: {who}: {self.pairs} pairs of packings are too few to tell a difference"
        value = f"{self.difference:+.4f} +- {self.ci95:.4f} in porosity ({self.pairs} packings of the same clouds)"
        verdict = "no difference is seen" if self.is_nought else "WARNING: the engines differ"
        return f"cross-check: {who}: {value}: {verdict}"


def cross_check_table(
    pairs: Iterable[tuple[Point, Point]], packings: Path, csds: Mapping[str, FullAndTruncated], sphericity: float
) -> pd.DataFrame:
    """Measure packings of the same clouds by both engines; ``COLUMNS``, one row per cloud.

    Parameters
    ----------
    pairs : iterable of (Point, Point)
        A point of the study, and the same as the other engine packs it; replicates have the same clouds.
    packings : Path
        Holds one folder per point.
    csds : mapping of str to FullAndTruncated
        The distributions.
    sphericity : float
        The study's; it decides nothing here.

    Returns
    -------
    DataFrame
        A failed packing leaves its porosity, and the difference, blank.
    """
    listed = list(pairs)
    own, other = (
        replicates_table([pair[k] for pair in listed], packings, csds, sphericity)[
            ["point", "replicate", "engine", "porosity"]
        ]
        for k in (0, 1)
    )
    names = {theirs.name: ours.name for ours, theirs in listed}
    other = other.assign(point=other["point"].map(names))
    other = other.rename(columns={"engine": "other_engine", "porosity": "other_porosity"})
    table = other.merge(own, on=["point", "replicate"], how="left")
    table["difference"] = table["other_porosity"] - table["porosity"]
    return table[list(COLUMNS)]


def agreement(table: pd.DataFrame) -> Agreement:
    """Average the differences of :func:`cross_check_table`."""
    found = table["difference"].dropna().to_numpy(np.float64)
    mean = float(found.mean()) if found.size else np.nan
    own, other = (str(table[name].dropna().iloc[0]) for name in ("engine", "other_engine"))
    return Agreement(own, other, int(found.size), mean, half_width(found))
