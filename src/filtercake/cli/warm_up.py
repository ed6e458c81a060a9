"""Compile the kernels of the embedded engine and the pressure cell: the first packing is then as fast as any.

``python -m filtercake.cli.warm_up``; a second when they are compiled already.
"""

from __future__ import annotations

import sys
import tempfile
import time
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from filtercake import api
from filtercake.packing.cell import CellScene, press


def compile_kernels() -> None:
    """Make a small bed and a small cell of every kind: with and without friction, and of each kind of attraction."""
    halves = api.distribution(mixture={30: 0.5, 50: 0.5})
    cell: dict[str, Any] = {"radius": np.full(60, 15e-6), "stress": 88.0, "density": 1180.0, "patience": 1}
    with tempfile.TemporaryDirectory() as folder:
        for number, (friction, cohesion) in enumerate(product((0.0, 0.1), (0.0, 50.0))):
            api.pack(
                halves,
                Path(folder, str(number)),
                density_kg_m3=1180,
                particles=60,
                replicates=1,
                engine="embedded",
                protocol="gravity",
                friction=friction,
                cohesion_kJ_m3=cohesion,
            )
            press(CellScene(friction=friction, cohesion=1e3 * cohesion, **cell))
            if cohesion:
                press(CellScene(friction=friction, adhesion=1e-5 * cohesion, **cell))


def main() -> int:
    """Compile, and say how long it took."""
    began = time.monotonic()
    compile_kernels()
    print(f"setup: kernels compiled in {time.monotonic() - began:.0f} s", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
