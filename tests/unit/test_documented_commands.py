"""Every command of docs/command-line.md and every example of docs/api.md runs as it is printed."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from filtercake import engine_choice
from filtercake.cli import build_parser, main
from filtercake.config_loading import load_study
from filtercake.study import expand

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / "docs" / "command-line.md").read_text(encoding="utf-8")
API = (REPOSITORY / "docs" / "api.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```python\n(.*?)```", API, flags=re.DOTALL)


def commands() -> list[list[str]]:
    blocks = re.findall(r"```sh\n(.*?)```", PAGE, flags=re.DOTALL)
    return [shlex.split(line) for block in blocks for line in block.splitlines() if line.strip()]


def test_the_commands_run_one_after_the_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "config" / "test"
    shutil.copytree(REPOSITORY / "config" / "test", folder)
    point = expand(load_study(folder / "tiny.yaml"), engine_choice.choose)[0].name
    for program, *words in commands():
        assert program == "filtercake"
        assert main([point if word == "POINT" else word for word in words]) == 0, " ".join(words)


def test_the_page_shows_every_command() -> None:
    (choices,) = (action.choices for action in build_parser()._actions if action.dest == "command")
    assert choices is not None
    assert set(choices) == {words[1] for words in commands()}


def test_there_are_three_examples() -> None:
    assert len(EXAMPLES) == 3


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_runs(
    example: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "docs/api.md", "exec"), {})
    assert capsys.readouterr().out
