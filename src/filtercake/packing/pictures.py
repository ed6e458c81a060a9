"""Pictures of a packing for ParaView: legacy VTK point files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from filtercake.units import MICROMETRE, FloatArray


def write_vtk(path: Path, position: FloatArray, velocity: FloatArray, radius: FloatArray) -> None:
    """Write spheres as VTK points with radius and velocity; lengths in um, velocities in m/s.

    Positions (n, 3) and radii (n,) are given in m, velocities (n, 3) in m/s.
    """
    n = radius.size
    with path.open("w", encoding="ascii") as stream:
        stream.write("# vtk DataFile Version 3.0\nspheres, um\nASCII\nDATASET POLYDATA\n")
        stream.write(f"POINTS {n} double\n")
        np.savetxt(stream, position / MICROMETRE, fmt="%.9g")
        stream.write(f"VERTICES {n} {2 * n}\n")
        np.savetxt(stream, np.column_stack([np.ones(n, dtype=np.int64), np.arange(n)]), fmt="%d")
        stream.write(f"POINT_DATA {n}\nSCALARS radius double 1\nLOOKUP_TABLE default\n")
        np.savetxt(stream, radius / MICROMETRE, fmt="%.9g")
        stream.write("VECTORS v double\n")
        np.savetxt(stream, velocity, fmt="%.9g")
