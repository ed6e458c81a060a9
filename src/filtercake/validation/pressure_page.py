"""The page on the pressure cell.

``python -m filtercake.validation.pressure_page`` computes the ensembles that are not kept yet, and writes it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from filtercake.figures.style import applied, save
from filtercake.packing.result import publish
from filtercake.validation import pages
from filtercake.validation.figures import pressure as figures
from filtercake.validation.pressure import cases, compute
from filtercake.validation.pressure_evidence import averages, columns, friction_series, led, read_cells

CELLS, MEANS = "pressure_cells.csv", "pressure.csv"
PAGE, LOAD_IMAGE, FRICTION_IMAGE = "pressure.md", "pressure_load.png", "pressure_friction.png"
COLUMN_IMAGE = "pressure_column.png"


def write(table: pd.DataFrame, template: Path, docs: Path, pdf: Path) -> None:
    """Write tables, figures and page into the folder of the documentation, and the figures as PDF into another."""
    _publish(table, docs / "data" / CELLS)
    cells = read_cells(docs / "data" / CELLS)
    means = averages(cells)
    _publish(means, docs / "data" / MEANS)
    with applied():
        save(figures.draw_load(led(cells)), docs / "images" / LOAD_IMAGE, pdf / "load.pdf")
        save(figures.draw_friction(friction_series(means)), docs / "images" / FRICTION_IMAGE, pdf / "friction.pdf")
        if not (found := columns(cells)).empty:
            save(figures.draw_columns(found), docs / "images" / COLUMN_IMAGE, pdf / "column.pdf")
    with publish(docs / PAGE) as temporary:
        temporary.write_text(render(template, docs), encoding="utf-8")


def render(template: Path, docs: Path) -> str:
    """Make the page from the table of cells in the documentation."""
    return pages.pressure(template, read_cells(docs / "data" / CELLS))


def _publish(table: pd.DataFrame, path: Path) -> None:
    with publish(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.6g")


def main() -> None:
    """Compute all ensembles that are not kept yet, and write tables, figures and page."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="where computed cells are kept")
    parser.add_argument("--docs", type=Path, required=True, help="the documentation's folder")
    parser.add_argument("--template", type=Path, required=True, help="the page's template")
    parser.add_argument("--processes", type=int, default=2, help="processes that compute (default: 2)")
    parser.add_argument("--redraw", action="store_true", help="take the documentation's table, and compute nothing")
    options = parser.parse_args()
    if options.redraw:
        table = pd.read_csv(options.docs / "data" / CELLS)
    else:
        table = compute(options.folder, cases(), options.processes, lambda line: print(line, flush=True))
    options.folder.mkdir(parents=True, exist_ok=True)
    write(table, options.template, options.docs, options.folder)


if __name__ == "__main__":
    main()
