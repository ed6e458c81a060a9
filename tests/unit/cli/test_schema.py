"""The generated files follow from the config model, and the studies shipped follow the schema."""

import difflib
import json
from pathlib import Path

import jsonschema
import pytest

from filtercake.calibration.config import load_calibration
from filtercake.cli.schema import ROOT, generated, write
from filtercake.study.loading import load_study, load_workflow, read_yaml

FOLDERS = ("studies", "benchmarks", "test")
STUDIES = [path for folder in FOLDERS for path in sorted((ROOT / "config" / folder).glob("*.yaml"))]
STUDIES.append(ROOT / "config" / "template.yaml")
CALIBRATIONS = sorted((ROOT / "config" / "calibrations").glob("*.yaml"))


@pytest.mark.parametrize("path", generated(), ids=str)
def test_generated_files_are_in_step_with_the_model(path):
    expected, found = generated()[path], (ROOT / path).read_text(encoding="utf-8")
    diff = "".join(difflib.unified_diff(found.splitlines(True), expected.splitlines(True), "on disk", "from the model"))
    assert not diff, f"run `make schemas`:\n{diff}"


def test_write_makes_every_file(tmp_path):
    write(tmp_path)
    assert {path.relative_to(tmp_path) for path in tmp_path.rglob("*.*")} == set(generated())


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.name)
def test_shipped_studies_follow_schema_and_model(path):
    schema = json.loads((ROOT / "workflow/schemas/study.schema.json").read_text())
    jsonschema.validate(read_yaml(path), schema)
    study = load_study(path)
    assert study.model.sweeps and study.csds


@pytest.mark.parametrize("path", CALIBRATIONS, ids=lambda path: path.name)
def test_shipped_calibrations_follow_schema_and_model(path):
    calibration = load_calibration(path, ROOT / "config" / "studies")
    for name, file in (("calibration", path), ("measurements", calibration.measurements.files[0])):
        schema = json.loads((ROOT / f"workflow/schemas/{name}.schema.json").read_text())
        jsonschema.validate(read_yaml(file), schema)
    assert calibration.measured and calibration.frictions


def test_the_schema_refuses_what_the_model_refuses():
    schema = json.loads((ROOT / "workflow/schemas/study.schema.json").read_text())
    study = read_yaml(ROOT / "config/template.yaml")
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**study, "colour": "red"}, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**study, "material": {"density_kg_m3": -1}}, schema)


def test_the_workflow_configuration_is_valid():
    assert load_workflow(read_yaml(Path(ROOT / "config/config.yaml")), "config/config.yaml").studies == ["pmma"]
