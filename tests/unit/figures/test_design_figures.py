"""Figures of designs: they show what the tables hold, and say what stands behind it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from designs import DESIGN, made, task_of, written
from test_calibration_figures import bars, marked, texts

from filtercake.figures.catalogue import DESIGN_FIGURES, draw, figures_of_design
from filtercake.figures.designed import TIME, DesignData
from filtercake.figures.style import save
from filtercake.study.config.design import Design

CASES = {
    "two levels": (DESIGN, {2: (0.003, 0.001, 0.004), 3: (0.002, 0.003, float("nan"))}),
    "nothing packed": (DESIGN, {}),
    "no design": (DESIGN.replace("[5, 50]", "[5000, 6000]"), {}),
    "area": (
        DESIGN.replace("objective: installed_cost", "objective: filter_area").replace(
            "trade_off: filter_area", "trade_off: purchase_cost"
        ),
        {4: (0.0, 0.001)},
    ),
    "moisture": (
        DESIGN.replace(
            "trade_off: filter_area", "trade_off: cake_moisture\n  deliquoring_share: 0.4\n  surface_tension_mN_m: 72"
        ),
        {1: (0.0,)},
    ),
}


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> dict[str, DesignData]:
    found = {}
    for name, (text, deviations) in CASES.items():
        folder = tmp_path_factory.mktemp("case")
        outcome = made(task_of(folder, text), deviations)
        found[name] = DesignData.read("mine", "A design", *written(outcome, folder / "design"))
    return found


@pytest.mark.parametrize("figure", DESIGN_FIGURES)
@pytest.mark.parametrize("case", CASES)
def test_every_figure_is_drawn_and_saved(figure: str, case: str, cases: dict[str, DesignData], tmp_path: Path) -> None:
    drawn = draw(figure, cases[case])
    save(drawn, tmp_path / "x.png", tmp_path / "x.pdf")
    assert (tmp_path / "x.png").stat().st_size > 5_000
    for axes in drawn.axes:
        assert axes.get_xlabel() or axes.get_ylabel()
    said = texts(drawn)
    assert ("no design keeps to the limits" in said) == (case == "no design")
    assert ("the instant estimate alone" in said) == (case in ("nothing packed", "no design"))


def test_the_objective_is_shown_with_its_parts_and_its_optimum(cases: dict[str, DesignData]) -> None:
    data = cases["two levels"]
    (axes,) = draw("design_objective", data).axes
    total, vessel, cloth = (line.get_ydata() for line in axes.get_lines()[:3])
    assert np.asarray(total) == pytest.approx(data.search["installed_cost"] / 1e3)
    assert np.asarray(vessel) + np.asarray(cloth) == pytest.approx(np.asarray(total))
    (span,) = marked(axes, "interval")
    ends = sorted(span.get_x() + np.array([0.0, span.get_width()]))
    assert ends == pytest.approx([data.summary[TIME]["low"], data.summary[TIME]["high"]])
    (across, up) = bars(axes)
    assert [float(end[0, 0]) for end in across] == pytest.approx(ends)
    value = data.summary["value"]
    assert [float(end[0, 1]) for end in up] == pytest.approx([value["low"] / 1e3, value["high"] / 1e3])
    (packed,) = (line for line in axes.get_lines() if line.get_label() == "packings")
    assert np.asarray(packed.get_xdata()).tolist() == data.levels[TIME].tolist()


def test_area_and_resistance_stand_beside_their_packings(cases: dict[str, DesignData]) -> None:
    data = cases["two levels"]
    panels = draw("design_resistance", data).axes
    for axes, name in zip(panels, ("filter_area{}_m2", "resistance{}_m_kg"), strict=True):
        ((low, high),) = bars(axes)
        assert low[:, 1] == pytest.approx(data.levels[name.format("_low")])
        assert high[:, 1] == pytest.approx(data.levels[name.format("_high")])
        assert low[:, 0] == pytest.approx(data.levels[TIME])


def test_the_trade_off_goes_from_the_least_of_one_to_the_least_of_the_other(cases: dict[str, DesignData]) -> None:
    data = cases["two levels"]
    axes = draw("design_trade_off", data).axes[0]
    cost, area = (np.asarray(values, dtype=float) for values in axes.get_lines()[0].get_data())
    assert cost[0] == pytest.approx(data.summary["value"]["value"] / 1e3, rel=0.01)
    assert area[-1] == pytest.approx(data.search["filter_area_m2"].min(), rel=0.01)


def test_a_trade_off_is_only_of_two_objectives() -> None:
    one = Design.model_validate({"variables": {"residence_time_min": [1, 2]}})
    two = one.model_copy(update={"trade_off": "filter_area"})
    assert set(figures_of_design(two)) - set(figures_of_design(one)) == {"design_trade_off"}
