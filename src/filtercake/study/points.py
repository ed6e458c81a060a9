"""A study as a list of sweep points, and the tables made of their packings."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Collection, Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing import contact_law
from filtercake.packing.cloud import BedSize, bed_for
from filtercake.packing.scene import PackingSpec, digest
from filtercake.study.config.packing import Packing
from filtercake.study.config.study import Study
from filtercake.study.config.sweep import SWEPT, Sweep
from filtercake.study.loading import LoadedStudy
from filtercake.units import KILOJOULE_PER_M3, MEGAPASCAL, MICROMETRE, MINUTE, tidy

ChooseEngine = Callable[[CrystalSizeDistribution, int, float], str]
"""Names an engine from a distribution, a number of particles and a restitution."""

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
    spec : PackingSpec
        Specification of the packings.
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
    spec: PackingSpec
    porosity_ci95_target: float | None = None
    max_replicates: int = 0

    @property
    def most_replicates(self) -> int:
        """Packings that are made at most."""
        return self.replicates if self.porosity_ci95_target is None else max(self.replicates, self.max_replicates)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, fit for JSON and a rule's params."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Point:
        """Build a point from :meth:`as_dict`'s values."""
        return cls(**{**values, "spec": PackingSpec.from_dict(values["spec"])})

    def row(self) -> dict[str, Any]:
        """Return the values of ``POINT_COLUMNS``, in the units their names say."""
        return {
            "point": self.name,
            "study": self.study,
            "csd": self.csd,
            "residence_time_min": np.nan if self.residence_time_min is None else self.residence_time_min,
            "cohesion_kJ_m3": tidy(self.spec.cohesion / KILOJOULE_PER_M3),
            "friction": self.spec.friction,
            "poisson_ratio": self.spec.poisson_ratio,
            "restitution": self.spec.restitution,
            "youngs_modulus_MPa": tidy(self.spec.youngs_modulus / MEGAPASCAL),
            "engine": self.spec.engine,
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


def bed_of(settings: Packing, csd: CrystalSizeDistribution) -> BedSize:
    """Size of the beds of a (truncated) distribution: what the study says, or what the distribution needs."""
    if settings.particles is not None:
        return BedSize(settings.particles, settings.bed_depth_factor or 1.0)
    chosen = bed_for(csd, settings.initial_void_fraction)
    one_shape = settings.engine == "liggghts_as_published"
    return BedSize(chosen.particles, settings.bed_depth_factor or (1.0 if one_shape else chosen.bed_depth_factor))


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
    settings, material = study.model.packing, study.model.material
    csd = study.csds[csd_name].truncated
    modulus, poisson = swept["youngs_modulus_MPa"] * MEGAPASCAL, swept["poisson_ratio"]
    rayleigh = contact_law.rayleigh_time_step(0.5 * csd.smallest, material.density, modulus, poisson)
    bed = bed_of(settings, csd)
    engine = settings.engine if settings.engine != "auto" else choose_engine(csd, bed.particles, swept["restitution"])
    spec = PackingSpec(
        particles=bed.particles,
        initial_void_fraction=settings.initial_void_fraction,
        bed_depth_factor=bed.bed_depth_factor,
        settling_velocity=settings.settling_velocity_m_s,
        density=material.density,
        youngs_modulus=modulus,
        poisson_ratio=poisson,
        restitution=swept["restitution"],
        friction=swept["friction"],
        cohesion=swept["cohesion_kJ_m3"] * KILOJOULE_PER_M3,
        time_step=settings.time_step(rayleigh, swept["friction"]),
        engine=engine,
        seed=settings.seed,
        porosity_tolerance=settings.porosity_tolerance,
        max_fall_times=settings.max_fall_times,
        skin=(settings.skin_um or 0.0) * MICROMETRE,
        processes=settings.processes,
        time_limit=settings.time_limit_min * MINUTE,
        write_vtk=settings.write_vtk,
    )
    return Point(
        name=_slug(csd_name, swept, study.model, spec, csd),
        study=study.name,
        csd=csd_name,
        residence_time_min=study.model.csds[csd_name].residence_time_min,
        replicates=replicates,
        spec=spec,
        porosity_ci95_target=settings.porosity_ci95_target,
        max_replicates=settings.max_replicates,
    )


def _slug(csd_name: str, swept: dict[str, float], study: Study, spec: PackingSpec, csd: CrystalSizeDistribution) -> str:
    """Readable prefix and a hash of all that decides the packing (not of time limits or labels)."""
    parts = [csd_name, f"s{swept['cohesion_kJ_m3']:g}", f"mu{swept['friction']:g}"]
    for name, short in (("poisson_ratio", "nu"), ("restitution", "e"), ("youngs_modulus_MPa", "E")):
        if swept[name] != getattr(study.material, name):
            parts.append(f"{short}{swept[name]:g}")
    idle = {"time_limit", "write_vtk"} | ({"bed_depth_factor"} if spec.bed_depth_factor == 1.0 else set())
    decisive = {key: value for key, value in asdict(spec).items() if key not in idle}
    code = digest(decisive, csd.size.tolist(), csd.volume_fraction.tolist())[:8]
    return re.sub(r"[^A-Za-z0-9_.-]", "-", "_".join([*parts, code]))
