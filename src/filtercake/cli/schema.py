"""Everything generated from the config model: JSON schemas, the study template and the reference of keys.

``python -m filtercake.cli.schema`` rewrites the files; a test fails when they no longer follow from the model.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from filtercake.calibration.config import AdhesionRange, Calibration, CohesionRange
from filtercake.calibration.measurements import ConstantPressureTest, KnownResistance, MeasurementFile
from filtercake.cli.fields import allowed, meaning
from filtercake.filtration.resistance import CARMAN
from filtercake.packing.scene import FILTRATION_PROTOCOL
from filtercake.study.config.cross_check import CrossCheck
from filtercake.study.config.crystals import Crystallizer, Csd, Lognormal, RosinRammler, SizeClass
from filtercake.study.config.design import Constraints, Costs, Design, Variables
from filtercake.study.config.filter import Filter
from filtercake.study.config.material import Material
from filtercake.study.config.packing import Packing
from filtercake.study.config.permeability import Permeability
from filtercake.study.config.published import Published
from filtercake.study.config.study import Study, Workflow
from filtercake.study.config.sweep import Sweep

EXAMPLES = {
    "resistance_law": CARMAN,
    "kinetics": "ammonium_alum",
    "slurry_concentration_kg_m3": "200",
    "pressure_drop_kPa": "53.33",
    "submerged_fraction": "0.3",
    "rotation_rate_rpm": "0.2",
    "medium_resistance_1_m": "5.0e+9",
}
"""Values of the keys without a default, for the template, and of the law that a new study takes."""

DESIGN_PARTS: dict[str, type[BaseModel]] = {"variables": Variables, "constraints": Constraints, "costs": Costs}
"""Sections of the section ``design``."""
EXAMPLES_OF_DESIGNS = {
    "residence_time_min": "[15, 60]",
    "slurry_concentration_kg_m3": "[100, 300]",
    "pressure_drop_kPa": "[20, 80]",
    "submerged_fraction": "[0.2, 0.4]",
    "rotation_rate_rpm": "[0.1, 2]",
    "cake_thickness_mm": "[5, 50]",
}
"""Ranges, for the template."""

ROOT = Path(__file__).resolve().parents[3]

_INTRO = {
    "material": "The crystals, and the base value of every property a sweep may vary.",
    "packing": "How the packings are made.",
}


def generated() -> dict[Path, str]:
    """Contents of every generated file, by its path relative to the project's root."""
    return {
        Path("workflow/schemas/study.schema.json"): _schema(Study),
        Path("workflow/schemas/workflow.schema.json"): _schema(Workflow),
        Path("workflow/schemas/calibration.schema.json"): _schema(Calibration),
        Path("workflow/schemas/measurements.schema.json"): _schema(MeasurementFile),
        Path("config/template.yaml"): study_template(),
        Path("docs/config-reference.md"): reference(),
    }


def study_template() -> str:
    """Render a study with every key, its default and its description: the file to copy for a study of one's own."""
    lines = [
        "# yaml-language-server: $schema=../workflow/schemas/study.schema.json",
        "# Every key of a study. Copy to config/studies/<name>.yaml, keep what you need: the values of keys that",
        "# stand behind a # are the defaults. Generated from the config model.",
        "title: My study",
        "",
        "csds:",
        "  mine:",
        f"    # {meaning(Csd.model_fields['label'])}",
        "    # label: My crystals",
        f"    # {meaning(Csd.model_fields['mixture'])}",
        "    mixture:",
        "      - {size_um: 20, volume_fraction: 0.5}",
        "      - {size_um: 50, volume_fraction: 0.5}",
        f"    # or: {meaning(Csd.model_fields['file'])}",
        "    # file: ../csd/example.csv",
        f"    # or: {meaning(Csd.model_fields['lognormal'])}",
        "    # lognormal: {d10_um: 20, d50_um: 40, d90_um: 80}",
        f"    # or: {meaning(Csd.model_fields['rosin_rammler'])}",
        "    # rosin_rammler: {size_um: 60, exponent: 3}",
        f"    # {meaning(Csd.model_fields['truncate_below_volume_fraction'])}",
        "    # truncate_below_volume_fraction: 0.001",
        f"    # {meaning(Csd.model_fields['truncate_below_um'])}",
        "    # truncate_below_um: 25",
        f"    # {meaning(Csd.model_fields['truncate_above_um'])}",
        "    # truncate_above_um: 500",
    ]
    for part, optional in (("crystallizer", Crystallizer), ("filter", Filter), ("permeability", Permeability)):
        lines += ["", f"# {meaning(Study.model_fields[part])}", f"# {part}:"]
        for key, field in optional.model_fields.items():
            lines.append(f"  # {meaning(field)} Allowed: {allowed(field)}.")
            lines.append(f"  # {key}: {EXAMPLES.get(key) or _yaml(field.get_default())}")
    for name, model, given in (
        ("material", Material, {"density_kg_m3": "1180", "adhesion_mJ_m2": "0"}),
        ("packing", Packing, {"protocol": FILTRATION_PROTOCOL, "pressure_kPa": "50"}),
    ):
        lines += ["", f"# {_INTRO[name]}", f"{name}:" if given else f"# {name}:"]
        for key, field in model.model_fields.items():
            lines.append(f"  # {meaning(field)} Allowed: {allowed(field)}.")
            default = _yaml(field.get_default(call_default_factory=True))
            lines.append(f"  {key}: {given[key]}" if key in given else f"  # {key}: {default}")
        if name == "material":
            law = Study.model_fields["resistance_law"]
            lines += ["", f"# {meaning(law)} Allowed: {allowed(law)}.", f"resistance_law: {EXAMPLES['resistance_law']}"]
    lines += ["", f"# {meaning(Study.model_fields['sweeps'])}", "sweeps:", "  - csd: [mine]"]
    for key, field in Sweep.model_fields.items():
        if key != "csd":
            lines.append(f"    # {meaning(field)}")
            lines.append(f"    # {key}: {'8' if key == 'replicates' else _example(key)}")
    lines += _design_template()
    lines += [
        "",
        f"# {meaning(Study.model_fields['published'])}",
        "# published:",
        "#   - {csd: mine, quantity: porosity, value: 0.36, source: my test, kind: measurement}",
    ]
    return "\n".join(lines) + "\n"


def _design_template() -> list[str]:
    """Section ``design``, every key of it behind a #."""
    lines = ["", f"# {meaning(Study.model_fields['design'])}", "# design:"]
    for key, field in Design.model_fields.items():
        lines.append(f"  # {meaning(field)}")
        part = DESIGN_PARTS.get(key)
        if part is None:
            lines.append(f"  # {key}: {EXAMPLES.get(key) or _yaml(field.get_default())}")
            continue
        lines.append(f"  # {key}:")
        for name, inner in part.model_fields.items():
            example = EXAMPLES_OF_DESIGNS.get(name) or _yaml(inner.get_default())
            lines += [f"    # {meaning(inner)}", f"    # {name}: {example}"]
    return lines


def reference() -> str:
    """Render the reference of every key as a Markdown page."""
    lines = [
        "# Reference of configuration keys",
        "",
        "Generated from the config model by `make schemas`.",
    ]
    parts: list[tuple[str, type[BaseModel]]] = [
        ("`config/config.yaml`", Workflow),
        ("A study: `config/studies/<name>.yaml`", Study),
        ("`csds.<name>`", Csd),
        ("`csds.<name>.mixture[]`", SizeClass),
        ("`csds.<name>.lognormal`", Lognormal),
        ("`csds.<name>.rosin_rammler`", RosinRammler),
        ("`crystallizer`", Crystallizer),
        ("`filter`", Filter),
        ("`material`", Material),
        ("`packing`", Packing),
        ("`permeability`", Permeability),
        ("`sweeps[]`", Sweep),
        ("`cross_check`", CrossCheck),
        ("`design`", Design),
        ("`design.variables`", Variables),
        ("`design.constraints`", Constraints),
        ("`design.costs`", Costs),
        ("`published[]`", Published),
        ("A calibration: `config/calibrations/<name>.yaml`", Calibration),
        ("`cohesion_kJ_m3` of a calibration", CohesionRange),
        ("`adhesion_mJ_m2` of a calibration", AdhesionRange),
        ("Measurements: `config/measurements/<name>.yaml`", MeasurementFile),
        ("`tests[]`", ConstantPressureTest),
        ("`resistances[]`", KnownResistance),
    ]
    for title, model in parts:
        lines += ["", f"## {title}", "", str(model.__doc__ or "").strip(), ""]
        lines += ["| key | default | allowed | meaning |", "|---|---|---|---|"]
        for key, field in model.model_fields.items():
            default = "required" if field.is_required() else f"`{_default_text(field)}`"
            lines.append(f"| `{key}` | {default} | {allowed(field)} | {meaning(field)} |")
    return "\n".join(lines) + "\n"


def write(root: Path = ROOT) -> None:
    """Rewrite every generated file below ``root``."""
    for path, text in generated().items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text, encoding="utf-8")


def _schema(model: type[BaseModel]) -> str:
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **model.model_json_schema()}
    return json.dumps(_widen(schema), indent=2, ensure_ascii=False) + "\n"


def _widen(node: Any) -> Any:
    """Let the schema accept what the model does: one value instead of a list of one."""
    if isinstance(node, dict):
        node = {key: _widen(value) for key, value in node.items()}
        of_one = node.get("type") == "array" and node.get("minItems", 0) < 2
        if of_one and node.get("items", {}).get("type") in ("number", "string"):
            title = {key: node.pop(key) for key in ("title", "description", "default") if key in node}
            return {**title, "anyOf": [node, node["items"]]}
        return node
    return [_widen(item) for item in node] if isinstance(node, list) else node


def _default_text(field: FieldInfo) -> str:
    default = field.get_default(call_default_factory=True)
    return "(its defaults)" if isinstance(default, BaseModel) else _yaml(default)


def _yaml(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(_yaml(item) for item in value) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _example(key: str) -> str:
    examples = {
        "residence_time_min": "[15, 30, 45, 60] # instead of csd",
        "cohesion_kJ_m3": "[0, 25, 50]",
        "engine": "[embedded, liggghts]",
        "friction": "[0, 0.05]",
        "poisson_ratio": "[0.2, 0.3]",
        "restitution": "[0.3, 0.6]",
        "youngs_modulus_MPa": "[5, 10]",
        "adhesion_mJ_m2": "[0, 1, 10]",
        "pressure_kPa": "[25, 50, 100]",
        "protocol": "[gravity, filtration]",
    }
    return examples[key]


if __name__ == "__main__":
    write()
