"""The filter that a study's slurries need."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from filtercake.errors import FilterError
from filtercake.filtration.drum_filter import Cake, DrumFilter, area, design_table
from filtercake.results.paper_tables import Csds, published_number
from filtercake.results.resistance_columns import ALWAYS, LAW, LAW_CI95
from filtercake.study.config.filter import drum_filter
from filtercake.study.config.study import Study
from filtercake.units import HOUR, KILOPASCAL, MINUTE, FloatArray


def filter_design(study: Study, csds: Csds, summary: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the drum filter that every point's slurry needs (paper, eq. 10 and Fig. 14).

    The columns are crystallizer volume, porosity and resistance by the study's law, those of
    :data:`filtercake.filtration.drum_filter.DESIGN_COLUMNS`, the area at both ends of the resistance's 95 % interval
    over the packings (low, high) and of the law's own (law_low, law_high), the areas by the laws ``additive`` and
    ``carman`` and the relative change from the first to the second, and the published area. Pressed cakes are on the
    filter at their own pressure drop; ``compressibility`` is the exponent n of their resistance.

    Raises
    ------
    FilterError
        If the study has no filter, or its values leave the model's range.
    """
    if study.filter is None or study.crystallizer is None:
        raise FilterError("the study has no filter: add the sections crystallizer and filter")
    drum = drum_of(study)
    own = float(drum.pressure_drop) / KILOPASCAL
    pressures = summary["pressure_kPa"].astype(np.float64).fillna(own)
    parts = [
        _design(study, replace(drum, pressure_drop=float(pressure) * KILOPASCAL), csds, summary[pressures == pressure])
        for pressure in (pressures.unique() if len(summary) else [own])
    ]
    return pd.concat(parts).loc[summary.index].reset_index(drop=True)


def _design(study: Study, drum: DrumFilter, csds: Csds, summary: pd.DataFrame) -> pd.DataFrame:
    """Tabulate a drum at one pressure drop, with the index of the summary's rows."""
    if study.filter is None or study.crystallizer is None:
        raise FilterError("the study has no filter: add the sections crystallizer and filter")
    flow = study.crystallizer.slurry_flow_m3_h / HOUR
    names = [str(name) for name in summary["csd"]]
    cakes = [
        Cake(resistance, porosity, study.material.density, csds[name][0].sauter_mean, csds[name][1].largest)
        for name, resistance, porosity in zip(
            names, summary["resistance_m_kg"].to_list(), summary["porosity"].to_list(), strict=True
        )
    ]
    columns = ["point", "csd", "residence_time_min", "protocol", "cohesion_kJ_m3", "adhesion_mJ_m2", "pressure_kPa"]
    columns += ["friction", "engine", "n", "n_failed", "compressibility", "compressibility_ci95"]
    columns += ["porosity", "porosity_ci95", "resistance_m_kg", "resistance_ci95_m_kg", LAW, LAW_CI95]
    columns += [f"resistance_{law}_m_kg" for law in ALWAYS]
    table = summary[columns].reset_index(drop=True)
    table.insert(3, "crystallizer_volume_m3", flow * MINUTE * table["residence_time_min"])
    table = pd.concat([table, design_table(drum, cakes, flow, study.filter.liquid_density_kg_m3)], axis=1)
    mean = table["resistance_m_kg"]
    for name, half in (("", table["resistance_ci95_m_kg"]), ("law_", table[LAW_CI95])):
        table[f"filter_area_{name}low_m2"] = _areas(drum, mean - half, flow)
        table[f"filter_area_{name}high_m2"] = _areas(drum, mean + half, flow)
    for law in ALWAYS:
        table[f"filter_area_{law}_m2"] = _areas(drum, table[f"resistance_{law}_m_kg"], flow)
    table["area_change_by_carman"] = table["filter_area_carman_m2"] / table["filter_area_additive_m2"] - 1.0
    table["published_area_m2"] = [published_number(study, name, "filter_area_m2", "simulation") for name in names]
    return table.set_index(summary.index)


def _areas(drum: DrumFilter, resistance: pd.Series[float], flow: float) -> FloatArray:
    """Areas, m2, for resistances, m/kg; nan where there is none."""
    # an interval wider than the mean ends just above 0: without a medium, eq. 10 needs some resistance
    values = resistance.clip(lower=float(np.finfo(np.float64).tiny)).to_numpy(np.float64)
    found, known = np.full(values.shape, np.nan), np.isfinite(values)
    found[known] = area(drum, values[known], flow)
    return found


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
