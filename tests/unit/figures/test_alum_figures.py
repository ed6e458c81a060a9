"""Figures of a crystallizer and its filter: curves are the closed forms, points are the tables."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from filtercake.crystals.csd import mixture
from filtercake.figures import style
from filtercake.figures.catalogue import draw, figures_of
from filtercake.figures.selection import StudyData
from filtercake.figures.style import save
from filtercake.figures.truncation import class_edges
from filtercake.filtration.drum_filter import area, medium_share, resistance_for_cake_share
from filtercake.filtration.resistance import RESISTANCE_LAWS
from filtercake.results.filter_design import drum_of, filter_design
from filtercake.results.paper_tables import crystallizer_table
from filtercake.results.replicates import REPLICATE_COLUMNS, summarise
from filtercake.results.resistance_columns import resistance_columns
from filtercake.study.loading import LoadedStudy, load_study
from filtercake.study.points import expand, points_table

pytestmark = pytest.mark.filterwarnings("error")

STUDIES = Path(__file__).resolve().parents[3] / "config" / "studies"
NAMES = (
    "fig05_truncation",
    "fig12_distributions",
    "fig13_growth_nucleation",
    "fig14_resistance_area",
    "filter_area_sensitivity",
)
FILTER = NAMES[3:]
TIMES = ("tau_15min", "tau_30min", "tau_45min", "tau_60min")
VOLUMES = [5.0, 10.0, 15.0, 20.0]
SIZE_SCALES = [58.417, 67.103, 72.771, 77.081]
POROSITIES: list[float | None] = [0.292, 0.293, 0.294]
FLOW = 20.0 / 3600.0


def make(study: LoadedStudy, porosities: dict[str, list[float | None]] | None = None, **model: Any) -> StudyData:
    points = expand(study, lambda *_: "embedded")
    rows = []
    for point in points:
        sizes = (study.csds[point.csd].full, study.csds[point.csd].truncated)
        for k, porosity in enumerate((porosities or {}).get(point.csd, POROSITIES)):
            row: dict[str, Any] = {**point.row(), "replicate": k, "status": "failed", "reason": "not settled"}
            if porosity is not None:
                row |= {"status": "ok", "reason": "", "porosity": porosity, "porosity_paper_count": porosity}
                law = model.get("resistance_law", study.model.resistance_law)
                row |= {**resistance_columns(law, porosity, sizes, 2450.0, 1.0), "wall_s": 1.0}
            rows.append(row)
    replicates = pd.DataFrame(rows, columns=list(REPLICATE_COLUMNS))
    csds = {name: (loaded.full, loaded.truncated) for name, loaded in study.csds.items()}
    shown = study.model.model_copy(update=model)
    states = {name: loaded.crystallizer for name, loaded in study.csds.items() if loaded.crystallizer}
    return StudyData(
        name="alum",
        study=shown,
        points=points_table(points),
        summary=summarise(replicates),
        replicates=replicates,
        csds=csds,
        packings=Path("none"),
        crystallizer=crystallizer_table(study.model, states, csds),
    )


@pytest.fixture(scope="module")
def study() -> LoadedStudy:
    return load_study(STUDIES / "alum.yaml")


@pytest.fixture(scope="module")
def data(study: LoadedStudy) -> StudyData:
    return make(study)


@pytest.fixture(scope="module")
def failed(study: LoadedStudy) -> StudyData:
    return make(study, {"tau_30min": [None, None, None], "tau_45min": [0.293]})


@pytest.fixture(scope="module")
def design(data: StudyData) -> pd.DataFrame:
    return filter_design(data.study, data.csds, data.summary)


def marked(axes: Axes, gid: str) -> list[Any]:
    return [artist for artist in axes.get_children() if artist.get_gid() == gid]


def texts(figure: Figure) -> str:
    found = [text.get_text() for axes in figure.axes for text in axes.texts]
    found += [entry.get_text() for box in figure.legends for entry in box.get_texts()]
    return " ".join(" ".join([*found, figure.get_supxlabel()]).split())


def series(axes: Axes) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Abscissa, means and both ends of the intervals of every series with error bars."""
    found = []
    for container in axes.containers:
        assert isinstance(container, ErrorbarContainer)
        line, _, bars = container.lines
        ends = np.array([s[[0, -1], 1] if len(s) else [np.nan, np.nan] for s in bars[-1].get_segments()])
        found.append((line.get_xdata(), line.get_ydata(), ends[:, 0], ends[:, 1]))
    return found


class TestCatalogue:
    def test_alum_has_them_all(self, study: LoadedStudy) -> None:
        assert set(NAMES) <= set(figures_of(expand(study, lambda *_: "embedded"), study.model))

    def test_a_study_without_a_crystallizer_has_none(self) -> None:
        pmma = load_study(STUDIES / "pmma.yaml")
        assert not set(NAMES) & set(figures_of(expand(pmma, lambda *_: "embedded"), pmma.model))

    def test_each_depends_on_its_part_of_the_study(self, study: LoadedStudy) -> None:
        points = expand(study, lambda *_: "embedded")
        no_filter = figures_of(points, study.model.model_copy(update={"filter": None}))
        assert set(NAMES) & set(no_filter) == set(NAMES) - set(FILTER)
        one = {name: csd for name, csd in study.model.csds.items() if name == "tau_15min"}
        assert "fig12_distributions" not in figures_of(points, study.model.model_copy(update={"csds": one}))
        whole = {k: c.model_copy(update={"truncate_below_volume_fraction": 0.0}) for k, c in study.model.csds.items()}
        assert "fig05_truncation" not in figures_of(points, study.model.model_copy(update={"csds": whole}))


@pytest.mark.parametrize("name", NAMES)
class TestEveryFigure:
    def test_is_saved_as_png_and_pdf(self, name: str, data: StudyData, tmp_path: Path) -> None:
        save(draw(name, data), tmp_path / "a.png", tmp_path / "a.pdf")
        assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
        assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")

    def test_axes_are_labelled_with_units(self, name: str, data: StudyData) -> None:
        for axes in draw(name, data).axes:
            for shared, label in (
                (axes.get_shared_x_axes(), Axes.get_xlabel),
                (axes.get_shared_y_axes(), Axes.get_ylabel),
            ):
                longest = max((label(other) for other in shared.get_siblings(axes)), key=len)
                assert longest.endswith(")") and "(" in longest, longest

    def test_nothing_covers_or_leaves_the_figure(self, name: str, data: StudyData) -> None:
        figure = draw(name, data)
        figure.canvas.draw()
        (box,) = (legend.get_window_extent() for legend in figure.legends)
        assert box.x1 <= figure.bbox.x1
        assert not any(box.overlaps(axes.get_window_extent()) for axes in figure.axes)
        labels = [label.get_window_extent() for axes in figure.axes for label in (axes.xaxis.label, axes.yaxis.label)]
        labels = [label for label in labels if label.width and label.height]
        for k, label in enumerate(labels):
            assert label.x0 >= 0.0 and label.y0 >= 0.0
            assert label.x1 <= figure.bbox.x1 and label.y1 <= figure.bbox.y1
            assert not any(label.overlaps(other) for other in labels[k + 1 :])

    @pytest.mark.parametrize(
        ("porosities", "model"),
        [
            pytest.param({name: [None, None] for name in TIMES}, {}, id="all failed"),
            pytest.param({"tau_15min": [None]}, {}, id="one failed"),
            pytest.param({name: [0.293] for name in TIMES}, {}, id="one packing each"),
            pytest.param({}, {"published": []}, id="nothing published"),
            pytest.param({"tau_15min": [0.1, 0.9]}, {}, id="interval wider than the mean"),
        ],
    )
    def test_draws_poor_data(
        self,
        name: str,
        porosities: dict[str, list[float | None]],
        model: dict[str, Any],
        study: LoadedStudy,
        tmp_path: Path,
    ) -> None:
        save(draw(name, make(study, porosities, **model)), tmp_path / "a.png", tmp_path / "a.pdf")

    def test_draws_without_a_point_at_the_base_material(self, name: str, data: StudyData) -> None:
        other = data.summary.assign(friction=0.3)
        draw(name, dataclasses.replace(data, summary=other)).canvas.draw()


class TestTruncation:
    def test_classes_are_kept_or_discarded(self, data: StudyData) -> None:
        panels = draw("fig05_truncation", data).axes
        assert len(panels) == 4
        for axes, name in zip(panels, TIMES, strict=True):
            full, truncated = data.csds[name]
            (kept,), (discarded,) = marked(axes, "kept"), marked(axes, "discarded")
            inside = np.isfinite(kept.get_data().values)
            assert (inside != np.isfinite(discarded.get_data().values)).all()
            assert inside.sum() == truncated.size.size
            both = np.where(inside, kept.get_data().values, discarded.get_data().values)
            assert both == pytest.approx(100.0 * full.volume_fraction)
            assert np.nanmin(kept.get_data().values) >= 0.1 > np.nanmax(discarded.get_data().values)
            (threshold,) = marked(axes, "threshold")
            assert set(threshold.get_ydata()) == {0.1}

    def test_says_what_is_kept_beside_the_published_ends(self, data: StudyData) -> None:
        first = draw("fig05_truncation", data).axes[0]
        assert "98.2 %" in first.texts[0].get_text() and "32.5 to 543.3 µm" in first.texts[0].get_text()
        assert [line.get_xdata()[0] for line in marked(first, "published")] == [32.5, 543.3]

    def test_limits_of_size_are_drawn(self, data: StudyData) -> None:
        limits = {"truncate_below_volume_fraction": 0.0, "truncate_below_um": 40.0, "truncate_above_um": 500.0}
        model = data.study.csds["tau_15min"].model_copy(update=limits)
        study = data.study.model_copy(update={"csds": {**data.study.csds, "tau_15min": model}})
        first, second, *_ = draw("fig05_truncation", dataclasses.replace(data, study=study)).axes
        assert [line.get_xdata()[0] for line in marked(first, "limit")] == [40.0, 500.0]
        assert not marked(first, "threshold") and not marked(second, "limit")
        alone = study.model_copy(update={"csds": {"tau_15min": model}})
        assert "fig05_truncation" in figures_of([], alone)

    def test_at_most_four_panels(self, data: StudyData) -> None:
        model = data.study.model_copy(update={"csds": {**data.study.csds, "fifth": data.study.csds["tau_60min"]}})
        more = dataclasses.replace(data, study=model, csds={**data.csds, "fifth": data.csds["tau_60min"]})
        figure = draw("fig05_truncation", more)
        assert len(figure.axes) == 4 and "1 more truncated" in texts(figure)

    def test_edges_lie_halfway(self) -> None:
        assert class_edges(np.array([1.0, 3.0, 4.0])).tolist() == [0.0, 2.0, 3.5, 4.5]
        assert class_edges(mixture([0.2], [1.0]).size) == pytest.approx([0.19, 0.21])


class TestDistributions:
    def test_curves_are_the_closed_form_and_hold_all_volume(self, data: StudyData) -> None:
        (axes,) = draw("fig12_distributions", data).axes
        for line, scale in zip(marked(axes, "density"), SIZE_SCALES, strict=True):
            size, density = line.get_data()
            assert density == pytest.approx(100.0 * size**3 * np.exp(-size / scale) / (6.0 * scale**4), rel=1e-3)
            assert np.trapezoid(density, size) == pytest.approx(100.0, abs=0.5)

    def test_means(self, data: StudyData) -> None:
        (axes,) = draw("fig12_distributions", data).axes
        for gid, order in (("number", 1.0), ("volume", 4.0)):
            means = [line.get_xdata()[0] for line in marked(axes, gid)]
            assert means == pytest.approx([order * scale for scale in SIZE_SCALES], rel=1e-4)


class TestGrowthAndNucleation:
    def test_markers_are_the_table_of_the_kinetics(self, data: StudyData) -> None:
        upper, lower = draw("fig13_growth_nucleation", data).axes
        (growth,), (nucleation,) = marked(upper, "study"), marked(lower, "study")
        assert list(growth.get_xdata()) == pytest.approx(VOLUMES)
        assert list(growth.get_ydata()) == pytest.approx([6.4907e-8, 3.7279e-8, 2.6952e-8, 2.1411e-8], rel=1e-4)
        assert list(nucleation.get_ydata()) == pytest.approx([7.5833e4, 2.5016e4, 1.3076e4, 8.2521e3], rel=1e-4)

    def test_curves_are_powers_of_the_volume(self, data: StudyData) -> None:
        """Alum has i = 2 and j = 1: G as tau^(-4/5), B0 as G^2."""
        for axes, exponent in zip(draw("fig13_growth_nucleation", data).axes, (-0.8, -1.6), strict=True):
            volume, rate = (np.asarray(values) for values in marked(axes, "curve")[0].get_data())
            assert len(volume) > 50 and (volume[0], volume[-1]) == pytest.approx((5.0, 20.0))
            assert rate / rate[0] == pytest.approx((volume / volume[0]) ** exponent)

    def test_kinetics_of_the_user_s_own_are_drawn(self, tmp_path: Path) -> None:
        """Of i = 1: G as tau^(-4/4), B0 as G; G and B0 from eqs. 13, 14 and 16 by hand."""
        entry = "{nucleation_coefficient: 1.0e+13, units: 'B0 #/(m3 s), MT kg/m3, G m/s', "
        entry += "slurry_concentration_exponent: 1, growth_rate_exponent: 1, shape_factor: 0.5, "
        entry += "density_kg_m3: 2000, source: me}"
        (tmp_path / "own.yaml").write_text(f"salt: {entry}\n")
        text = (STUDIES / "alum.yaml").read_text(encoding="utf-8")
        text = text.replace("  kinetics: ammonium_alum\n", "  kinetics: salt\n  kinetics_file: own.yaml\n")
        (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
        own = make(load_study(tmp_path / "mine.yaml"))
        time = 60.0 * np.array([15, 30, 45, 60])
        rate = (6.0 * 0.5 * 2000.0 * 1e13 * time**4) ** -0.25
        for axes, expected in zip(
            draw("fig13_growth_nucleation", own).axes, (rate, 1e13 * 200 * rate * 1e-3), strict=True
        ):
            assert marked(axes, "study")[0].get_ydata() == pytest.approx(expected)
            volume, drawn = (np.asarray(values) for values in marked(axes, "curve")[0].get_data())
            assert drawn / drawn[0] == pytest.approx(volume[0] / volume)
        (axes,) = draw("fig12_distributions", own).axes
        means = [line.get_xdata()[0] for line in marked(axes, "volume")]
        assert means == pytest.approx(4e6 * rate * time)
        for name in NAMES:
            draw(name, own).canvas.draw()

    def test_one_residence_time_is_a_marker(self, data: StudyData) -> None:
        one = dataclasses.replace(data, crystallizer=data.crystallizer.iloc[:1])
        for axes in draw("fig13_growth_nucleation", one).axes:
            assert len(marked(axes, "study")[0].get_xdata()) == 1

    def test_no_product_is_said(self, data: StudyData) -> None:
        for crystallizer in (data.crystallizer.iloc[:0], pd.DataFrame()):
            for name in ("fig12_distributions", "fig13_growth_nucleation"):
                figure = draw(name, dataclasses.replace(data, crystallizer=crystallizer))
                assert "no distribution is made by a crystallizer" in texts(figure)

    def test_units(self, data: StudyData) -> None:
        upper, lower = draw("fig13_growth_nucleation", data).axes
        assert upper.get_ylabel().endswith("(10⁻⁸ m/s)") and lower.get_ylabel().endswith("(10⁴ #/(L s))")
        assert upper.yaxis.get_major_formatter()(6e-8, 0) == "6"


class TestResistanceAndArea:
    def test_points_and_intervals_are_the_tables(self, data: StudyData, design: pd.DataFrame) -> None:
        resistance, filter_area, share = (series(axes)[0] for axes in draw("fig14_resistance_area", data).axes)
        for drawn in (resistance, filter_area, share):
            assert list(drawn[0]) == pytest.approx(VOLUMES)
        mean, half = design["resistance_m_kg"].to_numpy(), design["resistance_ci95_m_kg"].to_numpy()
        assert resistance[1] == pytest.approx(mean)
        assert resistance[2] == pytest.approx(mean - half) and resistance[3] == pytest.approx(mean + half)
        columns = ("filter_area_m2", "filter_area_low_m2", "filter_area_high_m2")
        for drawn, column in zip(filter_area[1:], columns, strict=True):
            assert drawn == pytest.approx(design[column].to_numpy())
        drum = drum_of(data.study)
        for drawn, alpha in zip(share[1:], (mean, mean + half, mean - half), strict=True):
            assert drawn == pytest.approx(100.0 * medium_share(drum, alpha))

    @pytest.mark.parametrize(("law", "other"), [("additive", "carman"), ("carman", "additive")])
    def test_the_other_law_stands_beside_ours(self, study: LoadedStudy, law: str, other: str) -> None:
        data = make(study, resistance_law=law)
        table = filter_design(data.study, data.csds, data.summary)
        figure = draw("fig14_resistance_area", data)
        columns = (f"resistance_{other}_m_kg", f"filter_area_{other}_m2")
        for axes, column in zip(figure.axes[:2], columns, strict=True):
            (line,) = marked(axes, "beside")
            assert list(line.get_ydata()) == pytest.approx(sorted(table[column], reverse=True))
        (line,) = marked(figure.axes[2], "beside")
        share = 100.0 * medium_share(drum_of(study.model), np.array(sorted(table[columns[0]], reverse=True)))
        assert list(line.get_ydata()) == pytest.approx(share)
        said = texts(figure)
        assert "by Carman instead of eq. 3 the area changes by −1" in said
        assert f"resistances by {RESISTANCE_LAWS[law].title}" in said

    def test_published_values_stand_beside_ours(self, data: StudyData) -> None:
        resistance, filter_area, share = draw("fig14_resistance_area", data).axes
        found = [(line.get_xdata()[0], line.get_ydata()[0]) for line in marked(resistance, "published")]
        values = [1.009e8, 7.69e7, 6.54e7, 5.86e7]
        assert found == [pytest.approx(pair) for pair in zip(VOLUMES, values, strict=True)]
        areas = [(line.get_xdata()[0], line.get_ydata()[0]) for line in marked(filter_area, "published")]
        assert areas == [pytest.approx(pair) for pair in ((5.0, 3.4), (20.0, 2.9))]
        shares = [(line.get_xdata()[0], line.get_ydata()[0]) for line in marked(share, "published")]
        assert shares == [pytest.approx(pair) for pair in ((5.0, 50.0), (20.0, 60.0))]

    def test_failed_point_is_a_cross_and_a_single_packing_has_no_interval(self, failed: StudyData) -> None:
        figure = draw("fig14_resistance_area", failed)
        for axes in figure.axes:
            (cross,) = marked(axes, style.FAILED)
            assert list(cross.get_xdata()) == pytest.approx([10.0])
            ((x, _, low, high),) = series(axes)
            assert list(x) == pytest.approx([5.0, 15.0, 20.0])
            assert np.isnan(low).tolist() == np.isnan(high).tolist() == [False, True, False]
        said = texts(figure)
        assert style.ALL_FAILED in said and "n = 0 to 3 packings per point, 3 failed; embedded engine" in said

    def test_says_how_much_of_the_fall_reaches_the_area(self, data: StudyData, design: pd.DataFrame) -> None:
        resistance, filter_area = (design[name].to_numpy() for name in ("resistance_m_kg", "filter_area_m2"))
        falls = [round(100 * (1.0 - values[-1] / values[0])) for values in (resistance, filter_area)]
        words = f"the resistance changes by −{falls[0]} % and the area by −{falls[1]} %"
        assert words in texts(draw("fig14_resistance_area", data))


class TestFilterSensitivity:
    def test_areas_are_equation_10(self, data: StudyData, design: pd.DataFrame) -> None:
        *panels, _ = draw("filter_area_sensitivity", data).axes
        mean, half = design["resistance_m_kg"].to_numpy(), design["resistance_ci95_m_kg"].to_numpy()
        for axes, pressure in zip(panels, (20e3, 53.32e3, 80e3), strict=True):
            assert f"{pressure / 1e3:g} kPa" in axes.get_title(loc="left")
            lines = series(axes)
            assert len(lines) == 5
            for (x, *drawn), medium in zip(lines, (1e9, 5e9, 1e10, 5e10, 1e11), strict=True):
                drum = dataclasses.replace(drum_of(data.study), pressure_drop=pressure, medium_resistance=medium)
                assert list(x) == pytest.approx(VOLUMES)
                for values, alpha in zip(drawn, (mean, mean - half, mean + half), strict=True):
                    assert values == pytest.approx(area(drum, alpha, FLOW))
            own = [line.get_ydata()[0] for line in marked(axes, "published")]
            assert own == ([3.4, 2.9] if pressure == 53.32e3 else [])

    def test_share_of_the_cake_and_the_paper_s_statement(self, data: StudyData) -> None:
        share = draw("filter_area_sensitivity", data).axes[-1]
        drum = drum_of(data.study)
        alpha, cake = marked(share, "share")[1].get_data()
        assert cake == pytest.approx(100.0 * (1.0 - medium_share(drum, alpha)))
        (stated,) = marked(share, "published")
        assert stated.get_xydata()[1].tolist() == [1e9, 80.0]
        (exact,) = marked(share, "exact")
        assert exact.get_xdata()[0] == pytest.approx(1.042e9, rel=1e-3)
        assert exact.get_xdata()[0] == pytest.approx(float(resistance_for_cake_share(drum, 0.8)))
        assert "80 % at 1.042·10⁹ m/kg" in texts(share.figure)

    def test_failed_point_is_said(self, failed: StudyData) -> None:
        figure = draw("filter_area_sensitivity", failed)
        for axes in figure.axes[:-1]:
            assert all(list(cross.get_xdata()) == pytest.approx([10.0]) for cross in marked(axes, style.FAILED))
            assert len(marked(axes, style.FAILED)) == 5
        assert style.ALL_FAILED in texts(figure)

    def test_own_medium_and_pressure_join_the_others(self, data: StudyData) -> None:
        for medium, pressure, lines, panels in ((2e9, 30.0, 6, 4), (5e9, 80.0, 5, 3), (0.0, 53.32, 6, 4)):
            own = data.study.filter.model_copy(  # type: ignore[union-attr]
                update={"medium_resistance_1_m": medium, "pressure_drop_kPa": pressure}
            )
            model = data.study.model_copy(update={"filter": own})
            figure = draw("filter_area_sensitivity", dataclasses.replace(data, study=model))
            figure.canvas.draw()
            assert len(figure.axes) == panels and len(series(figure.axes[0])) == lines
            assert len(marked(figure.axes[-1], "exact")) == (medium > 0.0)


@pytest.mark.parametrize(
    ("value", "written"), [(0.0, "0"), (1e9, "10⁹"), (5e10, "5·10¹⁰"), (1.0416e9, "1.04·10⁹"), (3e-8, "3·10⁻⁸")]
)
def test_numbers_are_written_for_readers(value: float, written: str) -> None:
    assert style.scientific(value) == written
