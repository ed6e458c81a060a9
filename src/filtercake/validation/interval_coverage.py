"""Whether intervals asked for hold what they are of, and how many packings they take, by two rules."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake.packing.engines import ENGINES
from filtercake.packing.pack import Report
from filtercake.packing.replication import LEAST_REPLICATES, UntilNarrow
from filtercake.packing.scene import GRAVITY_PROTOCOL, Scene
from filtercake.packing.spread import FREEDOM
from filtercake.statistics import Spread, half_width, quantile
from filtercake.units import FloatArray
from filtercake.validation.error_against_time import Reference
from filtercake.validation.timing import Contender, settle_timed

SEED: Final = 3001
"""Seeds from which an interval is asked for: neither the default's nor the reference's, nor those of fitted spreads."""
MOST: Final = 64
COLUMNS: Final = ("case", "asked", "rule", "repeat", "n", "porosity", "half_width", "reached", "covered", "seconds")
KNOWN, ALONE = "known spread", "its packings alone"
"""The rule of :class:`filtercake.packing.replication.UntilNarrow`, and that of :class:`Alone`."""


RATIOS: Final = (0.5, 0.8, 1.0, 1.25, 1.5, 2.0)
TRIED_INTERVAL: Final = 0.9


class Alone:
    """The rule that took a point's packings alone: six at least, and Student's interval narrow after two on end."""

    least, on_end = 6, 2

    def __init__(self, interval: float):
        """Ask for a half-width of the 95 % interval of the mean."""
        self.interval, self.narrow = interval, 0
        self.values: list[float] = []

    def add(self, porosity: float) -> bool:
        """Take one more porosity into account; say whether that is enough."""
        self.values.append(porosity)
        self.narrow = self.narrow + 1 if self.half_width <= self.interval else 0
        return len(self.values) >= self.least and self.narrow >= self.on_end

    @property
    def half_width(self) -> float:
        """Half-width of Student's interval so far."""
        return half_width(self.values)


@dataclass(frozen=True)
class Asked:
    """What is asked for: a case's scene, its true porosity, and half-widths of its interval."""

    case: str
    scene: Scene
    reference: Reference
    intervals: tuple[float, ...]


def coverage(asked: Asked, repeats: int, report: Report = lambda _: None) -> pd.DataFrame:
    """Ask for intervals again and again, from other seeds, and see how often they hold the reference.

    Both rules are shown the same packings for every half-width, each until it has enough.

    Returns
    -------
    DataFrame
        Columns ``COLUMNS``: half-width asked for, rule, number of packings, mean and half-width, whether the half-width
        asked for was reached, whether the reference lies within half-width and its own uncertainty of the mean, seconds
        of packing.
    """
    rows = []
    for repeat in range(repeats):
        scene = replace(asked.scene, seed=SEED + repeat)
        made = Contender(scene.engine, scene, ENGINES[scene.engine]())
        waiting: dict[tuple[float, str], UntilNarrow | Alone] = {}
        for interval in asked.intervals:
            waiting[interval, KNOWN] = UntilNarrow(scene, interval)
            waiting[interval, ALONE] = Alone(interval)
        seconds = 0.0
        for replicate in range(MOST):
            found = settle_timed(made, replicate)
            seconds += found["wall_s"]
            if found["status"] != "ok":
                continue
            for (interval, name), rule in list(waiting.items()):
                if rule.add(found["porosity"]) or replicate == MOST - 1:
                    rows.append({**_row(asked, rule), "rule": name, "repeat": repeat, "seconds": seconds})
                    del waiting[interval, name]
            if not waiting:
                break
        counts = [f"{row['n']} for {row['asked']:g} ({row['rule']})" for row in rows if row["repeat"] == repeat]
        report(f"{asked.case}, repeat {repeat}: {', '.join(counts)}")
    return pd.DataFrame(rows, columns=list(COLUMNS)).sort_values(["asked", "rule", "repeat"], ignore_index=True)


def _row(asked: Asked, found: UntilNarrow | Alone) -> dict[str, Any]:
    mean, half = float(np.mean(found.values)), found.half_width
    unsure = math.hypot(half, quantile(asked.reference.freedom) * asked.reference.standard_error)
    return {
        "case": asked.case,
        "asked": found.interval,
        "n": len(found.values),
        "porosity": mean,
        "half_width": half,
        "reached": half <= found.interval,
        "covered": abs(mean - asked.reference.porosity) <= unsure,
    }


def unlike(repeats: int = 1000) -> pd.DataFrame:
    """Try both rules on normal values whose spread is another than what is known of it, without a packing.

    Returns
    -------
    DataFrame
        Columns ratio (spread over that known), then share covered and mean number of values, of the rule and of
        :class:`Alone`, asked for ``TRIED_INTERVAL`` times the known spread.
    """
    random = np.random.default_rng(SEED)
    rows = []
    for ratio in RATIOS:
        sequences = ratio * random.standard_normal((repeats, MOST))
        known, alone = (_tried(make, sequences) for make in (_Synthetic, Alone))
        rows.append((ratio, *known, *alone))
    return pd.DataFrame(rows, columns=["ratio", "covered", "n", "covered_alone", "n_alone"])


class _Synthetic(UntilNarrow):
    """The rule for values whose spread is known to be about 1."""

    def __init__(self, interval: float):
        self.interval, self.least = interval, LEAST_REPLICATES
        self.known = Spread(1.0, FREEDOM[GRAVITY_PROTOCOL])
        self.values = []


def _tried(make: Callable[[float], UntilNarrow | Alone], sequences: FloatArray) -> tuple[float, float]:
    """Return the share of sequences (m, n), of mean 0, whose interval holds it, and how many values it takes."""
    covered, count = 0, 0
    for sequence in sequences:
        rule = make(TRIED_INTERVAL)
        any(rule.add(float(value)) for value in sequence)
        covered += bool(abs(np.mean(rule.values)) <= rule.half_width)
        count += len(rule.values)
    return covered / len(sequences), count / len(sequences)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Summarise coverage by case, half-width asked for and rule.

    Returns
    -------
    DataFrame
        Columns case, asked, rule, repeats, met (reached and covered), least, most and mean number of packings, porosity
        (mean over the repeats) and its 95 % half-width, seconds (mean).
    """
    rows = []
    for (case, asked, rule), group in table.groupby(["case", "asked", "rule"], sort=False):
        count = group["n"]
        rows.append(
            {
                "case": case,
                "asked": asked,
                "rule": rule,
                "repeats": len(group),
                "met": int((group["covered"] & group["reached"]).sum()),
                "least": int(count.min()),
                "most": int(count.max()),
                "mean": float(count.mean()),
                "porosity": float(group["porosity"].mean()),
                "porosity_ci95": half_width(group["porosity"]),
                "seconds": float(group["seconds"].mean()),
            }
        )
    return pd.DataFrame(rows)
