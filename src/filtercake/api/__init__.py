"""The steps of a study as functions: the one import that a notebook needs.

``from filtercake import api``, then :func:`distribution`, :func:`pack`, :func:`predict`, :func:`porosity`,
:func:`profile`, :func:`permeability`, :func:`permeabilities`, :func:`resistance`, :func:`filter_area`,
:func:`filtration_test`, :func:`filtration_tests`, :func:`crystallizer`, :func:`batch_filter`, :func:`deliquoring`,
:func:`cost`, :func:`export` and :func:`rerun`.

It may import from every room but ``cli``, ``report`` and ``validation``.
"""

from filtercake.api.crystallizer import CrystallizerOptions, CrystallizerProduct, crystallizer
from filtercake.api.design import CostOptions, EquipmentCost, cost
from filtercake.api.export import Exported, export, first_porosity, rerun
from filtercake.api.filters import (
    BatchFilterOptions,
    BatchFilterSize,
    Deliquored,
    DeliquoringOptions,
    batch_filter,
    deliquoring,
)
from filtercake.api.filtration import FiltrationResult, filtration_test, filtration_tests
from filtercake.api.pack import Bed, pack
from filtercake.api.permeability import (
    FlowLevel,
    PackingPermeability,
    PermeabilityOptions,
    mean_kozeny_constant,
    permeabilities,
    permeability,
)
from filtercake.api.predict import Prediction, PredictOptions, predict
from filtercake.api.steps import (
    Distribution,
    FilterOptions,
    FilterSize,
    PackingPorosity,
    Resistance,
    ResistanceOptions,
    distribution,
    filter_area,
    porosity,
    profile,
    resistance,
)

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
