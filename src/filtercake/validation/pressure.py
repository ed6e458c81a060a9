"""Evidence on the pressure cell: ensembles of cells, and of beds by the paper's protocol and columns beside them.

What has been computed is kept under a digest of all that decides it, so that a run goes on where it was stopped and
cases that ask for the same cell share it. A change of the cell's own code is not part of that: after one, the folder
must go. What the ensembles say is worked out in :mod:`filtercake.validation.pressure_evidence`.
"""

from __future__ import annotations

import json
import math
import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
import scipy

from filtercake.api.steps import csd_name, distribution, load
from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import CellError, CloudError, EngineError
from filtercake.packing import contact_law
from filtercake.packing.cell import FRICTIONAL_STEP, FRICTIONLESS_STEP, CellScene, PressedCell, press, press_through
from filtercake.packing.cloud import size_levels
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.engines.liggghts import Liggghts
from filtercake.packing.result import write_json
from filtercake.packing.scene import Scene, digest
from filtercake.study import engine_choice
from filtercake.study.points import base_point
from filtercake.units import GRAVITY, KILOJOULE_PER_M3, FloatArray, IntArray
from filtercake.validation.pressure_column import Column, press_column
from filtercake.validation.timing import contender, settle_timed, warm_up

REFERENCES, FRICTION, COLLAPSE, PATHS = "references", "friction", "collapse", "paths"
INVARIANCE, GRAVITY_BED, COST, SCALING = "invariance", "gravity", "cost", "mass scaling"
COLUMN = "column"
UNIAXIAL: Final = "pressed along one axis"

MODULUS: Final = contact_law.effective_modulus(5e6, 0.2)
"""E* of all cells, Pa."""
FILTER_STRESS: Final = 88.0
"""53 kPa on a crystal of 3 GPa, at the modulus above, Pa."""
HIGH_STRESS: Final = 2e-4 * MODULUS
"""What cells for which nothing else is said are brought to, Pa: time steps grow as the root of one over the stress."""
PATH_STRESS: Final = 75.0
"""Stress under which cohesion is weakened, Pa: any higher, and x = 3 asks for contacts beyond the rigid limit."""
ALONG_COHESION: Final = 30e3
"""Cohesion along the other path, J/m3: x = 100 is still within the rigid limit."""
LOADS: Final = (3.0, 5.5, 10.0, 17.0, 30.0, 55.0, 100.0)
"""Loads x = p/p_c along a path, each at most about twice the one before."""
COLLAPSED: Final = (3.0, 10.0)
"""Loads at which two cohesions are held against each other."""
COMPARED: Final = (3.0, 10.0, 30.0, 100.0)
"""Those at which paths are held against each other, and but for the first, which both start from, against cells pressed
at once."""
FRICTIONS: Final = (0.0, 0.05, 0.3)
ALUM: Final = {"kinetics": "ammonium_alum", "residence_time_min": 15, "slurry_concentration_kg_m3": 200}
ALUM_SPHERES: Final = 8000
ONE_SIZE: Final = {30.0: 1.0}
"""Volume fraction by diameter, um; neither decides anything of a cell."""
COST_SEEDS: Final = 100
"""Seeds of what is timed begin behind this one: nothing in it is shared with a case that ran at another moment."""
MEMBERS: Final = {0.0: 5, 0.05: 8, 0.3: 14}
"""Cells of 2000 behind each mean of the tables of collapse and invariance, by friction.

One spreads by 0.0011, 0.0018 and 0.0023."""
COLUMNS_EACH: Final = 8
"""Columns of 2000 spheres by friction."""
COLUMN_DEPTH: Final = 2.0
"""How many times deeper than the paper's bed a column is, in units of its side: ten largest diameters."""
PATIENCE: Final = 800_000
"""Time steps that cells without mass scaling may take."""
DENSITY: Final = 1180.0
"""Of all cells, kg/m3: it sets the unit of time and nothing else."""
FEWEST_CONTACTS: Final = (4, 2)
"""Contacts of a sphere that is no rattler, without and with friction."""
COLUMNS: Final = (
    "section",
    "case",
    "label",
    "seed",
    "spheres",
    "friction",
    "cohesion_kJ_m3",
    "stress_Pa",
    "load",
    "porosity",
    "coordination",
    "backbone",
    "rattlers",
    "steps",
    "seconds",
    "reason",
)

Say = Callable[[str], None]
Member = tuple[CellScene, ...] | Scene | Column


@dataclass(frozen=True, eq=False)
class Case:
    """An ensemble.

    Attributes
    ----------
    section, name, label : str
        Part of the evidence; slug; in words.
    stages : tuple of CellScene, Scene, or Column
        What one cell is led through, or a bed that is settled, or pressed by its weight; its seed is that of each
        member.
    cells : int
        Members.
    """

    section: str
    name: str
    label: str
    stages: Member
    cells: int

    def member(self, seed: int) -> Member:
        """Return what is computed for a seed, from 1."""
        own = seed + COST_SEEDS if self.section == COST else seed
        if isinstance(self.stages, Scene):
            return replace(self.stages, seed=own)
        if isinstance(self.stages, Column):
            return replace(self.stages, scene=replace(self.stages.scene, seed=own))
        return tuple(replace(stage, seed=own) for stage in self.stages)


def cases() -> list[Case]:
    """List all ensembles in the order in which they are computed."""
    return [
        *_references(),
        *_friction(),
        *_collapse(),
        *_invariance(0.0),
        *_invariance(0.05),
        *_cost(),
        *_gravity(0.0),
        *_gravity(0.05),
        *_paths(),
        *_scaling(),
        *_invariance(0.3),
        *_columns(),
    ]


def mixture(sizes_um: Mapping[float, float]) -> CrystalSizeDistribution:
    """Volume fractions by diameter, um."""
    return distribution(mixture=dict(sizes_um)).truncated


def pmma(fine: float = 0.5) -> CrystalSizeDistribution:
    """Spheres of 20 and 50 um, ``fine`` of the volume of 20."""
    return mixture({20.0: fine, 50.0: 1.0 - fine})


def alum() -> CrystalSizeDistribution:
    """Ammonium alum of the paper's design case, 15 min in the crystallizer, as it is packed."""
    return distribution(**ALUM).truncated


def cell(csd: CrystalSizeDistribution, particles: int = 2000, **options: Any) -> CellScene:
    """Make a cell of the evidence; ``load``, where given, sets the stress from the cohesion."""
    given = {"density": DENSITY, "stress": HIGH_STRESS, **options}
    load_over_strength = given.pop("load", None)
    if load_over_strength is not None:
        given["stress"] = load_over_strength * contact_law.cohesive_strength(given["cohesion"], 5e6, 0.2)
    return CellScene.from_csd(csd, particles, **given)


def _references() -> list[Case]:
    one = mixture(ONE_SIZE)

    def case(name: str, label: str, scene: CellScene, cells: int) -> Case:
        return Case(REFERENCES, name, label, (scene,), cells)

    listed = [
        case("one_size", "one size", cell(one, stress=FILTER_STRESS), 8),
        case("one_size_high", "one size, p/E* 2e-4", cell(one), 8),
        case("one_size_low", "one size, p/E* 1e-5", cell(one, stress=1e-5 * MODULUS), 4),
        case("pmma_load_100", "20/50 um 50/50, x = 100", cell(pmma(), cohesion=ALONG_COHESION, load=100.0), 8),
    ]
    for fine in (0.75, 0.5, 0.25):
        shares = f"{100 * fine:.0f}/{100 - 100 * fine:.0f}"
        listed.append(case(f"pmma_{shares.replace('/', '_')}", f"20/50 um {shares}", cell(pmma(fine)), 8))
    scaled = cell(alum(), ALUM_SPHERES, mass_scaling=True)
    return [*listed, case("alum", "alum, 15 min, mass scaling", scaled, 5)]


SERIES: Final = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)


def _friction() -> list[Case]:
    one = mixture(ONE_SIZE)
    return [
        Case(
            FRICTION,
            f"one_size_{friction:g}",
            f"one size, friction {friction:g}",
            (cell(one, stress=FILTER_STRESS, friction=friction),),
            8 if friction == 0.0 else 4,
        )
        for friction in (0.0, *SERIES)
    ]


def _collapse() -> list[Case]:
    return [
        Case(
            COLLAPSE,
            f"s{cohesion:.0f}_x{load_over_strength:g}_mu{friction:g}",
            f"{cohesion:.0f} kJ/m3",
            (cell(pmma(), cohesion=1e3 * cohesion, load=load_over_strength, friction=friction),),
            MEMBERS[friction],
        )
        for friction in FRICTIONS
        for load_over_strength in COLLAPSED
        for cohesion in (30.0, 50.0)
    ]


def _paths() -> list[Case]:
    listed = []
    for friction in FRICTIONS:
        rising = [cell(pmma(), cohesion=ALONG_COHESION, load=x, friction=friction) for x in LOADS]
        weakening = [_weak(x, friction) for x in LOADS]
        cells = {0.0: 3, 0.05: 1, 0.3: 2}[friction]
        listed += [
            Case(PATHS, f"stress_{friction:g}", "stress raised", tuple(rising), cells),
            Case(PATHS, f"cohesion_{friction:g}", "cohesion weakened", tuple(weakening), cells),
        ]
        listed += [
            Case(PATHS, f"direct_{friction:g}_x{x:g}", "at once", (_weak(x, friction),), cells) for x in COMPARED[1:]
        ]
    return listed


def _weak(load_over_strength: float, friction: float) -> CellScene:
    cohesion = contact_law.cohesion_of_strength(PATH_STRESS / load_over_strength, 5e6, 0.2)
    return cell(pmma(), stress=PATH_STRESS, cohesion=cohesion, friction=friction)


def _invariance(friction: float) -> list[Case]:
    base = cell(pmma(), cohesion=50e3, load=10.0, friction=friction)
    step = base.time_step / replace(base, time_step_rayleigh=0.1).time_step * 0.1
    changes: list[tuple[str, CellScene]] = [
        ("as it is", base),
        ("void fraction of the cloud 0.65 -> 0.75", replace(base, void_fraction=0.75)),
        ("void fraction of the cloud 0.65 -> 0.6", replace(base, void_fraction=0.6)),
        ("restitution 0.3 -> 0.6", replace(base, restitution=0.6)),
        ("restitution 0.3 -> 0.9", replace(base, restitution=0.9)),
        ("servo 3 times as fast", replace(base, servo=3.0 * base.servo)),
        ("servo a third as fast", replace(base, servo=base.servo / 3.0)),
        ("drag 3 times", replace(base, drag=3.0 * base.drag)),
        ("drag half", replace(base, drag=0.5 * base.drag)),
        ("spheres 2000 -> 1000", replace(base, radius=cell(pmma(), 1000).radius)),
        ("spheres 2000 -> 8000", replace(base, radius=cell(pmma(), 8000).radius)),
        ("time step halved", replace(base, time_step_rayleigh=0.5 * step)),
        (UNIAXIAL, replace(base, uniaxial=True)),
    ]
    return [
        Case(INVARIANCE, f"mu{friction:g}_{k}", label, (scene,), _members(MEMBERS[friction], scene.radius.size))
        for k, (label, scene) in enumerate(changes)
    ]


def _members(cells: int, spheres: int) -> int:
    """Cells for the same standard error: the variance of one goes as one over its spheres."""
    return max(math.ceil(cells * 2000 / spheres), 1)


def _gravity(friction: float) -> list[Case]:
    base = bed({"mixture": {20.0: 0.5, 50.0: 0.5}}, friction=friction, particles=2000)

    def dropped(times: float) -> float:
        return math.sqrt(base.settling_velocity**2 + 2.0 * GRAVITY * (times - 1.0) * base.cloud_height)

    changes: list[tuple[str, Scene]] = [
        ("as it is", base),
        ("drop height 2 times", replace(base, settling_velocity=dropped(2.0))),
        ("drop height 10 times", replace(base, settling_velocity=dropped(10.0))),
        ("void fraction of the cloud 0.65 -> 0.75", replace(base, initial_void_fraction=0.75)),
        ("void fraction of the cloud 0.65 -> 0.6", replace(base, initial_void_fraction=0.6)),
        ("start speed 0.01 m/s -> 0", replace(base, settling_velocity=0.0)),
        ("cloud twice as deep, as many spheres", replace(base, bed_depth_factor=2.0)),
        ("restitution 0.3 -> 0.6", replace(base, restitution=0.6)),
        ("restitution 0.3 -> 0.9", replace(base, restitution=0.9)),
        ("spheres 2000 -> 1000", replace(base, particles=1000)),
        ("spheres 2000 -> 8000", replace(base, particles=8000)),
        ("time step halved", replace(base, time_step=0.5 * base.time_step)),
    ]
    return [
        Case(GRAVITY_BED, f"bed{friction:g}_{k}", label, scene, _members(4, scene.particles))
        for k, (label, scene) in enumerate(changes)
    ]


def _columns() -> list[Case]:
    listed = []
    for friction in FRICTIONS:
        share = FRICTIONAL_STEP if friction > 0.0 else FRICTIONLESS_STEP
        scene = bed(
            {"mixture": {20.0: 0.5, 50.0: 0.5}}, friction=friction, particles=2000, bed_depth_factor=COLUMN_DEPTH
        )
        column = Column(replace(scene, engine=Liggghts.name).with_time_step(share)).without_impact()
        listed.append(Case(COLUMN, f"column{friction:g}", "column under raised gravity", column, COLUMNS_EACH))
    return listed


def bed(source: Mapping[str, Any], **options: Any) -> Scene:
    """Make the scene of a bed settled by the paper's protocol, 50 kJ/m3, by the embedded engine on one core."""
    material = {"youngs_modulus_MPa": 5, "cohesion_kJ_m3": 50, "friction": options.pop("friction", 0)}
    if "kinetics" not in source:
        material["density_kg_m3"] = DENSITY
    study = load(source, material, {"engine": Embedded.name, "processes": 1, **options})
    return base_point(study, csd_name(study), engine_choice.choose).scene


def _cost() -> list[Case]:
    listed = [
        Case(COST, f"pmma_cell_{n}", f"20/50 um 50/50, cell of {n}", (cell(pmma(), n),), count)
        for n, count in {1000: 8, 2000: 6, 4000: 4}.items()
    ]
    settled = bed({"mixture": {20.0: 0.5, 50.0: 0.5}}, particles=2000)
    listed.append(Case(COST, "pmma_gravity_2000", "20/50 um 50/50, gravity, 2000", settled, 8))
    listed += [
        Case(COST, f"alum_cell_{n}", f"alum, cell of {n}", (cell(alum(), n, mass_scaling=True),), count)
        for n, count in {4000: 4, ALUM_SPHERES: 3}.items()
    ]
    listed += [
        Case(COST, f"alum_gravity_{n}", f"alum, gravity, {n}", bed(ALUM, particles=n, bed_depth_factor=depth), count)
        for n, depth, count in ((4000, 1.0, 6), (20_000, 1.0, 2))
    ]
    return listed


def _scaling() -> list[Case]:
    wide = {
        "alum": (alum(), ALUM_SPHERES, 2),
        "1:5 50/50": (mixture({20.0: 0.5, 100.0: 0.5}), 4000, 2),
        "1:10 25/75": (mixture({10.0: 0.25, 100.0: 0.75}), 6000, 1),
    }
    return [
        Case(
            SCALING,
            f"{label.replace(' ', '_')}_{'scaled' if scaled else 'plain'}",
            label,
            (cell(csd, spheres, mass_scaling=scaled, **({} if scaled else {"patience": PATIENCE})),),
            cells,
        )
        for label, (csd, spheres, cells) in wide.items()
        for scaled in (True, False)
    ]


def compute(folder: Path, chosen: Iterable[Case], processes: int, say: Say = lambda _: None) -> pd.DataFrame:
    """Compute every member that ``folder`` does not hold yet, in several processes; one row, ``COLUMNS``, per stage."""
    folder.mkdir(parents=True, exist_ok=True)
    listed = _possible(chosen, say)
    wanted = {kept_as(folder, case.member(seed)): (case, seed) for case, seed in _members_of(listed)}
    missing = [(path, *task) for path, task in wanted.items() if not path.exists()]
    # a kernel that numba compiles while another process forks is not there for it
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context) as pool:
        running = [(case, seed, pool.submit(_keep, path, case.member(seed))) for path, case, seed in missing]
        try:
            for number, (case, seed, future) in enumerate(running):
                say(f"{number + 1}/{len(running)} {case.section}, {case.name} {seed}: {_said(future.result())}")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return table(folder, listed)


def _possible(chosen: Iterable[Case], say: Say) -> list[Case]:
    """Leave out columns where LIGGGHTS is missing."""
    listed, missing = list(chosen), Liggghts().why_missing()
    if missing is None or all(case.section != COLUMN for case in listed):
        return listed
    say(f"no columns: {missing}")
    return [case for case in listed if case.section != COLUMN]


def _said(rows: list[dict[str, Any]]) -> str:
    last, steps, seconds = rows[-1], sum(row["steps"] for row in rows), sum(row["seconds"] for row in rows)
    porosity = "none" if last["porosity"] is None else f"{last['porosity']:.4f}"
    return f"porosity {porosity}, {steps:,} steps, {seconds:.1f} s {last['reason']}"


def table(folder: Path, chosen: Iterable[Case]) -> pd.DataFrame:
    """Read what ``folder`` holds of the cases; one row, ``COLUMNS``, per stage of a member."""
    rows = []
    for case in chosen:
        for seed in range(1, case.cells + 1):
            path = kept_as(folder, case.member(seed))
            if path.exists():
                named = {"section": case.section, "case": case.name, "label": case.label, "seed": seed}
                rows += [{**named, **row} for row in json.loads(path.read_text(encoding="utf-8"))["rows"]]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _members_of(chosen: Iterable[Case]) -> Iterator[tuple[Case, int]]:
    """List members, all cases in turn: a change of the machine's pace hits all, and a stopped run has some of each."""
    listed = list(chosen)
    for seed in range(1, max((case.cells for case in listed), default=0) + 1):
        yield from ((case, seed) for case in listed if seed <= case.cells)


def kept_as(folder: Path, member: Member) -> Path:
    """File of a member: its name is a digest of everything that decides it."""
    if isinstance(member, Column):
        return folder / f"{digest('column', member.scene.decisive(), member.load)[:24]}.json"
    if isinstance(member, Scene):
        return folder / f"{digest(member.decisive())[:24]}.json"
    content = [{**vars(stage), "radius": stage.radius.tolist()} for stage in member]
    return folder / f"{digest(content)[:24]}.json"


def _keep(path: Path, member: Member) -> list[dict[str, Any]]:
    if isinstance(member, Column):
        rows = column_rows(member)
    else:
        rows = settled_rows(member) if isinstance(member, Scene) else pressed_rows(member)
    write_json(path, {"rows": rows})
    return rows


def pressed_rows(stages: tuple[CellScene, ...]) -> list[dict[str, Any]]:
    """Press a cell through its stages; a row, ``COLUMNS`` from spheres on, for each that was reached.

    A cell for which there is no packing at all has a row with the reason and without values.
    """
    first = stages[0]
    _warm(first.friction > 0.0, first.cohesion > 0.0)
    started = time.process_time()
    try:
        found = press_through(stages)
    except (CellError, CloudError, EngineError) as error:
        nothing = dict.fromkeys(COLUMNS[9:13])
        return [
            {**_asked(first), **nothing, "steps": 0, "seconds": time.process_time() - started, "reason": str(error)}
        ]
    seconds = (time.process_time() - started) / sum(each.wall_time for each in found)
    return [_row(stage, each, seconds * each.wall_time) for stage, each in zip(stages, found, strict=False)]


def _asked(scene: CellScene) -> dict[str, Any]:
    return {
        "spheres": scene.radius.size,
        "friction": scene.friction,
        "cohesion_kJ_m3": scene.cohesion / KILOJOULE_PER_M3,
        "stress_Pa": scene.stress,
        "load": scene.stress / scene.strength if scene.strength > 0.0 else None,
    }


def _row(scene: CellScene, found: PressedCell, seconds: float) -> dict[str, Any]:
    contacts = _contacts(found.position, found.radius, found.sides)
    fewest = FEWEST_CONTACTS[scene.friction > 0.0]
    coordination, rattlers = backbone(contacts, found.radius.size, fewest)
    return {
        **_asked(scene),
        "porosity": found.last.rigid_porosity,
        "coordination": found.last.coordination,
        "backbone": coordination if math.isfinite(coordination) else None,
        "rattlers": rattlers,
        "steps": found.steps,
        "seconds": seconds,
        "reason": "; ".join(found.reasons),
    }


@cache
def _warm(frictional: bool, cohesive: bool) -> None:
    """Have the kernels compiled, once, before a clock is started."""
    few = cell(mixture(ONE_SIZE), 100, friction=0.3 * frictional, cohesion=10e3 * cohesive, patience=2000)
    press(few)


def _contacts(position: FloatArray, radius: FloatArray, sides: FloatArray) -> IntArray:
    """Pairs of spheres that overlap in a box periodic in all directions, shape (m, 2); searched by size level."""
    level = size_levels(radius)
    groups = [np.flatnonzero(level == k) for k in np.unique(level)]
    trees = [scipy.spatial.cKDTree(position[group] % sides, boxsize=sides) for group in groups]
    found = []
    for a, coarse in enumerate(groups):
        for b in range(a, len(groups)):
            fine = groups[b]
            reach = float(radius[coarse].max() + radius[fine].max())
            near = trees[a].sparse_distance_matrix(trees[b], reach, output_type="ndarray")
            i, j = coarse[near["i"]], fine[near["j"]]
            keep = (near["v"] < radius[i] + radius[j]) & ((i < j) if a == b else True)
            found.append(np.column_stack([i[keep], j[keep]]))
    return np.concatenate(found)


def backbone(pairs: IntArray, spheres: int, fewest: int) -> tuple[float, float]:
    """Mean number of contacts without rattlers, and the share of rattlers.

    Spheres with less than ``fewest`` contacts are taken away until none is left.

    Parameters
    ----------
    pairs : ndarray, shape (m, 2)
        Spheres in contact.
    spheres, fewest : int
        Number of spheres; contacts of one that is no rattler.

    Returns
    -------
    tuple of float
        nan and 1 where no sphere is left.
    """
    left = pairs
    while True:
        counts = np.bincount(left.ravel(), minlength=spheres)
        loose = (counts > 0) & (counts < fewest)
        if not loose.any():
            break
        left = left[~loose[left].any(axis=1)]
    held = int((counts > 0).sum())
    return (float(counts.sum()) / held if held else math.nan), 1.0 - held / spheres


def settled_rows(scene: Scene) -> list[dict[str, Any]]:
    """Settle a bed by the paper's protocol; one row, ``COLUMNS`` from spheres on."""
    made = contender(Embedded.name, scene)
    _warm_bed(made.scene.friction > 0.0)
    started = time.process_time()
    found = settle_timed(made, 0)
    return [
        {
            **_bed_asked(scene),
            "porosity": found["porosity"] if math.isfinite(found["porosity"]) else None,
            "steps": found["steps"],
            "seconds": time.process_time() - started,
            "reason": "" if found["status"] == "ok" else found["status"],
        }
    ]


def column_rows(column: Column) -> list[dict[str, Any]]:
    """Press a column by its weight; a row, ``COLUMNS`` from spheres on, for each of its slices."""
    return [{**_bed_asked(column.scene), **row} for row in press_column(column)]


def _bed_asked(scene: Scene) -> dict[str, Any]:
    asked = {
        "spheres": scene.particles,
        "friction": scene.friction,
        "cohesion_kJ_m3": scene.cohesion / KILOJOULE_PER_M3,
    }
    return asked | dict.fromkeys(("stress_Pa", "load", "porosity", "coordination", "backbone", "rattlers"))


@cache
def _warm_bed(frictional: bool) -> None:
    warm_up(contender(Embedded.name, bed({"mixture": ONE_SIZE}, friction=0.3 * frictional, particles=200)))
