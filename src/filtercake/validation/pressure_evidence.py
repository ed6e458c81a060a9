"""What ensembles of pressure cells say: means with their errors, held against what was expected of them.

Expectations were set down before the ensembles were computed; one that does not hold is part of the evidence.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing.analytic_models import farr_groot
from filtercake.packing.representation import merge_rare
from filtercake.statistics import Spread, difference_half_width, half_width, pooled_spread, quantile, standard_error
from filtercake.units import FloatArray
from filtercake.validation.pressure import (
    ALUM_SPHERES,
    COLLAPSE,
    COLLAPSED,
    COLUMN,
    COMPARED,
    COST,
    FRICTION,
    FRICTIONS,
    INVARIANCE,
    PATHS,
    SCALING,
    UNIAXIAL,
    alum,
    pmma,
)
from filtercake.validation.pressure_column import EDGES, SLICES

CELL_COLUMNS: Final = ("section", "case", "label", "spheres", "friction", "cohesion_kJ_m3", "stress_Pa", "load")
"""What an ensemble, or a stage of it, has in common."""
SPHERES: Final = 2000
"""Of the packing whose spread stands for all."""
SAME: Final = {0.0: 0.003, 0.05: 0.003, 0.3: 0.005}
"""Differences in porosity up to which cells of one x are the same, by friction."""
UNMOVED: Final = {0.0: 0.002, 0.05: 0.002, 0.3: 0.005}
"""Changes of porosity up to which a cell does not depend on how it was made, by friction."""
SHARP: Final = 0.0007
"""Standard error that each mean of the tables of collapse and invariance should have."""
AS_COLUMN: Final = 0.004
"""Difference of a column's slice from cells of the same load up to which they are the same."""
COLUMN_COHESION: Final = 50.0
"""Cohesion of columns, kJ/m3, and of the cells that they are held against."""
NARROW: Final = 0.0012
"""Largest standard deviation of one packing of 2000, without friction."""
HALF_WIDTH: Final = 0.002
"""Half-width of the 95 % interval of the porosity for which costs are compared."""
GAIN: Final = {"pmma": 2.0, "alum": 5.0}
"""How many times cheaper than a settled bed a cell should be."""
STRESSES: Final = ("one_size_low", "one_size", "one_size_high")
"""Cases of one size by rising stress."""
QUANTITIES: Final = {"porosity": "porosity", "backbone": "contacts without rattlers"}
CONTACTS: Final = (6.0, 6.2)
"""Mean number of contacts without rattlers, without friction: 6 in the limit of no stress."""
RANDOM_CLOSE: Final = 0.36
NEAR_FARR_GROOT: Final = 0.007
FITS: Final = {0.0: (0.3105, 0.5145, 0.064, 0.789), 0.05: (0.3354, 0.4807, 1.54, 0.911)}
"""Porosity at a high and at no load, and a and b of ``e + (e0 - e)/(1 + (x/a)^b)``, by friction: an earlier program."""
LOOSE: Final = (0.55, 0.57)
"""Solids of spheres of one size at friction 1 in the limit of rigid spheres (Silbert, Soft Matter 6 (2010) 2918)."""
CLOSE: Final = 0.64
"""The same without friction."""


def read_cells(path: Path) -> pd.DataFrame:
    """Read a table of :func:`filtercake.validation.pressure.compute`."""
    cells = pd.read_csv(path, dtype={"reason": str})
    return cells.assign(reason=cells["reason"].fillna(""))


def accepted(cells: pd.DataFrame) -> pd.DataFrame:
    """Rows of accepted packings."""
    return cells[cells["reason"] == ""]


def averages(cells: pd.DataFrame) -> pd.DataFrame:
    """Average each ensemble, and each stage of those that are led.

    Returns
    -------
    DataFrame
        ``CELL_COLUMNS``, n (accepted), rejected, porosity, sd (of one packing), se (of the mean), and means of
        coordination, backbone (contacts without rattlers), rattlers (share), steps and seconds.
    """
    rows = []
    for key, group in cells.groupby(list(CELL_COLUMNS), sort=False, dropna=False):
        good = accepted(group)
        values = good["porosity"].to_numpy(np.float64)
        rows.append(
            {
                **dict(zip(CELL_COLUMNS, key, strict=True)),
                "n": values.size,
                "rejected": len(group) - values.size,
                "porosity": float(good["porosity"].mean()),
                "sd": float(values.std(ddof=1)) if values.size > 1 else math.nan,
                "se": standard_error(values),
                **{name: good[name].mean() for name in ("coordination", "backbone", "rattlers", "steps", "seconds")},
            }
        )
    return pd.DataFrame(rows)


def references(means: pd.DataFrame) -> pd.DataFrame:
    """Hold frictionless cells against known values: random close packing, Farr and Groot, the number of contacts.

    Returns
    -------
    DataFrame
        Of each comparison the ensemble's average, quantity, value, its standard error, expected, tolerance, source,
        difference and whether it ``holds``.
    """
    listed = means.set_index("case")
    known: list[tuple[str, str, float, float, str]] = [
        ("one_size", "porosity", RANDOM_CLOSE, 0.003, "random close packing"),
        ("pmma_load_100", "porosity", 0.312, 0.003, "an earlier program"),
    ]
    for case, csd, spheres in _distributions():
        packed = merge_rare(csd, spheres)
        known.append((case, "porosity", farr_groot(packed), NEAR_FARR_GROOT, "Farr and Groot"))
    middle, half = 0.5 * sum(CONTACTS), 0.5 * (CONTACTS[1] - CONTACTS[0])
    known += [(case, "backbone", middle, half, "isostatic") for case in ("one_size_low", "one_size", "one_size_high")]
    rows = []
    for case, quantity, expected, tolerance, source in known:
        row = listed.loc[[case]].to_dict("records")[0]
        value = float(row[quantity])
        difference = value - expected
        rows.append(
            {
                **{str(name): part for name, part in row.items()},
                "case": case,
                "quantity": quantity,
                "value": value,
                "expected": expected,
                "tolerance": tolerance,
                "source": source,
                "difference": difference,
                "holds": abs(difference) <= tolerance,
            }
        )
    return pd.DataFrame(rows)


def _distributions() -> list[tuple[str, CrystalSizeDistribution, int]]:
    return [
        ("pmma_75_25", pmma(0.75), 2000),
        ("pmma_50_50", pmma(0.5), 2000),
        ("pmma_25_75", pmma(0.25), 2000),
        ("alum", alum(), ALUM_SPHERES),
    ]


def contacts_without_stress(means: pd.DataFrame) -> float:
    """Extrapolate the contacts of one size without rattlers to no stress, straight in the cube root of the stress.

    Contacts of Hertz overlap by the power 2/3 of the stress, and new ones come with the root of the overlap.
    """
    rows = means[means["case"].isin(STRESSES)]
    return float(
        np.polyfit(np.cbrt(rows["stress_Pa"].to_numpy(np.float64)), rows["backbone"].to_numpy(np.float64), 1)[1]
    )


def friction_series(means: pd.DataFrame) -> pd.DataFrame:
    """One size against friction: averages and solids."""
    rows = means[means["section"] == FRICTION].sort_values("friction")
    return rows.assign(solids=1.0 - rows["porosity"])


def led(cells: pd.DataFrame) -> pd.DataFrame:
    """Average the ways to a load, with 95 % half-widths from the spread of one packing, pooled by friction.

    Returns
    -------
    DataFrame
        The averages, and ``ci95``.
    """
    rows, spreads = averages(cells[cells["section"] == PATHS]), cell_spreads(cells)
    one = [spreads[friction] for friction in rows["friction"]]
    half = [quantile(each.freedom) * each.sd / math.sqrt(max(n, 1)) for each, n in zip(one, rows["n"], strict=True)]
    return rows.assign(ci95=half)


@dataclass(frozen=True)
class Ensemble:
    """Mean of accepted packings.

    Attributes
    ----------
    porosity : float
        Mean.
    n, rejected : int
        Accepted and rejected packings.
    weight : float
        Packings of 2000 spheres whose mean would be as sharp.
    """

    porosity: float
    n: int
    rejected: int
    weight: float


def ensemble(cells: pd.DataFrame) -> Ensemble:
    """Average rows of one ensemble."""
    good = accepted(cells)
    weight = float(good["spheres"].sum()) / SPHERES
    return Ensemble(float(good["porosity"].mean()), len(good), len(cells) - len(good), weight)


def spread(cells: pd.DataFrame) -> Spread:
    """Pool the standard deviation of one packing of 2000 spheres over ensembles, and stages of those that are led.

    The variance of one packing goes as one over its spheres.
    """
    good = accepted(cells).drop_duplicates(["seed", "spheres", "friction", "stress_Pa", "porosity"])
    scaled = good["porosity"] * np.sqrt(good["spheres"] / SPHERES)
    groups = scaled.groupby([good["case"], good["load"].round(6)], dropna=False)
    return pooled_spread([values.to_numpy(np.float64) for _, values in groups])


def cell_spreads(cells: pd.DataFrame) -> dict[float, Spread]:
    """Pool :func:`spread` of 50/50 PMMA by friction, over all loads and ways to make a cell."""
    here = cells[cells["section"].isin([COLLAPSE, PATHS, INVARIANCE])]
    return {friction: spread(here[here["friction"] == friction]) for friction in FRICTIONS}


def collapse(cells: pd.DataFrame) -> pd.DataFrame:
    """Hold cohesions against each other at the same x.

    Returns
    -------
    DataFrame
        By friction and load: porosity of both, the larger standard error of the two, difference, its 95 % half-width,
        ``holds``.
    """
    rows, spreads = [], cell_spreads(cells)
    here = cells[cells["section"] == COLLAPSE]
    for friction, load in itertools.product(FRICTIONS, COLLAPSED):
        group = here[(here["friction"] == friction) & np.isclose(here["load"], load)]
        weak, strong = (ensemble(part) for _, part in group.groupby("cohesion_kJ_m3"))
        found, limit = _change(weak, strong, spreads[friction]), SAME[friction]
        rows.append(
            {
                "friction": friction,
                "load": load,
                "n": min(weak.n, strong.n),
                "rejected": weak.rejected + strong.rejected,
                "weak": weak.porosity,
                "strong": strong.porosity,
                "se": max(_error(weak, spreads[friction]), _error(strong, spreads[friction])),
                **found,
                "limit": limit,
                "holds": abs(found["change"]) <= limit,
            }
        )
    return pd.DataFrame(rows)


def paths(cells: pd.DataFrame) -> pd.DataFrame:
    """Hold three ways to an x against each other: stress raised, cohesion weakened, at once.

    Returns
    -------
    DataFrame
        By friction and load: mean and number of each way, ``apart`` (the two led ways, the second minus the first),
        ``ahead`` (at once minus the mean of both; nan at the first load, which both ways start from), 95 % half-widths,
        and whether each holds.
    """
    rows, spreads = [], cell_spreads(cells)
    here = cells[cells["section"] == PATHS]
    for friction, load in itertools.product(FRICTIONS, COMPARED):
        group = here[(here["friction"] == friction) & np.isclose(here["load"], load)]
        raised, weakened, direct, led = (
            ensemble(group[group["case"].str.startswith(way)])
            for way in ("stress_", "cohesion_", "direct_", ("stress_", "cohesion_"))
        )
        apart, ahead = _change(raised, weakened, spreads[friction]), _change(led, direct, spreads[friction])
        limit = SAME[friction]
        row: dict[str, Any] = {"friction": friction, "load": load, "limit": limit}
        for name, each in (("raised", raised), ("weakened", weakened), ("direct", direct)):
            row |= {f"n_{name}": each.n, f"rejected_{name}": each.rejected, name: each.porosity}
        row |= {"apart": apart["change"], "apart_ci95": apart["ci95"], "apart_holds": abs(apart["change"]) <= limit}
        row |= {"ahead": ahead["change"], "ahead_ci95": ahead["ci95"], "ahead_holds": not abs(ahead["change"]) > limit}
        rows.append(row)
    return pd.DataFrame(rows)


def changes(cells: pd.DataFrame, section: str) -> pd.DataFrame:
    """Hold each way to make a cell, or a bed, against the one that is usual.

    Returns
    -------
    DataFrame
        By friction: label, n, rejected, porosity, se, change, its 95 % half-width, limit, holds; the usual one first.
        Errors follow from the spread of one packing, pooled over all ways of the friction.
    """
    rows = []
    here = cells[cells["section"] == section]
    for friction in sorted(here["friction"].unique()):
        group = here[here["friction"] == friction]
        one = cell_spreads(cells)[friction] if section == INVARIANCE else spread(group)
        usual: Ensemble | None = None
        for label, part in group.groupby("label", sort=False):
            mine = ensemble(part)
            found = {"change": 0.0, "ci95": math.nan} if usual is None else _change(usual, mine, one)
            usual = usual or mine
            limit = UNMOVED[friction]
            row = {
                "friction": friction,
                "label": label,
                "n": mine.n,
                "rejected": mine.rejected,
                "porosity": mine.porosity,
            }
            row |= {"se": _error(mine, one), **found, "limit": limit}
            rows.append(row | {"holds": abs(found["change"]) <= limit})
    return pd.DataFrame(rows)


def columns(cells: pd.DataFrame) -> pd.DataFrame:
    """Hold slices of columns under raised gravity against cells of the same load.

    Returns
    -------
    DataFrame
        By friction and load: n, rejected, porosity of the slices, its 95 % half-width; of cells pressed from all sides
        and along one axis (``cell`` and ``axial``) n, porosity, 95 % half-width, and change (slice minus cell) with its
        own; and ``limit`` and ``holds`` where something was expected. Empty where there are no columns.
    """
    rows = []
    here = cells[cells["cohesion_kJ_m3"] == COLUMN_COHESION]
    for friction, load in itertools.product(FRICTIONS, SLICES):
        same = here[(here["friction"] == friction) & np.isclose(here["load"], load)]
        group = same[same["section"] == COLUMN]
        if group.empty:
            continue
        mine = accepted(group)["porosity"]
        row: dict[str, Any] = {"friction": friction, "load": load, "n": len(mine), "rejected": len(group) - len(mine)}
        row |= {"porosity": float(mine.mean()), "ci95": half_width(mine), "limit": math.nan, "holds": True}
        for name, ways in (("cell", same[same["section"] == COLLAPSE]), ("axial", same[same["label"] == UNIAXIAL])):
            other = accepted(ways)["porosity"]
            row |= {f"n_{name}": len(other), name: float(other.mean()), f"{name}_ci95": half_width(other)}
            row[f"{name}_change"] = row["porosity"] - row[name]
            row[f"{name}_change_ci95"] = difference_half_width(mine, other)
        if load == SLICES[-1]:
            row |= {"limit": AS_COLUMN, "holds": abs(row["cell_change"]) <= AS_COLUMN}
        rows.append(row)
    return pd.DataFrame(rows)


def slice_bias(friction: float) -> float:
    """Porosity averaged over the loads of a column's lowest slice, less that at its mean load, by the earlier fit."""
    loads = np.linspace(*EDGES[-2:], 601)
    return float(fitted(loads, friction).mean() - fitted(np.array([SLICES[-1]]), friction)[0])


def cost(cells: pd.DataFrame) -> pd.DataFrame:
    """Work out what a 95 % half-width of ``HALF_WIDTH`` costs by each way to pack.

    Returns
    -------
    DataFrame
        The averages, ``material``, ``settled`` (whether by gravity), ``seconds_for`` (time times variance, over the
        variance that is allowed; the variance of one packing is pooled over sizes of the box, see :func:`spread`), and
        of cells ``gain``: how many times cheaper than the material's cheapest settled bed, with the factor
        ``gain_factor`` of its 95 % interval.
    """
    timed = cells[cells["section"] == COST]
    rows = averages(timed)
    rows["material"] = rows["case"].str.split("_").str[0]
    rows["settled"] = rows["case"].str.contains("gravity")
    spreads = {
        key: spread(timed[timed["case"].isin(group["case"])]) for key, group in rows.groupby(["material", "settled"])
    }
    mine = [spreads[key] for key in zip(rows["material"], rows["settled"], strict=True)]
    variance = np.array([one.sd**2 for one in mine]) * SPHERES / rows["spheres"].to_numpy(np.float64)
    rows["freedom"] = [one.freedom for one in mine]
    rows["seconds_for"] = rows["seconds"] * variance * (quantile() / HALF_WIDTH) ** 2
    rows["gain"], rows["gain_factor"] = math.nan, math.nan
    for material in rows["material"].unique().tolist():
        best = rows[(rows["material"] == material) & rows["settled"]].sort_values("seconds_for").iloc[0]
        others = rows.index[(rows["material"] == material) & ~rows["settled"]]
        rows.loc[others, "gain"] = best["seconds_for"] / rows.loc[others, "seconds_for"]
        # of the ratio of two estimated variances
        doubt = 2.0 / best["freedom"] + 2.0 / rows.loc[others, "freedom"]
        rows.loc[others, "gain_factor"] = np.exp(quantile() * np.sqrt(doubt))
    return rows


def gains(costs: pd.DataFrame) -> pd.DataFrame:
    """Take the best cell of each material: its row of :func:`cost` with ``wanted`` and ``holds``."""
    cells = costs[~costs["settled"]]
    best = cells.sort_values("gain", ascending=False).groupby("material", sort=False).head(1).sort_index()
    wanted = best["material"].map(GAIN)
    return best.assign(wanted=wanted, holds=best["gain"] >= wanted)


def mass_scaling(cells: pd.DataFrame) -> pd.DataFrame:
    """Hold scaled against unscaled masses: porosities, change, 95 % half-width, steps and seconds."""
    rows = []
    for label, group in cells[cells["section"] == SCALING].groupby("label", sort=False):
        scaled = group["case"].str.endswith("_scaled")
        row: dict[str, Any] = {"label": label, "spheres": int(group["spheres"].iloc[0])}
        for name, part in (("plain", group[~scaled]), ("scaled", group[scaled])):
            mine, good = ensemble(part), accepted(part)
            row |= {name: mine.porosity, f"n_{name}": mine.n, f"rejected_{name}": mine.rejected}
            row |= {f"{what}_{name}": good[what].mean() for what in ("steps", "seconds")}
        rows.append(row | _change(ensemble(group[~scaled]), ensemble(group[scaled]), spread(group)))
    return pd.DataFrame(rows)


def _error(mean: Ensemble, one: Spread) -> float:
    """Work out the standard error of a mean from the spread of one packing of 2000."""
    return one.sd / math.sqrt(mean.weight) if mean.n else math.nan


def _change(usual: Ensemble, other: Ensemble, one: Spread) -> dict[str, float]:
    """Difference of two means and the half-width of its 95 % interval, from the spread of one packing of 2000."""
    if not (usual.n and other.n):
        return {"change": math.nan, "ci95": math.nan}
    error = math.hypot(_error(usual, one), _error(other, one))
    return {"change": other.porosity - usual.porosity, "ci95": quantile(one.freedom) * error}


def fitted(load: FloatArray, friction: float) -> FloatArray:
    """Porosity at loads x by the fit of an earlier program, for a friction of ``FITS``."""
    high, none, middle, exponent = FITS[friction]
    return np.asarray(high + (none - high) / (1.0 + (load / middle) ** exponent))


def rejections(cells: pd.DataFrame) -> list[dict[str, Any]]:
    """List every rejected packing: section, case, label, friction, seed, spheres, porosity, steps, reason."""
    columns = ["section", "case", "label", "friction", "seed", "spheres", "porosity", "steps", "reason"]
    return [
        {str(key): value for key, value in row.items()}
        for row in cells.loc[cells["reason"] != "", columns].to_dict("records")
    ]


def unmet(cells: pd.DataFrame) -> tuple[list[str], int]:
    """Say which expectations do not hold, a sentence each, and how many there are in all."""
    means = averages(cells)
    said = [
        *_said_of_references(means),
        *_said_of_friction(means),
        *_said_of_loads(cells),
        *_said_of_changes(changes(cells, INVARIANCE)),
        *_said_of_columns(columns(cells)),
        *_said_of_cost(cells),
    ]
    return [text for holds, text in said if not holds], len(said)


_Said = list[tuple[bool, str]]
"""Whether an expectation holds, and what to say if it does not."""


def _said_of_references(means: pd.DataFrame) -> _Said:
    return [
        (
            row["holds"],
            f"{row['label']}: {QUANTITIES[row['quantity']]} {row['value']:.4f}, expected {row['expected']:.4f} within "
            f"{row['tolerance']:.2g} ({row['source']})",
        )
        for row in _rows(references(means))
    ]


def _said_of_friction(means: pd.DataFrame) -> _Said:
    series = {row["friction"]: row["solids"] for row in _rows(friction_series(means))}
    return [
        (
            low <= series[friction] <= high,
            f"solids at friction {friction:g}: {series[friction]:.3f}, {low} to {high} expected",
        )
        for friction, low, high in ((0.0, CLOSE - 0.003, CLOSE + 0.003), (1.0, *LOOSE))
    ]


def _said_of_loads(cells: pd.DataFrame) -> _Said:
    same = collapse(cells)
    said = _said_of_errors(same, "two cohesions")
    for row in _rows(same):
        where = f"x = {row['load']:g}, friction {row['friction']:g}"
        said.append((row["holds"], _too_far(f"30 and 50 kJ/m3, {where}", row["change"], row["ci95"], row["limit"])))
    for row in _rows(paths(cells)):
        where = f"x = {row['load']:g}, friction {row['friction']:g}"
        name = f"cohesion weakened against stress raised, {where}"
        said.append((row["apart_holds"], _too_far(name, row["apart"], row["apart_ci95"], row["limit"])))
        if math.isfinite(row["ahead"]):
            name = f"pressed at once against led, {where}"
            said.append((row["ahead_holds"], _too_far(name, row["ahead"], row["ahead_ci95"], row["limit"])))
    return said


def _said_of_changes(table: pd.DataFrame) -> _Said:
    return _said_of_errors(table, "ways to make a cell") + [
        (
            row["holds"],
            _too_far(f"{row['label']}, friction {row['friction']:g}", row["change"], row["ci95"], row["limit"]),
        )
        for row in _rows(table)
        if math.isfinite(row["ci95"])
    ]


def _said_of_errors(table: pd.DataFrame, what: str) -> _Said:
    said = []
    for friction, group in table.groupby("friction"):
        worst = float(group["se"].max())
        text = f"standard errors of {what} at friction {friction:g}: up to {worst:.4f}, at most {SHARP} wanted"
        said.append((worst <= SHARP, f"{text}, for want of cells"))
    return said


def _said_of_columns(table: pd.DataFrame) -> _Said:
    return [
        (
            row["holds"],
            _too_far(
                f"column against cells, x = {row['load']:g}, friction {row['friction']:g}",
                row["cell_change"],
                row["cell_change_ci95"],
                row["limit"],
            ),
        )
        for row in _rows(table)
        if math.isfinite(row["limit"])
    ]


def _said_of_cost(cells: pd.DataFrame) -> _Said:
    costs = cost(cells)
    spread = float(costs.loc[costs["case"] == "pmma_cell_2000", "sd"].iloc[0])
    said = [(spread <= NARROW, f"standard deviation of one cell of 2000: {spread:.4f}, at most {NARROW} expected")]
    for row in _rows(gains(costs)):
        name = f"{row['label']}: {row['gain']:.2g} times cheaper than a settled bed"
        said.append((row["holds"], f"{name}, at least {row['wanted']:g} wanted"))
    return said


def _too_far(name: str, change: float, ci95: float, limit: float) -> str:
    return f"{name}: {change:+.4f} +- {ci95:.4f}, at most {limit} expected"


def _rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(key): value for key, value in row.items()} for row in table.to_dict("records")]
