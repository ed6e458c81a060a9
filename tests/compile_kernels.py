"""Compile the kernels of the embedded engine and the pressure cell: several processes of tests would each do so.

``python tests/compile_kernels.py``; a second when they are compiled already.
"""

import tempfile
from itertools import product
from pathlib import Path

import numpy as np

from filtercake import api
from filtercake.packing.cell import CellScene, press

if __name__ == "__main__":
    halves = api.distribution(mixture={30: 0.5, 50: 0.5})
    small = {"density_kg_m3": 1180, "particles": 60, "replicates": 1, "engine": "embedded", "protocol": "gravity"}
    with tempfile.TemporaryDirectory() as folder:
        for number, (friction, cohesion) in enumerate(product((0, 0.1), (0, 50))):
            api.pack(halves, Path(folder, str(number)), friction=friction, cohesion_kJ_m3=cohesion, **small)
            cell = {"radius": np.full(60, 15e-6), "stress": 88.0, "density": 1180.0, "patience": 1}
            press(CellScene(friction=friction, cohesion=1e3 * cohesion, **cell))
            if cohesion:
                press(CellScene(friction=friction, adhesion=1e-5 * cohesion, **cell))
