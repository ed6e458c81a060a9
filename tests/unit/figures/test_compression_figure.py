"""The figure of pressed cakes: what it draws is what the packings and the tables hold."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from filtercake.crystals.csd import mixture
from filtercake.figures import style
from filtercake.figures.catalogue import draw, figures_of
from filtercake.figures.compression import families
from filtercake.figures.selection import StudyData
from filtercake.filtration.compressible import cake_average
from filtercake.packing.compression import LOADS, CompressionCurve
from filtercake.packing.result import Packing
from filtercake.report import captions
from filtercake.results.replicates import REPLICATE_COLUMNS, summarise
from filtercake.results.resistance_columns import resistance_columns
from filtercake.study.config.study import Study
from filtercake.study.points import expand

CSD = mixture([20e-6, 50e-6], [0.5, 0.5])
STRENGTH = 0.4  # kPa
STUDY: dict[str, Any] = {
    "csds": {"a": {"mixture": [{"size_um": 20, "volume_fraction": 0.5}, {"size_um": 50, "volume_fraction": 0.5}]}},
    "material": {"density_kg_m3": 1180, "adhesion_mJ_m2": 10},
    "resistance_law": "carman",
    "packing": {"protocol": "filtration", "pressure_kPa": 50},
    "sweeps": [{"csd": "a", "pressure_kPa": [10, 50, 200]}],
}


def curve(replicate: int) -> list[dict[str, float | None]]:
    return [
        {"load": None if math.isinf(x) else x, "porosity": 0.335 + 0.001 * replicate + 0.1 / (1.0 + x / 2.0)}
        for x in LOADS
    ]


@pytest.fixture
def data(tmp_path: Path) -> StudyData:
    rows = []
    for replicate in range(3):
        record = {"protocol": "filtration", "loads": curve(replicate), "replicate": replicate}
        position, radius = np.full((2, 3), 2e-5), np.array([1e-5, 5e-6])
        Packing(position, radius, 5e-5, record).save(tmp_path / "shared" / f"r{replicate}.npz")
        for pressure in (10.0, 50.0, 200.0):
            cake = cake_average(pressure / STRENGTH, CompressionCurve.of(record).at)
            rows.append(
                {
                    "point": f"p{pressure:g}",
                    "packings": "shared",
                    "study": "made_up",
                    "csd": "a",
                    "protocol": "filtration",
                    "cohesion_kJ_m3": 0.0,
                    "adhesion_mJ_m2": 10.0,
                    "pressure_kPa": pressure,
                    "friction": 0.0,
                    "poisson_ratio": 0.2,
                    "restitution": 0.3,
                    "youngs_modulus_MPa": 5.0,
                    "engine": "embedded",
                    "replicate": replicate,
                    "status": "ok",
                    "porosity": cake.porosity,
                    "porosity_at_medium": cake.porosity_at_medium,
                    "compressibility": cake.exponent,
                    "load_over_strength": pressure / STRENGTH,
                    **resistance_columns("carman", cake.porosity, (CSD, CSD), 1180.0, 1.0),
                }
            )
    table = pd.DataFrame(rows, columns=list(REPLICATE_COLUMNS))
    summary = summarise(table)
    return StudyData("made_up", Study.model_validate(STUDY), summary, summary, table, {"a": (CSD, CSD)}, tmp_path)


def test_lines_go_through_the_points_of_the_tables(data: StudyData) -> None:
    porosity, resistance, _ = draw("cake_compression", data).axes
    for axes, column in ((porosity, "porosity"), (resistance, "resistance_m_kg")):
        line = next(line for line in axes.get_lines() if len(line.get_xdata()) > 10)
        for _, row in data.summary.iterrows():
            # the mean over packings of a resistance is not that of the mean porosity
            found = np.interp(math.log(row["pressure_kPa"]), np.log(line.get_xdata()), line.get_ydata())
            assert found == pytest.approx(row[column], rel=5e-3)


def test_the_porosity_falls_from_the_surface_to_the_medium(data: StudyData) -> None:
    figure = draw("cake_compression", data)
    (line,) = figure.axes[2].get_lines()
    porosity, height = line.get_data()
    assert (height[0], height[-1]) == (0.0, 1.0)
    assert (np.diff(porosity) >= 0.0).all()
    base = data.summary.set_index("point").loc["p50"]
    assert porosity[0] == pytest.approx(base["porosity_at_medium"], abs=1e-6)


def test_the_legend_has_the_exponent_and_the_footer_the_law(data: StudyData) -> None:
    figure = draw("cake_compression", data)
    exponent = data.summary.set_index("point").loc["p200", "compressibility"]
    (entry,) = (text.get_text() for text in figure.legends[0].get_texts())
    assert entry == f"a: n = {exponent:.3f}"
    footer = " ".join(figure.get_supxlabel().split())
    assert "Carman" in footer and "at 50 kPa" in footer and "n = 3 packings per point" in footer


def test_families_share_packings(data: StudyData) -> None:
    (family,) = families(data)
    assert len(family.curves) == 3 and family.strength == pytest.approx(STRENGTH)
    assert family.load(50.0) == pytest.approx(125.0)
    assert family.resistance(np.array([float(family.rows["porosity"].iloc[0])]))[0] == pytest.approx(
        float(family.rows["resistance_m_kg"].iloc[0])
    )


def test_nothing_accepted_is_said(data: StudyData, tmp_path: Path) -> None:
    import dataclasses

    failed = data.replicates.assign(status="failed", porosity=np.nan, resistance_m_kg=np.nan)
    summary = summarise(failed)
    empty = dataclasses.replace(data, replicates=failed, summary=summary, points=summary)
    figure = draw("cake_compression", empty)
    assert "all packings failed" in " ".join(text.get_text() for axes in figure.axes for text in axes.texts)


def test_shared_packings_count_once_and_points_are_told_by_what_they_have(data: StudyData) -> None:
    found = captions.study_values(data)
    assert found["counts"]["n"] == 3 and found["points"] == 3
    assert found["made"] == "are pressed from a random cloud as in a filter"
    assert found["lowest"]["where"] == "adhesion 10 mJ/m², friction 0, 10 kPa"
    assert found["highest"]["where"] == "adhesion 10 mJ/m², friction 0, 200 kPa"


def rubbing(data: StudyData, frictions: tuple[float, ...], adhesions: tuple[float, ...]) -> StudyData:
    """Points at 50 kPa of several frictions and adhesions, looser the higher both are."""
    base = data.replicates[data.replicates["pressure_kPa"] == 50.0]
    parts = [
        base.assign(
            point=f"mu{mu:g}_W{w:g}",
            friction=mu,
            adhesion_mJ_m2=w,
            porosity=base["porosity"] + 0.1 * mu + 0.001 * w,
            resistance_m_kg=base["resistance_m_kg"] * (1.0 - mu) * (1.0 - 0.01 * w),
        )
        for mu in frictions
        for w in adhesions
    ]
    table = pd.concat(parts, ignore_index=True)
    summary = summarise(table)
    return dataclasses.replace(data, points=summary, summary=summary, replicates=table)


class TestFriction:
    @pytest.mark.parametrize(
        ("frictions", "adhesions", "along", "lines"),
        [
            ((0.0, 0.1, 0.3), (1.0, 10.0), "friction", 2),
            ((0.0, 0.1, 0.3), (10.0,), "friction", 1),
            ((0.0,), (1.0, 10.0), "adhesion_mJ_m2", 1),
        ],
    )
    def test_lines_are_the_table_s(self, data: StudyData, frictions, adhesions, along: str, lines: int) -> None:
        data = rubbing(data, frictions, adhesions)
        porosity, resistance = draw("cake_friction", data).axes
        assert porosity.get_xlabel() == resistance.get_xlabel() == style.AXES[along]
        for axes, name in ((porosity, "porosity"), (resistance, "resistance_m_kg")):
            drawn = [container.lines[0].get_ydata() for container in axes.containers]
            assert len(drawn) == lines
            for values, (_, rows) in zip(
                drawn, data.summary.groupby("adhesion_mJ_m2" if along == "friction" else "friction"), strict=True
            ):
                np.testing.assert_allclose(values, rows.sort_values(along)[name])

    def test_without_a_pressure_of_its_own_a_study_s_first_is_shown(self, data: StudyData) -> None:
        both = rubbing(data, (0.0, 0.1), (10.0,))
        other = both.summary.assign(point=both.summary["point"] + "_p", pressure_kPa=200.0, porosity=0.9)
        packing = both.study.packing.model_copy(update={"pressure_kPa": None})
        study = both.study.model_copy(update={"packing": packing})
        both = dataclasses.replace(both, study=study, summary=pd.concat([both.summary, other], ignore_index=True))
        porosity, _ = draw("cake_friction", both).axes
        (drawn,) = porosity.containers
        assert len(drawn.lines[0].get_ydata()) == 2 and max(drawn.lines[0].get_ydata()) < 0.5

    def test_a_study_that_varies_them_has_the_figure(self, study_from, good_study: str) -> None:
        head = good_study[: good_study.index("sweeps:")]
        packing = "packing: {protocol: filtration, pressure_kPa: 50}\n"
        for block, shown in (
            ("friction: [0, 0.1]", True),
            ("adhesion_mJ_m2: [1, 10]", True),
            ("pressure_kPa: [20, 50]", False),
        ):
            study = study_from(f"{head}{packing}sweeps:\n  - {{csd: bimodal, {block}}}\n")
            assert ("cake_friction" in figures_of(expand(study, lambda *_: "embedded"), study.model)) == shown
