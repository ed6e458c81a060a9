"""Run the real workflow on a copy of the project, so that tests may edit any file of it."""

import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
PARTS = ("Snakefile", "config", "workflow", "profiles", "liggghts_templates", "src", "docs")
TINY = "config/test/tiny.yaml"


@contextmanager
def edited(path, change):
    """Change a file and put it back, its time included."""
    before, times = path.read_text(), path.stat()
    path.write_text(change(before))
    try:
        yield
    finally:
        path.write_text(before)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


@dataclass
class Checkout:
    """A copy of the project that runs its own library."""

    root: Path

    @property
    def results(self) -> Path:
        return self.root / "results" / "tiny"

    def snakemake(
        self, *arguments: str, module: str = "snakemake", timeout: float = 300, **environment: str
    ) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", module, "--cores", "2", *arguments]
        return subprocess.run(
            command,
            cwd=self.root,
            env={**os.environ, "PYTHONPATH": str(self.root / "src"), **environment},
            capture_output=True,
            text=True,
            timeout=timeout,
        )

    def run(self, *arguments: str, study: str = TINY, **environment: str) -> subprocess.CompletedProcess:
        return self.snakemake("--config", f"studies={study}", *arguments, **environment)

    def planned(self, *targets: str, study: str = TINY) -> Counter:
        """Jobs that a run would start, by rule."""
        done = self.run("--dry-run", "--quiet", "host", "--", *targets, study=study)
        assert done.returncode == 0, done.stderr + done.stdout
        text = done.stdout + done.stderr
        table = re.search(r"^job +count\n-+ +-+\n(?P<rows>.*?)^total", text, re.MULTILINE | re.DOTALL)
        rows = table["rows"].split("\n") if table else []
        return Counter({name: int(count) for name, count in (row.split() for row in rows if row.strip())})


def copy_project(target: Path) -> Checkout:
    """Copy the project, with the kernels that are compiled already, to a path that nobody would choose."""
    target = target.with_name(f"user's own {target.name}")
    target.mkdir(parents=True, exist_ok=True)
    for part in PARTS:
        source = PROJECT / part
        if source.is_dir():
            shutil.copytree(source, target / part, symlinks=True, ignore=shutil.ignore_patterns("*.egg-info"))
        else:
            shutil.copy(source, target / part)
    return Checkout(target)
