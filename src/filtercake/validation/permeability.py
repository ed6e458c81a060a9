"""Which resistance law holds: Stokes flow solved through settled beds, hard spheres, layers and lattices.

A packing that has been solved is kept, so that a run goes on where it was stopped. What the packings say is worked out
in :mod:`filtercake.validation.resistance_law`.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake.api.packings import pack
from filtercake.api.steps import distribution
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.result import Packing, write_json
from filtercake.packing.slab import interior_slab
from filtercake.permeability.measure import SPREAD, bed_domain, measure_cell
from filtercake.permeability.measure import solve as solve_flow
from filtercake.permeability.resolution import ACCURACY
from filtercake.permeability.result import Permeability
from filtercake.statistics import quantile
from filtercake.units import MICROMETRE, FloatArray
from filtercake.validation.hard_spheres import Species, arrange
from filtercake.validation.stokes_reference import BEDS

BED, CELL, LAYERED, LATTICE, FINER, SECOND = "bed", "hard spheres", "layers", "lattice", "finer", "second"
"""Kinds of cases; of layers and lattices no law of mixed packings is asked, and finer are beds solved once more."""
MIXED = (BED, CELL)
DIAMETER: Final = 20.0 * MICROMETRE
"""Of the (finer) spheres of a cell, m."""
FINER_ENDING: Final = "_finer"
TWICE: Final = (
    "one_size",
    "one_size_free",
    "one_size_rough",
    "pmma_75_25",
    "pmma_50_50",
    "pmma_25_75",
    "pmma_free",
    "pmma_friction_0.05",
    "pmma_friction_0.3",
    "binary_2",
)
"""Cases of which beds are solved on fine lattices as well."""
FINER_ACCURACY: Final = 0.005
CELL_SPHERES: Final = 250
SEED: Final = 20_26
SLICES: Final = 400
SUBSLICES: Final = 20
COLUMNS: Final = (
    "case",
    "kind",
    "label",
    "replicate",
    "seed",
    "spheres",
    "effective_spheres",
    "porosity",
    "sauter_um",
    "ratio",
    "series",
    "permeability_m2",
    "kozeny_constant",
    "kozeny_constant_eq3",
    "resolution",
    "convergence",
    "slab",
    "diameters_per_spacing",
    "seconds",
)
DENSITY: Final = 1180.0
"""Of the beds without a crystallizer, whose kinetics say theirs, kg/m3: PMMA."""

Say = Callable[[str], None]
Geometry = tuple[FloatArray, FloatArray, FloatArray]
"""Centres, radii and sides of a cell, m."""


@dataclass(frozen=True)
class Case:
    """Packings of one kind.

    Attributes
    ----------
    name, kind, label : str
        Slug; one of the kinds; in words.
    replicates : int
        Packings.
    accuracy : float
        Numerical error asked for, relative.
    distribution, options : mapping
        Of a bed: arguments of :func:`filtercake.api.distribution` and of :func:`filtercake.api.pack`.
    cell : callable or None
        Of anything else: makes the cell of a seed.
    """

    name: str
    kind: str
    label: str
    replicates: int = 3
    accuracy: float = ACCURACY
    distribution: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    cell: Callable[[Sequence[int]], Geometry] | None = None


def cases() -> list[Case]:
    """List all cases: what is cheap first, so that a table soon has something of everything."""
    beds = [*_one_size(), *_pmma()]
    wide = _wide()
    return [*beds, *_hard_spheres(), *_lattices(), *wide, *_layers(), *_second(), *_finer([*beds, *wide])]


def _finer(beds: Iterable[Case]) -> list[Case]:
    """Solve two beds of ten cases on fine lattices, to show whether the stated error covers."""
    return [
        replace(case, name=f"{case.name}{FINER_ENDING}", kind=FINER, replicates=2, accuracy=FINER_ACCURACY)
        for case in beds
        if case.name in TWICE
    ]


def _second() -> list[Case]:
    """List the beds that the second method is run on."""
    found = []
    for number, (label, (mixture, options)) in enumerate(BEDS.items()):
        case = Case(f"second_{number}", SECOND, label, distribution={"mixture": mixture})
        found.append(replace(case, options={"friction": 0, **options}, replicates=1, accuracy=0.01))
    return found


def _bed(name: str, label: str, mixture: Mapping[float, float], particles: int = 2000, **options: Any) -> Case:
    given = {"cohesion_kJ_m3": 50, "friction": 0, "particles": particles, **options}
    return Case(name, BED, label, distribution={"mixture": dict(mixture)}, options=given)


def _one_size() -> list[Case]:
    one = {50.0: 1.0}
    return [
        _bed("one_size", "one size", one, 1500),
        _bed("one_size_free", "one size, no cohesion", one, 1500, cohesion_kJ_m3=0),
        _bed("one_size_rough", "one size, no cohesion, friction 0.5", one, 1500, cohesion_kJ_m3=0, friction=0.5),
    ]


def _pmma() -> list[Case]:
    def mixed(fine: float) -> dict[float, float]:
        return {20.0: fine, 50.0: 1.0 - fine}

    return [
        _bed("pmma_75_25", "20/50 um 75/25", mixed(0.75)),
        _bed("pmma_50_50", "20/50 um 50/50", mixed(0.5)),
        _bed("pmma_25_75", "20/50 um 25/75", mixed(0.25)),
        _bed("pmma_free", "20/50 um 50/50, no cohesion", mixed(0.5), cohesion_kJ_m3=0),
        _bed("pmma_friction_0.05", "20/50 um 50/50, friction 0.05", mixed(0.5), friction=0.05),
        _bed("pmma_friction_0.3", "20/50 um 50/50, friction 0.3", mixed(0.5), friction=0.3),
        _bed("binary_2", "1:2 50/50", {20.0: 0.5, 40.0: 0.5}),
    ]


def _wide() -> list[Case]:
    alum = {"kinetics": "ammonium_alum", "residence_time_min": 15, "slurry_concentration_kg_m3": 200}
    deep = {"cohesion_kJ_m3": 50, "friction": 0, "particles": 10_000, "bed_depth_factor": 2}
    few = {"cohesion_kJ_m3": 50, "friction": 0, "particles": 8000}
    fuller, many = {**alum, "truncate_below_volume_fraction": 2e-4}, {**few, "particles": 12_000}
    tens = {"mixture": {10.0: 0.25, 100.0: 0.75}}
    return [
        _lognormal(0.2, 1500),
        _lognormal(0.4, 4000),
        _lognormal(0.6, 4000, truncate_below_um=16, truncate_above_um=160),
        _bed("binary_5", "1:5 50/50", {20.0: 0.5, 100.0: 0.5}, 6000),
        Case("alum", BED, "MSMPR, cut at 0.1 % a class", 3, 0.035, alum, few),
        Case("binary_10", BED, "1:10 25/75", 3, 0.04, tens, deep),
        _lognormal(0.8, 8000, truncate_below_um=15, truncate_above_um=150),
        Case("alum_fuller", BED, "MSMPR, cut at 0.02 % a class", 3, 0.04, fuller, many),
    ]


def _lognormal(spread: float, particles: int, **cut: float) -> Case:
    """Make a case of a lognormal distribution of the volume, median 50 um, standard deviation of ln d ``spread``."""
    decile = math.exp(1.2815516 * spread)
    source = {"lognormal": {"d10_um": 50.0 / decile, "d50_um": 50.0, "d90_um": 50.0 * decile}, **cut}
    ends = f", {cut['truncate_below_um']:g} to {cut['truncate_above_um']:g} um" if cut else ""
    options = {"cohesion_kJ_m3": 50, "friction": 0, "particles": particles}
    return Case(f"lognormal_{spread:g}", BED, f"lognormal {spread:g}{ends}", distribution=source, options=options)


def _hard_spheres() -> list[Case]:
    def cell(solids: float) -> Callable[[Sequence[int]], Geometry]:
        def make(seed: Sequence[int]) -> Geometry:
            side = DIAMETER * (CELL_SPHERES * math.pi / 6.0 / solids) ** (1.0 / 3.0)
            box = np.full(3, side)
            return (*arrange([Species(CELL_SPHERES, DIAMETER)], box, seed), box)

        return make

    return [
        Case(f"hard_{solids:.2f}", CELL, f"hard spheres, solids {solids:.2f}", 5, 0.01, cell=cell(solids))
        for solids in (0.30, 0.40, 0.45, 0.50, 0.55)
    ]


LAYER_RATIO: Final = 3.0
LAYER_SOLIDS: Final = 0.5
LAYER_SIDE: Final = 9
LAYER_HEIGHT: Final = 36
"""Side and height of the layered cells in finer diameters; half of the height is fine and half coarse."""
LAYER_SWEEPS: Final = 400


def _layers() -> list[Case]:
    def cell(pairs: int) -> Callable[[Sequence[int]], Geometry]:
        return lambda seed: layered(pairs, seed)

    found = []
    for pairs, number in ((1, "two"), (3, "six"), (6, "twelve")):
        thickness = LAYER_HEIGHT / 2.0 / pairs / LAYER_RATIO
        label = f"{number} layers, each {thickness:g} coarse diameter{'' if thickness == 1.0 else 's'}"
        found.append(Case(f"layers_{2 * pairs}", LAYERED, label, 2, cell=cell(pairs)))
    return [*found, Case("hard_mixed", CELL, "hard spheres 1:3 50/50, solids 0.50", 2, cell=cell(0))]


def layered(pairs: int, seed: Sequence[int], sweeps: int = LAYER_SWEEPS) -> Geometry:
    """Make a cell of fine and coarse hard spheres, as much of each, in ``pairs`` of layers; 0 mixes them."""
    box = DIAMETER * np.array([LAYER_SIDE, LAYER_SIDE, LAYER_HEIGHT])
    layers = 2 * max(pairs, 1)
    thickness = float(box[2]) / layers
    species = []
    for layer in range(layers):
        diameter = DIAMETER * (LAYER_RATIO if layer % 2 else 1.0)
        count = round(LAYER_SOLIDS * float(np.prod(box)) / layers / (math.pi / 6.0 * diameter**3))
        bounds = (layer * thickness, (layer + 1) * thickness) if pairs else (0.0, math.inf)
        species.append(Species(count, diameter, *bounds))
    return (*arrange(species, box, seed, sweeps), box)


def series(position: FloatArray, radius: FloatArray, box: FloatArray) -> float:
    """Resistance of slices in series over that of the whole cell, Carman's law for each of them.

    Slices are one of the largest diameters thick: thinner ones cut coarse spheres into porosities that no flow sees.
    """
    count = round(float(box[2]) / (2.0 * float(radius.max()))) * SUBSLICES
    heights = (np.arange(count) + 0.5) / count * box[2]
    away = heights[None, :] - position[:, 2, None]
    away -= box[2] * np.round(away / box[2])
    area = np.pi * np.maximum(radius[:, None] ** 2 - away**2, 0.0) / float(box[0] * box[1])
    solids, surface = (np.asarray(part) for part in (area.sum(axis=0), (area / (2.0 * radius[:, None])).sum(axis=0)))
    solids, surface = (part.reshape(-1, SUBSLICES).mean(axis=1) for part in (solids, surface))
    whole = float(surface.mean()) ** 2 / (1.0 - float(solids.mean())) ** 3
    return float(np.mean(surface**2 / (1.0 - solids) ** 3)) / whole


LATTICES: Final = {
    "simple cubic": ([[0.5, 0.5, 0.5]], 1.0, 1.0 / (18.0 * math.pi / 6.0 * 42.1)),
    "body-centred cubic": ([[0.25, 0.25, 0.25], [0.75, 0.75, 0.75]], math.sqrt(0.75), 5.014e-4),
    "face-centred cubic": (
        [[0.25, 0.25, 0.25], [0.75, 0.75, 0.25], [0.75, 0.25, 0.75], [0.25, 0.75, 0.75]],
        math.sqrt(0.5),
        1.73e-4,
    ),
}
"""Touching spheres: places in the unit cell, diameter over its side, and k/D^2 after Zick and Homsy, J. Fluid Mech. 115
(1982) 13."""


def _lattices() -> list[Case]:
    def cell(name: str) -> Callable[[Sequence[int]], Geometry]:
        places, diameter, _ = LATTICES[name]

        def make(_seed: Sequence[int]) -> Geometry:
            side = DIAMETER / diameter
            position = side * np.array(places)
            return position, np.full(len(places), 0.5 * DIAMETER), np.full(3, side)

        return make

    return [Case(name.replace(" ", "_"), LATTICE, name, 1, 0.005, cell=cell(name)) for name in LATTICES]


def known_constant(name: str, porosity: float) -> float:
    """Kozeny constant of a touching lattice by the literature."""
    return porosity**3 / (LATTICES[name][2] * (1.0 - porosity) ** 2)


def solve_all(folder: Path, chosen: Iterable[Case], say: Say = lambda _: None) -> pd.DataFrame:
    """Make and solve every packing that ``folder`` does not hold yet; one row, ``COLUMNS``, per packing."""
    rows = [row for case in chosen for row in solve(folder, case, say)]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def solve(folder: Path, case: Case, say: Say = lambda _: None) -> list[dict[str, Any]]:
    """Make and solve the packings of one case; rows of ``COLUMNS``.

    What is kept goes by the name of the case alone: after a change to a case, its files must go.
    """
    rows = []
    for replicate in range(case.replicates):
        kept = folder / f"{case.name}_{replicate}.json"
        if not kept.exists():
            kept.parent.mkdir(parents=True, exist_ok=True)
            row = _row(case, replicate, folder)
            write_json(kept, row)
            say(
                f"{case.name} {replicate}: porosity {row['porosity']:.4f}, ratio {row['ratio']:.3f}, "
                f"A = {row['kozeny_constant']:.1f}, eq. 3 {row['kozeny_constant_eq3']:.1f}, {row['seconds']:.0f} s"
            )
        rows.append(json.loads(kept.read_text(encoding="utf-8")))
    return rows


def _row(case: Case, replicate: int, folder: Path) -> dict[str, Any]:
    started = time.perf_counter()
    solved = _solved_bed(case, replicate, folder) if case.cell is None else _solved_cell(case, replicate)
    found, ratio = solved.found, solved.ratio
    return {
        "case": case.name,
        "kind": case.kind,
        "label": case.label,
        "replicate": replicate,
        "seed": solved.seed,
        "spheres": solved.spheres,
        "effective_spheres": (quantile() * SPREAD / found.slab) ** 2,
        "porosity": found.porosity,
        "sauter_um": found.sauter_diameter / MICROMETRE,
        "ratio": ratio,
        "series": solved.series,
        "permeability_m2": found.permeability,
        "kozeny_constant": found.kozeny_constant,
        "kozeny_constant_eq3": found.kozeny_constant / ratio,
        "resolution": found.resolution,
        "convergence": found.convergence,
        "slab": found.slab,
        "diameters_per_spacing": " ".join(f"{level.diameters_per_spacing:.2f}" for level in found.levels),
        "seconds": time.perf_counter() - started,
    }


@dataclass(frozen=True)
class Solved:
    """What was found of one packing; :func:`series` of cells only."""

    found: Permeability
    seed: int
    spheres: int
    ratio: float
    series: float | None = None


def _solved_bed(case: Case, replicate: int, folder: Path) -> Solved:
    density = {} if "kinetics" in case.distribution else {"density_kg_m3": DENSITY}
    engine = {"protocol": "gravity", "engine": Embedded.name, "processes": 1, "replicates": 1, "seed": 1 + replicate}
    options = {"youngs_modulus_MPa": 5, **density, **case.options, **engine}
    source = distribution(**case.distribution)
    bed = pack(source, folder / "packings" / f"{case.name}_{replicate}", replace=True, **options)
    if not bed.files:
        raise ValueError(f"{case.name}: {'; '.join(bed.failures)}")
    packing = Packing.load(bed.files[0])
    domain = bed_domain(packing.position, packing.radius, packing.length, case.accuracy)
    # a fine lattice is its own end: no third one is taken where two of them differ
    found, _ = solve_flow(domain, ACCURACY if case.kind == FINER else case.accuracy)
    slab = interior_slab(packing.position, packing.radius)
    ratio = width_ratio(packing.position, packing.radius, (slab.lower, slab.upper))
    return Solved(found, 1 + replicate, packing.radius.size, ratio)


def _solved_cell(case: Case, replicate: int) -> Solved:
    assert case.cell is not None
    position, radius, box = case.cell((SEED, replicate))
    found = measure_cell(position, radius, box, accuracy=case.accuracy)
    # a cell's porosity is known; that of its nodes is off by a percent where few spheres all lie alike on the lattice
    porosity = 1.0 - float(np.sum(4.0 / 3.0 * math.pi * radius**3) / np.prod(box))
    constant = porosity**3 * found.sauter_diameter**2 / (found.permeability * (1.0 - porosity) ** 2)
    found = replace(found, porosity=porosity, kozeny_constant=constant)
    return Solved(found, replicate, radius.size, width_ratio(position, radius), series(position, radius, box))


def width_ratio(position: FloatArray, radius: FloatArray, between: tuple[float, float] | None = None) -> float:
    """Sum of x/d^2 over the square of the sum of x/d: 1 for spheres of one size.

    Of a bed, ``between`` two heights (m), which are weighted as in its permeability; otherwise of all spheres.
    """
    if between is None:
        volume = radius**3
    else:
        lower, upper = between
        heights = lower + (np.arange(SLICES) + 0.5) / SLICES * (upper - lower)
        square = radius[:, None] ** 2 - (heights[None, :] - position[:, 2, None]) ** 2
        volume = np.maximum(square, 0.0) @ ((heights - lower) * (upper - heights))
    share = volume / volume.sum()
    return float(np.sum(share / radius**2) / np.sum(share / radius) ** 2)
