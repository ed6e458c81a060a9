"""Interior porosity against cohesion, one line per friction (paper, Fig. 9)."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from filtercake.figures import cohesion, style
from filtercake.figures.selection import StudyData


def draw(data: StudyData) -> Figure:
    """Draw our porosity with its 95 % interval, the paper's estimate of the same packings, and published values."""
    hollow: dict[str, Any] = {"markerfacecolor": "none", "linestyle": "none"}
    key = style.key("same packings, counted as in the paper", marker="o", markeredgecolor=style.FAINT, **hollow)
    counted = cohesion.Beside(
        "porosity_paper_count",
        "paper_count",
        lambda index: {
            "marker": style.marker(index),
            "markeredgecolor": style.colour(index),
            "alpha": 0.45,
            **hollow,
        },
        key,
    )
    return cohesion.draw(
        data, ("porosity", "porosity_ci95"), counted, lambda axes, _: axes.set_ylabel("Interior porosity (–)")
    )
