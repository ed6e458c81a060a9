"""The page on the resistance law.

``python -m filtercake.validation.permeability_page`` solves the packings that are not kept yet, and writes it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from filtercake.figures.style import applied, save
from filtercake.packing.result import publish
from filtercake.validation import pages
from filtercake.validation.figures import permeability as figure
from filtercake.validation.permeability import cases, solve_all
from filtercake.validation.resistance_law import by_case, fit_table

TABLE, FITS, SECOND = "permeability.csv", "permeability_fit.csv", "permeability_second_method.csv"
PAGE, IMAGE = "permeability.md", "permeability.png"


def write(table: pd.DataFrame, template: Path, docs: Path, pdf: Path) -> None:
    """Write tables, figure and page into the folder of the documentation, and the figure as PDF elsewhere."""
    _publish(table, docs / "data" / TABLE)
    averages = by_case(pd.read_csv(docs / "data" / TABLE))
    _publish(fit_table(averages), docs / "data" / FITS)
    with applied():
        save(figure.draw(averages), docs / "images" / IMAGE, pdf)
    with publish(docs / PAGE) as temporary:
        temporary.write_text(render(template, docs), encoding="utf-8")


def render(template: Path, docs: Path) -> str:
    """Make the page from the tables in the documentation; without a second method's table it has no section on that."""
    second = docs / "data" / SECOND
    other = pd.read_csv(second) if second.exists() else pd.DataFrame()
    return pages.permeability(template, pd.read_csv(docs / "data" / TABLE), other)


def _publish(table: pd.DataFrame, path: Path) -> None:
    with publish(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.6g")


def main() -> None:
    """Solve all packings that are not kept yet, and write tables, figure and page."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="where solved packings are kept")
    parser.add_argument("--docs", type=Path, required=True, help="the documentation's folder")
    parser.add_argument("--template", type=Path, required=True, help="the page's template")
    parser.add_argument("--redraw", action="store_true", help="take the documentation's table, and solve nothing")
    options = parser.parse_args()
    if options.redraw:
        table = pd.read_csv(options.docs / "data" / TABLE)
    else:
        table = solve_all(options.folder, cases(), lambda line: print(line, flush=True))
    options.folder.mkdir(parents=True, exist_ok=True)
    write(table, options.template, options.docs, options.folder / "permeability.pdf")


if __name__ == "__main__":
    main()
