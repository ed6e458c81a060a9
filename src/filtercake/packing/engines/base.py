"""Interface of the packing engines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing.cloud import Cloud
from filtercake.packing.result import SettledState
from filtercake.packing.scene import PackingSpec
from filtercake.packing.settling import StopRule

Progress = Callable[[str], None]
"""Takes one short line about how far a long packing is."""

LARGE_BED = 40_000
"""Spheres from which one packing takes two processes or threads; smaller ones go side by side instead."""


def parallelism(spec: PackingSpec) -> int:
    """Return how many processes or threads one packing takes: what the spec says, or by its size."""
    return spec.processes or (2 if spec.particles >= LARGE_BED else 1)


@dataclass(frozen=True)
class SettleRequest:
    """One packing to be made.

    Attributes
    ----------
    spec : PackingSpec
        Material, time step and protocol.
    csd : CrystalSizeDistribution
        The truncated distribution (for engines that insert spheres themselves).
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

    spec: PackingSpec
    csd: CrystalSizeDistribution
    cloud: Cloud
    rule: StopRule
    seed: int
    folder: Path
    progress: Progress
    state_file: Path | None = None


class Engine(Protocol):
    """A packing engine."""

    name: str

    def why_missing(self) -> str | None:
        """Say why the engine cannot run on this machine, None where it can."""

    def settle(self, request: SettleRequest) -> SettledState:
        """Let the cloud settle.

        Raises
        ------
        EngineError
            If the engine stops with an error; the text holds the engine's own words.
        """
