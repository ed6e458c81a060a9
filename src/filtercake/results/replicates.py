"""Results of a study: one row per packing, then one per point with means and intervals."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from filtercake.crystals.csd import FullAndTruncated
from filtercake.errors import PackingRejected
from filtercake.filtration.compressible import CakeAverage, cake_average
from filtercake.filtration.resistance import ADDITIVE
from filtercake.packing.compression import CompressionCurve
from filtercake.packing.pack import MANIFEST, Outcome
from filtercake.packing.porosity import measure
from filtercake.packing.result import Packing, read_record
from filtercake.packing.spread import known_spread
from filtercake.permeability.replicates import RECORD, constant_of, read_solved
from filtercake.results.resistance_columns import LAW, LAW_CI95, RESISTANCES, resistance_columns
from filtercake.statistics import Spread, half_width, informed_half_width, pooled_spread
from filtercake.study.points import POINT_COLUMNS, Point
from filtercake.units import MICROMETRE

Solved = Mapping[int, Mapping[str, Any]]
"""What the flow through packings was found to be, by replicate."""
NOTHING_SOLVED: Solved = {}

PRESSED = ("porosity_at_medium", "compressibility", "load_over_strength")
"""Of pressed cakes: porosity under the whole pressure drop, exponent n of the average resistance, and x = p/p_c."""

MEASURED = (
    "porosity",
    "porosity_paper_count",
    *PRESSED[:2],
    *RESISTANCES,
)

FLOW = ("permeability_m2", "kozeny_constant", "flow_numerical_ci95", "flow_slab_ci95")
"""Of solved packings: the two, and the relative half-widths of the numerics and of a packing's size."""

KNOWN_SD, KNOWN_FREEDOM = "porosity_known_sd", "porosity_known_freedom"
"""Where an interval is asked for: what is known of the porosity's spread beforehand, and as how much it counts."""

REPLICATE_COLUMNS = (
    *POINT_COLUMNS,
    "replicate",
    "seed",
    "status",
    "reason",
    "settled",
    *MEASURED,
    LAW,
    LAW_CI95,
    *FLOW,
    PRESSED[2],
    "porosity_from_floor",
    "soft_contact_compaction",
    "pull_off_over_weight",
    "overlap_max",
    "coordination",
    "particles",
    "length_um",
    "bed_height_um",
    "steps",
    "wall_s",
    KNOWN_SD,
    KNOWN_FREEDOM,
)
SUMMARY_COLUMNS = (
    *POINT_COLUMNS,
    "n",
    "n_failed",
    "interval_reached",
    "porosity",
    "porosity_ci95",
    "porosity_paper_count",
    "porosity_paper_count_ci95",
    "porosity_at_medium",
    "porosity_at_medium_ci95",
    "compressibility",
    "compressibility_ci95",
    "load_over_strength",
    "resistance_m_kg",
    "resistance_ci95_m_kg",
    LAW,
    LAW_CI95,
    "resistance_additive_m_kg",
    "resistance_additive_ci95_m_kg",
    "resistance_carman_m_kg",
    "resistance_carman_ci95_m_kg",
    "resistance_stokes_m_kg",
    "resistance_stokes_ci95_m_kg",
    "resistance_sauter_m_kg",
    "resistance_sauter_ci95_m_kg",
    "resistance_truncated_m_kg",
    "n_flow",
    "permeability_m2",
    "permeability_ci95_m2",
    "kozeny_constant",
    "kozeny_constant_ci95",
    "soft_contact_compaction",
    "pull_off_over_weight",
    "overlap_max",
    "wall_s",
)


def replicate_row(
    point: Point,
    packing: Packing,
    csd: FullAndTruncated,
    sphericity: float,
    law: str = ADDITIVE,
    flows: Solved = NOTHING_SOLVED,
) -> dict[str, Any]:
    """Measure an accepted packing: one row of ``REPLICATE_COLUMNS``.

    The resistance is that of the full distribution; that of the truncated one is kept for comparison. Of a pressed
    cake, porosity and resistance are averages from its surface to the medium.
    """
    found, record = measure(packing, point.scene), packing.diagnostics
    pressed = _pressed(point, record)
    porosity = found.interior if pressed is None else pressed.porosity
    return {
        **point.row(),
        "replicate": record["replicate"],
        "seed": record["seed"],
        "status": "ok",
        "reason": "",
        "settled": record["settled"],
        "porosity": porosity,
        "porosity_paper_count": found.paper_count,
        **_pressed_columns(point, pressed),
        **resistance_columns(law, porosity, csd, point.scene.density, sphericity, constant_of(flows.values())),
        **_flow(flows.get(record["replicate"])),
        "porosity_from_floor": found.from_floor,
        "soft_contact_compaction": found.compaction,
        "pull_off_over_weight": np.nan if point.scene.is_pressed else point.scene.pull_off_over_weight,
        "overlap_max": record["overlap_max"],
        "coordination": record["coordination"],
        "particles": record["particles"],
        "length_um": record["length_m"] / MICROMETRE,
        "bed_height_um": record["bed_height_m"] / MICROMETRE,
        "steps": record["steps"],
        "wall_s": record["wall_s"],
        **_known(point),
    }


def replicate_rows(
    point: Point,
    outcomes: Iterable[Outcome],
    folder: Path,
    csd: FullAndTruncated,
    sphericity: float,
    law: str = ADDITIVE,
    flows: Solved = NOTHING_SOLVED,
) -> Iterator[dict[str, Any]]:
    """Measure a point's packings in its folder; a failed or damaged one is a row with a reason, blank but for that."""
    for outcome in outcomes:
        reason = outcome.reason
        if outcome.status == "ok":
            try:
                packing = Packing.load(folder / f"r{outcome.replicate}.npz")
                yield replicate_row(point, packing, csd, sphericity, law, flows)
                continue
            except PackingRejected as error:
                reason = str(error)
        who = {"replicate": outcome.replicate, "seed": outcome.seed}
        yield {**point.row(), **who, "status": "failed", "reason": reason, "settled": False, LAW: law}


def replicates_table(
    points: Iterable[Point],
    packings: Path,
    csds: Mapping[str, FullAndTruncated],
    sphericity: float,
    law: str = ADDITIVE,
    solved: Path | None = None,
) -> pd.DataFrame:
    """Measure every packing of a study, ``REPLICATE_COLUMNS``.

    ``packings`` holds one folder per point; ``sphericity`` and ``law`` are the study's, for the resistance;
    ``solved`` holds one folder per point with what its flow was found to be, where it was solved.
    """
    rows: list[dict[str, Any]] = []
    for point in points:
        folder = packings / point.packings
        outcomes = [Outcome(**entry) for entry in read_record(folder / MANIFEST)["replicates"]]
        flows = NOTHING_SOLVED if solved is None else read_solved(solved / point.packings / RECORD)
        rows += replicate_rows(point, outcomes, folder, csds[point.csd], sphericity, law, flows)
    return pd.DataFrame(rows, columns=list(REPLICATE_COLUMNS))


def summarise(replicates: pd.DataFrame) -> pd.DataFrame:
    """Average the accepted replicates of every point, with 95 % intervals; ``SUMMARY_COLUMNS``.

    A point of which every replicate failed keeps its row, with n = 0 and blank values.
    """
    rows = []
    for _, group in replicates.groupby("point", sort=False):
        good = group[group["status"] == "ok"]
        row: dict[str, Any] = {column: group.iloc[0][column] for column in POINT_COLUMNS}
        row.update(n=len(good), n_failed=len(group) - len(good), wall_s=good["wall_s"].sum())
        for column in MEASURED:
            values = good[column].to_numpy(np.float64)
            row[column] = values.mean() if values.size else np.nan
            row[_interval_name(column)] = half_width(values)
        row.update(_informed(good))
        row["interval_reached"] = _reached(row["porosity_ci95"], row["porosity_ci95_target"])
        row[LAW] = group.iloc[0][LAW]
        for column in (LAW_CI95, "load_over_strength", "soft_contact_compaction", "pull_off_over_weight"):
            row[column] = good[column].mean()
        row.update(_mean_flow(good))
        row["overlap_max"] = good["overlap_max"].max()
        rows.append(row)
    return pd.DataFrame(rows, columns=list(SUMMARY_COLUMNS))


def _known(point: Point) -> dict[str, float]:
    """Say what is known of the porosity's spread where an interval is asked for; blank elsewhere."""
    if point.porosity_ci95_target is None:
        return {KNOWN_SD: np.nan, KNOWN_FREEDOM: np.nan}
    known = known_spread(point.scene.as_packed())
    return {KNOWN_SD: known.sd, KNOWN_FREEDOM: known.freedom}


def _informed(good: pd.DataFrame) -> dict[str, float]:
    """Half-widths of a point's intervals where one is asked for: of the rule that ended its packings.

    A resistance goes with the porosity: its spread is known in the ratio in which the packings show both.
    """
    known = good.reindex(columns=[KNOWN_SD, KNOWN_FREEDOM]).dropna()
    if known.empty:
        return {}
    own = pooled_spread([good["porosity"]]).sd
    found = {_interval_name("porosity"): informed_half_width(good["porosity"], Spread(*known.iloc[0]))}
    for column in RESISTANCES if own > 0.0 else ():
        slope = pooled_spread([good[column]]).sd / own
        found[_interval_name(column)] = slope * found["porosity_ci95"]
    return found


def _pressed(point: Point, record: Mapping[str, Any]) -> CakeAverage | None:
    """Average a pressed cake; None for one that was not pressed."""
    if not point.scene.is_pressed:
        return None
    return cake_average(point.scene.load_over_strength, CompressionCurve.of(record).at)


def _pressed_columns(point: Point, cake: CakeAverage | None) -> dict[str, Any]:
    """Give the columns ``PRESSED``; blank where nothing was pressed."""
    if cake is None:
        return dict.fromkeys(PRESSED, np.nan)
    return dict(zip(PRESSED, (cake.porosity_at_medium, cake.exponent, point.scene.load_over_strength), strict=True))


def _flow(found: Mapping[str, Any] | None) -> dict[str, Any]:
    """Give the flow through one packing, ``FLOW``; blank where it was not solved."""
    if found is None:
        return dict.fromkeys(FLOW)
    return dict(
        zip(FLOW, (found[key] for key in ("permeability", "kozeny_constant", "numerical_ci95", "slab")), strict=True)
    )


def _mean_flow(good: pd.DataFrame) -> dict[str, Any]:
    """Mean flow of a point's packings, with half-widths of the numerics and of how many spheres there were."""
    found = good.dropna(subset=["kozeny_constant"])
    if found.empty:
        return {"n_flow": 0}
    slab = np.sqrt(np.sum(found["flow_slab_ci95"] ** 2)) / len(found)
    relative = float(np.hypot(slab, found["flow_numerical_ci95"].mean()))
    mean = {name: float(found[name].mean()) for name in FLOW[:2]}
    intervals = {_interval_name(name): relative * value for name, value in mean.items()}
    return {"n_flow": len(found), **mean, **intervals}


def _reached(half: float, asked: float) -> str:
    """Whether an interval is as narrow as its target ("yes", "no"); empty without a target."""
    if np.isnan(asked):
        return ""
    return "yes" if half <= asked else "no"


def _interval_name(column: str) -> str:
    name, unit = next(
        ((column.removesuffix(unit), unit) for unit in ("_m_kg", "_m2") if column.endswith(unit)), (column, "")
    )
    return f"{name}_ci95{unit}"
