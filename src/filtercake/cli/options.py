"""Options of the command line, made from the config model: names, units, ranges and defaults are the model's own."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NoReturn

from filtercake.api.arguments import ORIGIN, SOURCES
from filtercake.errors import ConfigError, FiltercakeError, Problem, did_you_mean

if TYPE_CHECKING:
    from pydantic import BaseModel
    from pydantic.fields import FieldInfo

SOURCE_FIELDS = (
    "kinetics",
    "kinetics_file",
    "slurry_concentration_kg_m3",
    "residence_time_min",
    "bin_width_um",
    "truncate_below_volume_fraction",
    "truncate_below_um",
    "truncate_above_um",
)
"""Options of a distribution that are keys of a study's crystallizer, or of its distributions."""
SOURCE_OPTIONS = ("file", "mixture", "lognormal", "rosin_rammler", *SOURCE_FIELDS)
SAID_OTHERWISE = {
    "residence_time_min": "Residence time of the crystallizer, min; goes with --kinetics.",
    "kinetics": "Crystallizer's product: a preset (ammonium_alum, potassium_nitrate), or a name in --kinetics-file.",
    "slurry_concentration_kg_m3": "Crystals in the slurry, kg/m3 (= g/L); goes with --kinetics.",
    "kinetics_file": "YAML with kinetics of your own.",
}
"""Help where the model speaks of a study file."""
DEFAULT_OTHERWISE = {"truncate_below_volume_fraction": "0; 0.001 with --kinetics, --lognormal and --rosin-rammler"}
SOURCES_SHOWN = "FILE, --mixture, --lognormal, --rosin-rammler and --kinetics"
NOT_GIVEN = "(missing)"


class UsageError(FiltercakeError):
    """The command line is not understood."""


class Parser(argparse.ArgumentParser):
    """Reports errors in one line, without the usage text."""

    def __init__(self, **settings: Any):
        settings.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        super().__init__(allow_abbrev=False, **settings)

    def error(self, message: str) -> NoReturn:
        """Report a command line that is not understood."""
        raise UsageError(f"{message} (see {self.prog} --help)")


def flag(name: str) -> str:
    """Write the option of a key of the configuration."""
    return "FILE" if name == "file" else "--" + name.replace("_", "-")


def add_field(group: argparse._ArgumentGroup, name: str, field: FieldInfo, text: str | None = None) -> None:
    """Add the option of a key, with a text instead of the model's; its value stays text, for the model to check."""
    from filtercake.cli.fields import allowed, meaning

    names = dict.fromkeys((flag(name), flag(name).lower()))
    if field.annotation is bool:
        group.add_argument(*names, dest=name, action="store_const", const=True, help=_escape(meaning(field)))
        return
    range_ = allowed(field).replace("`", "")
    group.add_argument(*names, dest=name, metavar=_metavar(range_), help=_escape(_help(name, field, range_, text)))


def add_model(group: argparse._ArgumentGroup, model: type[BaseModel]) -> None:
    """Add an option for every key of a part of the configuration."""
    for name, field in model.model_fields.items():
        add_field(group, name, field)


def add_source(parser: argparse.ArgumentParser) -> None:
    """Add the options that give a size distribution."""
    from filtercake.study.config.crystals import Crystallizer, Csd

    group = parser.add_argument_group(f"size distribution (one of {SOURCES_SHOWN})")
    group.add_argument(
        "file",
        nargs="?",
        metavar="FILE",
        help="CSV with the columns size_um,volume_fraction, or as a spreadsheet or an instrument writes it",
    )
    group.add_argument(
        "--mixture", metavar="UM:FRACTION,...", help="sizes in um with their volume fractions: 20:0.5,50:0.5"
    )
    group.add_argument(
        "--lognormal", metavar="D10,D50,D90", help="lognormal by volume: sizes in um that 10, 50 and 90 %% are below"
    )
    group.add_argument(
        "--rosin-rammler",
        metavar="UM,EXPONENT",
        help="Rosin-Rammler by volume: size in um that 36.8 %% is above, exponent",
    )
    fields = {**Crystallizer.model_fields, **Csd.model_fields}
    for name in SOURCE_FIELDS:
        add_field(group, name, fields[name], SAID_OTHERWISE.get(name))


def given(options: argparse.Namespace, names: Iterable[str]) -> dict[str, Any]:
    """Options of these names that were given."""
    return {name: value for name in names if (value := getattr(options, name, None)) is not None}


def source(options: argparse.Namespace) -> dict[str, Any]:
    """Arguments of :func:`filtercake.api.steps.distribution`."""
    found = given(options, SOURCE_OPTIONS)
    if "mixture" in found:
        found["mixture"] = _pairs(found["mixture"])
    for law in ("lognormal", "rosin_rammler"):
        if law in found:
            found[law] = [number.strip() for number in found[law].split(",")]
    return found


def in_words(error: FiltercakeError, known: Iterable[str]) -> str:
    """Text of an error in one line, with options in place of keys of the configuration."""
    if isinstance(error, UsageError):
        return str(error)
    names = set(known)
    if isinstance(error, ConfigError):
        return "; ".join(_problem_in_words(problem, names) for problem in error.problems)
    return with_flags("; ".join(str(error).splitlines()), names)


def with_flags(text: str, known: Iterable[str]) -> str:
    """Write keys of the configuration as options."""
    for name in sorted((name for name in known if "_" in name), key=len, reverse=True):
        text = re.sub(rf"(?<![\w-])(?:\w+\.)?{re.escape(name)}(?![\w-])", flag(name), text)
    return text.removeprefix(f"{ORIGIN}: ")


def unknown(words: list[str], known: Iterable[str]) -> str:
    """Message about unknown options, with the nearest known one."""
    word = words[0].partition("=")[0]
    return f"unknown argument {words[0]!r}{did_you_mean(word, known)}"


def _problem_in_words(problem: Problem, known: set[str]) -> str:
    if problem.file != str(ORIGIN):  # in a file, whose keys are no options
        return str(problem)
    name = _option_of(problem.key, known)
    allowed_ = problem.allowed
    if problem.key == "distribution":
        allowed_ = allowed_.replace(f"{', '.join(SOURCES[:-1])} and {SOURCES[-1]}", SOURCES_SHOWN)
    text = with_flags(allowed_, known)
    value = problem.value.strip("'")
    if name == "file" and value and text.startswith(value):
        return text
    if name is None:
        shown = "" if value in ("", NOT_GIVEN) else f" {value}"
        return f"{problem.key}{shown}: {text}" if problem.key == "distribution" else text
    if value in (NOT_GIVEN, "None"):
        return f"{flag(name)}: {text if problem.value == NOT_GIVEN else 'must be given'}"
    return f"{flag(name)} = {value}: {text}" if value else f"{flag(name)}: {text}"


def _option_of(key: str, known: set[str]) -> str | None:
    """Option that a key of the checked study stands for."""
    parts = re.sub(r"\[\d+\]", "", key).split(".")
    for source_ in ("mixture", "lognormal", "rosin_rammler"):
        if source_ in parts:
            return source_
    return next((part for part in reversed(parts) if part in known), None)


def _pairs(text: str) -> list[tuple[str, str]]:
    found = []
    for item in text.split(","):
        size, colon, fraction = item.partition(":")
        if not colon:
            allowed_ = "must be sizes in um with their volume fractions: 20:0.5,50:0.5"
            raise ConfigError([Problem(str(ORIGIN), "mixture", repr(text), allowed_)])
        found.append((size.strip(), fraction.strip()))
    return found


def _help(name: str, field: FieldInfo, range_: str, instead: str | None) -> str:
    from filtercake.cli.fields import meaning

    text = instead or meaning(field)
    if range_ == "text":
        return text
    if name in DEFAULT_OTHERWISE:
        default = f" Default: {DEFAULT_OTHERWISE[name]}."
    elif field.is_required() and instead is None:
        default = " Required."
    else:
        default = "" if field.is_required() or field.default is None else f" Default: {_plain(field.default)}."
    return f"{text} Allowed: {range_}.{default}"


def _plain(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _metavar(range_: str) -> str:
    words: Mapping[str, str] = {"number": "X", "whole": "N", "text": "NAME"}
    return words.get(range_.split()[0], "NAME")


def _escape(text: str) -> str:
    return text.replace("%", "%%")
