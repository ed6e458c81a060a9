"""Small scenes on which the embedded engine is held against LIGGGHTS; units um, m/s (= um/us), rad/us.

``python tests/data/force_scenes.py`` remakes the references (needs LIGGGHTS): tests/data/force_references.npz.
"""

import subprocess
import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from filtercake.crystals.csd import mixture
from filtercake.packing import scene as packing
from filtercake.packing.engines.liggghts import contact_model, find_executable, render

REFERENCES = Path(__file__).with_name("force_references.npz")
LENGTH_UM = 600.0
EVERY = 20


@dataclass(frozen=True)
class Scene:
    """Spheres at rest or on their way, in a box periodic in x and y."""

    position: list
    velocity: list
    radius: list
    spin: list = field(default_factory=list)
    friction: float = 0.0
    cohesion: float = 50e3
    gravity: float = 0.0
    steps: int = 2000
    time_step_us: float = 0.1

    def packed(self):
        return packing.Scene(
            csd=mixture([20e-6], [1.0]),
            particles=len(self.radius),
            initial_void_fraction=0.65,
            settling_velocity=0.01,
            density=1180.0,
            youngs_modulus=5e6,
            poisson_ratio=0.2,
            restitution=0.3,
            friction=self.friction,
            cohesion=self.cohesion,
            time_step=self.time_step_us * 1e-6,
            engine="embedded",
        )

    def spins(self):
        return self.spin or [[0.0, 0.0, 0.0]] * len(self.radius)


def _cluster(seed=3, n=50):
    """A loose cluster of two sizes that collapses on its centre and the floor."""
    rng = np.random.default_rng(seed)
    radius, position = [], []
    while len(radius) < n:
        r = 25.0 if len(radius) < 6 else 10.0
        p = np.array([*rng.uniform(0.0, 120.0, 2), rng.uniform(r, 130.0)])
        if all(np.linalg.norm(p - q) > r + s for q, s in zip(position, radius, strict=True)):
            radius.append(r)
            position.append(p)
    centre = np.mean(position, axis=0)
    velocity = [(0.08 * (centre - p) / np.linalg.norm(centre - p)).tolist() for p in position]
    return Scene([p.tolist() for p in position], velocity, radius, gravity=9.81, steps=500, time_step_us=0.2)


def _pairs():
    height = 200.0
    equal = [[100.0, 100.0, height], [120.3, 100.0, height]]
    uneven = [[40.0, 100.0, height], [216.5, 100.0, height]]
    towards = [[0.05, 0.0, 0.0], [-0.05, 0.0, 0.0]]
    scenes = {
        "head_on": Scene(equal, towards, [10.0, 10.0]),
        "head_on_17_to_1": Scene(uneven, [[0.05, 0.0, 0.0], [-0.15, 0.0, 0.0]], [166.0, 10.0]),
        "oblique": Scene(equal, [[0.05, 0.03, 0.01], [-0.05, -0.02, 0.0]], [10.0, 10.0]),
        "oblique_spinning": Scene(
            equal,
            [[0.05, 0.03, 0.01], [-0.05, 0.0, 0.0]],
            [10.0, 10.0],
            spin=[[0.001, 0.002, 0.003], [0.0, -0.002, 0.001]],
        ),
        "sliding": Scene(
            [[100.0, 100.0, height], [119.9, 100.0, height]], [[0.0, 0.05, 0.0], [0.0, -0.05, 0.0]], [10.0, 10.0]
        ),
        "rolling": Scene(
            [[100.0, 100.0, height], [119.9, 100.0, height]],
            [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
            [10.0, 10.0],
            spin=[[0.0, 0.0, 0.004], [0.0, 0.0, -0.004]],
        ),
        "sticking": Scene(
            [[100.0, 100.0, height], [120.005, 100.0, height]],
            [[0.002, 0.0, 0.0], [-0.002, 0.0, 0.0]],
            [10.0, 10.0],
            cohesion=100e3,
        ),
        "separating": Scene(
            [[100.0, 100.0, height], [119.8, 100.0, height]], [[-0.05, 0.0, 0.01], [0.05, 0.0, 0.0]], [10.0, 10.0]
        ),
        "across_the_edge": Scene(
            [[5.0, 599.0, height], [590.0, 6.0, height]], [[-0.05, 0.02, 0.0], [0.05, 0.0, 0.01]], [10.0, 12.0]
        ),
        "no_cohesion": Scene(equal, towards, [10.0, 10.0], cohesion=0.0),
        "floor": Scene([[100.0, 100.0, 10.5]], [[0.03, 0.0, -0.05]], [10.0], spin=[[0.0, 0.002, 0.001]], gravity=9.81),
        "floor_rolling": Scene([[100.0, 100.0, 9.98]], [[0.02, 0.01, 0.0]], [10.0], gravity=9.81),
        "cluster": _cluster(),
    }
    return {
        **scenes,
        **{f"{name}_mu": replace(scene, friction=0.3) for name, scene in scenes.items() if name != "no_cohesion"},
    }


SCENES = _pairs()

DECK_TAIL = """
region all block -1000 1000 -1000 1000 -1000 1000 units box
dump every all custom {every} states.dump id x y z vx vy vz omegax omegay omegaz
dump_modify every sort id format "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g"
run {steps}
"""


def _deck(scene):
    """The packing deck up to its time loop, with the scene's own start and gravity."""
    tangential = scene.friction > 0.0
    values = {
        "cloud_file": "cloud.data",
        "skin": "3.0",
        "tangential": tangential,
        "cohesive": scene.cohesion > 0.0,
        "contact_model": contact_model(tangential, scene.cohesion > 0.0),
        "youngs_modulus": "5000",
        "poisson_ratio": "0.2",
        "restitution": "0.3",
        "friction": repr(scene.friction),
        "cohesion": repr(scene.cohesion / 1e3),
        "gravity": repr(scene.gravity * 1e-6),
        "time_step": repr(scene.time_step_us),
        "settling_velocity": "0.0",
        "length": repr(LENGTH_UM),
        "check_steps": 1000,
        "max_checks": 1,
        "calm_checks": 1,
        "height_tolerance": "0",
        "energy_fraction": "0",
        "write_vtk": False,
    }
    head = render("packing.in.j2", values).split("# the paper's sample region")[0]
    head = "\n".join(line for line in head.splitlines() if not line.startswith("velocity"))
    return head + DECK_TAIL.format(every=EVERY, steps=scene.steps)


def _data(scene):
    n = len(scene.radius)
    lines = [
        "scene",
        "",
        f"{n} atoms",
        "1 atom types",
        "",
        f"0 {LENGTH_UM} xlo xhi",
        f"0 {LENGTH_UM} ylo yhi",
        "-50 400 zlo zhi",
        "",
        "Atoms",
        "",
    ]
    for i, (r, p) in enumerate(zip(scene.radius, scene.position, strict=True), 1):
        lines.append(f"{i} 1 {2 * r!r} 1.18 {p[0]!r} {p[1]!r} {p[2]!r}")
    lines += ["", "Velocities", ""]
    for i, (v, w) in enumerate(zip(scene.velocity, scene.spins(), strict=True), 1):
        lines.append(f"{i} {v[0]!r} {v[1]!r} {v[2]!r} {w[0]!r} {w[1]!r} {w[2]!r}")
    return "\n".join(lines) + "\n"


def run_liggghts(scene):
    """States every ``EVERY`` steps from LIGGGHTS: array (frames, n, 9), micro units."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "packing.in").write_text(_deck(scene))
        (folder / "cloud.data").write_text(_data(scene))
        command = ["stdbuf", "-o0", find_executable(), "-echo", "screen", "-log", "none", "-in", "packing.in"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if "ERROR" in done.stdout or done.returncode != 0:
            raise RuntimeError(done.stdout[-2000:])
        frames, lines = [], (folder / "states.dump").read_text().splitlines()
        n = len(scene.radius)
        starts = [k for k, line in enumerate(lines) if line.startswith("ITEM: ATOMS")]
        for k in starts:
            frames.append([[float(word) for word in line.split()[1:]] for line in lines[k + 1 : k + 1 + n]])
    return np.array(frames)


if __name__ == "__main__":
    np.savez_compressed(REFERENCES, **{name: run_liggghts(scene) for name, scene in SCENES.items()})
    print(f"wrote {REFERENCES}")
