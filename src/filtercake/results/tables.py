"""Tables of the results, read back: names stay text, whatever they look like."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import pandas as pd

NAMES: Final = ("point", "study", "csd", "label", "kinetics")
"""Columns of what users named: 01, NA, null, 1e5 and nan among them."""

BLANK: Final = ("", "nan", "NaN")
"""How a missing value is written elsewhere."""


def read_table(path: str | Path) -> pd.DataFrame:
    """Read a table of the results; its columns of names hold text, as it was written.

    Raises
    ------
    OSError, ValueError
        If it cannot be read.
    """
    import pandas as pd  # who plans a study reads no table

    columns = pd.read_csv(path, nrows=0).columns
    return pd.read_csv(
        path,
        dtype=dict.fromkeys(columns.intersection(list(NAMES)), str),
        keep_default_na=False,
        na_values={column: list(BLANK) for column in columns.difference(list(NAMES))},
    )
