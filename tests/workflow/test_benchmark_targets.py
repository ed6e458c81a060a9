"""The benchmarks' targets are planned without an error; they run for too long to be tests."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("target", "jobs"),
    [
        ("agreement", ["compare_engines", "replicates", "packing", "csd"]),
        ("speed", ["time_in_turn"]),
        ("growth", ["time_growth"]),
        ("reference", ["gather_references", "replicates", "packing"]),
        ("benchmark", ["time_variants", "choices", "coverage", "benchmark_page"]),
        ("stability", ["stress", "stability_page"]),
    ],
)
def test_a_benchmark_is_planned(target: str, jobs: list[str], tmp_path: Path) -> None:
    command = [sys.executable, "-m", "snakemake", "--dry-run", "--quiet", "rules", "--cores", "2", target]
    command += ["--config", f"results={tmp_path / 'results'}"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert all(job in done.stdout + done.stderr for job in jobs)


def test_both_engines_make_the_same_points() -> None:
    from filtercake.config_loading import load_study
    from filtercake.study import expand, with_engine

    for path in sorted((REPOSITORY / "config" / "benchmarks").glob("agreement_*.yaml")):
        study = load_study(path)
        one, other = (expand(with_engine(study, engine), lambda _csd, _n: "") for engine in ("liggghts", "embedded"))
        assert [point.spec.engine for point in one] == ["liggghts"] * len(one)
        for a, b in zip(one, other, strict=True):
            assert a.name != b.name
            assert {**a.spec.as_dict(), "engine": ""} == {**b.spec.as_dict(), "engine": ""}
            assert a.study == f"{path.stem}_liggghts"
