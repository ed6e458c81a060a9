"""Specific cake resistance against cohesion, one line per friction (paper, Fig. 10)."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from filtercake.figures import cohesion, style
from filtercake.figures.selection import StudyData


def draw(data: StudyData) -> Figure:
    """Draw our resistance with its 95 % interval (eq. 3), Carman's form of the same law, and published values."""
    dashed: dict[str, Any] = {"linestyle": "--"}
    key = style.key("Carman's form (Sauter mean), same packings", color=style.FAINT, linewidth=0.9, **dashed)
    sauter = cohesion.Beside(
        "resistance_sauter_m_kg",
        "sauter",
        lambda index: {"color": style.colour(index), "linewidth": 0.8, "alpha": 0.5, **dashed},
        key,
    )
    return cohesion.draw(
        data,
        ("resistance_m_kg", "resistance_ci95_m_kg"),
        sauter,
        lambda axes, values: style.resistance_axis(axes, values, log=bool(values.size)),
    )
