"""Flow solved in packings of one point, each kept as soon as it is finished; and what they say together."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from filtercake.errors import PackingRejected
from filtercake.filtration.resistance import KozenyConstant
from filtercake.packing.pack import MANIFEST, Outcome
from filtercake.packing.result import Packing, publish, read_record, read_sealed, sealed, sha256, write_json
from filtercake.packing.scene import digest
from filtercake.permeability.result import Permeability, Picture

RECORD: Final = "permeability.json"
"""Name of the record of all solved packings of a point."""
PICTURE: Final = "cut.npz"
"""Name of the picture of the first one; its record holds the picture's checksum."""

Report = Callable[[str], None]


def solve_replicates(
    packings: Path, folder: Path, count: int, *, accuracy: float, code: str, report: Report, note: Report
) -> None:
    """Solve the flow in the first accepted packings of a point, and write the record of them.

    What an earlier run solved of the same packings with the same code and accuracy is kept.

    Parameters
    ----------
    packings, folder : Path
        The point's packings; where records and picture go.
    count : int
        How many packings.
    accuracy : float
        Relative half-width of the numerical error asked for.
    code : str
        Hash of the code that solves.
    report, note : callable
        Receive a line per packing, and a line per lattice.

    Raises
    ------
    FiltercakeError
        If a packing cannot be solved.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any]] = []
    for outcome in _accepted(packings, count):
        packing = Packing.load(packings / f"r{outcome.replicate}.npz")
        key = digest({"packing": packing.diagnostics["sha256"], "accuracy": accuracy, "code": code})
        picture = folder / PICTURE if not rows else None
        row = _kept(folder / f"r{outcome.replicate}.json", key, picture)
        if row is None:
            found, cut = _solve(
                packing,
                accuracy,
                lambda line, who=outcome.replicate: note(f"r{who} {line}"),  # type: ignore[misc]
                picture=picture is not None,
            )
            row = {"key": key, "replicate": outcome.replicate, **row_of(found)}
            if cut is not None:
                row["picture"] = _write_picture(folder / PICTURE, cut)
            write_json(folder / f"r{outcome.replicate}.json", sealed(row))
            report(f"r{outcome.replicate}: k = {found.permeability:.4g} m2, {found.seconds:.1f} s")
        rows.append(row)
    write_json(folder / RECORD, sealed({"packings": rows}))


def _solve(packing: Packing, accuracy: float, say: Report, *, picture: bool) -> tuple[Permeability, Picture | None]:
    """Solve the flow in a settled bed between its floor and surface, in a pressed cell whole."""
    # who reads what was solved need not wait for the compiler
    from filtercake.permeability.measure import bed_domain, cell_domain, solve

    position, radius, length = packing.position, packing.radius, packing.length
    if packing.is_cell:
        domain = cell_domain(position, radius, np.full(3, length), accuracy)
    else:
        domain = bed_domain(position, radius, length, accuracy)
    return solve(domain, accuracy, say=say, picture=picture)


def row_of(found: Permeability) -> dict[str, Any]:
    """Plain values of a result, with its numerical half-width."""
    return {**asdict(found), "numerical_ci95": found.numerical_ci95}


def read_picture(folder: Path) -> Picture | None:
    """Read the picture of a point from its folder; None where no packing was accepted.

    Raises
    ------
    PackingRejected
        If the record or the picture is missing or damaged.
    """
    pictured = [row for row in read_sealed(folder / RECORD)["packings"] if "picture" in row]
    if not pictured:
        return None
    if not _is_whole(folder / PICTURE, pictured[0]):
        raise PackingRejected([f"{PICTURE} is not the picture that was made; remove {RECORD} to make it again"])
    with np.load(folder / PICTURE) as data:
        return Picture(data["speed"], float(data["spacing"]), float(data["bottom"]))


def read_solved(path: Path) -> dict[int, dict[str, Any]]:
    """Read the record of a point: what was found, by replicate.

    Raises
    ------
    PackingRejected
        If the record is missing or damaged.
    """
    return {int(row["replicate"]): row for row in read_sealed(path)["packings"]}


def constant_of(rows: Iterable[Mapping[str, Any]]) -> KozenyConstant | None:
    """Mean Kozeny constant of solved packings of one kind, and its relative 95 % half-width; None without any.

    What two or three of them spread says little: the half-width is that of the ``SPREAD`` of
    many packings, and the numerical one, which they share.
    """
    found = list(rows)
    if not found:
        return None
    slab = math.sqrt(sum(row["slab"] ** 2 for row in found)) / len(found)
    numerical = float(np.mean([row["numerical_ci95"] for row in found]))
    return KozenyConstant(float(np.mean([row["kozeny_constant"] for row in found])), math.hypot(slab, numerical))


def _accepted(packings: Path, count: int) -> Iterable[Outcome]:
    outcomes = [Outcome(**entry) for entry in read_record(packings / MANIFEST)["replicates"]]
    return [outcome for outcome in outcomes if outcome.status == "ok"][:count]


def _kept(path: Path, key: str, picture: Path | None) -> dict[str, Any] | None:
    """Return what an earlier run found, if it is whole and of the same packing."""
    try:
        row = read_sealed(path)
    except PackingRejected:
        return None
    whole = picture is None or _is_whole(picture, row)
    return row if whole and row.get("key") == key else None


def _is_whole(picture: Path, row: Mapping[str, Any]) -> bool:
    return picture.is_file() and sha256(picture) == row.get("picture")


def _write_picture(path: Path, picture: Picture) -> str:
    """Write a picture and return its checksum."""
    with publish(path) as temporary:
        with temporary.open("wb") as stream:
            speed = picture.speed.astype(np.float32)
            np.savez_compressed(stream, speed=speed, spacing=picture.spacing, bottom=picture.bottom)
        return sha256(temporary)
