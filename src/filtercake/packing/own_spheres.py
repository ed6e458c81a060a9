"""Spheres from anywhere, a settled bed or a periodic cell: read from an ``.npz``, and checked.

The file holds ``position`` (n, 3) and ``radius`` (n,), and either ``length``, the side of the box of a bed, or ``box``
(3,), the sides of a cell; all in m.
"""

from __future__ import annotations

import io
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from filtercake.errors import ConfigError, Problem, did_you_mean, shown
from filtercake.packing.slab import interior_slab, why_too_thin
from filtercake.units import FloatArray
from filtercake.user_files import Unusable, read_bytes

SHAPES: Final = {"position": "(n, 3)", "radius": "(n,)", "length": "one number", "box": "(3,)"}
"""Arrays of a file, and their shapes."""
LARGEST_RADIUS: Final = 0.1
"""Radius, m, that no crystal has: another unit is meant."""
LARGEST_FILE: Final = 500_000_000
"""Bytes of a file, and of its arrays; two million spheres take 64 MB."""
ROUNDING: Final = 1e-6
"""Share of a side by which spheres may lie outside, and sides be off a whole multiple."""
LEAST_SOLIDS, MOST_SOLIDS = 0.001, 0.95
"""Volume of the spheres over that of their box beyond which the two are in different units."""
_UNREADABLE = (
    *(ValueError, OSError, EOFError, LookupError, RuntimeError, ArithmeticError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, tokenize.TokenError, SyntaxError),
)


@dataclass(frozen=True)
class OwnSpheres:
    """Checked spheres in their box.

    Attributes
    ----------
    position : ndarray, shape (n, 3)
        Centres, m.
    radius : ndarray, shape (n,)
        Radii, m.
    box : ndarray, shape (3,), or None
        Sides of a cell that is periodic in all directions, m; None for a bed.
    length : float
        Side of the box, m, of a bed, which is periodic in x and y and lies on a floor at z = 0; the first of a cell.
    origin : str
        File, or what stands for it in messages.
    density : float or None
        Density of the solid, kg/m3, where it is known.
    """

    position: FloatArray
    radius: FloatArray
    box: FloatArray | None
    length: float
    origin: str
    density: float | None = None


def read_spheres(npz: Path) -> OwnSpheres:
    """Read spheres from a file.

    Raises
    ------
    ConfigError
        With every problem of the file, or of its arrays.
    """
    try:
        return check_spheres(_arrays(read_bytes(npz, LARGEST_FILE)), str(npz))
    except Unusable as error:
        raise ConfigError([Problem(str(npz), "(file)", "", str(error))]) from None


def check_spheres(arrays: Mapping[str, Any], origin: str, density: float | None = None) -> OwnSpheres:
    """Check arrays, named as in a file; ``origin`` stands for the file in messages.

    Raises
    ------
    ConfigError
        With every problem that is found at once: keys, then shapes, then values, then the bed.
    """
    _refuse(origin, _keys(arrays))
    found = {name: _numbers(arrays[name]) for name in SHAPES if name in arrays}
    _refuse(origin, _shapes(arrays, found))
    whole = {name: value for name, value in found.items() if value is not None}
    _refuse(origin, _values(whole))
    position, radius, is_bed = whole["position"], whole["radius"], "length" in whole
    sides = np.full(2, float(whole["length"])) if is_bed else whole["box"]
    _refuse(origin, _places(position, radius, sides, is_bed))
    _refuse(origin, _bed(position, radius) if is_bed else _cell(sides))
    _refuse(origin, _filling(position, radius, sides))
    return OwnSpheres(position, radius, None if is_bed else sides, float(sides[0]), origin, density)


Found = Iterator[tuple[str, str, str]]
"""Key, value and what is allowed, of each problem."""


def _refuse(origin: str, found: Found) -> None:
    problems = [Problem(origin, *item) for item in found]
    if problems:
        raise ConfigError(problems)


def _arrays(content: bytes) -> dict[str, Any]:
    """Take the arrays out of a file's content; nothing in it is run, and what unpacks to too much is refused."""
    if not zipfile.is_zipfile(io.BytesIO(content)):
        raise Unusable("must be an .npz file, as numpy.savez writes it")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(member.file_size for member in archive.infolist()) > LARGEST_FILE:
                raise Unusable(f"must unpack to at most {LARGEST_FILE // 10**6} MB")
        with np.load(io.BytesIO(content), allow_pickle=False) as data:
            return {name: data[name] if name in SHAPES else None for name in data.files}
    except _UNREADABLE as error:
        raise Unusable(f"cannot be read: {shown(str(error))}") from None


def _keys(arrays: Mapping[str, Any]) -> Found:
    there = ", ".join(map(str, arrays)) or "nothing"
    for name in ("position", "radius"):
        if name not in arrays:
            near = did_you_mean(name, map(str, arrays))
            yield name, "(missing)", f"must be given, shape {SHAPES[name]}, in m; there is {there}{near}"
    if ("length" in arrays) == ("box" in arrays):
        value = "(both)" if "box" in arrays else "(missing)"
        meant = "length, the side of a bed's box, and box, the three sides of a periodic cell, in m"
        yield "length", value, f"must be exactly one of {meant}; there is {there}"


def _numbers(value: Any) -> FloatArray | None:
    """Array of numbers; None where it is no such thing."""
    try:
        array: NDArray[Any] = np.asarray(value)
    except ValueError:
        return None
    return np.array(array, dtype=np.float64) if array.dtype.kind in "iuf" else None


def _shapes(arrays: Mapping[str, Any], found: Mapping[str, FloatArray | None]) -> Found:
    counts = {}
    for name, array in found.items():
        if array is None:
            yield name, shown(arrays[name]), "must be numbers"
        elif not _fits(name, array):
            least = ", n at least 1" if SHAPES[name].startswith("(n") else ""
            yield name, f"array of shape {array.shape}", f"must be {SHAPES[name]}{least}"
        elif name in ("position", "radius"):
            counts[name] = len(array)
    if len(set(counts.values())) > 1:
        yield "radius", f"{counts['radius']} values", f"must be as many as positions: {counts['position']}"


def _fits(name: str, array: FloatArray) -> bool:
    return {
        "position": array.ndim == 2 and array.shape[1:] == (3,) and len(array) > 0,
        "radius": array.ndim == 1 and len(array) > 0,
        "length": array.ndim == 0,
        "box": array.shape == (3,),
    }[name]


def _values(found: Mapping[str, FloatArray]) -> Found:
    yield from _outside("position", found["position"], np.isfinite(found["position"]), "must be a finite number, in m")
    radius = found["radius"]
    good = (radius > 0.0) & (radius <= LARGEST_RADIUS)
    likely = "; is it in um or mm?" if (radius > LARGEST_RADIUS).any() else ""
    yield from _outside("radius", radius, good, f"must be above 0 and at most {LARGEST_RADIUS:g} m{likely}")
    least = 2.0 * float(radius.max()) if good.all() else 0.0
    for name in found.keys() & {"length", "box"}:
        sides = found[name]
        enough = (sides > 0.0) & (sides * (1.0 + ROUNDING) >= least) & np.isfinite(sides)
        allowed = f"must be at least the largest sphere's diameter, {least:g} m" if least else "must be above 0, in m"
        yield from _outside(name, sides, enough, allowed)


def _outside(name: str, values: FloatArray, good: NDArray[np.bool_], allowed: str) -> Found:
    """First value that is not good, and how many there are."""
    bad = np.argwhere(~good)
    if len(bad):
        place = "".join(f"[{k}]" for k in bad[0])
        more = f" ({len(bad):,} such values)" if len(bad) > 1 else ""
        yield name + place, f"{values[tuple(bad[0])]:g}", allowed + more


def _places(position: FloatArray, radius: FloatArray, sides: FloatArray, is_bed: bool) -> Found:
    """Spheres outside of their box; over a bed, there is no lid."""
    centres = position[:, : sides.size]
    good = (centres >= -ROUNDING * sides) & (centres <= (1.0 + ROUNDING) * sides)
    box = " x ".join(f"{side:g}" for side in sides)
    allowed = f"must be in the box, 0 to {box} m: shift the spheres so that it begins at 0"
    yield from _outside("position", centres, good, allowed)
    if is_bed:
        height, lowest = position[:, 2], float((position[:, 2] - radius).min())
        diameter = 2.0 * float(radius.max())
        if not -0.5 * diameter <= lowest <= diameter:
            k = int(np.argmin(height - radius))
            rest = f"the bed must lie on a floor at z = 0; its lowest sphere begins at {lowest:g} m"
            yield f"position[{k}][2]", f"{height[k]:g}", rest


def _bed(position: FloatArray, radius: FloatArray) -> Found:
    thin = why_too_thin(interior_slab(position, radius), radius)
    if thin:
        yield "position", "", thin


def _cell(sides: FloatArray) -> Found:
    multiples = sides / sides[0]
    good = np.abs(multiples - np.rint(multiples)) <= ROUNDING * multiples
    yield from _outside("box", sides, good, f"must be a whole multiple of the first side, {sides[0]:g} m")


def _filling(position: FloatArray, radius: FloatArray, sides: FloatArray) -> Found:
    """Spheres that fill their box too little or too much, as where the two are in different units."""
    height = float(sides[2]) if sides.size == 3 else float((position[:, 2] + radius).max())
    share = float(np.sum(4.0 / 3.0 * np.pi * radius**3)) / float(sides[0] * sides[1] * height)
    if not LEAST_SOLIDS <= share <= MOST_SOLIDS:
        allowed = f"spheres of {share:.3g} of the volume: must be {LEAST_SOLIDS:g} to {MOST_SOLIDS:g}; is all in m?"
        yield ("box" if sides.size == 3 else "length"), f"{sides[0]:g}", allowed
