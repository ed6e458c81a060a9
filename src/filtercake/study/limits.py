"""The fence around safe ground: scenes that are proven unstable are refused, those that are inaccurate warned about.

Every limit comes from the stability benchmark (``make stability``, docs/stability.md); the configuration is checked
against it before any job starts. SI units.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing import contact_law
from filtercake.packing.engines import kind_of
from filtercake.packing.representation import Representation, particles_for, represent
from filtercake.packing.scene import Scene
from filtercake.packing.similarity import LARGEST_LOAD, LARGEST_STRENGTH, LEAST_LOAD
from filtercake.packing.slab import LEAST_BED_DIAMETERS
from filtercake.units import GIGAPASCAL, KILOJOULE_PER_M3, KILOPASCAL, MEGAPASCAL, MICROMETRE, MICROSECOND

PAGE: Final = "docs/stability.md"

MOST_PARTICLES: Final = 2_000_000
"""Spheres of a packing."""

FRICTIONLESS_TIME_STEP: Final = 0.5
"""Default time step over the Rayleigh step at mu = 0."""
FRICTIONAL_TIME_STEP: Final = 0.2
"""The same at mu > 0: rotation on several tangential springs is the fastest motion, and limits the step."""
LARGEST_DENSITY: Final = 25_000.0
"""Crystal density, kg/m3, over that of any solid: heavier spheres strike soft contacts too hard."""
SMALLEST_TIME_STEP: Final = 0.001
"""Time step over the Rayleigh step below which a bed takes hundreds of times as long for nothing: refused."""
LARGEST_TIME_STEP: Final = 1.0
"""Time step over the Rayleigh step from which beds explode: refused."""
SMALL_RESTITUTION, DAMPED_TIME_STEP = 0.1, 0.5
"""Restitution under which contacts are damped so hard that a longer step gives wrong porosities: refused."""
LARGE_RESTITUTION: Final = 0.95
"""Restitution above which beds hardly come to rest: warned."""
FRICTIONAL_LIMIT: Final = 0.36
"""Time step over the Rayleigh step above which frictional beds never come to rest: refused."""
SOFT_TIME_STEP: Final = 0.5
"""The same for contacts that overlap by more than is beyond doubt."""
LARGEST_RELATIVE_OVERLAP: Final = 0.035
"""Contacts overlap by more than this share of the diameter: refused (SJKR turns the bed over, porosity falls)."""
DOUBTFUL_RELATIVE_OVERLAP: Final = 0.01
"""Contacts overlap by more than this share of the diameter: warned."""
LOOSEST: Final = 0.5
"""Porosity that settled beds stay under: one that is too shallow even at this is refused before it is made."""
SHIFT_SPREADS: Final = 2.0
"""Change of the porosity by size classes that hold no whole sphere, over one packing's spread: refused above."""
IDLE_LOAD_SHARE: Final = 0.1
"""Cohesive strength over the bed's own load under which cohesion changes nothing that can be seen: warned."""
LIGHTEST_SOLID: Final = 300.0
"""Density, kg/m3, under that of any solid that is filtered: another unit is meant."""
NARROWEST_CELL: Final = 2.1
"""Side of a pressed cell in largest diameters under which spheres are neighbours of themselves: refused."""
LEAST_PRESSED_RESTITUTION: Final = 0.2
"""Restitution under which pressed cells with friction are kept moving by their time step: refused."""
SMALLEST_POROSITY, LARGEST_POROSITY = 0.15, 0.85
"""Porosities beyond which a measured resistance is in another unit than it says, or something of it is."""
FINEST, COARSEST = 0.5e-6, 20e-3
"""Largest diameter of a distribution that no filter holds, and one that no filter is for, m: another unit is meant."""
WIDEST_SPAN: Final = 1e4
"""Largest diameter over the smallest, beyond which sizes of one distribution are in several units."""
LIKELY_SIZES: Final = (1e-6, 2e-3)
"""Largest diameter of most distributions that are filtered, m: what a likelier unit makes of it."""


@dataclass(frozen=True)
class Finding:
    """One thing about a scene.

    Attributes
    ----------
    key : {"cohesion", "adhesion", "pressure", "time_step", "density", "restitution", "sizes", "particles"}
        Which number it is about.
    text : str
        What is wrong, with the number that is allowed and the page that shows why.
    """

    key: str
    text: str


def default_time_step(friction: float) -> float:
    """Time step over the Rayleigh step that the benchmark found fastest among the accurate ones."""
    return FRICTIONAL_TIME_STEP if friction > 0.0 else FRICTIONLESS_TIME_STEP


def refusals(scene: Scene) -> Iterator[Finding]:
    """Say what is proven unstable about a scene."""
    if scene.is_pressed:
        yield from _pressed_refusals(scene)
        return
    rayleigh = scene.rayleigh_time_step
    if scene.relative_overlap > LARGEST_RELATIVE_OVERLAP:
        limit = contact_law.cohesion_at_overlap(LARGEST_RELATIVE_OVERLAP, scene.youngs_modulus, scene.poisson_ratio)
        yield Finding(
            "cohesion",
            f"must be at most {math.floor(limit / KILOJOULE_PER_M3)} kJ/m3 at "
            f"E = {scene.youngs_modulus / MEGAPASCAL:g} MPa, nu = {scene.poisson_ratio:g}: above it, contacts overlap "
            f"by more than {LARGEST_RELATIVE_OVERLAP:.1%} of the diameter ({PAGE}); use a larger youngs_modulus_MPa",
        )
    if scene.density > LARGEST_DENSITY:
        yield Finding("density", f"must be at most {LARGEST_DENSITY:g} kg/m3 ({PAGE})")
    if scene.time_step >= LARGEST_TIME_STEP * rayleigh:
        yield Finding(
            "time_step",
            f"must be below the Rayleigh time step {rayleigh / MICROSECOND:.4g} us ({PAGE}); leave it out for "
            f"{FRICTIONLESS_TIME_STEP:g} of that (without friction) or {FRICTIONAL_TIME_STEP:g} (with)",
        )
    elif scene.time_step < SMALLEST_TIME_STEP * (1.0 - 1e-9) * rayleigh:
        yield Finding(
            "time_step",
            f"must be at least {SMALLEST_TIME_STEP:g} of the Rayleigh time step {rayleigh / MICROSECOND:.4g} us: "
            "shorter ones change nothing but the run time",
        )
    else:
        yield from _long_steps(scene)
    engine = kind_of(scene.engine)
    if scene.restitution <= engine.least_restitution:
        text = f"{engine.label} takes only more than {engine.least_restitution:g}; use engine: auto ({PAGE})"
        yield Finding("restitution", text)


def small_beds(scene: Scene) -> Iterator[Finding]:
    """Say whether a bed is too small for its distribution: too shallow to measure, or short of whole classes."""
    if scene.is_pressed:
        yield from _narrow_cells(scene)
    else:
        yield from _shallow_beds(scene)
    if kind_of(scene.engine).own_spheres:
        return
    found, largest = representation(scene), SHIFT_SPREADS * scene.expected_spread
    if abs(found.porosity_shift) > largest:
        enough = particles_for(scene.csd, largest, MOST_PARTICLES)
        cure = (
            f"use at least {enough:,} particles" if enough else "leave out sizes (truncate_...), or use more particles"
        )
        yield Finding(
            "particles",
            f"{found.words}; the porosity would be off by about {found.porosity_shift:+.3f}, more than its interval "
            f"could tell: {cure}",
        )


def _narrow_cells(scene: Scene) -> Iterator[Finding]:
    """Say whether a pressed cell, at its densest, is too narrow for its largest sphere."""
    solids = scene.particles * scene.csd.mean_particle_volume
    side = (solids / (1.0 - SMALLEST_POROSITY)) ** (1.0 / 3.0)
    needed = NARROWEST_CELL * scene.csd.largest
    if side < needed:
        yield Finding(
            "particles",
            f"a cell of {side / MICROMETRE:.4g} um, less than the {needed / MICROMETRE:.4g} um of {NARROWEST_CELL:g} "
            f"of its largest spheres; use at least {math.ceil(scene.particles * (needed / side) ** 3):,} particles",
        )


def _shallow_beds(scene: Scene) -> Iterator[Finding]:
    """Say whether a settled bed is too shallow to be measured."""
    needed = LEAST_BED_DIAMETERS * scene.csd.largest
    deepest = scene.particles * scene.csd.mean_particle_volume / scene.box_length**2 / (1.0 - LOOSEST)
    if deepest < needed:
        yield Finding(
            "particles",
            f"a bed at most {deepest / MICROMETRE:.4g} um deep, less than the {needed / MICROMETRE:.4g} um of "
            f"{LEAST_BED_DIAMETERS:g} of its largest spheres; use more particles, or a larger bed_depth_factor",
        )


def merged_classes(scene: Scene) -> Iterator[Finding]:
    """Say which size classes the cloud merges because they are too rare."""
    found = representation(scene)
    if found.merged and not kind_of(scene.engine).own_spheres:
        text = "they are merged with their neighbours, and the porosity moves by about"
        yield Finding("particles", f"{found.words}; {text} {found.porosity_shift:+.4f}")


def representation(scene: Scene) -> Representation:
    """Say what the spheres of a scene hold of its distribution."""
    return _represented(scene.csd.size.tobytes(), scene.csd.volume_fraction.tobytes(), scene.particles)


@lru_cache
def _represented(size: bytes, volume_fraction: bytes, particles: int) -> Representation:
    csd = CrystalSizeDistribution(np.frombuffer(size), np.frombuffer(volume_fraction))
    return represent(csd, particles)


def unit_problems(csd: CrystalSizeDistribution, density: float) -> Iterator[Finding]:
    """Say which numbers of the crystals must be in another unit than their keys say, and in which.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        A distribution of the crystals.
    density : float
        Their density, kg/m3.
    """
    if density < LIGHTEST_SOLID:
        likely = (
            f": in g/cm3? ({1000.0 * density:g} kg/m3)" if LIGHTEST_SOLID <= 1000.0 * density <= LARGEST_DENSITY else ""
        )
        yield Finding("density", f"lighter than any solid (under {LIGHTEST_SOLID:g} kg/m3){likely}")
    shown = f"{csd.smallest / MICROMETRE:.4g} to {csd.largest / MICROMETRE:.4g} um"
    if csd.largest > WIDEST_SPAN * csd.smallest:
        yield Finding("sizes", f"{shown}: the largest crystal is over {WIDEST_SPAN:g} times the smallest; in one unit?")
    elif not FINEST <= csd.largest <= COARSEST:
        units = {"mm": 1e3, "m": 1e6, "nm": 1e-3, "cm": 1e4}
        fits = [u for u, factor in units.items() if LIKELY_SIZES[0] <= factor * csd.largest <= LIKELY_SIZES[1]]
        likely = f": were they in {' or '.join(fits)}?" if fits else ""
        why = "no filter holds crystals so fine" if csd.largest < FINEST else "no filter is for crystals so coarse"
        yield Finding("sizes", f"{shown}: {why}{likely}")


def _pressed_refusals(scene: Scene) -> Iterator[Finding]:
    """Say what a pressed cake is not known for: contacts that are not rigid, loads that decide nothing."""
    modulus = contact_law.effective_modulus(scene.crystal_modulus, scene.poisson_ratio)
    sticks = "adhesion" if scene.attraction == "adhesion" else "cohesion"
    given = f"E = {scene.crystal_modulus / GIGAPASCAL:g} GPa (material.youngs_modulus_GPa)"
    if scene.pressure > LARGEST_LOAD * modulus:
        yield Finding(
            "pressure",
            f"must be at most {LARGEST_LOAD * modulus / KILOPASCAL:.3g} kPa at {given}: above {LARGEST_LOAD:g} of E*, "
            "crystals are pressed out of shape",
        )
    if scene.load_over_strength < LEAST_LOAD:
        yield Finding(
            sticks,
            f"holds {scene.strength / KILOPASCAL:.3g} kPa, more than the pressure of {scene.pressure / KILOPASCAL:.3g} "
            "kPa: the cake is what the way it formed has made of it; use more pressure or less attraction",
        )
    if scene.strength > LARGEST_STRENGTH * modulus:
        yield Finding(
            sticks,
            f"holds {scene.strength / KILOPASCAL:.3g} kPa; must hold at most "
            f"{LARGEST_STRENGTH * modulus / KILOPASCAL:.3g} kPa at {given}: above {LARGEST_STRENGTH:g} of E*, contacts "
            "are pulled out of shape",
        )
    if scene.time_step > (SOFT_TIME_STEP + 1e-9) * scene.rayleigh_time_step:
        yield Finding("time_step", f"must be at most {SOFT_TIME_STEP:g} of the Rayleigh time step in a pressed cell")
    elif scene.friction > 0.0:
        yield from _long_steps(scene)
    if scene.density > LARGEST_DENSITY:
        yield Finding("density", f"must be at most {LARGEST_DENSITY:g} kg/m3 ({PAGE})")
    if scene.friction > 0.0 and scene.restitution < LEAST_PRESSED_RESTITUTION:
        yield Finding(
            "restitution",
            f"must be at least {LEAST_PRESSED_RESTITUTION:g} in a pressed cell with friction: one damped harder shakes "
            "itself and never comes to rest",
        )


def _long_steps(scene: Scene) -> Iterator[Finding]:
    """Say which time steps under the Rayleigh step are still too long for a scene."""
    rayleigh, overlap = scene.rayleigh_time_step, scene.relative_overlap
    limits = (
        (
            scene.restitution < SMALL_RESTITUTION,
            DAMPED_TIME_STEP,
            f"at a restitution under {SMALL_RESTITUTION:g}: above it, porosities look right but are off by 0.01",
        ),
        (
            overlap > DOUBTFUL_RELATIVE_OVERLAP,
            SOFT_TIME_STEP,
            f"where contacts overlap by {overlap:.1%} of the diameter: above it, beds do not come to rest",
        ),
        (scene.friction > 0.0, FRICTIONAL_LIMIT, "with friction: above it, beds do not come to rest"),
    )
    for holds, limit, why in limits:
        if holds and scene.time_step > (limit + 1e-9) * rayleigh:
            yield Finding(
                "time_step",
                f"must be at most {limit:g} of the Rayleigh time step {rayleigh / MICROSECOND:.4g} us {why} ({PAGE})",
            )


def doubts(scene: Scene) -> Iterator[Finding]:
    """Say what is allowed about a scene, but makes its porosity depend on a choice of numbers."""
    if scene.is_pressed:
        return
    overlap = scene.relative_overlap
    if DOUBTFUL_RELATIVE_OVERLAP < overlap <= LARGEST_RELATIVE_OVERLAP:
        yield Finding(
            "cohesion",
            f"contacts overlap by {overlap:.1%} of the diameter, which alone lowers the porosity by about "
            f"{3 * 0.65 * overlap:.3f} ({PAGE})",
        )
    if scene.restitution > LARGE_RESTITUTION:
        yield Finding(
            "restitution", f"over {LARGE_RESTITUTION:g} beds hardly come to rest; raise packing.max_fall_times ({PAGE})"
        )
    if scene.cohesion > 0.0 and (scene.pull_off_over_weight < 1.0 or scene.strength_over_load < IDLE_LOAD_SHARE):
        yield Finding(
            "cohesion",
            f"does nothing at E = {scene.youngs_modulus / MEGAPASCAL:g} MPa: its pull-off is "
            f"{scene.pull_off_over_weight:.2g} times the weight of the smallest crystal, its strength "
            f"{scene.strength_over_load:.2g} times the load of the bed",
        )


def verdict(scene: Scene) -> str:
    """Return what the configuration says to a scene: ``refused``, ``warned`` or ``allowed``."""
    if any(True for _ in refusals(scene)):
        return "refused"
    return "warned" if any(True for _ in doubts(scene)) else "allowed"
