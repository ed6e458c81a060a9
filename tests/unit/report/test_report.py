"""The report's words, pages and captions: numbers are the tables', and what users wrote is text."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from designs import made as make_design
from designs import task_of
from designs import written as write_design
from matplotlib.figure import Figure
from PIL import Image
from test_alum_figures import STUDIES
from test_alum_figures import make as make_alum
from test_calibration_figures import CASES
from test_calibration_figures import make as make_calibration
from test_figures import POINTS
from test_figures import make as make_study

from filtercake.figures.calibrated import CalibrationData, with_interval
from filtercake.figures.catalogue import CALIBRATION_FIGURES, DESIGN_FIGURES, EVERY_FIGURE, FIGURES, answering, title_of
from filtercake.figures.designed import DesignData
from filtercake.figures.selection import StudyData
from filtercake.figures.style import panels, save
from filtercake.report import captions, markdown, pages, words
from filtercake.report.catalogue import PAGES
from filtercake.report.pictures import on_screen
from filtercake.study.loading import load_study

ROOT = Path(__file__).resolve().parents[3]
TEMPLATES = ROOT / "workflow" / "report" / "captions"
PAGE = ROOT / "workflow" / "report" / "page.html.j2"
FOOTER = "n = 3 packings, none failed; LIGGGHTS"


@pytest.mark.parametrize(
    ("value", "half", "written"),
    [
        (0.35221, 0.00124, "0.3522 ± 0.0012"),
        (1.1426e9, 5.7e7, "(1.143 ± 0.057)·10⁹ m/kg"),
        (0.4, np.nan, "0.4 ± –"),
        (np.nan, np.nan, "no accepted packing"),
        (0.395, 0.54, "0.40 ± 0.54"),
    ],
)
def test_a_value_has_the_digits_that_its_interval_leaves(value: float, half: float, written: str) -> None:
    assert words.with_interval(value, half, "m/kg" if value > 1.0 else "") == written


@pytest.mark.parametrize(("value", "written"), [(75812.0, "75800"), (0.02, "0.02"), (-1.5e-7, "−1.5·10⁻⁷")])
def test_a_number_is_short(value: float, written: str) -> None:
    assert words.number(value, 3) == written


@pytest.mark.parametrize(
    ("column", "written"),
    [
        ("resistance_m_kg", "resistance (m/kg)"),
        ("cohesion_kJ_m3", "cohesion (kJ/m³)"),
        ("growth_rate_m_s", "growth rate (m/s)"),
        ("resistance_ci95_m_kg", "resistance (m/kg): half-width of the 95 % interval"),
        ("friction", "friction"),
        ("resistance_law", "law of the resistance"),
        ("resistance_law_ci95_m_kg", "half-width of the law's own 95 % interval (m/kg)"),
        ("classes", "classes"),
    ],
)
def test_a_heading_has_its_unit(column: str, written: str) -> None:
    assert words.heading(column) == written


def test_intervals_stand_beside_their_values_and_empty_columns_go() -> None:
    table = pd.DataFrame({"csd": ["a"], "porosity": [0.35], "porosity_ci95": [0.01], "residence_time_min": [np.nan]})
    headings, rows = words.readable(table)
    assert headings == ["distribution", "porosity of the interior, ± 95 %"]
    assert rows == [["a", "0.350 ± 0.010"]]


def test_formulas_become_mathml_and_links_to_files_text() -> None:
    html = markdown.to_html("So $x^2$ <b>, see [there](benchmark.md#a) and [here](https://example.org).\n\n$$y$$\n")
    assert html.count("<math") == 2 and "$" not in html
    assert '<cite title="benchmark.md#a">there</cite>' in html and '<a href="https://example.org">here</a>' in html
    assert "&lt;b&gt;" in html


@pytest.mark.parametrize("name", ["method", "calibration"])
def test_the_documentation_has_no_formula_left_as_text(name: str) -> None:
    html = markdown.to_html((ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8"))
    assert "$" not in html and "merror" not in html
    assert (html.count("<math") > 5) == (name == "method")


@pytest.fixture(scope="module")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> StudyData:
    return make_study(tmp_path_factory.mktemp("packings"), POINTS, title="<i>Made & up</i>")


@pytest.fixture(scope="module")
def alum() -> StudyData:
    return make_alum(load_study(STUDIES / "alum.yaml"))


def written(folder: Path, figure: str, values: dict) -> tuple[str, str]:
    drawn = Figure()
    drawn.supxlabel(FOOTER)
    save(drawn, folder / f"{figure}.png", folder / f"{figure}.pdf")
    captions.write(TEMPLATES, [folder / f"{figure}.png"], values, folder)
    return tuple(" ".join((folder / f"{name}.html").read_text().split()) for name in (figure, "front"))


@pytest.mark.parametrize("figure", FIGURES)
def test_every_figure_has_a_caption_with_n_and_engine(
    figure: str, made_up: StudyData, alum: StudyData, tmp_path: Path
) -> None:
    for data, engine in ((made_up, "LIGGGHTS"), (alum, "embedded engine")):
        caption, front = written(tmp_path, figure, captions.study_values(data))
        good = int((data.replicates["status"] == "ok").sum())
        assert FOOTER in caption and engine in caption
        for text in (caption, front):
            assert f"n = {good} packings" in text and "nan" not in text
    assert len(caption) > 300


def test_the_front_page_shows_the_figures_that_answer_above_the_words(made_up: StudyData, tmp_path: Path) -> None:
    names = ["fig09_porosity_vs_cohesion", "packing_cross_section", "fig10_resistance_vs_cohesion"]
    for name in names:
        save(Figure(figsize=(3.5, 2.0)), tmp_path / f"{name}.png", tmp_path / f"{name}.pdf")
    captions.write(TEMPLATES, [tmp_path / f"{name}.png" for name in names], captions.study_values(made_up), tmp_path)
    front = (tmp_path / "front.html").read_text()
    found = re.findall(r'<img src="data:image/png;base64,([^"]+)" width="394" alt="([^"]+)">', front)
    assert [title for _, title in found] == ["Resistance against cohesion (Fig. 10)", "Cut through a packing"]
    assert front.index("<h2>") < front.index("<img") < front.rindex("</figure>") < front.index("Asked:")
    for data, _ in found:
        with Image.open(io.BytesIO(base64.b64decode(data))) as image:
            assert image.size == (525, 300)  # 3.5 by 2.0 inches at 150 dpi


def test_a_picture_on_a_screen_is_what_was_printed(tmp_path: Path) -> None:
    figure, (axes,) = panels()
    axes.plot([0.0, 1.0], [0.0, 1.0], color="#0072B2")
    save(figure, tmp_path / "a.png", tmp_path / "a.pdf")
    data = base64.b64decode(on_screen(tmp_path / "a.png").uri.removeprefix("data:image/png;base64,"))
    with Image.open(io.BytesIO(data)) as small, Image.open(tmp_path / "a.png") as whole:
        expected = np.asarray(whole.convert("RGB").resize(small.size, Image.Resampling.LANCZOS), dtype=float)
        assert np.abs(np.asarray(small.convert("RGB"), dtype=float) - expected).max() < 16.0
    assert len(data) < (tmp_path / "a.png").stat().st_size / 2


@pytest.mark.parametrize(
    ("figures", "shown"),
    [
        (
            ["packing_cross_section", "fig08_resistance_vs_porosity"],
            ["fig08_resistance_vs_porosity", "packing_cross_section"],
        ),
        (
            ["fig08_resistance_vs_porosity", "fig10_resistance_vs_cohesion", "fig14_resistance_area"],
            ["fig14_resistance_area", "fig10_resistance_vs_cohesion"],
        ),
        (["calibration_objective", "calibration_parity"], ["calibration_parity"]),
        ([], []),
    ],
)
def test_the_figures_that_answer_come_first(figures: list[str], shown: list[str]) -> None:
    assert answering(figures) == shown


def test_every_figure_has_a_title_of_its_own() -> None:
    titles = [title_of(name) for name in EVERY_FIGURE]
    assert len(set(titles)) == len(titles)
    assert all("_" not in title and title[0].isupper() and len(title) < 60 for title in titles)
    for name in FIGURES:
        number = re.match(r"fig0?(\d+)_", name)
        assert ("(Fig. " in title_of(name)) == bool(number)
        assert number is None or title_of(name).endswith(f"(Fig. {number[1]})")


@pytest.mark.parametrize("figure", ["fig09_porosity_vs_cohesion", "fig10_resistance_vs_cohesion"])
def test_captions_say_that_markers_are_shifted(figure: str, made_up: StudyData, tmp_path: Path) -> None:
    caption, _ = written(tmp_path, figure, captions.study_values(made_up))
    assert "at one cohesion are shifted sideways" in caption


def test_captions_hold_the_numbers_of_the_tables(made_up: StudyData, alum: StudyData, tmp_path: Path) -> None:
    caption, front = written(tmp_path, "fig09_porosity_vs_cohesion", captions.study_values(made_up))
    row = made_up.summary.set_index("point").loc["s0"]
    assert f"from {words.with_interval(row['porosity'], row['porosity_ci95'])} at 0 kJ/m³" in caption
    assert "4 failed" in caption and "&lt;i&gt;Made &amp; up&lt;/i&gt;" in front and "<i>" not in front
    caption, front = written(tmp_path, "fig14_resistance_area", captions.study_values(alum))
    row = alum.summary.iloc[0]
    assert words.with_interval(row["resistance_m_kg"], row["resistance_ci95_m_kg"], "m/kg") in caption
    assert "The drum filter needs" in front


def test_both_parts_of_a_resistance_s_interval_are_said(alum: StudyData, tmp_path: Path) -> None:
    caption, front = written(tmp_path, "fig14_resistance_area", captions.study_values(alum))
    row = alum.summary.iloc[0]
    assert f"<td>± {words.number(row['resistance_law_ci95_m_kg'], 2)} m/kg</td>" in front
    for text in (caption, front):
        assert "by eq. 3 (additive)" in text and "by the law itself" in text
    assert "by Carman, −13 %" in caption


def test_the_law_is_among_the_parameters(alum: StudyData) -> None:
    table = pages.parameters(alum.study).set_index("parameter")
    assert table.loc["law of the resistance", "value"] == "eq. 3 (additive)"


@pytest.fixture(scope="module")
def calibration() -> CalibrationData:
    return make_calibration(**next(iter(CASES.values())))


@pytest.mark.parametrize("figure", CALIBRATION_FIGURES)
def test_every_figure_of_a_calibration_has_a_caption_with_n_and_engine(
    figure: str, calibration: CalibrationData, tmp_path: Path
) -> None:
    caption, front = written(tmp_path, figure, captions.calibration_values(calibration))
    value = with_interval(*calibration.found)
    good = int((calibration.simulated["status"] == "ok").sum())
    for text in (caption, front):
        assert f"n = {good} packings" in text and "engine" in text and value in text
    assert FOOTER in caption


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> DesignData:
    folder = tmp_path_factory.mktemp("design")
    outcome = make_design(task_of(folder), {2: (0.003, 0.001, 0.004), 3: (0.002, 0.003, float("nan"))})
    return DesignData.read("mine", "A design", *write_design(outcome, folder / "design"))


@pytest.mark.parametrize("figure", DESIGN_FIGURES)
def test_every_figure_of_a_design_has_a_caption_with_n_and_engine(
    figure: str, design: DesignData, tmp_path: Path
) -> None:
    caption, front = written(tmp_path, figure, captions.design_values(design))
    for text in (caption, front):
        assert "n = 5 packings" in text and "1 failed" in text and "embedded engine" in text
    assert FOOTER in caption
    assert front.count("<li>") == len(design.summary["findings"])
    answer = design.summary["findings"][0]["text"]
    assert answer[1:50] in front and (figure == "design_trade_off" or answer[1:50] in caption)


def test_failed_packings_are_listed_with_their_reasons(made_up: StudyData, tmp_path: Path) -> None:
    content = pages.failed(made_up.replicates)
    assert "4 of 22 packings failed" in content.lead
    assert content.table["reason"].eq("not settled").all() and len(content.table) == 4
    pages.write(PAGE, {"failed": content}, tmp_path)
    html = (tmp_path / "failed.html").read_text()
    assert html.count("<tr>") == 5 and "data:text/csv;base64," in html
    good = made_up.replicates[made_up.replicates["status"] == "ok"]
    assert pages.failed(good).lead == "None of 18 packings failed."


def test_pages_are_those_of_the_tables_that_have_rows(made_up: StudyData, tmp_path: Path) -> None:
    made_up.summary.to_csv(tmp_path / "summary.csv", index=False)
    (tmp_path / "tables").mkdir()
    (tmp_path / "tables" / "comparison.csv").write_text("csd,published\n")
    provenance = {"versions": {"filtercake": "1"}, "machine": {"system": "Linux"}, "commit": "abc"}
    packings = made_up.replicates.assign(seed=range(len(made_up.replicates)))
    found = pages.contents(tmp_path, packings, made_up.study, provenance)
    assert set(found) == {"summary", "table3", "failed", "provenance"} <= set(PAGES)
    pages.write(PAGE, found, tmp_path / "pages")
    texts = {name: (tmp_path / "pages" / f"{name}.html").read_text() for name in found}
    assert "density (kg/m³)" in texts["table3"] and "abc" in texts["provenance"]
    assert all("http" not in text for text in texts.values())


def test_a_table_cannot_bring_markup_of_its_own(tmp_path: Path) -> None:
    content = pages.Content("lead", pd.DataFrame({"csd": ["<script>alert(1)</script>"]}))
    assert "<script>" not in pages.render(PAGE, "title", content)
