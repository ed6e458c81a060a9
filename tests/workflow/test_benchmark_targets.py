"""The benchmarks' targets are planned without an error; they run for too long to be tests."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import pandas as pd
import pytest
from checkouts import Checkout

REPOSITORY = Path(__file__).resolve().parents[2]


JOBS = {
    "agreement": ["compare_engines", "replicates", "packing", "csd"],
    "speed": ["time_in_turn"],
    "growth": ["time_growth", "time_large_beds"],
    "reference": ["gather_references"],
    "benchmark": ["time_variants", "choices", "answers", "coverage", "benchmark_page"],
    "stability": ["stress", "stability_page"],
    "twin": ["repeat_calibrations", "calibrate_apart"],
    "bed_size": ["compare_sizes"],
}


def test_every_benchmark_is_planned(checkout: Checkout) -> None:
    """All of them by one start; a packing for each point of the studies behind them."""
    planned = checkout.planned(*JOBS)
    assert {*JOBS, *chain(*JOBS.values())} <= set(planned)
    assert planned["compare_engines"] == planned["gather_references"] == planned["repeat_calibrations"] == 1
    studies = [path.stem for path in (checkout.root / "config" / "benchmarks").glob("*.yaml")]
    behind = [name for name in studies if name.startswith(("agreement", "reference", "twin"))]
    assert planned["replicates"] == len(behind) + sum(name.startswith("agreement") for name in behind) + 2
    assert planned["packing"] > planned["replicates"]


def test_pages_are_drawn_again_from_the_committed_tables(checkout: Checkout) -> None:
    docs, folder = checkout.root / "docs", checkout.root / "results" / "benchmark_redrawn"
    done = checkout.snakemake("redraw")
    assert done.returncode == 0, done.stdout + done.stderr
    for page, table in {"benchmark.md": "run_time_error.csv", "stability.md": "stability.csv"}.items():
        assert (folder / page).read_text() == (docs / page).read_text()
        pd.testing.assert_frame_equal(pd.read_csv(folder / table), pd.read_csv(docs / "data" / table))
    assert {path.suffix for path in (folder / "images").iterdir()} == {".png", ".pdf"}


@pytest.mark.slow
@pytest.mark.parametrize("target", ["benchmark", "stability"])
def test_quick_benchmarks_run_to_their_pages(target: str, checkout: Checkout) -> None:
    done = checkout.snakemake(target, "--config", "quick=true", timeout=3600)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (checkout.root / "results" / "benchmark_quick" / f"{target}.md").stat().st_size > 3000


def test_a_broken_study_of_bed_sizes_stops_only_their_comparison(checkout: Checkout) -> None:
    study = checkout.root / "config/studies/alum_full.yaml"
    study.write_text(study.read_text().replace("replicates: 1", "replicates: none"))
    done = checkout.snakemake("--dry-run", "bed_size")
    output = done.stdout + done.stderr
    assert done.returncode != 0 and "alum_full.yaml: packing.replicates = 'none': must be a number" in output
    assert "most recent call last" not in output
    assert checkout.run("--dry-run").returncode == 0


def test_calibrate_says_what_to_give(checkout: Checkout) -> None:
    done = checkout.snakemake("--dry-run", "calibrate")
    output = done.stdout + done.stderr
    assert done.returncode != 0 and "most recent call last" not in output
    assert "no calibration is asked for" in output and "allowed: pmma, pmma_filtration, pmma_paper, synthetic" in output


def test_both_engines_make_the_same_points() -> None:
    from filtercake.study.loading import load_study
    from filtercake.study.points import expand, with_engine

    for path in sorted((REPOSITORY / "config" / "benchmarks").glob("agreement_*.yaml")):
        study = load_study(path)
        one, other = (expand(with_engine(study, engine), lambda *_: "") for engine in ("liggghts", "embedded"))
        assert [point.scene.engine for point in one] == ["liggghts"] * len(one)
        for a, b in zip(one, other, strict=True):
            assert a.name != b.name
            assert {**a.scene.as_dict(), "engine": ""} == {**b.scene.as_dict(), "engine": ""}
            assert a.study == f"{path.stem}_liggghts"
