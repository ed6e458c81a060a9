"""Packings that show what the scatter of porosity is made of: 50/50 PMMA as in the paper, from arranged clouds."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import PackingRejected
from filtercake.packing.accept import accept
from filtercake.packing.analytic_models import yu_zou_standish
from filtercake.packing.cloud import Cloud, make_cloud
from filtercake.packing.engines import SettleRequest, get_engine
from filtercake.packing.pack import Report, cloud_seed
from filtercake.packing.porosity import measure, porosity_profile, volume_below
from filtercake.packing.result import Packing
from filtercake.packing.scene import Scene, stage_seed
from filtercake.packing.settling import StopRule
from filtercake.packing.slab import Slab, bed_height
from filtercake.units import MICROMETRE, FloatArray
from filtercake.validation.pressure import bed

SEED: Final = 5001
PLAIN, OTHER_STEP, MIRRORED, STRATIFIED, WIDER, DEEPER = (
    "as asked",
    "same clouds, other step",
    "mirrored",
    "stratified",
    "four times as wide",
    "other depth",
)
DEPTHS: Final = (0.75, 1.5, 2.0, 3.0, 4.0)
"""Depths of cloud and bed over the paper's, in the paper's box, by as many more spheres."""
MIDDLE: Final = (0.16, 0.83)
"""Share of a cloud's solids, by height, that comes to lie in the interior."""
SLICES: Final = 40

Place = Callable[[Scene, int], Cloud]


@dataclass(frozen=True)
class Way:
    """A way to make packings: its name, scene, how clouds are placed, how many."""

    name: str
    scene: Scene
    place: Place
    replicates: int


def ways() -> Iterator[Way]:
    """List what is packed: without friction and with 0.3."""
    for friction, count in ((0.0, 120), (0.3, 40)):
        scene = replace(bed({"mixture": {20.0: 0.5, 50.0: 0.5}}, particles=2000, friction=friction), seed=SEED)
        yield Way(PLAIN, scene, plain, count)
        yield Way(OTHER_STEP, replace(scene, time_step=0.9 * scene.time_step), plain, count)
        if friction == 0.0:
            yield Way(MIRRORED, scene, mirrored, count)
            yield Way(STRATIFIED, scene, stratified, count)
            yield Way(WIDER, replace(scene, particles=8000, bed_depth_factor=0.5), plain, 16)
            for depth in DEPTHS:
                deep = replace(scene, particles=round(2000 * depth), bed_depth_factor=depth)
                yield Way(DEEPER, deep, plain, 8)


def plain(scene: Scene, replicate: int) -> Cloud:
    """Place the cloud that a study starts from."""
    seed = cloud_seed(scene, replicate)
    return make_cloud(scene.csd, scene.particles, scene.initial_void_fraction, seed, scene.bed_depth_factor)


def mirrored(scene: Scene, replicate: int) -> Cloud:
    """Turn that cloud upside down."""
    cloud = plain(scene, replicate)
    return replace(cloud, position=cloud.position * [1.0, 1.0, -1.0] + [0.0, 0.0, cloud.height])


def stratified(scene: Scene, replicate: int) -> Cloud:
    """Place every class evenly over the height: each sphere in a slice of its own, at random in it."""
    cloud = plain(scene, replicate)
    random = np.random.default_rng(cloud_seed(scene, replicate))
    placed = np.empty_like(cloud.position)
    counts = np.unique(cloud.radius, return_counts=True)[1][::-1]  # as the spheres are listed, the largest first
    rank, slices = np.concatenate([random.permutation(n) for n in counts]), np.repeat(counts, counts)
    for k, radius in enumerate(cloud.radius):
        while True:
            share = (rank[k] + random.random()) / slices[k]
            x, y = cloud.length * random.random(2)
            placed[k] = x, y, radius + share * (cloud.height - 2.0 * radius)
            apart = placed[:k] - placed[k]
            apart[:, :2] -= cloud.length * np.round(apart[:, :2] / cloud.length)
            if np.all(np.sum(apart**2, axis=1) >= (cloud.radius[:k] + radius) ** 2):
                break
    return replace(cloud, position=placed)


def pack_all(report: Report = lambda _: None) -> pd.DataFrame:
    """Make every packing; one row each, rejected ones left out."""
    rows = []
    for way in ways():
        for replicate in range(way.replicates):
            found = _settle(way, replicate)
            if found is not None:
                scene = way.scene
                place = (way.name, scene.friction, scene.particles, scene.bed_depth_factor, replicate)
                names = ("way", "friction", "particles", "bed_depth_factor", "replicate")
                rows.append({**dict(zip(names, place, strict=True)), **found})
        report(f"{way.name}, friction {way.scene.friction:g}, {way.scene.particles} spheres: {way.replicates}")
    return pd.DataFrame(rows)


def _settle(way: Way, replicate: int) -> dict[str, Any] | None:
    scene, cloud = way.scene, way.place(way.scene, replicate)
    rule = StopRule.for_bed(scene, cloud.length)
    with tempfile.TemporaryDirectory(prefix="filtercake-") as folder:
        seed = stage_seed(cloud_seed(scene, replicate), "engine")
        state = get_engine(scene.engine).settle(SettleRequest(scene, cloud, rule, seed, Path(folder), lambda _: None))
    try:
        accept(state, scene, cloud, rule)
    except PackingRejected:
        return None
    return {**measured(Packing(state.position, state.radius, state.length), scene, cloud), "steps": state.steps}


def measured(packing: Packing, scene: Scene, cloud: Cloud) -> dict[str, float]:
    """Measure a packing by every estimator, with what might explain its porosity.

    Returns
    -------
    dict
        Porosities by the interior slab, slab from the floor, paper's count, a slab half a largest diameter from floor
        and surface, weights that taper off from the interior's middle, and of the whole bed up to its height; the
        height, um; and porosities by the analytic model of the composition of the interior, and of the cloud's middle.
    """
    position, radius, length = packing.position, packing.radius, packing.length
    found, height, largest = measure(packing, scene), bed_height(position, radius), 2.0 * float(radius.max())

    def profile(margin: float) -> FloatArray:
        return porosity_profile(position, radius, length, np.linspace(margin, height - margin, SLICES + 1))

    middle = np.sin(np.pi * (np.arange(SLICES) + 0.5) / SLICES)
    solids = 4.0 / 3.0 * np.pi * radius**3
    return {
        "interior": found.interior,
        "from_floor": found.from_floor,
        "paper_count": found.paper_count,
        "larger_slab": float(profile(0.5 * largest).mean()),
        "tapered": float(np.average(profile(0.5 * largest), weights=middle)),
        "bed": 1.0 - float(solids.sum()) / (length**2 * height),
        "height_um": height / MICROMETRE,
        "model_interior": _model(radius, _inside(position, radius, found.slab)),
        "model_cloud": _model(cloud.radius, _middle(cloud)),
    }


def _inside(position: FloatArray, radius: FloatArray, slab: Slab) -> FloatArray:
    heights = position[:, 2]
    return volume_below(slab.upper, heights, radius) - volume_below(slab.lower, heights, radius)


def _middle(cloud: Cloud) -> FloatArray:
    """Volumes of the spheres in the middle of a cloud, by their share of the solids under them; 0 elsewhere."""
    volume, order = cloud.radius**3, np.argsort(cloud.position[:, 2])
    below = np.empty_like(volume)
    below[order] = np.cumsum(volume[order]) / volume.sum()
    return np.where((below > MIDDLE[0]) & (below < MIDDLE[1]), volume, 0.0)


def _model(radius: FloatArray, volume: FloatArray) -> float:
    """Porosity by the analytic model for spheres of these radii that hold so much volume each."""
    sizes, index = np.unique(radius, return_inverse=True)
    shares = np.bincount(index, volume)
    return yu_zou_standish(CrystalSizeDistribution.from_classes(2.0 * sizes, shares / shares.sum()))
