"""The paper's tables with our values beside the published ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from filtercake.crystals.crystallizer import SteadyState
from filtercake.crystals.csd import FullAndTruncated, kept_volume
from filtercake.errors import CrystallizerError
from filtercake.filtration.resistance import kozeny_carman
from filtercake.packing.cloud import box_length
from filtercake.results.resistance_columns import ALWAYS, LAW, LAW_CI95
from filtercake.statistics import pooled_spread
from filtercake.study.config.published import Published
from filtercake.study.config.study import Study
from filtercake.study.points import base_rows
from filtercake.study.scenes import bed_of
from filtercake.units import HOUR, LITRE, MICROMETRE, MINUTE, tidy

Csds = dict[str, FullAndTruncated]

COMPARISON_COLUMNS = (
    "csd",
    "cohesion_kJ_m3",
    "friction",
    "engine",
    "source",
    "published",
    "n",
    "porosity_paper_count",
    "sd",
    "deviation_sd",
    "porosity",
)


CRYSTALLIZER_COLUMNS = (
    "csd",
    "kinetics",
    "residence_time_min",
    "crystallizer_volume_m3",
    "slurry_concentration_kg_m3",
    "growth_rate_m_s",
    "nucleation_rate_1_L_s",
    "size_scale_um",
    "mass_mean_size_um",
    "kept_volume_fraction",
)


def published_value(study: Study, csd: str, quantity: str, kind: str) -> Published | None:
    """First published value of a quantity for a distribution, None where there is none."""
    found = (p for p in study.published if (p.csd, p.quantity, p.kind) == (csd, quantity, kind))
    return next(found, None)


def published_number(study: Study, csd: str, quantity: str, kind: str) -> float:
    """Value of :func:`published_value`, nan where there is none."""
    found = published_value(study, csd, quantity, kind)
    return float("nan") if found is None else found.value


def table1(study: Study, csds: Csds) -> pd.DataFrame:
    """Tabulate the system dimension L of every distribution (paper, Table 1).

    The published value may be for another number of spheres: ``system_dimension_at_published_um`` is ours for that.
    """
    rows = []
    for name, (_, truncated) in csds.items():
        published = published_value(study, name, "system_dimension_um", "simulation")
        bed = bed_of(study.packing, truncated)
        particles = published.particles if published and published.particles else bed.particles
        length, same = (
            box_length(truncated, n, study.packing.initial_void_fraction, ratio) / MICROMETRE
            for n, ratio in ((bed.particles, bed.bed_depth_factor), (particles, 1.0))
        )
        rows.append(
            {
                "csd": name,
                "label": study.csds[name].label or name,
                "particles": bed.particles,
                "initial_void_fraction": study.packing.initial_void_fraction,
                "system_dimension_um": round(length, 2),
                "published_um": published_number(study, name, "system_dimension_um", "simulation"),
                "published_particles": particles if published else None,
                "system_dimension_at_published_um": round(same, 2) if published else None,
            }
        )
    return pd.DataFrame(rows)


def table2(study: Study, csds: Csds) -> pd.DataFrame:
    """Tabulate what each distribution keeps when classes are left out of the packing (paper, Table 2)."""
    rows = []
    for name, (full, truncated) in csds.items():
        kept = kept_volume(full, truncated)
        rows.append(
            {
                "csd": name,
                "label": study.csds[name].label or name,
                "residence_time_min": study.csds[name].residence_time_min,
                "truncate_below_volume_fraction": study.csds[name].truncate_below_volume_fraction,
                "truncate_below_um": study.csds[name].truncate_below_um,
                "truncate_above_um": study.csds[name].truncate_above_um,
                "classes": truncated.size.size,
                "smallest_um": round(truncated.smallest / MICROMETRE, 2),
                "largest_um": round(truncated.largest / MICROMETRE, 2),
                "kept_volume_fraction": round(kept, 5),
                "discarded_volume_fraction": round(max(1.0 - kept, 0.0), 5),
                "published_smallest_um": published_number(study, name, "smallest_um", "simulation"),
                "published_largest_um": published_number(study, name, "largest_um", "simulation"),
            }
        )
    return pd.DataFrame(rows)


def crystallizer_table(study: Study, states: Mapping[str, SteadyState], csds: Csds) -> pd.DataFrame:
    """Tabulate the crystallizer at every residence time, shortest first (paper, Figs 12 and 13).

    ``states`` holds the crystallizer behind each of its products. The columns are :data:`CRYSTALLIZER_COLUMNS`; the
    mean size is weighted by mass.

    Raises
    ------
    CrystallizerError
        If the study has no crystallizer.
    """
    if study.crystallizer is None:
        raise CrystallizerError("the study has no crystallizer: add the section crystallizer")
    flow = study.crystallizer.slurry_flow_m3_h / HOUR
    rows = [
        {
            "csd": name,
            "kinetics": state.kinetics,
            "residence_time_min": tidy(state.residence_time / MINUTE),
            "crystallizer_volume_m3": tidy(flow * state.residence_time),
            "slurry_concentration_kg_m3": state.slurry_concentration,
            "growth_rate_m_s": state.growth_rate,
            "nucleation_rate_1_L_s": state.nucleation_rate * LITRE,
            "size_scale_um": state.size_scale / MICROMETRE,
            "mass_mean_size_um": state.volume_mean / MICROMETRE,
            "kept_volume_fraction": round(kept_volume(*csds[name]), 5),
        }
        for name, state in sorted(states.items(), key=lambda item: item[1].residence_time)
    ]
    return pd.DataFrame(rows, columns=list(CRYSTALLIZER_COLUMNS))


def table4(study: Study, csds: Csds, summary: pd.DataFrame) -> pd.DataFrame:
    """Tabulate porosity and resistance at the base material (paper, Table 4).

    For every distribution: the published simulation, our estimate by the paper's own count, the interior slab
    (the answer), and the measurement. Resistances are of the full distribution: by the study's law, with its own
    interval, by the laws ``additive`` and ``carman`` beside it, and that of the paper's count by eq. 3 as in the paper.
    """
    rows, material = [], study.material
    every = [_by_engine(study, summary[summary["csd"] == name]) for name in csds]
    for _, point in pd.concat(every).iterrows() if every else ():
        name = str(point["csd"])
        full, _ = csds[name]
        paper_count = float(point["porosity_paper_count"])
        rows.append(
            {
                "csd": name,
                "label": study.csds[name].label or name,
                "n": int(point["n"]),
                "n_failed": int(point["n_failed"]),
                "engine": point["engine"],
                "porosity_measured": published_number(study, name, "porosity", "measurement"),
                "porosity_published": published_number(study, name, "porosity", "simulation"),
                "porosity_paper_count": paper_count,
                "porosity_paper_count_ci95": point["porosity_paper_count_ci95"],
                "porosity": point["porosity"],
                "porosity_ci95": point["porosity_ci95"],
                **_measured_resistance(published_value(study, name, "resistance_m_kg", "measurement")),
                "resistance_published_m_kg": published_number(study, name, "resistance_m_kg", "simulation"),
                "resistance_paper_count_m_kg": (
                    kozeny_carman(paper_count, full, material.density, material.sphericity)
                    if np.isfinite(paper_count)
                    else np.nan
                ),
                "resistance_m_kg": point["resistance_m_kg"],
                "resistance_ci95_m_kg": point["resistance_ci95_m_kg"],
                **{name: point[name] for name in (LAW, LAW_CI95, *(f"resistance_{law}_m_kg" for law in ALWAYS))},
                "resistance_sauter_m_kg": point["resistance_sauter_m_kg"],
            }
        )
    return pd.DataFrame(rows)


def _by_engine(study: Study, rows: pd.DataFrame) -> pd.DataFrame:
    """Return the base points of a distribution, one by each engine that packed it, the study's own first."""
    every = pd.concat([base_rows(study, rows), base_rows(study, rows, ("engine",))])
    return every.drop_duplicates("engine")


def _measured_resistance(published: Published | None) -> dict[str, float]:
    """Return a measured resistance, or the range where only that is known."""
    names = ("resistance_measured_m_kg", "resistance_measured_low_m_kg", "resistance_measured_high_m_kg")
    if published is None:
        return dict.fromkeys(names, np.nan)
    if published.low is None or published.high is None:
        return dict(zip(names, (published.value, np.nan, np.nan), strict=True))
    return dict(zip(names, (np.nan, published.low, published.high), strict=True))


def comparison(study: Study, replicates: pd.DataFrame) -> pd.DataFrame:
    """Compare published simulated porosities at visited points with ours by the same estimator.

    ``sd`` is the standard deviation of one packing, pooled over the study's points of the same engine: a few
    replicates of one point say little about it. ``deviation_sd`` is the published value's distance from our mean
    in these: a published value is one packing (or a few), so that within three of them it is no different. Both are
    blank where no point of the engine has two packings.
    """
    good = replicates[replicates["status"] == "ok"]
    pooled = {
        engine: pooled_spread(values for _, values in rows.groupby("point")["porosity_paper_count"]).sd
        for engine, rows in good.groupby("engine")
    }
    rows = []
    for entry in study.published:
        if entry.quantity != "porosity" or entry.cohesion_kJ_m3 is None or entry.friction is None:
            continue
        here = (replicates["csd"] == entry.csd) & (replicates["status"] == "ok")
        here &= np.isclose(replicates["cohesion_kJ_m3"], entry.cohesion_kJ_m3)
        here &= np.isclose(replicates["friction"], entry.friction)
        for name in ("poisson_ratio", "restitution", "youngs_modulus_MPa"):
            here &= np.isclose(replicates[name], getattr(study.material, name))
        for engine, own in replicates[here].groupby("engine", sort=False):
            values = own["porosity_paper_count"].to_numpy(np.float64)
            mean, sd = float(values.mean()), float(pooled.get(str(engine), np.nan))
            rows.append(
                (
                    *(entry.csd, entry.cohesion_kJ_m3, entry.friction, engine),
                    *(entry.source, entry.value, values.size, mean, sd, (entry.value - mean) / sd),
                    float(own["porosity"].mean()),
                )
            )
    return pd.DataFrame(rows, columns=list(COMPARISON_COLUMNS))
