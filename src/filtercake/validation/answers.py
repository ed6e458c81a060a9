"""Run time against error in what a user asks for: the specific resistance of a cake and the area of its filter.

Each way to an answer is a protocol and a law. The truth is the flow solved in cakes that were pressed as a filter
presses them; what the crystals' friction and attraction are is a matter of its own.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake import api
from filtercake.filtration.resistance import ADDITIVE, CARMAN
from filtercake.packing.pack import Report
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL
from filtercake.statistics import half_width
from filtercake.units import FloatArray

SOLVED: Final = "flow solved"
ESTIMATED: Final = "instant estimate"
ACCURACY: Final = 0.02
"""Relative accuracy of the solved flow."""
PRESSURE_KPA: Final = 50.0
SLURRY: Final[Mapping[str, float]] = {
    "slurry_concentration_kg_m3": 150.0,
    "slurry_flow_m3_h": 15.0,
    "pressure_drop_kPa": PRESSURE_KPA,
    "submerged_fraction": 0.3,
    "rotation_rate_rpm": 0.2,
    "medium_resistance_1_m": 5e9,
}
"""The paper's drum filter at this pressure, and what it takes."""
MATERIAL: Final[Mapping[str, Any]] = {"density_kg_m3": 1180.0, "youngs_modulus_GPa": 3.0, "adhesion_mJ_m2": 10.0}
SETTLED: Final[Mapping[str, Any]] = {"density_kg_m3": 1180.0, "cohesion_kJ_m3": 50.0}
"""The crystals as a filter presses them, and as the paper lets them settle."""


@dataclass(frozen=True)
class Way:
    """One way to an answer: a protocol and a law of the resistance."""

    protocol: str
    law: str


WAYS: Final = (
    Way(GRAVITY_PROTOCOL, ADDITIVE),
    Way(GRAVITY_PROTOCOL, CARMAN),
    Way(GRAVITY_PROTOCOL, SOLVED),
    Way(FILTRATION_PROTOCOL, ADDITIVE),
    Way(FILTRATION_PROTOCOL, CARMAN),
    Way(FILTRATION_PROTOCOL, SOLVED),
)


def answers(
    mixture: Mapping[float, float], friction: float, packings: int, say: Report = lambda _: None
) -> pd.DataFrame:
    """Ask for the resistance and the filter area in every way.

    Parameters
    ----------
    mixture : mapping of float to float
        Volume fractions by size, um.
    friction : float
        Friction of the crystals.
    packings : int
        Packings of each protocol.
    say : callable
        Receives a line per packing.

    Returns
    -------
    DataFrame
        Columns protocol, law, n, seconds (of one packing with what follows it), porosity, resistance_m_kg (means),
        filter_area_m2 (of the mean), resistance_error, resistance_error_ci95 (of the mean, relative to the flow solved
        in pressed cakes), spread (relative, of one packing), area_error.
    """
    csd = api.distribution(mixture=dict(mixture))
    made = {name: _packings(csd, name, friction, packings, say) for name in (GRAVITY_PROTOCOL, FILTRATION_PROTOCOL)}
    truth = made[FILTRATION_PROTOCOL][SOLVED].to_numpy(np.float64)
    rows = [_row(way, made[way.protocol], truth) for way in WAYS]
    began = time.perf_counter()
    estimate = api.predict(csd, friction=friction, pressure_kPa=PRESSURE_KPA, **MATERIAL)
    seconds = time.perf_counter() - began
    found = np.array([estimate.resistance_m_kg])
    rows.append(
        {
            "protocol": FILTRATION_PROTOCOL,
            "law": ESTIMATED,
            "n": 0,
            "seconds": seconds,
            "porosity": estimate.porosity,
            **_errors(found, truth),
        }
    )
    return pd.DataFrame(rows)


def _packings(csd: Any, protocol: str, friction: float, packings: int, say: Report) -> pd.DataFrame:
    """One row per packing: porosity, its resistance by each law, and the seconds of packing and of solving."""
    options: dict[str, Any] = {"protocol": protocol, "friction": friction, "engine": "embedded"}
    if protocol == FILTRATION_PROTOCOL:
        options |= {**MATERIAL, "pressure_kPa": PRESSURE_KPA}
    else:
        options |= SETTLED
    with tempfile.TemporaryDirectory(prefix="filtercake-") as folder:
        bed = api.pack(csd, Path(folder), replicates=packings, say=say, **options)
        rows = []
        for file, (_, made) in zip(bed.files, bed.replicates[bed.replicates["status"] == "ok"].iterrows(), strict=True):
            began = time.perf_counter()
            solved = api.permeability(file, accuracy=ACCURACY, threads=1)
            seconds = time.perf_counter() - began
            say(f"{protocol}: flow solved in {seconds:.1f} s")
            laws = {law: _resistance(csd, float(made["porosity"]), law) for law in (ADDITIVE, CARMAN)}
            rows.append(
                {
                    "porosity": made["porosity"],
                    "packed_s": made["wall_s"],
                    "solved_s": seconds,
                    **laws,
                    SOLVED: solved.resistance_m_kg,
                }
            )
    return pd.DataFrame(rows)


def _resistance(csd: Any, porosity: float, law: str) -> float:
    found = api.resistance(csd, porosity=porosity, density_kg_m3=MATERIAL["density_kg_m3"], law=law)
    return float(found.resistance_m_kg)


def _row(way: Way, made: pd.DataFrame, truth: FloatArray) -> dict[str, Any]:
    solving = float(made["solved_s"].median()) if way.law == SOLVED else 0.0
    return {
        "protocol": way.protocol,
        "law": way.law,
        "n": len(made),
        "seconds": float(made["packed_s"].median()) + solving,
        "porosity": float(made["porosity"].mean()),
        **_errors(made[way.law].to_numpy(np.float64), truth),
    }


def _errors(found: FloatArray, truth: FloatArray) -> dict[str, float]:
    """Compare resistances with the true ones: both samples' means are uncertain."""
    mean, true = float(found.mean()), float(truth.mean())
    areas = [api.filter_area(resistance_m_kg=value, **SLURRY).filter_area_m2 for value in (mean, true)]
    widths = [half_width(values) / values.mean() for values in (found, truth) if values.size > 1]
    itself = found is truth or np.array_equal(found, truth)
    return {
        "resistance_m_kg": mean,
        "filter_area_m2": areas[0],
        "resistance_error": mean / true - 1.0,
        "resistance_error_ci95": mean / true * math.hypot(*widths[: 1 if itself else 2]),
        "spread": float(found.std(ddof=1) / mean) if found.size > 1 else math.nan,
        "area_error": areas[0] / areas[1] - 1.0,
    }
