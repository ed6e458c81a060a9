"""Size distributions as people have them: tables of sieves, laser diffraction, image analysis and spreadsheets.

A file is read as classes of (diameter, volume fraction), with words that say what was understood. What may be meant in
two ways is refused, with the likely cause and the cure. Sources: ISO 9276-1 (shares per class, densities and cumulative
distributions by number, surface and volume), ISO 9276-2 (numbers become volumes by x ~ n d^3, surfaces by x ~ s d). A
class between two sizes has their geometric middle.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from filtercake.crystals.cells import (
    BLANKS,
    DELIMITERS,
    Decimals,
    Line,
    decimals_of,
    header_splits,
    numeric,
    range_of,
    read_lines,
    split,
)
from filtercake.crystals.column_names import (
    EXACT,
    MASS_UNITS,
    PERCENT_UNITS,
    Column,
    columns_of,
    is_header,
    is_unit,
    merged,
    per_size_unit,
    unit_of,
)
from filtercake.crystals.csd import MOST_CLASSES, SUM_TOLERANCE
from filtercake.errors import CsdError, shown
from filtercake.units import FRACTION_UNITS, LENGTH_UNITS, MICROMETRE, FloatArray

MOST_UNSEEN: Final = 1e-3
"""Share below the smallest or above the largest size of a cumulative distribution that may be left out."""

ROUNDING: Final = 2e-3
"""Difference of cumulative shares, of the whole, that is rounding."""

DENSITY_TOLERANCE: Final = 0.1
"""How far off 1 (or 100 %) the integral of a density may be."""

WIDE_CLASS: Final = 2.5
"""Upper over lower edge beyond which a class is said to be wide."""

FEWEST_GRID_SIZES: Final = 5
"""Sizes in equal steps that are taken for the series of an instrument or of sieves."""
GRID_STEPS: Final = (0.02, 0.8)
"""Steps of such a series, in natural logarithms."""
GRID_TOLERANCE: Final = 0.06
"""How far off the series a size may be, in steps."""

HEADER_LINES: Final = 200
"""Lines among which the names of the columns must be."""
HEADER_HEIGHT: Final = 3
"""Lines that the names of the columns may take."""
HEADER_CELLS: Final = 2000
"""Cells of such a line that are looked at."""

_POWER: Final = {"volume": 0, "surface": 1, "length": 2, "number": 3}
"""Volume over quantity goes as this power of the size."""
_SUMS: Final = ("under", "over", "cumulative")
"""Kinds of cumulative columns."""
_WANTED = "(for example size_um,volume_fraction)"
_NO_CLASS = "holds no class; the first line names the columns, each further line is a class"
_FOOTER = re.compile(
    r"total|sum\b|summe|\u03a3|mean|mode|median|average|std|span|d\s*[\[(]|d[0-9(]|x[0-9(]|end\b|date|operator|remark"
    r"|note|comment|gesamt",
    re.IGNORECASE,
)
_PAN = re.compile(r"pan|bottom|boden|receiver|rest\b|fines", re.IGNORECASE)
_WIDE_FORM = re.compile(r"(between|below)[^()]*sizes?\s*\(\s*sizes? in ([^\s)]+)\s*\)", re.IGNORECASE)
_RESULT_TYPE = re.compile(r"(result )?(transform )?type", re.IGNORECASE)
_PAN_CURE = (
    "what passed the finest sieve (the pan), or lies in an open class, has no size, but fines decide the resistance "
    "(x/d^2): give it a size, by laser diffraction or about half the finest one; or leave it out and scale the rest"
)
_EDGES_CURE = (
    "if these are lower edges, add a last line with the upper edge of the last class and no share; if upper edges, a "
    "first line with the lower edge of the first class and no share; if middles, name the column size_middle_um"
)


class Classes(NamedTuple):
    """What a file of a size distribution holds.

    Attributes
    ----------
    size : ndarray, shape (n,)
        Diameters, m.
    volume_fraction : ndarray, shape (n,)
        Volume fractions.
    understood : str
        How the file was read, in words.
    """

    size: FloatArray
    volume_fraction: FloatArray
    understood: str


class _Row(NamedTuple):
    line: Line
    cells: list[str]

    def cell(self, index: int) -> str:
        return self.cells[index] if index < len(self.cells) else ""


class _Header(NamedTuple):
    """Names of columns, the rows below them, and what parts their cells."""

    cells: list[str]
    columns: list[Column]
    rows: list[_Row]
    way: str


class _Spread(NamedTuple):
    """Classes with what they hold.

    ``lower`` and ``upper`` are edges in m, shape (n,), the same where a class is known by its middle; ``line`` is where
    a class stands.
    """

    lower: FloatArray
    upper: FloatArray
    share: FloatArray
    line: list[Line]
    words: str

    @property
    def middle(self) -> FloatArray:
        """Geometric middles, m."""
        between = np.sqrt(np.abs(self.lower)) * np.sqrt(np.abs(self.upper))
        return np.where(self.lower == self.upper, self.lower, between)


class _Found(NamedTuple):
    """Classes, the basis of their shares (a key of ``_POWER``), and what else was understood."""

    spread: _Spread
    basis: str
    notes: list[str]


def read_classes(path: Path) -> Classes:
    """Read the classes of a size distribution from a file of a spreadsheet or an instrument.

    Parameters
    ----------
    path : Path
        Columns of sizes (middles, edges, ``10-20``, or from and to) and of shares (volume, mass, surface or number; per
        class, cumulative, or per size), by name; or a Mastersizer's row of classes.

    Raises
    ------
    CsdError
        If the file cannot be read, or may mean more than one distribution: with file, line, value and cure.
    """
    lines, delimiter, encoding = read_lines(path)
    for line in lines[:HEADER_LINES]:
        if re.search(r"\bchord|FBRM", line.text, re.IGNORECASE):
            raise _wrong(path, line, "chord lengths (FBRM) are not diameters; measure the sizes by another method")
    if len(lines) < 2:
        raise CsdError(f"{path}: {_NO_CLASS}")
    if len(lines) - 1 > MOST_CLASSES:
        raise CsdError(f"{path}: {len(lines) - 1} classes: must be at most {MOST_CLASSES}")
    with np.errstate(all="ignore"):  # numbers beyond all sizes are refused where they become a distribution
        return _understood(path, lines, delimiter, encoding)


def _understood(path: Path, lines: list[Line], delimiter: str | None, encoding: str) -> Classes:
    found = _wide(path, lines, delimiter)
    if found is None:
        found = _named(path, _across(path, lines, delimiter) or _down(path, lines, delimiter))
    spread, basis, notes = _placed(path, found.spread), found.basis, found.notes
    share, size = spread.share, spread.middle
    if _POWER[basis]:
        share = share * np.where(share != 0.0, size, 1.0) ** _POWER[basis]
        share = share / np.sum(share)
        notes = [f"volumes from x ~ {basis} d^{_POWER[basis]}", *notes]
    kept = (share != 0.0) | ((size > 0.0) & np.isfinite(size))
    empty = int(np.sum(share == 0.0))
    counted = f"{share.size - empty} classes" + (f", {empty} empty ones dropped" if empty else "")
    written = [] if encoding == "utf-8" else [{"cp1252": "Windows-1252"}.get(encoding, encoding.upper())]
    return Classes(size[kept], share[kept], "; ".join([spread.words, *notes, counted, *written]))


def _placed(path: Path, spread: _Spread) -> _Spread:
    """Refuse volume in a class without a size; say where a class is wide."""
    lower, upper = spread.lower, spread.upper
    open_end = (upper >= 0.0) & (lower <= 0.0) & ~(lower < 0.0) | (np.isinf(upper) & np.isfinite(lower))
    for k in np.flatnonzero(open_end & (spread.share != 0.0)):
        size = f"{lower[k] / MICROMETRE:g}" + ("" if upper[k] == lower[k] else f" to {upper[k] / MICROMETRE:g}")
        raise _wrong(path, spread.line[k], f"size {size} um: sizes must be positive; {_PAN_CURE}")
    held = (spread.share > 0.0) & (lower > 0.0) & (lower < upper)
    widest = float(np.max(upper[held] / lower[held], initial=1.0))
    if widest <= WIDE_CLASS:
        return spread
    return spread._replace(words=f"{spread.words} (the widest class spans a factor of {widest:.3g}: a coarse guess)")


# --- finding the columns


def _down(path: Path, lines: list[Line], delimiter: str | None) -> _Header:
    """Find the names of the columns of a table with a class in each line."""
    without_unit: _Header | None = None
    for height in range(1, HEADER_HEIGHT + 1):
        for start in range(min(HEADER_LINES, len(lines) - height)):
            for way, names in _names(path, lines[start : start + height], delimiter):
                if numeric(names) or not is_header(columns_of(names)):
                    continue
                full, end = _with_units(path, lines, start + height, way, names)
                columns = columns_of(full)
                header = _Header(full, columns, [_Row(line, split(path, line, way)) for line in lines[end:]], way)
                if all(column.unit in LENGTH_UNITS for column in columns if column.role != "share"):
                    return header
                without_unit = without_unit or header
    if without_unit is not None:
        return without_unit
    named = [(line, names) for line in lines[:HEADER_LINES] for _, names in _names(path, [line], delimiter)]
    line, names = max(named or [(lines[0], [lines[0].text])], key=lambda item: (len(columns_of(item[1])), len(item[1])))
    raise _no_header(path, line, names, columns_of(names))


def _names(path: Path, lines: Sequence[Line], delimiter: str | None) -> Iterator[tuple[str, list[str]]]:
    """Names of columns that stand in one line or several, for every way to part them."""
    for way, names in header_splits(path, lines[0], delimiter):
        for line in lines[1:]:
            cells = split(path, line, way)
            names = [] if numeric(cells) else merged(names, cells)
        if names:
            yield way, names[:HEADER_CELLS]


def _with_units(path: Path, lines: list[Line], end: int, way: str, names: list[str]) -> tuple[list[str], int]:
    """Add the units that stand in a line of their own below the names."""
    if end < len(lines):
        cells = split(path, lines[end], way)
        named = [cell for cell in cells if cell]
        if named and all(map(is_unit, named)) and not all(numeric([cell]) for cell in named):
            said = [unit_of(name.lower())[1] is not None for name in names]
            bare = ["" if k < len(said) and said[k] else cell for k, cell in enumerate(cells)]
            return merged(names, bare), end + 1
    return names, end


def _across(path: Path, lines: list[Line], delimiter: str | None) -> _Header | None:
    """Read a table whose names stand in the first cells of lines: a class in each column."""
    for start, first in enumerate(lines[:HEADER_LINES]):
        for way, cells in header_splits(path, first, delimiter):
            if way == BLANKS or not _names_values(*_name_and_values(cells)):
                continue
            found: list[tuple[str, list[str]]] = []
            for line in lines[start:]:
                name, values = _name_and_values(split(path, line, way))
                if not _names_values(name, values):
                    break
                found.append((name, values))
            columns = columns_of([name for name, _ in found])
            if is_header(columns):
                longest = max(len(values) for _, values in found)
                every = [[values[k] if k < len(values) else "" for _, values in found] for k in range(longest)]
                rows = [_Row(lines[start + len(found) - 1], cells) for cells in every if any(cells)]
                return _Header([name for name, _ in found], columns, rows, way)
    return None


def _name_and_values(cells: list[str]) -> tuple[str, list[str]]:
    if len(cells) > 1 and is_unit(cells[1]) and not numeric([cells[1]]):
        return merged([cells[0]], [cells[1]])[0], cells[2:]
    return cells[0], cells[1:]


def _names_values(name: str, values: Sequence[str]) -> bool:
    """Whether a line begins with the name of a column, and holds numbers besides."""
    held = [cell for cell in values if cell]
    return len(held) > 1 and bool(columns_of([name])) and all(numeric([cell]) for cell in held)


def _no_header(path: Path, line: Line, names: Sequence[str], columns: Sequence[Column]) -> CsdError:
    has_size = any(column.role != "share" for column in columns)
    needed = "volume_fraction" if has_size else "size"
    text = f"{path}: line {line.number}: header {shown(list(names))}: needs exactly one column {needed!r} {_WANTED}"
    vague = next((column for column in columns if column.role == "share" and not column.basis), None)
    if not has_size:
        return CsdError(text)
    said = f"{shown(vague.name)} does not say a share of what" if vague else "or one of another name"
    return CsdError(f"{text}, {said}: mass_percent, number_fraction, passing_percent, undersize_volume_percent ...")


# --- a table whose columns are named


@dataclass(frozen=True)
class _Table:
    """Rows of classes under chosen columns.

    Attributes
    ----------
    sizes : tuple of Column
        One, or those of lower and upper edges.
    held : Column
        The shares.
    under : Column or None
        Undersize, which tells what the sizes are.
    """

    path: Path
    sizes: tuple[Column, ...]
    held: Column
    under: Column | None
    rows: list[_Row]
    marks: Decimals

    def number(self, row: _Row, column: Column) -> float:
        """Read a number, or say which line holds none."""
        found = self.marks.number(row.cell(column.index))
        if found is None:
            raise _wrong(self.path, row.line, f"{shown(row.cell(column.index))} is not a number (use a decimal point)")
        return found


def _named(path: Path, header: _Header) -> _Found:
    """Read the table below a header."""
    sizes, held, under = _chosen(path, header)
    used = [*sizes, held, *([under] if under else [])]
    marks = decimals_of(path, ((row.line.number, row.cell(column.index)) for row in header.rows for column in used))
    rows, notes = _without_footers(path, header, sizes[0], held, marks)
    for row in rows:
        if any(row.cells[len(header.cells) :]):
            count = f"{len(row.cells)} values under {len(header.cells)} columns"
            raise _wrong(path, row.line, f"{count} (decimal commas? use points, or export with semicolons)")
    how = [*([header.way] if header.way in (*DELIMITERS, BLANKS) and header.way != "commas" else [])]
    how += ["decimal commas"] if marks.mark == "," else []
    table = _Table(path, sizes, held, under, rows, marks)
    spread, words = _spread(table)
    return _Found(spread, held.basis, [words, *notes, *([", ".join(how)] if how else [])])


def _chosen(path: Path, header: _Header) -> tuple[tuple[Column, ...], Column, Column | None]:
    """Choose the columns of sizes (one, or from and to) and shares, and one of undersize that tells what sizes are."""
    sizes = _sizes(path, header)
    shares = [column for column in header.columns if column.role == "share" and "left_out" not in column.hints]
    basis = next((basis for basis in _POWER if any(column.basis == basis for column in shares)), "")
    of_basis = [column for column in shares if column.basis == basis]
    per_class = [column for column in of_basis if column.kind == "class"]
    per_class = [column for column in per_class if column.stem in EXACT] or per_class
    sums = next((found for kind in _SUMS if (found := [c for c in of_basis if c.kind == kind])), [])
    candidates = per_class or sums or of_basis
    if not basis or len(candidates) > 1:
        raise _not_one(path, header, "volume_fraction", candidates)
    tells = per_class and sums and sums[0].kind == "under" and len(sizes) == 1 and sizes[0].role == "size"
    return sizes, candidates[0], sums[0] if tells else None


def _sizes(path: Path, header: _Header) -> tuple[Column, ...]:
    by_role = {role: [column for column in header.columns if column.role == role] for role in ("size", "from", "to")}
    if len(by_role["from"]) == len(by_role["to"]) == 1:
        lower, upper = by_role["from"][0], by_role["to"][0]
        return replace(lower, unit=lower.unit or upper.unit), replace(upper, unit=upper.unit or lower.unit)
    exact = [column for column in by_role["size"] if column.stem == "size"]
    found = exact or by_role["size"] or by_role["from"] or by_role["to"]
    if len(found) != 1:
        raise _not_one(path, header, "size", found)
    beside = found[0].index + 1
    unnamed = beside < len(header.cells) and not header.cells[beside]
    if unnamed and 2 * sum(numeric([row.cell(beside)]) for row in header.rows) > len(header.rows):
        return replace(found[0], role="from"), replace(found[0], role="to", index=beside)
    return (found[0],)


def _not_one(path: Path, header: _Header, needed: str, found: Sequence[Column]) -> CsdError:
    text = f"{path}: header {shown(header.cells)}: needs exactly one column {needed!r} {_WANTED}"
    names = ", ".join(shown(column.name) for column in found[:5])
    return CsdError(f"{text}; {names} may be meant: keep one" if names else text)


def _without_footers(
    path: Path, header: _Header, size: Column, held: Column, marks: Decimals
) -> tuple[list[_Row], list[str]]:
    """Leave out totals and lines of text below the last class; refuse a pan that holds something."""
    is_class = [_is_size(row.cell(size.index), marks) for row in header.rows]
    end = max((k for k, found in enumerate(is_class, start=1) if found), default=0)
    rows: list[_Row] = []
    left_out: list[int] = []
    gap = False
    for k, row in enumerate(header.rows):
        text, share = row.cell(size.index), marks.number(row.cell(held.index))
        gap = gap or (row.line.after_gap and k >= end)
        if is_class[k]:
            rows.append(row)
        elif _PAN.match(text) and share is not None:
            if share:
                raise _wrong(path, row.line, f"{shown(text)} holds {share:g}: {_PAN_CURE}")
            left_out.append(row.line.number)
        elif k >= end > 0 and _is_footer(text, share, gap, [marks.number(done.cell(held.index)) for done in rows]):
            left_out.append(row.line.number)
        else:
            raise _wrong(path, row.line, f"{shown(text)} is not a number (use a decimal point)")
    if not rows:
        raise CsdError(f"{path}: {_NO_CLASS}")
    lines = ", ".join(map(str, left_out[:5])) + (" and more" if len(left_out) > 5 else "")
    return rows, [f"line {lines} left out (no class)"] if left_out else []


def _is_size(text: str, marks: Decimals) -> bool:
    return marks.number(text) is not None or range_of(text, marks) is not None


def _is_footer(text: str, share: float | None, gap: bool, above: Sequence[float | None]) -> bool:
    """Whether a line below the classes is none: text, behind a blank line, a statistic, or the sum of those above."""
    if share is None or gap or _FOOTER.match(text):
        return True
    return not text and math.isclose(share, sum(held or 0.0 for held in above), rel_tol=SUM_TOLERANCE)


# --- classes of a table


def _spread(table: _Table) -> tuple[_Spread, str]:
    """Classes in m with shares that sum to 1, and how the shares were read."""
    edges = _edges(table)
    if np.array_equal(edges[:, 0], edges[:, 1]):
        order = [int(k) for k in np.argsort(edges[:, 0], kind="stable")]
        size, rows = edges[order, 0], [table.rows[k] for k in order]
        if table.held.kind in _SUMS:
            return _of_sums(table, size, rows)
        if table.held.kind != "class":
            return _of_density(table, size, rows)
        return _of_points(table, size, rows)
    order = [int(k) for k in np.argsort(edges[:, 1], kind="stable")]
    return _of_classes(table, edges[order], [table.rows[k] for k in order])


def _edges(table: _Table) -> FloatArray:
    """Edges of every class, m, shape (n, 2); twice the same where the table gives one size."""
    factors = [_length_factor(table.path, column) for column in table.sizes]
    found = []
    for row in table.rows:
        text = row.cell(table.sizes[0].index)
        ends = range_of(text, table.marks) if table.marks.number(text) is None else None
        lower, upper = ends or (table.number(row, table.sizes[0]), table.number(row, table.sizes[-1]))
        if (len(table.sizes) == 2 or ends) and not lower < upper:
            raise _wrong(table.path, row.line, f"a class from {lower:g} to {upper:g}: must be from small to large")
        found.append((lower, upper))
    edges: FloatArray = np.array(found, dtype=np.float64) * np.array([factors[0], factors[-1]])
    return edges


def _length_factor(path: Path, column: Column) -> float:
    if column.unit is None or column.unit not in LENGTH_UNITS:
        known = ", ".join(key for key in LENGTH_UNITS if key.isascii())
        raise CsdError(
            f"{path}: column {column.stem!r} has unit {shown(column.unit)}; name one of {known} in the header"
        )
    return LENGTH_UNITS[column.unit]


def _scale(table: _Table, values: FloatArray, rows: Sequence[_Row]) -> tuple[float, str]:
    """Factor that makes fractions of a column's values (its largest where it is cumulative), and how it was found."""
    column, what = table.held, f"by {table.held.basis}"
    total = float(values.max() if column.kind in _SUMS else values.sum())
    unit = column.unit
    signs = [row.cell(column.index).strip().endswith("%") for row in rows]
    if unit in PERCENT_UNITS or (unit is None and all(signs)):
        return 0.01, f"% {what}"
    counts = column.basis == "number" and unit is None and not re.search("fraction|share|anteil", column.stem)
    if unit in MASS_UNITS or (counts and abs(total - 1.0) > SUM_TOLERANCE):
        return (1.0 / total if total > 0.0 else 1.0), "counts" if counts else "masses"
    if unit is not None and unit not in FRACTION_UNITS:
        known = ", ".join([key for key in FRACTION_UNITS if key] + list(MASS_UNITS))
        raise CsdError(
            f"{table.path}: column {column.stem!r} has unit {shown(unit)}; name one of {known} in the header"
        )
    if abs(total - 100.0) <= 100.0 * SUM_TOLERANCE:
        return 0.01, f"% {what}, though the header does not say so"
    return 1.0, f"fractions {what}"


def _of_points(table: _Table, size: FloatArray, rows: list[_Row]) -> tuple[_Spread, str]:
    """Shares beside one size each: middles, or edges where the table shows it; refused where it may be either."""
    column, cells = table.sizes[0], [row.cell(table.held.index) for row in rows]
    blank = [k for k, cell in enumerate(cells) if not cell]
    if len(rows) > 1 and blank in ([0], [len(rows) - 1]):
        first = blank == [0]
        held = rows[1:] if first else rows[:-1]
        values = np.array([table.number(row, table.held) for row in held])
        factor, words = _scale(table, values, held)
        if abs(float(np.sum(values * factor)) - 1.0) <= SUM_TOLERANCE:
            return _between(table, size, values * factor, held), words
    values = np.array([table.number(row, table.held) for row in rows])
    factor, words = _scale(table, values, rows)
    share = values * factor
    edge = "upper" if column.role == "to" else "lower" if column.role == "from" or "sieve" in column.hints else ""
    if not edge and table.under is not None:
        edge = _told_by_undersize(table, share, rows)
    if edge == "lower":
        if share[-1] != 0.0:
            text = f"{cells[-1]} at {size[-1] / MICROMETRE:g} um, the largest of lower edges, has no upper edge"
            raise _wrong(table.path, rows[-1].line, f"{text}: add a last line with that edge and no share")
        return _between(table, size, share[:-1], rows[:-1]), words
    if edge == "upper":
        if share[0] != 0.0:
            text = f"{cells[0]} at {size[0] / MICROMETRE:g} um, the smallest of upper edges, has no lower edge"
            raise _wrong(table.path, rows[0].line, f"{text}: add a line with that edge and no share; {_PAN_CURE}")
        return _between(table, size, share[1:], rows[1:]), words
    if "middle" not in column.hints and edge != "middle" and ("label" in column.hints or _on_a_grid(size)):
        sizes = f"{size[0] / MICROMETRE:g} to {size[-1] / MICROMETRE:g} um"
        raise _wrong(table.path, rows[0].line, f"sizes {sizes} look like edges of classes, one missing: {_EDGES_CURE}")
    return _Spread(size, size, share, [row.line for row in rows], "sizes as middles of classes"), words


def _on_a_grid(size: FloatArray) -> bool:
    """Whether sizes are in equal steps of a series that holds a power of ten of 1 um, as edges are and middles not."""
    inside = size[size > 0.0]
    if inside.size < FEWEST_GRID_SIZES or not np.isfinite(inside).all():
        return False
    logarithm = np.log(inside / MICROMETRE)
    steps = np.diff(logarithm)
    step = float(steps.mean())
    if not GRID_STEPS[0] < step < GRID_STEPS[1] or np.max(np.abs(steps - step)) > 2.0 * GRID_TOLERANCE * step:
        return False
    places = [(logarithm - math.log(10.0) * power) / step for power in range(4)]
    return any(float(np.max(np.abs(place - np.round(place)))) < GRID_TOLERANCE for place in places)


def _told_by_undersize(table: _Table, share: FloatArray, rows: Sequence[_Row]) -> str:
    """Say what sizes are from shares and the undersize at the same sizes: upper or lower edges, or middles."""
    assert table.under is not None
    under = np.array([table.number(row, table.under) for row in rows])
    under = under / (100.0 if under.max() > 1.0 + SUM_TOLERANCE else 1.0)
    before = np.cumsum(share) - share
    tries = {"upper": before + share, "lower": before, "middle": before + 0.5 * share}
    off = {edge: float(np.max(np.abs(under - under[0] - (sums - sums[0])))) for edge, sums in tries.items()}
    best = min(off, key=lambda edge: off[edge])
    if off[best] > SUM_TOLERANCE or sorted(off.values())[1] < 2.0 * off[best]:
        names = f"{table.held.name!r} and {table.under.name!r}"
        raise CsdError(f"{table.path}: the columns {names} do not agree on what the sizes are; keep one of them")
    return best


def _between(table: _Table, edges: FloatArray, share: FloatArray, rows: Sequence[_Row]) -> _Spread:
    """Classes between consecutive sizes."""
    same = np.flatnonzero(np.diff(edges) <= 0.0)
    if same.size:
        text = f"the edge {edges[same[0]] / MICROMETRE:g} um stands twice"
        raise _wrong(table.path, rows[min(int(same[0]), len(rows) - 1)].line, text)
    words = "class edges, geometric middles"
    return _Spread(edges[:-1], edges[1:], share, [row.line for row in rows], words)


def _of_sums(table: _Table, size: FloatArray, rows: list[_Row]) -> tuple[_Spread, str]:
    """Cumulative shares at sizes: classes between them."""
    values = np.array([table.number(row, table.held) for row in rows])
    below, words = _undersize(table, values, rows, table.held.kind)
    if below.max() > 1.0 + SUM_TOLERANCE:
        text = f"the largest cumulative share is {values.max():g}: must be 1, or 100 %"
        raise _wrong(table.path, rows[int(values.argmax())].line, text)
    if below[0] > MOST_UNSEEN:
        text = f"{below[0]:.3g} of the whole is smaller than {size[0] / MICROMETRE:g} um, the smallest size"
        raise _wrong(table.path, rows[0].line, f"{text}: add the size below which there is nothing; {_PAN_CURE}")
    if below[-1] < 1.0 - SUM_TOLERANCE:
        text = f"{1.0 - below[-1]:.3g} of the whole is larger than {size[-1] / MICROMETRE:g} um, the largest size"
        raise _wrong(table.path, rows[-1].line, f"{text}: add the size above which there is nothing")
    share = _rises(table, below, rows)
    return _between(table, size, share / share.sum(), rows[1:]), words


def _undersize(table: _Table, values: FloatArray, rows: Sequence[_Row], kind: str) -> tuple[FloatArray, str]:
    """Shares smaller than sizes that ascend, as fractions, and how they were read."""
    if not np.isfinite(values).all():
        raise CsdError(f"{table.path}: volume fraction {values[~np.isfinite(values)][0]:g}: must be finite")
    factor, words = _scale(table, values, rows)
    over = kind == "over" or (kind == "cumulative" and values[-1] < values[0])
    return (
        1.0 - values * factor if over else values * factor
    ), f"cumulative {'oversize' if over else 'undersize'}, {words}"


def _rises(table: _Table, below: FloatArray, rows: Sequence[_Row]) -> FloatArray:
    """Shares between sizes from those smaller than them."""
    share = np.diff(below)
    falls = np.flatnonzero(share < -ROUNDING)
    if falls.size:
        column = shown(table.held.name)
        raise _wrong(table.path, rows[int(falls[0]) + 1].line, f"{column} turns back here: a cumulative share must not")
    return np.maximum(share, 0.0)


def _of_density(table: _Table, size: FloatArray, rows: list[_Row]) -> tuple[_Spread, str]:
    """Density at sizes: classes between them by the trapezoidal rule."""
    values = np.array([table.number(row, table.held) for row in rows])
    if size.size < 2 or not size[0] > 0.0:
        raise _wrong(table.path, rows[0].line, "a density needs two sizes at least, all of them positive")
    spread = _between(table, size, 0.5 * (values[1:] + values[:-1]), rows[1:])
    share, words = _integrated(table, spread.share, spread.lower, spread.upper, rows)
    return spread._replace(share=share), words


def _integrated(
    table: _Table, values: FloatArray, lower: FloatArray, upper: FloatArray, rows: Sequence[_Row]
) -> tuple[FloatArray, str]:
    """Shares of classes from their densities, normalised; refused where the integral is neither 1 nor 100 %."""
    per_log = table.held.kind == "per log"
    if per_log and not (lower > 0.0).all():
        raise _wrong(table.path, rows[0].line, "a density per logarithm of the size needs sizes above zero")
    unit = per_size_unit(table.held) or "um"
    share = values * (np.log(upper / lower) if per_log else (upper - lower) / LENGTH_UNITS[unit])
    total = float(share.sum())
    wholes = [whole * base for whole in (1.0, 100.0) for base in ((1.0, math.log(10.0)) if per_log else (1.0,))]
    if not any(abs(total / whole - 1.0) <= DENSITY_TOLERANCE for whole in wholes):
        text = f"the density {shown(table.held.name)} integrates to {total:.3g}, not to 1 or 100 %"
        raise CsdError(f"{table.path}: {text}: does it go with the unit in its name, do the sizes cover the whole?")
    per = "logarithm of the size" if per_log else unit
    return share / total, f"density per {per}, by {table.held.basis}"


def _of_classes(table: _Table, edges: FloatArray, rows: list[_Row]) -> tuple[_Spread, str]:
    """Shares of classes with both edges."""
    lower, upper = edges[:, 0], edges[:, 1]
    overlaps = np.flatnonzero(lower[1:] < upper[:-1] * (1.0 - 1e-6))
    if overlaps.size:
        k = int(overlaps[0]) + 1
        text = f"the class {lower[k] / MICROMETRE:g} to {upper[k] / MICROMETRE:g} um overlaps that below it"
        raise _wrong(table.path, rows[k].line, text)
    values = np.array([table.number(row, table.held) for row in rows])
    if table.held.kind == "class":
        factor, words = _scale(table, values, rows)
        share = values * factor
    elif table.held.kind in _SUMS:
        share, words = _sums_of_classes(table, values, rows)
    else:
        share, words = _integrated(table, values, lower, upper, rows)
    spread = _Spread(lower, upper, share, [row.line for row in rows], "class edges, geometric middles")
    return spread, words


def _sums_of_classes(table: _Table, values: FloatArray, rows: Sequence[_Row]) -> tuple[FloatArray, str]:
    """Shares of classes from cumulative ones, which are those at the upper edges, or else at the lower ones."""
    below, words = _undersize(table, values, rows, table.held.kind)
    if below[-1] >= 1.0 - MOST_UNSEEN:
        share = _rises(table, np.concatenate([[0.0], below]), [rows[0], *rows])
    elif below[0] <= MOST_UNSEEN:
        share = _rises(table, np.concatenate([below, [1.0]]), [*rows, rows[-1]])
    else:
        text = f"{shown(table.held.name)} is complete at neither end of the classes: it must begin at 0 or end at 100 %"
        raise _wrong(table.path, rows[-1].line, text)
    return share, words


# --- a row of classes (Mastersizer 2000)


def _wide(path: Path, lines: list[Line], delimiter: str | None) -> _Found | None:
    """Read a row of results under a row of the edges of its classes."""
    for start, first in enumerate(lines[:HEADER_LINES]):
        if not _WIDE_FORM.search(first.text):
            continue
        for way, cells in header_splits(path, first, delimiter):
            at = next((k for k, cell in enumerate(cells) if _WIDE_FORM.search(cell)), None)
            if at is not None and start + 2 < len(lines) and way != BLANKS:
                rows = [_Row(line, split(path, line, way)) for line in lines[start + 1 :]]
                return _of_row(path, cells, at, rows)
    return None


def _of_row(path: Path, names: Sequence[str], at: int, rows: Sequence[_Row]) -> _Found:
    end = at
    while end < len(rows[0].cells) and numeric([rows[0].cells[end]]):
        end += 1
    results = [row for row in rows[1:] if any(numeric([cell]) for cell in row.cells[at:end])]
    if len(results) != 1:
        text = (
            f"{len(results)} results under one row of classes: must be exactly one; keep one, for example the average"
        )
        raise _wrong(path, (results or rows)[-1].line, text)
    result, form = results[0], _WIDE_FORM.search(names[at])
    assert form is not None
    marks = decimals_of(path, [(row.line.number, c) for row in (rows[0], result) for c in row.cells[at:end]])
    types = [result.cell(k).lower() for k, name in enumerate(names[:at]) if _RESULT_TYPE.fullmatch(name)]
    basis = next((basis for basis in _POWER for text in types if text.startswith(basis)), "volume")
    kind = "class" if form[1].lower() == "between" else "under"
    size = Column("size", "size", form[2].lower().replace("\u00b5", "u").replace("\u03bc", "u"), "size", index=0)
    held = Column(names[at], "volume_percent", "%", "share", basis, kind, index=1)
    pairs = [_Row(result.line, [rows[0].cells[k], result.cell(k)]) for k in range(at, end)]
    if kind == "class" and all(row.cells[1] for row in pairs):
        text = f"{len(pairs)} edges with as many shares: must be one share less, with a blank below the first edge"
        raise _wrong(path, result.line, text)
    spread, words = _spread(_Table(path, (size,), held, None, pairs, marks))
    said = words if types else f"{words} (the file does not say of what)"
    return _Found(
        spread, basis, [said, f"line {result.line.number}", *(["decimal commas"] if marks.mark == "," else [])]
    )


def _wrong(path: Path, line: Line, text: str) -> CsdError:
    return CsdError(f"{path}: line {line.number}: {text}")
