"""A study of pressed cakes: points that differ in pressure and adhesion share their packings."""

import re

import numpy as np
import pandas as pd
import pytest
from checkouts import copy_project

STUDY = "config/test/tiny_pressed.yaml"


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    checkout = copy_project(tmp_path_factory.mktemp("pressed") / "project")
    done = checkout.run(study=STUDY)
    assert done.returncode == 0, done.stderr + done.stdout
    checkout.output = done.stdout + done.stderr
    return checkout


def folder(checkout):
    return checkout.root / "results" / "tiny_pressed"


def test_one_cell_serves_four_points(pressed):
    assert [path.name for path in (folder(pressed) / "packings").iterdir()] == list(
        pd.read_csv(folder(pressed) / "points.csv")["packings"].unique()
    )
    assert re.search(r"2 packings to make", pressed.output)
    summary = pd.read_csv(folder(pressed) / "summary.csv")
    assert len(summary) == 4 and (summary["n"] == 2).all()
    assert set(summary["protocol"]) == {"filtration"}


def test_a_higher_load_packs_denser_and_resists_more(pressed):
    rows = pd.read_csv(folder(pressed) / "summary.csv").sort_values("load_over_strength")
    # x = p/p_c: 5 and 50 kPa over what 10 and 1 mJ/m2 hold; the two in the middle are the same load
    load = rows["load_over_strength"].to_numpy()
    assert np.allclose(load / load[0], [1.0, 10.0, 10.0, 100.0])
    porosity, resistance = rows["porosity"].to_numpy(), rows["resistance_m_kg"].to_numpy()
    assert porosity[0] > porosity[1] > porosity[3] and porosity[1] == pytest.approx(porosity[2], abs=1e-12)
    assert resistance[0] < resistance[1] < resistance[3]
    assert (rows["porosity_at_medium"] <= rows["porosity"] + 1e-9).all()
    # the exponent falls with the load: what is compressed already does not compress any more
    assert rows["compressibility"].iloc[0] > rows["compressibility"].iloc[3]


def test_another_pressure_is_no_new_packing(pressed):
    study = pressed.root / STUDY
    text = study.read_text()
    try:
        study.write_text(text.replace("[5, 50]", "[5, 50, 200]"))
        planned = set(pressed.planned(study=STUDY))
    finally:
        study.write_text(text)
    assert "replicates" in planned and "packing" not in planned


def test_figures_are_those_of_a_pressed_cake(pressed):
    drawn = {path.stem for path in (folder(pressed) / "figures").glob("*.png")}
    assert "cake_compression" in drawn and "packing_cross_section" in drawn
    assert not {"fig03_porosity_trajectory", "packing_porosity_profile"} & drawn
