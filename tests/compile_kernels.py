"""Compile the kernels of the embedded engine, which keeps them: several processes of tests would each do so.

``python tests/compile_kernels.py``; a second when they are compiled already.
"""

import tempfile
from itertools import product
from pathlib import Path

from filtercake import api

if __name__ == "__main__":
    halves = api.distribution(mixture={30: 0.5, 50: 0.5})
    small = {"density_kg_m3": 1180, "particles": 60, "replicates": 1, "engine": "embedded"}
    with tempfile.TemporaryDirectory() as folder:
        for number, (friction, cohesion) in enumerate(product((0, 0.1), (0, 50))):
            api.pack(halves, Path(folder, str(number)), friction=friction, cohesion_kJ_m3=cohesion, **small)
