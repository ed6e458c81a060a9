"""The map for newcomers: every room, file, rule and function that it names is there."""

from __future__ import annotations

import importlib
import re

import pytest
from documented import REPOSITORY
from test_floors import FLOOR, FLOORS, GROUND

PAGE = "docs/architecture.md"
PACKAGE = REPOSITORY / "src" / "filtercake"
ROOMS = set(FLOOR) - set(GROUND)
TOPS = {path.name for path in REPOSITORY.iterdir()}
RULES = "\n".join(path.read_text(encoding="utf-8") for path in (REPOSITORY / "workflow" / "rules").glob("*.smk"))


def spans_of(text: str) -> list[str]:
    """Code spans of a page, blocks left out."""
    return re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL))


def written_by_a_rule(span: str) -> bool:
    """Whether rules have a file of a study, written with <wildcards>."""
    return re.sub(r"<(\w+)>", r"{\1}", span).replace("results/", "{results}/", 1) in RULES


def in_the_library(span: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    module, _, name = f"filtercake.{span}".rpartition(".")
    try:
        if hasattr(importlib.import_module(module), name):
            return True
        importlib.import_module(f"{module}.{name}")
    except ModuleNotFoundError:
        return False
    return True


def why_missing(span: str) -> str | None:
    """Say what is not there of what a code span names; None where it is, or where it names nothing of the project."""
    first = re.split(r"[/.]", span)[0]
    if span.startswith("results/"):
        return None if written_by_a_rule(span) else "no rule writes it"
    if span.startswith("rule "):
        return None if re.search(rf"^{span}:$", RULES, re.MULTILINE) else "no such rule"
    if "/" in span:
        place = PACKAGE if first in ROOMS else REPOSITORY
        return None if (place / span).exists() else f"no such file below {place.name}"
    if span in TOPS or (first in FLOOR and "." not in span):
        return None
    if first in FLOOR:
        return None if in_the_library(span) else "the library has no such name"
    return None


@pytest.mark.parametrize("span", sorted(set(spans_of((REPOSITORY / PAGE).read_text(encoding="utf-8")))))
def test_what_the_page_names_is_there(span: str) -> None:
    assert why_missing(span) is None


def test_the_pages_floors_are_those_of_the_test() -> None:
    text = (REPOSITORY / PAGE).read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| ([^|]+) \|", text, re.MULTILINE)
    found = {int(floor): tuple(spans_of(rooms)) for floor, rooms in rows}
    assert found == {height + 1: rooms for height, rooms in enumerate(FLOORS)}


@pytest.mark.parametrize(
    "span",
    [
        "packing.cloud.no_such_function",
        "packing.no_such_module",
        "crystals.csd.CrystalSizeDistribution.nothing",
        "packing/no_such_module.py",
        "workflow/rules/no_such.smk",
        "results/<study>/no_such.csv",
        "rule no_such_rule",
    ],
)
def test_what_is_not_there_is_noticed(span: str) -> None:
    assert why_missing(span) is not None


def test_the_page_names_what_is_checked() -> None:
    spans = spans_of((REPOSITORY / PAGE).read_text(encoding="utf-8"))
    for kind in ("results/", "rule ", "workflow/scripts/", "packing.", "results.", "study."):
        assert sum(span.startswith(kind) for span in spans) >= 5, kind
