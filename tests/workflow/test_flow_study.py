"""A study with the flow solved in its packings: tables and figure, and what is solved again."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from checkouts import Checkout

BLOCK = "resistance_law: stokes\n\npermeability: {packings: 1, accuracy: 0.2}\n\npacking:\n"


@pytest.fixture(scope="module")
def solved(finished, tmp_path_factory):
    copy = Checkout(shutil.copytree(finished.root, tmp_path_factory.mktemp("flow") / "copy", symlinks=True))
    study = copy.root / "config/test/tiny.yaml"
    study.write_text(study.read_text().replace("packing:\n", BLOCK))
    done = copy.run("--", "results/tiny/summary.csv", "results/tiny/figures/packing_flow.png")
    assert done.returncode == 0, done.stderr + done.stdout
    return copy


def test_tables_have_permeability_constant_and_the_resistance_that_follows(solved, finished):
    replicates, summary = (pd.read_csv(solved.results / f"{name}.csv") for name in ("replicates", "summary"))
    found = replicates.dropna(subset=["kozeny_constant"])
    assert (found["replicate"] == 0).all() and len(found) == len(summary)
    assert found["kozeny_constant"].between(110.0, 240.0).all()
    assert (summary["n_flow"] == 1).all()
    assert np.allclose(summary["resistance_m_kg"], summary["resistance_stokes_m_kg"])
    # the constant is that of k = eps^3 D^2 / (A (1 - eps)^2), so that alpha = A / 170 times Carman's
    merged = replicates.merge(summary[["point", "kozeny_constant"]], on="point", suffixes=("", "_mean"))
    expected = merged["kozeny_constant_mean"] * merged["resistance_sauter_m_kg"] / 180.0
    assert np.allclose(merged["resistance_stokes_m_kg"], expected)
    share = summary["kozeny_constant_ci95"] / summary["kozeny_constant"]
    assert np.allclose(summary["resistance_law_ci95_m_kg"] / summary["resistance_m_kg"], share)
    assert np.allclose(summary["permeability_ci95_m2"] / summary["permeability_m2"], share)
    before = pd.read_csv(finished.results / "summary.csv")
    assert np.allclose(summary["porosity"], before["porosity"]) and before["kozeny_constant"].isna().all()


def test_packings_are_not_made_again_for_their_flow(solved, finished):
    for kept in sorted((finished.results / "packings").glob("*/r0.npz")):
        other = solved.results / kept.relative_to(finished.results)
        assert other.read_bytes() == kept.read_bytes()


def test_what_was_solved_is_kept(solved):
    folder = sorted((solved.results / "permeability").iterdir())[0]
    before = (folder / "r0.json").stat().st_mtime_ns
    (folder / "permeability.json").unlink()
    done = solved.run("--", f"results/tiny/permeability/{folder.name}/permeability.json")
    assert done.returncode == 0, done.stderr
    assert (folder / "r0.json").stat().st_mtime_ns == before
    row = json.loads((folder / "permeability.json").read_text())["packings"][0]
    assert row["replicate"] == 0 and row["levels"][0]["nodes"] > 0
    # a damaged one is solved again
    (folder / "r0.json").write_text("{}")
    (folder / "permeability.json").unlink()
    done = solved.run("--", f"results/tiny/permeability/{folder.name}/permeability.json")
    assert done.returncode == 0, done.stderr
    assert json.loads((folder / "r0.json").read_text())["kozeny_constant"] == row["kozeny_constant"]


def test_another_accuracy_solves_the_flow_only(solved):
    study = solved.root / "config/test/tiny.yaml"
    text = study.read_text()
    try:
        study.write_text(text.replace("accuracy: 0.2", "accuracy: 0.15"))
        planned = set(solved.planned())
    finally:
        study.write_text(text)
    assert "permeability" in planned and "packing" not in planned
