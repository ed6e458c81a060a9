"""Figures: what is drawn is what the tables hold, and poor data give a figure that says so, never an exception."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.figures import cross_section, profile, style, trajectory
from filtercake.figures.catalogue import FIGURES, draw
from filtercake.figures.selection import StudyData
from filtercake.figures.style import save
from filtercake.filtration.resistance import ADDITIVE, CARMAN, kozeny_carman, resistance
from filtercake.packing.porosity import slab_porosity
from filtercake.packing.result import Packing
from filtercake.packing.slab import Slab, bed_height, interior_slab
from filtercake.results.replicates import REPLICATE_COLUMNS, summarise
from filtercake.results.resistance_columns import resistance_columns
from filtercake.statistics import half_width
from filtercake.study.config.study import Study

pytestmark = pytest.mark.filterwarnings("error")

STUDY = {
    "title": "Made up",
    "csds": {
        "coarse": {
            "label": "coarse spheres",
            "mixture": [{"size_um": 40, "volume_fraction": 0.5}, {"size_um": 60, "volume_fraction": 0.5}],
        },
        "fine": {"mixture": [{"size_um": 20, "volume_fraction": 1}]},
    },
    "material": {"density_kg_m3": 1180},
    "packing": {"particles": 200},
    "sweeps": [{"csd": ["coarse", "fine"]}],
    "published": [
        {
            "csd": "coarse",
            "quantity": "porosity",
            "value": 0.37,
            "source": "a paper",
            "kind": "simulation",
            "cohesion_kJ_m3": 50,
        },
        {
            "csd": "coarse",
            "quantity": "resistance_m_kg",
            "value": 0.9e9,
            "source": "a paper",
            "kind": "simulation",
            "cohesion_kJ_m3": 50,
        },
        {"csd": "coarse", "quantity": "porosity", "value": 0.36, "source": "a rig", "kind": "measurement"},
        {"csd": "coarse", "quantity": "resistance_m_kg", "value": 0.8e9, "source": "another", "kind": "measurement"},
    ],
}
CSDS = {"coarse": mixture([40e-6, 60e-6], [0.5, 0.5]), "fine": mixture([20e-6], [1.0])}
BASE = {"cohesion_kJ_m3": 50.0, "friction": 0.0, "poisson_ratio": 0.2, "restitution": 0.3, "youngs_modulus_MPa": 5.0}
# name, distribution, what differs from the base material, porosities (None: the packing failed)
POINTS: list[tuple[str, str, dict[str, float], list[float | None]]] = [
    ("base", "coarse", {}, [0.351, 0.355, 0.349]),
    ("s0", "coarse", {"cohesion_kJ_m3": 0.0}, [0.330, 0.333]),
    ("s100", "coarse", {"cohesion_kJ_m3": 100.0}, [None, None]),
    ("s0mu", "coarse", {"cohesion_kJ_m3": 0.0, "friction": 0.3}, [0.361]),
    ("s50mu", "coarse", {"friction": 0.3}, [0.410, 0.420, None]),
    ("nu", "coarse", {"poisson_ratio": 0.4}, [0.348, 0.350]),
    ("e", "coarse", {"restitution": 0.6}, [0.356, 0.352]),
    ("nu_s0", "coarse", {"poisson_ratio": 0.4, "cohesion_kJ_m3": 0.0}, [0.200, 0.210]),
    ("stiff", "coarse", {"cohesion_kJ_m3": 25.0, "youngs_modulus_MPa": 50.0}, [0.500, 0.510]),
    ("fine", "fine", {}, [0.390, None, 0.400]),
]


EVERYWHERE = [name for name, spec in FIGURES.items() if spec.needs(Study.model_validate(STUDY))]
"""Figures that need neither a crystallizer nor truncated sizes."""


def spheres(replicate: int, csd: CrystalSizeDistribution) -> Packing:
    """Spheres on a shaken lattice, apart from each other, with a record of their settling."""
    random = np.random.default_rng(replicate)
    pitch, side = 1.3 * csd.largest, 5
    lattice = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    position = (lattice + 0.5 + random.uniform(-0.1, 0.1, lattice.shape)) * pitch
    radius = 0.5 * random.choice(csd.size, len(position))
    times = np.linspace(0.0, 8e-3, 9 + replicate)
    settling = {
        "time_s": times.tolist(),
        "mean_height_m": np.linspace(3e-4, 1e-4, times.size).tolist(),
        "kinetic_energy_J": (1e-11 * np.exp(-times / 1e-3)).tolist(),
        "porosity_sample": (0.36 + 0.002 * replicate + 0.29 * np.exp(-times / 1.5e-3)).tolist(),
    }
    return Packing(position, radius, side * pitch, {"trajectory": settling})


def replicate_rows(
    points: list[tuple[str, str, dict[str, float], list[float | None]]], law: str = ADDITIVE
) -> pd.DataFrame:
    rows = []
    for name, csd, differs, porosities in points:
        for k, porosity in enumerate(porosities):
            row: dict[str, Any] = {
                "point": name,
                "packings": name,
                "study": "made_up",
                "csd": csd,
                "engine": "liggghts",
            }
            row |= {"protocol": "gravity"}
            row |= {**BASE, **differs, "replicate": k, "status": "failed", "reason": "not settled"}
            if porosity is not None:
                row |= {
                    "status": "ok",
                    "reason": "",
                    "porosity": porosity,
                    "porosity_paper_count": porosity + 0.007,
                    **resistance_columns(law, porosity, (CSDS[csd], CSDS[csd]), 1180.0, 1.0),
                    "wall_s": 1.0,
                }
            rows.append(row)
    return pd.DataFrame(rows, columns=list(REPLICATE_COLUMNS))


def make(folder: Path, points: list[tuple[str, str, dict[str, float], list[float | None]]], **study: Any) -> StudyData:
    replicates = replicate_rows(points, study.get("resistance_law", ADDITIVE))
    for name, csd, _, porosities in points:
        for k, porosity in enumerate(porosities):
            if porosity is not None:
                spheres(k, CSDS[csd]).save(folder / name / f"r{k}.npz")
    summary = summarise(replicates)
    model = Study.model_validate({**STUDY, **study})
    return StudyData("made_up", model, summary, summary, replicates, {k: (c, c) for k, c in CSDS.items()}, folder)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> StudyData:
    return make(tmp_path_factory.mktemp("packings"), POINTS)


def every_axes(figure: Figure) -> Iterator[Axes]:
    for axes in figure.axes:
        yield axes
        yield from (child for child in axes.child_axes if isinstance(child, Axes))


def texts(figure: Figure) -> str:
    found = [text.get_text() for axes in figure.axes for text in axes.texts]
    found += [entry.get_text() for box in figure.legends for entry in box.get_texts()]
    return " ".join(" ".join([*found, figure.get_supxlabel()]).split())


def error_lines(axes: Axes) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Abscissa, mean and half-width of every series with error bars, by label."""
    found = {}
    for container in axes.containers:
        assert isinstance(container, ErrorbarContainer)
        line, _, bars = container.lines
        halves = [0.5 * (s[-1, 1] - s[0, 1]) if len(s) else np.nan for s in bars[-1].get_segments()]
        found[str(container.get_label())] = (line.get_xdata(), line.get_ydata(), np.array(halves))
    return found


def marked(axes: Axes, gid: str) -> list[Any]:
    return [artist for artist in axes.get_children() if artist.get_gid() == gid]


def row(data: StudyData, point: str) -> pd.Series:
    return data.summary.set_index("point").loc[point]


@pytest.mark.parametrize("name", EVERYWHERE)
class TestEveryFigure:
    def test_all_axes_are_labelled_with_units(self, name: str, data: StudyData) -> None:
        figure = draw(name, data)
        for axes in figure.axes:
            shared_x = axes.get_shared_x_axes().get_siblings(axes)
            shared_y = axes.get_shared_y_axes().get_siblings(axes)
            for label in (
                max((other.get_xlabel() for other in shared_x), key=len),
                max((other.get_ylabel() for other in shared_y), key=len),
            ):
                assert label.endswith(")") and "(" in label, label

    def test_says_how_many_packings_failed_and_which_engine(self, name: str, data: StudyData) -> None:
        said = texts(draw(name, data))
        assert "LIGGGHTS" in said
        failed = {
            "fig03_porosity_trajectory": "n = 3 packings, none failed",
            "packing_cross_section": "n = 3 packings, none failed",
            "fig08_resistance_vs_porosity": "n = 2 to 3 packings per point, 1 failed",
            "packing_porosity_profile": "n = 2 to 3 packings per point, 1 failed",
            "sensitivity_poisson_restitution": "n = 2 to 3 packings per point, none failed",
        }
        assert failed.get(name, "n = 0 to 3 packings per point, 3 failed") in said

    def test_legend_covers_no_data(self, name: str, data: StudyData) -> None:
        figure = draw(name, data)
        assert all(axes.get_legend() is None for axes in every_axes(figure))
        figure.canvas.draw()
        (box,) = (legend.get_window_extent() for legend in figure.legends)
        assert not any(box.overlaps(axes.get_window_extent()) for axes in figure.axes)
        assert box.x1 <= figure.bbox.x1

    def test_is_saved_whole_and_the_same_every_time(
        self, name: str, data: StudyData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        save(draw(name, data), tmp_path / "a.png", tmp_path / "a.pdf")
        monkeypatch.setitem(mpl.rcParams, "font.size", 20.0)  # a reader's own settings
        monkeypatch.setitem(mpl.rcParams, "axes.grid", True)
        save(draw(name, data), tmp_path / "b.png", tmp_path / "b.pdf")
        assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
        assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()
        assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
        assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
        assert mpl.rcParams["font.size"] == 20.0

    @pytest.mark.parametrize(
        ("points", "study"),
        [
            pytest.param([(p, c, d, [None] * len(e)) for p, c, d, e in POINTS], {}, id="all failed"),
            pytest.param([(p, c, d, e[:1]) for p, c, d, e in POINTS], {}, id="one packing each"),
            pytest.param(POINTS, {"published": []}, id="nothing published"),
            pytest.param(POINTS[1:-1], {}, id="no base point"),
            pytest.param(POINTS[1:], {}, id="one distribution without base point"),
            pytest.param([("base", "coarse", {}, [0.02, 0.98])], {}, id="interval wider than the axes"),
        ],
    )
    def test_draws_poor_data(
        self,
        name: str,
        points: list[tuple[str, str, dict[str, float], list[float | None]]],
        study: dict[str, Any],
        tmp_path: Path,
    ) -> None:
        figure = draw(name, make(tmp_path, points, **study))
        save(figure, tmp_path / "a.png", tmp_path / "a.pdf")
        assert (tmp_path / "a.png").stat().st_size > 0

    def test_draws_without_readable_packings(self, name: str, data: StudyData, tmp_path: Path) -> None:
        figure = draw(name, dataclasses.replace(data, packings=tmp_path))
        figure.canvas.draw()
        if FIGURES[name].module in ("trajectory", "cross_section"):
            assert "no accepted packing" in texts(figure) and "3 packings could not be read" in texts(figure)


class TestPorosityAgainstCohesion:
    @pytest.fixture
    def axes(self, data: StudyData) -> Axes:
        (axes,) = draw("fig09_porosity_vs_cohesion", data).axes  # fine has one cohesion: no panel
        return axes

    def test_lines_are_the_summary(self, axes: Axes, data: StudyData) -> None:
        lines = error_lines(axes)
        assert set(lines) == {"friction 0", "friction 0.3"}
        x, y, half = lines["friction 0"]  # neither the failed point nor those off the base material
        assert x.tolist() == [0.0, 50.0]
        assert y.tolist() == [row(data, "s0")["porosity"], row(data, "base")["porosity"]]
        assert half == pytest.approx([row(data, "s0")["porosity_ci95"], row(data, "base")["porosity_ci95"]])

    def test_single_packing_has_a_mean_and_no_interval(self, axes: Axes, data: StudyData) -> None:
        x, y, half = error_lines(axes)["friction 0.3"]
        assert x.tolist() == [0.0, 50.0] and y[0] == 0.361
        assert np.isnan(half[0]) and half[1] == pytest.approx(row(data, "s50mu")["porosity_ci95"])

    def test_failed_point_is_a_cross(self, axes: Axes) -> None:
        (cross,) = marked(axes, style.FAILED)
        assert cross.get_xdata().tolist() == [100.0] and cross.get_color() == style.colour(0)

    def test_estimate_of_the_paper_and_published_values(self, axes: Axes, data: StudyData) -> None:
        counted = marked(axes, "paper_count")[0]
        expected = [row(data, name)["porosity_paper_count"] for name in ("s0", "base")]
        assert counted.get_ydata()[:2].tolist() == expected
        level, point = sorted(marked(axes, "published"), key=lambda line: len(line.get_xdata()), reverse=True)
        assert (point.get_xdata(), point.get_ydata()) == ([50.0], [0.37])
        assert set(level.get_ydata()) == {0.36} and level.get_label() == "a rig, measured"

    def test_all_data_are_in_sight(self, axes: Axes) -> None:
        axes.figure.canvas.draw()
        (low, high), (left, right) = axes.get_ylim(), axes.get_xlim()
        for x, y, half in error_lines(axes).values():
            assert left < x.min() and x.max() < right
            assert low < np.nanmin(y - np.nan_to_num(half)) and np.nanmax(y + np.nan_to_num(half)) < high


def test_same_friction_looks_the_same_in_every_panel(tmp_path: Path) -> None:
    points = [
        ("a0", "coarse", {"cohesion_kJ_m3": 0.0}, [0.33]),
        ("a1", "coarse", {}, [0.35]),
        ("b0", "fine", {"cohesion_kJ_m3": 0.0, "friction": 0.3}, [0.38]),
        ("b1", "fine", {"friction": 0.3}, [0.41]),
    ]
    first, second = draw("fig09_porosity_vs_cohesion", make(tmp_path, points)).axes
    assert list(error_lines(first)) == ["friction 0"]
    assert "friction 0.3" in error_lines(second)
    colours = {c.get_label(): c.lines[0].get_color() for axes in (first, second) for c in axes.containers}
    assert colours["friction 0"] != colours["friction 0.3"]


class TestResistanceAgainstCohesion:
    @pytest.fixture
    def axes(self, data: StudyData) -> Axes:
        (axes,) = draw("fig10_resistance_vs_cohesion", data).axes
        return axes

    def test_lines_are_the_summary(self, axes: Axes, data: StudyData) -> None:
        x, y, half = error_lines(axes)["friction 0"]
        points = [row(data, name) for name in ("s0", "base")]
        assert x.tolist() == [0.0, 50.0]
        assert y.tolist() == [point["resistance_m_kg"] for point in points]
        assert half == pytest.approx([point["resistance_ci95_m_kg"] for point in points])
        beside = marked(axes, "beside")[0].get_ydata()
        assert beside[:2].tolist() == [point["resistance_carman_m_kg"] for point in points]

    def test_the_law_is_named_and_the_other_stands_beside_it(self, data: StudyData, tmp_path: Path) -> None:
        for found, own, other in (
            (data, "eq. 3 (additive)", "Carman (Sauter mean)"),
            (make(tmp_path, POINTS, resistance_law=CARMAN), "Carman (Sauter mean)", "eq. 3 (additive)"),
        ):
            said = texts(draw("fig10_resistance_vs_cohesion", found))
            assert f"resistances by {own}" in said and f"{other}, same packings" in said

    def test_axis_is_logarithmic_and_its_unit_right(self, axes: Axes) -> None:
        assert axes.get_yscale() == "log"
        assert axes.get_ylabel() == "Specific cake resistance (10⁹ m/kg)"
        assert axes.yaxis.get_major_formatter()(1.5e9, 0) == "1.5"

    def test_measurement_without_cohesion_is_a_line(self, axes: Axes) -> None:
        lines = {line.get_label(): line for line in marked(axes, "published")}
        assert set(lines["another, measured"].get_ydata()) == {0.8e9}
        assert (lines["a paper, simulated"].get_xdata(), lines["a paper, simulated"].get_ydata()) == ([50.0], [0.9e9])


class TestSensitivity:
    def test_panels_hold_the_summary(self, data: StudyData) -> None:
        poisson, restitution = draw("sensitivity_poisson_restitution", data).axes
        x, y, half = error_lines(poisson)["coarse spheres"]
        assert (x.tolist(), y.tolist()) == ([0.2, 0.4], [row(data, "base")["porosity"], row(data, "nu")["porosity"]])
        assert half == pytest.approx([row(data, "base")["porosity_ci95"], row(data, "nu")["porosity_ci95"]])
        x, y, _ = error_lines(restitution)["coarse spheres"]
        assert (x.tolist(), y.tolist()) == ([0.3, 0.6], [row(data, "base")["porosity"], row(data, "e")["porosity"]])

    def test_band_is_the_interval_at_base(self, data: StudyData) -> None:
        for axes in draw("sensitivity_poisson_restitution", data).axes:
            (band,) = marked(axes, "base")
            mean, half = row(data, "base")["porosity"], row(data, "base")["porosity_ci95"]
            assert (band.get_y(), band.get_height()) == pytest.approx((mean - half, 2.0 * half))

    def test_small_differences_stay_small(self, data: StudyData) -> None:
        low, high = draw("sensitivity_poisson_restitution", data).axes[0].get_ylim()
        assert high - low >= 0.03 - 1e-12

    def test_one_panel_where_one_property_varies(self, tmp_path: Path) -> None:
        (axes,) = draw("sensitivity_poisson_restitution", make(tmp_path, [POINTS[0], POINTS[6]])).axes
        assert "restitution" in axes.get_xlabel()


class TestResistanceAgainstPorosity:
    @pytest.fixture
    def axes(self, data: StudyData) -> Axes:
        (axes,) = draw("fig08_resistance_vs_porosity", data).axes
        return axes

    def test_curves_are_equation_3_of_the_full_distribution(self, axes: Axes, data: StudyData) -> None:
        curves = {line.get_label(): line for line in axes.get_lines()}
        for label, csd in (("coarse spheres", "coarse"), ("fine", "fine")):
            x, y = curves[label].get_data()
            expected = [kozeny_carman(float(value), CSDS[csd], 1180.0) for value in x]
            assert len(x) > 50 and np.asarray(y) == pytest.approx(expected)

    def test_another_law_is_drawn_and_named(self, tmp_path: Path) -> None:
        figure = draw("fig08_resistance_vs_porosity", make(tmp_path, POINTS, resistance_law=CARMAN))
        assert "curves: Carman (Sauter mean) with the full distribution" in texts(figure)
        curves = {line.get_label(): line for line in figure.axes[0].get_lines()}
        x, y = curves["coarse spheres"].get_data()
        expected = [resistance(CARMAN, float(value), CSDS["coarse"], 1180.0) for value in x]
        assert np.asarray(y) == pytest.approx(expected)

    def test_uses_the_full_distribution_not_the_truncated_one(self, data: StudyData) -> None:
        cut = dataclasses.replace(data, csds={**data.csds, "coarse": (CSDS["coarse"], CSDS["fine"])})
        (axes,) = draw("fig08_resistance_vs_porosity", cut).axes
        x, y = next(line for line in axes.get_lines() if line.get_label() == "coarse spheres").get_data()
        assert y[0] == pytest.approx(kozeny_carman(float(x[0]), CSDS["coarse"], 1180.0))

    def test_our_means_are_the_summary(self, axes: Axes, data: StudyData) -> None:
        points = [row(data, name) for name in ("base", "fine")]
        for container, point in zip(axes.containers, points, strict=True):
            line, _, (across, along) = container.lines
            assert line.get_xydata().tolist() == [[point["porosity"], point["resistance_m_kg"]]]
            assert np.ptp(across.get_segments()[0][:, 0]) == pytest.approx(2.0 * point["porosity_ci95"])
            assert np.ptp(along.get_segments()[0][:, 1]) == pytest.approx(2.0 * point["resistance_ci95_m_kg"])

    def test_published_pairs_belong_together(self, axes: Axes) -> None:
        found = {tuple(np.ravel(line.get_data())) for line in marked(axes, "published")}
        assert found == {(0.37, 0.9e9), (0.36, 0.0)}  # the rig's porosity has no resistance; the other measured none

    def test_band_ends_at_the_curve(self, axes: Axes, data: StudyData) -> None:
        point = row(data, "base")
        low, high = point["porosity"] - point["porosity_ci95"], point["porosity"] + point["porosity_ci95"]
        upright, flat = (np.vstack([p.vertices for p in c.get_paths()]) for c in axes.collections[:2])
        assert (upright[:, 0].min(), upright[:, 0].max()) == pytest.approx((low, high))
        assert upright[:, 1].max() == pytest.approx(kozeny_carman(low, CSDS["coarse"], 1180.0))
        assert flat[:, 1].min() == pytest.approx(kozeny_carman(high, CSDS["coarse"], 1180.0))
        assert flat[:, 1].max() == pytest.approx(kozeny_carman(low, CSDS["coarse"], 1180.0))
        assert flat[:, 0].max() == pytest.approx(low)


class TestTrajectory:
    def test_shows_every_packing_its_end_and_the_mean(self, data: StudyData) -> None:
        upper, lower = draw("fig03_porosity_trajectory", data).axes
        runs = [spheres(k, CSDS["coarse"]).diagnostics["trajectory"] for k in range(3)]
        for axes, quantity in ((upper, "porosity_sample"), (lower, "kinetic_energy_J")):
            for line, run in zip(marked(axes, "replicate"), runs, strict=True):
                assert line.get_xdata() == pytest.approx(np.array(run["time_s"]) * 1e3)
                assert list(line.get_ydata()) == run[quantity]
            (stopped,) = marked(axes, "stopped")
            assert list(stopped.get_ydata()) == [run[quantity][-1] for run in runs]
            (mean,) = marked(axes, "mean")
            assert mean.get_ydata()[-1] == pytest.approx(np.mean([run[quantity][-1] for run in runs]))
        assert lower.get_yscale() == "log"

    def test_mean_holds_a_bed_that_stopped_early(self) -> None:
        short = {"time_s": [0.0, 1.0], "q": [3.0, 1.0]}
        long = {"time_s": [0.0, 1.0, 2.0], "q": [5.0, 2.0, 0.0]}
        times, mean = trajectory.mean_trajectory([short, long], "q")
        assert times.tolist() == [0.0, 1.0, 2.0] and mean.tolist() == [4.0, 1.5, 0.5]

    def test_only_the_published_simulation_is_a_line(self, data: StudyData) -> None:
        upper, _ = draw("fig03_porosity_trajectory", data).axes
        (level,) = marked(upper, "published")
        assert set(level.get_ydata()) == {0.37}

    def test_inset_shows_every_end(self, data: StudyData) -> None:
        (inset,) = (c for c in draw("fig03_porosity_trajectory", data).axes[0].child_axes if isinstance(c, Axes))
        low, high = inset.get_ylim()
        (stopped,) = marked(inset, "stopped")
        assert low < min(stopped.get_ydata()) and max(stopped.get_ydata()) < high


class TestCrossSection:
    def test_sphere_is_cut_in_its_exact_circle_on_both_sides(self) -> None:
        packing = Packing(np.array([[1.0, 53.0, 10.0]]), np.array([5.0]), 100.0)
        centre, circle, diameter = cross_section.plane_circles(packing, 50.0)
        assert sorted(centre.tolist()) == [[1.0, 10.0], [101.0, 10.0]]  # it reaches through the side x = 0
        assert circle.tolist() == [4.0, 4.0] and diameter.tolist() == [10.0, 10.0]

    def test_plane_sees_spheres_through_the_periodic_side(self) -> None:
        packing = Packing(np.array([[50.0, 97.0, 10.0], [50.0, 90.0, 30.0]]), np.array([5.0, 5.0]), 100.0)
        centre, circle, _ = cross_section.plane_circles(packing, 1.0)
        assert centre.tolist() == [[50.0, 10.0]] and circle == pytest.approx([3.0])

    def test_area_of_the_cuts_is_the_solids_fraction(self) -> None:
        """Averaged over planes, area and volume fractions are the same (Delesse)."""
        packing = spheres(1, CSDS["coarse"])
        planes = (np.arange(400) + 0.5) / 400 * packing.length
        areas = []
        for y in planes:
            centre, circle, _ = cross_section.plane_circles(packing, float(y))
            once = (centre[:, 0] >= 0.0) & (centre[:, 0] < packing.length)
            areas.append(np.pi * np.sum(circle[once] ** 2))
        volume = np.sum(4.0 / 3.0 * np.pi * packing.radius**3)
        assert np.mean(areas) * packing.length == pytest.approx(volume, rel=2e-3)

    def test_draws_the_first_replicate_that_can_be_read(self, tmp_path: Path) -> None:
        data = make(tmp_path, [("base", "coarse", {}, [None, 0.35, 0.36])])
        (tmp_path / "base" / "r1.npz").write_bytes(b"damaged")
        figure = draw("packing_cross_section", data)
        assert "replicate 2 of coarse spheres" in texts(figure)
        assert "1 failed" in texts(figure) and "1 packing could not be read" in texts(figure)

    def test_floor_slab_and_sizes(self, data: StudyData) -> None:
        figure = draw("packing_cross_section", data)
        (axes,) = figure.axes
        packing = spheres(0, CSDS["coarse"])
        slab = interior_slab(packing.position, packing.radius)
        drawn = sorted(line.get_ydata()[0] for line in marked(axes, "slab"))
        assert drawn == pytest.approx([slab.lower * 1e6, slab.upper * 1e6])
        assert "40 µm" in texts(figure) and "60 µm" in texts(figure)
        assert axes.get_aspect() == 1.0

    def test_many_sizes_take_a_colour_bar(self, data: StudyData, tmp_path: Path) -> None:
        packing = spheres(0, CSDS["coarse"])
        radius = np.linspace(20e-6, 30e-6, packing.radius.size)
        dataclasses.replace(packing, radius=radius).save(tmp_path / "base" / "r0.npz")
        figure = draw("packing_cross_section", dataclasses.replace(data, packings=tmp_path))
        assert [axes.get_ylabel() for axes in figure.axes] == ["z (µm)", "Sphere diameter (µm)"]


class TestProfile:
    def test_mean_and_interval_are_those_of_the_slices(self) -> None:
        beds = [spheres(k, CSDS["coarse"]) for k in range(3)]
        height, mean, half = profile.mean_profile(beds)
        step = height[1] - height[0]
        assert step == pytest.approx(60e-6 / 20)
        k = int(np.argmin(np.abs(height - 150e-6)))
        slab = Slab(height[k] - step / 2, height[k] + step / 2)
        values = np.array([slab_porosity(bed.position, bed.radius, bed.length, slab) for bed in beds])
        assert mean[k] == pytest.approx(values.mean()) and half[k] == pytest.approx(half_width(values))
        assert mean[-1] <= 1.0 and height[-1] > max(bed_height(bed.position, bed.radius) for bed in beds)

    def test_one_bed_has_no_interval(self) -> None:
        _, mean, half = profile.mean_profile([spheres(0, CSDS["fine"])])
        assert np.isfinite(mean).all() and np.isnan(half).all()

    def test_panels_show_the_mean_the_slab_and_the_bed_height(self, data: StudyData) -> None:
        coarse, fine = draw("packing_porosity_profile", data).axes
        for axes, csd, which in ((coarse, "coarse", (0, 1, 2)), (fine, "fine", (0, 2))):
            beds = [spheres(k, CSDS[csd]) for k in which]
            height, mean, _ = profile.mean_profile(beds)
            (line,) = marked(axes, "mean")
            assert line.get_xdata() == pytest.approx(mean) and line.get_ydata() == pytest.approx(height * 1e6)
            (slab,) = marked(axes, "slab")
            slabs = [interior_slab(bed.position, bed.radius) for bed in beds]
            assert slab.get_y() == pytest.approx(np.mean([s.lower for s in slabs]) * 1e6)
            assert slab.get_y() + slab.get_height() == pytest.approx(np.mean([s.upper for s in slabs]) * 1e6)
        assert (coarse.get_title(loc="left"), fine.get_title(loc="left")) == ("coarse spheres", "fine")


class TestFooter:
    @pytest.mark.parametrize(
        ("n", "failed", "engines", "said"),
        [
            ([8], [0], ["liggghts"], "n = 8 packings, none failed; LIGGGHTS"),
            ([1], [2], ["liggghts"], "n = 1 packing, 2 failed; LIGGGHTS"),
            ([8, 3], [0, 5], ["liggghts"] * 2, "n = 3 to 8 packings per point, 5 failed; LIGGGHTS"),
            ([3, 3], [0, 0], ["new", "liggghts"], "n = 3 packings per point, none failed; LIGGGHTS, new"),
        ],
    )
    def test_counts(self, n: list[int], failed: list[int], engines: list[str], said: str) -> None:
        assert style.describe_counts(pd.DataFrame({"n": n, "n_failed": failed, "engine": engines})) == said


@pytest.mark.parametrize("backend", ["module://matplotlib_inline.backend_inline", "none_such", "svg"])
@pytest.mark.parametrize("room", ["figures.catalogue", "validation.figures.growth"])
def test_a_backend_that_is_not_there_changes_nothing(backend: str, room: str, tmp_path: Path) -> None:
    code = f"""
import filtercake.{room}, os
from pathlib import Path
from matplotlib.figure import Figure
from filtercake.figures.style import save
save(Figure(), Path("x.png"), Path("x.pdf"))
assert os.environ["MPLBACKEND"] == {backend!r}
"""
    environment = {**os.environ, "MPLBACKEND": backend}
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "x.png").stat().st_size > 0
