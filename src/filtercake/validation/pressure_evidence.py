"""What ensembles of pressure cells say: means with their errors, held against what was expected of them.

Expectations were set down before the ensembles were computed; one that does not hold is part of the evidence.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing.analytic_models import farr_groot
from filtercake.packing.representation import merge_rare
from filtercake.statistics import difference_half_width, quantile, standard_error
from filtercake.units import FloatArray
from filtercake.validation.pressure import (
    ALUM_SPHERES,
    COLLAPSE,
    COLLAPSED,
    COMPARED,
    COST,
    FRICTION,
    FRICTIONS,
    INVARIANCE,
    PATHS,
    SCALING,
    alum,
    pmma,
)

CELL_COLUMNS: Final = ("section", "case", "label", "spheres", "friction", "cohesion_kJ_m3", "stress_Pa", "load")
"""What an ensemble, or a stage of it, has in common."""
SAME: Final = {0.0: 0.003, 0.05: 0.003, 0.3: 0.005}
"""Differences in porosity up to which cells of one x are the same, by friction."""
UNMOVED: Final = {0.0: 0.002, 0.05: 0.002, 0.3: 0.005}
"""Changes of porosity up to which a cell does not depend on how it was made, by friction."""
SHARP: Final = 0.0007
"""Standard error that each mean of the table of invariance should have."""
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
    cells = pd.read_csv(path)
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
                "porosity": _mean(values),
                "sd": float(values.std(ddof=1)) if values.size > 1 else math.nan,
                "se": standard_error(values),
                **{name: good[name].mean() for name in ("coordination", "backbone", "rattlers", "steps", "seconds")},
            }
        )
    return pd.DataFrame(rows)


def _of(cells: pd.DataFrame, case: str, load: float | None = None) -> FloatArray:
    """Porosities of a case's accepted packings, at one load of several."""
    rows = accepted(cells[cells["case"] == case])
    if load is not None:
        rows = rows[np.isclose(rows["load"], load, rtol=1e-6)]
    return rows["porosity"].to_numpy(np.float64)


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


def collapse(cells: pd.DataFrame) -> pd.DataFrame:
    """Hold cohesions against each other at the same x: porosity of both, difference, its 95 % half-width, ``holds``."""
    rows = []
    here = cells[cells["section"] == COLLAPSE]
    for friction, load in itertools.product(FRICTIONS, COLLAPSED):
        group = here[(here["friction"] == friction) & np.isclose(here["load"], load)]
        weak, strong = (accepted(part)["porosity"].to_numpy() for _, part in group.groupby("cohesion_kJ_m3"))
        found = _difference(weak, strong)
        limit = SAME[friction]
        rows.append(
            {
                "friction": friction,
                "load": load,
                "n": min(weak.size, strong.size),
                "rejected": len(group) - weak.size - strong.size,
                "weak": _mean(weak),
                "strong": _mean(strong),
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
        By friction and load: mean and standard error of each way, ``apart`` (the two led ways, the second minus the
        first), ``ahead`` (at once minus the mean of both; nan at the first load, which both ways start from), 95 %
        half-widths, and whether each holds.
    """
    here = cells[cells["section"] == PATHS]
    rows = []
    for friction in FRICTIONS:
        for load in COMPARED:
            raised = _of(here, f"stress_{friction:g}", load)
            weakened = _of(here, f"cohesion_{friction:g}", load)
            direct = _of(here, f"direct_{friction:g}_x{load:g}")
            led, at_once = _difference(raised, weakened), _difference(np.concatenate([raised, weakened]), direct)
            row: dict[str, Any] = {"friction": friction, "load": load, "limit": SAME[friction]}
            for name, values in (("raised", raised), ("weakened", weakened), ("direct", direct)):
                row |= {f"n_{name}": values.size, name: _mean(values), f"se_{name}": standard_error(values)}
            row |= {
                "apart": led["change"],
                "apart_ci95": led["ci95"],
                "apart_holds": abs(led["change"]) <= row["limit"],
            }
            row |= {"ahead": at_once["change"], "ahead_ci95": at_once["ci95"]}
            rows.append(row | {"ahead_holds": not abs(at_once["change"]) > row["limit"]})
    return pd.DataFrame(rows)


def changes(cells: pd.DataFrame, section: str) -> pd.DataFrame:
    """Hold each way to make a cell, or a bed, against the one that is usual.

    Returns
    -------
    DataFrame
        By friction: label, n, rejected, porosity, sd, se, change, ci95 (Welch), limit, holds; the usual one first.
    """
    rows = []
    here = cells[cells["section"] == section]
    for friction in sorted(here["friction"].unique()):
        group = here[here["friction"] == friction]
        usual: FloatArray | None = None
        for label, part in group.groupby("label", sort=False):
            values = accepted(part)["porosity"].to_numpy(np.float64)
            usual = values if usual is None else usual
            found = _difference(usual, values)
            limit = UNMOVED[friction]
            rows.append(
                {
                    "friction": friction,
                    "label": label,
                    "n": values.size,
                    "rejected": len(part) - values.size,
                    "porosity": _mean(values),
                    "sd": values.std(ddof=1) if values.size > 1 else math.nan,
                    "se": standard_error(values),
                    **found,
                    "limit": limit,
                    "holds": abs(found["change"]) <= limit,
                    "steps": accepted(part)["steps"].mean(),
                }
            )
    return pd.DataFrame(rows)


def cost(means: pd.DataFrame) -> pd.DataFrame:
    """Work out what a 95 % half-width of ``HALF_WIDTH`` costs by each way to pack.

    Returns
    -------
    DataFrame
        The averages, ``material``, ``settled`` (whether by gravity), ``seconds_for`` (time times variance, over the
        variance that is allowed), and of cells ``gain``: how many times cheaper than the material's cheapest settled
        bed, with the factor ``gain_factor`` of its 95 % interval.
    """
    rows = means[means["section"] == COST].copy()
    rows["material"] = rows["case"].str.split("_").str[0]
    rows["settled"] = rows["case"].str.contains("gravity")
    rows["seconds_for"] = rows["seconds"] * (quantile() * rows["sd"] / HALF_WIDTH) ** 2
    rows["gain"], rows["gain_factor"] = math.nan, math.nan
    for material in rows["material"].unique().tolist():
        beds = rows[(rows["material"] == material) & rows["settled"]]
        best = beds.sort_values("seconds_for").iloc[0]
        cells = rows.index[(rows["material"] == material) & ~rows["settled"]]
        rows.loc[cells, "gain"] = best["seconds_for"] / rows.loc[cells, "seconds_for"]
        # of the ratio of two estimated variances
        doubt = 2.0 / (best["n"] - 1.0) + 2.0 / (rows.loc[cells, "n"] - 1.0)
        rows.loc[cells, "gain_factor"] = np.exp(quantile() * np.sqrt(doubt))
    return rows


def gains(costs: pd.DataFrame) -> pd.DataFrame:
    """Take the best cell of each material: its row of :func:`cost` with ``wanted`` and ``holds``."""
    cells = costs[~costs["settled"]]
    best = cells.sort_values("gain", ascending=False).groupby("material", sort=False).head(1).sort_index()
    wanted = best["material"].map(GAIN)
    return best.assign(wanted=wanted, holds=best["gain"] >= wanted)


def mass_scaling(cells: pd.DataFrame) -> pd.DataFrame:
    """Hold scaled against unscaled masses: porosities, change, 95 % half-width, steps and seconds saved (ratios)."""
    rows = []
    for label, group in cells[cells["section"] == SCALING].groupby("label", sort=False):
        scaled = group["case"].str.endswith("_scaled")
        parts = {"scaled": accepted(group[scaled]), "plain": accepted(group[~scaled])}
        values = {name: part["porosity"].to_numpy(np.float64) for name, part in parts.items()}
        found = _difference(values["plain"], values["scaled"])
        row = {
            "label": label,
            "spheres": int(group["spheres"].iloc[0]),
            **{f"n_{name}": part.size for name, part in values.items()},
            **{
                f"rejected_{name}": len(group[scaled == (name == "scaled")]) - part.size
                for name, part in values.items()
            },
            **{name: _mean(part) for name, part in values.items()},
            **found,
            **{f"steps_{name}": part["steps"].mean() for name, part in parts.items()},
            **{f"seconds_{name}": part["seconds"].mean() for name, part in parts.items()},
        }
        rows.append(row)
    return pd.DataFrame(rows)


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if values.size else math.nan


def _difference(usual: FloatArray, other: FloatArray) -> dict[str, float]:
    if not (usual.size and other.size):
        return {"change": math.nan, "ci95": math.nan}
    same = usual is other
    return {
        "change": float(other.mean() - usual.mean()),
        "ci95": math.nan if same else difference_half_width(usual, other),
    }


def fitted(load: FloatArray, friction: float) -> FloatArray:
    """Porosity at loads x by the fit of an earlier program, for a friction of ``FITS``."""
    high, none, middle, exponent = FITS[friction]
    return np.asarray(high + (none - high) / (1.0 + (load / middle) ** exponent))


def rejections(cells: pd.DataFrame) -> list[dict[str, Any]]:
    """List every rejected packing: section, label, friction, seed, spheres, reason."""
    columns = ["section", "label", "friction", "seed", "spheres", "reason"]
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
        *_said_of_cost(means),
    ]
    return [text for holds, text in said if not holds], len(said)


_Said = list[tuple[bool, str]]
"""Whether an expectation holds, and what to say if it does not."""


def _said_of_references(means: pd.DataFrame) -> _Said:
    return [
        (
            row["holds"],
            f"{row['label']}: {QUANTITIES[row['quantity']]} {row['value']:.4g}, expected {row['expected']:.4g} within "
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
    said = []
    for row in _rows(collapse(cells)):
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
    said = []
    for row in _rows(table):
        where = f"{row['label']}, friction {row['friction']:g}"
        if math.isfinite(row["ci95"]):
            said.append((row["holds"], _too_far(where, row["change"], row["ci95"], row["limit"])))
        said.append((row["se"] <= SHARP, f"{where}: standard error {row['se']:.4f}, at most {SHARP} wanted"))
    return said


def _said_of_cost(means: pd.DataFrame) -> _Said:
    costs = cost(means)
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
