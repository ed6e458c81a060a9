"""A study as a list of sweep points, and the tables made of their packings."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.scene import FILTRATION_PROTOCOL, Scene, digest
from filtercake.study.config.packing import AUTO
from filtercake.study.config.study import Study
from filtercake.study.config.sweep import OF_FILTRATION, SWEPT, Sweep
from filtercake.study.loading import LoadedStudy
from filtercake.study.scenes import scene_of
from filtercake.units import KILOJOULE_PER_M3, KILOPASCAL, MEGAPASCAL, MILLIJOULE_PER_M2, tidy

if TYPE_CHECKING:
    import pandas as pd
from numpy.typing import NDArray

ChooseEngine = Callable[[Scene], str]
"""Names an engine for a scene."""

POINT_COLUMNS = (
    "point",
    "study",
    "csd",
    "residence_time_min",
    "protocol",
    *SWEPT,
    "engine",
    "porosity_ci95_target",
    "packings",
)


@dataclass(frozen=True)
class Point:
    """One point of a study.

    Attributes
    ----------
    name : str
        Readable slug with a short hash of everything that decides the result.
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
    def packings(self) -> str:
        """Name of its packings: those of pressed cakes serve every pressure and every strength of the attraction."""
        if not self.scene.is_pressed:
            return self.name
        packed = self.scene.as_packed()
        return _safe(f"{self.csd}_pressed_mu{packed.friction:g}_{packed.attraction}_{digest(packed.decisive())[:8]}")

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
            "protocol": self.scene.protocol,
            "cohesion_kJ_m3": tidy(self.scene.cohesion / KILOJOULE_PER_M3),
            "friction": self.scene.friction,
            "poisson_ratio": self.scene.poisson_ratio,
            "restitution": self.scene.restitution,
            "youngs_modulus_MPa": tidy(self.scene.youngs_modulus / MEGAPASCAL),
            "adhesion_mJ_m2": tidy(self.scene.adhesion / MILLIJOULE_PER_M2) if self.scene.is_pressed else np.nan,
            "pressure_kPa": tidy(self.scene.pressure / KILOPASCAL) if self.scene.is_pressed else np.nan,
            "engine": self.scene.engine,
            "porosity_ci95_target": np.nan if self.porosity_ci95_target is None else self.porosity_ci95_target,
            "packings": self.packings,
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
        protocols = sweep.protocol or [study.model.packing.protocol]
        engines = sweep.engine or [study.model.packing.engine]
        kinds = itertools.product(sweep.csd or [], protocols, engines)
        for (csd, protocol, engine), values in itertools.product(kinds, itertools.product(*axes)):
            swept = dict(zip(SWEPT, values, strict=True))
            point = _point(study, csd, swept, replicates, choose_engine, protocol, engine)
            known = points.get(point.name)
            if known is None or known.replicates < replicates:
                points[point.name] = point
    return list(points.values())


def packed(points: Iterable[Point]) -> dict[str, Point]:
    """List what is packed for points, by the name of the packings: one for all points that they serve."""
    found: dict[str, Point] = {}
    for point in points:
        name = point.packings
        made = replace(point, name=name, scene=point.scene.as_packed())
        if name not in found or found[name].replicates < point.replicates:
            found[name] = made
    return found


def base_point(
    study: LoadedStudy,
    csd: str,
    choose_engine: ChooseEngine,
    **changed: float,
) -> Point:
    """Return the point of a distribution at the study's base material, but for the properties named by ``changed``."""
    base = {name: study.model.base(name) for name in SWEPT}
    settings = study.model.packing
    swept = {**base, **changed}
    return _point(study, csd, swept, settings.replicates, choose_engine, settings.protocol, settings.engine)


def points_table(points: Iterable[Point]) -> pd.DataFrame:
    """Tabulate points: ``POINT_COLUMNS`` and the replicates asked for."""
    import pandas as pd  # who plans a study needs no table

    rows = [{**point.row(), "replicates": point.replicates} for point in points]
    return pd.DataFrame(rows, columns=[*POINT_COLUMNS, "replicates"])


def base_rows(study: Study, table: pd.DataFrame, free: Collection[str] = ()) -> pd.DataFrame:
    """Rows of a table of points at the study's base, but for the properties named by ``free``.

    They are those of the study's own protocol and engine, unless ``free`` names ``protocol`` or ``engine``.
    """
    keep = np.ones(len(table), dtype=bool)
    if "engine" not in free:
        keep &= _of_own_engine(study, table)
    if "protocol" not in free:
        keep &= (table["protocol"] == study.packing.protocol).to_numpy()
    pressed = (table["protocol"] == FILTRATION_PROTOCOL).to_numpy()
    for name in SWEPT:
        base = study.base(name)
        if name in free or base is None:
            continue
        here = np.isclose(table[name].to_numpy(np.float64), base)
        if name == "cohesion_kJ_m3" and study.material.adhesion_mJ_m2 is not None:
            here |= pressed  # they stick by adhesion
        keep &= here | (~pressed & (name in OF_FILTRATION))
    return table[keep]


def _of_own_engine(study: Study, table: pd.DataFrame) -> NDArray[np.bool_]:
    """Rows by the study's own engine; by the first of the table, where its own packed nothing. One presses cakes."""
    made, pressed = table["engine"].astype(str), table["protocol"] == FILTRATION_PROTOCOL
    own = Embedded.name if study.packing.engine == AUTO else study.packing.engine
    beds = made[~pressed]
    if len(beds) and own not in set(beds):
        own = beds.iloc[0]
    return np.asarray((made == own) | pressed, dtype=bool)


def _axis(study: Study, sweep: Sweep, name: str) -> list[float | None]:
    values = getattr(sweep, name)
    return [study.base(name)] if values is None else list(values)


def _point(
    study: LoadedStudy,
    csd_name: str,
    swept: Mapping[str, float | None],
    replicates: int,
    choose_engine: ChooseEngine,
    protocol: str,
    engine: str,
) -> Point:
    settings = study.model.packing
    scene = scene_of(study.model, study.csds[csd_name].truncated, swept, protocol, engine)
    chosen = settings.engine if settings.engine != AUTO else choose_engine(scene)
    if scene.engine == AUTO:
        scene = replace(scene, engine=chosen)
    other = "" if scene.is_pressed or scene.engine == chosen else scene.engine
    return Point(
        name=_slug(csd_name, swept, study.model, scene, other),
        study=study.name,
        csd=csd_name,
        residence_time_min=study.model.csds[csd_name].residence_time_min,
        replicates=replicates,
        scene=scene,
        porosity_ci95_target=settings.porosity_ci95_target,
        max_replicates=settings.max_replicates,
    )


def _slug(csd_name: str, swept: Mapping[str, float | None], study: Study, scene: Scene, engine: str) -> str:
    """Readable prefix and a hash of all that decides the result (not of time limits or labels).

    ``engine`` is named where it is not the study's own.
    """
    stick = f"s{swept['cohesion_kJ_m3']:g}"
    if scene.is_pressed and swept["adhesion_mJ_m2"] is not None:
        stick = f"W{swept['adhesion_mJ_m2']:g}"
    parts = [csd_name, stick, f"mu{scene.friction:g}"]
    if scene.is_pressed:
        parts.append(f"p{swept['pressure_kPa']:g}")
    for name, short in (("poisson_ratio", "nu"), ("restitution", "e"), ("youngs_modulus_MPa", "E")):
        if swept[name] != study.base(name):
            parts.append(f"{short}{swept[name]:g}")
    parts += [engine] if engine else []
    return _safe("_".join([*parts, digest(scene.decisive())[:8]]))


def _safe(name: str) -> str:
    """Replace what file names should not have."""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", name)
