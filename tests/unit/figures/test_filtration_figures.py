"""Figures of filtration tests: points are the readings, lines and bands are the fits."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from filtercake.calibration.measurements import (
    BothForms,
    Measurement,
    Measurements,
    compressibility_by_csd,
    load_measurements,
)
from filtercake.figures import compressibility, filtration_fits, style
from filtercake.figures.calibrated import CalibrationData
from filtercake.figures.filtration_fits import with_interval
from filtercake.filtration.analysis import analyse
from filtercake.filtration.constant_pressure import FiltrationTest

pytestmark = pytest.mark.filterwarnings("error")

EXAMPLE = Path(__file__).resolve().parents[3] / "config" / "measurements" / "synthetic_tests.yaml"
NOTHING = Measurements("", (), (), (), ())


@pytest.fixture(autouse=True)
def house_style() -> Iterator[None]:
    with style.applied():
        yield


@pytest.fixture(scope="module")
def example() -> Measurements:
    return load_measurements(EXAMPLE)


def of_tests(*tests: FiltrationTest) -> Measurements:
    results = tuple(analyse(test) for test in tests)
    fits = tuple(BothForms(found.integral, found.differential) for found in results)
    return Measurements("", tests, fits, (), (), results=results)


def of_values(*values: tuple[str, float | None, float]) -> Measurements:
    entries = [Measurement(f"{k}", csd, alpha, 0.05, dp, "") for k, (csd, dp, alpha) in enumerate(values)]
    return Measurements("", (), (), tuple(entries), ())


def marked(axes: Axes, gid: str) -> list:
    return [artist for artist in axes.get_children() if artist.get_gid() == gid]


def texts(figure: Figure) -> str:
    found = [text.get_text() for axes in figure.axes for text in axes.texts]
    found += [axes.get_title(loc="left") for axes in figure.axes]
    found += [entry.get_text() for box in figure.legends for entry in box.get_texts()]
    return " ".join(" ".join([*found, figure.get_supxlabel()]).split())


def drawn(figure: Figure) -> Figure:
    figure.canvas.draw()
    return figure


class TestFits:
    def test_readings_used_are_full_and_those_left_out_hollow(self, example: Measurements) -> None:
        figure = drawn(filtration_fits.draw(example))
        assert len(figure.axes) == 4
        for axes, test, fits in zip(figure.axes, example.tests, example.fits, strict=True):
            kept = fits.integral.kept
            (used,) = marked(axes, "used")
            np.testing.assert_allclose(used.get_xdata(), test.volume[kept] * 1e6)
            np.testing.assert_allclose(used.get_ydata(), (test.time / test.volume)[kept] * 1e-6)
            assert used.get_markerfacecolor() == style.INK
        (out,) = marked(figure.axes[0], "left out")
        np.testing.assert_allclose(out.get_xdata(), [50, 100, 150, 200])
        np.testing.assert_allclose(out.get_ydata(), [15.3 / 50, 24.5 / 100, 34.5 / 150, 45.3 / 200])
        assert out.get_markerfacecolor() == "white"
        assert not any(marked(axes, "left out") for axes in figure.axes[1:])
        assert "readings left out" in texts(figure)

    def test_lines_and_band_are_the_fits(self, example: Measurements) -> None:
        figure = filtration_fits.draw(example)
        for axes, test, (integral, differential) in zip(figure.axes, example.tests, example.fits, strict=True):
            (line,), (other,), (band,) = (marked(axes, name) for name in ("integral", "differential", "band"))
            x = np.asarray(line.get_xdata())
            assert x[0] < 0.01 * x[-1] and x[-1] == pytest.approx(test.volume.max() * 1e6)
            np.testing.assert_allclose(line.get_ydata(), (integral.intercept + integral.slope * x * 1e-6) * 1e-6)
            v = np.asarray(other.get_xdata()) * 1e-6
            assert v[0] >= test.volume[differential.kept][0]
            expected = differential.time_offset / v + differential.intercept + 0.5 * differential.slope * v
            np.testing.assert_allclose(other.get_ydata(), expected * 1e-6)
            edge = band.get_paths()[0].vertices
            middle, half = integral.time_per_volume(x[100] * 1e-6)
            ends = edge[np.isclose(edge[:, 0], x[100], rtol=1e-12), 1]
            assert sorted(ends) == pytest.approx([float(v[0]) * 1e-6 for v in (middle - half, middle + half)])

    def test_words(self, example: Measurements) -> None:
        said = texts(filtration_fits.draw(example))
        assert "synthetic_25kPa pmma_50_50, 25 kPa" in said and "synthetic_100kPa pmma_50_50, 100 kPa" in said
        assert "α = (3.727 ± 0.039)·10⁹ m/kg Rₘ = (5.1" in said
        assert "disagree" not in said and "not shown" not in said
        axes = filtration_fits.draw(example).axes
        assert axes[0].get_ylabel() == "t/V (s/mL)" and axes[-1].get_xlabel() == "Filtrate volume V (mL)"
        assert axes[1].get_ylabel() == "" and axes[0].get_xlabel() == ""

    def test_large_volumes_are_in_litres(self, example: Measurements) -> None:
        test = example.tests[1]
        large = dataclasses.replace(test, volume=10.0 * test.volume)
        (axes,) = filtration_fits.draw(of_tests(large)).axes
        assert axes.get_xlabel() == "Filtrate volume V (L)" and axes.get_ylabel() == "t/V (s/L)"
        (used,) = marked(axes, "used")
        np.testing.assert_allclose(used.get_xdata(), large.volume * 1e3)
        np.testing.assert_allclose(used.get_ydata(), large.time / large.volume * 1e-3)

    def test_a_wild_start_is_drawn_at_the_edge(self, example: Measurements) -> None:
        test = example.tests[0]
        volume = test.volume.copy()
        volume[0] = 1e-6
        figure = drawn(filtration_fits.draw(of_tests(dataclasses.replace(test, volume=volume))))
        (axes,) = figure.axes
        (above,) = marked(axes, "above")
        assert list(above.get_xdata()) == pytest.approx([1.0])
        assert list(above.get_ydata()) == pytest.approx([axes.get_ylim()[1]])
        assert axes.get_ylim()[1] < 0.8 and "hollow triangles" in texts(figure)

    def test_a_fitted_time_zero_is_said_and_drawn_from_the_first_reading(self, example: Measurements) -> None:
        late = dataclasses.replace(example.tests[3], time=example.tests[3].time + 60.0)
        found = of_tests(example.tests[2], late)
        assert found.results[1].time_zero == pytest.approx(60.0, abs=5.0)
        figure = filtration_fits.draw(found)
        assert "time zero fitted: synthetic_100kPa (" in texts(figure)
        for axes, test, first in ((figure.axes[0], found.tests[0], False), (figure.axes[1], late, True)):
            (line,) = marked(axes, "integral")
            assert (np.asarray(line.get_xdata())[0] >= test.volume[0] * 1e6) == first

    def test_many_tests_and_many_readings(self, example: Measurements) -> None:
        long = example.tests[1]
        volume = np.linspace(1e-4, 1e-3, 2001)
        time = 1.6e8 * volume**2 + 2e4 * volume
        long = dataclasses.replace(long, volume=volume, time=time)
        figure = filtration_fits.draw(of_tests(long, *[example.tests[2]] * 25))
        assert len(figure.axes) == filtration_fits.MOST_PANELS
        (used,) = marked(figure.axes[0], "used")
        assert 400 <= len(used.get_xdata()) <= filtration_fits.MOST_READINGS
        said = texts(figure)
        assert "2 more tests are not shown" in said and "only some are drawn" in said

    def test_without_tests_it_says_so(self) -> None:
        assert "no filtration test" in texts(drawn(filtration_fits.draw(NOTHING)))

    def test_long_names_stay_in_their_panel(self, example: Measurements) -> None:
        named = dataclasses.replace(example.tests[1], name="a long name " * 5, csd="a_long_distribution" * 3)
        figure = filtration_fits.draw(of_tests(*[named] * 5))
        figure.canvas.draw()
        for axes in figure.axes:
            title = axes._left_title.get_window_extent()  # type: ignore[attr-defined]
            assert title.x1 <= axes.get_window_extent().x1 + 10.0


@pytest.mark.parametrize(
    ("value", "half", "written"),
    [
        (3.2791e9, 1.29e7, "(3.279 ± 0.013)·10⁹"),
        (3.2791e9, 4.1e8, "(3.28 ± 0.41)·10⁹"),
        (6e8, 1.5e9, "(0.6 ± 1.5)·10⁹"),
        (-2.1e9, 4e8, "(−2.10 ± 0.40)·10⁹"),
        (8e9, 1e3, "(8.000 ± 0.000)·10⁹"),
        (8e9, 0.0, "(8.000 ± 0.000)·10⁹"),
        (0.0, 0.0, "0 ± 0"),
    ],
)
def test_values_are_written_with_two_digits_of_their_interval(value: float, half: float, written: str) -> None:
    assert with_interval(value, half) == written


def calibrated_by(measurements: Measurements) -> CalibrationData:
    """Return the data of a calibration of which the figure sees no more than the measurements."""
    nothing = pd.DataFrame()
    return CalibrationData("x", "", {}, nothing, nothing, nothing, nothing, None, {}, measurements)


class TestCompressibility:
    def test_points_line_and_band(self, example: Measurements) -> None:
        figure = drawn(compressibility.draw(calibrated_by(example)))
        (axes,) = figure.axes
        (points,) = axes.containers
        assert isinstance(points, ErrorbarContainer)
        entries = example.measurements
        alpha = np.array([entry.resistance for entry in entries])
        np.testing.assert_allclose(points.lines[0].get_xdata(), [25, 50, 50, 100])
        np.testing.assert_allclose(points.lines[0].get_ydata(), alpha)
        factor = np.exp(1.959964 * np.array([entry.relative_se for entry in entries]))
        ends = np.array([segment[:, 1] for segment in points.lines[2][0].get_segments()])
        np.testing.assert_allclose(ends, np.stack([alpha / factor, alpha * factor], axis=1), rtol=1e-6)
        fit = compressibility_by_csd(example)["pmma_50_50"]
        (line,), (band,) = marked(axes, "line"), marked(axes, "band")
        x = np.asarray(line.get_xdata())
        assert x[0] < 25.0 and x[-1] > 100.0
        value, low, high = fit.resistance_at(x * 1e3)
        np.testing.assert_allclose(line.get_ydata(), value)
        edge = band.get_paths()[0].vertices
        ends = sorted(edge[np.isclose(edge[:, 0], x[50], rtol=1e-12), 1])
        assert ends == pytest.approx([low[50], high[50]])
        assert axes.get_xscale() == axes.get_yscale() == "log"
        assert axes.get_xlabel() == "Pressure drop Δp (kPa)"
        assert axes.get_ylabel() == "Specific cake resistance (10⁹ m/kg)"
        assert axes.get_ylim()[1] >= 1.99 * axes.get_ylim()[0]

    def test_exponents_are_in_the_legend(self) -> None:
        values = [("a", dp, 1e9 * (dp / 1e5) ** 0.4 * by) for dp, by in ((2e4, 1.0), (5e4, 1.1), (1e5, 0.95))]
        values += [("b", 2e4, 2e9), ("b", 8e4, 1e9), ("c", 5e4, 5e9), ("d", None, 1e9)]
        found = of_values(*values)
        figure = drawn(compressibility.draw(calibrated_by(found)))
        said, fits = texts(figure), compressibility_by_csd(found)
        assert fits["a"].exponent == pytest.approx(0.38, abs=0.01)
        assert fits["a"].exponent_ci95 == pytest.approx(1.13, abs=0.01)
        assert "a: k = 0.4 ± 1.1" in said
        assert "b: k = −0.50 (no interval)" in said and "b: two points" in said
        (axes,) = figure.axes
        assert len(axes.containers) == 3 and len(marked(axes, "line")) == 2 and len(marked(axes, "band")) == 1
        labels = [entry.get_text() for entry in figure.legends[0].get_texts()]
        assert labels[2] == "c" and len(labels) == 3

    def test_points_at_one_pressure_stand_alone(self) -> None:
        figure = drawn(compressibility.draw(calibrated_by(of_values(("a", 5e4, 1e9), ("b", 5e4, 2e9)))))
        (axes,) = figure.axes
        assert len(axes.containers) == 2 and not marked(axes, "line")
        assert "intervals of the line" not in texts(figure)

    @pytest.mark.parametrize("found", [NOTHING, of_values(("a", None, 1e9))])
    def test_without_pressures_it_says_so(self, found: Measurements) -> None:
        assert "no resistance is given with its pressure" in texts(drawn(compressibility.draw(calibrated_by(found))))
