"""The report of the tiny study: one file, complete, and readable without a network and in a browser."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from checkouts import TINY, Checkout

from filtercake.figures.catalogue import title_of
from filtercake.report.catalogue import PAGES

WALK = Path(__file__).with_name("walk_report.js")
NOWHERE = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
"""Makes every request fail: the report needs none."""
ANSWERS = ["Resistance against cohesion (Fig. 10)", "Cut through a packing"]
"""What the front page shows of the tiny study."""
LOADED = re.compile(r"""<(?:script|img|iframe|link)\b[^>]*?\b(?:src|href)=["']?https?:|@import|url\(["']?https?:""")
WRONG = re.compile("Uncaught|Error|Failed to load|net::|Refused")
"""Of the console's lines those that are errors; the rest are the hints of the libraries inside the report."""


@pytest.fixture(scope="module")
def reported(finished: Checkout) -> Path:
    style = ("--report-stylesheet", "workflow/report/report.css", "--report-metadata", "workflow/report/landing.yaml")
    for steps in ((), ("--report", "results/report.html", *style)):
        done = finished.snakemake("report", "--config", f"studies={TINY}", *steps, **NOWHERE)
        assert done.returncode == 0, done.stderr + done.stdout
    assert "Loading script code" not in done.stderr
    return finished.root / "results" / "report.html"


def embedded(report: Path, name: str) -> Any:
    """Value that the report's own script holds under a name."""
    start = rf'<script id="{name.replace("_", "-")}">\s*var {name} = '
    found = re.search(rf"{start}(.*);$", report.read_text(encoding="utf-8"), re.MULTILINE)
    assert found is not None
    return json.loads(found[1])


def page_text(result: dict[str, Any]) -> str:
    return base64.b64decode(result["data_uri"].partition("base64,")[2]).decode()


def test_one_file_holds_everything_and_loads_nothing(reported: Path, finished: Checkout) -> None:
    text = reported.read_text(encoding="utf-8")
    assert not LOADED.search(text)
    results = embedded(reported, "results")
    assert all(result["data_uri"].startswith("data:") for result in results.values())
    assert set(embedded(reported, "categories")) == {"Method", "Study tiny"}
    parts = embedded(reported, "categories")["Study tiny"]
    assert set(parts) == {"Figures", "Tables", "Failed packings", "Provenance"}
    assert {Path(path).stem for path in parts["Figures"]} == {
        path.stem for path in (finished.results / "figures").glob("*.png")
    }
    pages = {Path(path).stem: page_text(results[path]) for part in parts if part != "Figures" for path in parts[part]}
    # the published value of the tiny study has no cohesion to compare at
    assert set(pages) == {"summary", "table1", "table2", "table3", "table4", "failed", "provenance"} <= set(PAGES)
    assert "None of 10 packings failed." in pages["failed"]
    record = json.loads((finished.results / "provenance.json").read_text())
    assert record["versions"]["numpy"] in pages["provenance"]
    assert all(str(seed) in pages["provenance"] for seed in record["seeds"].values())
    assert not any(LOADED.search(page) for page in pages.values())


def test_captions_and_front_page_name_n_and_the_engine(reported: Path, finished: Checkout) -> None:
    engines = json.loads((finished.results / "provenance.json").read_text())["engines"]
    name = "LIGGGHTS" if engines == ["liggghts"] else "embedded engine"
    figures = [entry for entry in embedded(reported, "results").values() if entry["mime_type"] == "image/png"]
    assert figures
    for text in (*(figure["caption"] for figure in figures), embedded(reported, "workflow_desc")):
        assert re.search(r"n = 10\s+packings", text) and "none failed" in text and name in text
        assert re.search("(?i)porosity|resistance", text) and re.search(r"0\.\d+ ± 0\.\d+|± [\d.]+\)·10", text)


def test_the_front_page_shows_the_answers_above_the_words(reported: Path) -> None:
    front = embedded(reported, "workflow_desc")
    assert re.findall(r'<img src="data:image/png;base64,[^"]+" width="\d+" alt="([^"]*)">', front) == ANSWERS
    assert front.rindex("<img") < front.index("Asked:") < front.index("What was done")
    assert embedded(reported, "metadata")  # or it would open on the graph of jobs


def test_the_menu_names_figures_as_readers_do(reported: Path) -> None:
    figures = {path: found for path, found in embedded(reported, "results").items() if path.endswith(".png")}
    assert figures
    for path, found in figures.items():
        assert found["labels"] == {"figure": title_of(Path(path).stem)}


def test_the_method_page_shows_its_formulas(reported: Path) -> None:
    (page,) = (page_text(r) for path, r in embedded(reported, "results").items() if path.endswith("pages/method.html"))
    assert page.count("<math") > 5 and "What the model leaves out" in page and "$" not in page


@pytest.mark.browser
def test_the_browser_opens_all_of_it_without_errors(reported: Path, tmp_path: Path) -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("needs chromium: make browser")
    text, script = reported.read_text(encoding="utf-8"), WALK.read_text(encoding="utf-8")
    watch, walk = script.split("// --- after the report\n")
    head, _, body = text.partition("<head>")
    inside, _, end = body.rpartition("</body>")
    page = tmp_path / "report.html"
    page.write_text(
        f"{head}<head><script>{watch}</script>{inside}<script>{walk}</script></body>{end}", encoding="utf-8"
    )
    command = [chromium, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"]
    command += [f"--user-data-dir={tmp_path / 'profile'}", "--host-resolver-rules=MAP * ~NOTFOUND"]
    command += ["--window-size=1600,1000", "--virtual-time-budget=120000", "--dump-dom", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line and WRONG.search(line)]
    assert not said, said
    found = re.search(r'<script type="application/json" id="walked">(.*?)</script>', done.stdout, re.DOTALL)
    assert found is not None, done.stderr[-2000:]
    walked = json.loads(found[1])
    assert walked["errors"] == []
    assert walked["requests"] == [], walked["requests"]
    assert all(walked["drawn"].values()) and len(walked["drawn"]) == 4, walked["drawn"]
    for front in (walked["front"], walked["again"]):
        assert [picture["title"] for picture in front["pictures"]] == ANSWERS
        assert all(picture["width"] > 200 for picture in front["pictures"])
        assert front["above"] and front["seen"] and not front["graph"], front
    categories, results = embedded(reported, "categories"), embedded(reported, "results")
    opened = {name: {part: len(rows) for part, rows in parts.items()} for name, parts in walked["categories"].items()}
    listed = {name: {part: len(paths) for part, paths in parts.items()} for name, parts in categories.items()}
    assert opened == listed
    shown = [row for parts in walked["categories"].values() for rows in parts.values() for row in rows]
    assert all(row["shown"] for row in shown), shown
    captions = [row["caption"] for row in shown if row["kind"] == "img"]
    assert len(captions) == sum(entry["mime_type"] == "image/png" for entry in results.values())
    assert all("n = 10 packings" in caption and re.search("LIGGGHTS|engine", caption) for caption in captions)
