"""The packings that the instant estimate is trained on and held against: a space-filling design and how it is packed.

Shapes of distributions, friction and attraction follow a scrambled Sobol sequence, the kinds of distribution in turn,
so that what is made first is spread over the space; what is held out comes from plain random numbers of another seed,
and from shapes that are not trained on as well. Each packing is kept in a file of its own under a digest of all that
decides it, so that a run goes on where it was stopped.
"""

from __future__ import annotations

import math
import multiprocessing
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import scipy
from numpy.typing import ArrayLike

from filtercake.api.steps import csd_name, load
from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import CellError, CloudError, EngineError, PackingRejected
from filtercake.packing.cloud import SETTLED_POROSITY
from filtercake.packing.compression import CompressionCurve
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.pack import pack
from filtercake.packing.porosity import measure
from filtercake.packing.result import write_json
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL, Scene, digest
from filtercake.study import engine_choice
from filtercake.study.points import base_point
from filtercake.units import KILOJOULE_PER_M3, MICROMETRE, FloatArray

TRAINING, HELD_OUT = "training", "held out"
CELL_SAUTER_UM: Final = 30.0
"""Sauter mean of all cells, um; it decides nothing of them."""
CELL_SIDE: Final = 2.7
"""Side of a cell in its largest diameters, at least."""
FEWEST_SPHERES, MOST_SPHERES = 1000, 3000
"""Spheres of a cell; what needs more is not in the design."""
MOST_BED_SPHERES: Final = 8000
"""Spheres of a settled bed, which the study's defaults choose."""
REPEATED: Final = 8
"""Every so many packings one is a second packing of a point before it: how much a packing scatters."""
BACK: Final = 3
"""How far before."""
FRICTIONLESS_SHARE: Final = 0.2
LARGEST_FRICTION: Final = 1.0
COHESIONLESS_SHARE: Final = 0.1
LARGEST_COHESION: Final = 120.0
"""Of settled beds, kJ/m3, at the default modulus of 5 MPa."""
BED_SAUTER_UM: Final = (10.0, 400.0)
BED_DENSITY: Final = (1000.0, 2700.0)
"""kg/m3."""
MOST_STICKY: Final = 200.0
"""Strength of the contacts over the stress half way down a bed, at most; 100 kJ/m3 on the paper's PMMA has 167."""
CLASS_STEP: Final = 0.2
"""Width of a class in the logarithm of the size, at most."""
FEWEST_CLASSES: Final = 6
DIMENSIONS: Final = 8
POWER: Final = 11
"""The sequence has two to this power points."""

Cumulative = Callable[[FloatArray], FloatArray]
Quantile = Callable[[float], float]
Say = Callable[[str], None]


@dataclass(frozen=True)
class Member:
    """One packing of the design.

    Attributes
    ----------
    role : {"training", "held out"}
        What it is for.
    family : str
        Kind of distribution.
    scene : Scene
        What is packed.
    replicate : int
        Number of the packing of its scene.
    """

    role: str
    family: str
    scene: Scene
    replicate: int

    @property
    def name(self) -> str:
        """File of the packing: it follows from everything that decides it."""
        return f"{digest(self.scene.decisive(), self.replicate)[:24]}.json"


def members(draw: int, rounds: int) -> Iterator[Member]:
    """List packings in the order in which they are made; a longer list begins with a shorter one.

    Parameters
    ----------
    draw : int
        Seed of what is held out: another one draws other distributions and other clouds.
    rounds : int
        Rounds of five cells, one of them without attraction, and four beds for the training, and one or two packings
        that are held out.
    """
    cells, beds = _sequence(FILTRATION_PROTOCOL), _sequence(GRAVITY_PROTOCOL)
    other_cells, other_beds = _random(FILTRATION_PROTOCOL, draw), _random(GRAVITY_PROTOCOL, draw)
    loose = map(without_attraction, _random(FILTRATION_PROTOCOL, draw + 1))
    for number in range(rounds):
        four = [next(cells) for _ in range(4)]
        yield from four
        yield without_attraction(four[number % 4])
        for _ in range(4):
            yield next(beds)
        # after 28 rounds 42 held-out cells, 7 more without attraction, and 21 beds
        for _ in range(1 + number % 2):
            yield next(other_cells)
        if number % 4 < 3:
            yield next(other_beds)
        if number % 4 == 0:
            yield next(loose)


def _sequence(protocol: str) -> Iterator[Member]:
    """Members of the training, with a second packing of an earlier one now and then."""
    sobol = scipy.stats.qmc.Sobol(DIMENSIONS, scramble=True, seed=1 if protocol == FILTRATION_PROTOCOL else 2)
    made: list[Member] = []
    names: set[str] = set()
    for number, point in enumerate(sobol.random_base2(POWER)):
        family = IN_TURN[(number + number // MOVES_ON) % len(IN_TURN)]
        found = _member(TRAINING, family, point, protocol, 1)
        if found is None or found.name in names:  # equal spheres without friction are all alike
            continue
        made.append(found)
        names.add(found.name)
        yield found
        if len(made) % (REPEATED - 1) == 0:
            earlier = made[-BACK]
            yield Member(earlier.role, earlier.family, earlier.scene, 1)


def _random(protocol: str, draw: int) -> Iterator[Member]:
    """Members that are held out."""
    random = np.random.default_rng([draw, len(protocol)])
    families = [*IN_TURN, *UNSEEN, *UNSEEN]
    names: set[str] = set()
    while True:
        family = families[int(random.integers(len(families)))]
        found = _member(HELD_OUT, family, random.random(DIMENSIONS), protocol, 1000 + draw)
        if found is not None and found.name not in names:
            names.add(found.name)
            yield found


def _member(role: str, family: str, point: FloatArray, protocol: str, seed: int) -> Member | None:
    """Make the member of a point of the unit cube; None where it would need too many spheres."""
    csd = {**FAMILIES, **UNSEEN}[family](*point[:4])
    mu = friction_of(point[4])
    if protocol == FILTRATION_PROTOCOL:
        spheres = spheres_for(csd)
        attraction = "adhesion" if point[5] < 0.6 else "cohesion"
        scene = None if spheres > MOST_SPHERES else cell_scene(csd, mu, attraction, spheres, seed)
    else:
        scene = bed_scene(csd, mu, point[5:8], seed)
    return None if scene is None else Member(role, family, scene, 0)


def without_attraction(member: Member) -> Member:
    """Make the cell that is pressed at once, without attraction, of the same spheres."""
    return replace(member, scene=_bare(member.scene))


def _bare(scene: Scene) -> Scene:
    return replace(scene, adhesion=0.0, cohesion=0.0)


def friction_of(share: float) -> float:
    """Friction of a number in [0, 1): none in a fifth of it, beyond that more densely where it counts for more."""
    rest = max(0.0, (share - FRICTIONLESS_SHARE) / (1.0 - FRICTIONLESS_SHARE))
    return round(LARGEST_FRICTION * rest**2, 4)


def spheres_for(csd: CrystalSizeDistribution) -> int:
    """Choose how many spheres a cell has: few, but enough that the largest is not its own neighbour."""
    wanted = (1.0 - SETTLED_POROSITY) * (CELL_SIDE * csd.largest) ** 3 / (math.pi / 6.0) * _number_per_volume(csd)
    return max(FEWEST_SPHERES, math.ceil(wanted / 100.0) * 100)


def _number_per_volume(csd: CrystalSizeDistribution) -> float:
    return math.pi / 6.0 / csd.mean_particle_volume


def cell_scene(csd: CrystalSizeDistribution, friction: float, attraction: str, spheres: int, seed: int) -> Scene:
    """Make the scene of a pressed cell; neither the strength of its attraction nor the pressure counts."""
    sticks = {"cohesion_kJ_m3": 50.0} if attraction == "cohesion" else {"adhesion_mJ_m2": 10.0}
    material = {"density_kg_m3": 1500.0, "friction": friction, "trust_units": True, **sticks}
    packing = {"protocol": FILTRATION_PROTOCOL, "pressure_kPa": 50.0, "particles": spheres, "seed": seed}
    scene = _scene(csd, CELL_SAUTER_UM, material, packing).as_packed()
    return scene if attraction != "none" else _bare(scene)


def bed_scene(csd: CrystalSizeDistribution, friction: float, point: FloatArray, seed: int) -> Scene | None:
    """Make the scene of a settled bed by the study's defaults; None where it is too large or too sticky."""
    sauter = math.exp(float(np.interp(point[0], [0.0, 1.0], np.log(BED_SAUTER_UM))))
    sticky = max(0.0, (float(point[1]) - COHESIONLESS_SHARE) / (1.0 - COHESIONLESS_SHARE))
    material = {
        "density_kg_m3": round(float(np.interp(point[2], [0.0, 1.0], BED_DENSITY)), 1),
        "friction": friction,
        "cohesion_kJ_m3": round(LARGEST_COHESION * sticky, 2),
    }
    scene = settled_scene(csd, sauter, material, seed)
    return None if scene.particles > MOST_BED_SPHERES or scene.strength_over_load > MOST_STICKY else scene


def settled_scene(csd: CrystalSizeDistribution, sauter_um: float, material: dict[str, Any], seed: int) -> Scene:
    """Make the scene of a bed settled by the study's defaults."""
    return _scene(csd, sauter_um, {**material, "trust_units": True}, {"seed": seed, "engine": Embedded.name})


def _scene(csd: CrystalSizeDistribution, sauter_um: float, material: dict[str, Any], packing: dict[str, Any]) -> Scene:
    sizes = csd.size / csd.sauter_mean * sauter_um
    mixture = {float(size): float(share) for size, share in zip(sizes, csd.volume_fraction, strict=True)}
    # of what the spheres hold instead of the classes is asked, so that no choice of their number is wrong
    study = load({"mixture": mixture}, material, {"processes": 1, **packing}, packed=False)
    return base_point(study, csd_name(study), engine_choice.choose).scene


def _between(low: float, high: float, share: float) -> float:
    """Value between two that is as often in any factor of them."""
    return float(low * (high / low) ** share)


def _classes(size: ArrayLike, share: ArrayLike) -> CrystalSizeDistribution:
    """Build a distribution from sizes of which only the ratios count."""
    return CrystalSizeDistribution.from_classes(np.asarray(size) * MICROMETRE, share)


def _cut(cumulative: Cumulative, quantile: Quantile, low: float, high: float) -> CrystalSizeDistribution:
    """Cut a distribution of the volume into classes between two of its quantiles, each in 0.001 to 0.03 of an end."""
    ends = quantile(_between(1e-3, 0.03, low)), quantile(1.0 - _between(1e-3, 0.03, high))
    classes = max(FEWEST_CLASSES, math.ceil(math.log(ends[1] / ends[0]) / CLASS_STEP))
    edges = np.geomspace(*ends, classes + 1)
    share = np.diff(cumulative(edges))
    return _classes(np.sqrt(edges[1:] * edges[:-1]), share / share.sum())


def _one(*_: float) -> CrystalSizeDistribution:
    return _classes([1.0], [1.0])


def _two(ratio: float, fine: float, *_: float) -> CrystalSizeDistribution:
    share = 0.02 + 0.96 * fine
    return _classes([1.0, _between(1.2, 10.0, ratio)], [share, 1.0 - share])


def _three(ratio: float, other: float, fine: float, coarse: float) -> CrystalSizeDistribution:
    middle = _between(1.2, 4.0, ratio)
    sizes = [1.0, middle, middle * _between(1.2, 4.0, other)]
    share = 0.05 + 0.9 * fine
    rest = (1.0 - share) * (0.1 + 0.8 * coarse)
    return _classes(sizes, [share, 1.0 - share - rest, rest])


def _lognormal(spread: float, low: float, high: float, *_: float) -> CrystalSizeDistribution:
    law = scipy.stats.lognorm(0.08 + 0.6 * spread)
    return _cut(law.cdf, law.ppf, low, high)


def _gamma(shape: float, low: float, high: float, *_: float) -> CrystalSizeDistribution:
    """Volume of an MSMPR crystallizer's product (shape 4) and of its like."""
    law = scipy.stats.gamma(_between(3.0, 12.0, shape))
    return _cut(law.cdf, law.ppf, low, high)


def _rosin_rammler(exponent: float, low: float, high: float, *_: float) -> CrystalSizeDistribution:
    law = scipy.stats.weibull_min(_between(1.5, 8.0, exponent))
    return _cut(law.cdf, law.ppf, low, high)


def _measured(apart: float, weight: float, spread: float, end: float) -> CrystalSizeDistribution:
    """Two overlapping peaks of different widths, as an instrument shows them."""
    laws = scipy.stats.lognorm(0.15 + 0.3 * spread), scipy.stats.lognorm(0.45 - 0.3 * spread, scale=math.exp(2 * apart))
    shares = 0.1 + 0.8 * weight, 0.9 - 0.8 * weight

    def cumulative(size: FloatArray) -> FloatArray:
        return np.asarray(sum(share * law.cdf(size) for share, law in zip(shares, laws, strict=True)))

    def quantile(share: float) -> float:
        return float(scipy.optimize.brentq(lambda size: float(cumulative(size)) - share, 1e-3, 1e3))

    return _cut(cumulative, quantile, end, end)


def _power_law(exponent: float, ratio: float, *_: float) -> CrystalSizeDistribution:
    """Gates, Gaudin and Schuhmann: the volume below a size is a power of it, down to a smallest size."""
    power, least = _between(0.6, 4.0, exponent), 1.0 / _between(2.0, 12.0, ratio)
    classes = max(FEWEST_CLASSES, math.ceil(-math.log(least) / CLASS_STEP))
    edges = np.geomspace(least, 1.0, classes + 1)
    share = np.diff(edges**power)
    return _classes(np.sqrt(edges[1:] * edges[:-1]), share / share.sum())


def _uneven(first: float, second: float, third: float, fourth: float) -> CrystalSizeDistribution:
    """Five sieve fractions of any weight."""
    weights = np.array([0.05 + first, 0.05 + second, 0.05 + third, 0.05 + fourth, 0.5])
    return _classes(np.sqrt(2.0) ** np.arange(5), weights / weights.sum())


FAMILIES: Final[dict[str, Callable[..., CrystalSizeDistribution]]] = {
    "one size": _one,
    "two sizes": _two,
    "three sizes": _three,
    "lognormal": _lognormal,
    "MSMPR": _gamma,
    "Rosin-Rammler": _rosin_rammler,
    "measured": _measured,
}
"""Shapes that are trained on; each takes four numbers in [0, 1)."""
IN_TURN: Final = (
    *("two sizes", "lognormal", "measured", "MSMPR", "two sizes", "Rosin-Rammler", "measured", "three sizes"),
    *("two sizes", "lognormal", "measured", "MSMPR", "one size", "Rosin-Rammler"),
)
"""Their order."""
MOVES_ON: Final = 84
"""Points of the sequence after which that order moves on by one: a kind that always has the even points has only a half
of a coordinate."""
UNSEEN: Final[dict[str, Callable[..., CrystalSizeDistribution]]] = {"power law": _power_law, "sieves": _uneven}
"""Shapes that are only held out."""


def compute(folder: Path, listed: Sequence[Member], processes: int, say: Say = lambda _: None) -> None:
    """Make the packings that ``folder`` does not hold yet, in their order, in several processes."""
    folder.mkdir(parents=True, exist_ok=True)
    missing = [member for member in listed if not (folder / member.name).exists()]
    # a kernel that numba compiles while another process forks is not there for it
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context) as pool:
        running = [pool.submit(_keep, folder / member.name, member) for member in missing]
        try:
            for number, (member, future) in enumerate(zip(missing, running, strict=True)):
                say(f"{number + 1}/{len(missing)} {_said(member, future.result())}")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _keep(path: Path, member: Member) -> dict[str, Any]:
    row = packed(member)
    write_json(path, row)
    return row


def _said(member: Member, row: Mapping[str, Any]) -> str:
    scene = member.scene
    what = f"{scene.protocol}, {member.role}, {member.family}, friction {scene.friction:g}, {scene.particles} spheres"
    porosity = f"porosity {row['porosity'][-1]:.4f}" if row["porosity"] else "no porosity"
    return f"{what}: {porosity}, {row['seconds']:.1f} s {row['reason']}"


def packed(member: Member) -> dict[str, Any]:
    """Make one packing; its row, with a reason and no porosity where it is not accepted."""
    scene, started = member.scene, time.process_time()
    loads: list[float | None] = []
    porosity: list[float] = []
    reason = ""
    try:
        with tempfile.TemporaryDirectory() as scratch:
            found = pack(scene, member.replicate, Path(scratch))
        if scene.is_pressed:
            curve = CompressionCurve.of(found.diagnostics)
            loads = [None if math.isinf(x) else float(x) for x in curve.load]
            porosity = curve.porosity.tolist()
        else:
            porosity = [measure(found, scene).interior]
    except (CellError, CloudError, EngineError, PackingRejected) as error:
        reason = " ".join(str(error).split())
    return {
        **described(member),
        "load": loads,
        "porosity": porosity,
        "seconds": time.process_time() - started,
        "reason": reason,
    }


def described(member: Member) -> dict[str, Any]:
    """Plain values that say what is packed."""
    scene = member.scene
    return {
        "protocol": scene.protocol,
        "role": member.role,
        "family": member.family,
        "replicate": member.replicate,
        "seed": scene.seed,
        "particles": scene.particles,
        "friction": scene.friction,
        "attraction": scene.attraction,
        "cohesion_kJ_m3": None if scene.is_pressed else scene.cohesion / KILOJOULE_PER_M3,
        "density_kg_m3": scene.density,
        "bed_depth_factor": scene.bed_depth_factor,
        "size_um": (scene.csd.size / MICROMETRE).tolist(),
        "volume_fraction": scene.csd.volume_fraction.tolist(),
    }
