"""VTK files hold what they are given."""

import numpy as np

from filtercake.packing.pictures import write_vtk


def test_points_radii_and_velocities_are_there(tmp_path):
    rng = np.random.default_rng(1)
    position, velocity, radius = rng.random((5, 3)) * 1e-4, rng.random((5, 3)), rng.random(5) * 1e-5
    path = tmp_path / "bed.vtk"
    write_vtk(path, position, velocity, radius)
    lines = path.read_text().splitlines()
    assert lines[0] == "# vtk DataFile Version 3.0"
    start = lines.index("POINTS 5 double") + 1
    assert np.allclose(np.loadtxt(lines[start : start + 5]), position * 1e6)
    start = lines.index("LOOKUP_TABLE default") + 1
    assert np.allclose(np.loadtxt(lines[start : start + 5]), radius * 1e6)
    start = lines.index("VECTORS v double") + 1
    assert np.allclose(np.loadtxt(lines[start : start + 5]), velocity)
