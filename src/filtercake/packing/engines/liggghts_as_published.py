"""The paper's own LIGGGHTS protocol, run by the same harness: the baseline for error and run time."""

from __future__ import annotations

from typing import Any

from filtercake.packing.engines import micro
from filtercake.packing.engines.base import SettleRequest
from filtercake.packing.engines.liggghts import Liggghts, material_values

ROUNDS = 150
SMALLEST_SEED = 10_000
"""LIGGGHTS takes only primes above this as random seeds."""


class LiggghtsAsPublished(Liggghts):
    """The authors' box, skin, insertion and fixed number of steps; it draws its own spheres, not the cloud."""

    name = "liggghts_as_published"
    label = "LIGGGHTS (protocol as published)"
    template = "as_published.in.j2"
    sphere_step = (700e-9, 700e-9)
    wide_factor = 1.0
    own_spheres = True
    fixed_steps = 150_000  # paper, Table 3

    def _deck_values(self, request: SettleRequest) -> dict[str, Any]:
        scene, csd = request.scene, request.scene.csd
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
            **material_values(scene, micro.MICRO),
            "length": micro.number(request.cloud.length / micro.MICRO.length),
            "skin": micro.number((scene.skin or csd.largest) / micro.MICRO.length),
            "classes": classes,
            "distribution_seed": seeds[0],
            "insertion_seed": seeds[1],
            "particles": scene.particles,
            "rounds": ROUNDS,
            "round_steps": self.fixed_steps // ROUNDS,
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
