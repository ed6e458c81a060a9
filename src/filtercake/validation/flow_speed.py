"""How fast the flow is solved: against copying the same memory, over sizes, and on two threads.

``python -m filtercake.validation.flow_speed`` writes one row per lattice: nodes, threads, seconds per node and step,
and their ratio to a plain copy of as many bytes in the same run, so that another machine can be compared.
"""

from __future__ import annotations

import argparse
import math
import resource
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake.api.packings import pack
from filtercake.api.steps import distribution
from filtercake.packing.result import Packing, publish
from filtercake.permeability.lattice import Spheres, build
from filtercake.permeability.measure import measure_bed
from filtercake.permeability.stokes import Flow, Numbers

NODES: Final = (0.5e6, 1e6, 2.5e6, 5e6, 10e6, 20e6)
"""Fluid nodes of the lattices."""
STEPS: Final = 20
REPEATS: Final = 3
"""Of which the fastest counts: the machine is shared."""
COLUMNS: Final = ("what", "nodes", "threads", "seconds", "ns_per_node_step", "copy_ratio", "memory_mb")
Row = dict[str, Any]


def run(nodes: tuple[float, ...] = NODES) -> pd.DataFrame:
    """Time lattices of these sizes on one and two threads, and a whole bed; ``COLUMNS``."""
    rows = [row for size in nodes for row in _lattice(size)]
    return pd.DataFrame([*rows, _bed()], columns=list(COLUMNS))


def _lattice(nodes: float) -> list[Row]:
    """Time steps on a periodic lattice of about so many fluid nodes, around random spheres that fill six tenths."""
    across = round((nodes / 0.4) ** (1.0 / 3.0))
    lattice = build(_spheres(across), across)
    copied = _copy_seconds(lattice.source.size)
    rows = []
    for threads in (1, 2):
        flow = Flow(lattice, np.ones(across), threads=threads)
        flow.run(2)
        seconds = _fastest(partial(flow.run, STEPS)) / STEPS
        rows.append(
            {
                "what": "lattice",
                "nodes": lattice.fluid,
                "threads": threads,
                "seconds": seconds,
                "ns_per_node_step": 1e9 * seconds / lattice.fluid,
                "copy_ratio": seconds / copied[threads - 1],
                "memory_mb": (lattice.source.nbytes + lattice.wall.nbytes + flow._f.nbytes) / 1e6,
            }
        )
    return rows


def _spheres(across: int) -> Spheres:
    """Overlapping spheres of ten nodes' diameter at random places, six tenths of the box."""
    count = round(-math.log(0.4) * across**3 / (np.pi / 6.0 * 10.0**3))
    position = np.random.default_rng(1).random((count, 3)) * across
    return Spheres(position, np.full(count, 5.0), np.full(3, float(across)))


def _bed() -> Row:
    """Solve a bed of 2000 PMMA spheres at the default accuracy, compiled code in place."""
    source = distribution(mixture={20: 0.5, 50: 0.5})
    options: dict[str, Any] = {"density_kg_m3": 1180, "cohesion_kJ_m3": 50, "friction": 0, "particles": 2000}
    with tempfile.TemporaryDirectory(prefix="filtercake-") as folder:
        made = pack(source, folder, protocol="gravity", engine="embedded", replicates=1, seed=1, **options)
        packing = Packing.load(made.files[0])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    bed = packing.position, packing.radius, packing.length
    seconds = _fastest(lambda: measure_bed(*bed))
    found = measure_bed(*bed)
    return {
        "what": "bed of 2000 spheres at 2 %",
        "nodes": found.levels[-1].nodes,
        "threads": 1,
        "seconds": seconds,
        "ns_per_node_step": 1e9 * seconds / sum(level.nodes * level.steps for level in found.levels),
        "copy_ratio": math.nan,
        "memory_mb": max(found.memory_bytes / 1e6, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3),
    }


def _copy_seconds(places: int) -> tuple[float, float]:
    """Seconds to copy as many bytes as a step reads and writes at least, on one and on two threads."""
    # a pair of steps reads and writes the values twice, the neighbours and the walls once and twice
    size = int(places * (2 * 4 + 2 + 1) / 4) // 2
    source: Numbers = np.ones(size, dtype=np.float32)
    target: Numbers = np.empty_like(source)
    return _fastest(lambda: _copy(source, target, 1)), _fastest(lambda: _copy(source, target, 2))


def _copy(source: Numbers, target: Numbers, threads: int) -> None:
    """Copy in as many parts at once."""
    parts = zip(np.array_split(source, threads), np.array_split(target, threads), strict=True)
    with ThreadPoolExecutor(threads) as pool:
        # numpy lets other threads run while it copies
        list(pool.map(lambda part: np.copyto(part[1], part[0]), parts))


def _fastest(work: Callable[[], object]) -> float:
    found = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        work()
        found.append(time.perf_counter() - started)
    return min(found)


def main() -> None:
    """Time the flow and write the table."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--output", type=Path, required=True, help="the table, CSV")
    parser.add_argument("--most-nodes", type=float, default=max(NODES), help="largest lattice")
    options = parser.parse_args()
    table = run(tuple(size for size in NODES if size <= options.most_nodes))
    with publish(options.output) as temporary:
        table.to_csv(temporary, index=False, float_format="%.5g")
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
