"""Who plans a study does not read the benchmarks'; whoever asks for one, a job on a cluster too, finds its rule."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from checkouts import PROJECT, Checkout

from filtercake.study.config.study import Workflow

RULES = PROJECT / "workflow" / "rules"


@pytest.fixture(scope="module")
def asked() -> Callable[..., bool]:
    """The workflow's own function, for the default study; takes the words Snakemake is started with."""
    (text,) = re.findall(r"^def validation_is_asked.*?(?=\n\n\n|\Z)", (RULES / "common.smk").read_text(), re.M | re.S)

    def call(*words: str, program: str = "/x/.venv/bin/snakemake") -> bool:
        names = {
            "STUDIES": {"pmma"},
            "BED_SIZES": ["alum", "alum_full"],
            "VALIDATION": RULES / "validation.smk",
            "settings": Workflow(),
            "sys": SimpleNamespace(argv=[program, *words]),
            "re": re,
            "Path": Path,
        }
        exec(text, names)
        found: bool = names["validation_is_asked"]()
        return found

    return call


@pytest.mark.parametrize(
    "words",
    [
        "-n --cores 2 --latency-wait 5",
        "--config studies=alum,pmma results=benchmark calibrations=speed",
        "results/pmma/summary.csv report calibrate --forcerun figure",
        "--mode subprocess --target-jobs packing:results=results,study=pmma,point=p50_1 --allowed-rules packing",
    ],
)
def test_who_asks_for_studies_does_not_ask_for_validation(asked: Callable[..., bool], words: str) -> None:
    assert not asked(*words.split())
    assert not asked(*words.split(), program="/x/site-packages/snakemake/__main__.py")


@pytest.mark.parametrize(
    "words",
    [
        *[
            "agreement",
            "twin",
            "bed_size",
            "speed",
            "growth",
            "reference",
            "benchmark",
            "stability",
            "choices",
            "coverage",
        ],
        "--until stress",
        "--forcerun=time_growth",
        "results/benchmark_quick/errors/pmma.csv",
        "elsewhere/agreement_alum_embedded/summary.csv",
        "results/alum_full/summary.csv",
        "--target-jobs time_growth:results=results --allowed-rules time_growth",
        "--target-jobs packing:results=results,study=twin_friction,point=p50_1 --allowed-rules packing",
        "--target-jobs packing:results=results,study=alum_full,point=p50_1 --allowed-rules packing",
        "--lint",
        "--list-rules",
        "-l",
    ],
)
def test_who_names_a_target_or_a_job_of_validation_asks_for_it(asked: Callable[..., bool], words: str) -> None:
    assert asked(*words.split())


def test_in_doubt_it_is_asked_for(asked: Callable[..., bool]) -> None:
    assert asked("all", program="/x/a_program_that_calls_snakemake.py")


def test_a_plain_plan_reads_no_benchmark(checkout: Checkout) -> None:
    file = checkout.root / "config" / "benchmarks" / "reference_pmma.yaml"
    file.write_text("titel: no study\n")
    assert checkout.snakemake("--dry-run").returncode == 0
    done = checkout.snakemake("--dry-run", "growth")
    assert done.returncode != 0 and "reference_pmma.yaml: titel = 'no study': unknown key" in done.stdout + done.stderr


def test_a_single_job_finds_its_rule(checkout: Checkout) -> None:
    """As Snakemake starts itself, on a cluster too."""
    for rule, known in (("choices", True), ("coices", False)):
        job = ("--target-jobs", f"{rule}:", "--allowed-rules", rule, "--mode", "subprocess", "--nolock")
        done = checkout.snakemake("--dry-run", *job)
        assert (done.returncode == 0) == known, done.stderr
