"""Types of the values of a configuration: numbers as YAML gives them, names, paths, texts, and their bounds."""

from __future__ import annotations

import math
import re
import unicodedata
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema

from filtercake.errors import did_you_mean
from filtercake.filtration.resistance import RESISTANCE_LAWS
from filtercake.packing.scene import PROTOCOLS
from filtercake.study import limits
from filtercake.units import NUMBER
from filtercake.user_files import as_written

NAME = re.compile(r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}\Z")
"""What a study or a distribution may be called: it names files and folders."""

LARGEST_INTEGER = 10**18
"""Whole numbers beyond this fit neither the arrays nor the programs they go to."""

UNSEEN = ("Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp")
"""Unicode categories of what cannot be seen: control and format characters, halves of characters, line ends."""

FORMULA_STARTS = ("=", "+", "-", "@")

NOT_IN_PATHS = "{}"
"""Characters that Snakemake would take for a wildcard."""

LONGEST_NAME = 255
"""Bytes of a file's or folder's name that file systems allow."""

MOST_POINTS = 10_000
"""Points of a study; each is a job of its own."""
MOST_PARTICLES = limits.MOST_PARTICLES
"""Spheres of a packing."""
MOST_VALUES = 1000
"""Entries of a list."""


def _number(value: Any) -> Any:
    """Accept what YAML 1.1 reads as text (1e5, 5e-1); refuse booleans, and whole numbers that are no floats."""
    if isinstance(value, bool):
        raise ValueError("must be a number, not true/false")
    if isinstance(value, str):
        if not NUMBER.fullmatch(value.strip()):
            raise ValueError("must be a number (with a decimal point)")
        return float(value)
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        raise ValueError(f"must be between -{LARGEST_INTEGER:g} and {LARGEST_INTEGER:g}")
    return value


def _whole(value: Any) -> Any:
    value = _number(value)
    if isinstance(value, float):
        if not math.isfinite(value) or value != int(value):
            raise ValueError("must be a whole number")
        return int(value)
    return value


def _listed(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


def _name(value: Any) -> Any:
    """Take a name as it is written, also where YAML takes it for a number."""
    value = as_written(value)
    if value is None or isinstance(value, bool):
        raise ValueError("is no text to YAML; if it is a name, write it in quotes")
    if not isinstance(value, str) or not NAME.match(value):
        raise ValueError("must be letters, digits, - and _, starting with a letter or digit, at most 64 long")
    return value


def _text(value: Any) -> Any:
    """Take away the blanks around a text; refuse what would break a line, a figure or a table that shows it."""
    value = as_written(value)
    if not isinstance(value, str):
        return value
    text = value.strip()
    if any(unicodedata.category(character) in UNSEEN for character in text):
        raise ValueError("must be one line of visible characters")
    if "$" in text:
        raise ValueError("must not hold $, which starts a formula in figures")
    if text.startswith(FORMULA_STARTS):
        raise ValueError(f"must not start with {' or '.join(FORMULA_STARTS)}, which start a formula in spreadsheets")
    return text


def _path(value: Any) -> Any:
    """Refuse what no file is called, or Snakemake would not take as it is."""
    value = as_written(value)
    if not isinstance(value, str):
        return value
    unseen = any(unicodedata.category(character) in UNSEEN for character in value)
    if unseen or value != value.strip() or set(value) & set(NOT_IN_PATHS):
        raise ValueError("must be a path of visible characters, without { and }")
    if any(len(part.encode()) > LONGEST_NAME for part in value.split("/")):
        raise ValueError(f"must be a path, no part of it longer than {LONGEST_NAME} bytes")
    return value


def _law(name: str) -> str:
    """Refuse what no resistance law is called."""
    if name not in RESISTANCE_LAWS:
        known = ", ".join(map(repr, RESISTANCE_LAWS))
        raise ValueError(f"allowed: {known}{did_you_mean(name, RESISTANCE_LAWS)}")
    return name


def _protocol(name: str) -> str:
    """Refuse what no protocol is called."""
    if name not in PROTOCOLS:
        raise ValueError(f"allowed: {', '.join(map(repr, PROTOCOLS))}{did_you_mean(name, PROTOCOLS)}")
    return name


# the bounds stand before the conversion, or they are lost from the JSON schema
TO_NUMBER = BeforeValidator(_number)
TO_WHOLE = BeforeValidator(_whole)
Name = Annotated[str, BeforeValidator(_name)]
PathText = Annotated[str, Field(min_length=1, max_length=1000), BeforeValidator(_path)]
TO_TEXT = BeforeValidator(_text)
LISTED = BeforeValidator(_listed)
ENTRIES = Field(min_length=1, max_length=MOST_VALUES)

Density = Annotated[float, Field(ge=1, le=limits.LARGEST_DENSITY, allow_inf_nan=False), TO_NUMBER]
YoungsModulus = Annotated[float, Field(ge=0.5, le=100_000, allow_inf_nan=False), TO_NUMBER]
PoissonRatio = Annotated[float, Field(ge=0, lt=0.5, allow_inf_nan=False), TO_NUMBER]
Restitution = Annotated[float, Field(ge=0.001, lt=1, allow_inf_nan=False), TO_NUMBER]
Friction = Annotated[float, Field(ge=0, le=2, allow_inf_nan=False), TO_NUMBER]
Adhesion = Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False), TO_NUMBER]
Pressure = Annotated[float, Field(ge=0.001, le=10_000, allow_inf_nan=False), TO_NUMBER]
CrystalModulus = Annotated[float, Field(ge=1e-4, le=2000, allow_inf_nan=False), TO_NUMBER]
Cohesion = Annotated[float, Field(ge=0, le=1e7, allow_inf_nan=False), TO_NUMBER]
Protocol = Annotated[str, AfterValidator(_protocol), WithJsonSchema({"enum": [*PROTOCOLS], "type": "string"})]
LawName = Annotated[str, AfterValidator(_law), WithJsonSchema({"enum": [*RESISTANCE_LAWS], "type": "string"})]

ResidenceTime = Annotated[float, Field(ge=0.001, le=100_000, allow_inf_nan=False), TO_NUMBER]


class Model(BaseModel):
    """Base of all parts: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)
