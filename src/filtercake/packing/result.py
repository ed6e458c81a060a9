"""A packing and its record: what an engine returns, what is written to disk, and how it is read back."""

from __future__ import annotations

import hashlib
import json
import os
import re
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from filtercake.errors import PackingRejected
from filtercake.packing.scene import FILTRATION_PROTOCOL, digest
from filtercake.packing.settling import Trajectory
from filtercake.units import FloatArray

TEMPORARY = re.compile(r"\..+\.[a-z0-9_]{8}")
"""Matches the names that :func:`publish` writes to."""
SEAL = "seal"
"""Key of a record's checksum over its other entries."""


@dataclass(frozen=True)
class SettledState:
    """Result of an engine, not yet accepted.

    Attributes
    ----------
    position, velocity : ndarray, shape (n, 3)
        Final centres (m) and velocities (m/s); x and y wrapped into [0, length).
    radius : ndarray, shape (n,)
        Radii, m, in the same order.
    length : float
        Side of the periodic box, m.
    trajectory : Trajectory
        The record the stop rule worked on.
    steps : int
        Time steps run.
    expected : int
        Spheres the packing started with.
    dangerous_builds : int
        Neighbour lists the engine itself calls late.
    engine, engine_version : str
        Engine name and version.
    warnings : tuple of str
        The engine's own warnings.
    wall_time : float
        Seconds of wall clock in the engine.
    """

    position: FloatArray
    velocity: FloatArray
    radius: FloatArray
    length: float
    trajectory: Trajectory
    steps: int
    expected: int
    dangerous_builds: int
    engine: str
    engine_version: str
    warnings: tuple[str, ...] = ()
    wall_time: float = 0.0


@dataclass(frozen=True)
class Packing:
    """An accepted packing.

    Attributes
    ----------
    position : ndarray, shape (n, 3)
        Centres, m.
    radius : ndarray, shape (n,)
        Radii, m.
    length : float
        Side of the periodic box, m.
    diagnostics : dict
        Plain values: engine, version, N, L, steps, wall time, settled, overlaps, energy, seed, trajectory.
    """

    position: FloatArray
    radius: FloatArray
    length: float
    diagnostics: dict[str, Any] = field(default_factory=dict)

    @property
    def is_cell(self) -> bool:
        """Whether it is a pressed cell, periodic in all directions, instead of a bed on a floor."""
        return self.diagnostics.get("protocol") == FILTRATION_PROTOCOL

    def save(self, npz: Path) -> str:
        """Write the geometry beside its diagnostics, each published whole; return the geometry's SHA-256.

        The diagnostics (``.json``) come last and name the geometry's hash, so a pair is complete or absent.
        """
        with publish(npz) as temporary:
            with temporary.open("wb") as stream:
                np.savez(stream, position=self.position, radius=self.radius, **self._room())
            checksum = sha256(temporary)
        write_json(npz.with_suffix(".json"), sealed({**self.diagnostics, "sha256": checksum}))
        return checksum

    def _room(self) -> dict[str, Any]:
        """Where the spheres are: a file without its record must still tell a cell from a bed on a floor."""
        return {"box": np.full(3, self.length)} if self.is_cell else {"length": np.float64(self.length)}

    @classmethod
    def load(cls, npz: Path) -> Packing:
        """Read a packing back.

        Raises
        ------
        PackingRejected
            If a file is missing, damaged, or not the one that was accepted.
        """
        record = read_sealed(npz.with_suffix(".json"))
        try:
            if sha256(npz) != record.get("sha256"):
                raise PackingRejected([f"{npz.name} is not the file that was accepted (checksum differs)"])
            with np.load(npz) as data:
                length = data["box"][0] if "box" in data.files else data["length"]
                return cls(data["position"], data["radius"], float(length), record)
        except (OSError, EOFError, ValueError, KeyError, IndexError, zipfile.BadZipFile) as error:
            raise PackingRejected([f"{npz.name} cannot be read: {error}"]) from None


def read_record(path: Path) -> dict[str, Any]:
    """Read a packing's diagnostics.

    Raises
    ------
    PackingRejected
        If the file is missing or is not the JSON object that was written.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise PackingRejected([f"{path.name} cannot be read: {error}"]) from None
    if not isinstance(record, dict):
        raise PackingRejected([f"{path.name} does not hold a packing's record"])
    return record


def sealed(record: dict[str, Any]) -> dict[str, Any]:
    """Add the checksum of a record's entries to it."""
    return {**record, SEAL: digest(record)}


def read_sealed(path: Path) -> dict[str, Any]:
    """Read a record that carries its own checksum, which is left out.

    Raises
    ------
    PackingRejected
        If the file is missing, or is not what was written.
    """
    record = read_record(path)
    seal = record.pop(SEAL, None)
    if seal != digest(record):
        raise PackingRejected([f"{path.name} is not the record that was written (checksum differs)"])
    return record


@contextmanager
def publish(path: Path) -> Iterator[Path]:
    """Give a temporary name to write to, and move it to ``path`` only when the block ends without an error."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        with temporary.open("rb") as stream:
            os.fsync(stream.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_json(path: Path, value: Any) -> None:
    """Write JSON so that readers see the old file or the new one, never a part."""
    with publish(path) as temporary:
        temporary.write_text(json.dumps(value, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def sha256(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
