"""The page on the pressure cell.

``python -m filtercake.validation.pressure_page`` computes the ensembles that are not kept yet, and writes it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from filtercake.validation.pressure import cases, compute


def main() -> None:
    """Compute all ensembles that are not kept yet, and write tables, figures and page."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="where computed cells are kept")
    parser.add_argument("--docs", type=Path, required=True, help="the documentation's folder")
    parser.add_argument("--template", type=Path, required=True, help="the page's template")
    parser.add_argument("--processes", type=int, default=2, help="processes that compute")
    options = parser.parse_args()
    compute(options.folder, cases(), options.processes, lambda line: print(line, flush=True))


if __name__ == "__main__":
    main()
