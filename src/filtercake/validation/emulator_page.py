"""The instant estimate's packings, training and page.

``python -m filtercake.validation.emulator_page`` makes the packings that are not kept yet, trains the models that come
with the package, and writes the page on how far they hold.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final

import pandas as pd

from filtercake.design import emulator_file
from filtercake.figures.style import applied, save
from filtercake.packing.result import publish
from filtercake.validation import emulator_evidence as evidence
from filtercake.validation import pages
from filtercake.validation.emulator_design import compute, members
from filtercake.validation.figures import emulator as figures

PACKINGS, HELD_OUT, MEANS = "emulator_packings.csv", "emulator_held_out.csv", "pressure.csv"
PAGE, IMAGE = "emulator.md", "emulator.png"
DRAW: Final = 1
"""What is held out by default."""
ROUNDS: Final = 34
"""Rounds of the design that are made."""


def write(table: pd.DataFrame, draw: int, options: argparse.Namespace) -> None:
    """Write the table of packings, the models trained on it, figure and page."""
    data = options.docs / "data"
    _publish(table, data / PACKINGS)
    # the models follow from the table as it is stored
    stored = evidence.read_packings(data / PACKINGS)
    emulator_file.write(options.models, {name: evidence.trained(stored, name) for name in evidence.PROTOCOLS})
    emulator_file.shipped.cache_clear()
    held = evidence.held_out(emulator_file.read(options.models), stored, draw)
    _publish(held, data / HELD_OUT)
    options.folder.mkdir(parents=True, exist_ok=True)
    with applied():
        save(figures.draw(held), options.docs / "images" / IMAGE, options.folder / "emulator.pdf")
    with publish(options.docs / PAGE) as temporary:
        temporary.write_text(render(options.template, options.docs, options.models, draw), encoding="utf-8")


def render(template: Path, docs: Path, models: Path, draw: int) -> str:
    """Make the page from the tables in the documentation and the models' file."""
    data = docs / "data"
    return pages.emulator(
        template, evidence.read_packings(data / PACKINGS), pd.read_csv(data / MEANS), emulator_file.read(models), draw
    )


def _publish(table: pd.DataFrame, path: Path) -> None:
    with publish(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.7g")


def main() -> None:
    """Make the packings that are not kept yet, train the models on them, and write tables, figure and page."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="where packings are kept")
    parser.add_argument("--docs", type=Path, required=True, help="the documentation's folder")
    parser.add_argument("--template", type=Path, required=True, help="the page's template")
    parser.add_argument("--models", type=Path, default=emulator_file.MODELS, help="file of the models")
    parser.add_argument("--processes", type=int, default=2, help="processes that compute (default: 2)")
    parser.add_argument("--draw", type=int, default=DRAW, help=f"seed of what is held out (default: {DRAW})")
    parser.add_argument("--redraw", action="store_true", help="take the documentation's table, and pack nothing")
    options = parser.parse_args()
    if options.redraw:
        table = evidence.read_packings(options.docs / "data" / PACKINGS)
    else:
        listed = list(members(options.draw, ROUNDS))
        compute(options.folder, listed, options.processes, lambda line: print(line, flush=True))
        table = evidence.tabulate(options.folder, listed)
    write(table, options.draw, options)


if __name__ == "__main__":
    main()
