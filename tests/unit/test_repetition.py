"""Nothing of the library stands twice: no ten lines in a row are the same in two of its files."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import filtercake

PACKAGE = Path(filtercake.__file__).parent
LENGTH = 10
"""Equal lines in a row that count as a repetition."""


def significant(text: str) -> list[tuple[int, str]]:
    """Numbered lines of a module but for blank ones, comments, imports and lone brackets."""
    imports = {
        number
        for node in ast.walk(ast.parse(text))
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for number in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1) if number not in imports]
    return [(number, line) for number, line in lines if line.strip("()[]{},:") and not line.startswith("#")]


def repetitions(folder: Path, length: int = LENGTH) -> list[str]:
    """Places where as many significant lines are the same in two files."""
    places = defaultdict(list)
    for path in sorted(folder.rglob("*.py")):
        lines = significant(path.read_text(encoding="utf-8"))
        for first in range(len(lines) - length + 1):
            number = lines[first][0]
            run = tuple(line for _, line in lines[first : first + length])
            places[run].append((path.relative_to(folder), number))
    return [
        " = ".join(f"{path}:{number}" for path, number in found)
        for found in places.values()
        if len({path for path, _ in found}) > 1
    ]


def test_no_ten_lines_stand_in_two_files() -> None:
    assert repetitions(PACKAGE) == []


def test_a_repetition_is_found_whatever_stands_between(tmp_path: Path) -> None:
    lines = [f"x{k} = f({k})" for k in range(LENGTH)]
    (tmp_path / "a.py").write_text("\n".join(["import os", *lines]), encoding="utf-8")
    spread = "\n\n    # a word\n    ".join(["if x:", *lines])
    (tmp_path / "b.py").write_text(spread, encoding="utf-8")
    assert repetitions(tmp_path) == ["a.py:2 = b.py:4"]
    (tmp_path / "b.py").write_text(spread.replace("x5", "y"), encoding="utf-8")
    assert repetitions(tmp_path) == []
