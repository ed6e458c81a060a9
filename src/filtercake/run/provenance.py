"""Provenance of results: the library files behind a module, and the versions behind a run."""

from __future__ import annotations

import importlib.metadata
import inspect
import platform
import re
import subprocess
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from filtercake.packing.engines import ENGINES
from filtercake.packing.engines.liggghts import template_folder
from filtercake.packing.result import sha256
from filtercake.packing.scene import digest

ROOT = Path(__file__).resolve().parents[1]
IMPORT = re.compile(r"^ *(?:from (filtercake[\w.]*) import (\([^)]*\)|.*)|import (filtercake\.[\w.]+))", re.MULTILINE)
"""Statements that import from the package, as ruff formats them."""
STRING_OR_COMMENT = re.compile(
    r'''("""(?:\\.|[^\\])*?"""|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*')|#[^\n]*''', re.DOTALL
)
"""Strings (the group) and comments of Python, as ruff formats them."""
PACKAGES = ("numpy", "scipy", "pandas", "numba", "matplotlib", "scikit-learn", "jinja2", "pydantic", "snakemake")


@cache
def sources(module: str) -> tuple[Path, ...]:
    """List the library's own files that a module (``packing.pack``) depends on, itself included, sorted.

    Snakemake does not see imports: rules take the :func:`code_hash` of these files as a parameter, so that an edit
    reruns what depends on it.

    Raises
    ------
    FileNotFoundError
        If there is no such module.
    """
    start = _file_of(module)
    if start is None:
        raise FileNotFoundError(f"filtercake has no module {module!r}")
    return tuple(sorted(_closure(start)))


@cache
def packing_sources(engine: str) -> tuple[Path, ...]:
    """List the files behind packings by one engine: an edit of another engine leaves its packings alone.

    Raises
    ------
    FileNotFoundError
        If there is no such engine.
    """
    if engine not in ENGINES:
        raise FileNotFoundError(f"filtercake has no engine {engine!r}")
    registry = ROOT / "packing" / "engines" / "__init__.py"
    own = _closure(Path(inspect.getfile(ENGINES[engine])), closed=registry)
    others = set(registry.parent.glob("*.py")) - own
    return tuple(sorted(own | set(sources("packing.pack")) - others))


def _closure(start: Path, closed: Path | None = None) -> set[Path]:
    """Collect a file and all it imports; what ``closed`` imports is not followed."""
    found: set[Path] = set()
    waiting = [start]
    while waiting:
        path = waiting.pop()
        if path in found:
            continue
        found.add(path)
        waiting += _packages(path.parent)
        if path != closed:
            waiting += _imports(path)
    return found


@cache
def _packages(folder: Path) -> tuple[Path, ...]:
    """Files of the packages that a folder is and lies in, up to ``ROOT``; none outside of it."""
    if folder == ROOT:
        return (folder / "__init__.py",)
    return (*_packages(folder.parent), folder / "__init__.py") if ROOT in folder.parents else ()


def packing_code(engine: str) -> str:
    """Hash of the code behind packings by an engine, and of the deck template that it fills, if any.

    Raises
    ------
    FileNotFoundError
        If there is no such engine.
    """
    name = ENGINES[engine].template
    deck = template_folder() / name
    return code_hash([*packing_sources(engine), *([deck] if name and deck.exists() else [])])


def code_hash(files: Iterable[Path]) -> str:
    """Hash of what files mean, independent of where they lie: comments and docstrings of Python are no part of it."""
    return digest(
        sorted(
            (path.name, _meaning(path.read_text(encoding="utf-8")) if path.suffix == ".py" else sha256(path))
            for path in files
        )
    )


@cache
def _meaning(source: str) -> str:
    """Hash Python source without comments, blank lines and strings that stand alone as statements.

    The text is searched, as parsing it would slow every start; in doubt, a string is kept.
    """
    bare = STRING_OR_COMMENT.sub(lambda found: found[1] or "", source)

    def shown(found: re.Match[str]) -> str:
        before, _, indent = bare[: found.start()].rpartition("\n")
        after = bare[found.end() :].partition("\n")[0]
        ends_statement = not before.rstrip().endswith((*"([{,=+-*/%|&\\\"'",))
        if found[0].startswith('"""') and ends_statement and not (indent + after).strip():
            return ""
        return repr(found[0]) if "\n" in found[0] else found[0]

    text = STRING_OR_COMMENT.sub(shown, bare)
    return digest([line.rstrip() for line in text.splitlines() if line.strip()])


def versions() -> dict[str, str]:
    """Versions of filtercake, Python and the packages it stands on."""
    from filtercake import __version__

    found = {"filtercake": __version__, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def describe(root: Path) -> dict[str, Any]:
    """Describe versions, machine and commit, for ``provenance.json``."""
    return {
        "versions": versions(),
        "machine": {"system": platform.system(), "release": platform.release(), "processor": platform.machine()},
        "commit": _commit(root),
    }


def _commit(root: Path) -> str:
    command = ["git", "-C", str(root), "describe", "--always", "--dirty"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return "unknown"


def _file_of(module: str) -> Path | None:
    path = ROOT.joinpath(*module.split("."))
    if path.with_suffix(".py").is_file():
        return path.with_suffix(".py")
    package = path / "__init__.py"
    return package if package.is_file() else None


@cache
def _imports(path: Path) -> tuple[Path, ...]:
    """Files below ``ROOT`` that a file imports; the text is searched, as parsing it would slow every start."""
    names: list[str] = []
    for module, aliases, plain in IMPORT.findall(path.read_text(encoding="utf-8")):
        aliased = re.findall(r"(\w+)(?: as \w+)?", re.sub("#.*", "", aliases))
        names += [module or plain, *(f"{module}.{name}" for name in aliased)]
    own = [name.removeprefix("filtercake.") for name in names if name.startswith("filtercake.")]
    return tuple(file for name in own if (file := _file_of(name)) is not None)
