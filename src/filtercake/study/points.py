"""A study as a list of sweep points, and the tables made of their packings."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from filtercake.packing.scene import Scene, digest
from filtercake.study.config.packing import AUTO
from filtercake.study.config.study import Study
from filtercake.study.config.sweep import SWEPT, Sweep
from filtercake.study.loading import LoadedStudy
from filtercake.study.scenes import scene_of
from filtercake.units import KILOJOULE_PER_M3, MEGAPASCAL, tidy

ChooseEngine = Callable[[Scene], str]
"""Names an engine for a scene."""

POINT_COLUMNS = ("point", "study", "csd", "residence_time_min", *SWEPT, "engine", "porosity_ci95_target")


@dataclass(frozen=True)
class Point:
    """One point of a study.

    Attributes
    ----------
    name : str
        Readable slug with a short hash of everything that decides the packing.
    study, csd : str
        Names of the study and of the distribution.
    residence_time_min : float or None
        Residence time of the crystallizer, where one made the distribution.
    replicates : int
        Packings asked for; at least so many where an interval is asked for.
    scene : Scene
        What is packed.
    porosity_ci95_target : float or None
        Half-width of the porosity's 95 % interval, down to which packings are added.
    max_replicates : int
        Packings after which that ends.
    """

    name: str
    study: str
    csd: str
    residence_time_min: float | None
    replicates: int
    scene: Scene
    porosity_ci95_target: float | None = None
    max_replicates: int = 0

    @property
    def most_replicates(self) -> int:
        """Packings that are made at most."""
        return self.replicates if self.porosity_ci95_target is None else max(self.replicates, self.max_replicates)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, fit for JSON and a rule's params: of the scene, what decides the packing."""
        return {**vars(self), "scene": self.scene.decisive()}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Point:
        """Build a point from :meth:`as_dict`'s values."""
        return cls(**{**values, "scene": Scene.from_dict(values["scene"])})

    def row(self) -> dict[str, Any]:
        """Return the values of ``POINT_COLUMNS``, in the units their names say."""
        return {
            "point": self.name,
            "study": self.study,
            "csd": self.csd,
            "residence_time_min": np.nan if self.residence_time_min is None else self.residence_time_min,
            "cohesion_kJ_m3": tidy(self.scene.cohesion / KILOJOULE_PER_M3),
            "friction": self.scene.friction,
            "poisson_ratio": self.scene.poisson_ratio,
            "restitution": self.scene.restitution,
            "youngs_modulus_MPa": tidy(self.scene.youngs_modulus / MEGAPASCAL),
            "engine": self.scene.engine,
            "porosity_ci95_target": np.nan if self.porosity_ci95_target is None else self.porosity_ci95_target,
        }


def with_engine(study: LoadedStudy, engine: str) -> LoadedStudy:
    """Return the same study made by another engine, under a name that says so."""
    packing = study.model.packing.model_copy(update={"engine": engine})
    model = study.model.model_copy(update={"packing": packing})
    return replace(study, name=f"{study.name}_{engine}", model=model)


def expand(study: LoadedStudy, choose_engine: ChooseEngine) -> list[Point]:
    """List a study's points: the union of its sweeps; a point in two sweeps is visited once.

    ``choose_engine`` names the engine for ``engine: auto``.
    """
    points: dict[str, Point] = {}
    for sweep in study.model.sweeps:
        axes = [_axis(study.model, sweep, name) for name in SWEPT]
        replicates = sweep.replicates or study.model.packing.replicates
        for csd, values in itertools.product(sweep.csd or [], itertools.product(*axes)):
            point = _point(study, csd, dict(zip(SWEPT, values, strict=True)), replicates, choose_engine)
            known = points.get(point.name)
            if known is None or known.replicates < replicates:
                points[point.name] = point
    return list(points.values())


def base_point(
    study: LoadedStudy,
    csd: str,
    choose_engine: ChooseEngine,
    **changed: float,
) -> Point:
    """Return the point of a distribution at the study's base material, but for the properties named by ``changed``."""
    base = {name: getattr(study.model.material, name) for name in SWEPT}
    return _point(study, csd, {**base, **changed}, study.model.packing.replicates, choose_engine)


def points_table(points: Iterable[Point]) -> pd.DataFrame:
    """Tabulate points: ``POINT_COLUMNS`` and the replicates asked for."""
    rows = [{**point.row(), "replicates": point.replicates} for point in points]
    return pd.DataFrame(rows, columns=[*POINT_COLUMNS, "replicates"])


def base_rows(study: Study, table: pd.DataFrame, free: Collection[str] = ()) -> pd.DataFrame:
    """Rows of a table of points at the study's base material, but for the properties named by ``free``."""
    keep = np.ones(len(table), dtype=bool)
    for name in SWEPT:
        if name not in free:
            keep &= np.isclose(table[name].to_numpy(np.float64), getattr(study.material, name))
    return table[keep]


def _axis(study: Study, sweep: Sweep, name: str) -> list[float]:
    values = getattr(sweep, name)
    return [getattr(study.material, name)] if values is None else list(values)


def _point(
    study: LoadedStudy,
    csd_name: str,
    swept: dict[str, float],
    replicates: int,
    choose_engine: ChooseEngine,
) -> Point:
    settings = study.model.packing
    scene = scene_of(study.model, study.csds[csd_name].truncated, swept)
    if scene.engine == AUTO:
        scene = replace(scene, engine=choose_engine(scene))
    return Point(
        name=_slug(csd_name, swept, study.model, scene),
        study=study.name,
        csd=csd_name,
        residence_time_min=study.model.csds[csd_name].residence_time_min,
        replicates=replicates,
        scene=scene,
        porosity_ci95_target=settings.porosity_ci95_target,
        max_replicates=settings.max_replicates,
    )


def _slug(csd_name: str, swept: dict[str, float], study: Study, scene: Scene) -> str:
    """Readable prefix and a hash of all that decides the packing (not of time limits or labels)."""
    parts = [csd_name, f"s{swept['cohesion_kJ_m3']:g}", f"mu{swept['friction']:g}"]
    for name, short in (("poisson_ratio", "nu"), ("restitution", "e"), ("youngs_modulus_MPa", "E")):
        if swept[name] != getattr(study.material, name):
            parts.append(f"{short}{swept[name]:g}")
    return re.sub(r"[^A-Za-z0-9_.-]", "-", "_".join([*parts, digest(scene.decisive())[:8]]))
