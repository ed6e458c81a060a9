"""Files and values that would hang, fill memory, run code or spoil a message: each is one clear error."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from filtercake.calibration.config import load_calibration
from filtercake.calibration.measurements import load_measurements, read_test
from filtercake.crystals.cells import LARGEST_FILE
from filtercake.crystals.crystallizer import load_kinetics
from filtercake.crystals.csd import read_csd
from filtercake.crystals.instruments import MOST_CLASSES
from filtercake.design.costs import load_correlations
from filtercake.errors import (
    MOST_SHOWN,
    ConfigError,
    CrystallizerError,
    CsdError,
    FiltercakeError,
    FiltrationError,
    Problem,
    shown,
)
from filtercake.study.config.study import MOST_DISTRIBUTIONS, Workflow
from filtercake.study.config.values import MOST_POINTS
from filtercake.study.loading import LoadedStudy, find_studies, load_study, load_workflow, parse
from filtercake.user_files import read_yaml

READERS: dict[str, Callable[[Path], Any]] = {
    "yaml": read_yaml,
    "kinetics": load_kinetics,
    "costs": load_correlations,
    "measurements": load_measurements,
    "csd": read_csd,
    "test": read_test,
}


@pytest.mark.parametrize("reader", READERS)
def test_devices_pipes_and_impossible_paths_are_refused_at_once(reader: str, tmp_path: Path) -> None:
    pipe, link, loop = (tmp_path / name for name in ("pipe", "link", "loop"))
    os.mkfifo(pipe)
    link.symlink_to("/dev/zero")
    loop.symlink_to(loop)
    impossible = (tmp_path, loop, tmp_path / ("x" * 300), tmp_path / "a\0b", tmp_path / "\ud800", tmp_path / "none")
    for path in (Path("/dev/zero"), pipe, link):
        with pytest.raises(FiltercakeError, match="must be a regular file, not a device or a pipe"):
            READERS[reader](path)
    for path in impossible:
        with pytest.raises(FiltercakeError, match="cannot be read"):
            READERS[reader](path)


@pytest.mark.parametrize(("reader", "limit"), [("yaml", "200 kB"), ("csd", "1 MB"), ("test", "10 MB")])
def test_huge_files_are_refused_before_they_are_read(reader: str, limit: str, tmp_path: Path) -> None:
    path = tmp_path / "huge"
    with path.open("wb") as stream:
        stream.truncate(10**12)
    with pytest.raises(FiltercakeError, match=f"must be at most {limit}"):
        READERS[reader](path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: &a [1]\nb: *a\n", "aliases"),
        ("a: {<<: {b: 1}}\n", "merge keys"),
        ("a: !!int ''\n", "tags"),
        ("a: !!bool x\n", "tags"),
        ("a: !!timestamp x\n", "tags"),
        ("? !!set {a}\n: 1\n", "tags"),
        ("a: ! x\n", "tags"),
        ("a: 1" + ":59" * 400 + ".5\n", "not valid YAML: "),
        ("a: " + "9" * 5000 + "\n", "not valid YAML: "),
        ("a: " + "[" * 5000 + "\n", "nested too deeply"),
    ],
)
def test_yaml_that_surprises_is_refused(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(text)
    for read, error in ((read_yaml, ConfigError), (load_kinetics, CrystallizerError)):
        with pytest.raises(error) as caught:
            read(path)
        assert said in str(caught.value) and str(path) in str(caught.value)


@pytest.mark.parametrize("value", ["0x" + "f" * 5000, "1e-300", "1e300", "'1_180'", "1e999", "5e-324", "9" * 400])
def test_absurd_numbers_are_refused(value: str, write_study: Callable[..., Path], good_study: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_study(write_study(good_study.replace("kg_m3: 1180", f"kg_m3: {value}")))
    assert "material.density_kg_m3" in str(caught.value) and len(str(caught.value)) < 400


def test_absurd_numbers_in_kinetics_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "k.yaml"
    path.write_text("mine: {shape_factor: 0x" + "f" * 5000 + "}\n")
    with pytest.raises(CrystallizerError, match=r"mine\.shape_factor = "):
        load_kinetics(path)


@pytest.mark.parametrize(
    ("label", "said"),
    [
        ('"=cmd|x"', "spreadsheets"),
        ('"@SUM(1)"', "spreadsheets"),
        ('"$x^$"', "must not hold \\$"),
        ('"\\e[31m"', "visible characters"),
        ('"\\ud800"', "visible characters"),
        ('"a\\u202eb"', "visible characters"),
        ('"a\\nb"', "one line"),
    ],
)
def test_texts_that_tables_or_figures_would_obey_are_refused(
    label: str, said: str, study_from: Callable[..., LoadedStudy], good_study: str
) -> None:
    with pytest.raises(ConfigError, match=f"csds.bimodal.label.*{said}"):
        study_from(good_study.replace("label: half and half", f"label: {label}"))


def test_blanks_around_a_text_are_taken_away(study_from: Callable[..., LoadedStudy], good_study: str) -> None:
    study = study_from(good_study.replace("title: A study for tests", "title: >\n  A folded\n  title"))
    assert study.model.title == "A folded title"


@pytest.mark.parametrize("path", ["a{study}.csv", "a\x1bb.csv", " a.csv", "d/" + "x" * 256, "", "a" * 1001])
def test_paths_that_snakemake_would_take_for_more_are_refused(
    path: str, study_from: Callable[..., LoadedStudy], good_study: str
) -> None:
    with pytest.raises(ConfigError, match="results = "):
        parse(Workflow, {"results": path}, "config.yaml")
    with pytest.raises(ConfigError, match="studies"):
        load_workflow({"studies": [path]}, "config.yaml")


def test_an_impossible_study_path_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such study"):
        find_studies(Workflow(studies=["/".join(["x" * 200] * 4) + "/a.yaml"] * 1), tmp_path, "config.yaml")


@pytest.mark.parametrize("values", [None, [], "x", 5])
def test_a_configuration_that_is_no_mapping_is_refused(values: Any) -> None:
    with pytest.raises(ConfigError, match="must be a mapping"):
        load_workflow(values, "config.yaml")


def test_too_many_points_or_distributions_are_refused(study_from: Callable[..., LoadedStudy], good_study: str) -> None:
    values = [k / 1000 for k in range(1000)]
    with pytest.raises(ConfigError, match=f"sweeps = 1000000 points: must be at most {MOST_POINTS}"):
        study_from(good_study + f"    friction: {values}\n    poisson_ratio: {[v / 3 for v in values]}\n")
    many = good_study + "".join(f"  - csd: [{', '.join(f'a{k}' for k in range(1000))}]\n" for _ in range(9))
    with pytest.raises(ConfigError, match="and 8980 more problems"):
        study_from(many)
    csds = "".join(f"  c{k}: {{mixture: [{{size_um: 1, volume_fraction: 1}}]}}\n" for k in range(MOST_DISTRIBUTIONS))
    with pytest.raises(ConfigError, match="csds"):
        study_from(good_study.replace("csds:\n", "csds:\n" + csds))


def test_a_distribution_too_broad_for_any_bed_is_refused(
    study_from: Callable[..., LoadedStudy], good_study: str
) -> None:
    broad = good_study.replace("size_um: 50", "size_um: 50000").replace(
        "material:", "material:\n  trust_units: true", 1
    )
    with pytest.raises(ConfigError, match=r"csds.bimodal.mixture = 2 classes: needs .* spheres"):
        study_from(broad)
    with pytest.raises(ConfigError, match=r"packing.particles = 5000: a bed .* \(csds.bimodal.mixture = 2 classes\)"):
        study_from(broad.replace("sweeps:", "packing: {particles: 5000}\nsweeps:"))


def test_a_uselessly_short_time_step_is_refused(study_from: Callable[..., LoadedStudy], good_study: str) -> None:
    with pytest.raises(ConfigError, match=r"packing\.time_step_us = 1e-06: must be at least 0\.001 of the Rayleigh"):
        study_from(good_study + "packing: {time_step_us: 1.0e-6}\n")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("size_um,volume_fraction\n1e-7,1\n", "sizes must be 0.001 to"),
        ("size_um,volume_fraction\n1e300,1\n", "sizes must be"),
        ("size_um,volume_fraction\n2_0,1\n", "line 2: '2_0' is not a number"),
        ("size_um,volume_fraction\n=cmd|' /C calc'!A0,1\n", "line 2: .* is not a number"),
        ("x" * 100_000 + ",volume_fraction\n1,1\n", "header .*\\.\\.\\."),
        ("size_um,volume_fraction\n" + "1,1\n" * (MOST_CLASSES + 1), f"{MOST_CLASSES + 1} classes"),
        ("1" * (LARGEST_FILE + 1), "at most 1 MB"),
    ],
)
def test_hostile_distributions_are_refused(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(CsdError, match=said) as caught:
        read_csd(path)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32", "latin-1"])
def test_other_encodings_are_refused(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes("size_um,volume_fraction\n20,1 # é\n".encode(encoding))
    for read, error in ((read_csd, CsdError), (read_test, FiltrationError), (read_yaml, ConfigError)):
        with pytest.raises(error, match=r"must be UTF-8|not valid YAML|is not|names|binary"):
            read(path)


def test_a_missing_file_of_measurements_names_the_calibration_and_its_key(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(
        "csds: {a: {mixture: [{size_um: 20, volume_fraction: 1}]}}\n"
        "material: {density_kg_m3: 1000}\nsweeps: [{csd: a}]\n"
    )
    path = tmp_path / "calibration.yaml"
    path.write_text("study: study.yaml\nmeasurements: none.yaml\n")
    with pytest.raises(ConfigError, match=r"calibration\.yaml: measurements = 'none\.yaml': no such file"):
        load_calibration(path, tmp_path)


def test_messages_stay_short_and_harmless() -> None:
    assert len(shown("x" * 10**6)) <= 60 and len(shown([[["y"] * 100] * 100] * 100)) <= 60
    assert "digits" in shown(16**5000)
    problems = [Problem("f\x1b[31m.yaml", f"k{k}", "1", "must be 2") for k in range(100)]
    text = str(ConfigError(problems))
    assert "\x1b" not in text and "\\x1b[31m" in text
    assert text.count("\n") == MOST_SHOWN and text.endswith("... and 80 more problems")
