"""Choice of the engine for ``engine: auto`` on this machine."""

from __future__ import annotations

from collections.abc import Iterable

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import ConfigError, Problem
from filtercake.packing.cloud import NARROW
from filtercake.packing.engines import ENGINES
from filtercake.study.limits import LIGGGHTS_RESTITUTION
from filtercake.study.loading import LoadedStudy

SMALL_BED = 10_000
"""Spheres up to which LIGGGHTS is taken whatever the width of the distribution."""


def choose(csd: CrystalSizeDistribution, particles: int, restitution: float) -> str:
    """Name the engine for ``engine: auto``.

    LIGGGHTS where it is installed, takes the restitution, and the bed is small or narrow; the embedded engine
    everywhere else: LIGGGHTS lists neighbours on one grid, which a wide distribution fills with pairs that never
    touch.
    """
    fast = particles <= SMALL_BED or csd.largest <= NARROW * csd.smallest
    suits = fast and restitution > LIGGGHTS_RESTITUTION
    return "liggghts" if suits and ENGINES["liggghts"]().why_missing() is None else "embedded"


def check(studies: Iterable[LoadedStudy]) -> None:
    """Make sure that every study's engine can run here.

    Raises
    ------
    ConfigError
        Naming each study whose engine is missing.
    """
    problems = []
    for study in studies:
        asked = study.model.packing.engine
        reason = ENGINES[asked]().why_missing() if asked != "auto" else None
        if reason is not None:
            allowed = f"an engine that runs on this machine (auto takes one); {reason}"
            problems.append(Problem(str(study.path), "packing.engine", asked, allowed))
    if problems:
        raise ConfigError(problems)
