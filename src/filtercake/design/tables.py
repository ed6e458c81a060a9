"""What comes out of a design: its record, and its tables."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from filtercake.design.outcome import Outcome
from filtercake.design.plant import Evaluated, Settings, evaluate
from filtercake.design.search import evaluated, every_design, pareto
from filtercake.design.words import COSTS, findings
from filtercake.filtration.safety import PAPER_FACTOR
from filtercake.statistics import CONFIDENCE, half_width, quantile
from filtercake.units import KILOPASCAL, MINUTE, FloatArray

TABLES: Final = ("search", "levels", "packings", "pareto", "safety", "costs")
"""Tables of a design; ``pareto`` is empty without a second objective."""
EMPTY: Final = ["residence_time_min"]
"""Columns of a table that has nothing to say."""
MOST_TRADES: Final = 200
"""Rows of the table of two objectives."""
MILLIMETRE: Final = 1e-3

TAIL: Final = 0.5 * (1.0 - CONFIDENCE)


def tables(outcome: Outcome) -> dict[str, pd.DataFrame]:
    """Tabulate a finished design, by the names of ``TABLES``."""
    return {
        "search": search_table(outcome),
        "levels": levels_table(outcome),
        "packings": outcome.packings,
        "pareto": pareto_table(outcome),
        "safety": safety_table(outcome),
        "costs": costs_table(outcome),
    }


def summary(outcome: Outcome) -> dict[str, Any]:
    """Return the outcome as plain values, fit for JSON."""
    optimum, design = outcome.optimum, outcome.task.design
    record: dict[str, Any] = {
        "objective": design.objective,
        "trade_off": design.trade_off,
        "currency": design.costs.currency,
        "cost_index": design.costs.cost_index,
        "kind": optimum.kind,
        "possible": optimum.possible,
        "resistance_law": outcome.task.study.resistance_law,
        "tolerance": outcome.problem.tolerance,
        "ended": outcome.ended,
        **outcome.made,
        "findings": [asdict(finding) for finding in findings(outcome)],
    }
    if not optimum.possible:
        return record
    flat = None if math.isnan(optimum.flat[0]) else [end / MINUTE for end in optimum.flat]
    return record | {
        "residence_time_min": _interval(optimum.residence_time, optimum.low, optimum.high, MINUTE),
        "value": _interval(optimum.value, optimum.value_low, optimum.value_high),
        "flat_min": flat,
        "shares_at_bounds": list(optimum.at_bounds),
        "best": _known(_row(optimum.choice.settings, outcome.best)),
        "porosity": float(outcome.cake.porosity),
        "resistance_m_kg": float(outcome.cake.resistance),
        "resistance_ci95_m_kg": outcome.half_width,
        "resistance_law_ci95_m_kg": outcome.law_half_width,
    }


def search_table(outcome: Outcome) -> pd.DataFrame:
    """Tabulate the best design at every residence time of the search, with 95 % intervals (low, high).

    They are those of what is known of the porosity, at the settings of its mean; those of the objective allow for
    settings that follow the porosity.
    """
    rows, before = [], outcome.task.prior.mean
    for place, choice in enumerate(outcome.choices):
        pressure = choice.pressure
        mid, low, high = (
            evaluated(outcome.problem, outcome.belief, place, choice, z) for z in (0.0, quantile(), -quantile())
        )
        values = outcome.optimum.surface[:, place]
        ends = np.quantile(values, [TAIL, 1.0 - TAIL], method="nearest") if values.size else (np.nan, np.nan)
        limits = [name for name, missed in mid.misses.items() if missed.any()]
        porosity = [float(outcome.belief.at(place, z)[pressure]) for z in (0.0, -quantile(), quantile())]
        alpha = [float(outcome.problem.resistance(place, np.array(value))) for value in porosity]
        rows.append(
            {
                **_row(choice.settings, mid),
                # of a cake as high as the filter, a denser one is more of it: the area may fall
                "filter_area_low_m2": min(float(item.filter_area) for item in (low, mid, high)),
                "filter_area_high_m2": max(float(item.filter_area) for item in (low, mid, high)),
                "porosity": porosity[0],
                "porosity_low": porosity[1],
                "porosity_high": porosity[2],
                "resistance_m_kg": alpha[0],
                "resistance_low_m_kg": alpha[2],
                "resistance_high_m_kg": alpha[1],
                "estimated_resistance_m_kg": float(
                    outcome.problem.resistance(place, np.array(before[place, pressure]))
                ),
                "objective": choice.value,
                "objective_low": float(ends[0]),
                "objective_high": float(ends[1]),
                "misses": "; ".join(limits),
            }
        )
    return pd.DataFrame(rows)


def levels_table(outcome: Outcome) -> pd.DataFrame:
    """Tabulate the residence times packed: estimate and packings beside it, at the best design's pressure drop."""
    rows, pressure = [], outcome.optimum.choice.pressure
    table = _at_pressure(outcome)
    for level, time in enumerate(outcome.task.levels):
        place = outcome.belief.levels[level]
        own = table[table["level"] == level]
        if own.empty:
            continue
        good = own[own["status"] == "ok"]
        estimate = outcome.task.estimates[level]
        mean = float(good["porosity"].mean()) if len(good) else math.nan
        half = half_width(good["porosity"].to_numpy(np.float64)) if len(good) > 1 else math.nan
        alpha, area = _sized(outcome, place, np.array([mean, mean + half, mean - half]))
        rows.append(
            {
                "residence_time_min": time,
                "engine": str(own["engine"].iloc[0]),
                "n": len(good),
                "n_failed": len(own) - len(good),
                "porosity": mean,
                "porosity_ci95": half,
                "estimated_porosity": float(estimate.porosity[pressure]),
                "estimated_porosity_ci95": quantile() * float(estimate.deviation[pressure]),
                "resistance_m_kg": alpha[0],
                "resistance_low_m_kg": alpha[1],
                "resistance_high_m_kg": alpha[2],
                "filter_area_m2": area[0],
                "filter_area_low_m2": float(np.min(area)),
                "filter_area_high_m2": float(np.max(area)),
            }
        )
    columns = ["residence_time_min", "engine", "n", "n_failed", "porosity", "porosity_ci95", "estimated_porosity"]
    columns += ["estimated_porosity_ci95", "resistance_m_kg", "resistance_low_m_kg", "resistance_high_m_kg"]
    columns += ["filter_area_m2", "filter_area_low_m2", "filter_area_high_m2"]
    return pd.DataFrame(rows, columns=columns)


def _at_pressure(outcome: Outcome) -> pd.DataFrame:
    """Rows of the packings at the best design's pressure drop."""
    table = outcome.packings
    if outcome.task.pressures.size == 1:
        return table
    own = float(outcome.optimum.choice.settings.pressure_drop) / KILOPASCAL
    return table[table["pressure_kPa"].isna() | np.isclose(table["pressure_kPa"].astype(np.float64), own)]


def _sized(outcome: Outcome, place: int, porosity: FloatArray) -> tuple[list[float], list[float]]:
    """Resistances and filter areas for porosities at a residence time, nan where there is none."""
    known = np.isfinite(porosity)
    alpha, size = np.full(porosity.shape, np.nan), np.full(porosity.shape, np.nan)
    if known.any():
        cake = outcome.problem.cake(place, porosity[known])
        alpha[known] = cake.resistance
        pressure = outcome.optimum.choice.settings.pressure_drop
        settings = replace(outcome.choices[place].settings, pressure_drop=pressure)
        size[known] = evaluate(outcome.problem.plant, settings, cake).filter_area
    return alpha.tolist(), size.tolist()


def pareto_table(outcome: Outcome) -> pd.DataFrame:
    """Tabulate the designs that no other one beats in both objectives; empty without a second one."""
    second, first = outcome.task.design.trade_off, outcome.task.design.objective
    if second is None or not outcome.optimum.possible:
        return pd.DataFrame(columns=EMPTY)
    rows: list[dict[str, Any]] = []
    for place in range(len(outcome.task.residence_times)):
        for settings, _, found in every_design(outcome.problem, outcome.belief, place):
            one, other = (np.asarray(found.objective(name)) for name in (first, second))
            shape = np.broadcast_shapes(one.shape, other.shape)
            flat = [np.broadcast_to(values, shape).ravel() for values in (one, other)]
            for k in pareto(*flat):
                index = np.unravel_index(int(k), shape)
                rows.append(
                    {"first": flat[0][k], "second": flat[1][k], **_row(_one(settings, index), _pick(found, index))}
                )
    table = pd.DataFrame(rows)
    if table.empty:
        return pd.DataFrame(columns=EMPTY)
    best = table.iloc[pareto(table["first"].to_numpy(np.float64), table["second"].to_numpy(np.float64))]
    if len(best) > MOST_TRADES:
        best = best.iloc[np.unique(np.linspace(0, len(best) - 1, MOST_TRADES).round().astype(int))]
    return best.drop(columns=["first", "second"]).reset_index(drop=True)


def safety_table(outcome: Outcome) -> pd.DataFrame:
    """Tabulate what the filter may be designed for: what was found, the interval's end, and the paper's factor."""
    if not outcome.optimum.possible:
        return pd.DataFrame(columns=EMPTY)
    safety = outcome.safety
    own = float(safety.found)
    alpha = np.array([own, own + outcome.half_width, float(safety.upper), PAPER_FACTOR * own])
    found = outcome.with_resistance(alpha)
    shifted = [outcome.by_resistance(float(factor)) for factor in alpha / own]
    holds = [
        ("as found", "nothing: half of all cakes of this kind resist more", "all errors"),
        (
            "upper end over the porosity",
            "what is not known of the packings' mean porosity",
            "the law's error, other crystals, shape, compression",
        ),
        (
            "upper end over porosity and law",
            "that, and the resistance law's own error",
            "other crystals, shape, what the packing method leaves open",
        ),
        (
            f"the paper's factor of {PAPER_FACTOR:g}",
            "a margin for all of it, whatever was found",
            "how well this cake is known",
        ),
    ]
    return pd.DataFrame(
        {
            "designed_for": [row[0] for row in holds],
            "resistance_m_kg": alpha,
            "resistance_over_found": alpha / own,
            "filter_area_m2": np.broadcast_to(found.filter_area, alpha.shape),
            "filter_installed_cost": np.broadcast_to(found.filter_installed, alpha.shape),
            "best_residence_time_min": [optimum.residence_time / MINUTE for optimum in shifted],
            "best_objective": [optimum.value for optimum in shifted],
            "holds": [row[1] for row in holds],
            "leaves_out": [row[2] for row in holds],
        }
    )


def costs_table(outcome: Outcome) -> pd.DataFrame:
    """Tabulate the best design by each cost correlation of its filter, side by side."""
    if not outcome.optimum.possible:
        return pd.DataFrame(columns=EMPTY)
    kind = outcome.optimum.choice.settings.filter_type
    own = outcome.task.filter_costs(kind)[0]
    rows = []
    for name, optimum in [(own, outcome.optimum), *outcome.by_other_costs()]:
        if not optimum.possible:
            continue
        correlation = outcome.task.correlations[name]
        plant = outcome.problem.plant
        area = float(outcome.best.filter_area)
        bought = float(correlation.purchase(np.array(area))) * plant.cost_index / correlation.cost_index
        rows.append(
            {
                "filter_costed_by": name,
                "filter_area_m2": area,
                "filter_purchase_cost": bought * plant.currency_per_usd,
                "filter_installed_cost": bought * plant.currency_per_usd * correlation.installed_factor,
                "best_residence_time_min": optimum.residence_time / MINUTE,
                "best_objective": optimum.value,
                "kind": optimum.kind,
                "source": correlation.source,
            }
        )
    return pd.DataFrame(rows)


def _interval(value: float, low: float, high: float, unit: float = 1.0) -> dict[str, float]:
    return {"value": value / unit, "low": low / unit, "high": high / unit}


def _known(row: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what is not known, which JSON cannot say."""
    return {name: value for name, value in row.items() if not (isinstance(value, float) and math.isnan(value))}


def _row(settings: Settings, found: Evaluated) -> dict[str, Any]:
    """Columns of one design."""
    row: dict[str, Any] = {
        "residence_time_min": settings.residence_time / MINUTE,
        "filter_type": settings.filter_type,
        "slurry_concentration_kg_m3": float(settings.slurry_concentration),
        "pressure_drop_kPa": float(settings.pressure_drop) / KILOPASCAL,
        "submerged_fraction": float(settings.submerged_fraction),
        "rotation_rate_rpm": float(settings.rotation_rate) * MINUTE,
        "crystallizer_volume_m3": float(found.crystallizer_volume),
        "filter_area_m2": float(found.filter_area),
        "cake_thickness_mm": float(found.cake_thickness) / MILLIMETRE,
        "medium_share": float(found.medium_share),
        "cake_moisture": float(found.cake_moisture),
    }
    for name in COSTS:
        part = name.removesuffix("_cost")
        for item in ("crystallizer", "filter"):
            row[f"{item}_{name}"] = float(getattr(found, f"{item}_{part}"))
        row[name] = row[f"crystallizer_{name}"] + row[f"filter_{name}"]
    row["costs_in_range"] = "yes" if found.in_range.all() else "no"
    return row


def _one(settings: Settings, index: tuple[np.intp, ...]) -> Settings:
    """Return one of many settings."""
    values = {name: _at(value, index) for name, value in vars(settings).items() if isinstance(value, np.ndarray)}
    return Settings(**{**vars(settings), **values})


def _pick(found: Evaluated, index: tuple[np.intp, ...]) -> Evaluated:
    """Return one of many designs."""
    values: dict[str, Any] = {
        name: np.asarray(_at(value, index)) for name, value in vars(found).items() if isinstance(value, np.ndarray)
    }
    return Evaluated(**values, misses={name: np.asarray(_at(v, index)) for name, v in found.misses.items()})


def _at(values: NDArray[Any], index: tuple[np.intp, ...]) -> Any:
    """Value of an array at an index of what it broadcasts to."""
    return values[tuple(0 if size == 1 else k for k, size in zip(index, values.shape, strict=True))].item()
