"""Kernels run whatever became of their cache on disk: damaged, unwritable, or nowhere at all."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import filtercake

KERNEL = """
from filtercake.packing.compiled import cached_njit

@cached_njit
def twice(x):
    return 2.0 * x

if __name__ == "__main__":
    print(twice(21.0), dict(twice.stats.cache_hits) != {}, twice.stats.cache_path)
"""


def run(script: Path, **environment: str) -> tuple[str, bool, str]:
    """Value, whether it came from the cache, and the cache's folder."""
    found = {**os.environ, "PYTHONPATH": str(Path(filtercake.__file__).parents[1]), **environment}
    found.pop("NUMBA_CACHE_DIR", None) if "NUMBA_CACHE_DIR" not in environment else None
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=found)
    assert done.returncode == 0, done.stderr
    value, hit, folder = done.stdout.split(maxsplit=2)
    return value, hit == "True", folder.strip()


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "place" / "kernel.py"
    path.parent.mkdir()
    path.write_text(KERNEL, encoding="utf-8")
    return path


def test_a_kernel_is_compiled_once(script: Path) -> None:
    assert run(script)[:2] == ("42.0", False)
    assert run(script)[:2] == ("42.0", True)


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("spoil", [lambda data: b"", lambda data: data[: len(data) // 2], lambda data: b"x" * 999])
def test_a_damaged_cache_is_made_anew(script: Path, suffix: str, spoil: object) -> None:
    run(script)
    files = list(script.parent.glob(f"__pycache__/*.{suffix}"))
    assert files
    for file in files:
        file.write_bytes(spoil(file.read_bytes()))  # type: ignore[operator]
    assert run(script)[:2] == ("42.0", False)
    assert run(script)[:2] == ("42.0", True)


def read_only_tree(script: Path) -> None:
    """A file where the folder would be: nothing can be written beside the kernel, not even by root."""
    shutil.rmtree(script.parent / "__pycache__", ignore_errors=True)
    (script.parent / "__pycache__").write_text("")


def test_without_a_writable_tree_or_home_the_temporary_folder_serves(script: Path, tmp_path: Path) -> None:
    read_only_tree(script)
    (tmp_path / "tmp").mkdir()
    nowhere = {"HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null/cache", "TMPDIR": str(tmp_path / "tmp")}
    value, hit, folder = run(script, **nowhere)
    assert (value, hit) == ("42.0", False)
    own = tmp_path / "tmp" / f"filtercake-{os.getuid()}"
    assert folder.startswith(str(own))
    assert own.stat().st_mode & 0o077 == 0
    assert run(script, **nowhere)[1]
    own.chmod(0o777)  # what others may write is not run
    assert run(script, **nowhere)[1:] == (False, "None")


def test_a_place_that_can_no_longer_be_written_is_done_without(script: Path) -> None:
    read_only_tree(script)
    assert run(script, HOME="/dev/null", XDG_CACHE_HOME="/dev/null/c", TMPDIR="/dev/null")[0] == "42.0"


def test_importing_compiles_nothing_and_writes_nothing(tmp_path: Path) -> None:
    tree = tmp_path / "src" / "filtercake"
    shutil.copytree(Path(filtercake.__file__).parent, tree, ignore=shutil.ignore_patterns("__pycache__"))
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    modules = ["filtercake.api", "filtercake.packing.engines", "filtercake.cli.commands"]
    environment = {**os.environ, "PYTHONPATH": str(tree.parent), "HOME": str(tmp_path), "TMPDIR": str(tmp_path)}
    code = f"import {', '.join(modules)}; print(filtercake.__file__)"
    done = subprocess.run([sys.executable, "-B", "-c", code], capture_output=True, text=True, env=environment)
    assert done.stdout.strip() == str(tree / "__init__.py"), done.stderr
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before


def test_a_kernel_is_compiled_anew_when_one_that_it_calls_has_changed(script: Path) -> None:
    borrowed = script.with_name("other_kernels.py")
    kernel = "from filtercake.packing.compiled import cached_njit\n\n@cached_njit\ndef times(x):\n    return {} * x\n"
    borrowed.write_text(kernel.format(2.0))
    script.write_text(
        KERNEL.replace("2.0 * x", "other.times(x)").replace("\n\n@", "\nimport other_kernels as other\n\n@", 1)
    )
    assert run(script)[:2] == ("42.0", False)
    assert run(script)[:2] == ("42.0", True)
    borrowed.write_text(kernel.format(3.0))
    assert run(script)[:2] == ("63.0", False)
    assert run(script)[:2] == ("63.0", True)


def test_a_kernel_is_compiled_anew_when_one_two_calls_away_has_changed(script: Path) -> None:
    far, near = script.with_name("far_kernels.py"), script.with_name("near_kernels.py")
    kernel = "from filtercake.packing.compiled import cached_njit\n{}\n@cached_njit\ndef times(x):\n    return {} * x\n"
    far.write_text(kernel.format("", 2.0))
    near.write_text(kernel.format("import far_kernels as far\n", "far.times(1.0)"))
    script.write_text(
        KERNEL.replace("2.0 * x", "near.times(x)").replace("\n\n@", "\nimport near_kernels as near\n\n@", 1)
    )
    assert run(script)[:2] == ("42.0", False)
    assert run(script)[:2] == ("42.0", True)
    far.write_text(kernel.format("", 3.0))
    assert run(script)[:2] == ("63.0", False)
