"""The filter that a study's slurries need."""

from __future__ import annotations

import numpy as np
import pandas as pd

from filtercake.errors import FilterError
from filtercake.filtration.drum_filter import Cake, DrumFilter, area, design_table
from filtercake.results.paper_tables import Csds, published_number
from filtercake.study.config.filter import Filter
from filtercake.study.config.study import Study
from filtercake.units import HOUR, KILOPASCAL, MILLIPASCAL_SECOND, MINUTE


def filter_design(study: Study, csds: Csds, summary: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the drum filter that every point's slurry needs (paper, eq. 10 and Fig. 14).

    The columns are crystallizer volume, porosity and resistance, those of
    :data:`filtercake.filtration.drum_filter.DESIGN_COLUMNS`, the area at both ends of the resistance's 95 % interval,
    and the published area.

    Raises
    ------
    FilterError
        If the study has no filter, or its values leave the model's range.
    """
    if study.filter is None or study.crystallizer is None:
        raise FilterError("the study has no filter: add the sections crystallizer and filter")
    drum = drum_of(study)
    flow = study.crystallizer.slurry_flow_m3_h / HOUR
    names = [str(name) for name in summary["csd"]]
    cakes = [
        Cake(resistance, porosity, study.material.density, csds[name][0].sauter_mean, csds[name][1].largest)
        for name, resistance, porosity in zip(
            names, summary["resistance_m_kg"].to_list(), summary["porosity"].to_list(), strict=True
        )
    ]
    columns = ["point", "csd", "residence_time_min", "cohesion_kJ_m3", "friction", "engine", "n", "n_failed"]
    columns += ["porosity", "porosity_ci95", "resistance_m_kg", "resistance_ci95_m_kg"]
    table = summary[columns].reset_index(drop=True)
    table.insert(3, "crystallizer_volume_m3", flow * MINUTE * table["residence_time_min"])
    table = pd.concat([table, design_table(drum, cakes, flow, study.filter.liquid_density_kg_m3)], axis=1)
    for name, sign in (("filter_area_low_m2", -1.0), ("filter_area_high_m2", 1.0)):
        # an interval wider than the mean ends just above 0: without a medium, eq. 10 needs some resistance
        smallest = float(np.finfo(np.float64).tiny)
        ends = (table["resistance_m_kg"] + sign * table["resistance_ci95_m_kg"]).clip(lower=smallest)
        known = ends.notna()
        table.loc[known, name] = area(drum, ends[known].to_numpy(np.float64), flow)
    table["published_area_m2"] = [published_number(study, name, "filter_area_m2", "simulation") for name in names]
    return table


def drum_of(study: Study) -> DrumFilter:
    """Return the study's drum filter, in SI.

    Raises
    ------
    FilterError
        If the study has none.
    """
    if study.filter is None or study.crystallizer is None:
        raise FilterError("the study has no filter: add the sections crystallizer and filter")
    return drum_filter(study.filter, study.crystallizer.slurry_concentration_kg_m3)


def drum_filter(settings: Filter, slurry_concentration: float) -> DrumFilter:
    """Return a drum filter for a slurry with so many kg of crystals per m3, in SI."""
    return DrumFilter(
        pressure_drop=settings.pressure_drop_kPa * KILOPASCAL,
        submerged_fraction=settings.submerged_fraction,
        rotation_rate=settings.rotation_rate_rpm / MINUTE,
        medium_resistance=settings.medium_resistance_1_m,
        viscosity=settings.viscosity_mPa_s * MILLIPASCAL_SECOND,
        slurry_concentration=slurry_concentration,
    )
