"""What a field of the config model means and allows, in words."""

from __future__ import annotations

import types
from collections.abc import Iterator
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, WithJsonSchema
from pydantic.fields import FieldInfo


def meaning(field: FieldInfo) -> str:
    """Return the description of a field in the model."""
    return (field.description or "").strip()


def allowed(field: FieldInfo) -> str:
    """Return the allowed values of a field, from its annotation and bounds."""
    metadata = [*field.metadata, *_inner_metadata(field.annotation)]
    for item in metadata:
        if isinstance(item, WithJsonSchema) and item.json_schema:
            return ", ".join(f"`{name}`" for name in item.json_schema["enum"])
    kinds = list(dict.fromkeys(_kinds(field.annotation)))
    bounds = list(_bounds(metadata))
    return " ".join([" or ".join(kinds), *([", ".join(bounds)] if bounds else [])])


def _kinds(annotation: Any) -> Iterator[str]:
    origin = get_origin(annotation)
    if origin is Literal:
        yield ", ".join(f"`{value}`" for value in get_args(annotation))
    elif origin in (list, dict):
        inner = get_args(annotation)[-1]
        yield ("list of " if origin is list else "mapping of names to ") + " or ".join(dict.fromkeys(_kinds(inner)))
    elif origin in (Union, types.UnionType) or hasattr(annotation, "__metadata__"):
        for part in get_args(annotation)[: 1 if hasattr(annotation, "__metadata__") else None]:
            if part is not type(None):
                yield from _kinds(part)
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield f"{annotation.__name__.lower()} block"
    else:
        names = {bool: "true/false", int: "whole number", float: "number", str: "text"}
        yield names.get(annotation, str(annotation))


def _inner_metadata(annotation: Any) -> Iterator[Any]:
    yield from getattr(annotation, "__metadata__", ())
    for part in get_args(annotation):
        if not isinstance(part, str):
            yield from _inner_metadata(part)


def _bounds(metadata: list[Any]) -> Iterator[str]:
    signs = (
        ("gt", ">"),
        ("ge", ">="),
        ("lt", "<"),
        ("le", "<="),
        ("min_length", "at least"),
        ("max_length", "at most"),
    )
    seen = set()
    for item in metadata:
        for part in (item, *getattr(item, "metadata", ())):
            for name, sign in signs:
                value = getattr(part, name, None)
                if value is not None and (name, value) not in seen:
                    seen.add((name, value))
                    yield f"{sign} {value:g}" + (" long" if "length" in name else "")
