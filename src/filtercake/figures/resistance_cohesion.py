"""Specific cake resistance against cohesion, one line per friction (paper, Fig. 10)."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from filtercake.figures import cohesion, selection, style
from filtercake.figures.selection import StudyData
from filtercake.results.resistance_columns import others


def draw(data: StudyData) -> Figure:
    """Draw our resistance with its 95 % interval by the study's law, another law's, and published values."""
    dashed: dict[str, Any] = {"linestyle": "--"}
    law = others(data.study.resistance_law)[-1]
    key = style.key(f"{selection.law_title(law)}, same packings", color=style.FAINT, linewidth=0.9, **dashed)
    beside = cohesion.Beside(
        f"resistance_{law}_m_kg",
        "beside",
        lambda index: {"color": style.colour(index), "linewidth": 0.8, "alpha": 0.5, **dashed},
        key,
    )
    return cohesion.draw(
        data,
        ("resistance_m_kg", "resistance_ci95_m_kg"),
        beside,
        lambda axes, values: style.resistance_axis(axes, values, log=bool(values.size)),
        selection.law_note(data),
    )
