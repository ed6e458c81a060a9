"""The house: which room stands on which floor, and that every import leads down."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import filtercake

PACKAGE = Path(filtercake.__file__).parent
GROUND = ("units", "errors", "user_files", "statistics")
FLOORS = (
    GROUND,
    ("crystals",),
    ("packing", "filtration"),
    ("permeability",),
    ("study",),
    ("results",),
    ("calibration", "design", "run"),
    ("figures",),
    ("api", "report"),
    ("cli", "validation"),
)
"""From the ground up; a room imports from lower floors and from itself."""
FLOOR = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
DOORS = {"__init__.py", "__main__.py"}
"""Files that belong to the whole package."""


def imported(path: Path) -> Iterator[str]:
    """Rooms that a file imports from."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        yield from (name.split(".")[1] for name in names if name.startswith("filtercake."))


def wrong_ways(package: Path) -> list[str]:
    """Imports that lead up, or to another room on the same floor."""
    found = []
    for path in sorted(package.rglob("*.py")):
        place = path.relative_to(package)
        if str(place) in DOORS:
            continue
        room = place.parts[0].removesuffix(".py")
        ground = FLOORS[0]
        for other in imported(path):
            if other == "__version__" or other == room or (room in ground and other in ground):
                continue
            if FLOOR[other] >= FLOOR[room]:
                found.append(f"{place} imports from {other}")
    return found


def test_every_import_leads_down() -> None:
    assert wrong_ways(PACKAGE) == []


def test_an_import_that_leads_up_is_found(tmp_path: Path) -> None:
    for room in ("crystals", "packing", "filtration"):
        (tmp_path / room).mkdir()
    (tmp_path / "crystals" / "a.py").write_text("from filtercake.packing import b\n", encoding="utf-8")
    (tmp_path / "packing" / "b.py").write_text("def f():\n    import filtercake.filtration.c\n", encoding="utf-8")
    (tmp_path / "filtration" / "c.py").write_text("from filtercake.crystals.a import x\n", encoding="utf-8")
    assert wrong_ways(tmp_path) == ["crystals/a.py imports from packing", "packing/b.py imports from filtration"]


def test_only_the_ground_lies_directly_in_the_package() -> None:
    assert {path.stem for path in PACKAGE.glob("*.py")} <= {*GROUND, "__init__", "__main__"}
    rooms = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").is_file()}
    assert rooms == set(FLOOR) - set(GROUND)


def test_every_room_says_what_lives_there() -> None:
    for room in set(FLOOR) - set(GROUND):
        docstring = ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text(encoding="utf-8")))
        assert docstring is not None
        assert len(docstring) > 80, room
        assert "mports" in docstring or "import" in docstring, room
