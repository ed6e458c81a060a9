"""Every command of the documentation is run, every block of YAML is loaded and every block of Python executed.

All commands in README.md, CONTRIBUTING.md, config/README.md and docs/*.md are found by themselves, in blocks and in
code spans (:mod:`documented`). Those of the ``filtercake`` command line run as they are printed; a ``make`` target must
exist and what it asks Snakemake for must be planned without an error, and so must what the pages ask Snakemake for. A
command that is none of these stands in :data:`RUN_BY`, beside the test that runs it.
"""

from __future__ import annotations

import doctest
import importlib
import importlib.util
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import yaml
from documented import (
    LANGUAGES,
    REPOSITORY,
    SHELL,
    TUTORIAL,
    Block,
    Command,
    blocks,
    blocks_of,
    commands,
    commands_of,
    merged,
    pages,
    spans,
    write,
)
from snakemake.cli import get_argument_parser

from filtercake.calibration.config import Calibration, load_calibration
from filtercake.calibration.measurements import load_measurements
from filtercake.cli.commands import EXAMPLES as HELP_EXAMPLES
from filtercake.cli.commands import build_parser, main
from filtercake.crystals.crystallizer import load_kinetics
from filtercake.design.costs import load_correlations
from filtercake.design.loading import load_designs
from filtercake.errors import ConfigError
from filtercake.study import engine_choice
from filtercake.study.loading import load_study, load_workflow
from filtercake.study.points import expand

CLUSTER = "docs/cluster.md"
CLUSTER_TEST = "tests/slurm/test_slurm.py::test_the_commands_of_the_page"
TUTORIAL_TEST = "tests/unit/test_tutorial.py::test_a_clean_clone_follows_the_tutorial"

RUN_BY = {
    # page, how the command starts: the test that runs it
    (TUTORIAL, "git clone"): TUTORIAL_TEST,
    (TUTORIAL, "cd"): TUTORIAL_TEST,
    (TUTORIAL, "."): TUTORIAL_TEST,
    (TUTORIAL, "timeout"): TUTORIAL_TEST,
    (TUTORIAL, "filtercake"): TUTORIAL_TEST,
    ("README.md", "filtercake"): "tests/unit/test_readme_example.py::test_an_answer_is_what_its_command_prints",
    (CLUSTER, "."): CLUSTER_TEST,
    (CLUSTER, "squeue"): CLUSTER_TEST,
}
"""Commands that this file does not run itself."""

FOLLOWED = {TUTORIAL: TUTORIAL_TEST}
"""Pages whose commands need the results of those before them, and are followed as a whole by a test of their own."""

STAND_INS = {
    "path/to/my_study.yaml": "config/studies/pmma.yaml",
    "<name>": "pmma",
    "...": "pmma",
    "STUDY": "config/test/tiny.yaml",
    "FOLDER": "a_folder",
    "K": "1",
}
"""What is put for the words that a reader replaces; POINT is a point of the tiny study."""

QUICK = ["--engine", "embedded"]
SMALL = ["--particles", "200", "--replicates", "2"]
"""Added to a packing, the second where its size is not printed, so that it takes a second."""

PARTS = ("Snakefile", "Makefile", "config", "workflow", "profiles", "liggghts_templates", "src")
API_PAGE = "docs/api.md"

STUDY = {
    "csds": {
        "bimodal": {"mixture": [{"size_um": 20, "volume_fraction": 0.5}, {"size_um": 50, "volume_fraction": 0.5}]}
    },
    "material": {"density_kg_m3": 1180},
    "sweeps": [{"csd": "bimodal"}],
}
"""A study that a piece of one is put into."""

EVERY_COMMAND = [command for page in pages() for command in commands(page)]
MAKE = [command for command in EVERY_COMMAND if command.words[0] == "make"]
SNAKEMAKE = [command for command in EVERY_COMMAND if command.words[0] == "snakemake"]


def runner(command: Command) -> str | None:
    """Where a command is run; None if nowhere."""
    for (page, start), test in RUN_BY.items():
        if command.page == page and command.words[: len(start.split())] == start.split():
            return test
    program, *words = command.words
    if program in ("make", "snakemake"):
        return f"{program} below"
    if program == "filtercake" or (program.startswith("python") and words[:2] == ["-m", "filtercake"]):
        return "test_a_page_runs"
    return None


def replaced(words: list[str], stand_ins: dict[str, str] = STAND_INS) -> list[str]:
    """Put stand-ins for the words that a reader replaces, also behind the = of NAME=word."""
    found = []
    for word in words:
        name, equals, value = word.rpartition("=")
        found.append(name + equals + stand_ins.get(value, value))
    return found


def test_every_block_says_its_language() -> None:
    wrong = [block.place for page in pages() for block in blocks(page) if block.language not in LANGUAGES]
    assert not wrong, f"a block's language must be one of {sorted(LANGUAGES)}"


def test_every_command_is_run() -> None:
    nowhere = [command.place for command in EVERY_COMMAND if runner(command) is None]
    assert not nowhere, "no test runs these commands; add the one that does to RUN_BY:\n" + "\n".join(nowhere)


def test_the_table_names_tests_and_commands_that_exist() -> None:
    for (page, start), test in RUN_BY.items():
        file, _, name = test.partition("::")
        assert re.search(rf"def {re.escape(name)}\b", (REPOSITORY / file).read_text(encoding="utf-8")), test
        if (REPOSITORY / page).exists():
            here = [command for command in commands(page) if shlex.join(command.words).startswith(start)]
            assert here, f"{page} has no command {start!r}: remove it from RUN_BY"


def test_a_command_that_nobody_runs_is_noticed() -> None:
    text = "Do this:\n\n```sh\nrm -rf results  # all of it\nmake clean\n```\n\n    ```\n    sbatch job.sh\n    ```\n"
    found = [command for block in blocks_of("docs/x.md", text) for command in commands_of(block)]
    assert [command.text for command in found] == ["rm -rf results", "make clean", "sbatch job.sh"]
    assert [runner(command) for command in found] == [None, "make below", None]


@pytest.mark.parametrize("page", pages())
def test_links_lead_somewhere(page: str) -> None:
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)|src=\"([^\":]+)\"", text):
        path = (REPOSITORY / page).parent / (target[0] or target[1])
        assert path.exists(), f"{page}: {path}"


# --- make and snakemake: every target exists, and one dry run plans all they ask for


@dataclass
class Asked:
    """What the pages ask Snakemake for, gathered."""

    targets: set[str] = field(default_factory=set)
    config: dict[str, set[str]] = field(default_factory=dict)

    def add(self, words: list[str]) -> None:
        """Add a command's targets and settings; ends the test where Snakemake does not know an option."""
        options = get_argument_parser().parse_args(words)
        self.targets |= set(options.targets)
        for setting in options.config or []:
            key, _, value = setting.partition("=")
            self.config.setdefault(key, set()).update(value.split(","))


def ask_make(command: Command, root: Path) -> list[list[str]]:
    """Commands that a make target would run."""
    words = [word for word in replaced(command.words[1:]) if word != "-n"]
    done = subprocess.run(["make", "-n", *words], cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command.place}: {done.stderr}"
    lines = done.stdout.replace("\\\n", " ").splitlines()
    return [shlex.split(re.split(r"\s(?:\|\||>|2>)", line)[0]) for line in lines if line.strip()]


def check_tool(words: list[str], place: str, root: Path) -> None:
    """A command that a make target runs, other than Snakemake, must be there."""
    program = words[0]
    if program == ".venv/bin/python":
        known = (root / words[1]).exists() or (words[1] == "-m" and importlib.util.find_spec(words[2]) is not None)
        assert known, f"{place}: {words}"
    elif program.startswith(".venv/bin/"):
        assert shutil.which(Path(program).name, path=Path(sys.executable).parent), f"{place}: {words}"
    elif "/" in program:
        assert (root / program).exists(), f"{place}: {words}"


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the project that holds the files of every page."""
    root = tmp_path_factory.mktemp("documented") / "project"
    for part in PARTS:
        source = REPOSITORY / part
        if source.is_dir():
            shutil.copytree(source, root / part, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        else:
            root.mkdir(exist_ok=True)
            shutil.copy(source, root / part)
    for part in ("docs", "tests"):
        (root / part).symlink_to(REPOSITORY / part)
    for page in pages():
        for block in blocks(page):
            if block.file:
                write(block, root)
            elif block.language == "python" and page != API_PAGE and "results/" not in block.text:
                execute(block, root)
    return root


def execute(block: Block, folder: Path) -> str:
    """Run a block of Python in a process of its own; returns what it prints."""
    done = subprocess.run(
        [sys.executable, "-c", block.text], cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, f"{block.place}:\n{done.stderr}"
    return done.stdout


def test_make_has_every_target_and_snakemake_plans_it(project: Path) -> None:
    asked = Asked()
    for command in {shlex.join(command.words): command for command in MAKE}.values():
        for words in ask_make(command, project):
            if words[0].endswith("/snakemake"):
                asked.add(words[1:])
            else:
                check_tool(words, command.place, project)
    for command in SNAKEMAKE:
        asked.add(replaced(command.words[1:]))
    for value in asked.config.pop("results", set()) | asked.config.pop("quick", set()):
        assert value in ("/data/results", "true")
    load_workflow({key: sorted(values) for key, values in asked.config.items()}, "the pages")
    planned = dry_run(project, asked)
    assert {target for target in asked.targets if "/" not in target} <= set(planned), planned
    assert planned["packing"] > 100


def dry_run(root: Path, asked: Asked) -> dict[str, int]:
    """Jobs by rule that Snakemake plans for all that is asked, in one dry run."""
    config = [f"{key}={','.join(without_path_twice(values))}" for key, values in sorted(asked.config.items())]
    targets = ["all", *sorted(asked.targets)]
    command = [sys.executable, "-m", "snakemake", *targets, "--dry-run", "--cores", "2", "--quiet", "rules", "host"]
    done = subprocess.run(
        [*command, "--config", *config],
        cwd=root,
        env={
            "PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin",
            "PYTHONPATH": str(root / "src"),
            "HOME": str(root),
        },
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    text = done.stdout + done.stderr
    assert done.returncode == 0, text
    table = re.search(r"^job +count\n-+ +-+\n(?P<rows>.*?)^total", text, re.MULTILINE | re.DOTALL)
    assert table is not None, text
    return {name: int(count) for name, count in (row.split() for row in table["rows"].strip().splitlines())}


def without_path_twice(values: set[str]) -> list[str]:
    """Studies, each once: a path is left out where the same study is named too."""
    names = {Path(value).stem: value for value in sorted(values, key=lambda value: "/" not in value)}
    return sorted(names.values())


# --- the filtercake command line, YAML and Python: every page, block by block


def load(path: Path, root: Path) -> None:
    """Check a file in the place it belongs to."""
    studies = root / "config" / "studies"
    loaders: dict[str, Callable[[Path], object]] = {
        "config/studies": lambda file: load_designs([load_study(file)]),
        "config/measurements": load_measurements,
        "config/calibrations": lambda file: load_calibration(file, studies),
        "config": load_kinetics,
        "config/kinetics": load_kinetics,
        "config/costs": load_correlations,
    }
    loaders[str(path.parent.relative_to(root))](path)


def load_piece(block: Block, root: Path) -> None:
    """Check a block of YAML that names no file: a whole calibration, or a piece of a study."""
    target = root / "config" / "studies" / "piece_of_a_page.yaml"
    write(Block(block.page, block.line, "yaml", block.text, str(target), False), root)
    values = yaml.safe_load(target.read_text(encoding="utf-8"))
    if set(values) <= set(Calibration.model_fields) and "measurements" in values:
        path = root / "config" / "calibrations" / "of_a_page.yaml"
        target.rename(path)
        load(path, root)
        return
    target.write_text(yaml.safe_dump(merged(STUDY, values)), encoding="utf-8")
    load_study(target)
    target.unlink()


def command_names() -> set[str]:
    """Names of the commands that filtercake has."""
    (choices,) = (action.choices for action in build_parser()._actions if action.dest == "command")
    return set(choices or ())


def run(command: Command, point: str) -> None:
    words = command.words[1:] if command.words[0] == "filtercake" else command.words[3:]
    if len(words) < 2:  # its name, in prose
        assert set(words) <= command_names(), command.place
        return
    words = replaced(words, {**STAND_INS, "POINT": point})
    if words[0] == "pack":
        words += QUICK if "--particles" in words else [*QUICK, *SMALL]
    if "--output" in words[:-1]:  # an export's folder must be new
        shutil.rmtree(words[words.index("--output") + 1], ignore_errors=True)
    assert main(words) == 0, command.place


def runs_here(page: str) -> bool:
    return page not in FOLLOWED


@pytest.mark.parametrize("page", pages())
def test_a_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(REPOSITORY / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    point = expand(load_study(Path("config/test/tiny.yaml")), engine_choice.choose)[0].name
    for block in blocks(page):
        if block.file:
            path = write(block, tmp_path)
            if block.language == "yaml":
                load(path, tmp_path)
        elif block.language == "yaml":
            load_piece(block, tmp_path)
        elif block.language == "python" and runs_here(page) and page != API_PAGE:
            execute(block, tmp_path)
        elif runs_here(page):
            for command in filtercake_commands(commands_of(block)):
                run(command, point)
    if runs_here(page):
        for command in filtercake_commands(spans(page)):
            run(command, point)


def filtercake_commands(found: list[Command]) -> Iterator[Command]:
    return (command for command in found if runner(command) == "test_a_page_runs")


def test_a_piece_with_a_wrong_key_is_noticed(tmp_path: Path) -> None:
    (tmp_path / "config" / "studies").mkdir(parents=True)
    (block,) = blocks_of("docs/x.md", "So:\n\n```yaml\npacking:\n  replicate: 3\n```\n")
    with pytest.raises(ConfigError, match="did you mean replicates"):
        load_piece(block, tmp_path)


def test_the_page_of_the_command_line_shows_every_command() -> None:
    shown = {command.words[1] for block in blocks("docs/command-line.md") for command in commands_of(block)}
    assert command_names() == shown


def test_the_examples_in_the_help_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for part in ("test", "measurements"):
        shutil.copytree(REPOSITORY / "config" / part, tmp_path / "config" / part)
    monkeypatch.chdir(tmp_path)
    tiny = "config/test/tiny.yaml"
    point = expand(load_study(Path(tiny)), engine_choice.choose)[0].name
    asked = {"pmma": tiny, "config/studies/pmma.yaml": tiny, "pmma_50_s50_mu0_1a2b3c4d": point, "0.003": "0.1"}
    assert set(HELP_EXAMPLES) == command_names()
    for name, text in HELP_EXAMPLES.items():
        program, *words = shlex.split(text)
        small = [*QUICK, "--particles", "200"] if name == "pack" else []
        assert program == "filtercake"
        assert main([asked.get(word, word) for word in words] + small) == 0, text


def test_docstrings_hold_no_example_that_nobody_runs() -> None:
    """Examples are on the pages; one in a docstring (``>>>``) must pass as a doctest."""
    for path in sorted((REPOSITORY / "src" / "filtercake").rglob("*.py")):
        if ">>>" in path.read_text(encoding="utf-8"):
            name = ".".join(path.relative_to(REPOSITORY / "src").with_suffix("").parts)
            assert doctest.testmod(importlib.import_module(name)).failed == 0, path


EXAMPLES = [block for block in blocks(API_PAGE) if block.language == "python"]


def test_there_are_five_examples() -> None:
    assert len(EXAMPLES) == 5


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda block: block.place)
def test_an_example_runs(
    example: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(example.text, example.place, "exec"), {})
    assert capsys.readouterr().out


def test_shell_blocks_are_those_of_the_readers_terminal() -> None:
    """Blocks of text and data hold no commands; all others do."""
    for page in pages():
        for block in blocks(page):
            assert bool(commands_of(block)) == (block.language in SHELL), block.place
