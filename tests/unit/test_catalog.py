"""What the Snakemake workflow catalog asks of a workflow."""

from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]


def test_the_catalog_finds_the_workflow_its_manual_and_its_usage() -> None:
    usage = yaml.safe_load((ROOT / ".snakemake-workflow-catalog.yml").read_text())["usage"]
    assert usage["report"] is True
    deployed = usage["software-stack-deployment"]
    assert deployed["conda"] == any("conda:" in path.read_text() for path in (ROOT / "workflow/rules").glob("*.smk"))
    assert (ROOT / "workflow" / "Snakefile").is_file() and (ROOT / "config" / "README.md").is_file()
