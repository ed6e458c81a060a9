"""Tables of the results keep the names in them as text."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from filtercake.results.tables import NAMES, read_table

HOSTILE = ["01", "NA", "null", "nan", "1e5", "None", "007", "2024_05", "true"]


@pytest.mark.parametrize("column", NAMES)
def test_names_come_back_as_they_were_written(tmp_path: Path, column: str) -> None:
    table = pd.DataFrame({column: HOSTILE, "porosity": [0.4, np.nan] + [0.3] * 7, "n": range(9)})
    table.to_csv(tmp_path / "t.csv", index=False)
    again = read_table(tmp_path / "t.csv")
    assert again[column].tolist() == HOSTILE
    assert again["porosity"].isna().tolist() == [False, True] + [False] * 7
    assert again["n"].tolist() == list(range(9))


def test_missing_numbers_and_reasons_are_missing(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("point,reason,x\na,,nan\nb,broke,2\n")
    table = read_table(tmp_path / "t.csv")
    assert table["reason"].isna().tolist() == [True, False]
    assert table["x"].isna().tolist() == [True, False]
