"""Choice of the engine for ``engine: auto`` on this machine."""

from __future__ import annotations

from collections.abc import Iterable

from filtercake.errors import ConfigError, Problem
from filtercake.packing.engines import ENGINES
from filtercake.packing.scene import Scene
from filtercake.study.config.packing import AUTO
from filtercake.study.loading import LoadedStudy


def choose(scene: Scene) -> str:
    """Name the engine for ``engine: auto``: the first that suits the scene and runs here."""
    return next(name for name, kind in ENGINES.items() if kind.suits(scene) and kind().why_missing() is None)


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
        reason = ENGINES[asked]().why_missing() if asked != AUTO else None
        if reason is not None:
            allowed = f"an engine that runs on this machine (auto takes one); {reason}"
            problems.append(Problem(str(study.path), "packing.engine", asked, allowed))
    if problems:
        raise ConfigError(problems)
