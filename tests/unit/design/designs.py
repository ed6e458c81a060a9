"""Designs for tests, and packings that nobody made: the instant estimate and a deviation from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from filtercake.design import tables as tabulate
from filtercake.design.loading import load_design
from filtercake.design.outcome import Outcome
from filtercake.design.task import Task
from filtercake.packing.result import write_json
from filtercake.results.replicates import REPLICATE_COLUMNS
from filtercake.study import engine_choice
from filtercake.study.loading import load_study
from filtercake.units import KILOPASCAL

DESIGN = """\
title: For tests
crystallizer:
  kinetics: ammonium_alum
  slurry_concentration_kg_m3: 200
filter:
  pressure_drop_kPa: 53.32
  submerged_fraction: 0.3
  rotation_rate_rpm: 0.5
  medium_resistance_1_m: 5.0e+9
material:
  friction: 0
  adhesion_mJ_m2: 0
resistance_law: carman
packing:
  protocol: filtration
  replicates: 3
sweeps:
  - residence_time_min: 30
design:
  variables:
    residence_time_min: [10, 60]
    rotation_rate_rpm: [0.1, 10]
  objective: installed_cost
  trade_off: filter_area
  constraints: {cake_thickness_mm: [5, 50]}
  levels: 5
"""


def task_of(folder: Path, text: str = DESIGN) -> Task:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return Task.from_params(load_design(load_study(path)).params(engine_choice.choose))


def made(task: Task, deviations: Mapping[int, Sequence[float]]) -> Outcome:
    """A design whose packings deviate from the estimate so much, by level; nan for one that failed."""
    rows = []
    for level, values in deviations.items():
        ask = next(item for item in task.asks if item.level == level and item.batch == 0)
        for replicate, value in enumerate(values):
            for k, pressure in enumerate(task.pressures):
                rows.append(
                    {
                        **ask.point.row(),
                        "pressure_kPa": pressure / KILOPASCAL,
                        "replicate": replicate,
                        "seed": 1,
                        "status": "failed" if math.isnan(value) else "ok",
                        "reason": "made up" if math.isnan(value) else "",
                        "porosity": float(task.estimates[level].porosity[k]) + value,
                        "level": level,
                        "batch": 0,
                    }
                )
    return Outcome(task, pd.DataFrame(rows, columns=[*REPLICATE_COLUMNS, "level", "batch"]), "because")


def packed(task: Task, porosity: Mapping[int, Sequence[float]]) -> Outcome:
    """A design whose packings have such porosities, by level."""
    return made(
        task,
        {level: np.asarray(values) - float(task.estimates[level].porosity[0]) for level, values in porosity.items()},
    )


def written(outcome: Outcome, folder: Path) -> tuple[Path, list[str]]:
    """Write a design's record and tables as its rule does; their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "design.json", tabulate.summary(outcome))
    tables = []
    for name, table in tabulate.tables(outcome).items():
        path = folder / f"{name}.csv"
        table.to_csv(path, index=False)
        tables.append(str(path))
    return folder / "design.json", tables
