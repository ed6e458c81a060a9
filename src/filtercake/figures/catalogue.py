"""Which figures there are, which of them a study has, and how one is drawn and saved.

A new figure is one module with ``draw(data) -> Figure`` and one line in ``FIGURES``.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from filtercake.config import Study
from filtercake.csd import CrystalSizeDistribution
from filtercake.packing.result import publish
from filtercake.study import Point

if TYPE_CHECKING:  # parsing the workflow must not cost an import of matplotlib
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class StudyData:
    """Everything a figure may show of a study.

    Attributes
    ----------
    name : str
        The study.
    study : Study
        Its model (labels, published values, material).
    points, summary, replicates : DataFrame
        Its tables (see :mod:`filtercake.study`).
    csds : dict of str to (CrystalSizeDistribution, CrystalSizeDistribution)
        Full and truncated distribution by name.
    packings : Path
        Folder with one folder of packings per point.
    """

    name: str
    study: Study
    points: pd.DataFrame
    summary: pd.DataFrame
    replicates: pd.DataFrame
    csds: dict[str, tuple[CrystalSizeDistribution, CrystalSizeDistribution]]
    packings: Path


@dataclass(frozen=True)
class FigureSpec:
    """A figure's module below ``filtercake.figures`` and whether a list of points gives it something to show."""

    module: str
    applies: Callable[[list[Point]], bool]


def _always(_points: list[Point]) -> bool:
    return True


def _varies(name: str) -> Callable[[list[Point]], bool]:
    def applies(points: list[Point]) -> bool:
        return any(
            len({getattr(point.spec, name) for point in points if point.csd == csd}) > 1
            for csd in {point.csd for point in points}
        )

    return applies


FIGURES: dict[str, FigureSpec] = {
    "fig03_porosity_trajectory": FigureSpec("trajectory", _always),
    "fig08_resistance_vs_porosity": FigureSpec("resistance_porosity", _always),
    "fig09_porosity_vs_cohesion": FigureSpec("porosity_cohesion", _varies("cohesion")),
    "fig10_resistance_vs_cohesion": FigureSpec("resistance_cohesion", _varies("cohesion")),
    "sensitivity_poisson_restitution": FigureSpec(
        "sensitivity", lambda points: _varies("poisson_ratio")(points) or _varies("restitution")(points)
    ),
    "packing_cross_section": FigureSpec("cross_section", _always),
    "packing_porosity_profile": FigureSpec("profile", _always),
}


def figures_of(points: Iterable[Point], study: Study) -> list[str]:  # noqa: ARG001 - later figures depend on the model
    """Names of the figures a study has."""
    listed = list(points)
    return [name for name, spec in FIGURES.items() if spec.applies(listed)]


def module_of(figure: str) -> str:
    """Library module behind a figure, below ``filtercake``."""
    return f"figures.{FIGURES[figure].module}"


def draw(figure: str, data: StudyData) -> Figure:
    """Draw a figure."""
    from filtercake.figures import style

    module = importlib.import_module(f"filtercake.{module_of(figure)}")
    with style.applied():
        drawn: Figure = module.draw(data)
    return drawn


def save(figure: Figure, png: Path, pdf: Path) -> None:
    """Save a figure as PNG (300 dpi) and PDF; no date inside, so that the same figure is the same file."""
    from filtercake.figures import style

    with style.applied():
        with publish(png) as temporary:
            figure.savefig(temporary, format="png", dpi=300)
        with publish(pdf) as temporary:
            figure.savefig(temporary, format="pdf", metadata={"CreationDate": None})
