"""What the documentation holds for its readers to run or to write: the pages' blocks and commands.

A block of YAML or CSV is a file where the line before it ends in "Write `path`:", and part of a file with
"Add to `path`:"; a block of YAML without either is a piece of a study.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

REPOSITORY = Path(__file__).resolve().parents[2]
TUTORIAL = "docs/tutorial.md"

SHELL = frozenset({"", "sh", "bash", "shell", "console"})
LANGUAGES = SHELL | {"yaml", "python", "csv", "text"}
PROGRAMS = (
    "make",
    "snakemake",
    "filtercake",
    "python",
    "python3",
    "pip",
    "git",
    "sbatch",
    "squeue",
    "scancel",
    "sinfo",
)
"""A code span in prose that starts with one of these and has arguments is a command."""

_FENCE = re.compile(r"^(?P<indent> *)```(?P<language>\w*)[^\n]*\n(?P<text>.*?)^ *```$", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"(?P<verb>[Ww]rite|[Aa]dd to) `(?P<path>[^`\s]+)`:\s*\Z")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page; ``file`` is what it is to be written or added to, empty if nothing says so."""

    page: str
    line: int
    language: str
    text: str
    file: str
    added: bool

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"


@dataclass(frozen=True)
class Command:
    """A command as it is printed on a page, without comments."""

    page: str
    line: int
    text: str

    @property
    def words(self) -> list[str]:
        """Program and arguments, without the variables that may be set before them."""
        found = shlex.split(self.text)
        while found and re.match(r"[A-Z_]+=", found[0]):
            found.pop(0)
        return found

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}: {self.text}"


@cache
def pages() -> list[str]:
    """Pages of the documentation, relative to the repository."""
    found = [
        "README.md",
        "CONTRIBUTING.md",
        "config/README.md",
        *(f"docs/{path.name}" for path in (REPOSITORY / "docs").glob("*.md")),
    ]
    return sorted(found)


@cache
def blocks(page: str) -> list[Block]:
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    return list(blocks_of(page, text))


def blocks_of(page: str, text: str) -> Iterator[Block]:
    for match in _FENCE.finditer(text):
        inner = re.sub(rf"^{match['indent']}", "", match["text"], flags=re.MULTILINE)
        said = _FILE.search(" ".join(text[: match.start()].split()[-12:]))
        yield Block(
            page,
            text.count("\n", 0, match.start()) + 1,
            match["language"],
            inner,
            said["path"] if said else "",
            bool(said) and said["verb"].lower() == "add to",
        )


def commands_of(block: Block) -> list[Command]:
    """Commands of a shell block, one a line; a backslash continues a line."""
    if block.language not in SHELL:
        return []
    lines = block.text.replace("\\\n", " ").splitlines()
    found = [shlex.join(shlex.split(line, comments=True)) for line in lines]
    return [Command(block.page, block.line, text) for text in found if text]


def spans(page: str) -> list[Command]:
    """Commands that stand in the prose, in code spans."""
    text = _FENCE.sub(lambda match: "\n" * match[0].count("\n"), (REPOSITORY / page).read_text(encoding="utf-8"))
    found = []
    for paragraph in re.finditer(r"(?:^[^\n]+\n)+", text + "\n", re.MULTILINE):
        for span in re.finditer(r"`([^`]+)`", paragraph[0]):
            command = Command(
                page, text.count("\n", 0, paragraph.start() + span.start()) + 1, " ".join(span[1].split())
            )
            if _is_command(command):
                found.append(command)
    return found


def _is_command(command: Command) -> bool:
    try:
        words = command.words
    except ValueError:  # an apostrophe: prose
        return False
    return len(words) > 1 and words[0] in PROGRAMS


def commands(page: str) -> list[Command]:
    """All commands of a page, those in its blocks first."""
    return [*(command for block in blocks(page) for command in commands_of(block)), *spans(page)]


def write(block: Block, root: Path) -> Path:
    """Write a block that is a file, or add it to the YAML file that it belongs to."""
    target = root / block.file
    text = block.text
    if block.added:
        before = yaml.safe_load(target.read_text(encoding="utf-8"))
        text = yaml.safe_dump(merged(before, yaml.safe_load(block.text)), sort_keys=False)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(text, encoding="utf-8")
    return target


def merged(before: Any, more: Any) -> Any:
    """Join two YAML values: mappings key by key, anything else is replaced."""
    if not (isinstance(before, dict) and isinstance(more, dict)):
        return more
    return before | {key: merged(before[key], value) if key in before else value for key, value in more.items()}
