"""The scene of every point, built once from the configuration: here its keys and units become SI."""

from __future__ import annotations

from collections.abc import Mapping

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing.cloud import BedSize, bed_for
from filtercake.packing.engines import kind_of
from filtercake.packing.scene import Scene
from filtercake.study import limits
from filtercake.study.config.packing import Packing
from filtercake.study.config.study import Study
from filtercake.units import KILOJOULE_PER_M3, MEGAPASCAL, MICROMETRE, MICROSECOND, MINUTE


def bed_of(settings: Packing, csd: CrystalSizeDistribution) -> BedSize:
    """Size of the beds of a (truncated) distribution: what the study says, or what the distribution needs."""
    if settings.particles is not None:
        return BedSize(settings.particles, settings.bed_depth_factor or 1.0)
    chosen = bed_for(csd, settings.initial_void_fraction)
    one_shape = kind_of(settings.engine).own_spheres
    return BedSize(chosen.particles, settings.bed_depth_factor or (1.0 if one_shape else chosen.bed_depth_factor))


def scene_of(study: Study, csd: CrystalSizeDistribution, swept: Mapping[str, float]) -> Scene:
    """Build the scene of one point, with the engine as the study names it.

    Parameters
    ----------
    study : Study
        Its material is the base, its packing the protocol.
    csd : CrystalSizeDistribution
        The (truncated) distribution.
    swept : mapping of str to float
        Values of ``SWEPT``, in the units their names say.
    """
    settings = study.packing
    bed = bed_of(settings, csd)
    scene = Scene(
        csd=csd,
        particles=bed.particles,
        initial_void_fraction=settings.initial_void_fraction,
        bed_depth_factor=bed.bed_depth_factor,
        settling_velocity=settings.settling_velocity_m_s,
        density=study.material.density,
        youngs_modulus=swept["youngs_modulus_MPa"] * MEGAPASCAL,
        poisson_ratio=swept["poisson_ratio"],
        restitution=swept["restitution"],
        friction=swept["friction"],
        cohesion=swept["cohesion_kJ_m3"] * KILOJOULE_PER_M3,
        time_step=(settings.time_step_us or 0.0) * MICROSECOND,
        engine=settings.engine,
        seed=settings.seed,
        porosity_tolerance=settings.porosity_tolerance,
        max_fall_times=settings.max_fall_times,
        skin=(settings.skin_um or 0.0) * MICROMETRE,
        processes=settings.processes,
        time_limit=settings.time_limit_min * MINUTE,
        write_vtk=settings.write_vtk,
    )
    if settings.time_step_us is not None:
        return scene
    return scene.with_time_step(settings.time_step_rayleigh or limits.default_time_step(scene.friction))
