"""Spoil valid files: structurally (keys, values, subtrees, cells) and byte by byte."""

from __future__ import annotations

import csv
import io
import json
import math
import random
from dataclasses import dataclass
from typing import Any

import yaml


@dataclass
class Raw:
    """YAML that is written as it stands."""

    text: str


class Pairs(list):
    """A mapping whose keys may stand twice."""


NUMBERS = (
    *(0, -1, 1, 2, 0.5, -0.0, 1e-300, 5e-324, 1e-30, 1e300, 1.7e308, -1e300, 10**18, 10**19, 10**400, 2**63, -(2**63)),
    *(math.nan, math.inf, -math.inf, 0.1 + 0.2, 1e5, 999999, 1e-9, 0.999999999999, 100_000, 1e7),
)
CANARY = "fuzz_canary"
"""A file that no input may bring into being."""
FACTORS = (-1, 0, 0.001, 0.1, 0.5, 0.9, 1.1, 2, 10, 1000)
TEXTS = (
    *("", " ", "null", "~", "true", "nan", "inf", "1e5", "1_000", "0x10", "0o7", "1:30", "12:30:45.5", "2001-99-99"),
    *("2001-01-01", "١٢", "1,5", "5%", "=1+1", f"=cmd|' /C touch {CANARY}'!A0", "@SUM(1)", "+1", "-2", "\t=1"),
    *(
        "../../etc/passwd",
        "/etc/passwd",
        "../tiny.yaml",
        "/dev/zero",
        "/dev/stdin",
        "a/../b",
        "..",
        ".",
        "/",
        "//",
        "~root",
    ),
    *(f"$(touch {CANARY})", f"`touch {CANARY}`", f"; touch {CANARY}", f"| touch {CANARY}", "$HOME", "%PATH%", "a b"),
    *("{study}", "{wildcards}", "{{ 7 * 7 }}", "{% raw %}", "*", "?", "[a-z]", "a{b,c}", "'", '"', "\\", "a\\b"),
    *("CON", "nul", "AUX.yaml", "com1", "bimоdal", "ｂimodal", "bimodal\u200b", "\u202ebimodal", "é" * 40, "x" * 70),
    *(
        "x" * 300,
        "y" * 5000,
        "\0",
        "a\0b",
        "line\nbreak",
        "\r\n",
        "\x1b[31m",
        "\x7f",
        "\ud800",
        "\U0001f600",
        "$x^$",
        "$5",
    ),
    *("__use_yte__", "__class__", "?print('x')", "calibration_tiny", "benchmark", "tiny.csv", "fifo", "loop.yaml"),
    *("tiny.csv\0", "huge.csv", "folder", "bimodal", "from_file", "tiny", "pmma", "advised", "auto", "embedded"),
    *("s3://bucket/x.csv", "file:///etc/passwd", "http://localhost/x.yaml", "con.yaml", "-", "--help", "-rf", "#", "!"),
)
YAML = (
    *("!!python/object/apply:os.system ['touch fuzz_canary']", "!!python/name:os.system", "!!python/module:os ''"),
    *("!!python/object/new:type {}", "!include x.yaml", "!!binary aGk=", "!!set {a, b}", "!!omap [a: 1]", "!!int ''"),
    *("!!float x", "!!timestamp x", "!!bool x", "!!str 5", "! x", "&a [1, 2]", "*a", "&a [*a]", "{<<: {friction: 1}}"),
    *(
        "{[1, 2]: 3}",
        "{{a: 1}: 2}",
        "{? !!set {a} : 1}",
        "{1: 2}",
        "{null: 1}",
        "{1.5: 2}",
        "{true: 1}",
        "{2001-01-01: 1}",
    ),
    *("[" * 40 + "]" * 40, "[" * 2000 + "]" * 2000, "{a: " * 200 + "1" + "}" * 200, "[" + "1," * 3000 + "]"),
    *(
        "0x" + "f" * 5000,
        "9" * 5000,
        "0b" + "1" * 9000,
        "1" + ":59" * 300,
        "1" + ":59" * 300 + ".5",
        "._",
        "0x_",
        "1e999",
    ),
    *(
        "2001-01-01 00:00:00 +99:99",
        "0000-00-00",
        "'unclosed",
        '"\\x',
        "[",
        "}",
        "|",
        "@x",
        "`x",
        "%TAG",
        "- - -",
        "? ? ?",
    ),
    *("{" + ",".join(f"k{i}: {i}" for i in range(800)) + "}", "[" + ",".join(["[0,1,2,3]"] * 500) + "]"),
)
BYTES = (
    *(b"\0", b"\xff", b"\xfe\xff", b"\xef\xbb\xbf", b"\r", b"\r\n", b"\n\n", b"\t", b"\x85", b"\xe2\x80\xa8", b"\x1a"),
    *(b"\xc0\xaf", b"\xed\xa0\x80", b"---\n", b"...\n", b"%YAML 9.9\n", b"#", b": ", b"- ", b"'", b'"', b"&a ", b"*a"),
    *(
        b"!!python/object/apply:os.system [x]",
        b"<<: ",
        b"[" * 300,
        b"{" * 300,
        b",",
        b";",
        b"=",
        b"1e308",
        b"-",
        b"9" * 400,
    ),
)


def scalar(chance: random.Random) -> Any:
    """Draw a hostile value."""
    kind = chance.random()
    if kind < 0.3:
        return chance.choice(NUMBERS)
    if kind < 0.4:
        return chance.choice((-1, 1)) * 10.0 ** chance.uniform(-12, 12)
    if kind < 0.7:
        return chance.choice(TEXTS)
    if kind < 0.9:
        return Raw(chance.choice(YAML))
    return chance.choice((None, True, False, [], Pairs(), [None], [[]], Pairs([("a", 1)])))


def to_pairs(node: Any) -> Any:
    """Turn mappings into lists of pairs."""
    if isinstance(node, dict):
        return Pairs([(key, to_pairs(value)) for key, value in node.items()])
    return [to_pairs(item) for item in node] if isinstance(node, list) else node


def write(node: Any) -> str:
    """Write a structure as YAML in one line."""
    if isinstance(node, Raw):
        return node.text
    if isinstance(node, Pairs):
        return "{" + ", ".join(f"{write(key)}: {write(value)}" for key, value in node) + "}"
    if isinstance(node, list):
        return "[" + ", ".join(write(item) for item in node) + "]"
    if isinstance(node, float) and not math.isfinite(node):
        return ".nan" if math.isnan(node) else (".inf" if node > 0 else "-.inf")
    return json.dumps(node)


def _places(node: Any) -> list[tuple[list, int]]:
    """Every place of a structure: its container and index."""
    found: list[tuple[list, int]] = []
    for index, item in enumerate(node if isinstance(node, list) else []):
        found += [(node, index), *_places(item[1] if isinstance(node, Pairs) else item)]
    return found


def _value(place: tuple[list, int]) -> Any:
    holder, index = place
    return holder[index][1] if isinstance(holder, Pairs) else holder[index]


def _put(place: tuple[list, int], value: Any) -> None:
    holder, index = place
    holder[index] = (holder[index][0], value) if isinstance(holder, Pairs) else value


def _spoil(tree: Any, chance: random.Random) -> None:
    """Make one structural change, in place."""
    places = _places(tree)
    if not places:
        return
    place = chance.choice(places)
    leaves = [each for each in places if not isinstance(_value(each), list)]
    holder, index = place
    kind = chance.choice(
        ("value", "value", "value", "scale", "scale", "delete", "twice", "key", "swap", "wrap", "graft", "long")
    )
    if kind == "value":
        _put(chance.choice(leaves or places), scalar(chance))
    elif kind == "scale":
        numbers = [each for each in leaves if type(_value(each)) in (int, float)]
        if numbers:
            place = chance.choice(numbers)
            _put(place, _value(place) * chance.choice(FACTORS))
    elif kind == "delete":
        del holder[index]
    elif kind == "twice":
        holder.insert(index, holder[index])
    elif kind == "key" and isinstance(holder, Pairs):
        key = chance.choice((chance.choice(TEXTS), f"{holder[index][0]}s", Raw(chance.choice(YAML)), 1, None))
        holder[index] = (key, holder[index][1])
    elif kind == "swap":
        other = chance.choice(leaves or places)
        if not isinstance(_value(place), list):
            mine, theirs = _value(place), _value(other)
            _put(place, theirs)
            _put(other, mine)
    elif kind == "wrap":
        _put(place, chance.choice(([_value(place)], Pairs([("x", _value(place))]), [_value(place)] * 3)))
    elif kind == "graft":
        copied = to_pairs(yaml.safe_load(json.dumps(_plain(_value(chance.choice(places))))))
        _put(place, copied)
    elif kind == "long" and isinstance(_value(place), list) and not isinstance(_value(place), Pairs):
        _put(place, _value(place) * chance.choice((2, 20, 300)))


def _plain(node: Any) -> Any:
    """Return a structure that JSON can copy."""
    if isinstance(node, Raw):
        return "raw"
    if isinstance(node, Pairs):
        return {str(key): _plain(value) for key, value in node}
    if isinstance(node, list):
        return [_plain(item) for item in node]
    if isinstance(node, float) and not math.isfinite(node):
        return None
    return node


def spoil_yaml(content: bytes, chance: random.Random) -> bytes:
    """Change a YAML file in one to three places of its structure."""
    tree = to_pairs(yaml.safe_load(content))
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        _spoil(tree, chance)
    return write(tree).encode("utf-8", "surrogatepass")


def spoil_table(content: bytes, chance: random.Random) -> bytes:
    """Change a CSV file in one to three of its cells, rows or columns."""
    lines = content.decode().splitlines()
    rows = list(csv.reader(lines))
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        row = chance.randrange(len(rows))
        kind = chance.choice(
            ("cell", "cell", "cell", "scale", "scale", "header", "delete", "twice", "swap", "column", "long", "empty")
        )
        if kind in ("cell", "header"):
            line = rows[0 if kind == "header" else row]
            drawn = scalar(chance)
            text = drawn.text if isinstance(drawn, Raw) else str(_plain(drawn) if isinstance(drawn, list) else drawn)
            if line:
                line[chance.randrange(len(line))] = text
        elif kind == "scale":
            factor, column = chance.choice(FACTORS), chance.randrange(2)
            for line in rows if chance.random() < 0.5 else [rows[row]]:
                if column < len(line) and line[column].replace(".", "", 1).isdigit():
                    line[column] = f"{float(line[column]) * factor:g}"
        elif kind == "delete" and len(rows) > 1:
            del rows[row]
        elif kind == "twice":
            rows.insert(row, list(rows[row]))
        elif kind == "swap":
            other = chance.randrange(len(rows))
            rows[row], rows[other] = rows[other], rows[row]
        elif kind == "column":
            rows = [line[::-1] for line in rows] if chance.random() < 0.5 else [[*line, *line] for line in rows]
        elif kind == "long":
            rows += [list(rows[row])] * chance.choice((5, 500, 12_000))
        elif kind == "empty":
            rows = rows[: chance.randrange(len(rows) + 1)] or [[]]
    stream = io.StringIO()
    writer = csv.writer(
        stream,
        delimiter=chance.choice((",", ",", ",", ";", "\t", "|")),
        lineterminator=chance.choice(("\n", "\n", "\r\n", "\r")),
        quoting=chance.choice((csv.QUOTE_MINIMAL, csv.QUOTE_MINIMAL, csv.QUOTE_ALL)),
    )
    writer.writerows(rows)
    return stream.getvalue().encode("utf-8", "surrogatepass")


def spoil_bytes(content: bytes, chance: random.Random) -> bytes:
    """Change a file in one to five places, or its encoding, without a look at what it means."""
    kind = chance.random()
    text = content.decode()
    if kind < 0.05:
        return text.encode(chance.choice(("utf-16", "utf-16-le", "utf-32", "utf-8-sig")))
    if kind < 0.1:
        return text.replace("a", "é").encode("latin-1")
    if kind < 0.15:
        return text.replace("\n", chance.choice(("\r\n", "\r", "\u2028", "\n\n"))).encode()
    data = bytearray(content)
    for _ in range(chance.randint(1, 5)):
        at = chance.randrange(len(data) + 1)
        span = chance.choice((1, 1, 3, 20, 200))
        what = chance.choice(("flip", "insert", "delete", "repeat", "move", "cut"))
        if what == "flip" and at < len(data):
            data[at] ^= 1 << chance.randrange(8)
        elif what == "insert":
            data[at:at] = chance.choice(BYTES)
        elif what == "delete":
            del data[at : at + span]
        elif what == "repeat":
            data[at:at] = data[at : at + span] * chance.choice((1, 2, 50))
        elif what == "move":
            to = chance.randrange(len(data) + 1)
            data[to:to] = data[at : at + span]
        elif what == "cut" and chance.random() < 0.2:
            del data[at:]
    return bytes(data)
