"""A clean clone follows the tutorial from the first command to the last, and finds what the page shows."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest
from documented import REPOSITORY, SHELL, TUTORIAL, Block, blocks, commands_of, spans, write

KEPT = re.compile(r"cd |\. |export ")
"""What a command changes in the terminal, and what the commands after it must therefore repeat."""
STOPPED = 124
"""Exit status of ``timeout`` when it had to stop the command."""


def masked(text: str) -> set[str]:
    """Lines of an output without what differs from run to run and machine to machine: numbers and spaces."""
    lines = (re.sub(r"_[0-9a-f]{8}\b", "_#", line) for line in text.splitlines())
    return {" ".join(re.sub(r"-?\d+(\.\d+)?(e[+-]?\d+)?", "#", line).split()) for line in lines}


class Reader:
    """Somebody who has the page and a terminal, and does what it says."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.kept: list[str] = []
        self.seen = ""

    @property
    def clone(self) -> Path:
        return self.folder / "filtercake"

    def follow(self, block: Block) -> None:
        if block.file:
            write(block, self.clone)
        elif block.language in SHELL:
            self.seen = "".join(self.type(command.text) for command in commands_of(block))
        elif block.language == "python":
            script = self.folder / "pasted.py"
            script.write_text(block.text, encoding="utf-8")
            self.seen = self.type(f"python {script}")
        elif block.language == "text":
            missing = masked(block.text) - masked(self.seen)
            assert not missing, f"{block.place}: not in the output: {missing}\n{self.seen}"

    def type(self, command: str) -> str:
        command = command.replace("URL", str(REPOSITORY)).replace("POINT", self.point())
        if KEPT.match(command):
            self.kept.append(command)
            return ""
        environment = {name: value for name, value in os.environ.items() if name not in ("VIRTUAL_ENV", "PYTHONPATH")}
        done = subprocess.run(
            ["bash", "-c", "\n".join(["set -e", *self.kept, command])],
            cwd=self.folder,
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=3600,
            check=False,
        )
        print(f"$ {command}\n{done.stdout}")
        allowed = (0, STOPPED) if command.startswith("timeout ") else (0,)
        assert done.returncode in allowed, f"{command} ended with {done.returncode}:\n{done.stdout}"
        return done.stdout

    def point(self) -> str:
        summary = self.clone / "results" / "salt" / "summary.csv"
        return str(pd.read_csv(summary)["point"][0]) if summary.exists() else ""


@pytest.mark.slow
def test_a_clean_clone_follows_the_tutorial(tmp_path: Path) -> None:
    if not (REPOSITORY / ".git").exists() or shutil.which("git") is None:
        pytest.skip("no git repository to clone")
    reader = Reader(tmp_path)
    for block in blocks(TUTORIAL):
        reader.follow(block)
    in_prose = [
        command for command in spans(TUTORIAL) if command.words[1:2] == ["report"] or "STUDIES=" in command.text
    ]
    for command in in_prose:
        if subprocess.run(["make", "-n", *command.words[1:]], cwd=reader.clone, capture_output=True).returncode == 0:
            reader.type(command.text)
    shown = pd.read_csv(reader.clone / "results" / "salt" / "summary.csv")
    assert (shown["interval_reached"] == "yes").all()
    assert (shown["porosity_ci95"] <= 0.0015).all()


def test_an_output_that_the_program_does_not_give_is_noticed() -> None:
    assert masked("porosity 0.364 +- 1e-3\n") == masked("porosity   0.4 +- 0.002")
    assert masked("porosity 0.364") != masked("voidage 0.364")
    reader = Reader(Path("nowhere"))
    reader.seen = "porosity 0.36\nresistance 1e9 m/kg"
    reader.follow(Block("page", 1, "text", "resistance 2.0e+09 m/kg\n", "", False))
    with pytest.raises(AssertionError, match="not in the output"):
        reader.follow(Block("page", 1, "text", "resistance 2 m/kg and more\n", "", False))
