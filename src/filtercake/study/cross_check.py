"""Which packings of a study another engine makes once more."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from filtercake.packing.scene import stage_seed
from filtercake.study.loading import LoadedStudy
from filtercake.study.points import Point


def drawn(study: LoadedStudy, points: Iterable[Point]) -> list[tuple[Point, Point]]:
    """Draw points of a study whose first packings its ``cross_check`` has made by the other engine.

    The draw follows from the study's seed. A point is drawn again only when every other one has been; never more often
    than it has packings.

    Parameters
    ----------
    study : LoadedStudy
        The study; without ``cross_check``, nothing is drawn.
    points : iterable of Point
        Its points. Those of pressed cakes, which one engine presses, and those of the other engine are left out.

    Returns
    -------
    list of (Point, Point)
        Each point drawn, and the same as the other engine packs it, with as many replicates as it was drawn.
    """
    asked = study.model.cross_check
    if asked is None:
        return []
    suited = {p.name: p for p in points if not p.scene.is_pressed and p.scene.engine != asked.engine}
    order = np.random.default_rng(stage_seed("cross_check", study.name, study.model.packing.seed))
    names = [str(name) for name in order.permutation(sorted(suited))]
    deepest = max((suited[name].replicates for name in names), default=0)
    turns = [name for turn in range(deepest) for name in names if suited[name].replicates > turn]
    counts = Counter(turns[: asked.packings])
    return [(suited[name], _made_by(suited[name], asked.engine, count)) for name, count in counts.items()]


def _made_by(point: Point, engine: str, replicates: int) -> Point:
    scene = replace(point.scene, engine=engine)
    name = f"{point.name}_{engine}"
    return replace(point, name=name, scene=scene, replicates=replicates, porosity_ci95_target=None)
