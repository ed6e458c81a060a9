"""Figures of a calibration: what is drawn is what its tables hold, and poor data give a figure that says so."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from filtercake.calibration.fit import Observation
from filtercake.calibration.measurements import Measurements, load_measurements
from filtercake.calibration.response import Parameter
from filtercake.calibration.rounds import Settings, conclude
from filtercake.calibration.tables import objective_table, parity_table, prediction_table, response_table, summary
from filtercake.crystals.csd import mixture
from filtercake.figures import catalogue, style
from filtercake.figures.calibrated import CalibrationData, with_interval
from filtercake.figures.calibration_objective import stretches
from filtercake.figures.catalogue import CALIBRATION_FIGURES, figures_of_calibration, module_of
from filtercake.figures.style import save
from filtercake.filtration.drum_filter import DrumFilter
from filtercake.statistics import half_width

pytestmark = pytest.mark.filterwarnings("error")

EXAMPLE = Path(__file__).parents[3] / "config" / "measurements" / "synthetic_tests.yaml"
Z, LIMIT = 1.959964, 3.841459
COHESIONS = (0.0, 20.0, 40.0, 60.0, 80.0, 100.0)
LABELS = {"a": "75/25 wt% 20/50 µm", "b": "50/50 wt% 20/50 µm", "c": "25/75 wt% 20/50 µm", "d": "20 µm", "e": "50 µm"}
LEVELS = {"a": 22.05, "b": 21.9, "c": 21.5, "d": 22.6, "e": 20.9}
STEEPNESS = {"a": 0.5, "b": 0.6, "c": 0.7, "d": 0.45, "e": 0.8}
ROUGHNESS = {"a": 3.0, "b": 1.5, "c": 0.5, "d": 3.5, "e": 0.2}
CSDS = {
    name: mixture([20e-6, 50e-6], [share, 1.0 - share])
    for name, share in {"a": 0.75, "b": 0.5, "c": 0.25, "d": 0.9, "e": 0.1}.items()
}
DRUM = DrumFilter(
    pressure_drop=53.32e3,
    submerged_fraction=0.3,
    rotation_rate=1.0 / 300.0,
    medium_resistance=5e9,
    viscosity=1e-3,
    slurry_concentration=200.0,
)
NOISE = 0.02


def law(csd: str, cohesion: float, friction: float) -> float:
    """ln(alpha), made up: falls with both, in another way for every distribution."""
    fall = STEEPNESS[csd] * (1.0 - math.exp(-cohesion / 60.0))
    return LEVELS[csd] - fall - ROUGHNESS[csd] * friction


def packed(
    csds: Sequence[str], frictions: Sequence[float], failed: Sequence[tuple[str, float]] = (), replicates: int = 4
) -> pd.DataFrame:
    random = np.random.default_rng(3)
    rows: list[dict[str, Any]] = []
    for csd in csds:
        for cohesion in COHESIONS:
            for friction in frictions:
                for k in range(replicates):
                    ok = (csd, cohesion) not in failed
                    value = law(csd, cohesion, friction) + NOISE * random.standard_normal()
                    rows.append(
                        {
                            "point": f"{csd}_s{cohesion:g}_mu{friction:g}",
                            "csd": csd,
                            "cohesion_kJ_m3": cohesion,
                            "friction": friction,
                            "engine": "embedded",
                            "replicate": k,
                            "batch": 0,
                            "status": "ok" if ok else "failed",
                            "ln_resistance": value if ok else math.nan,
                        }
                    )
    return pd.DataFrame(rows)


def make(
    measured: Sequence[str] = ("a", "b", "c"),
    frictions: Sequence[float] = (0.0,),
    *,
    fit_friction: bool = False,
    predicted: Sequence[str] = (),
    failed: Sequence[tuple[str, float]] = (),
    errors: Sequence[float] = (0.03, -0.02, 0.01, 0.0, 0.02),
    uncertainty: float = 0.05,
    truth: tuple[float, float] = (45.0, 0.0),
    twice: bool = False,
    drum: DrumFilter | None = DRUM,
    title: str = "Made up",
) -> CalibrationData:
    parameters = [Parameter("cohesion_kJ_m3", 0.0, 100.0)]
    if fit_friction:
        parameters.append(Parameter("friction", frictions[0], frictions[-1]))
    settings = Settings(
        parameters=tuple(parameters),
        beside="friction",
        beside_levels=tuple(frictions),
        measured=tuple(measured),
        predicted=tuple(predicted),
        levels=COHESIONS,
        estimator="interior",
        rounds=4,
        relative_ci95_target=0.1,
        density=1180.0,
        sphericity=1.0,
        implied_porosity=0.36,
        soft_above=80.0,
    )
    observations = [
        Observation(f"test of {csd}", csd, law(csd, *truth) + error, uncertainty)
        for csd, error in zip(measured, errors, strict=False)
    ]
    if twice:
        observations.append(Observation("again", measured[0], law(measured[0], *truth) - 0.1, 0.1))
    simulated = packed((*measured, *predicted), frictions, failed)
    outcome = conclude(settings, observations, simulated)
    predictions = prediction_table(outcome, settings, simulated, CSDS, drum, 20.0 / 3600.0) if predicted else None
    return CalibrationData(
        name="made_up",
        title=title,
        summary=json.loads(json.dumps(summary(outcome, settings, "within 10 %"))),
        parity=parity_table(outcome, settings, observations),
        objective=objective_table(outcome, settings),
        response=response_table(outcome, settings, observations),
        simulated=simulated,
        predictions=predictions,
        labels=LABELS,
    )


CASES: dict[str, dict[str, Any]] = {
    "three": {"predicted": ("d", "e")},
    "one": {"measured": ("b",)},
    "rivals": {
        "frictions": (0.05, 0.0, 0.1),
        "truth": (45.0, 0.05),
        "failed": [("b", 60.0), ("c", 60.0)],
        "predicted": ("d",),
        "drum": None,
        "twice": True,
    },
    "friction": {
        "frictions": (0.0, 0.1, 0.2),
        "fit_friction": True,
        "truth": (45.0, 0.08),
        "predicted": ("d", "e"),
    },
    "five": {"measured": ("a", "b", "c", "d", "e"), "errors": (0.3, -0.2, 0.1, 0.0, -0.2), "title": "long words " * 10},
    "flat": {"measured": ("b",), "uncertainty": 0.5},
    "confounded": {"measured": ("b",), "frictions": (0.0, 0.1, 0.2), "fit_friction": True, "truth": (45.0, 0.08)},
}


@pytest.fixture(scope="module")
def cases() -> dict[str, CalibrationData]:
    return {name: make(**case) for name, case in CASES.items()}


KNOWN: dict[tuple[str, int], tuple[CalibrationData, Figure]] = {}


def draw(name: str, data: CalibrationData) -> Figure:
    """Draw a figure, each only once; the data stay, so that their identity does."""
    if (name, id(data)) not in KNOWN:
        KNOWN[name, id(data)] = data, catalogue.draw(name, data)
    return KNOWN[name, id(data)][1]


def figures_of(predicts: bool) -> list[str]:
    """Figures of a calibration to known resistances, without pressures."""
    return figures_of_calibration(predicts, Measurements("", (), (), (), ()))


def marked(axes: Axes, gid: str) -> list[Any]:
    return [artist for artist in axes.get_children() if artist.get_gid() == gid]


def texts(figure: Figure) -> str:
    found = [text.get_text() for axes in figure.axes for text in axes.texts]
    found += [entry.get_text() for box in figure.legends for entry in box.get_texts()]
    return " ".join(" ".join([*found, figure.get_supxlabel()]).split())


def bars(axes: Axes) -> list[tuple[np.ndarray, np.ndarray]]:
    """Lower and upper ends of the bars of every series with error bars, as points."""
    found = []
    for container in axes.containers:
        assert isinstance(container, ErrorbarContainer)
        for collection in container.lines[2]:
            segments = np.array(collection.get_segments())
            found.append((segments[:, 0], segments[:, -1]))
    return found


def spans(artists: Sequence[Any]) -> list[tuple[float, float]]:
    return [(box.get_x(), box.get_x() + box.get_width()) for box in artists]


class TestCatalogue:
    def test_predictions_have_their_own(self) -> None:
        assert set(figures_of(True)) - set(figures_of(False)) == {"calibration_predictions"}
        of_tests = {name for name, figure in CALIBRATION_FIGURES.items() if figure.of_tests} | {"compressibility"}
        assert figures_of(True) == [name for name in CALIBRATION_FIGURES if name not in of_tests]
        measurements = load_measurements(EXAMPLE)
        assert figures_of_calibration(True, measurements) == list(CALIBRATION_FIGURES)
        assert set(figures_of_calibration(False, measurements)) == set(CALIBRATION_FIGURES) - {
            "calibration_predictions"
        }
        assert of_tests == {"filtration_fits", "compressibility"}

    def test_every_figure_has_its_module(self) -> None:
        folder = Path(style.__file__).parent
        assert all((folder / f"{module_of(name).removeprefix('figures.')}.py").is_file() for name in figures_of(True))


@pytest.mark.parametrize("case", CASES)
class TestEveryFigure:
    def test_nothing_overlaps_or_leaves_the_figure(self, case: str, cases: dict[str, CalibrationData]) -> None:
        data = cases[case]
        for name in figures_of(data.predictions is not None):
            figure = draw(name, data)
            figure.canvas.draw()
            (box,) = (legend.get_window_extent() for legend in figure.legends)
            below = figure._supxlabel.get_window_extent()  # type: ignore[attr-defined]
            labels = [label.get_window_extent() for axes in figure.axes for label in (axes.xaxis.label, axes.title)]
            labels += [axes.yaxis.label.get_window_extent() for axes in figure.axes]
            labels += [axes._left_title.get_window_extent() for axes in figure.axes]  # type: ignore[attr-defined]
            labels += [text.get_window_extent() for axes in figure.axes for text in axes.texts]
            boxes = [box, below, *(label for label in labels if label.width > 2.0 and label.height > 2.0)]
            for k, one in enumerate(boxes):
                assert one.x0 >= 0.0 and one.y0 >= 0.0, (name, k)
                assert one.x1 <= figure.bbox.x1 and one.y1 <= figure.bbox.y1, (name, k)
                assert not any(one.overlaps(other) for other in boxes[k + 1 :]), (name, k)
                assert not any(one.overlaps(axes.get_window_extent()) for axes in figure.axes), (name, k)

    def test_axes_are_labelled_with_units(self, case: str, cases: dict[str, CalibrationData]) -> None:
        data = cases[case]
        for name in figures_of(data.predictions is not None):
            for axes in draw(name, data).axes:
                labels = [axes.get_xlabel(), axes.get_ylabel()]
                if name == "calibration_predictions":
                    labels = labels[:1]
                if axes.get_label() == "<colorbar>":
                    labels = labels[1:]
                assert all(label.endswith(")") and "(" in label for label in labels), labels

    def test_says_what_was_fitted_by_what(self, case: str, cases: dict[str, CalibrationData]) -> None:
        data = cases[case]
        for name in figures_of(data.predictions is not None):
            said = texts(draw(name, data))
            assert "resistances from the interior porosity" in said and "embedded engine" in said
            assert ("cohesion and friction fitted" in said) == data.fits_both


def test_is_saved_as_png_and_pdf(cases: dict[str, CalibrationData], tmp_path: Path) -> None:
    for name in figures_of(True):
        save(draw(name, cases["three"]), tmp_path / "a.png", tmp_path / "a.pdf")
        assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
        assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")


def test_counts_packings(cases: dict[str, CalibrationData]) -> None:
    data = cases["rivals"]
    assert "192 packings, 24 failed" in texts(draw("calibration_objective", data))  # of all frictions
    for name in ("calibration_parity", "calibration_resistance"):
        assert "64 packings, 8 failed" in texts(draw(name, data))
    said = texts(draw("calibration_predictions", data))
    assert "fit: 64 packings, 8 failed" in said and "predicted distributions: 24 packings, none failed" in said


def test_an_unknown_estimator_and_engine_keep_their_names(cases: dict[str, CalibrationData]) -> None:
    data = cases["one"]
    other = dataclasses.replace(
        data, summary={**data.summary, "estimator": "mine"}, simulated=data.simulated.assign(engine="yade")
    )
    said = texts(draw("calibration_parity", other))
    assert "resistances from the mine" in said and "yade" in said


class TestObjective:
    @pytest.mark.parametrize("case", ["three", "one", "rivals", "flat"])
    def test_curves_interval_and_best_are_the_tables(self, case: str, cases: dict[str, CalibrationData]) -> None:
        data = cases[case]
        (axes,) = draw("calibration_objective", data).axes
        curves = marked(axes, "deviance")
        assert len(curves) == len(data.summary["rivals"])
        for line, friction in zip(curves, data.summary["rivals"], strict=True):
            rows = data.objective[data.objective["friction"] == float(friction)]
            assert line.get_xdata() == pytest.approx(rows["cohesion_kJ_m3"].to_numpy())
            assert line.get_ydata() == pytest.approx(rows["deviance"].to_numpy())
        assert spans(marked(axes, "interval")) == [pytest.approx(data.found[1:])]
        (best,), (threshold,) = marked(axes, "best"), marked(axes, "threshold")
        assert best.get_xdata()[0] == data.found[0] and best.get_ydata()[0] == 0.0
        assert threshold.get_ydata()[0] == data.summary["threshold"] >= 3.841
        assert threshold.get_ydata()[0] < axes.get_ylim()[1] <= 20.0

    def test_the_threshold_drawn_is_the_one_used(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["five"]  # with a discrepancy of four degrees of freedom
        (axes,) = draw("calibration_objective", data).axes
        (threshold,) = marked(axes, "threshold")
        assert threshold.get_ydata()[0] == pytest.approx(7.709, abs=1e-3)
        assert "95 % threshold of one parameter (7.71)" in texts(axes.figure)
        assert spans(marked(axes, "interval")) == [pytest.approx(data.found[1:])]
        high = dataclasses.replace(data, summary={**data.summary, "threshold": 161.45})
        (axes,) = draw("calibration_objective", high).axes
        assert axes.get_ylim()[1] > 161.45

    def test_rivals_are_named_with_their_squares_and_marked(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["rivals"]
        figure = draw("calibration_objective", data)
        for friction, rival in data.summary["rivals"].items():
            taken = " (taken)" if friction == "0.05" else ""
            assert f"friction {friction}{taken}: χ² = {rival['chi_square']:.1f}" in texts(figure)
        found = [line.get_xdata()[0] for line in marked(figure.axes[0], "rival")]
        assert found == [data.summary["rivals"][mu]["cohesion_kJ_m3"] for mu in ("0", "0.1")]
        assert "χ² with 2 degrees of freedom" in texts(figure)

    def test_a_lone_friction_is_not_called_taken(self, cases: dict[str, CalibrationData]) -> None:
        said = texts(draw("calibration_objective", cases["one"]))
        assert "(taken)" not in said and "no degree of freedom" in said

    @pytest.mark.parametrize("case", ["rivals", "five", "flat", "confounded"])
    def test_findings_stand_below(self, case: str, cases: dict[str, CalibrationData]) -> None:
        data = cases[case]
        figure = draw("calibration_objective", data)
        (below,) = marked(figure.axes[0], "findings")
        said = " ".join(below.get_text().split()).lower()
        assert len(data.summary["findings"]) == said.count("•") > 0
        assert all(found["text"].lower() in said for found in data.summary["findings"])

    def test_stretches_of_an_interval_are_shaded_one_by_one(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["one"]
        cohesion = np.linspace(0.0, 100.0, 801)
        deviance = 0.05 * np.minimum((cohesion - 20.0) ** 2, 0.5 + (cohesion - 70.0) ** 2)
        table = pd.DataFrame({"cohesion_kJ_m3": cohesion, "friction": 0.0, "deviance": deviance})
        (axes,) = draw("calibration_objective", dataclasses.replace(data, objective=table)).axes
        half, other = math.sqrt(LIMIT / 0.05), math.sqrt(LIMIT / 0.05 - 0.5)
        expected = [(20.0 - half, 20.0 + half), (70.0 - other, 70.0 + other)]
        assert spans(marked(axes, "interval")) == [pytest.approx(ends, abs=1e-3) for ends in expected]

    def test_stretches_end_with_the_range(self) -> None:
        values = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
        found = stretches(values, LIMIT + np.array([-1.0, 1.0, 1.0, 1.0, -3.0]), LIMIT)
        assert found == [pytest.approx((0.0, 0.5)), pytest.approx((3.25, 4.0))]
        assert stretches(values, np.zeros(5), LIMIT) == [(0.0, 4.0)]


class TestFittedFriction:
    def test_best_point_and_intervals(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["friction"]
        axes = draw("calibration_objective", data).axes[0]
        (best,) = marked(axes, "best")
        fitted = data.summary["parameters"]
        assert best.get_xydata()[0] == pytest.approx([fitted["cohesion_kJ_m3"]["value"], fitted["friction"]["value"]])
        horizontal, vertical = marked(axes, "interval")
        assert tuple(horizontal.get_xdata()) == data.found[1:]
        assert tuple(vertical.get_ydata()) == data.estimate("friction")[1:]

    def test_outline_reaches_as_far_as_the_intervals(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["friction"]
        axes = draw("calibration_objective", data).axes[0]
        (outline,) = marked(axes, "region")
        assert list(outline.levels) == [pytest.approx(data.summary["threshold"])]
        points = np.vstack([path.vertices for path in outline.get_paths()])
        assert (points[:, 0].min(), points[:, 0].max()) == pytest.approx(data.found[1:], rel=1e-3)
        assert (points[:, 1].min(), points[:, 1].max()) == pytest.approx(data.estimate("friction")[1:], rel=1e-2)

    def test_says_the_squares(self, cases: dict[str, CalibrationData]) -> None:
        assert "with 1 degree of freedom" in texts(draw("calibration_objective", cases["friction"]))
        assert "with no degree of freedom" in texts(draw("calibration_objective", cases["confounded"]))

    def test_a_region_without_an_outline(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["friction"]
        flat = data.objective.assign(deviance=data.objective["deviance"] / data.objective["deviance"].max())
        figure = draw("calibration_objective", dataclasses.replace(data, objective=flat))
        figure.canvas.draw()
        assert not marked(figure.axes[0], "region") and "region" not in texts(figure)


class TestParity:
    def test_markers_and_bars_are_the_table(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["rivals"]
        (axes,) = draw("calibration_parity", data).axes
        found = np.vstack([line.get_xydata() for line in marked(axes, "modelled")])
        rows = data.parity.sort_values("csd", kind="stable")
        assert len(rows) == 4
        assert found == pytest.approx(rows[["measured_m_kg", "modelled_m_kg"]].to_numpy())
        drawn = bars(axes)
        vertical = np.vstack([np.column_stack([a, b[:, 1]]) for a, b in drawn[0::2]])
        assert vertical == pytest.approx(rows[["measured_m_kg", "modelled_low_m_kg", "modelled_high_m_kg"]].to_numpy())
        horizontal = np.vstack([np.column_stack([a[:, 0], b]) for a, b in drawn[1::2]])
        measured, reach = rows["measured_m_kg"].to_numpy(), np.exp(Z * rows["relative_uncertainty"].to_numpy())
        expected = np.column_stack([measured / reach, measured * reach, rows["modelled_m_kg"]])
        assert horizontal == pytest.approx(expected, rel=1e-6)

    def test_left_out_predictions_are_hollow(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["three"]
        (axes,) = draw("calibration_parity", data).axes
        hollow = marked(axes, "left_out")
        expected = data.parity["measured_m_kg"] * np.exp(data.parity["left_out_ln_error"])
        assert [line.get_ydata()[0] for line in hollow] == pytest.approx(expected.tolist())
        assert [line.get_xdata()[0] for line in hollow] == pytest.approx(data.parity["measured_m_kg"].tolist())
        assert all(line.get_markerfacecolor() == "none" for line in hollow)
        assert "predicted from the other distributions" in texts(draw("calibration_parity", data))

    def test_measurements_of_one_distribution_share_their_prediction(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["rivals"]
        (axes,) = draw("calibration_parity", data).axes
        own = data.parity[data.parity["csd"] == "a"]
        weight = own["relative_uncertainty"].to_numpy() ** -2
        mean = np.exp(np.average(np.log(own["measured_m_kg"]), weights=weight))
        point = marked(axes, "left_out")[0].get_xydata()[0]
        assert point == pytest.approx([mean, mean * math.exp(own["left_out_ln_error"].iloc[0])])

    def test_without_another_distribution_none_is_left_out(self, cases: dict[str, CalibrationData]) -> None:
        figure = draw("calibration_parity", cases["one"])
        assert not marked(figure.axes[0], "left_out") and "predicted from" not in texts(figure)

    def test_line_of_equality_crosses_common_limits(self, cases: dict[str, CalibrationData]) -> None:
        for case in ("three", "one", "five"):
            (axes,) = draw("calibration_parity", cases[case]).axes
            (equal,) = marked(axes, "equal")
            assert axes.get_xlim() == axes.get_ylim() == pytest.approx(tuple(equal.get_xdata()))
            assert list(equal.get_xdata()) == list(equal.get_ydata())
            low, high = axes.get_xlim()
            drawn = np.concatenate([np.vstack(pair) for pair in bars(axes)])
            assert low < drawn.min() and drawn.max() < high

    def test_typical_errors_are_said(self, cases: dict[str, CalibrationData]) -> None:
        parity = cases["five"].parity
        fitted = 100.0 * np.sqrt(np.mean(np.log(parity["modelled_m_kg"] / parity["measured_m_kg"]) ** 2))
        left_out = 100.0 * np.sqrt(np.mean(parity["left_out_ln_error"] ** 2))
        words = f"by distribution: {fitted:.0f} % modelled, {left_out:.0f} % predicted from the others"
        assert words in texts(draw("calibration_parity", cases["five"]))

    def test_an_interval_that_lacks_the_best_value(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["one"]
        ends = {f"modelled_{end}_m_kg": by * data.parity["modelled_m_kg"] for end, by in (("low", 1.1), ("high", 1.3))}
        odd = data.parity.assign(**ends)
        (axes,) = draw("calibration_parity", dataclasses.replace(data, parity=odd)).axes
        low, high = bars(axes)[0]
        assert low[0, 1] == pytest.approx(odd["modelled_low_m_kg"].iloc[0])
        assert high[0, 1] == pytest.approx(odd["modelled_high_m_kg"].iloc[0])


class TestResistance:
    @pytest.mark.parametrize("case", ["three", "one", "rivals", "friction", "five"])
    def test_curves_and_bands_are_the_smooth_models(self, case: str, cases: dict[str, CalibrationData]) -> None:
        data = cases[case]
        panels = draw("calibration_resistance", data).axes
        assert len(panels) == (5 if case == "five" else 1)
        curves = [line for axes in panels for line in marked(axes, "response")]
        bands = [band for axes in panels for band in marked(axes, "band")]
        for csd, line, band in zip(data.measured, curves, bands, strict=True):
            rows = data.response[(data.response["csd"] == csd) & np.isclose(data.response["friction"], data.held)]
            x, y = rows["cohesion_kJ_m3"].to_numpy(), rows["resistance_m_kg"].to_numpy()
            assert line.get_xdata() == pytest.approx(x) and line.get_ydata() == pytest.approx(y)
            vertices = band.get_paths()[0].vertices
            middle = vertices[np.isclose(vertices[:, 0], x[50]), 1]
            reach = math.exp(Z * rows["relative_error"].iloc[50])
            assert (middle.min(), middle.max()) == pytest.approx((y[50] / reach, y[50] * reach), rel=1e-6)

    @pytest.mark.parametrize("case", ["three", "five"])
    def test_measurements_and_the_chosen_cohesion(self, case: str, cases: dict[str, CalibrationData]) -> None:
        data = cases[case]
        panels = draw("calibration_resistance", data).axes
        lines = [line.get_ydata()[0] for axes in panels for line in marked(axes, "measured")]
        boxes = [box for axes in panels for box in marked(axes, "measured_interval")]
        reach = math.exp(Z * 0.05)
        for value, line, box in zip(data.parity["measured_m_kg"], lines, boxes, strict=True):
            assert line == pytest.approx(value)
            assert box.get_y() == pytest.approx(value / reach, rel=1e-6)
            assert box.get_y() + box.get_height() == pytest.approx(value * reach, rel=1e-6)
        for axes in panels:
            (chosen,) = marked(axes, "chosen")
            assert chosen.get_xdata()[0] == data.found[0]
            assert spans(marked(axes, "interval")) == [pytest.approx(data.found[1:])]

    def test_measurements_of_one_distribution_are_averaged_as_in_the_fit(
        self, cases: dict[str, CalibrationData]
    ) -> None:
        data = cases["rivals"]
        own = data.parity[data.parity["csd"] == "a"]
        weight = own["relative_uncertainty"].to_numpy() ** -2
        mean = np.exp(np.average(np.log(own["measured_m_kg"]), weights=weight))
        (axes,) = draw("calibration_resistance", data).axes
        assert marked(axes, "measured")[0].get_ydata()[0] == pytest.approx(mean)
        box = marked(axes, "measured_interval")[0]
        assert box.get_y() == pytest.approx(mean * math.exp(-Z / math.sqrt(weight.sum())), rel=1e-6)

    def test_points_are_means_of_the_packings_at_the_friction_taken(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["rivals"]
        (axes,) = draw("calibration_resistance", data).axes
        drawn = bars(axes)
        for csd, container, ends in zip(data.measured, axes.containers, drawn, strict=True):
            assert isinstance(container, ErrorbarContainer)
            points = container.lines[0]
            assert points.get_linestyle() == "None"
            accepted = data.simulated.query("friction == 0.05 and status == 'ok'")
            rows = accepted[accepted["csd"] == csd]
            groups = [np.exp(values.to_numpy()) for _, values in rows.groupby("cohesion_kJ_m3")["ln_resistance"]]
            mean, half = (np.array([f(v) for v in groups]) for f in (np.mean, half_width))
            assert points.get_xdata() == pytest.approx(sorted(rows["cohesion_kJ_m3"].unique()))
            assert points.get_ydata() == pytest.approx(mean)
            assert ends[0][:, 1] == pytest.approx(mean - half) and ends[1][:, 1] == pytest.approx(mean + half)

    def test_points_do_not_move_sideways(self, cases: dict[str, CalibrationData]) -> None:
        (axes,) = draw("calibration_resistance", cases["three"]).axes
        axes.figure.canvas.draw()
        for container in axes.containers:
            line = container.lines[0]  # type: ignore[attr-defined]
            assert line.get_transform().transform([(40.0, 2e9)]) == pytest.approx(
                axes.transData.transform([(40.0, 2e9)])
            )

    def test_failed_points_are_crosses_in_rows(self, cases: dict[str, CalibrationData]) -> None:
        figure = draw("calibration_resistance", cases["rivals"])
        figure.canvas.draw()
        crosses = marked(figure.axes[0], style.FAILED)
        assert [list(cross.get_xdata()) for cross in crosses] == [[60.0], [60.0]]
        heights = [cross.get_window_extent().y0 for cross in crosses]
        assert heights[0] != heights[1] and style.ALL_FAILED in texts(figure)

    def test_batches_are_one_point(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["one"]
        more = data.simulated[data.simulated["cohesion_kJ_m3"] == 40.0].assign(batch=1, point="again")
        both = pd.concat([data.simulated, more.assign(ln_resistance=more["ln_resistance"] + 0.1)])
        (axes,) = draw("calibration_resistance", dataclasses.replace(data, simulated=both)).axes
        points = axes.containers[0].lines[0]  # type: ignore[attr-defined]
        rows = both[both["cohesion_kJ_m3"] == 40.0]
        assert list(points.get_xdata()) == list(COHESIONS)
        assert points.get_ydata()[2] == pytest.approx(np.exp(rows["ln_resistance"]).mean())

    def test_packings_of_the_nearest_friction_are_hollow(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["friction"]
        figure = draw("calibration_resistance", data)
        points = figure.axes[0].containers[0].lines[0]  # type: ignore[attr-defined]
        rows = data.simulated.query("csd == 'a' and friction == 0.1")
        assert points.get_markerfacecolor() == "white"
        expected = np.exp(rows["ln_resistance"]).groupby(rows["cohesion_kJ_m3"]).mean()
        assert points.get_ydata() == pytest.approx(expected.to_numpy())
        assert f"friction 0.1, the nearest to the {data.held:.3g} of the curves" in texts(figure)

    def test_one_packing_has_no_interval(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["one"]
        few = data.simulated[(data.simulated["cohesion_kJ_m3"] != 40.0) | (data.simulated["replicate"] == 0)]
        figure = draw("calibration_resistance", dataclasses.replace(data, simulated=few))
        figure.canvas.draw()
        assert list(figure.axes[0].containers[0].lines[0].get_xdata()) == list(COHESIONS)  # type: ignore[attr-defined]


class TestPredictions:
    def test_both_panels_are_the_table(self, cases: dict[str, CalibrationData]) -> None:
        for case in ("three", "friction"):
            table = cases[case].predictions
            assert table is not None
            panels = draw("calibration_predictions", cases[case]).axes
            assert len(panels) == 2
            for axes, name, unit in zip(panels, ("resistance", "filter_area"), ("m_kg", "m2"), strict=True):
                line = axes.containers[0].lines[0]  # type: ignore[attr-defined]
                ((low, high),) = bars(axes)
                assert line.get_xdata() == pytest.approx(table[f"{name}_{unit}"].to_numpy())
                assert list(line.get_ydata()) == list(low[:, 1]) == list(high[:, 1]) == [0, 1]
                assert low[:, 0] == pytest.approx(table[f"{name}_low_{unit}"].to_numpy())
                assert high[:, 0] == pytest.approx(table[f"{name}_high_{unit}"].to_numpy())
                (safe,) = marked(axes, "safety")
                assert safe.get_xdata() == pytest.approx(table[f"{name}_with_safety_factor_{unit}"].to_numpy())
            names = [label.get_text() for label in panels[0].get_yticklabels()]
            assert names == [LABELS["d"], LABELS["e"]]
            assert panels[0].get_ylim()[0] > panels[0].get_ylim()[1]  # the first on top

    def test_without_a_filter_there_is_one_panel(self, cases: dict[str, CalibrationData]) -> None:
        (axes,) = draw("calibration_predictions", cases["rivals"]).axes
        assert axes.get_xlabel() == "Specific cake resistance (10⁹ m/kg)"

    def test_says_whether_the_safety_factor_covers_the_interval(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["three"]
        assert data.predictions is not None
        most = data.predictions["high_over_resistance"].max()
        said = texts(draw("calibration_predictions", data))
        assert f"at most {most:.2f} times the prediction: the safety factor covers them" in said
        wide = data.predictions.assign(high_over_resistance=[2.5, 1.5])
        said = texts(draw("calibration_predictions", dataclasses.replace(data, predictions=wide)))
        assert f"the safety factor does not cover the interval of {LABELS['d']}" in said

    def test_draws_without_predictions(self, cases: dict[str, CalibrationData]) -> None:
        figure = draw("calibration_predictions", cases["one"])
        figure.canvas.draw()
        assert "no prediction was asked for" in texts(figure)

    def test_packings_of_predicted_distributions_may_be_elsewhere(self, cases: dict[str, CalibrationData]) -> None:
        data = cases["three"]
        own = data.simulated[data.simulated["csd"].isin(data.measured)]
        assert "predicted distributions" not in texts(
            draw("calibration_predictions", dataclasses.replace(data, simulated=own))
        )


@pytest.mark.parametrize(
    ("values", "written"),
    [
        ((43.3, 33.2, 55.4), "43 kJ/m³ (95 %: 33 to 55)"),
        ((43.31, 40.2, 46.4), "43.3 kJ/m³ (95 %: 40.2 to 46.4)"),
        ((0.0701, 0.0249, 0.117), "0.070 kJ/m³ (95 %: 0.025 to 0.117)"),
        ((500.0, 100.0, 900.0), "500 kJ/m³ (95 %: 100 to 900)"),
        ((0.0, 0.0, 0.0), "0.000 kJ/m³ (95 %: 0.000 to 0.000)"),
    ],
)
def test_intervals_are_written_as_precisely_as_they_are_wide(values: tuple[float, float, float], written: str) -> None:
    assert with_interval(*values, unit=" kJ/m³") == written
