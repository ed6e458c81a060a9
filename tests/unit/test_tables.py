"""The paper's tables made of our values."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from filtercake.config_loading import LoadedStudy, load_study
from filtercake.study import expand, summarise
from filtercake.tables import published_value, table1, table4

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def pmma_study() -> LoadedStudy:
    return load_study(REPOSITORY / "config" / "studies" / "pmma.yaml")


def csds(study: LoadedStudy) -> dict:
    return {name: (loaded.full, loaded.truncated) for name, loaded in study.csds.items()}


def test_table_1(pmma_study: LoadedStudy) -> None:
    table = table1(pmma_study.model, csds(pmma_study)).set_index("csd")
    expected = {"pmma_75_25": (249.99, 249, 250), "pmma_50_50": (282.29, 282, 282), "pmma_25_75": (342.45, 342, 342)}
    for name, (length, whole, published) in expected.items():
        assert table.loc[name, "system_dimension_um"] == pytest.approx(length, abs=0.006)
        assert table.loc[name, "system_dimension_whole_um"] == whole
        assert table.loc[name, "published_um"] == published


def test_table_4_by_the_paper_s_own_porosities(pmma_study: LoadedStudy) -> None:
    # put the paper's porosities in place of ours: eq. 3 must give the paper's resistances (3 figures printed)
    printed = {"pmma_75_25": (0.392, 3.04e9), "pmma_50_50": (0.359, 3.06e9), "pmma_25_75": (0.358, 1.97e9)}
    rows = []
    for point in expand(pmma_study, lambda _csd, _n: "liggghts"):
        porosity = printed[point.csd][0] if point.spec.cohesion == 50e3 and point.spec.friction == 0 else 0.5
        if (point.spec.poisson_ratio, point.spec.restitution) != (0.2, 0.3):
            porosity = 0.6
        rows.append({**point.row(), "status": "ok", "porosity": porosity - 0.01, "porosity_as_published": porosity})
    replicates = pd.DataFrame(rows)
    for column in ("resistance_m_kg", "resistance_sauter_m_kg", "soft_contact_compaction", "overlap_max", "wall_s"):
        replicates[column] = 1.0
    table = table4(pmma_study.model, csds(pmma_study), summarise(replicates)).set_index("csd")
    assert list(table.index) == list(printed)
    for name, (porosity, alpha) in printed.items():
        assert table.loc[name, "porosity_as_published"] == porosity
        assert table.loc[name, "porosity"] == pytest.approx(porosity - 0.01)
        assert table.loc[name, "resistance_as_published_m_kg"] == pytest.approx(alpha, rel=0.005)
        assert table.loc[name, "resistance_published_m_kg"] == alpha
    assert table.loc["pmma_25_75", "resistance_measured_m_kg"] == 1.48e9


def test_published_values_are_found_by_what_they_are(study_from, good_study: str) -> None:
    published = """
published:
  - {csd: bimodal, quantity: porosity, value: 0.359, source: a, kind: simulation}
  - {csd: bimodal, quantity: porosity, value: 0.35, source: b, kind: measurement}
  - {csd: bimodal, quantity: porosity, value: 0.34, source: c, kind: measurement}
"""
    study = study_from(good_study + published).model
    simulated = published_value(study, "bimodal", "porosity", "simulation")
    measured = published_value(study, "bimodal", "porosity", "measurement")
    assert simulated is not None
    assert measured is not None
    assert (simulated.value, measured.value) == (0.359, 0.35)  # the first
    assert published_value(study, "bimodal", "resistance_m_kg", "measurement") is None
    assert published_value(study, "other", "porosity", "measurement") is None
