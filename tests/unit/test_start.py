"""Planning a study is quick: what the rules import brings in no compiler, no solver and nothing that draws."""

import os
import re
import subprocess
import sys
from pathlib import Path

RULES = Path(__file__).resolve().parents[2] / "workflow" / "rules"
HEAVY = ("numba", "llvmlite", "matplotlib", "sklearn", "scipy.special", "scipy.optimize", "scipy.spatial")


def test_the_rules_import_nothing_heavy() -> None:
    lines = [
        line
        for path in sorted(RULES.glob("*.smk"))
        if path.name != "validation.smk"
        for line in re.findall(r"^from filtercake.* import (?:\([^)]*\)|.+)", path.read_text(), re.MULTILINE)
    ]
    assert len(lines) > 10
    code = "\n".join([*lines, "import sys", f"print(*(set({HEAVY!r}) & set(sys.modules)))"])
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
