"""A study as its figures see it: tables, base points, accepted packings, and the published values beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from filtercake.crystals.crystallizer import SteadyState
from filtercake.crystals.csd import FullAndTruncated, read_tables
from filtercake.errors import PackingRejected
from filtercake.filtration.resistance import law_of
from filtercake.packing.result import Packing, read_record
from filtercake.results.tables import read_table
from filtercake.study.config.published import Published
from filtercake.study.config.study import Study
from filtercake.study.points import base_rows
from filtercake.units import LITRE, MICROMETRE, MINUTE

T = TypeVar("T")


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
    csds : dict of str to FullAndTruncated
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
    csds: dict[str, FullAndTruncated]
    packings: Path
    crystallizer: pd.DataFrame = field(default_factory=pd.DataFrame)

    @classmethod
    def read(
        cls, name: str, study: Mapping[str, Any], folder: Path, csds: Iterable[str], crystallizer: Iterable[str]
    ) -> StudyData:
        """Read a study's tables from its results (points.csv, summary.csv, replicates.csv, packings).

        ``study`` holds the values of its model, ``csds`` the tables of its distributions, named by them, and
        ``crystallizer`` the crystallizer's table, if it has one.
        """
        return cls(
            name=name,
            study=Study.model_validate(study),
            points=read_table(folder / "points.csv"),
            summary=read_table(folder / "summary.csv"),
            replicates=read_table(folder / "replicates.csv"),
            csds=read_tables(csds),
            packings=folder / "packings",
            crystallizer=next(map(read_table, crystallizer), pd.DataFrame()),
        )


def law_title(law: str) -> str:
    """Name of a resistance law for readers."""
    return law_of(law).title


def law_note(data: StudyData) -> str:
    """Say by which law a figure's resistances are."""
    return f"resistances by {law_title(data.study.resistance_law)}"


def folder(data: StudyData, point: str) -> str:
    """Name of the folder of a point's packings, which pressed points share."""
    return str(data.points.loc[data.points["point"] == point, "packings"].iloc[0])


def label(data: StudyData, csd: str) -> str:
    """Label of a distribution."""
    known = data.study.csds.get(csd)
    return (known.label if known else None) or csd


def number(data: StudyData, csd: str) -> int:
    """Index of a distribution in the study; it sets its colour in every figure."""
    return list(data.study.csds).index(csd)


def base_points(data: StudyData, protocol: str = "") -> pd.DataFrame:
    """Summary rows at the base material, one per distribution that has one, in the study's order of distributions.

    They are those of a protocol, the study's own if left out.
    """
    rows = base_rows(data.study, data.summary, ("protocol",))
    rows = rows[rows["protocol"] == (protocol or data.study.packing.protocol)]
    return rows.sort_values("csd", key=lambda names: names.map(lambda csd: number(data, csd)), kind="stable")


def other_engines(data: StudyData) -> pd.DataFrame:
    """Summary rows at the base material by engines that are not the study's own, in its own protocol."""
    rows = base_rows(data.study, data.summary, ("engine",))
    return rows[~rows["point"].isin(base_points(data)["point"])]


def main_point(data: StudyData) -> pd.Series[Any] | None:
    """Find the base point of the distribution with the most points; None where no sweep visits the base material."""
    rows = base_points(data)
    if rows.empty:
        return None
    counts = rows["csd"].map(data.summary["csd"].value_counts())
    return rows.iloc[int(np.argmax(counts.to_numpy()))]


def varied(data: StudyData, free: tuple[str, ...], *names: str) -> list[tuple[str, pd.DataFrame]]:
    """Distributions of which any of the properties ``names`` varies, with their summary rows.

    Of all other properties only ``free`` may differ from the base material.
    """
    rows = base_rows(data.study, data.summary, free)
    by_csd = ((csd, rows[rows["csd"] == csd]) for csd in data.study.csds)
    return [(csd, own) for csd, own in by_csd if any(own[name].nunique() > 1 for name in names)]


def published(data: StudyData, csd: str, quantity: str) -> list[Published]:
    """List the published values of a quantity for a distribution."""
    return [value for value in data.study.published if (value.csd, value.quantity) == (csd, quantity)]


def products(data: StudyData) -> list[tuple[str, float, SteadyState]]:
    """Distributions that the crystallizer makes, with its volume (m3) and state, smallest first."""
    return [
        (
            str(row["csd"]),
            float(row["crystallizer_volume_m3"]),
            SteadyState(
                growth_rate=float(row["growth_rate_m_s"]),
                nucleation_rate=float(row["nucleation_rate_1_L_s"]) / LITRE,
                size_scale=float(row["size_scale_um"]) * MICROMETRE,
                residence_time=float(row["residence_time_min"]) * MINUTE,
                slurry_concentration=float(row["slurry_concentration_kg_m3"]),
                kinetics=str(row["kinetics"]),
            ),
        )
        for _, row in data.crystallizer.iterrows()
    ]


def records(data: StudyData, point: str) -> tuple[list[tuple[int, dict[str, Any]]], str]:
    """Read the records of a point's accepted packings, with their replicates, and a note on the unreadable ones."""
    return _accepted(data, point, lambda npz: read_record(npz.with_suffix(".json")))


def packings(data: StudyData, point: str, most: int | None = None) -> tuple[list[tuple[int, Packing]], str]:
    """Read a point's accepted packings (the first few), with their replicates, and a note on the unreadable ones."""
    return _accepted(data, point, Packing.load, most)


def _accepted(
    data: StudyData, point: str, read: Callable[[Path], T], most: int | None = None
) -> tuple[list[tuple[int, T]], str]:
    rows = data.replicates
    good = rows[(rows["point"] == point) & (rows["status"] == "ok")]
    found: list[tuple[int, T]] = []
    lost = 0
    for replicate in sorted(good["replicate"].astype(int)):
        if len(found) == most:
            break
        try:
            found.append((replicate, read(data.packings / folder(data, point) / f"r{replicate}.npz")))
        except PackingRejected:
            lost += 1
    return found, f"{lost} packing{'' if lost == 1 else 's'} could not be read" if lost else ""
