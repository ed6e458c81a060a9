"""The file of the instant estimate: what its models were trained on, as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from filtercake.design.emulator import Emulator, Part
from filtercake.design.gaussian_process import Covariance, Process, Scatter
from filtercake.errors import ConfigError, Problem
from filtercake.packing.result import publish
from filtercake.units import FloatArray
from filtercake.user_files import Unusable, read_text

MODELS: Final = Path(__file__).with_name("emulator.json")
"""The models that come with the package."""
LARGEST_FILE: Final = 10_000_000
DIGITS: Final = 7
"""Significant digits that are kept: far beyond what is known."""


@lru_cache
def shipped() -> dict[str, Emulator]:
    """Read the models that come with the package, by protocol."""
    return read(MODELS)


def read(path: Path) -> dict[str, Emulator]:
    """Read models, by protocol.

    Raises
    ------
    ConfigError
        If the file cannot be read or holds no models.
    """
    try:
        return {name: _model(values) for name, values in json.loads(read_text(path, LARGEST_FILE)).items()}
    except Unusable as error:
        text = str(error)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        text = "must be as `make emulator` writes it"
    raise ConfigError([Problem(str(path), "(file)", "", text)])


def write(path: Path, models: Mapping[str, Emulator]) -> None:
    """Write models, by protocol."""
    with publish(path) as temporary:
        text = json.dumps({name: _plain(model) for name, model in models.items()}, indent=None)
        temporary.write_text(text.replace('"parts"', '\n"parts"').replace("], [", "],\n[") + "\n", encoding="utf-8")


def _plain(model: Emulator) -> dict[str, Any]:
    return {
        "protocol": model.protocol,
        "packings": model.packings,
        "widening": _short(model.widening),
        "lowest": _short(model.lowest),
        "highest": _short(model.highest),
        "load": [None if math.isinf(x) else float(x) for x in model.load],
        "shapes": _short(model.shapes),
        "rest": _short(model.rest),
        "parts": [
            {
                "columns": list(part.columns),
                "offset": _short(part.offset),
                "covariance": {name: _short(value) for name, value in vars(part.process.covariance).items()},
                "scatter": {name: _short(value) for name, value in vars(part.scatter).items()},
                "inputs": _short(part.process.inputs),
                "outputs": _short(part.process.outputs),
                "noise": _short(part.process.noise),
            }
            for part in model.parts
        ],
    }


def _model(values: Mapping[str, Any]) -> Emulator:
    return Emulator(
        protocol=values["protocol"],
        lowest=_array(values["lowest"]),
        highest=_array(values["highest"]),
        load=np.array([math.inf if x is None else float(x) for x in values["load"]]),
        shapes=_array(values["shapes"]).reshape(-1, len(values["load"])),
        parts=tuple(_part(part) for part in values["parts"]),
        rest=_array(values["rest"]),
        widening=float(values["widening"]),
        packings=int(values["packings"]),
    )


def _part(values: Mapping[str, Any]) -> Part:
    covariance = Covariance(**{**values["covariance"], "length": tuple(values["covariance"]["length"])})
    process = Process(covariance, *(_array(values[name]) for name in ("inputs", "outputs", "noise")))
    return Part(tuple(values["columns"]), float(values["offset"]), process, Scatter(**values["scatter"]))


def _array(values: Any) -> FloatArray:
    return np.array(values, dtype=np.float64)


def _short(values: Any) -> Any:
    """Plain numbers, rounded."""
    if np.ndim(values):
        return [_short(value) for value in values]
    return float(f"{float(values):.{DIGITS}g}")
