"""The paper's tables made of our values."""

from __future__ import annotations

from math import nan
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from filtercake.errors import CrystallizerError, FilterError
from filtercake.filtration.drum_filter import area
from filtercake.filtration.resistance import law_relative_ci95, resistance
from filtercake.results.filter_design import drum_of, filter_design
from filtercake.results.paper_tables import (
    COMPARISON_COLUMNS,
    CRYSTALLIZER_COLUMNS,
    comparison,
    crystallizer_table,
    published_value,
    table1,
    table2,
    table4,
)
from filtercake.results.replicates import REPLICATE_COLUMNS, summarise
from filtercake.results.resistance_columns import LAW, resistance_columns
from filtercake.study.loading import LoadedStudy, load_study
from filtercake.study.points import expand

REPOSITORY = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def pmma_study() -> LoadedStudy:
    return load_study(REPOSITORY / "config" / "studies" / "pmma.yaml")


@pytest.fixture(scope="module")
def alum_study() -> LoadedStudy:
    return load_study(REPOSITORY / "config" / "studies" / "alum.yaml")


def csds(study: LoadedStudy) -> dict:
    return {name: (loaded.full, loaded.truncated) for name, loaded in study.csds.items()}


def test_table_1(pmma_study: LoadedStudy) -> None:
    table = table1(pmma_study.model, csds(pmma_study)).set_index("csd")
    expected = {"pmma_75_25": (249.99, 250), "pmma_50_50": (282.29, 282), "pmma_25_75": (342.45, 342)}
    for name, (length, published) in expected.items():
        assert table.loc[name, "system_dimension_um"] == pytest.approx(length, abs=0.006)
        assert table.loc[name, "system_dimension_at_published_um"] == table.loc[name, "system_dimension_um"]
        assert table.loc[name, "published_um"] == published


TIMES = {"tau_15min": 5046, "tau_30min": 5808, "tau_45min": 6352, "tau_60min": 6658}


def test_table_1_of_alum_is_for_another_number_of_spheres(alum_study: LoadedStudy) -> None:
    table = table1(alum_study.model, csds(alum_study)).set_index("csd")
    for name, published in TIMES.items():
        assert table.loc[name, "published_um"] == published
        assert table.loc[name, "published_particles"] == 100_000
        assert round(table.loc[name, "system_dimension_at_published_um"]) == published
        ratio = table.loc[name, "system_dimension_um"] / table.loc[name, "system_dimension_at_published_um"]
        fewer = table.loc[name, "particles"] / 100_000 / alum_study.model.packing.bed_depth_factor
        assert ratio == pytest.approx(fewer ** (1 / 3), rel=1e-5)


def test_table_2(alum_study: LoadedStudy) -> None:
    table = table2(alum_study.model, csds(alum_study)).set_index("csd")
    printed = [(32.5, 543.3, 0.981), (37.6, 613.4, 0.979), (42.6, 653.4, 0.977), (42.5, 688.2, 0.976)]
    for name, (smallest, largest, kept) in zip(TIMES, printed, strict=True):
        row = table.loc[name]
        assert (row["published_smallest_um"], row["published_largest_um"]) == (smallest, largest)
        assert (row["smallest_um"], row["largest_um"]) == pytest.approx((smallest, largest), abs=0.06)
        assert row["kept_volume_fraction"] == pytest.approx(kept, abs=0.001)
        assert row["kept_volume_fraction"] + row["discarded_volume_fraction"] == pytest.approx(1.0, abs=2e-5)


def test_table_2_of_a_truncation_by_size(study_from, good_study: str) -> None:
    study = study_from(good_study.replace("    mixture:", "    truncate_below_um: 30\n    mixture:"))
    (row,) = table2(study.model, csds(study)).to_dict("records")
    assert (row["truncate_below_um"], row["classes"], row["smallest_um"]) == (30.0, 1, 50.0)
    assert (row["kept_volume_fraction"], row["discarded_volume_fraction"]) == (0.5, 0.5)


def test_the_crystallizer(alum_study: LoadedStudy) -> None:
    states = {name: loaded.crystallizer for name, loaded in reversed(alum_study.csds.items()) if loaded.crystallizer}
    table = crystallizer_table(alum_study.model, states, csds(alum_study))
    assert tuple(table.columns) == CRYSTALLIZER_COLUMNS
    assert table["csd"].to_list() == list(TIMES)
    assert table["kinetics"].unique().tolist() == ["ammonium_alum"]
    assert table["residence_time_min"].to_list() == [15.0, 30.0, 45.0, 60.0]
    assert table["crystallizer_volume_m3"].to_list() == [5.0, 10.0, 15.0, 20.0]
    scale = [58.417, 67.103, 72.771, 77.081]
    assert table["size_scale_um"].to_list() == pytest.approx(scale, abs=5e-4)
    assert table["mass_mean_size_um"].to_list() == pytest.approx([4.0 * value for value in scale], abs=2e-3)
    assert table["growth_rate_m_s"].to_list() == pytest.approx([6.4907e-8, 3.7279e-8, 2.6952e-8, 2.1411e-8], rel=3e-5)
    rates = [7.5833e4, 2.5016e4, 1.3076e4, 8.2521e3]
    assert table["nucleation_rate_1_L_s"].to_list() == pytest.approx(rates, rel=5e-5)
    assert table["kept_volume_fraction"].to_list() == pytest.approx([0.981, 0.979, 0.977, 0.976], abs=0.001)


def test_a_study_without_a_crystallizer_has_no_table_of_it(pmma_study: LoadedStudy) -> None:
    with pytest.raises(CrystallizerError, match="has no crystallizer"):
        crystallizer_table(pmma_study.model, {}, csds(pmma_study))


PRINTED = {
    "tau_15min": (0.293, 3.44),
    "tau_30min": (0.2925, 3.15),
    "tau_45min": (0.2925, 3.00),
    "tau_60min": (0.292, 2.905),
}
"""The paper's porosities of alum, and the filter areas that follow from them, m2."""


def designed(alum_study: LoadedStudy, law: str) -> pd.DataFrame:
    """Filters of cakes with the paper's porosities, and a spread of 1 % in resistance."""
    rows = []
    for point in expand(alum_study, lambda *_: "embedded"):
        porosity = PRINTED[point.csd][0]
        for sign in (-1, 1):
            row = {**point.row(), "status": "ok", "porosity": porosity, "porosity_paper_count": porosity}
            columns = resistance_columns(law, porosity, csds(alum_study)[point.csd], 2450.0, 1.0)
            scaled = {name: value * (1 + 0.01 * sign) if name != LAW else value for name, value in columns.items()}
            rows.append({**row, **scaled})
    replicates = pd.DataFrame(rows).reindex(columns=list(REPLICATE_COLUMNS))
    for column in ("soft_contact_compaction", "pull_off_over_weight", "overlap_max", "wall_s"):
        replicates[column] = 1.0
    model = alum_study.model.model_copy(update={"resistance_law": law})
    return filter_design(model, csds(alum_study), summarise(replicates)).set_index("csd")


def test_the_filter_by_the_paper_s_own_porosities(alum_study: LoadedStudy) -> None:
    table = designed(alum_study, "additive")
    assert list(table["crystallizer_volume_m3"]) == pytest.approx([5, 10, 15, 20])
    for name, (_, published) in PRINTED.items():
        row = table.loc[name]
        assert row["filter_area_m2"] == pytest.approx(published, rel=0.002)
        assert row["filter_area_low_m2"] < row["filter_area_m2"] < row["filter_area_high_m2"]
        assert 0.50 < row["medium_share"] < 0.60
    # the paper's text gives the first and the last
    assert table["published_area_m2"].to_list() == pytest.approx([3.4, nan, nan, 2.9], nan_ok=True)


@pytest.mark.parametrize("law", ["additive", "carman"])
def test_the_filter_follows_the_study_s_law(alum_study: LoadedStudy, law: str) -> None:
    table = designed(alum_study, law)
    drum, flow = drum_of(alum_study.model), 20.0 / 3600.0
    for name, (porosity, _) in PRINTED.items():
        row, full = table.loc[name], alum_study.csds[name].full
        alpha = {each: resistance(each, porosity, full, 2450.0) for each in ("additive", "carman")}
        assert row["resistance_law"] == law and row["resistance_m_kg"] == pytest.approx(alpha[law])
        half = alpha[law] * law_relative_ci95(law, full)
        ends = [float(area(drum, value, flow)) for value in (alpha[law], alpha[law] - half, alpha[law] + half)]
        columns = ("filter_area_m2", "filter_area_law_low_m2", "filter_area_law_high_m2")
        assert [row[column] for column in columns] == pytest.approx(ends)
        both = {each: float(area(drum, value, flow)) for each, value in alpha.items()}
        assert (row["filter_area_additive_m2"], row["filter_area_carman_m2"]) == pytest.approx(tuple(both.values()))
        assert row["area_change_by_carman"] == pytest.approx(both["carman"] / both["additive"] - 1.0)
        assert -0.2 < row["area_change_by_carman"] < -0.1


def test_a_study_without_a_filter_has_no_design(pmma_study: LoadedStudy) -> None:
    with pytest.raises(FilterError, match="has no filter"):
        filter_design(pmma_study.model, csds(pmma_study), pd.DataFrame())


def test_table_4_by_the_paper_s_own_porosities(pmma_study: LoadedStudy) -> None:
    # put the paper's porosities in place of ours: eq. 3 must give the paper's resistances (3 figures printed)
    printed = {"pmma_75_25": (0.392, 3.04e9), "pmma_50_50": (0.359, 3.06e9), "pmma_25_75": (0.358, 1.97e9)}
    rows = []
    for point in expand(pmma_study, lambda *_: "embedded"):
        porosity = printed[point.csd][0] if point.scene.cohesion == 50e3 and point.scene.friction == 0 else 0.5
        if (point.scene.poisson_ratio, point.scene.restitution) != (0.2, 0.3):
            porosity = 0.6
        row = {**point.row(), "status": "ok", "porosity": porosity - 0.01, "porosity_paper_count": porosity}
        rows.append({**row, **resistance_columns("carman", porosity - 0.01, csds(pmma_study)[point.csd], 1180.0, 1.0)})
    replicates = pd.DataFrame(rows).reindex(columns=list(REPLICATE_COLUMNS))
    for column in (
        "soft_contact_compaction",
        "pull_off_over_weight",
        "overlap_max",
        "wall_s",
    ):
        replicates[column] = 1.0
    table = table4(pmma_study.model, csds(pmma_study), summarise(replicates)).set_index("csd")
    # one row by each engine that packed the mixture, the study's own first
    assert list(table.index) == [name for name in printed for _ in range(2)]
    assert table["engine"].tolist() == ["embedded", "liggghts"] * 3
    table = table[table["engine"] == "embedded"]
    for name, (porosity, alpha) in printed.items():
        assert table.loc[name, "porosity_paper_count"] == porosity
        assert table.loc[name, "porosity"] == pytest.approx(porosity - 0.01)
        assert table.loc[name, "resistance_paper_count_m_kg"] == pytest.approx(alpha, rel=0.005)
        assert table.loc[name, "resistance_published_m_kg"] == alpha
        # the paper's own comparison is by eq. 3, whatever the study's law; both laws stand side by side
        full = pmma_study.csds[name].full
        assert table.loc[name, "resistance_law"] == "carman"
        assert table.loc[name, "resistance_m_kg"] == table.loc[name, "resistance_carman_m_kg"]
        for law in ("additive", "carman"):
            own = resistance(law, porosity - 0.01, full, 1180.0)
            assert table.loc[name, f"resistance_{law}_m_kg"] == pytest.approx(own)
        relative = table.loc[name, "resistance_law_ci95_m_kg"] / table.loc[name, "resistance_m_kg"]
        assert relative == pytest.approx(law_relative_ci95("carman", full))
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


def packings(study: LoadedStudy, porosities: dict[str, list[float]]) -> pd.DataFrame:
    """Replicates of a study's points, porosity by the paper's count; the interior's is 0.01 less."""
    return pd.DataFrame(
        [
            {**point.row(), "status": "ok", "porosity": value - 0.01, "porosity_paper_count": value}
            for point in expand(study, lambda *_: "embedded")
            for value in porosities.get(point.csd, [])
        ]
    )


def test_published_porosities_beside_one_packing_have_a_blank_spread(alum_study: LoadedStudy) -> None:
    table = comparison(alum_study.model, packings(alum_study, {"tau_15min": [0.296]}))
    assert tuple(table.columns) == COMPARISON_COLUMNS
    (row,) = table.to_dict("records")
    assert (row["csd"], row["n"], row["published"], row["engine"]) == ("tau_15min", 1, 0.293, "embedded")
    assert (row["porosity_paper_count"], row["porosity"]) == pytest.approx((0.296, 0.286))
    assert np.isnan(row["sd"]) and np.isnan(row["deviation_sd"])


def test_one_packing_is_held_against_the_other_points_spread(alum_study: LoadedStudy) -> None:
    made = packings(alum_study, {"tau_15min": [0.296], "tau_30min": [0.29, 0.294], "tau_45min": [0.29, 0.298]})
    table = comparison(alum_study.model, made).set_index("csd")
    assert table["n"].to_dict() == {"tau_15min": 1, "tau_30min": 2, "tau_45min": 2}
    sd = (0.5 * (0.002**2 * 2 + 0.004**2 * 2)) ** 0.5
    assert table["sd"].to_list() == pytest.approx([sd] * 3)
    assert table.loc["tau_15min", "deviation_sd"] == pytest.approx((0.293 - 0.296) / sd)
