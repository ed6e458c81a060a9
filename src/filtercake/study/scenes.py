"""The scene of every point, built once from the configuration: here its keys and units become SI."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing.cloud import BedSize, bed_for, cell_for
from filtercake.packing.engines import kind_of
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL, Scene
from filtercake.study import limits
from filtercake.study.config.packing import Packing
from filtercake.study.config.study import Study
from filtercake.units import (
    GIGAPASCAL,
    KILOJOULE_PER_M3,
    KILOPASCAL,
    MEGAPASCAL,
    MICROMETRE,
    MICROSECOND,
    MILLIJOULE_PER_M2,
    MINUTE,
)


def bed_of(settings: Packing, csd: CrystalSizeDistribution, protocol: str = GRAVITY_PROTOCOL) -> BedSize:
    """Size of the beds of a (truncated) distribution: what the study says, or what the distribution needs."""
    if protocol == FILTRATION_PROTOCOL:
        return BedSize(settings.particles or cell_for(csd), 1.0)
    if settings.particles is not None:
        return BedSize(settings.particles, settings.bed_depth_factor or 1.0)
    chosen = bed_for(csd, settings.initial_void_fraction)
    one_shape = kind_of(settings.engine).own_spheres
    return BedSize(chosen.particles, settings.bed_depth_factor or (1.0 if one_shape else chosen.bed_depth_factor))


def scene_of(
    study: Study,
    csd: CrystalSizeDistribution,
    swept: Mapping[str, float | None],
    protocol: str = GRAVITY_PROTOCOL,
    engine: str | None = None,
) -> Scene:
    """Build the scene of one point, with the engine as the study names it.

    Parameters
    ----------
    study : Study
        Its material is the base, its packing the protocol.
    csd : CrystalSizeDistribution
        The (truncated) distribution.
    swept : mapping of str to float
        Values of ``SWEPT``, in the units their names say; None where there is none.
    protocol : {"gravity", "filtration"}
        How the packing is made.
    engine : str, optional
        Engine of beds; the study's if left out.
    """
    pressed = protocol == FILTRATION_PROTOCOL
    settings = study.packing if engine is None else study.packing.model_copy(update={"engine": engine})
    bed = bed_of(settings, csd, protocol)
    value = {name: number or 0.0 for name, number in swept.items()}
    sticks_by_adhesion = pressed and swept["adhesion_mJ_m2"] is not None
    scene = Scene(
        csd=csd,
        particles=bed.particles,
        initial_void_fraction=settings.initial_void_fraction,
        bed_depth_factor=bed.bed_depth_factor,
        settling_velocity=settings.settling_velocity_m_s,
        density=study.material.density,
        youngs_modulus=value["youngs_modulus_MPa"] * MEGAPASCAL,
        poisson_ratio=value["poisson_ratio"],
        restitution=value["restitution"],
        friction=value["friction"],
        cohesion=0.0 if sticks_by_adhesion else value["cohesion_kJ_m3"] * KILOJOULE_PER_M3,
        time_step=(settings.time_step_us or 0.0) * MICROSECOND,
        engine=Embedded.name if pressed else settings.engine,
        seed=settings.seed,
        porosity_tolerance=settings.porosity_tolerance,
        max_fall_times=settings.max_fall_times,
        skin=(settings.skin_um or 0.0) * MICROMETRE,
        processes=settings.processes,
        time_limit=settings.time_limit_min * MINUTE,
        write_vtk=settings.write_vtk,
        **(_pressed(study, value) if pressed else {}),
    )
    if settings.time_step_us is not None:
        return scene
    return scene.with_time_step(settings.time_step_rayleigh or limits.default_time_step(scene.friction))


def _pressed(study: Study, value: Mapping[str, float]) -> dict[str, Any]:
    """Collect what a scene of a pressed cake has more."""
    return {
        "protocol": FILTRATION_PROTOCOL,
        "pressure": value["pressure_kPa"] * KILOPASCAL,
        "adhesion": value["adhesion_mJ_m2"] * MILLIJOULE_PER_M2,
        "crystal_modulus": study.material.youngs_modulus_GPa * GIGAPASCAL,
    }
