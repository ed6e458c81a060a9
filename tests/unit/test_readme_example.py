"""The answer that README.md shows is what its commands print."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from documented import blocks, commands_of

from filtercake.cli.commands import main

SHELL = [block for block in blocks("README.md") if block.language == "sh"]
SHOWN = [block.text for block in blocks("README.md") if block.language == "text"]
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def printed(text: str) -> list[tuple[str, list[float]]]:
    """Lines without their numbers, and the numbers."""
    lines = [line for line in text.splitlines() if line]
    # "eq. 3" and "95 %" are words; how long an interval is, and of how many packings, is chance
    return [
        (" ".join(NUMBER.sub("#", line).split()), [float(word) for word in NUMBER.findall(line.split("+-")[0])])
        for line in lines
    ]


@pytest.mark.parametrize(("number", "tolerance"), [(0, 0.05), (1, 1e-3)])
def test_an_answer_is_what_its_command_prints(
    number: int, tolerance: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # other processors order sums otherwise: packings differ within their spread
    monkeypatch.chdir(tmp_path)
    (command,) = commands_of(SHELL[number])
    assert main(command.words[1:]) == 0
    found, shown = printed(capsys.readouterr().out), printed(SHOWN[number])
    assert [words for words, _ in found] == [words for words, _ in shown]
    for (words, values), (_, expected) in zip(found, shown, strict=True):
        if not words.startswith("packings "):
            assert values == pytest.approx(expected, rel=tolerance), words


def test_the_flow_is_what_its_command_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for number in (0, 2):
        (command,) = commands_of(SHELL[number])
        capsys.readouterr()
        assert main(command.words[1:]) == 0
    shown = printed(SHOWN[2])
    found = printed(capsys.readouterr().out)[: len(shown)]
    assert [words for words, _ in found] == [words for words, _ in shown]
    for (words, values), (_, expected) in zip(found, shown, strict=True):
        assert values == pytest.approx(expected, rel=0.08), words
