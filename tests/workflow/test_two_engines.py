"""A study whose block is packed by both engines, and whose packings are checked by the other."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from checkouts import copy_project, edited

STUDY = """\
csds:
  halves: {mixture: [{size_um: 30, volume_fraction: 0.5}, {size_um: 50, volume_fraction: 0.5}]}
material: {density_kg_m3: 1180}
packing: {particles: 200, replicates: 2}
sweeps:
  - {csd: halves, engine: [embedded, liggghts]}
  - {csd: halves, cohesion_kJ_m3: [0, 50]}
cross_check: {engine: liggghts, packings: 3}
"""


@pytest.fixture
def study(tmp_path: Path):
    checkout = copy_project(tmp_path / "project")
    (checkout.root / "both.yaml").write_text(STUDY)
    return checkout


@pytest.mark.liggghts
def test_rows_say_which_engine_and_the_cross_check_how_they_differ(study) -> None:
    done = study.snakemake("--config", "studies=both.yaml")
    assert done.returncode == 0, done.stderr + done.stdout
    folder = study.root / "results" / "both"
    summary = pd.read_csv(folder / "summary.csv")
    assert sorted(summary["engine"]) == ["embedded", "embedded", "liggghts"]
    table4 = pd.read_csv(folder / "tables" / "table4.csv")
    assert table4["engine"].tolist() == ["embedded", "liggghts"] and (table4["n"] == 2).all()
    checked = pd.read_csv(folder / "tables" / "cross_check.csv")
    assert len(checked) == 3 and set(checked["other_engine"]) == {"liggghts"}
    # the study's own packings, as its table has them, and others of the same clouds
    own = pd.read_csv(folder / "replicates.csv").set_index(["point", "replicate"])["porosity"]
    for row in checked.to_dict("records"):
        assert row["porosity"] == own[row["point"], row["replicate"]]
        assert row["difference"] == pytest.approx(row["other_porosity"] - row["porosity"])
        assert abs(row["difference"]) < 0.05
    assert not set(checked["point"]) & set(summary.loc[summary["engine"] == "liggghts", "point"])
    assert "cross-check: LIGGGHTS less embedded engine:" in done.stdout + done.stderr
    assert not study.planned(study="both.yaml")
    # another deck is no reason to make the embedded engine's packings again
    with edited(study.root / "liggghts_templates/packing.in.j2", lambda deck: deck + "\n# edited\n"):
        assert study.planned(study="both.yaml")["packing"] == 1 + checked["point"].nunique()


def test_without_the_other_engine_the_rest_is_made_and_a_line_says_so(study) -> None:
    done = study.snakemake("--config", "studies=both.yaml", "--dry-run", FILTERCAKE_LIGGGHTS="/no/such/program")
    assert done.returncode == 0, done.stderr + done.stdout
    said = done.stdout + done.stderr
    assert "sweeps[0].engine: nothing is packed by liggghts: LIGGGHTS is not at /no/such/program" in said
    assert "cross_check.engine: nothing is checked by liggghts" in said
    assert "2 of 2 points, 4 packings to make with embedded" in said
