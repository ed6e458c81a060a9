"""The fast part of ``make fuzz``: a few hundred inputs, and proof that each bad outcome would be seen."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import fuzzing
import pytest
import watch as watching

from filtercake.errors import ConfigError, Problem

INPUTS = 40
"""Inputs of each kind."""


@pytest.fixture(scope="module")
def fuzz(tmp_path_factory: pytest.TempPathFactory) -> Iterator[fuzzing.Campaign]:
    before = Path.cwd()
    yield fuzzing.Campaign(tmp_path_factory.mktemp("fuzz") / "scratch", seed=2024)
    os.chdir(before)


@pytest.mark.parametrize("kind", fuzzing.KINDS)
def test_every_input_is_loaded_or_refused(fuzz: fuzzing.Campaign, kind: str) -> None:
    counts: Counter[str] = Counter()
    for number in range(INPUTS):
        outcome, said = fuzz.run(kind, fuzz.make(kind, number))
        assert outcome in watching.GOOD, f"{kind} {number}: {outcome}: {said}"
        counts[outcome] += 1
    assert counts["refused"] > 0 and counts["loaded"] > 0


def _raise(error: BaseException) -> None:
    raise error


FILE = "study.yaml"
CASES: dict[str, Callable[[Path], object]] = {
    "traceback": lambda _: _raise(KeyError("x")),
    "unclear": lambda _: _raise(ConfigError([Problem("", "key", "", "is wrong")])),
    "refused": lambda _: _raise(ConfigError([Problem(FILE, "key", "1", "must be 2")])),
    "wrote outside": lambda folder: (folder / "x").write_text("x"),
    "ran something": lambda _: subprocess.run([sys.executable, "-c", "1"], check=False),
    "too much memory": lambda _: bytearray(3 * watching.LARGEST_GROWTH),
    "loaded": lambda _: None,
}


@pytest.mark.parametrize("outcome", CASES)
def test_outcomes_are_told_apart(outcome: str, tmp_path: Path) -> None:
    watch = watching.Watch.install()
    watch.allowed = str(tmp_path / "nothing")
    found, said = watching.outcome_of(lambda: CASES[outcome](tmp_path), watch, (FILE,))
    assert found == outcome, said
    assert not (tmp_path / "x").exists()


def test_an_endless_input_is_too_slow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watching, "WALL_SECONDS", 0.2)

    def forever() -> None:
        while True:
            pass

    assert watching.outcome_of(forever, watching.Watch.install(), (FILE,))[0] == "too slow"
