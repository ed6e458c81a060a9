"""Names of columns as people and instruments write them, and what they say: sizes, edges, shares of what and how."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from filtercake.units import FRACTION_UNITS, LENGTH_UNITS

LONGEST_NAME: Final = 200
"""Characters of a name that are looked at."""

MASS_UNITS: Final = ("g", "mg", "kg")
PERCENT_UNITS: Final = ("%", "percent", "pct")

_BRACKET = re.compile(r"^(.*?)\s*[\[(]([^\[\]()]*)[\])]\s*$")
_BEHIND = re.compile(r"^(.*?)(?:\s*[_,/]\s*|\s+in\s+|\s+)(um|mm|nm|micron|m|percent|pct|%|g|mg|kg)$")
_PER_SIZE = re.compile(r"(?:/|per[_ ]?|1/)\s*(um|mm|nm|m)\b|(um|mm|nm|m)(?:\^?-1)")
_ISO_9276 = re.compile(r"(1\s*-\s*)?([pqPQ])([0-3])\s*(?:\([a-zA-Z]\))?\s*(\*|lg|log|ln)?\s*(?:[\[(,/].*)?")
_WORDS: Final[dict[str, tuple[str, ...]]] = {
    "volume": ("vol", "mass", "weight", "weights", "wt", "gewicht", "retained", "dv", "dm"),
    "number": ("number", "count", "anzahl", "num", "dn"),
    "surface": ("surface", "area", "oberfl"),
    "size": ("size", "diameter", "durchmesser", "korngr", "partikelgr", "gr\u00f6\u00dfe", "gr\u00f6sse", "groesse"),
    "sieve": ("sieve", "mesh", "aperture", "opening", "maschenweite", "sieb"),
    "from": ("from", "lower", "low", "min", "von", "untere", "xu", "start"),
    "to": ("to", "upper", "high", "max", "bis", "ober", "xo", "end"),
    "middle": ("mid", "middle", "midpoint", "center", "centre", "mittel", "mitte", "mean"),
    "under": (
        "undersize",
        "passing",
        "passed",
        "under",
        "below",
        "finer",
        "smaller",
        "less",
        "durchgang",
        "siebdurchgang",
    ),
    "over": ("oversize", "over", "above", "coarser", "greater", "residue", "r\u00fcckstand", "siebr\u00fcckstand"),
    "cumulative": ("cum", "kum"),
    "label": ("sample", "class", "channel", "bin", "no", "nr"),
    "left_out": ("truncated", "packed"),
}
"""How words of a name begin, by what they mean."""
_SHORT: Final = (
    "to",
    "no",
    "nr",
    "bin",
    "mid",
    "end",
    "xu",
    "xo",
    "low",
    "min",
    "max",
    "over",
    "dv",
    "dm",
    "dn",
    "num",
)
_WHOLE_WORDS: Final = frozenset({"weight", *_SHORT})
_EDGE_SIGNS: Final = {"x_u": "from", "x_o": "to", "d_u": "from", "d_o": "to", "x_l": "from"}
"""Signs of lower and upper edges."""
_DIAMETERS: Final = ("d", "x", "xm", "dp", "esd", "ecd")
EXACT: Final = ("volume_fraction", "mass_fraction", "weight_fraction", "number_fraction", "surface_fraction")


@dataclass(frozen=True)
class Column:
    """What a column's name says: ``role`` is size, from, to or share; ``kind`` of a share how it is spread."""

    name: str
    stem: str
    unit: str | None
    role: str
    basis: str = ""
    kind: str = "class"
    hints: frozenset[str] = frozenset()
    index: int = 0


def _column(text: str) -> Column | None:
    """Say what a column's name means; None where it is neither a size nor a share."""
    name = text.strip()[:LONGEST_NAME]
    plain = re.sub(r"\s+", " ", name.replace("\u00b5", "u").replace("\u03bc", "u")).strip().lower()
    stem, unit = unit_of(plain)
    signs = _ISO_9276.fullmatch(name)
    if signs:
        return _of_signs(name, signs, unit)
    words = [word for word in re.split(r"[^a-z0-9%\u00e4\u00f6\u00fc\u00df<>\u03a3]+", stem) if word]
    hints = frozenset(meaning for meaning in _WORDS if any(_means(word, meaning) for word in words))
    is_length = unit in LENGTH_UNITS and not _PER_SIZE.search(plain)
    basis = next((known for known in ("volume", "number", "surface") if known in hints), "")
    spread = _spread(stem, unit, hints)
    if unit and re.search(r"vol|wt|w-|mass|gew", unit):
        basis, unit = "volume", "%" if "%" in unit else unit
    if unit is None and {"%", "percent"} & set(words):
        unit = "%"
    if (
        basis == "number"
        and "label" in hints
        and unit is None
        and not {"of", "fraction", "count", "counts"} & set(words)
    ):
        return None
    if not is_length and (basis or spread != "class"):
        if (
            not basis
            and hints & {"sieve", "under", "over"}
            and re.search("pass|sieb|sieve|residue|durchgang|r\u00fcckstand", stem)
        ):
            basis = "volume"
        per_class = spread == "per size" and unit in PERCENT_UNITS and not _PER_SIZE.search(plain)
        return Column(name, stem, unit, "share", basis, "class" if per_class else spread, hints)
    named = "size" in hints or "sieve" in hints or stem in _DIAMETERS
    edge = _EDGE_SIGNS.get(stem) or next((end for end in ("from", "to") if end in hints), None)
    if named or (is_length and (edge or "middle" in hints)):
        return Column(name, stem, unit, edge or "size", hints=hints)
    return None


def _means(word: str, meaning: str) -> bool:
    return any(word == begin if begin in _WHOLE_WORDS else word.startswith(begin) for begin in _WORDS[meaning])


def unit_of(plain: str) -> tuple[str, str | None]:
    """Part a name from its unit: in brackets, behind a comma or an underscore, or alone."""
    bracket = _BRACKET.match(plain)
    if bracket:
        inside = bracket[2].strip()
        if any(_means(inside, meaning) for meaning in ("from", "to", "middle", "sieve", "cumulative", "volume")):
            return f"{bracket[1]} {inside}".replace(" ", "_"), "%" if "%" in inside else None
        return bracket[1].strip().replace(" ", "_"), inside
    behind = _BEHIND.match(plain)
    if behind:
        return behind[1].strip().replace(" ", "_"), behind[2]
    return plain.replace(" ", "_"), None


def _spread(stem: str, unit: str | None, hints: frozenset[str]) -> str:
    """Say how a share is spread: per class, cumulative (under, over, or unsaid), per size or per logarithm of it."""
    if re.search(r"per_?(um_)?log|dlog|/_?d?lo?g|per_?decade", stem) or (unit and re.search("log|lg|ln|decade", unit)):
        return "per log"
    if _PER_SIZE.search(f"{stem} {unit or ''}".replace("_", " ")) or "densit" in stem or "dichte" in stem:
        return "per size"
    if "under" in hints or "<" in stem:
        return "under"
    if "over" in hints or ">" in stem or ("cumulative" in hints and "retained" in stem):
        return "over"
    return "cumulative" if "cumulative" in hints else "class"


def _of_signs(name: str, found: re.Match[str], unit: str | None) -> Column:
    """Read p3, q3, Q3 (and 0 to 2): ISO 9276's signs of classes, densities and cumulative distributions."""
    basis = ("number", "length", "surface", "volume")[int(found[3])]
    kind = {"p": "class", "P": "class", "q": "per size", "Q": "under"}[found[2]]
    if found[1]:
        kind = "over"
    if kind == "per size" and found[4]:
        kind = "per log"
    return Column(name, name, unit, "share", basis, kind)


def columns_of(names: Sequence[str]) -> list[Column]:
    """Find the columns of sizes and shares among names; beside sieves, a share that says no more is one of the mass."""
    found = [replace(column, index=k) for k, name in enumerate(names) if (column := _column(name)) is not None]
    if not any("sieve" in column.hints for column in found if column.role != "share"):
        return found
    return [
        replace(column, basis="volume") if column.role == "share" and not column.basis else column for column in found
    ]


def is_header(columns: Sequence[Column]) -> bool:
    """Whether there is a column of sizes and one of shares that says of what."""
    roles = {column.role for column in columns if column.role != "share" or column.basis}
    return "share" in roles and len(roles) > 1


def is_unit(cell: str) -> bool:
    """Whether a cell holds a unit and nothing else."""
    plain = cell.strip().strip("[]() ").replace("\u00b5", "u").replace("\u03bc", "u").lower()
    units = (*LENGTH_UNITS, *FRACTION_UNITS, *MASS_UNITS, "pct", "none")
    return bool(plain) and (
        plain in units or re.fullmatch(r"(?:vol|wt|w|m)[-. ]*%|%[-. ]*(?:vol|wt)", plain) is not None
    )


def merged(above: list[str], below: list[str]) -> list[str]:
    """Join names that take two lines; units go behind."""
    found = []
    for upper, lower in itertools.zip_longest(above, below, fillvalue=""):
        first, second = (lower, upper) if is_unit(upper) else (upper, lower)
        found.append(f"{first} [{second.strip('[]() ')}]" if first and is_unit(second) else f"{first} {second}".strip())
    return found


def per_size_unit(column: Column) -> str | None:
    """Return the unit of length in a density's name, None where it holds none."""
    found = _PER_SIZE.search(column.name.replace("\u00b5", "u").replace("\u03bc", "u").lower())
    return (found[1] or found[2]) if found else None
