"""A tiny design from its section to its figures, run once; what breaks it says why before any job starts."""

from __future__ import annotations

import json

import pandas as pd
import pytest
from checkouts import Checkout, copy_project, edited

from filtercake.figures.catalogue import DESIGN_FIGURES

TINY = "config/test/tiny_design.yaml"


@pytest.fixture(scope="module")
def designed(tmp_path_factory: pytest.TempPathFactory) -> Checkout:
    checkout = copy_project(tmp_path_factory.mktemp("designed") / "project")
    done = checkout.run("--", "design", study=TINY)
    assert done.returncode == 0, done.stderr + done.stdout
    checkout.output = done.stdout
    return checkout


def test_every_product_is_there_and_consistent(designed: Checkout) -> None:
    folder = designed.root / "results" / "tiny_design" / "design"
    record = json.loads((folder / "design.json").read_text())
    rounds = [json.loads(path.read_text()) for path in sorted((folder / "rounds").glob("*.json"))]
    assert [made["finished"] for made in rounds] == [False] * (len(rounds) - 1) + [True]
    assert record["ended"] == rounds[-1]["why"] and record["kind"] == "lower bound"
    table = pd.read_csv(folder / "tables" / "packings.csv")
    assert set(table["packings"]) == {name for made in rounds for name in made["packings"]}
    assert record["packings"] == len(table) and (table["status"] == "ok").all()
    search = pd.read_csv(folder / "tables" / "search.csv")
    assert search["objective"].min() == pytest.approx(record["value"]["value"])
    for figure in DESIGN_FIGURES:
        for suffix in ("png", "pdf"):
            assert (folder / "figures" / f"{figure}.{suffix}").stat().st_size > 5_000


def test_the_run_ends_with_the_answer(designed: Checkout) -> None:
    record = json.loads((designed.root / "results/tiny_design/design/design.json").read_text())
    for finding in record["findings"]:
        assert f"tiny_design: {finding['kind']}: {finding['text']}" in designed.output


def test_nothing_is_left_to_do_and_another_cost_makes_no_packing(designed: Checkout) -> None:
    again = designed.run("--dry-run", "--", "design", study=TINY)
    assert "Nothing to be done" in again.stdout + again.stderr
    with edited(designed.root / TINY, lambda text: text + "  costs: {cost_index: 700}\n"):
        jobs = designed.planned("design", study=TINY)
    assert jobs["design_round"] and not jobs["packing"]


def test_its_part_of_the_report_holds_the_outcome(designed: Checkout) -> None:
    folder = designed.root / "results" / "tiny_design" / "design"
    done = designed.run("--", f"{folder.relative_to(designed.root)}/report/pages", study=TINY)
    assert done.returncode == 0, done.stderr + done.stdout
    assert "KeyError" not in done.stderr
    pages = {path.stem for path in (folder / "report" / "pages").glob("*.html")}
    assert pages == {"levels", "search", "costs", "safety", "pareto", "table3", "failed", "provenance"}
    captions = {path.stem for path in (folder / "report" / "captions").glob("*.html")}
    assert captions == {*DESIGN_FIGURES, "front"}


def test_what_is_wrong_is_said_before_any_job(designed: Checkout) -> None:
    with edited(designed.root / TINY, lambda text: text.replace("packings: 4", "packings: 1")):
        done = designed.run("--dry-run", "--", "design", study=TINY)
    assert done.returncode != 0 and done.stderr.count("filtercake cannot start") == 1
    assert f"{TINY}: design.packings = 1: must be at least packing.replicates, 2" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_study_without_a_design_is_told_so(designed: Checkout) -> None:
    done = designed.run("--dry-run", "--", "design", study="config/test/tiny.yaml")
    assert done.returncode != 0 and "of a study with the section design" in done.stderr + done.stdout
