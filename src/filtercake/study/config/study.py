"""A whole study, and the workflow's configuration that names it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from filtercake.filtration.resistance import ADDITIVE
from filtercake.study.config.cross_check import CrossCheck
from filtercake.study.config.crystals import Crystallizer, Csd
from filtercake.study.config.design import Design
from filtercake.study.config.filter import Filter
from filtercake.study.config.material import Material
from filtercake.study.config.packing import Packing
from filtercake.study.config.permeability import Permeability
from filtercake.study.config.published import Published
from filtercake.study.config.sweep import Sweep
from filtercake.study.config.values import ENTRIES, LISTED, MOST_VALUES, TO_TEXT, LawName, Model, Name, PathText

MOST_DISTRIBUTIONS = 200
"""Distributions of a study, the crystallizer's products among them."""


class Study(Model):
    """A parameter study: distributions, material, packing settings and the points to visit."""

    title: Annotated[str, Field(max_length=120), TO_TEXT] = Field(
        default="", description="One line for figures and reports."
    )
    csds: Annotated[dict[Name, Csd], Field(max_length=MOST_DISTRIBUTIONS)] = Field(
        default={}, description="The distributions by name."
    )
    crystallizer: Crystallizer | None = Field(default=None, description="Where the crystals come from.")
    filter: Filter | None = Field(default=None, description="Where the slurry goes; needs a crystallizer.")
    material: Material = Field(description="The crystals.")
    resistance_law: LawName = Field(
        default=ADDITIVE,
        description="Law of the resistance: additive (the paper's eq. 3), carman (Sauter mean, lower for broad "
        "distributions, nearer to the flow in packings), or stokes (flow solved in the packings: needs permeability).",
    )
    permeability: Permeability | None = Field(
        default=None, description="Stokes flow solved in packings of every point; left out, it is not."
    )
    packing: Packing = Field(default=Packing(), description="How the packings are made.")
    sweeps: Annotated[list[Sweep], Field(min_length=1, max_length=MOST_VALUES)] = Field(
        description="Blocks of points; their union is visited."
    )
    cross_check: CrossCheck | None = Field(
        default=None, description="Packings made once more by another engine, and how the porosities differ."
    )
    design: Design | None = Field(
        default=None,
        description="Which residence time, which filter, at what cost, how sure; needs a crystallizer and a filter.",
    )
    published: Annotated[list[Published], Field(max_length=MOST_VALUES)] = Field(
        default=[], description="Published values to show beside ours."
    )

    def base(self, name: str) -> float | None:
        """Return the base value of a property of ``SWEPT``; None where there is none."""
        if name == "pressure_kPa":
            drop = None if self.filter is None else self.filter.pressure_drop_kPa
            return drop if self.packing.pressure_kPa is None else self.packing.pressure_kPa
        value: float | None = getattr(self.material, name)
        return value

    @property
    def protocols(self) -> set[str]:
        """Protocols of its points."""
        return {name for sweep in self.sweeps for name in sweep.protocol or [self.packing.protocol]}


class Workflow(Model):
    """The workflow's configuration: which studies to run, and where their results go."""

    studies: Annotated[list[PathText], LISTED, ENTRIES] = Field(
        default=["pmma"], description="Names of files in config/studies, or paths of study files."
    )
    calibrations: Annotated[list[PathText], LISTED, Field(max_length=MOST_VALUES)] = Field(
        default=[], description="Names of files in config/calibrations, or paths of calibration files."
    )
    results: PathText = Field(default="results", description="Folder of the results.")
    quick: bool = Field(default=False, description="For the benchmarks: a few packings of each case.")
