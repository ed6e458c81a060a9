"""Pages that are made from measurements: the prose is a template, every number comes from a table."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from filtercake.design.emulator import FARTHEST, Emulator
from filtercake.packing.engines.liggghts import Liggghts
from filtercake.permeability.measure import SPREAD
from filtercake.study import limits
from filtercake.user_files import templates
from filtercake.validation import (
    cheaper_intervals,
    emulator_design,
    emulator_evidence,
    interval_coverage,
    pressure_column,
    pressure_evidence,
    resistance_law,
)
from filtercake.validation.error_against_time import ANALYTIC, DEFAULT, reference_of
from filtercake.validation.permeability import BED, CELL, LATTICE, LAYERED, known_constant
from filtercake.validation.pressure import GRAVITY_BED, INVARIANCE, MODULUS, PATH_STRESS, PATHS
from filtercake.validation.stability import OUTCOMES, UNDECIDED, families, undetected, wrong

INTERIOR, COUNT = "interior slab", "count"
PAPER = "as published"
OK = OUTCOMES[0]
GOOD = (OK, UNDECIDED)
"""Outcomes of a case in which nothing went wrong as far as its packings can tell."""
FAILING = ("inaccurate", "unsettled", "exploded", "refused")
"""Outcomes of a case beyond a limit."""
SHALLOWEST_EXTRAPOLATED = 1.5
"""Depth, over the paper's, down to which beds must reach for an extrapolation in 1/depth."""


def reference_table(replicates: pd.DataFrame, cases: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Tabulate the reference of every case: case, porosity, standard_error, n.

    ``replicates`` are the committed reference packings; ``cases`` hold each case's ``reference`` (a study) and
    ``friction``.
    """
    rows = []
    for name, case in cases.items():
        found = reference_of(replicates, case["reference"], case["friction"])
        here = (replicates["study"] == case["reference"]) & (replicates["friction"] == case["friction"])
        rows.append((name, found.porosity, found.standard_error, int((here & (replicates["status"] == "ok")).sum())))
    return pd.DataFrame(rows, columns=["case", "porosity", "standard_error", "n"])


def benchmark(
    template: Path,
    errors: pd.DataFrame,
    references: pd.DataFrame,
    choices: pd.DataFrame,
    coverage: pd.DataFrame,
    answers: pd.DataFrame,
    data: Path,
) -> str:
    """Write the page on run time and error.

    The tables are those of :func:`filtercake.validation.error_against_time.errors` (all cases, with ``on_front``),
    :func:`reference_table`, :func:`~filtercake.validation.error_against_time.choice_table`,
    :func:`~filtercake.validation.interval_coverage.coverage` and
    :func:`~filtercake.validation.answers.answers` (with the column friction); ``data`` is the folder of the committed
    results of long computations, whose tables the page shows too.
    """
    stored = [path for path in sorted(data.glob("*.csv")) if "replicates" not in path.stem]
    tables = {path.stem: _records(pd.read_csv(path)) for path in stored}
    return _render(
        template,
        errors=_records(errors),
        references={row["case"]: row for row in _records(references)},
        choices=_records(choices),
        answers=_records(answers),
        coverage=_records(interval_coverage.summary(coverage)),
        unlike=_records(interval_coverage.unlike()),
        cheaper=_cheaper(pd.read_csv(data / "cheaper_intervals.csv")),
        headline={case: headline(errors[errors["case"] == case]) for case in errors["case"].unique()},
        said={case: said(errors[errors["case"] == case]) for case in errors["case"].unique()},
        data=tables,
    )


def _cheaper(packings: pd.DataFrame) -> dict[str, Any]:
    """Say what was tried to make intervals cheaper, and how beds go with their depth."""
    means = cheaper_intervals.depths(packings)
    deepest = means.iloc[-1]
    limits = [
        {"deepest": depth, **dict(zip(("porosity", "ci95"), cheaper_intervals.extrapolated(means, depth), strict=True))}
        for depth in means["depth"]
        if depth >= SHALLOWEST_EXTRAPOLATED
    ]
    return {
        "methods": _records(cheaper_intervals.methods(packings)),
        "depths": _records(means),
        "deepest": deepest.to_dict(),
        "limits": limits,
    }


def headline(errors: pd.DataFrame) -> dict[str, Any]:
    """Compare one case's default with the protocol as published.

    Returns
    -------
    dict
        ``default`` and, where it was run, ``published`` (by its own estimator, the count), ``times_faster``, and
        ``same_error``: the fastest variant whose error is no larger than the published protocol's (its bias, where a
        single packing has no spread), with its ``same_error_times_faster``.
    """
    interior = errors[errors["estimator"] == INTERIOR]
    found: dict[str, Any] = {"default": _only(interior[interior["axis"] == DEFAULT])}
    published = errors[(errors["axis"] == PAPER) & (errors["estimator"] == COUNT)]
    if published.empty:
        return found
    paper = _only(published)
    ours = interior[(interior["engine"] == found["default"]["engine"]) & (interior["n_failed"] == 0)]
    allowed = paper["error"] if math.isfinite(paper["error"]) else abs(paper["bias"])
    as_good = ours[ours["error"] <= allowed].sort_values("seconds")
    found |= {"published": paper, "times_faster": paper["seconds"] / found["default"]["seconds"]}
    if not as_good.empty:
        fastest = _only(as_good.head(1))
        found |= {"same_error": fastest, "same_error_times_faster": paper["seconds"] / fastest["seconds"]}
    return found


def said(errors: pd.DataFrame) -> dict[str, Any]:
    """Sum up what one case's variants say, by the interior porosity.

    Returns
    -------
    dict
        ``variants`` (how many), ``front`` (how many are on it), ``biased`` (rows whose bias is larger than its 95 %
        interval), ``failed`` (rows with failed packings) and ``analytic`` (rows of the models without packings).
    """
    interior = errors[errors["estimator"] == INTERIOR]
    analytic = interior["axis"] == ANALYTIC
    packed = interior[~analytic]
    return {
        "variants": len(packed),
        "front": int(packed["on_front"].sum()),
        "biased": _records(packed[packed["bias"].abs() > packed["bias_ci95"]]),
        "failed": _records(packed[packed["n_failed"] > 0]),
        "analytic": _records(interior[analytic]),
    }


def stability(template: Path, table: pd.DataFrame) -> str:
    """Write the page on the stress tests of all families (see :func:`filtercake.validation.stability.run`)."""
    return _render(
        template,
        outcomes=OUTCOMES,
        counts=[
            {"engine": engine, "fence": fence, "of": [int((group["outcome"] == outcome).sum()) for outcome in OUTCOMES]}
            for (engine, fence), group in table.groupby(["engine", "fence"])
        ],
        maps=[
            {"family": family, "engine": engine, "good": int(rows["outcome"].isin(GOOD).sum()), "n": len(rows)}
            | {"x_name": rows["x_name"].iloc[0], "y_name": rows["y_name"].iloc[0], "failing": failing(rows)}
            for (family, engine), rows in table.groupby(["family", "engine"], sort=False)
        ],
        limits={**vars(limits), "LIGGGHTS_RESTITUTION": Liggghts.least_restitution},
        total=len(table),
        absent=[name for name in families() if name not in set(table["family"])],
        wrong=_records(table[wrong(table)]),
        undetected=_records(undetected(table)),
        drift=float(table.loc[table["n_accepted"] > 0, "momentum_drift"].max()),
        gain=float(table.loc[table["outcome"].isin(GOOD) & (table["fence"] == "allowed"), "energy_gain"].max()),
    )


def permeability(template: Path, table: pd.DataFrame, second: pd.DataFrame) -> str:
    """Write the page on the resistance law from solved packings, one row each.

    See :func:`filtercake.validation.permeability.solve_all`; ``second`` are the same packings by another method, empty
    where there are none.
    """
    averages = resistance_law.by_case(table)
    kinds = {kind: averages[averages["kind"] == kind] for kind in (BED, CELL, LAYERED, LATTICE)}
    layers = resistance_law.layers_by_law(averages)
    return _render(
        template,
        beds=_records(kinds[BED]),
        one={row["case"]: row for row in _records(averages)},
        cells=_records(kinds[CELL].assign(known=resistance_law.van_der_hoef(kinds[CELL]["porosity"].to_numpy()))),
        layers=_records(layers),
        layer_error=float((layers["slices"] / layers["constant"] - 1.0).abs().max()),
        lattices=[{**row, "known": known_constant(row["label"], row["porosity"])} for row in _records(kinds[LATTICE])],
        sets={
            name: {
                "free": resistance_law.fit(choose(averages)),
                "cubic": resistance_law.fit(choose(averages), exponent=3.0),
                "carman": resistance_law.overall(choose(averages), "constant"),
                "eq3": resistance_law.overall(choose(averages), "eq3"),
            }
            for name, choose in resistance_law.SETS.items()
        },
        finer=_records(resistance_law.finer(table)),
        narrow=int((kinds[BED]["ci95"] <= 0.03 * kinds[BED]["constant"]).sum()),
        spread=resistance_law.spread(table),
        spread_used=SPREAD,
        paper=resistance_law.papers_mixture(float(kinds[BED].set_index("case")["constant"]["pmma_25_75"])),
        msmpr=resistance_law.MSMPR_RATIO,
        reference_porosity=resistance_law.REFERENCE_POROSITY,
        total=len(table),
        seconds=float(table["seconds"].sum()),
        second=[] if second.empty else _records(resistance_law.both_methods(table, second)),
    )


def pressure(template: Path, cells: pd.DataFrame) -> str:
    """Write the page on the pressure cell from its cells, one row for each that was brought to a stress.

    See :func:`filtercake.validation.pressure.compute` and :func:`filtercake.validation.pressure_evidence.read_cells`.
    """
    means = pressure_evidence.averages(cells)
    costs = pressure_evidence.cost(cells)
    unmet, expected = pressure_evidence.unmet(cells)
    return _render(
        template,
        total=len(cells.drop_duplicates(["case", "seed"])),
        hours=float(cells["seconds"].sum()) / 3600.0,
        rejections=pressure_evidence.rejections(cells),
        unmet=unmet,
        expected=expected,
        references=_records(pressure_evidence.references(means)),
        series=_records(pressure_evidence.friction_series(means)),
        collapse=_records(pressure_evidence.collapse(cells)),
        paths=_records(pressure_evidence.paths(cells)),
        invariance=_records(pressure_evidence.changes(cells, INVARIANCE)),
        gravity=_records(pressure_evidence.changes(cells, GRAVITY_BED)),
        columns=_records(pressure_evidence.columns(cells)),
        floor_load=pressure_column.FLOOR_LOAD,
        slices=list(itertools.pairwise(pressure_column.EDGES)),
        balance=pressure_column.BALANCE,
        slice_bias={friction: pressure_evidence.slice_bias(friction) for friction in pressure_evidence.FITS},
        costs=_records(costs),
        gains=_records(pressure_evidence.gains(costs)),
        scaling=_records(pressure_evidence.mass_scaling(cells)),
        half_width=pressure_evidence.HALF_WIDTH,
        modulus=MODULUS,
        spreads=pressure_evidence.cell_spreads(cells),
        trial={row["case"]: row for row in _records(cells[cells["seed"] == 1])},
        isostatic=pressure_evidence.contacts_without_stress(means),
        one={row["case"]: row for row in _records(means[means["section"] != PATHS])},
        path_stress=PATH_STRESS,
    )


def emulator(
    template: Path, packings: pd.DataFrame, means: pd.DataFrame, models: Mapping[str, Emulator], draw: int
) -> str:
    """Write the page on the instant estimate.

    Parameters
    ----------
    template : Path
        Its text.
    packings : DataFrame
        All packings: :func:`filtercake.validation.emulator_evidence.tabulate`.
    means : DataFrame
        Ensembles of pressure cells: :func:`filtercake.validation.pressure_evidence.averages`.
    models : mapping of str to Emulator
        Models trained on them, by protocol.
    draw : int
        Seed of what is held out.
    """
    held = emulator_evidence.held_out(models, packings, draw)
    drawn = held[held["drawn"].astype(bool)]
    return _render(
        template,
        packings=packings,
        models=models,
        wanted=emulator_evidence.WANTED,
        limit_ms=emulator_evidence.LIMIT_MS,
        pace=emulator_evidence.pace(packings),
        farthest=FARTHEST,
        verdicts=_records(emulator_evidence.verdicts(held)),
        outside=_records(drawn[drawn["outside"].fillna("") != ""]),
        missed=_records(drawn[~drawn["inside"].astype(bool)]),
        by_load={name: _records(emulator_evidence.left_one_out(packings, models[name])) for name in models},
        ranges={name: emulator_evidence.ranges(models[name]) for name in models},
        widths={name: emulator_evidence.widths(packings, name) for name in models},
        learning=_records(emulator_evidence.learning(packings, draw)),
        beyond=_records(emulator_evidence.beyond(packings)),
        ensembles=_records(emulator_evidence.ensembles(models, means)),
        beds=(emulator_design.BED_SAUTER_UM, emulator_design.BED_DENSITY, emulator_design.MOST_STICKY),
        counts=_records(emulator_evidence.counts(packings)),
    )


def failing(rows: pd.DataFrame) -> list[str]:
    """Say where along x the cases of one map fail: a text for every set of y with the same answer.

    Parameters
    ----------
    rows : DataFrame
        The cases of one family and engine: x, y, outcome.
    """
    found: dict[str, list[str]] = {}
    for y, line in rows.sort_values("x").groupby("y"):
        bad = line[line["outcome"].isin(FAILING)]
        if not bad.empty:
            where = f"{_range(bad['x'].tolist(), line['x'].tolist())} ({', '.join(bad['outcome'].unique())})"
            found.setdefault(where, []).append(f"{y:g}")
    return [f"{', '.join(ys)}: {where}" for where, ys in found.items()]


def _range(some: list[float], every: list[float]) -> str:
    """Say which of sorted values some are."""
    count = len(some)
    if count == len(every):
        return "everywhere"
    if some == every[-count:]:
        return f"from {some[0]:g}"
    if some == every[:count]:
        return f"up to {some[-1]:g}"
    return "at " + ", ".join(f"{value:g}" for value in some)


def reliability(template: Path, table: pd.DataFrame) -> str:
    """Write the page on injected faults.

    The table has one row per fault: seed and round (the sweep it hit), family, kind, target, lost, accepted, left,
    commands, equal.
    """
    groups = {str(name): group for name, group in table.groupby("family", sort=False)}
    return _render(
        template,
        total=len(table),
        whole=_outcome(table),
        families=[{"family": name, "words": _words(group), **_outcome(group)} for name, group in groups.items()],
        kinds=[
            {"family": family, "kind": kind, "target": target, **_outcome(group)}
            for (family, kind, target), group in table.groupby(["family", "kind", "target"])
        ],
    )


def _outcome(rows: pd.DataFrame) -> dict[str, int]:
    """Count faults and what became of them; a sweep's outcome is counted once for all faults that hit it."""
    sweeps = rows.drop_duplicates(["seed", "round"])
    return {
        "faults": len(rows),
        "sweeps": len(sweeps),
        **{name: int(sweeps[name].sum()) for name in ("lost", "accepted", "left")},
        "resumed": int((rows["equal"] & (rows["commands"] == 1)).sum()),
    }


def _words(rows: pd.DataFrame) -> str:
    return ", ".join(str(kind).replace("_", " ") for kind in sorted(rows["kind"].unique()))


def _render(template: Path, **values: Any) -> str:
    environment = templates(template.parent)
    environment.filters["number"] = _number
    return environment.get_template(template.name).render(**values)


def _number(value: float, form: str) -> str:
    """Write a number by a format of printf's; a dash where there is none, as of the spread of one packing."""
    return form % value if math.isfinite(value) else "–"


def _records(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(key): value for key, value in row.items()} for row in table.to_dict("records")]


def _only(rows: pd.DataFrame) -> dict[str, Any]:
    if len(rows) != 1:
        raise ValueError(f"expected one row, found {len(rows)}")
    return _records(rows)[0]
