"""Which figures there are, which of them a study has, and how one is drawn and saved.

A new figure is one module with ``draw(data) -> Figure`` and one line in ``FIGURES``.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution, from_table
from filtercake.packing.result import publish
from filtercake.study.config.study import Study
from filtercake.study.points import Point

if TYPE_CHECKING:  # parsing the workflow must not cost an import of matplotlib
    from matplotlib.figure import Figure


FOOTER = "Description"
"""Metadata of a PNG that holds the line below its figure: packings, failures, engine."""


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
        Its tables (see :mod:`filtercake.study.points`).
    csds : dict of str to (CrystalSizeDistribution, CrystalSizeDistribution)
        Full and truncated distribution by name.
    packings : Path
        Folder with one folder of packings per point.
    crystallizer : DataFrame
        The table of the crystallizer's states (:func:`filtercake.results.paper_tables.crystallizer_table`); empty
        without one.
    """

    name: str
    study: Study
    points: pd.DataFrame
    summary: pd.DataFrame
    replicates: pd.DataFrame
    csds: dict[str, tuple[CrystalSizeDistribution, CrystalSizeDistribution]]
    packings: Path
    crystallizer: pd.DataFrame = field(default_factory=pd.DataFrame)

    @classmethod
    def read(
        cls, name: str, study: Mapping[str, Any], folder: Path, csds: Iterable[str], crystallizer: Iterable[str]
    ) -> StudyData:
        """Read a study's tables.

        Parameters
        ----------
        name : str
            The study.
        study : mapping
            Its model's values.
        folder : Path
            Its results: points.csv, summary.csv, replicates.csv, packings.
        csds : iterable of str
            Tables of its distributions, named by them.
        crystallizer : iterable of str
            The crystallizer's table, if it has one.
        """
        return cls(
            name=name,
            study=Study.model_validate(study),
            points=pd.read_csv(folder / "points.csv"),
            summary=pd.read_csv(folder / "summary.csv"),
            replicates=pd.read_csv(folder / "replicates.csv"),
            csds={Path(table).stem: from_table(pd.read_csv(table)) for table in csds},
            packings=folder / "packings",
            crystallizer=next(map(pd.read_csv, crystallizer), pd.DataFrame()),
        )


def _always(_anything: object) -> bool:
    return True


@dataclass(frozen=True)
class FigureSpec:
    """A figure's module below ``filtercake.figures``, and what gives it something to show.

    Attributes
    ----------
    module : str
        Its module.
    applies : callable
        Whether a list of points does.
    needs : callable
        Whether a study's model does.
    """

    module: str
    applies: Callable[[list[Point]], bool] = _always
    needs: Callable[[Study], bool] = _always


def _varies(name: str) -> Callable[[list[Point]], bool]:
    def applies(points: list[Point]) -> bool:
        return any(
            len({getattr(point.scene, name) for point in points if point.csd == csd}) > 1
            for csd in {point.csd for point in points}
        )

    return applies


def _truncates(study: Study) -> bool:
    return any(csd.truncation for csd in study.csds.values())


def _compares_products(study: Study) -> bool:
    return sum(csd.residence_time_min is not None for csd in study.csds.values()) > 1


def _crystallizes(study: Study) -> bool:
    return study.crystallizer is not None


def _filters(study: Study) -> bool:
    return study.filter is not None


FIGURES: dict[str, FigureSpec] = {
    "fig03_porosity_trajectory": FigureSpec("trajectory"),
    "fig05_truncation": FigureSpec("truncation", needs=_truncates),
    "fig08_resistance_vs_porosity": FigureSpec("resistance_porosity"),
    "fig09_porosity_vs_cohesion": FigureSpec("porosity_cohesion", _varies("cohesion")),
    "fig10_resistance_vs_cohesion": FigureSpec("resistance_cohesion", _varies("cohesion")),
    "fig12_distributions": FigureSpec("distributions", needs=_compares_products),
    "fig13_growth_nucleation": FigureSpec("crystallizer", needs=_crystallizes),
    "fig14_resistance_area": FigureSpec("filter_area", needs=_filters),
    "filter_area_sensitivity": FigureSpec("filter_sensitivity", needs=_filters),
    "sensitivity_poisson_restitution": FigureSpec(
        "sensitivity", lambda points: _varies("poisson_ratio")(points) or _varies("restitution")(points)
    ),
    "packing_cross_section": FigureSpec("cross_section"),
    "packing_porosity_profile": FigureSpec("profile"),
}


def figures_of(points: Iterable[Point], study: Study) -> list[str]:
    """Names of the figures a study has."""
    listed = list(points)
    return [name for name, spec in FIGURES.items() if spec.applies(listed) and spec.needs(study)]


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
    """Save a figure as PNG (300 dpi) and PDF; no date inside, so that the same figure is the same file.

    The PNG carries the line that stands below the figure, for its caption.
    """
    from filtercake.figures import style

    footer = " ".join(figure.get_supxlabel().split())
    with style.applied():
        with publish(png) as temporary:
            figure.savefig(temporary, format="png", dpi=300, metadata={FOOTER: footer})
        with publish(pdf) as temporary:
            figure.savefig(temporary, format="pdf", metadata={"CreationDate": None})
