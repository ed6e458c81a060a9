"""The steps of a study as functions: the one import that a notebook needs.

``from filtercake import api``, then :func:`distribution`, :func:`pack`, :func:`predict`, :func:`porosity`,
:func:`profile`, :func:`permeability`, :func:`permeabilities`, :func:`resistance`, :func:`filter_area`,
:func:`filtration_test`, :func:`filtration_tests`, :func:`crystallizer`, :func:`batch_filter`, :func:`deliquoring`,
:func:`cost`, :func:`export` and :func:`rerun`. It may import from every room but ``cli``, ``report`` and
``validation``.

Each name is imported when it is first asked for: a resistance need not wait for what packings need. So no module here
may have the name of a function.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from filtercake.api.crystallizers import CrystallizerOptions, CrystallizerProduct, crystallizer
    from filtercake.api.design import CostOptions, EquipmentCost, cost
    from filtercake.api.drum_filters import FilterOptions, FilterSize, filter_area
    from filtercake.api.exports import Exported, export, first_porosity, rerun
    from filtercake.api.filters import (
        BatchFilterOptions,
        BatchFilterSize,
        Deliquored,
        DeliquoringOptions,
        batch_filter,
        deliquoring,
    )
    from filtercake.api.filtration import FiltrationResult, filtration_test, filtration_tests
    from filtercake.api.flow import (
        FlowLevel,
        PackingPermeability,
        PermeabilityOptions,
        mean_kozeny_constant,
        permeabilities,
        permeability,
    )
    from filtercake.api.measured import PackingPorosity, porosity, profile
    from filtercake.api.packings import Bed, pack
    from filtercake.api.predict_options import PredictOptions
    from filtercake.api.predictions import Prediction, predict
    from filtercake.api.steps import Distribution, Resistance, ResistanceOptions, distribution, resistance

__all__ = [
    "BatchFilterOptions",
    "BatchFilterSize",
    "Bed",
    "CostOptions",
    "CrystallizerOptions",
    "CrystallizerProduct",
    "Deliquored",
    "DeliquoringOptions",
    "Distribution",
    "EquipmentCost",
    "Exported",
    "FilterOptions",
    "FilterSize",
    "FiltrationResult",
    "FlowLevel",
    "PackingPermeability",
    "PackingPorosity",
    "PermeabilityOptions",
    "PredictOptions",
    "Prediction",
    "Resistance",
    "ResistanceOptions",
    "batch_filter",
    "cost",
    "crystallizer",
    "deliquoring",
    "distribution",
    "export",
    "filter_area",
    "filtration_test",
    "filtration_tests",
    "first_porosity",
    "mean_kozeny_constant",
    "pack",
    "permeabilities",
    "permeability",
    "porosity",
    "predict",
    "profile",
    "rerun",
    "resistance",
]

_HOMES = {
    "crystallizers": ("CrystallizerOptions", "CrystallizerProduct", "crystallizer"),
    "design": ("CostOptions", "EquipmentCost", "cost"),
    "drum_filters": ("FilterOptions", "FilterSize", "filter_area"),
    "exports": ("Exported", "export", "first_porosity", "rerun"),
    "filters": (
        "BatchFilterOptions",
        "BatchFilterSize",
        "Deliquored",
        "DeliquoringOptions",
        "batch_filter",
        "deliquoring",
    ),
    "filtration": ("FiltrationResult", "filtration_test", "filtration_tests"),
    "flow": (
        "FlowLevel",
        "PackingPermeability",
        "PermeabilityOptions",
        "mean_kozeny_constant",
        "permeabilities",
        "permeability",
    ),
    "measured": ("PackingPorosity", "porosity", "profile"),
    "packings": ("Bed", "pack"),
    "predict_options": ("PredictOptions",),
    "predictions": ("Prediction", "predict"),
    "steps": ("Distribution", "Resistance", "ResistanceOptions", "distribution", "resistance"),
}
"""Names by the module that holds them."""
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import the module that holds a name, and keep the name."""
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """List the names for those who complete them by the tab key."""
    return sorted({*globals(), *__all__})
