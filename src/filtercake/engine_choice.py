"""Which engine a study uses on this machine."""

from __future__ import annotations

from collections.abc import Iterable

from filtercake.config_loading import LoadedStudy
from filtercake.csd import CrystalSizeDistribution
from filtercake.errors import ConfigError, Problem
from filtercake.packing.engines import ENGINES

PREFERENCE = ("liggghts",)
"""Engines for ``engine: auto``, best first."""


def choose(csd: CrystalSizeDistribution, particles: int) -> str:  # noqa: ARG001 - what a later engine decides on
    """Name the engine for ``engine: auto``: the first of ``PREFERENCE`` that runs here."""
    for name in PREFERENCE:
        if ENGINES[name]().why_missing() is None:
            return name
    return PREFERENCE[0]


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
        reasons = [ENGINES[name]().why_missing() for name in (PREFERENCE if asked == "auto" else (asked,))]
        if all(reason is not None for reason in reasons):
            allowed = f"an engine installed on this machine; {reasons[-1]}"
            problems.append(Problem(str(study.path), "packing.engine", asked, allowed))
    if problems:
        raise ConfigError(problems)
