"""What the jobs of a design need, as plain values; the problem, the estimate, and what the packings gave."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake.crystals.crystallizer import Kinetics, crystal_size_distribution, steady_state
from filtercake.crystals.csd import CrystalSizeDistribution, read_tables, truncate
from filtercake.design.belief import Belief, LevelEstimate
from filtercake.design.confirm import Candidate, Found
from filtercake.design.costs import Correlation
from filtercake.design.emulator import cake_of
from filtercake.design.emulator_file import shipped
from filtercake.design.loading import EQUIPMENT, Ask, pressures_of
from filtercake.design.plant import Limits, Plant, Suction
from filtercake.design.search import Problem
from filtercake.filtration.resistance import resistance
from filtercake.packing.compression import CompressionCurve
from filtercake.packing.pack import MANIFEST, Outcome
from filtercake.packing.result import read_record
from filtercake.packing.scene import Scene
from filtercake.results.replicates import REPLICATE_COLUMNS, replicate_rows
from filtercake.statistics import quantile
from filtercake.study.config.design import Design
from filtercake.study.config.study import Study
from filtercake.study.config.sweep import SWEPT
from filtercake.study.points import Point
from filtercake.study.products import product_name
from filtercake.study.scenes import scene_of
from filtercake.units import HOUR, KILOPASCAL, MICROMETRE, MILLIPASCAL_SECOND, MINUTE, FloatArray

BETWEEN: Final = 4
"""Steps of the search between two residence times that may be packed."""
PRESSURES: Final = 9
"""Pressure drops of the search, evenly by ratio."""
HALF: Final = 0.5
MILLINEWTON: Final = 1e-3
MILLIMETRE: Final = 1e-3


@dataclass(frozen=True, eq=False)
class Task:
    """Input of a design's jobs.

    Attributes
    ----------
    study : Study
        The study.
    kinetics : Kinetics
        The crystallizer's.
    correlations : dict of str to Correlation
        Cost correlations by name.
    levels : tuple of float
        Residence times that may be packed, min.
    asks : tuple of Ask
        Every set of packings that may be made.
    """

    study: Study
    kinetics: Kinetics
    correlations: dict[str, Correlation]
    levels: tuple[float, ...]
    asks: tuple[Ask, ...]

    @classmethod
    def from_params(cls, values: Mapping[str, Any]) -> Task:
        """Build from plain values, e.g. a rule's params."""
        kinetics = dict(values["kinetics"])
        if kinetics["residence_time_range"] is not None:
            kinetics["residence_time_range"] = tuple(kinetics["residence_time_range"])
        return cls(
            Study.model_validate(values["study"]),
            Kinetics(**kinetics),
            {name: Correlation.model_validate(item) for name, item in values["correlations"].items()},
            tuple(values["levels"]),
            tuple(Ask(Point.from_dict(ask["point"]), ask["level"], ask["batch"]) for ask in values["asks"]),
        )

    @property
    def design(self) -> Design:
        """The section ``design``."""
        if self.study.design is None:
            raise ValueError("the study has no design and was not loaded")
        return self.study.design

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Sets of packings that may be made."""
        return tuple(Candidate(ask.point.packings, ask.level, ask.batch, ask.point.replicates) for ask in self.asks)

    @cached_property
    def pressures(self) -> FloatArray:
        """Pressure drops of the search, Pa."""
        ends = pressures_of(self.design, self.study)
        return np.geomspace(ends[0], ends[-1], PRESSURES if len(ends) > 1 else 1) * KILOPASCAL

    @cached_property
    def residence_times(self) -> FloatArray:
        """Residence times of the search, s; every ``BETWEEN``-th may be packed."""
        at = np.log(np.array(self.levels) * MINUTE)
        steps = np.arange((at.size - 1) * BETWEEN + 1) / BETWEEN
        return np.asarray(np.exp(np.interp(steps, np.arange(at.size), at)))

    @cached_property
    def products(self) -> list[CrystalSizeDistribution]:
        """Whole distributions at the residence times of the search."""
        return [self._product(float(time)) for time in self.residence_times]

    def _product(self, residence_time: float) -> CrystalSizeDistribution:
        crystallizer = self.study.crystallizer
        if crystallizer is None:
            raise ValueError("the study has no crystallizer and was not loaded")
        state = steady_state(self.kinetics, residence_time, crystallizer.slurry_concentration_kg_m3)
        return crystal_size_distribution(state.size_scale, crystallizer.bin_width_um * MICROMETRE)

    @cached_property
    def problem(self) -> Problem:
        """What is to be found."""
        crystallizer, settings, variables = self.study.crystallizer, self.study.filter, self.design.variables
        if crystallizer is None or settings is None:
            raise ValueError("the study has no crystallizer or no filter and was not loaded")
        material = self.study.material
        at_half = np.array(
            [
                resistance(self.study.resistance_law, HALF, csd, material.density, material.sphericity)
                for csd in self.products
            ]
        )

        def of_porosity(place: int, porosity: FloatArray) -> FloatArray:
            # every law is a constant times (1 - eps)/eps^3
            return np.asarray(at_half[place] * (1.0 - porosity) / porosity**3 * HALF**2)

        def span(given: Sequence[float] | None, fixed: float, unit: float = 1.0) -> tuple[float, float]:
            return (fixed * unit, fixed * unit) if given is None else (given[0] * unit, given[1] * unit)

        rpm = 1.0 / MINUTE
        return Problem(
            plant=self.plant,
            residence_times=self.residence_times,
            sauter_means=np.array([csd.sauter_mean for csd in self.products]),
            resistance=of_porosity,
            pressure_drops=self.pressures,
            ranges={
                "slurry_concentration": span(
                    variables.slurry_concentration_kg_m3, crystallizer.slurry_concentration_kg_m3
                ),
                "submerged_fraction": span(variables.submerged_fraction, settings.submerged_fraction),
                "rotation_rate": span(variables.rotation_rate_rpm, settings.rotation_rate_rpm, rpm),
            },
            filter_types=tuple(variables.filter_type),
            objective=self.design.objective,
            target=self.design.relative_ci95_target,
            tolerance=self.design.objective_tolerance,
        )

    @property
    def plant(self) -> Plant:
        """What is the same in every design."""
        crystallizer, settings, design = self.study.crystallizer, self.study.filter, self.design
        if crystallizer is None or settings is None:
            raise ValueError("the study has no crystallizer or no filter and was not loaded")
        limits, thickness = design.constraints, design.constraints.cake_thickness_mm
        suction = None
        if design.deliquoring_share is not None and design.surface_tension_mN_m is not None:
            suction = Suction(design.deliquoring_share, design.surface_tension_mN_m * MILLINEWTON)
        return Plant(
            production=crystallizer.slurry_concentration_kg_m3 * crystallizer.slurry_flow_m3_h / HOUR,
            density=self.study.material.density,
            viscosity=settings.viscosity_mPa_s * MILLIPASCAL_SECOND,
            liquid_density=settings.liquid_density_kg_m3,
            medium_resistance=settings.medium_resistance_1_m,
            crystallizer_cost=self.correlations[design.costs.crystallizer],
            filter_cost={kind: self.correlations[self.filter_costs(kind)[0]] for kind in design.variables.filter_type},
            cost_index=design.costs.cost_index,
            currency_per_usd=design.costs.currency_per_usd,
            limits=Limits(
                thinnest=0.0 if thickness is None else thickness[0] * MILLIMETRE,
                thickest=np.inf if thickness is None else thickness[1] * MILLIMETRE,
                largest_area=limits.largest_filter_area_m2 or np.inf,
                largest_medium_share=limits.largest_medium_share or 1.0,
            ),
            turnaround=(design.turnaround_min or 0.0) * MINUTE,
            suction=suction,
        )

    def filter_costs(self, filter_type: str) -> list[str]:
        """Names of the cost correlations of a filter type, the one that counts first."""
        names = [name for name, item in self.correlations.items() if item.equipment == EQUIPMENT[filter_type]]
        return sorted(names, key=lambda name: name != self.design.costs.filter)

    @cached_property
    def estimates(self) -> list[LevelEstimate]:
        """The instant estimate at every residence time that may be packed."""
        return [self._estimate(time) for time in self.levels]

    def _estimate(self, time: float) -> LevelEstimate:
        truncation = self.study.csds[product_name(time)].truncation
        packed = truncate(self._product(time * MINUTE), **truncation).csd
        base = {name: self.study.base(name) for name in SWEPT}
        protocol, rows = self.study.packing.protocol, []
        outside: tuple[str, ...] = ()
        for pressure in self.pressures / KILOPASCAL:
            scene = scene_of(self.study, packed, {**base, "pressure_kPa": float(pressure)}, protocol)
            found = shipped()[protocol].estimate(scene)
            mean, one = found.half_widths(partial(_porosity, scene))
            unknown, whole = mean / quantile(), one / quantile()
            scatter = np.sqrt(max(whole**2 - unknown**2, 0.0))
            rows.append((cake_of(scene, found.curve).porosity, unknown, scatter))
            outside = found.outside
            if not scene.is_pressed:  # beds know no pressure
                rows = rows * self.pressures.size
                break
        porosity, deviation, scatters = np.array(rows).T
        return LevelEstimate(porosity, deviation, scatters, outside)

    @cached_property
    def prior(self) -> Belief:
        """What is known of the porosity before the first packing."""
        return Belief.prior([time * MINUTE for time in self.levels], self.estimates, BETWEEN)

    def measured(self, names: Iterable[str], packings: Path, tables: Iterable[str]) -> pd.DataFrame:
        """Tabulate the packings named, failed ones too; a pressed one has a row for each pressure drop.

        The columns are those of :func:`filtercake.results.replicates.replicates_table`, level and batch.
        """
        csds, wanted, rows = read_tables(tables), set(names), []
        material, law = self.study.material, self.study.resistance_law
        for ask in self.asks:
            if ask.point.packings not in wanted:
                continue
            folder = packings / ask.point.packings
            outcomes = [Outcome(**entry) for entry in read_record(folder / MANIFEST)["replicates"]]
            scene = ask.point.scene
            for pressure in self.pressures if scene.is_pressed else [scene.pressure]:
                point = replace(ask.point, scene=replace(scene, pressure=float(pressure)))
                for row in replicate_rows(point, outcomes, folder, csds[point.csd], material.sphericity, law):
                    rows.append({**row, "level": ask.level, "batch": ask.batch})
        return pd.DataFrame(rows, columns=[*REPLICATE_COLUMNS, "level", "batch"])

    def found(self, table: pd.DataFrame) -> Found:
        """Take from the table of packings what the search needs."""
        porosity: dict[str, FloatArray] = {}
        for name, rows in table.groupby("packings", sort=False):
            good = rows[rows["status"] == "ok"]
            each = [one["porosity"].to_numpy(np.float64) for _, one in good.groupby("replicate")]
            # a bed has one porosity, whatever the pressure drop
            values = [np.broadcast_to(one, self.pressures.shape) for one in each]
            porosity[str(name)] = np.array(values).reshape(len(each), self.pressures.size)
        return Found(porosity, len(table.drop_duplicates(["packings", "replicate"])))


def _porosity(scene: Scene, curve: CompressionCurve) -> float:
    """Porosity of a scene's cake, from that against the load."""
    return cake_of(scene, curve).porosity
