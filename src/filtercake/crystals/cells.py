"""Cells of a table as some program wrote it: which delimiter, which decimal mark, what is a number, what a range."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from filtercake.errors import CsdError, shown
from filtercake.units import NUMBER
from filtercake.user_files import Unusable, read_text_of_any_program

LARGEST_FILE: Final = 1_000_000
"""Bytes of a file beyond which it is surely not a size distribution."""

DELIMITERS: Final = {"tabs": "\t", "semicolons": ";", "bars": "|", "commas": ","}
"""Characters that part columns, in the order they are looked for; blanks come last."""
BLANKS: Final = "blanks"

_COMMENT = re.compile(r"\s*\"?(#|//)")
_DELIMITER_LINE = re.compile(r"\s*\"?sep=(\\t|.)\"?\s*", re.IGNORECASE)
_HEADER_BLANKS = (r"\s{2,}", r"(?<=[\])])\s+", r"\s+(?![\[(])")
"""How blanks part names of columns, which may hold blanks themselves."""
_GROUPED_BY_BLANKS = re.compile(r"[+-]?[0-9]{1,3}(?:[\s'\u2019][0-9]{3})+(?![0-9])")
_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2}(?:,[0-9]{3})+")
_FIGURE = r"[0-9]+(?:[.,][0-9]+)?(?:[eE][+-]?[0-9]+)?"
_RANGE = re.compile(
    rf"[>=\u2265\s]*({_FIGURE})\s*(?:-|\u2013|\u2014|\.\.+|\u2026|to|bis|[-,;]?\s*<)\s*=?\s*({_FIGURE})"
)
_INTERVAL = re.compile(r"[\[(]\s*([0-9.eE+-]+)\s*[,;]\s*([0-9.eE+-]+)\s*[\])]")
_SIEVED = re.compile(rf"-\s*({_FIGURE})\s*/?\s*\+\s*({_FIGURE})")
_OPEN_BELOW = re.compile(rf"(?:<=?|\u2264|under|below|unter)\s*({_FIGURE})", re.IGNORECASE)
_OPEN_ABOVE = re.compile(rf"(?:>=?|\u2265|over|above|\u00fcber)\s*({_FIGURE})", re.IGNORECASE)


class Line(NamedTuple):
    """A line that holds something.

    Attributes
    ----------
    number : int
        Where it stands, from 1.
    text : str
        What it holds.
    after_gap : bool
        Whether the line above is blank.
    """

    number: int
    text: str
    after_gap: bool


class Decimals(NamedTuple):
    """How a file writes its numbers: its decimal mark, and the one that parts thousands."""

    mark: str
    group: str

    def number(self, text: str) -> float | None:
        """Read a number, None where the text is none; a percent sign behind it is left out."""
        plain = text.strip().removesuffix("%").strip()
        if _GROUPED_BY_BLANKS.match(plain):
            plain = re.sub(r"(?<=[0-9])[\s'\u2019](?=[0-9]{3})", "", plain)
        if self.mark == ",":
            plain = plain.replace(".", "").replace(",", ".")
        elif self.group == ",":
            plain = plain.replace(",", "")
        return float(plain) if NUMBER.fullmatch(plain) else None


def read_lines(path: Path) -> tuple[list[Line], str | None, str]:
    """Read the lines of a file that are neither blank nor comments.

    Returns
    -------
    lines : list of Line
    delimiter : str or None
        What a line ``sep=;`` names.
    encoding : str
        The file's.

    Raises
    ------
    CsdError
        If the file is not text.
    """
    try:
        text, encoding = read_text_of_any_program(path, LARGEST_FILE)
    except Unusable as error:
        raise CsdError(f"{path}: {error}") from None
    lines: list[Line] = []
    delimiter, gap = None, True
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1):
        named = _DELIMITER_LINE.fullmatch(line) if not lines else None
        if named:
            character = "\t" if named[1] == "\\t" else named[1]
            delimiter = next((name for name, known in DELIMITERS.items() if known == character), character)
        elif not line.strip(' \t;,|"\u00a0\ufeff'):
            gap = True
        elif not _COMMENT.match(line):
            lines.append(Line(number, line, gap))
            gap = False
    return lines, delimiter, encoding


def split(path: Path, line: Line, delimiter: str) -> list[str]:
    """Split a line of values.

    Raises
    ------
    CsdError
        If its quotes are not those of a CSV.
    """
    if delimiter == BLANKS:
        return re.sub(r"(?<=[0-9])\s+[-\u2013\u2014]\s+(?=[0-9])", "-", line.text).split()
    character = DELIMITERS.get(delimiter, delimiter)
    if '"' not in line.text:
        return [cell.strip() for cell in line.text.split(character)]
    try:
        return [cell.strip() for cell in next(csv.reader([line.text], delimiter=character, skipinitialspace=True))]
    except csv.Error as error:
        raise CsdError(f"{path}: line {line.number}: is not CSV ({error})") from None


def header_splits(path: Path, line: Line, delimiter: str | None) -> Iterator[tuple[str, list[str]]]:
    """Split a line that may name columns in every way there is (or by the delimiter given): the way, and its cells."""
    for name in [delimiter] if delimiter is not None else DELIMITERS:
        if DELIMITERS.get(name, name) in line.text:
            yield name, split(path, line, name)
    if delimiter is None:
        for blanks in _HEADER_BLANKS:
            yield BLANKS, [cell for cell in re.split(blanks, line.text.strip()) if cell]


def decimals_of(path: Path, cells: Iterable[tuple[int, str]]) -> Decimals:
    """Tell the decimal mark of a file from its cells, each with its line.

    Raises
    ------
    CsdError
        If commas may part decimals or thousands, or both marks are decimal.
    """
    found: dict[str, tuple[int, str]] = {}
    for line, cell in cells:
        text = cell.strip().removesuffix("%").strip()
        ends = _RANGE.fullmatch(text)
        for number in ends.groups() if ends else [text]:
            if re.fullmatch(r"[-+0-9.,eE\s'\u2019]+", number) and re.search("[.,]", number):
                found.setdefault(_says(number), (line, cell))
    comma, other = found.get("comma"), found.get("point") or found.get("thousands")
    if comma and other:
        raise CsdError(
            f"{path}: line {comma[0]}: {shown(comma[1])} has a decimal comma, {shown(other[1])} in line {other[0]} a "
            "decimal point; write one of them"
        )
    if comma:
        return Decimals(",", ".")
    doubt = found.get("comma or thousands")
    if doubt and not other:
        raise CsdError(
            f"{path}: line {doubt[0]}: {shown(doubt[1])} may be a decimal comma or thousands; use a decimal point"
        )
    return Decimals(".", ",")


def _says(text: str) -> str:
    """Say what the marks of one number tell of the others."""
    if "," not in text:
        return "point" if text.count(".") == 1 and not _THOUSANDS.fullmatch(text.replace(".", ",")) else "nothing"
    if "." in text:
        return "comma" if text.rindex(",") > text.rindex(".") else "thousands"
    if _THOUSANDS.fullmatch(text):
        return "thousands" if text.count(",") > 1 else "comma or thousands"
    return "comma"


def range_of(text: str, decimals: Decimals) -> tuple[float, float] | None:
    """Read a class in one cell: ``10-20``, ``10 to 20``, ``(10, 20]``, ``-20+10``, ``<10``, ``>20``; else None."""
    plain = text.strip()
    for pattern, order in ((_RANGE, (1, 2)), (_INTERVAL, (1, 2)), (_SIEVED, (2, 1))):
        found = pattern.fullmatch(plain)
        if found:
            ends = [decimals.number(found[k]) for k in order]
            return (ends[0], ends[1]) if ends[0] is not None and ends[1] is not None else None
    below, above = _OPEN_BELOW.fullmatch(plain), _OPEN_ABOVE.fullmatch(plain)
    if below:
        end = decimals.number(below[1])
        return None if end is None else (0.0, end)
    if above:
        end = decimals.number(above[1])
        return None if end is None else (end, float("inf"))
    return None


def numeric(cells: Sequence[str]) -> bool:
    """Whether a cell holds a number, by either decimal mark."""
    return any(NUMBER.fullmatch(cell.strip().removesuffix("%").replace(",", ".").strip()) for cell in cells)
