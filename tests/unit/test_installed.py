"""The package as a wheel in an environment of its own: nothing of the checkout is left to it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from filtercake.study.loading import load_study

PROJECT = Path(__file__).resolve().parents[2]
PARTS = ("pyproject.toml", "README.md", "LICENSE", "src", "liggghts_templates")
pytestmark = pytest.mark.slow


def pip(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "pip", *words], check=True, capture_output=True)


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh environment with the wheel; what filtercake depends on is that of this one."""
    folder = tmp_path_factory.mktemp("a user's own")
    for part in PARTS:
        source, target = PROJECT / part, folder / "clone" / part
        if source.is_dir():
            unwanted = shutil.ignore_patterns("*.egg-info", "__pycache__")
            shutil.copytree(source, target, symlinks=True, ignore=unwanted)
        else:
            target.parent.mkdir(exist_ok=True)
            shutil.copy(source, target)
    pip("wheel", "--no-deps", "--no-build-isolation", "--no-index", "-w", str(folder), str(folder / "clone"))
    shutil.rmtree(folder / "clone")
    made = folder / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(made)], check=True)
    (wheel,) = folder.glob("*.whl")
    pip("--python", str(made / "bin" / "python"), "install", "--no-deps", "--no-index", str(wheel))
    (packages,) = made.glob("lib/python*/site-packages")
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return made


def filtercake(environment: Path, folder: Path, words: str) -> str:
    plain = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    plain["MPLBACKEND"] = "module://no.such.notebook"
    program = str(environment / "bin" / "filtercake")
    done = subprocess.run([program, *words.split()], cwd=folder, env=plain, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


BED = "--mixture 30:0.5,50:0.5 --density-kg-m3 1180 --particles 80 --replicates 1 --json"


def test_it_is_the_installed_one(environment: Path, tmp_path: Path) -> None:
    words = [str(environment / "bin" / "python"), "-c", "import filtercake; print(filtercake.__file__)"]
    plain = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(words, cwd=tmp_path, env=plain, capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()).is_relative_to(environment)


@pytest.mark.parametrize("engine", [pytest.param("liggghts", marks=pytest.mark.liggghts), "embedded"])
def test_it_packs(engine: str, environment: Path, tmp_path: Path) -> None:
    found = json.loads(filtercake(environment, tmp_path, f"pack {BED} --engine {engine}"))
    assert found["n"] == 1 and 0.3 < found["porosity"] < 0.6
    assert found["engine"] == engine


def test_it_estimates(environment: Path, tmp_path: Path) -> None:
    found = json.loads(filtercake(environment, tmp_path, "predict --mixture 20:0.5,50:0.5 --density-kg-m3 1180 --json"))
    assert 0.29 < found["porosity"] < 0.33 and found["packings"] > 100


def test_it_has_kinetics_and_a_template(environment: Path, tmp_path: Path) -> None:
    crystallizer = "--kinetics ammonium_alum --residence-time-min 15 --slurry-concentration-kg-m3 200"
    assert json.loads(filtercake(environment, tmp_path, f"csd {crystallizer} --json"))["packed_classes"] > 10
    filtercake(environment, tmp_path, "template --output mine.yaml")
    assert load_study(tmp_path / "mine.yaml").name == "mine"
