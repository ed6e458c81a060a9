"""The fence around safe ground: scenes that are proven unstable are refused, those that are inaccurate warned about.

Every limit comes from the stability benchmark (``make stability``, docs/stability.md); the configuration is checked
against it before any job starts. SI units.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from filtercake.packing import contact_law
from filtercake.packing.engines import kind_of
from filtercake.packing.scene import Scene
from filtercake.units import KILOJOULE_PER_M3, MEGAPASCAL, MICROSECOND

PAGE: Final = "docs/stability.md"

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


@dataclass(frozen=True)
class Finding:
    """One thing about a scene.

    Attributes
    ----------
    key : {"cohesion", "time_step", "density", "restitution"}
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


def verdict(scene: Scene) -> str:
    """Return what the configuration says to a scene: ``refused``, ``warned`` or ``allowed``."""
    if any(True for _ in refusals(scene)):
        return "refused"
    return "warned" if any(True for _ in doubts(scene)) else "allowed"
