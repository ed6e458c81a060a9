"""Check what a file or a call gives against its model; every problem is reported, with file, key, value and range."""

from __future__ import annotations

from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from filtercake.errors import LONGEST_SHOWN, ConfigError, Problem, did_you_mean, shown

MOST_PROBLEMS = 1000
"""Problems of a file that are looked into."""
RENAMED = {
    "slurry_density_kg_m3": ("slurry_concentration_kg_m3", "solids_per_filtrate_kg_m3"),
    "slurry_concentration_kg_m3": ("solids_per_filtrate_kg_m3",),
    "slurry_density_exponent": ("slurry_concentration_exponent",),
    "porosity_interval": ("porosity_ci95_target",),
    "target_interval": ("relative_ci95_target",),
    "column_ratio": ("bed_depth_factor",),
    "void_fraction": ("initial_void_fraction",),
}
"""Keys of earlier versions, and what they are called now."""

M = TypeVar("M", bound=BaseModel)


def parse(model: type[M], values: Any, file: str) -> M:
    """Check what :func:`~filtercake.user_files.read_yaml` returned for a file against the model of that file.

    Raises
    ------
    ConfigError
        With every problem.
    """
    if not isinstance(values, dict):
        raise ConfigError([Problem(file, "(file)", shown(values), "must be a mapping of keys to values")])
    try:
        return model.model_validate(values)
    except ValidationError as error:
        found = error.errors(include_url=False)
        raise ConfigError([_problem(model, item, file) for item in found[:MOST_PROBLEMS]]) from None


def _problem(model: type[BaseModel], item: Any, file: str) -> Problem:
    location = [part for part in item["loc"] if part != "[key]"]
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{_plain(part)}" for part in location)
    key = key.lstrip(".") or "(file)"
    value, message = shown(item["input"]), item["msg"].removeprefix("Value error, ")
    if item["type"] == "extra_forbidden":
        allowed = _allowed_keys(model, location[:-1])
        new = next((name for name in RENAMED.get(str(location[-1]), ()) if name in allowed), None)
        message = f"unknown key; allowed here: {', '.join(allowed)}{did_you_mean(str(location[-1]), allowed)}"
        if new is not None:
            message = f"is now called {new}"
    elif item["type"] == "missing":
        value, message = "(missing)", "must be given"
    elif item["type"] == "literal_error":
        message = f"allowed: {item['ctx']['expected']}"
    elif item["type"] == "too_short":
        least = item["ctx"]["min_length"]
        message = "must hold at least one value" if least == 1 else f"must hold at least {least} values"
    elif " should " in message:
        message = "must " + message.partition(" should ")[2]
    return Problem(file, key, value, message)


def _plain(word: str) -> str:
    """Write a key as it is, or as a short literal where it would spoil the message."""
    return word if word.isprintable() and len(word) <= LONGEST_SHOWN else shown(word)


def _allowed_keys(model: type[BaseModel], location: list[Any]) -> list[str]:
    """Keys of the part of the model that a location leads to."""
    named_by_user = False
    for part in location:
        if isinstance(part, int) or named_by_user:
            named_by_user = False
        elif part in model.model_fields:
            annotation = model.model_fields[part].annotation
            named_by_user = get_origin(annotation) is dict
            model = _inner_model(annotation) or model
    return list(model.model_fields)


def _inner_model(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for arg in get_args(annotation) if (found := _inner_model(arg))), None)
