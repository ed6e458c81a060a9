"""Read what LIGGGHTS prints: a small parser that makes something of any text, complete or cut short."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from filtercake.packing.engines.micro import MICRO, UnitSystem
from filtercake.packing.settling import Trajectory

UNKNOWN_VERSION = "unknown"
"""Version of a program that does not say it is LIGGGHTS."""
_VERSION = re.compile(r"^LIGGGHTS \(Version (?P<version>.*?)(?:, compiled|\))")
_ERROR = re.compile(r"^ERROR(?: on proc \d+)?: (?P<text>.*)")
_WARNING = re.compile(r"^WARNING(?: on proc \d+)?: *(?P<text>\S.*)")
_DANGEROUS = re.compile(r"^Dangerous builds = (?P<count>\d{1,18})")
_INSERTED = re.compile(r"(?:particle insertion|insertion).*?inserted (?P<count>\d{1,18}) particle", re.IGNORECASE)
_STATE = re.compile(r"^@state (?P<values>.+)$")
_FINISHED = re.compile(r"^@finished (?P<step>\d{1,18})$")
_FORCED_END = re.compile(r"SIGTERM|SIGINT|signal \d+|restart.*signal", re.IGNORECASE)


@dataclass(frozen=True)
class LiggghtsLog:
    """What a run's output says.

    Attributes
    ----------
    version : str
        LIGGGHTS's own version text.
    error : str or None
        Its first error, with the input line it was reading.
    warnings : tuple of str
        Its warnings.
    states : ndarray, shape (m, 4)
        Step, mean height (um), kinetic energy (micro) and mass in the sample region (pg) of every check.
    dangerous_builds : int
        Late neighbour lists, over all runs.
    inserted : int or None
        Particles inserted, where LIGGGHTS inserts them itself.
    finished_step : int or None
        Last step where the deck ran to its end marker.
    forced_end : bool
        Whether a signal ended the run early.
    last_line : str
        Last line that is not empty, for when nothing else explains the end.
    """

    version: str
    error: str | None
    warnings: tuple[str, ...]
    states: np.ndarray[tuple[int, int], np.dtype[np.float64]]
    dangerous_builds: int
    inserted: int | None
    finished_step: int | None
    forced_end: bool
    last_line: str


def parse_log(text: str) -> LiggghtsLog:
    """Parse LIGGGHTS's screen output (made with ``-echo screen``)."""
    version, error, last_line, previous = UNKNOWN_VERSION, None, "", ""
    warnings: list[str] = []
    states: list[list[float]] = []
    dangerous, inserted, finished, forced = 0, None, None, False
    for raw in text.splitlines():
        line = raw.strip()
        if not line:
            continue
        if match := _STATE.match(line):
            row = _floats(match["values"])
            if row is not None:
                states.append(row)
        elif match := _FINISHED.match(line):
            finished = int(match["step"])
        elif match := _ERROR.match(line):
            error = error or f"{match['text']} (while reading: {previous})"
        elif match := _WARNING.match(line):
            warnings.append(match["text"])
        elif match := _DANGEROUS.match(line):
            # the count runs on over `run ... pre no`, so that the last word of each series is its total
            dangerous = max(dangerous, int(match["count"]))
        elif match := _VERSION.match(line):
            version = match["version"]
        elif match := _INSERTED.search(line):
            inserted = (inserted or 0) + int(match["count"])
        elif not line.startswith("print") and _FORCED_END.search(line):
            forced = True
        previous = last_line = line
    return LiggghtsLog(
        version=version,
        error=error,
        warnings=tuple(dict.fromkeys(warnings)),
        states=np.array(states, dtype=np.float64).reshape(-1, 4),
        dangerous_builds=dangerous,
        inserted=inserted,
        finished_step=finished,
        forced_end=forced,
        last_line=last_line,
    )


def trajectory(
    log: LiggghtsLog, time_step: float, length: float, density: float, units: UnitSystem = MICRO
) -> Trajectory:
    """Turn a log's states into SI (time step in s, length in m, density in kg/m3)."""
    step, height, energy, mass = log.states.T
    solids = mass * units.mass / density
    return Trajectory(
        time=step * time_step,
        mean_height=height * units.length,
        kinetic_energy=energy * units.energy,
        porosity_sample=1.0 - solids / length**3,
    )


def _floats(text: str) -> list[float] | None:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return None
    return values if len(values) == 4 else None
