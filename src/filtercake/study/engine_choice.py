"""Choice of the engine for ``engine: auto`` on this machine."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from filtercake.errors import ConfigError, Problem
from filtercake.packing.engines import ENGINES
from filtercake.packing.scene import Scene
from filtercake.study.config.packing import AUTO
from filtercake.study.loading import LoadedStudy


def choose(scene: Scene) -> str:
    """Name the engine for ``engine: auto``: the first that suits the scene and runs here, the embedded one."""
    return next(name for name, kind in ENGINES.items() if kind.suits(scene) and kind().why_missing() is None)


def of_this_machine(study: LoadedStudy) -> LoadedStudy:
    """Leave out the engines of a study's blocks that cannot run here, with a warning for each.

    Raises
    ------
    ConfigError
        If none of a block's engines can run here.
    """
    sweeps, warnings, problems = [], [], []
    for index, sweep in enumerate(study.model.sweeps):
        missing = {name: reason for name in sweep.engine or [] if (reason := _why_missing(name)) is not None}
        left = [name for name in sweep.engine or [] if name not in missing]
        key, asked = f"sweeps[{index}].engine", ", ".join(missing)
        if missing and not left:
            allowed = f"an engine that runs on this machine (auto takes one); {next(iter(missing.values()))}"
            problems.append(Problem(str(study.path), key, asked, allowed))
        warnings += [f"{study.path}: {key}: nothing is packed by {name}: {why}" for name, why in missing.items()]
        sweeps.append(sweep.model_copy(update={"engine": left}) if missing else sweep)
    if problems:
        raise ConfigError(problems)
    check = study.model.cross_check
    lost = None if check is None else _why_missing(check.engine)
    if check is not None and lost is not None:
        warnings.append(f"{study.path}: cross_check.engine: nothing is checked by {check.engine}: {lost}")
    if not warnings:
        return study
    changed = {"sweeps": sweeps, "cross_check": None if lost else check}
    model = study.model.model_copy(update=changed)
    return replace(study, model=model, warnings=(*study.warnings, *warnings))


def _why_missing(name: str) -> str | None:
    return None if name == AUTO else ENGINES[name]().why_missing()


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
        reason = _why_missing(asked)
        if reason is not None:
            allowed = f"an engine that runs on this machine (auto takes one); {reason}"
            problems.append(Problem(str(study.path), "packing.engine", asked, allowed))
    if problems:
        raise ConfigError(problems)
