"""What is tried again, and what is noted as worth another try, with engines that fail on purpose."""

from __future__ import annotations

from pathlib import Path

import pytest

from filtercake.crystals.csd import mixture
from filtercake.errors import EngineError, PackingRejected, TimeLimitReached
from filtercake.packing import pack as pack_module
from filtercake.packing.pack import ATTEMPTS, Outcome, pack_replicates
from filtercake.packing.scene import Scene

SCENE = Scene(
    csd=mixture([20e-6, 30e-6], [0.5, 0.5]),
    particles=150,
    initial_void_fraction=0.6,
    settling_velocity=0.01,
    density=1180.0,
    youngs_modulus=5e6,
    poisson_ratio=0.2,
    restitution=0.3,
    friction=0.0,
    cohesion=50e3,
    time_step=0.25e-6,
    engine="embedded",
)


def made(monkeypatch: pytest.MonkeyPatch, folder: Path, error: Exception) -> Outcome:
    def fails(*_args: object, **_more: object) -> None:
        raise error

    monkeypatch.setattr(pack_module, "pack", fails)
    (outcome,) = pack_replicates(SCENE, 1, folder, "code")
    return outcome


@pytest.mark.parametrize(
    ("error", "attempts", "may_pass"),
    [
        (EngineError("killed", transient=True, outcome="exploded"), ATTEMPTS, True),
        (EngineError("Unknown command"), 1, False),
        (EngineError("cannot be started", may_pass=True), 1, True),
        (TimeLimitReached(60.0), 1, True),
        (EngineError("the bed exploded", outcome="exploded"), 1, False),
        (PackingRejected(["still moving"], outcome="unsettled"), 1, False),
        (PackingRejected(["not finite"], transient=True, outcome="exploded"), ATTEMPTS, True),
    ],
)
def test_what_may_pass_is_tried_again_and_noted(
    error: Exception, attempts: int, may_pass: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    outcome = made(monkeypatch, tmp_path, error)
    assert (outcome.status, outcome.attempts, outcome.may_pass) == ("failed", attempts, may_pass)
