"""The command line: what it prints, its one-line errors, and that no argument makes it fall over."""

from __future__ import annotations

import importlib
import json
import math
import re
import shutil
from collections.abc import Iterator
from dataclasses import asdict
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake import api
from filtercake.api.measured import load_packing
from filtercake.cli import commands as cli
from filtercake.cli.commands import build_parser, main
from filtercake.errors import ConfigError, PackingRejected
from filtercake.filtration.resistance import CARMAN_CONSTANT, CARMAN_CONSTANT_CI95, RESISTANCE_LAWS
from filtercake.packing.pack import Outcome
from filtercake.study.loading import load_study

PMMA = ["--mixture", "20:0.5,50:0.5"]
ALUM = ["--kinetics", "ammonium_alum", "--residence-time-min", "15", "--slurry-concentration-kg-m3", "200"]
DRUM = [
    *["--slurry-concentration-kg-m3", "200", "--pressure-drop-kPa", "53.33", "--submerged-fraction", "0.3"],
    *["--rotation-rate-rpm", "0.2", "--medium-resistance-1-m", "5e9"],
]
DESIGN = ["filter-batch", "deliquor", "crystallizer", "cost"]
COMMANDS = ["csd", "pack", "predict", "porosity", "permeability", "resistance", "filter-area", *DESIGN, "test"]
ALL_COMMANDS = [*COMMANDS, "export", "rerun"]
BED = ["--mixture", "30:0.5,50:0.5", "--density-kg-m3", "1180", "--particles", "200", "--engine", "embedded"]

ESTIMATED = {"density_kg_m3": 1180, "friction": 0.1, "adhesion_mJ_m2": 10}
NO_DOUBTS: dict[str, list[str]] = {"outside": [], "warnings": []}

Capture = pytest.CaptureFixture[str]


def as_json(arguments: list[str], capsys: Capture) -> dict[str, object]:
    capsys.readouterr()
    assert main([*arguments, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found


def complaint(arguments: list[str], capsys: Capture) -> str:
    capsys.readouterr()
    assert main(arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("filtercake: ")
    assert printed.err.count("\n") == 1
    return printed.err


def test_csd_of_a_mixture(capsys: Capture) -> None:
    found = as_json(["csd", *PMMA], capsys)
    assert found["sum_x_over_d_1_m"] == pytest.approx(35e3)
    assert found["sum_x_over_d2_1_m2"] == pytest.approx(1.45e9)
    assert found["kept_volume_fraction"] == pytest.approx(1.0)


def test_csd_of_the_papers_crystallizer(capsys: Capture, tmp_path: Path) -> None:
    table = tmp_path / "alum.csv"
    found = as_json(["csd", *ALUM, "--output", str(table)], capsys)
    assert found["packed_smallest_um"] == pytest.approx(32.5, abs=0.1)
    assert found["packed_largest_um"] == pytest.approx(543.3, abs=0.1)
    assert found["kept_volume_fraction"] == pytest.approx(0.981, abs=1e-3)
    assert pd.read_csv(table)["volume_fraction"].sum() == pytest.approx(1.0)
    again = as_json(["csd", str(table)], capsys)
    assert again["sum_x_over_d2_1_m2"] == pytest.approx(found["sum_x_over_d2_1_m2"], rel=0.01)


def test_a_law_of_few_numbers(capsys: Capture) -> None:
    beads = as_json(["csd", "--lognormal", "53.5,74.796,104.309"], capsys)
    assert beads["sauter_mean_um"] == pytest.approx(72.289, rel=2e-3)  # the instrument's own
    assert 0.99 < beads["kept_volume_fraction"] < 1.0  # without its tails
    milled = as_json(["csd", "--rosin-rammler", "60,3", "--truncate-below-volume-fraction", "0"], capsys)
    assert milled["sum_x_over_d_1_m"] == pytest.approx(math.gamma(2 / 3) / 60e-6, rel=1e-12)
    assert milled["kept_volume_fraction"] == pytest.approx(1.0)
    assert main(["resistance", "--porosity", "0.4", "--density-kg-m3", "1180", "--rosin-rammler", "60,3"]) == 0
    assert "distribution: Rosin-Rammler by volume: d' 60 um" in capsys.readouterr().err


def test_an_estimate_of_a_cake(capsys: Capture) -> None:
    cake = [*PMMA, "--density-kg-m3", "1180", "--friction", "0.1", "--adhesion-mJ-m2", "10"]
    found = as_json(["predict", *cake], capsys)
    assert found == {**asdict(api.predict(api.distribution(mixture={20: 0.5, 50: 0.5}), **ESTIMATED)), **NO_DOUBTS}
    assert main(["predict", *cake]) == 0
    printed = capsys.readouterr()
    assert "mean of many packings" in printed.out and "compressibility n" in printed.out
    assert printed.err == ""


def test_an_estimate_outside_of_what_was_packed_says_so(capsys: Capture) -> None:
    assert main(["predict", *PMMA, "--density-kg-m3", "1180", "--friction", "2"]) == 0
    assert "warning: outside of what was packed, and so with a wider interval: friction is 2" in capsys.readouterr().err
    wide = ["--mixture", "1:0.3,1000:0.7", "--density-kg-m3", "1180"]
    assert "too far off for an estimate; use pack" in complaint(["predict", *wide], capsys)
    assert "--law = stokes: needs a packing" in complaint(["predict", *PMMA, "--law", "stokes"], capsys)


def test_how_a_file_was_read_is_said(capsys: Capture, tmp_path: Path) -> None:
    file = tmp_path / "x.csv"
    file.write_text("size_um;volume_percent\n20-30;40\n30-50;60\n")
    said = "class edges, geometric middles; % by volume; semicolons; 2 classes"
    assert as_json(["csd", str(file)], capsys)["understood"] == said
    assert main(["csd", str(file)]) == 0
    assert capsys.readouterr().out.startswith(f"{file}: {said}\n")
    assert main(["resistance", "--porosity", "0.4", "--density-kg-m3", "1180", str(file)]) == 0
    assert capsys.readouterr().err == f"{file}: {said}\n"


def test_csd_in_words(capsys: Capture) -> None:
    assert main(["csd", *PMMA]) == 0
    printed = capsys.readouterr().out
    assert "Sauter mean diameter" in printed
    assert "28.57 um" in printed


def test_resistance_of_the_papers_table_4(capsys: Capture) -> None:
    cake = ["--porosity", "0.359", "--density-kg-m3", "1180", *PMMA]
    found = as_json(["resistance", "--law", "additive", *cake], capsys)
    assert found["resistance_m_kg"] == found["resistance_additive_m_kg"] == pytest.approx(3.06e9, rel=2e-3)
    assert found["resistance_sauter_m_kg"] == pytest.approx(3.06e9 / 1.18, rel=5e-3)
    assert found["change_per_0p01_porosity"] == pytest.approx(-0.099, abs=1e-3)


def test_resistance_takes_the_density_of_the_kinetics(capsys: Capture) -> None:
    found = as_json(["resistance", "--porosity", "0.293", *ALUM], capsys)
    assert found["resistance_additive_m_kg"] == pytest.approx(1.009e8, rel=5e-3)
    assert found["resistance_m_kg"] == found["resistance_carman_m_kg"]


CAKE = ["resistance", "--porosity", "0.36", "--density-kg-m3", "1180", *PMMA]
SAUTER = 35_000.0**2 * 0.64 / (0.36**3 * 1180.0)
"""Flow and sizes of that cake by hand: a resistance over its constant, m/kg."""


def test_carman_is_the_law_that_is_not_asked_for(capsys: Capture) -> None:
    found = as_json(CAKE, capsys)
    assert (found["resistance_law"], found["resistance_ci95_m_kg"]) == ("carman", None)
    assert found["resistance_m_kg"] == pytest.approx(CARMAN_CONSTANT * SAUTER)
    assert found["resistance_law_ci95_m_kg"] == pytest.approx(CARMAN_CONSTANT_CI95 * SAUTER)
    assert main(CAKE) == 0
    printed = capsys.readouterr().out
    assert re.search(r"resistance, carman +2.421e\+09 m/kg\nuncertainty of the law +1.424e\+08 m/kg \(95 %", printed)
    assert "resistance, additive" in printed and "+-" not in printed


def test_the_interval_of_a_porosity_goes_into_the_resistance(capsys: Capture) -> None:
    found = as_json([*CAKE, "--porosity-ci95", "0.002"], capsys)
    relative = found["resistance_ci95_m_kg"] / found["resistance_m_kg"]
    assert relative == pytest.approx(0.2 * abs(found["change_per_0p01_porosity"]))
    assert main([*CAKE, "--porosity-ci95", "0.002"]) == 0
    assert "2.421e+09 +- 4.791e+07 m/kg (95 %)" in capsys.readouterr().out


def test_a_solved_constant_gives_the_resistance_of_the_packing(capsys: Capture) -> None:
    stokes = [*CAKE, "--law", "stokes", "--kozeny-constant", "168"]
    found = as_json(stokes, capsys)
    assert found["resistance_m_kg"] == pytest.approx(168.0 * SAUTER) and found["resistance_law_ci95_m_kg"] is None
    assert main(stokes) == 0
    assert re.search(r"uncertainty of the law +- m/kg", capsys.readouterr().out)
    known = as_json([*stokes, "--kozeny-constant-ci95", "3"], capsys)
    assert known["resistance_law_ci95_m_kg"] == pytest.approx(3.0 * SAUTER)


def test_laws_are_listed(capsys: Capture) -> None:
    listed = as_json(["resistance", "--list-laws"], capsys)["laws"]
    assert [law["name"] for law in listed] == list(RESISTANCE_LAWS)
    assert main(["resistance", "--list-laws"]) == 0
    printed = capsys.readouterr().out
    assert all(str(text) in printed for law in listed for text in law.values())


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--law", "carmen"], "--law = carmen: allowed: 'additive', 'carman', 'stokes'; did you mean carman?"),
        (["--law", "stokes"], "--kozeny-constant: must be given with the law stokes"),
        (["--kozeny-constant", "160"], "--kozeny-constant = 160: goes with the law stokes, not carman"),
        (["--kozeny-constant-ci95", "3"], "--kozeny-constant-ci95 = 3: goes with the law stokes, not carman"),
    ],
)
def test_a_law_is_asked_for_as_it_must_be(more: list[str], said: str, capsys: Capture) -> None:
    assert said in complaint([*CAKE, *more], capsys)


def test_packings_know_no_flow(capsys: Capture, tmp_path: Path) -> None:
    words = ["pack", *BED, "--law", "stokes", "--output", str(tmp_path / "bed")]
    assert "--law = stokes: needs the flow solved in the packings" in complaint(words, capsys)


def test_a_law_decides_nothing_of_the_packings(packed: Path, capsys: Capture) -> None:
    before = {path.name: path.read_bytes() for path in packed.glob("r*.npz")}
    words = ["pack", *BED, "--replicates", "2", "--output", str(packed)]
    carman, additive = as_json(words, capsys), as_json([*words, "--law", "additive"], capsys)
    assert {path.name: path.read_bytes() for path in packed.glob("r*.npz")} == before
    for found, law in ((carman, "carman"), (additive, "additive")):
        assert found["resistance_law"] == law
        assert found["resistance_m_kg"] == found[f"resistance_{law}_m_kg"]
        assert found["resistance_ci95_m_kg"] == found[f"resistance_{law}_ci95_m_kg"]
    relative = carman["resistance_law_ci95_m_kg"] / carman["resistance_m_kg"]
    assert relative == pytest.approx(CARMAN_CONSTANT_CI95 / CARMAN_CONSTANT)


BATCH = [
    *["filter-batch", "--resistance-m-kg", "1e10", "--porosity", "0.4", "--density-kg-m3", "1500"],
    *["--slurry-concentration-kg-m3", "100", "--pressure-drop-kPa", "200", "--medium-resistance-1-m", "1e10"],
    *["--turnaround-time-min", "20"],
]
CAKE_OF_50_UM = [
    *["deliquor", "--resistance-m-kg", "1e9", "--porosity", "0.4", "--density-kg-m3", "1300", "--sauter-mean-um", "50"],
    *["--cake-height-mm", "20"],
]


def test_filter_area_on_the_filtrate_basis_and_with_safety(capsys: Capture) -> None:
    alum = ["--porosity", "0.293", "--density-kg-m3", "2450", "--resistance-m-kg", "1.009e8"]
    alum += ["--slurry-flow-m3-h", "20"]
    slurry = as_json(["filter-area", *alum, *DRUM], capsys)
    filtrate = as_json(["filter-area", *alum, *DRUM, "--filtrate-basis", "--resistance-ci95-m-kg", "2e7"], capsys)
    assert slurry["filter_area_m2"] / filtrate["filter_area_m2"] == pytest.approx(1.085, abs=5e-4)
    assert slurry["filter_area_upper_m2"] is None and slurry["safety"] == ""
    assert filtrate["filter_area_upper_m2"] == pytest.approx(3.372, abs=1e-3)
    assert filtrate["filter_area_paper_factor_m2"] == pytest.approx(4.073, abs=1e-3)
    assert main(["filter-area", *alum, *DRUM, "--resistance-ci95-m-kg", "2e8"]) == 0
    printed = capsys.readouterr()
    assert "area, paper's factor 2" in printed.out
    assert "ends at 2.98 times the resistance found, beyond the paper's factor of 2" in printed.err


def test_filter_area_warns_of_a_slow_slurry(capsys: Capture) -> None:
    slow = ["--porosity", "0.4", "--density-kg-m3", "1500", "--slurry-flow-m3-h", "1", "--resistance-m-kg", "1e14"]
    assert main(["filter-area", *slow, *DRUM]) == 0
    assert "warning: 3 mm of cake take " in capsys.readouterr().err


def test_filter_batch(capsys: Capture) -> None:
    found = as_json([*BATCH, "--slurry-flow-m3-h", "1"], capsys)
    back = as_json([*BATCH, "--filter-area-m2", str(found["filter_area_m2"])], capsys)
    assert back["slurry_flow_m3_h"] == pytest.approx(1.0)
    assert found["cake_height_mm"] == found["best_height_mm"]
    assert main([*BATCH, "--slurry-flow-m3-h", "1", "--cake-height-mm", "50", "--height-limit-mm", "40"]) == 0
    printed = capsys.readouterr()
    assert re.search(r"cake height +50 mm\nbest cake height +40 mm", printed.out)
    assert printed.err == "warning: the cake is higher than --height-limit-mm\n"


def test_deliquor_and_its_inverse(capsys: Capture) -> None:
    found = as_json([*CAKE_OF_50_UM, "--pressure-drop-kPa", "50", "--moisture", "0.15"], capsys)
    back = as_json([*CAKE_OF_50_UM, "--pressure-drop-kPa", "50", "--time-min", str(found["time_min"])], capsys)
    assert back["moisture"] == pytest.approx(0.15)
    assert main([*CAKE_OF_50_UM, "--pressure-drop-kPa", "50", "--time-min", "1e6"]) == 0
    printed = capsys.readouterr()
    assert "within the correlation's error" in printed.out
    assert printed.err == "warning: the time is outside of the correlation's range\n"


def test_a_crystallizers_product_goes_on_as_a_file(capsys: Capture, tmp_path: Path) -> None:
    table = str(tmp_path / "product.csv")
    fines = ["--fines-ratio", "5", "--fines-size-um", "50"]
    found = as_json(["crystallizer", *ALUM, *fines, "--output", table], capsys)
    again = as_json(["csd", table], capsys)
    assert again["sauter_mean_um"] == pytest.approx(found["sauter_mean_um"], rel=0.01)
    assert found["sauter_mean_um"] > as_json(["crystallizer", *ALUM], capsys)["sauter_mean_um"]
    stages = ["--residence-time-min", "5,10", "--slurry-concentration-kg-m3", "100,200"]
    assert main(["crystallizer", "--kinetics", "ammonium_alum", *stages]) == 0
    printed = capsys.readouterr()
    assert "growth rate, stage 2" in printed.out
    assert printed.err == (
        "warning: --residence-time-min = 5, 10: the kinetics ammonium_alum are meant for 15 to 60 min\n"
    )


def test_costs_stand_side_by_side(capsys: Capture) -> None:
    drum = ["cost", "--equipment", "drum_filter", "--cost-index", "800", "--filter-area-m2"]
    turton, seider = as_json([*drum, "3.44"], capsys)["costs"]  # type: ignore[misc]
    assert (turton["correlation"], seider["correlation"]) == ("drum_filter_turton", "drum_filter_seider")
    assert turton["purchase"] == pytest.approx(seider["purchase"], rel=0.02)
    assert main([*drum, "100", "--currency-per-usd", "0.9"]) == 0
    printed = capsys.readouterr()
    assert re.search(r"drum filter, Turton: bare module +\d+ thousand\n", printed.out)
    assert "warning: drum_filter_seider: outside of its range, 0.929 to 74.32 m2" in printed.err
    forced = ["--equipment", "forced_circulation_crystallizer", "--crystals-kg-s", "1"]
    assert main(["cost", *forced, "--cost-index", "525"]) == 0
    assert "source states no range" in capsys.readouterr().err


def test_filter_area_and_its_inverse(capsys: Capture) -> None:
    area = as_json(["filter-area", "--resistance-m-kg", "1.009e8", "--slurry-flow-m3-h", "20", *DRUM], capsys)
    assert area["filter_area_m2"] == pytest.approx(3.44, abs=5e-3)
    assert area["medium_share"] == pytest.approx(0.51, abs=5e-3)
    there = ["--filter-area-m2", str(area["filter_area_m2"])]
    back = as_json(["filter-area", "--resistance-m-kg", "1.009e8", *there, *DRUM], capsys)
    assert back["slurry_flow_m3_h"] == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["csd"], "one of FILE, --mixture, --lognormal, --rosin-rammler and --kinetics"),
        (["csd", "a.csv", *PMMA], "one of FILE, --mixture, --lognormal, --rosin-rammler and --kinetics"),
        (["csd", "no/such.csv"], "no/such.csv: cannot be read"),
        (["csd", "--mixture", "20"], "--mixture = 20: must be sizes"),
        (["csd", "--lognormal", "20,80"], "--lognormal = ['20', '80']: must be 3 numbers: d10_um, d50_um, d90_um"),
        (["csd", "--lognormal", "20,40,100"], "are not of a lognormal distribution: d50 is -11% off"),
        (["csd", "--rosin-rammler", "60,1.5"], "exponent = 1.5: must be above 2"),
        (["csd", "--rosin-rammler", "60,x"], "--rosin-rammler = x: must be a number"),
        (["csd", "--mixture", "20:0.5,50:0.2"], "sum to 0.7"),
        (["csd", "--mixture", "nan:1"], "--mixture = nan: must be"),
        (["csd", "--mixture", "1e-300:1"], "--mixture = 1e-300: must be greater than or equal to 0.001"),
        (["csd", *PMMA, "--bin-width-um", "3"], "--bin-width-um = 3: needs"),
        (["csd", "--kinetics", "alum", *ALUM[2:]], "--kinetics = alum: no such kinetics; allowed: ammonium_alum"),
        (["csd", *PMMA, "--truncat-below-um", "3"], "did you mean --truncate-below-um?"),
        (["csd", *PMMA, "--truncate-below-um", "60"], "truncation leaves no class"),
        (["csd", *PMMA, "--output", "/dev/null/x.csv"], "/dev/null"),
        (["resistance", "--porosity", "1.5", *PMMA], "--porosity = 1.5: must be less than or equal to 0.999"),
        (["resistance", "--porosity", "0.4", *PMMA], "--density-kg-m3: must be given"),
        (["resistance", *PMMA], "--porosity: must be given"),
        (
            ["resistance", *PMMA, "--porosity=1e-200", "--density-kg-m3=1"],
            "--porosity = 1e-200: must be greater than or equal to 0.001",
        ),
        (["filter-area", "--resistance-m-kg", "1e8", *DRUM], "one of --slurry-flow-m3-h and --filter-area-m2"),
        (["filter-area", "--resistance-m-kg", "x", *DRUM], "--resistance-m-kg = x: must be a number"),
        (
            ["filter-area", "--resistance-m-kg", "1e8", *DRUM, "--slurry-flow-m3-h", "1", "--filtrate-basis"],
            "--filtrate-basis needs porosity and --density-kg-m3",
        ),
        (
            ["filter-area", "--resistance-m-kg", "1e8", *DRUM, "--filter-area-m2", "1", "--resistance-ci95-m-kg", "1"],
            "--resistance-ci95-m-kg goes with --slurry-flow-m3-h",
        ),
        (BATCH, "one of --slurry-flow-m3-h and --filter-area-m2"),
        (
            [*BATCH, "--slurry-flow-m3-h", "1", "--turnaround-time-min", "0"],
            "--turnaround-time-min or --deliquoring-time-min must be above 0, or ever thinner cakes are better",
        ),
        ([*CAKE_OF_50_UM, "--pressure-drop-kPa", "50"], "exactly one of --time-min and moisture"),
        (
            [*CAKE_OF_50_UM, "--pressure-drop-kPa", "5", "--time-min", "1"],
            "--pressure-drop-kPa = 5: must be above 9.936 kPa, up to which no gas enters the pores",
        ),
        (
            [*CAKE_OF_50_UM, "--pressure-drop-kPa", "50", "--moisture", "0.05"],
            "--moisture = 0.05: must be above 0.08965, which no time of deliquoring undercuts",
        ),
        (["crystallizer", *ALUM, "--fines-ratio", "5"], "--fines-ratio above 1 and --fines-size-um go together"),
        (
            ["crystallizer", "--kinetics", "alum", *ALUM[2:]],
            "kinetics = 'alum': no such kinetics; allowed: ammonium_alum, potassium_nitrate",
        ),
        (
            ["crystallizer", *ALUM[:2], "--residence-time-min", "5,5", "--slurry-concentration-kg-m3", "200"],
            "2 residence times and 1 slurry concentrations",
        ),
        (["crystallizer", *ALUM, "--output", ""], "must be the name of a file"),
        (
            ["cost", "--equipment", "drum_filter", "--cost-index", "800"],
            "--filter-area-m2: must be given for a drum_filter",
        ),
        (
            ["cost", "--equipment", "drum_filter", "--cost-index", "800", "--crystals-kg-s", "3"],
            "--crystals-kg-s = 3: is no size of a drum_filter",
        ),
        (["cost", "--equipment", "drum", "--cost-index", "800"], "equipment = 'drum': allowed: drum_filter,"),
        (
            ["cost", "--equipment", "leaf_filter", "--cost-index", "800", "--filter-area-m2", "1e4"],
            "size = 10000 m2: leaf_filter_turton is of 0.6 to 235 m2",
        ),
        (["cost", "--equipment", "x", "--cost-index", "1", "--costs-file", "no/such.yaml"], "cannot be read"),
        (["porosity", "no/such.npz"], "cannot be read"),
        (["porosity"], "NPZ"),
        (["permeability"], "NPZ"),
        (["permeability", ""], "cannot be read"),
        (["permeability", "no/such.npz"], "no/such.npz: (file): cannot be read"),
        (
            ["permeability", "a.npz", "--accuracy", "0.001"],
            "--accuracy = 0.001: must be greater than or equal to 0.003",
        ),
        (["permeability", "a.npz", "--threads", "0"], "--threads = 0: must be greater than or equal to 1"),
        (["porosity", ""], "is not the name"),
        (["csd", *PMMA, "--output", ""], "must be the name of a file"),
        (["porosities"], "invalid choice"),
        ([], "COMMAND"),
    ],
)
def test_a_mistake_is_one_clear_line(arguments: list[str], said: str, capsys: Capture) -> None:
    assert said in complaint(arguments, capsys)


def test_help_lists_every_command(capsys: Capture) -> None:
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    assert all(f"\n    {command}" in printed for command in ALL_COMMANDS)
    assert "95 % intervals" in printed and "%%" not in printed


@pytest.mark.parametrize("command", ALL_COMMANDS)
def test_help_names_units_and_an_example(command: str, capsys: Capture) -> None:
    assert main([command, "--help"]) == 0
    printed = capsys.readouterr().out
    assert command not in COMMANDS or "um" in printed or "m3" in printed
    assert f"filtercake {command}" in printed.split("example:")[1]
    assert "%%" not in printed


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two tiny packings."""
    folder = tmp_path_factory.mktemp("packed") / "bed"
    assert main(["pack", *BED, "--replicates", "2", "--output", str(folder)]) == 0
    return folder


def test_one_packing_has_a_dash_for_an_interval(tmp_path: Path, capsys: Capture) -> None:
    assert main(["pack", *BED, "--replicates", "1", "--output", str(tmp_path / "bed")]) == 0
    printed = capsys.readouterr().out
    assert printed.count("+- -") == 2 and "nan" not in printed


def test_pack_prints_what_porosity_and_resistance_find_in_its_files(packed: Path, capsys: Capture) -> None:
    before = {path.name: path.read_bytes() for path in packed.glob("r*.npz")}
    found = as_json(["pack", *BED, "--replicates", "2", "--output", str(packed)], capsys)
    assert found["n"] == 2
    assert found["engine"] == "embedded"
    assert {path.name: path.read_bytes() for path in packed.glob("r*.npz")} == before
    measured = as_json(["porosity", *(str(packed / f"r{k}.npz") for k in (0, 1)), "--profile"], capsys)
    assert measured["porosity"] == pytest.approx(found["porosity"])
    assert measured["porosity_ci95"] == pytest.approx(found["porosity_ci95"])
    law = ["--density-kg-m3", "1180", *BED[:2]]
    alphas = []
    for item in measured["packings"]:  # type: ignore[attr-defined]
        filled = sum(1.0 - row["porosity"] for row in item["profile"])
        assert filled > 0.0
        alphas.append(as_json(["resistance", "--porosity", str(item["porosity"]), *law], capsys)["resistance_m_kg"])
    assert found["resistance_m_kg"] == pytest.approx(np.mean(alphas))
    assert json.loads((packed / "summary.json").read_text())["porosity"] == found["porosity"]


def test_packings_of_other_options_are_not_lost_unasked(packed: Path, tmp_path: Path, capsys: Capture) -> None:
    folder = tmp_path / "bed"
    shutil.copytree(packed, folder)
    (folder / "replicates.json").unlink()  # as after a run that was stopped
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    other = ["pack", *BED, "--friction", "0.1", "--replicates", "1", "--output", str(folder)]
    said = complaint(other, capsys)
    assert "bed" in said and "r0 of other options" in said and "replace" in said
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert main([*other, "--replace"]) == 0
    assert (folder / "r0.npz").read_bytes() != before["r0.npz"]


def test_a_template_is_a_study(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "mine.yaml"
    assert main(["template", "--output", str(file)]) == 0
    assert load_study(file).name == "mine"
    assert "mine.yaml" in complaint(["template", "--output", str(file)], capsys)


def test_a_problem_in_a_file_names_the_file(tmp_path: Path, capsys: Capture) -> None:
    study = tmp_path / "no such study.yaml"
    assert f"{study}: (file): cannot be read" in complaint(["estimate", str(study)], capsys)
    study.write_text("material: {density_kg_m3: 1180, poisson_ratio: 7}\n")
    assert f"{study}: material.poisson_ratio = 7: must be" in complaint(["estimate", str(study)], capsys)


def test_the_profile_adds_up_to_the_spheres(packed: Path) -> None:
    rows = api.profile(packed / "r0.npz")
    packing, _ = load_packing(packed / "r0.npz")
    step = 1e-6 * (rows["height_um"][1] - rows["height_um"][0])
    solids = float((1.0 - rows["porosity"]).sum()) * step * packing.length**2
    assert solids == pytest.approx(4.0 / 3.0 * np.pi * float((packing.radius**3).sum()))


def test_porosity_in_words(packed: Path, capsys: Capture) -> None:
    assert main(["porosity", str(packed / "r0.npz"), "--profile"]) == 0
    printed = capsys.readouterr().out
    assert "porosity, interior" in printed
    assert "height, um" in printed


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        (["--particles", "10"], "--particles = 10: must be greater than or equal to 50"),
        (["--protocol", "gravity", "--cohesion-kJ-m3", "500"], "--cohesion-kJ-m3 = 500: must be at most"),
        (["--cohesion-kJ-m3", "500"], "--cohesion-kJ-m3 = 500: holds 23.8 kPa; must hold at most 15.6 kPa"),
        (
            ["--pressure-kPa", "900"],
            "--pressure-kPa = 900: must be at most 469 kPa at E = 3 GPa (--youngs-modulus-GPa)",
        ),
        (["--protocol", "gravity", "--time-step-us", "5"], "--time-step-us = 5: must be below the Rayleigh time step"),
        (["--time-step-us", "5"], "--time-step-us = 5: must be at most 0.5 of the Rayleigh time step"),
        (["--engine", "magic"], "--engine = magic: allowed:"),
        (["--replicates", "2.5"], "--replicates = 2.5: must be a whole number"),
        (["--output", "{other}"], "must be new, empty, or a folder of packings; it holds mine.txt"),
        (["--output", "{other}/mine.txt"], "mine.txt"),
    ],
)
def test_pack_refuses_in_one_line(extra: list[str], said: str, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "mine.txt").touch()
    extra = [word.format(other=tmp_path) for word in extra]
    assert said in complaint(["pack", *BED, *extra], capsys)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_bed_that_fails_has_a_reason_and_status_1(tmp_path: Path, capsys: Capture) -> None:
    few = ["pack", "--mixture", "30:0.5,50:0.5", "--density-kg-m3", "1180", "--particles", "200"]
    few += ["--protocol", "gravity", "--friction", "0.3", "--cohesion-kJ-m3", "0", "--max-fall-times", "1"]
    assert main([*few, "--engine", "embedded", "--replicates", "1", "--output", str(tmp_path / "x"), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["n"], found["n_failed"], found["porosity"]) == (0, 1, None)
    assert "r0: " in found["failures"][0]


def test_version(capsys: Capture) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("filtercake ")


def test_units_are_accepted_in_small_letters(capsys: Capture) -> None:
    small = [word.lower() if word.startswith("--") else word for word in DRUM]
    assert as_json(["filter-area", "--resistance-m-kg", "1e8", "--slurry-flow-m3-h", "20", *small], capsys)


def test_a_bug_is_one_line_and_its_traceback_is_for_the_asking(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def broken(**_: object) -> None:
        raise RuntimeError("two\nlines")

    monkeypatch.setattr(api, "distribution", broken)
    assert main(["csd", *PMMA]) == 1
    assert "unexpected RuntimeError: two lines" in capsys.readouterr().err
    monkeypatch.setenv(cli.TRACEBACK_VARIABLE, "1")
    with pytest.raises(RuntimeError):
        main(["csd", *PMMA])


def test_the_api_names_every_problem_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        api.filter_area(resistance_m_kg=-1, pressure_drop_kPa=50)
    assert {"resistance_m_kg", "submerged_fraction"} <= {problem.key for problem in caught.value.problems}


def test_a_file_that_is_no_packing_is_refused(tmp_path: Path) -> None:
    npz = tmp_path / "r0.npz"
    npz.write_bytes(b"nothing")
    with pytest.raises(PackingRejected, match="cannot be read"):
        api.porosity(npz)
    npz.with_suffix(".json").write_text('{"sha256": 3}', encoding="utf-8")
    with pytest.raises(PackingRejected, match="checksum"):
        api.porosity(npz)


PARSERS = build_parser()._subparsers._group_actions[0].choices  # type: ignore[union-attr]
OPTIONS = {
    command: sorted(
        name
        for action in PARSERS[command]._actions  # type: ignore[index, call-overload]
        for name in action.option_strings
        if action.dest not in ("output", "help")
    )
    for command in COMMANDS
}
NUMBERS = st.floats(allow_nan=True, allow_infinity=True).map(repr) | st.integers().map(str)
WORDS = st.text(st.characters(exclude_characters="\0"), max_size=8) | NUMBERS
PAIRS = st.lists(st.tuples(NUMBERS, NUMBERS).map(":".join), max_size=3).map(",".join)
GOOD = st.sampled_from(["0.3", "20:0.5,50:0.5", "1e8", "15", "200", "ammonium_alum", "5", "1180", "53.3"])


def arguments_of(command: str) -> st.SearchStrategy[list[str]]:
    """Options of a command, mostly its own, with values good and bad."""
    option = st.sampled_from(OPTIONS[command]) | st.sampled_from(sorted({*chain(*OPTIONS.values())}))
    pair = st.tuples(option, GOOD | WORDS | PAIRS).map("=".join) | st.sampled_from(["--json", "--profile"])
    return st.lists(pair, max_size=8).map(lambda words: [command, *words])


ARGUMENTS = st.sampled_from(COMMANDS).flatmap(arguments_of)


@pytest.fixture(scope="module")
def no_settling(packed: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Let ``pack`` take packings that are there, whatever is asked for; gives a folder to write to."""
    shelf = tmp_path_factory.mktemp("shelf")

    def take(point: object, folder: Path, say: object) -> list[Outcome]:
        shutil.copytree(packed, folder, dirs_exist_ok=True)
        return [Outcome(k, "ok", "", 1, "", 1) for k in (0, 1)]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(importlib.import_module("filtercake.api.packings"), "_make", take)
        patch.chdir(shelf)
        yield shelf


@given(arguments=ARGUMENTS, more=st.lists(WORDS, max_size=2))
def test_no_argument_makes_it_fall_over(no_settling: Path, arguments: list[str], more: list[str]) -> None:
    assert main([*arguments, *more]) in (0, 2)


@given(option=st.sampled_from(OPTIONS["pack"]), value=GOOD | WORDS)
def test_no_option_of_pack_makes_it_fall_over(no_settling: Path, option: str, value: str) -> None:
    assert main(["pack", *BED, option if option in ("--json", "--write-vtk") else f"{option}={value}"]) in (0, 2)


@given(
    values=st.lists(st.tuples(st.floats(), st.floats()), min_size=1, max_size=4),
    cut=st.floats(),
    below=st.floats(),
)
def test_no_mixture_makes_it_fall_over(values: list[tuple[float, float]], cut: float, below: float) -> None:
    mixture = ",".join(f"{size!r}:{share!r}" for size, share in values)
    cuts = [f"--truncate-below-volume-fraction={cut!r}", f"--truncate-below-um={below!r}"]
    for extra in ([], cuts):
        assert main(["csd", "--json", f"--mixture={mixture}", *extra]) in (0, 2)


@given(
    size=st.floats(min_value=1e-320, max_value=1e5),
    share=st.floats(min_value=0.0, max_value=1.0),
    other=st.floats(min_value=1e-12, max_value=1e5),
    porosity=st.floats(min_value=0.0, max_value=1.0),
    density=st.floats(min_value=1e-320, max_value=25_000),
)
def test_no_numbers_within_their_ranges_make_it_fall_over(
    size: float, share: float, other: float, porosity: float, density: float
) -> None:
    mixture = f"--mixture={size!r}:{share!r},{other!r}:{1.0 - share!r}"
    cake = [f"--porosity={porosity!r}", f"--density-kg-m3={density!r}"]
    assert main(["resistance", "--json", mixture, *cake]) in (0, 2)


@given(
    values=st.lists(st.floats(min_value=0.0, max_value=1e7), min_size=7, max_size=7),
    inverse=st.booleans(),
)
def test_no_filter_makes_it_fall_over(values: list[float], inverse: bool) -> None:
    names = [name for name in DRUM if name.startswith("--")]
    names += ["--resistance-m-kg", "--filter-area-m2" if inverse else "--slurry-flow-m3-h"]
    assert main(["filter-area", *(f"{name}={value!r}" for name, value in zip(names, values, strict=True))]) in (0, 2)


@given(
    width=st.floats(min_value=1e-9, max_value=1000),
    time=st.floats(min_value=1e-9, max_value=1e5),
    slurry=st.floats(min_value=1e-9, max_value=2000),
)
def test_no_crystallizer_makes_it_fall_over(width: float, time: float, slurry: float) -> None:
    values = [f"--bin-width-um={width!r}", f"--residence-time-min={time!r}", f"--slurry-concentration-kg-m3={slurry!r}"]
    assert main(["csd", "--json", "--kinetics", "potassium_nitrate", *values]) in (0, 2)


LEAF_TESTS = Path(__file__).resolve().parents[2] / "data" / "leaf_tests"
CONDITIONS = [
    *["--area-cm2", "50", "--pressure-drop-kPa", "70", "--viscosity-mPa-s", "1"],
    *["--solids-per-filtrate-kg-m3", "100"],
]


def test_a_filtration_test(capsys: Capture) -> None:
    found = as_json(["test", str(LEAF_TESTS / "short_tail.csv"), *CONDITIONS], capsys)
    (test,) = found["tests"]  # type: ignore[misc]
    assert test["resistance_m_kg"] == pytest.approx(3.5e9) and test["medium_resistance_1_m"] == pytest.approx(1.75e10)
    assert (test["readings"], test["readings_left_out"], test["time_zero_s"]) == (13, 3, 0.0)
    assert main(["test", str(LEAF_TESTS / "short_tail.csv"), *CONDITIONS]) == 0
    out = capsys.readouterr().out
    assert "short_tail (10 of 13 readings, integral form)" in out and "3.5e+09 +- " in out and "m/kg (95 %)" in out
    assert "- end of the test: lines 12 to 14 left out" in out


def test_filtration_tests_of_a_file_of_measurements(capsys: Capture) -> None:
    path = "config/measurements/synthetic_tests.yaml"
    found = as_json(["test", str(LEAF_TESTS.parents[2] / path)], capsys)
    assert found["tests"][0]["name"] == "synthetic_25kPa"  # type: ignore[index]
    text = complaint(["test", path, "--area-cm2", "3"], capsys)
    assert f"--area-cm2: goes with a CSV; {path} says it itself" in text


def test_what_is_wrong_with_a_filtration_test_is_said(capsys: Capture) -> None:
    balance = ["test", str(LEAF_TESTS / "balance.csv"), *CONDITIONS]
    assert "holds masses of filtrate: give --filtrate-density-kg-m3" in complaint(balance, capsys)
    found = as_json([*balance, "--filtrate-density-kg-m3", "789"], capsys)
    assert found["tests"][0]["resistance_m_kg"] == pytest.approx(3.5e9)  # type: ignore[index]
    assert "--area-cm2: must be given" in complaint(["test", str(LEAF_TESTS / "base.csv")], capsys)
    assert "cannot be read" in complaint(["test", "none.csv", *CONDITIONS], capsys)


def test_units_that_cannot_be(capsys: Capture) -> None:
    light = ["resistance", "--porosity", "0.36", "--density-kg-m3", "1.18", *PMMA]
    said = "--density-kg-m3 = 1.18: lighter than any solid (under 300 kg/m3): in g/cm3? (1180 kg/m3)"
    assert said in complaint(light, capsys)
    assert as_json([*light, "--trust-units"], capsys)["resistance_m_kg"] > 1e12  # type: ignore[operator]
    fine = ["resistance", "--porosity", "0.36", "--density-kg-m3", "1180", "--mixture", "0.02:0.5,0.05:0.5"]
    assert "0.02 to 0.05 um: no filter holds crystals so fine: were they in mm or cm?" in complaint(fine, capsys)
