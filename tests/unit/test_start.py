"""Nobody waits for what is not used: what a plan, a formula and a help text import.

Processes of their own say which modules they have imported in the end.
"""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from filtercake import api
from filtercake.cli.commands import COMMANDS, EXAMPLES

REPOSITORY = Path(__file__).resolve().parents[2]
RULES = REPOSITORY / "workflow" / "rules"
HEAVY = ("numba", "llvmlite", "matplotlib", "sklearn", "pandas", "scipy", "jinja2")
NEEDS_SCIPY = {"crystallizer", "csd", "test"}
"""Formulas with special functions or roots."""
FORMULAS = ("resistance", "filter-area", "filter-batch", "deliquor", "cost", *sorted(NEEDS_SCIPY))
RUN = """
import contextlib, io, json, sys
from filtercake.cli.commands import main
with contextlib.redirect_stdout(io.StringIO()) as printed:
    status = main({arguments!r})
print(json.dumps([status, bool(printed.getvalue()), sorted(sys.modules)]))
"""


def modules_after(code: str) -> set[str]:
    """Modules that a process of its own has imported at the end of some code, which prints them as JSON."""
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True, cwd=REPOSITORY
    )
    *printed, modules = json.loads(done.stdout)
    assert printed in ([], [0, True]), done.stderr
    return set(modules)


def modules_of_command(*arguments: str) -> set[str]:
    return modules_after(RUN.format(arguments=[*arguments]))


def test_the_rules_import_nothing_heavy() -> None:
    lines = [
        line
        for path in sorted(RULES.glob("*.smk"))
        if path.name != "validation.smk"
        for line in re.findall(r"^from filtercake.* import (?:\([^)]*\)|.+)", path.read_text(), re.MULTILINE)
    ]
    assert len(lines) > 10
    found = modules_after("\n".join([*lines, "import json, sys", "print(json.dumps([sorted(sys.modules)]))"]))
    assert "filtercake.study.loading" in found
    assert found & set(HEAVY) == set()


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_help_needs_no_numbers(option: str) -> None:
    found = modules_of_command(option)
    assert "filtercake.cli.commands" in found
    assert found & {*HEAVY, "numpy", "pydantic", "yaml"} == set()


@pytest.mark.parametrize("command", FORMULAS)
def test_a_formula_imports_neither_tables_nor_compilers_nor_pictures(command: str) -> None:
    found = modules_of_command(*arguments_of(command))
    assert {"filtercake.cli.commands", "numpy", "pydantic"} <= found
    assert found & set(HEAVY) == ({"scipy"} if command in NEEDS_SCIPY else set())


def arguments_of(command: str) -> list[str]:
    """A call of a command, as its help shows it, but for what it writes."""
    program, *words = shlex.split(EXAMPLES[command])
    assert program == "filtercake"
    if "--output" in words:
        place = words.index("--output")
        del words[place : place + 2]
    return words


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_the_help_of_a_command_needs_nothing_heavy(command: str) -> None:
    assert modules_of_command(command, "--help") & set(HEAVY) == set()


def test_the_library_is_there_by_name_before_it_is_imported() -> None:
    found = modules_after("import json, sys; from filtercake import api; dir(api); print(json.dumps([[*sys.modules]]))")
    assert "filtercake.api" in found
    assert found & {*HEAVY, "numpy", "pydantic"} == set()


def test_every_name_of_the_library_is_found_and_completed() -> None:
    assert set(api.__all__) <= set(dir(api))
    assert sorted(api._HOME_OF) == sorted(api.__all__)
    for name, home in api._HOME_OF.items():
        assert getattr(api, name) is getattr(importlib.import_module(f"filtercake.api.{home}"), name)
    everything: dict[str, object] = {}
    exec("from filtercake.api import *", everything)
    assert set(api.__all__) <= set(everything)


def test_no_module_hides_a_function_of_its_name() -> None:
    """Importing a module sets its name in its package, whatever else is called so."""
    modules = {found.name for found in pkgutil.iter_modules(api.__path__)}
    assert "packings" in modules
    assert modules & set(api.__all__) == set()


def test_a_name_that_the_library_does_not_have_is_an_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'packs'"):
        _ = api.packs
    with pytest.raises(ImportError, match="packs"):
        exec("from filtercake.api import packs")
