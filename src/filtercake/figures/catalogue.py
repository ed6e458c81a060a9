"""Registry of the figures of studies, calibrations and designs.

A new figure is one module with ``draw(data) -> Figure`` and one line in ``FIGURES``, ``CALIBRATION_FIGURES`` or
``DESIGN_FIGURES``.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from filtercake.calibration.measurements import Measurements, compressibility_by_csd
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL
from filtercake.study.config.design import Design
from filtercake.study.config.study import Study
from filtercake.study.points import Point

if TYPE_CHECKING:  # parsing the workflow must not cost an import of matplotlib
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class FigureSpec:
    """A figure's title, its module below ``filtercake.figures``, and what gives it something to show.

    Attributes
    ----------
    title : str
        Its title for readers; with the paper's number where it is one of the paper's.
    module : str
        Its module.
    applies : callable
        Whether it shows anything of a study's points, of a calibration's predictions (True if any) and measurements, or
        of a design's section.
    needs : callable
        Whether it shows anything of a study's model.
    of_tests : bool
        Whether it is drawn from a calibration's measurements alone.
    """

    title: str
    module: str
    applies: Callable[..., bool] = lambda *_: True
    needs: Callable[[Study], bool] = lambda _: True
    of_tests: bool = False


def _varies(name: str) -> Callable[[list[Point]], bool]:
    def kind(point: Point) -> tuple[str, str]:
        return point.csd, point.scene.protocol

    def applies(points: list[Point]) -> bool:
        return any(
            len({getattr(point.scene, name) for point in points if kind(point) == one}) > 1
            for one in {kind(point) for point in points}
        )

    return applies


def _compresses(points: list[Point]) -> bool:
    return any(point.scene.is_pressed and point.scene.attraction != "none" for point in points)


def _rubs(points: list[Point]) -> bool:
    pressed = [point for point in points if point.scene.is_pressed]
    return _varies("friction")(pressed) or _varies("adhesion")(pressed)


def _pressed(study: Study) -> bool:
    return FILTRATION_PROTOCOL in study.protocols


def _truncates(study: Study) -> bool:
    return any(csd.truncation for csd in study.csds.values())


def _compares_products(study: Study) -> bool:
    return sum(csd.residence_time_min is not None for csd in study.csds.values()) > 1


def _crystallizes(study: Study) -> bool:
    return study.crystallizer is not None


def _solves_flow(study: Study) -> bool:
    return study.permeability is not None


def _falls(study: Study) -> bool:
    return study.packing.protocol == GRAVITY_PROTOCOL


def _filters(study: Study) -> bool:
    return study.filter is not None


FIGURES: dict[str, FigureSpec] = {
    "fig03_porosity_trajectory": FigureSpec("Porosity while a bed settles (Fig. 3)", "trajectory", needs=_falls),
    "fig05_truncation": FigureSpec("What is packed of each size distribution (Fig. 5)", "truncation", needs=_truncates),
    "fig08_resistance_vs_porosity": FigureSpec("Resistance against porosity (Fig. 8)", "resistance_porosity"),
    "fig09_porosity_vs_cohesion": FigureSpec(
        "Porosity against cohesion (Fig. 9)", "porosity_cohesion", _varies("cohesion")
    ),
    "fig10_resistance_vs_cohesion": FigureSpec(
        "Resistance against cohesion (Fig. 10)", "resistance_cohesion", _varies("cohesion")
    ),
    "fig12_distributions": FigureSpec(
        "Size distributions from the crystallizer (Fig. 12)", "distributions", needs=_compares_products
    ),
    "fig13_growth_nucleation": FigureSpec(
        "Growth and nucleation in the crystallizer (Fig. 13)", "crystallizer", needs=_crystallizes
    ),
    "fig14_resistance_area": FigureSpec("Resistance and area of the filter (Fig. 14)", "filter_area", needs=_filters),
    "filter_area_sensitivity": FigureSpec(
        "Area of the filter for other media and pressure drops", "filter_sensitivity", needs=_filters
    ),
    "sensitivity_poisson_restitution": FigureSpec(
        "Porosity against Poisson's ratio and restitution",
        "sensitivity",
        lambda points: _varies("poisson_ratio")(points) or _varies("restitution")(points),
    ),
    "cake_compression": FigureSpec(
        "Porosity and resistance of cakes against pressure", "compression", _compresses, needs=_pressed
    ),
    "cake_friction": FigureSpec("Porosity and resistance of cakes against friction", "friction", _rubs, needs=_pressed),
    "packing_cross_section": FigureSpec("Cut through a packing", "cross_section"),
    "packing_flow": FigureSpec("Flow through a packing", "flow", needs=_solves_flow),
    "packing_porosity_profile": FigureSpec("Porosity over the height of a bed", "profile", needs=_falls),
}
"""Figures of studies."""

CALIBRATION_FIGURES: dict[str, FigureSpec] = {
    "calibration_objective": FigureSpec("How well each value fits", "calibration_objective"),
    "calibration_parity": FigureSpec("Modelled against measured resistance", "calibration_parity"),
    "calibration_resistance": FigureSpec("Resistance of the packings, and what was measured", "calibration_resistance"),
    "calibration_predictions": FigureSpec(
        "Predicted resistances", "calibration_predictions", lambda predicts, _: predicts
    ),
    "filtration_fits": FigureSpec(
        "Filtration tests and their fits", "filtration_fits", lambda _, measured: bool(measured.tests), of_tests=True
    ),
    "compressibility": FigureSpec(
        "Resistance against pressure",
        "compressibility",
        lambda _, measured: bool(compressibility_by_csd(measured)),
    ),
}
"""Figures of calibrations."""

DESIGN_FIGURES: dict[str, FigureSpec] = {
    "design_objective": FigureSpec("Objective against residence time, and its parts", "design_objective"),
    "design_resistance": FigureSpec("Filter area and resistance against residence time", "design_resistance"),
    "design_trade_off": FigureSpec(
        "Designs that are best in neither of two objectives alone",
        "design_trade_off",
        lambda design: design.trade_off is not None,
    ),
}
"""Figures of designs."""
EVERY_FIGURE = FIGURES | CALIBRATION_FIGURES | DESIGN_FIGURES

ANSWERS = (
    "design_objective",
    "design_resistance",
    "fig14_resistance_area",
    "fig10_resistance_vs_cohesion",
    "cake_compression",
    "calibration_resistance",
    "calibration_parity",
)
"""Figures that answer what a study or a calibration asks, the first one first."""
ANSWERS_ELSE = "fig08_resistance_vs_porosity"
"""What answers where none of them is there."""
CUT = "packing_cross_section"


def figures_of(points: Iterable[Point], study: Study) -> list[str]:
    """Names of the figures a study has."""
    listed = list(points)
    return [name for name, spec in FIGURES.items() if spec.applies(listed) and spec.needs(study)]


def figures_of_calibration(predicts: bool, measurements: Measurements) -> list[str]:
    """Names of the figures a calibration has."""
    return [name for name, spec in CALIBRATION_FIGURES.items() if spec.applies(predicts, measurements)]


def figures_of_design(design: Design) -> list[str]:
    """Names of the figures a design has."""
    return [name for name, spec in DESIGN_FIGURES.items() if spec.applies(design)]


def answering(figures: Collection[str]) -> list[str]:
    """List those of some figures that answer what was asked, and the cut through a packing behind them."""
    found = [name for name in ANSWERS if name in figures] or [name for name in (ANSWERS_ELSE,) if name in figures]
    return [*found, *(name for name in (CUT,) if name in figures)]


def title_of(figure: str) -> str:
    """Title of a figure for readers."""
    return EVERY_FIGURE[figure].title


def module_of(figure: str) -> str:
    """Library module behind a figure, below ``filtercake``."""
    return f"figures.{EVERY_FIGURE[figure].module}"


def draw(figure: str, data: Any) -> Figure:
    """Draw a figure from the ``StudyData``, ``CalibrationData`` or ``DesignData`` that it is of."""
    from filtercake.figures import style

    module = importlib.import_module(f"filtercake.{module_of(figure)}")
    spec = EVERY_FIGURE[figure]
    with style.applied():
        drawn: Figure = module.draw(data.measurements if spec.of_tests else data)
    return drawn
