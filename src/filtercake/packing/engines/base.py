"""Interface of the packing engines."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from filtercake.packing.cloud import Cloud
from filtercake.packing.result import SettledState
from filtercake.packing.scene import Scene
from filtercake.packing.settling import StopRule

Progress = Callable[[str], None]
"""Takes one short line about how far a long packing is."""

LARGE_BED = 40_000
"""Spheres from which one packing takes two processes or threads; smaller ones go side by side instead."""


def parallelism(scene: Scene) -> int:
    """Return how many processes or threads one packing takes: what the scene says, or by its size."""
    return scene.processes or (2 if scene.particles >= LARGE_BED else 1)


@dataclass(frozen=True)
class SettleRequest:
    """One packing to be made.

    Attributes
    ----------
    scene : Scene
        Distribution, material, time step and protocol.
    cloud : Cloud
        The initial cloud.
    rule : StopRule
        Stop rule.
    seed : int
        Seed of the random numbers that the engine draws itself.
    folder : Path
        Private scratch folder, empty.
    progress : callable
        Receives a line of progress now and then.
    state_file : Path or None
        Where an engine that can go on from a saved state keeps one; it outlives the folder.
    """

    scene: Scene
    cloud: Cloud
    rule: StopRule
    seed: int
    folder: Path
    progress: Progress
    state_file: Path | None = None


class Engine(ABC):
    """A packing engine: what it is asked to do, and all that the rest of the program must know of it.

    Attributes
    ----------
    name, label : str
        Its name in a configuration, and for readers.
    sphere_step : (float, float)
        Seconds per sphere and step without and with friction, of a bed of 8000 (see :mod:`filtercake.study.estimate`).
    wide_factor : float
        Factor on it for a wide distribution.
    own_spheres : bool
        Whether it inserts spheres of its own, in the paper's box, instead of starting from the cloud.
    fixed_steps : int
        Time steps that it runs whatever the stop rule says; 0 where it stops by the rule.
    least_restitution : float
        It takes only restitutions over this.
    compiles : bool
        Whether the first packing on a machine takes longer than all others.
    evidence : tuple of str
        Files in its folder that tell why a packing failed.
    by_hand : str
        Command that runs what :meth:`write_input` wrote; empty where that is nothing.
    template : str
        Name of the deck template that it fills; empty where there is none.
    """

    name: str
    label: str
    sphere_step: tuple[float, float]
    wide_factor: float = 1.0
    own_spheres: bool = False
    fixed_steps: int = 0
    least_restitution: float = 0.0
    compiles: bool = False
    evidence: tuple[str, ...] = ()
    by_hand: str = ""
    template: str = ""

    @classmethod
    def suits(cls, scene: Scene) -> bool:  # noqa: ARG003
        """Whether ``engine: auto`` may take it for a scene."""
        return False

    def why_missing(self) -> str | None:
        """Say why the engine cannot run on this machine, None where it can."""
        return None

    def write_input(self, request: SettleRequest) -> None:  # noqa: B027 - an engine may read no files
        """Write what the engine reads into the request's folder.

        Raises
        ------
        EngineError
            If that cannot be written.
        """

    @abstractmethod
    def settle(self, request: SettleRequest) -> SettledState:
        """Let the cloud settle.

        Raises
        ------
        EngineError
            If the engine stops with an error; the text holds the engine's own words.
        """
