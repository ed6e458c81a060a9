"""Problems whose best design is known by calculus: costs and resistances that are powers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from filtercake.design.belief import Belief, LevelEstimate
from filtercake.design.costs import Correlation
from filtercake.design.plant import Limits, Plant
from filtercake.design.search import Problem
from filtercake.units import FloatArray

FLOW, CONCENTRATION = 0.005, 200.0
LEVELS = tuple(np.geomspace(240.0, 3600.0, 13))


def power(coefficient: float, exponent: float, unit: str, equipment: str) -> Correlation:
    return Correlation(
        title=equipment,
        equipment=equipment,
        formula="power",
        coefficients=[coefficient, exponent],
        size_unit=unit,
        size_range=None,
        cost_index=500.0,
        index_year=2000,
        installed_factor=1.0,
        installed_as="installed",
        source="made up",
    )


VESSEL, CLOTH = (30e3, 0.6), (60e3, 0.7)


def plant(**changed: object) -> Plant:
    values = {
        "production": FLOW * CONCENTRATION,
        "density": 2000.0,
        "viscosity": 1e-3,
        "liquid_density": 1000.0,
        "medium_resistance": 0.0,
        "crystallizer_cost": power(*VESSEL, "m3", "vessel"),
        "filter_cost": {
            "drum": power(*CLOTH, "m2", "drum_filter"),
            "leaf": power(CLOTH[0] / 4.0, CLOTH[1], "m2", "leaf_filter"),
        },
        "cost_index": 500.0,
        "turnaround": 1800.0,
        "limits": Limits(),
        **changed,
    }
    return Plant(**values)  # type: ignore[arg-type]


def resistance_at(time: FloatArray | float, exponent: float, alpha: float = 1e10) -> FloatArray:
    """Resistance of a porosity of 0.4: a power of the residence time."""
    return np.asarray(alpha * (np.asarray(time) / 1000.0) ** -exponent)


def problem(exponent: float = 0.6, **changed: object) -> Problem:
    """A problem over 49 residence times, 4 min to 1 h; alpha = 1e10 (tau/1000 s)^-exponent at a porosity of 0.4."""
    times = belief(0.001).position

    def resistance(place: int, porosity: FloatArray) -> FloatArray:
        relative = (1.0 - porosity) / porosity**3 / (0.6 / 0.4**3)
        return np.asarray(resistance_at(np.exp(times[place]), exponent) * relative)

    values = {
        "plant": plant(),
        "residence_times": np.exp(times),
        "sauter_means": np.full(times.size, 1e-5),
        "resistance": resistance,
        "pressure_drops": np.array([6e4]),
        "ranges": {
            "slurry_concentration": (CONCENTRATION, CONCENTRATION),
            "submerged_fraction": (0.3, 0.3),
            "rotation_rate": (0.01, 0.01),
        },
        "filter_types": ("drum",),
        "objective": "installed_cost",
        "target": 0.1,
        "tolerance": 0.005,
        **changed,
    }
    return Problem(**values)  # type: ignore[arg-type]


def belief(deviation: float, scatter: float = 0.002, levels: Sequence[float] = LEVELS, porosity: float = 0.4) -> Belief:
    one = LevelEstimate(np.array([porosity]), np.array([deviation]), np.array([scatter]))
    return Belief.prior(list(levels), [one] * len(levels), 4)


def best_time(exponent: float, alpha: float = 1e10) -> float:
    """Residence time of the least cost: d/dtau (k1 (Q tau)^a + k2 A^b) = 0 with A = Q sqrt(mu c alpha / (2 dP f n))."""
    (k1, a), (k2, b) = VESSEL, CLOTH
    at_1000 = FLOW * np.sqrt(1e-3 * CONCENTRATION * alpha / (2.0 * 6e4 * 0.3 * 0.01))
    falls = 0.5 * b * exponent  # the filter's cost goes as tau^-falls
    rise, fall = a * k1 * FLOW**a, falls * k2 * at_1000**b * 1000.0**falls
    return float((fall / rise) ** (1.0 / (a + falls)))
