"""The tiny study end to end: what it leaves behind, and what an edit makes it redo."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from checkouts import Checkout, edited

from filtercake.figures.catalogue import FIGURES
from filtercake.filtration.resistance import CARMAN_CONSTANT, CARMAN_CONSTANT_CI95
from filtercake.results.replicates import REPLICATE_COLUMNS, SUMMARY_COLUMNS

AFTER_PACKING = {"replicates", "summary", "tables", "figure", "provenance"}


def test_leaves_tables_figures_and_provenance(finished):
    summary = pd.read_csv(finished.results / "summary.csv")
    replicates = pd.read_csv(finished.results / "replicates.csv")
    points = pd.read_csv(finished.results / "points.csv")
    assert list(summary.columns) == list(SUMMARY_COLUMNS)
    assert list(replicates.columns) == list(REPLICATE_COLUMNS)
    assert len(points) == len(summary) == 5
    assert len(replicates) == 10 and (replicates["status"] == "ok").all()
    assert summary["porosity"].between(0.3, 0.55).all()
    assert (summary["porosity_ci95"] > 0).all() and (summary["resistance_ci95_m_kg"] > 0).all()
    means = replicates.groupby("point")["porosity"].mean()
    assert np.allclose(summary.set_index("point")["porosity"], means[summary["point"]])
    for table in ("table1", "table4", "comparison"):
        assert (finished.results / "tables" / f"{table}.csv").stat().st_size > 0
    drawn = {path.stem for path in (finished.results / "figures").glob("*.png")}
    made_by_a_crystallizer = {
        "fig05_truncation",
        "fig12_distributions",
        "fig13_growth_nucleation",
        "fig14_resistance_area",
        "filter_area_sensitivity",
    }
    assert (
        drawn
        == set(FIGURES)
        - {"sensitivity_poisson_restitution", "packing_flow", "cake_compression", "cake_friction"}
        - made_by_a_crystallizer
    )
    assert all(path.with_suffix(".pdf").stat().st_size > 1000 for path in (finished.results / "figures").glob("*.png"))
    record = json.loads((finished.results / "provenance.json").read_text())
    assert record["packings"] == 10 and record["failed"] == 0 and len(record["seeds"]) == 10


def test_friction_and_cohesion_share_their_clouds(finished):
    replicates = pd.read_csv(finished.results / "replicates.csv")
    seeds = replicates[replicates["csd"] == "bimodal"].groupby("replicate")["seed"].nunique()
    assert (seeds == 1).all()
    assert replicates["seed"].nunique() == 4  # two distributions, two replicates


def test_says_where_the_figures_are_and_how_far_it_is(finished):
    assert "figures in results/tiny/figures" in finished.output
    assert "[10/10 packings" in finished.output
    assert "Select jobs" not in finished.output and "Execute " not in finished.output


def test_a_second_call_does_nothing(finished):
    assert not finished.planned()


def changed(text):
    return text + "\nEDITED = True\n"


def commented(text):
    return text + "\n# edited\n"


@pytest.mark.parametrize(
    ("file", "rules"),
    [
        ("src/filtercake/crystals/csd.py", {"csd", "packing", "points", *AFTER_PACKING}),
        ("src/filtercake/packing/cloud.py", {"packing", "points", *AFTER_PACKING}),
        ("liggghts_templates/packing.in.j2", set()),  # nothing of this study is packed by LIGGGHTS
        ("src/filtercake/packing/porosity.py", AFTER_PACKING),
        ("src/filtercake/results/paper_tables.py", {"tables", "provenance"}),
        ("src/filtercake/figures/cross_section.py", {"figure", "provenance"}),
        ("workflow/scripts/packing.py", {"packing", *AFTER_PACKING}),
        ("workflow/scripts/summary.py", {"summary", "tables", "figure", "provenance"}),
    ],
)
def test_an_edit_reruns_exactly_what_depends_on_it(finished, file, rules):
    with edited(finished.root / file, changed):
        planned = finished.planned()
    assert set(planned) - {"all"} == rules
    assert planned["packing"] in (0, 5)
    if file.endswith("cross_section.py"):
        assert planned["figure"] == 1


def test_a_comment_in_the_library_remakes_nothing(finished):
    with edited(finished.root / "src/filtercake/crystals/csd.py", commented):
        assert not finished.planned()


def test_a_new_value_in_the_study_makes_only_the_new_points(finished):
    study = finished.root / "config/test/tiny.yaml"
    with edited(study, lambda text: text.replace("cohesion_kJ_m3: [0, 50]", "cohesion_kJ_m3: [0, 25, 50]")):
        planned = finished.planned()
    assert planned["packing"] == 2  # one per friction
    assert planned["csd"] == 0
    assert set(planned) - {"all"} == {"packing", "points", *AFTER_PACKING}


def test_a_plan_counts_what_is_made_not_what_is_kept(finished):
    study = finished.root / "config/test/tiny.yaml"
    with edited(study, lambda text: text.replace("replicates: 2", "replicates: 3")):
        done = finished.run("--dry-run")
    assert "tiny: 5 of 5 points, 5 packings to make with" in done.stderr


def test_a_label_in_the_study_makes_no_packing(finished):
    study = finished.root / "config/test/tiny.yaml"
    with edited(study, lambda text: text.replace("50/50 wt% 30/50 um", "another label")):
        planned = finished.planned()
    assert set(planned) - {"all"} == {"tables", "figure", "provenance"}


def test_another_resistance_law_makes_tables_and_figures_only(finished):
    summary = pd.read_csv(finished.results / "summary.csv")
    assert (summary["resistance_law"] == "additive").all()
    assert np.allclose(summary["resistance_m_kg"], summary["resistance_additive_m_kg"])
    study = finished.root / "config/test/tiny.yaml"
    with edited(study, lambda text: text.replace("packing:\n", "resistance_law: carman\n\npacking:\n")):
        planned = finished.planned()
        assert set(planned) - {"all"} == AFTER_PACKING
    with edited(study, lambda text: text.replace("packing:\n", "resistance_law: stokes\n\npacking:\n")):
        refused = finished.run("--dry-run")
    assert refused.returncode != 0 and "resistance_law = 'stokes': needs the flow solved" in refused.stderr


def test_another_resistance_law_is_in_the_tables_end_to_end(finished, tmp_path):
    copy = Checkout(shutil.copytree(finished.root, tmp_path / "copy", symlinks=True))
    study = copy.root / "config/test/tiny.yaml"
    study.write_text(study.read_text().replace("packing:\n", "resistance_law: carman\n\npacking:\n"))
    done = copy.run("--", "results/tiny/tables/table4.csv")
    assert done.returncode == 0, done.stderr + done.stdout
    before, after = (pd.read_csv(where.results / "summary.csv") for where in (finished, copy))
    table4 = pd.read_csv(copy.results / "tables/table4.csv")
    for table in (after, table4):
        assert (table["resistance_law"] == "carman").all()
        assert np.allclose(table["resistance_m_kg"], table["resistance_carman_m_kg"])
        relative = table["resistance_law_ci95_m_kg"] / table["resistance_m_kg"]
        assert np.allclose(relative, CARMAN_CONSTANT_CI95 / CARMAN_CONSTANT)
    assert np.allclose(after["resistance_additive_m_kg"], before["resistance_m_kg"])
    assert np.allclose(after["resistance_ci95_m_kg"], before["resistance_carman_ci95_m_kg"])
    assert np.allclose(after["porosity"], before["porosity"])


def test_more_time_pictures_or_processes_make_no_packing_anew(finished):
    study = finished.root / "config/test/tiny.yaml"
    more = "packing:\n  time_limit_min: 300\n  write_vtk: true\n  processes: 2\n"
    with edited(study, lambda text: text.replace("packing:\n", more)):
        planned = finished.planned()
    assert not planned["packing"] and not planned["replicates"] and not planned["points"]


def test_an_edited_size_distribution_remakes_only_its_points(finished):
    table = finished.root / "config/test/tiny.csv"
    with edited(table, lambda text: text.replace("50,0.25", "50,0.20").replace("40,0.25", "40,0.30")):
        planned = finished.planned()
    assert planned["packing"] == 1
    assert planned["csd"] == 1
