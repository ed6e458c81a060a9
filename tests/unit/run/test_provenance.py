"""Which library files a rule depends on, and what a run says about its origin."""

from __future__ import annotations

import ast
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy
import pytest

from filtercake.packing.engines import ENGINES
from filtercake.packing.engines.liggghts import TEMPLATE_FOLDER_VARIABLE, template_folder
from filtercake.run import provenance
from filtercake.run.provenance import ROOT, code_hash, describe, packing_code, packing_sources, sources, versions


def names(module: str) -> set[str]:
    return {str(path.relative_to(ROOT)) for path in sources(module)}


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A made-up library: top -> middle -> ground, and a module beside them."""
    root = tmp_path / "filtercake"
    (root / "inner").mkdir(parents=True)
    for name, text in {
        "__init__.py": "",
        "inner/__init__.py": "",
        "top.py": "from filtercake import middle\nimport json\n",
        "middle.py": "def late():\n    import filtercake.inner.ground as g\n    return g\n",
        "inner/ground.py": "from filtercake.inner.loop import x\n",
        "inner/loop.py": "from filtercake.inner.ground import y\n",
        "beside.py": "from filtercake.top import z\n",
    }.items():
        (root / name).write_text(text, encoding="utf-8")
    monkeypatch.setattr(provenance, "ROOT", root)
    provenance.sources.cache_clear()
    yield root
    provenance.sources.cache_clear()


def test_imports_are_followed_through_modules_and_circles(library: Path) -> None:
    found = {str(path.relative_to(library)) for path in sources("top")}
    assert found == {"__init__.py", "top.py", "middle.py", "inner/__init__.py", "inner/ground.py", "inner/loop.py"}


def test_modules_above_are_left_out(library: Path) -> None:
    found = {str(path.relative_to(library)) for path in sources("inner.ground")}
    assert found == {"__init__.py", "inner/__init__.py", "inner/ground.py", "inner/loop.py"}


def test_every_import_of_the_library_is_found() -> None:
    """By the search for its words, as the parser finds them."""
    for path in ROOT.rglob("*.py"):
        names: list[str] = []
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        own = [name.removeprefix("filtercake.") for name in names if name.startswith("filtercake.")]
        assert set(provenance._imports(path)) == {file for name in own if (file := provenance._file_of(name))}, path


def test_a_missing_module_is_an_error(library: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no module 'inner\.nothing'"):
        sources("inner.nothing")


def test_packing_depends_on_its_engines_and_not_on_studies_and_figures() -> None:
    found = names("packing.pack")
    assert {
        "__init__.py",
        "packing/__init__.py",
        "packing/pack.py",
        "packing/cloud.py",
        "packing/accept.py",
        "packing/contacts.py",
        "packing/settling.py",
        "packing/engines/__init__.py",
        "packing/engines/liggghts.py",
        "packing/engines/liggghts_log.py",
        "packing/engines/process.py",
        "packing/engines/micro.py",
        "packing/contact_law.py",
        "crystals/csd.py",
        "errors.py",
        "units.py",
    } <= found
    assert "packing/porosity.py" not in found
    assert {name.split("/")[0] for name in found if "/" in name} == {"packing", "crystals"}


def test_lower_floors_import_nothing_from_above() -> None:
    assert names("units") == {"__init__.py", "units.py"}
    assert names("errors") == {"__init__.py", "errors.py"}
    read = {f"crystals/{name}.py" for name in ("__init__", "csd", "instruments", "cells", "column_names")}
    rooms = read | {"filtration/__init__.py", "filtration/resistance.py"}
    assert names("filtration.resistance") == rooms | {"__init__.py", "errors.py", "units.py", "user_files.py"}


@pytest.mark.parametrize("module", ["packing.pack", "crystals.csd", "packing.porosity", "study.points"])
def test_what_python_really_imports_is_in_the_list(module: str) -> None:
    code = (
        f"import sys, filtercake.{module}\n"
        "print(*[m.__file__ for n, m in sys.modules.items() if n.split('.')[0] == 'filtercake'], sep='\\n')"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported = {Path(line).resolve() for line in run.stdout.splitlines()}
    assert imported <= set(sources(module))


def test_a_hash_follows_contents_not_places(tmp_path: Path) -> None:
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
    a, b = tmp_path / "one" / "a.py", tmp_path / "one" / "b.py"
    a.write_text("x = 1\n", encoding="utf-8")
    b.write_text("y = 1\n", encoding="utf-8")
    first = code_hash([a, b])
    assert code_hash((b, a)) == first
    shutil.copy(a, tmp_path / "two" / "a.py")
    assert code_hash([tmp_path / "two" / "a.py", b]) == first
    a.write_text("x = 2\n", encoding="utf-8")
    assert code_hash([a, b]) != first
    assert code_hash([b]) != first


def test_a_hash_is_of_what_code_means(tmp_path: Path) -> None:
    file = tmp_path / "a.py"
    plain = 'A = "# 1"\n\n\ndef f(x):\n    return g(\n        x,\n        """a\n\n  b""",\n    )\n'
    file.write_text(plain, encoding="utf-8")
    first = code_hash([file])
    for same in (
        "# it's why\n" + plain,
        '"""What\'s "done".\n\n# so\n"""\n\n\n' + plain,
        plain.replace("    return", '    """Say."""\n\n    return'),
        plain.replace("x,", "x,  # here"),
        plain + '\nB: int\n"""It."""\n'.replace("B: int\n", ""),
    ):
        file.write_text(same, encoding="utf-8")
        assert code_hash([file]) == first, same
    for other in ("# 2", "a\n\n b", "a\n  b", "z"):
        old = {"# 2": "# 1", "z": "g("}.get(other, "a\n\n  b")
        file.write_text(plain.replace(old, other), encoding="utf-8")
        assert code_hash([file]) != first, other


def meaning_by_syntax(source: str) -> str:
    """What a hash should be of, by the parser: slower, and sure."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(getattr(node, "body", None), list):
            text = [n for n in node.body if isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant)]
            node.body = [n for n in node.body if n not in text]
    return ast.dump(tree)


@pytest.mark.filterwarnings("ignore:invalid escape")
@pytest.mark.parametrize("path", sorted(ROOT.rglob("*.py")), ids=lambda path: path.name)
def test_every_string_that_does_something_is_in_the_hash(path: Path, tmp_path: Path) -> None:
    """Change one string after another: the hash follows where the syntax tree does, and only there."""
    source, file = path.read_text(encoding="utf-8"), tmp_path / "a.py"
    file.write_text(source, encoding="utf-8")
    first, tree = code_hash([file]), meaning_by_syntax(source)
    strings = [found for found in provenance.STRING_OR_COMMENT.finditer(source) if len(found[0]) > 8]
    for found in strings[:: max(1, len(strings) // 10)]:
        other = f"{source[: found.end() - 4]}X{source[found.end() - 4 :]}"
        file.write_text(other, encoding="utf-8")
        try:
            does_something = meaning_by_syntax(other) != tree
        except SyntaxError:
            continue  # cut through an escape or a replacement field
        assert (code_hash([file]) != first) >= does_something, found[0]


def test_versions_name_every_package_even_a_missing_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "PACKAGES", ("numpy", "no-such-package-at-all"))
    found = versions()
    assert found["no-such-package-at-all"] == "not installed"
    assert found["numpy"] == numpy.__version__
    assert found["python"].startswith(f"{sys.version_info.major}.{sys.version_info.minor}")


def test_a_description_is_json_and_survives_a_folder_without_git(tmp_path: Path) -> None:
    found = json.loads(json.dumps(describe(tmp_path)))
    assert found["commit"] == "unknown"
    assert set(found) == {"versions", "machine", "commit"}


def test_the_commit_is_the_repository_s(tmp_path: Path) -> None:
    if shutil.which("git") is None:
        pytest.skip("git is not installed")
    git = ["git", "-C", str(tmp_path), "-c", "user.name=t", "-c", "user.email=t@t"]
    subprocess.run([*git, "init", "-q"], check=True)
    (tmp_path / "f").write_text("1", encoding="utf-8")
    subprocess.run([*git, "add", "f"], check=True)
    subprocess.run([*git, "commit", "-qm", "m"], check=True)
    head = subprocess.run([*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True).stdout.strip()
    commit = describe(tmp_path)["commit"]
    assert head.startswith(commit)
    (tmp_path / "f").write_text("2", encoding="utf-8")
    assert describe(tmp_path)["commit"] == f"{commit}-dirty"


@pytest.mark.parametrize(
    ("engine", "own", "others"),
    [
        ("embedded", {"embedded.py", "embedded_bed.py", "embedded_kernels.py"}, {"liggghts.py", "liggghts_log.py"}),
        ("liggghts", {"liggghts.py", "liggghts_log.py", "process.py", "micro.py"}, {"embedded.py", "embedded_bed.py"}),
        ("liggghts_as_published", {"liggghts_as_published.py", "liggghts.py"}, {"embedded_kernels.py"}),
    ],
)
def test_packings_depend_on_their_own_engine_only(engine: str, own: set[str], others: set[str]) -> None:
    found = {path.name for path in packing_sources(engine)}
    assert own | {"base.py", "pack.py", "cloud.py", "accept.py", "settling.py", "contact_law.py"} <= found
    assert not others & found


def test_an_unknown_engine_has_no_files() -> None:
    with pytest.raises(FileNotFoundError, match="no engine 'magic'"):
        packing_sources("magic")


def test_a_file_behind_many_modules_is_read_once(library: Path) -> None:
    provenance._imports.cache_clear()
    for module in ("top", "middle", "beside", "inner.ground"):
        sources(module)
    assert provenance._imports.cache_info().misses == 7  # every file once


def test_a_deck_counts_for_the_engine_that_fills_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    folder = tmp_path / "templates"
    shutil.copytree(template_folder(), folder)
    monkeypatch.setenv(TEMPLATE_FOLDER_VARIABLE, str(folder))
    before = {name: packing_code(name) for name in ENGINES}
    deck = folder / "packing.in.j2"
    deck.write_text(f"{deck.read_text()}\n# edited\n")
    assert {name for name in ENGINES if packing_code(name) != before[name]} == {"liggghts"}
