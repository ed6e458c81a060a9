"""The workflow from another folder: with -s, with --directory, and as a module of another workflow."""

import os
import re
import shutil
import subprocess
import sys

import pandas as pd
import pytest
from checkouts import copy_project

STUDY = """\
csds:
  bimodal:
    mixture:
      - {size_um: 30, volume_fraction: 0.5}
      - {size_um: 50, volume_fraction: 0.5}
material: {density_kg_m3: 1180}
packing: {particles: 80, replicates: 2, engine: embedded}
sweeps:
  - csd: bimodal
"""
MODULE = """\
module filtercake:
    snakefile: {snakefile!r}
    config: config["filtercake"]

use rule * from filtercake as filtercake_*

rule mine:
    default_target: True
    input: "results/small/summary.csv"
    output: "mine.csv"
    shell: "cp {{input}} {{output}}"
"""


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    return copy_project(tmp_path_factory.mktemp("elsewhere") / "project")


@pytest.fixture
def folder(tmp_path):
    """Somebody's folder with a study of their own."""
    made = tmp_path / "it's elsewhere"
    (made / "config" / "studies").mkdir(parents=True)
    (made / "config" / "studies" / "small.yaml").write_text(STUDY)
    return made


def snakemake(folder, checkout, *arguments):
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "--cores", "2", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(checkout.root / "src")},
        capture_output=True,
        text=True,
        timeout=600,
    )
    return done.returncode, done.stdout + done.stderr


def test_runs_a_study_of_the_folder_it_is_started_in(folder, checkout):
    (folder / "config" / "config.yaml").write_text("studies: [small]\n")
    code, said = snakemake(folder, checkout, "-s", str(checkout.root / "Snakefile"), "--", "results/small/summary.csv")
    assert code == 0, said
    assert pd.read_csv(folder / "results" / "small" / "summary.csv")["n"].tolist() == [2]


@pytest.mark.parametrize("snakefile", ["Snakefile", "workflow/Snakefile"])
def test_brings_its_own_configuration_to_an_empty_folder(tmp_path, checkout, snakefile):
    arguments = ["--directory", str(tmp_path), "--dry-run", "--quiet", "host", "--config", "studies=pmma"]
    code, said = snakemake("/", checkout, "-s", str(checkout.root / snakefile), *arguments)
    assert code == 0, said
    assert re.search("packing +2[47]\n", said) and re.search("all +1\n", said)


def test_is_a_module_of_another_workflow(folder, checkout):
    (folder / "Snakefile").write_text(MODULE.format(snakefile=str(checkout.root / "Snakefile")))
    # the other workflow's own configuration, with keys that this one does not know
    (folder / "config" / "config.yaml").write_text("theirs: 1\nfiltercake: {studies: [small]}\n")
    configured = ["--configfile", "config/config.yaml"]
    code, said = snakemake(folder, checkout, *configured)
    assert code == 0, said
    assert pd.read_csv(folder / "mine.csv")["n"].tolist() == [2]


def test_a_module_without_configuration_has_its_own(folder, checkout):
    shutil.copytree(checkout.root / "config" / "test", folder / "config" / "test")
    (folder / "config" / "config.yaml").write_text("theirs: 1\n")
    statement = f"module filtercake:\n    snakefile: {str(checkout.root / 'Snakefile')!r}\n"
    (folder / "Snakefile").write_text(statement + "use rule * from filtercake\n")
    configured = ["--config", "studies=config/studies/small.yaml", "calibrations=config/test/calibration/tiny.yaml"]
    code, said = snakemake(folder, checkout, "--dry-run", "--quiet", "host", *configured, "--", "calibrate", "all")
    assert code == 0, said
    assert "calibrate_cohesion " in said and "provenance " in said
