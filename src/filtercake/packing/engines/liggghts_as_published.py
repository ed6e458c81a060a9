"""The paper's own LIGGGHTS protocol, run by the same harness: the baseline for error and run time."""

from __future__ import annotations

from typing import Any

from filtercake.packing.engines import micro
from filtercake.packing.engines.base import SettleRequest
from filtercake.packing.engines.liggghts import Liggghts, material_values
from filtercake.packing.result import SettledState

STEPS = 150_000
"""Fixed number of time steps (paper, Table 3)."""
ROUNDS = 150
SMALLEST_SEED = 10_000
"""LIGGGHTS takes only primes above this as random seeds."""


class LiggghtsAsPublished(Liggghts):
    """The authors' box, skin, insertion and fixed number of steps; it draws its own spheres, not the cloud."""

    name = "liggghts_as_published"
    template = "as_published.in.j2"

    def __init__(self, steps: int = STEPS):
        """Create the engine; ``steps`` is the fixed number of time steps."""
        super().__init__()
        self.steps = steps

    def settle(self, request: SettleRequest) -> SettledState:
        """Run the paper's protocol (see :class:`filtercake.packing.engines.base.Engine`)."""
        return self._run(request, _published_values(request, self.steps), expected=None)


def _published_values(request: SettleRequest, steps: int) -> dict[str, Any]:
    csd, spec = request.csd, request.spec
    seeds = prime_seeds(request.seed, csd.size.size + 2)
    classes = [
        {
            "radius": micro.number(0.5 * size / micro.MICRO.length),
            "volume_fraction": micro.number(fraction),
            "seed": seed,
        }
        for size, fraction, seed in zip(csd.size, csd.volume_fraction, seeds[2:], strict=True)
    ]
    return {
        **material_values(spec, micro.MICRO),
        "length": micro.number(request.cloud.length / micro.MICRO.length),
        "skin": micro.number((spec.skin or csd.largest) / micro.MICRO.length),
        "classes": classes,
        "distribution_seed": seeds[0],
        "insertion_seed": seeds[1],
        "particles": spec.particles,
        "rounds": ROUNDS,
        "round_steps": steps // ROUNDS,
        "write_vtk": False,
    }


def prime_seeds(seed: int, count: int) -> list[int]:
    """Return ``count`` distinct primes above 10 000 that follow from ``seed``."""
    found: list[int] = []
    candidate = SMALLEST_SEED + 1 + seed % 20_000_000
    while len(found) < count:
        if _is_prime(candidate):
            found.append(candidate)
        candidate += 1
    return found


def _is_prime(number: int) -> bool:
    if number < 2 or number % 2 == 0:
        return number == 2
    return all(number % divisor for divisor in range(3, int(number**0.5) + 1, 2))
