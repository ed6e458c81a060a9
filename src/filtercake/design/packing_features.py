"""Numbers without dimension that decide how crystals pack: of the shape of their sizes, of friction, load and fall."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing import contact_law
from filtercake.packing.analytic_models import farr_groot, yu_zou_standish
from filtercake.packing.scene import Scene
from filtercake.units import GRAVITY, FloatArray

RODS: Final = 3000
"""Of the close-packed porosity; within 5e-4 of 10 000 rods for what is trained on."""
LOOSE: Final = 0.44
"""Porosity of equal spheres with much friction, for the linear packing model."""
HALF_FRICTION: Final = 0.18
"""Friction that loosens equal spheres half as much as any does: 0.362 without, 0.4448 at 1 (docs/pressure.md)."""

SLIGHT: Final = 0.03
"""Friction that keeps a sticky bed half as loose as any does: 0.353 without, 0.462 at 0.05, 0.466 at 0.3 (PMMA)."""

SHAPE_FEATURES: Final = ("close_packing", "linear_packing", "spread", "skew", "surface_spread")
"""Names of what :func:`shape_features` returns."""


def shape_features(csd: CrystalSizeDistribution) -> FloatArray:
    """Describe the shape of a distribution, shape (5,); neither the unit of the sizes nor the order of classes counts.

    The close-packed porosity (Farr and Groot); what the linear packing model takes away from loose equal spheres;
    standard deviation and cube root of the third moment of ln d by volume; standard deviation of ln d by surface.
    """
    size = np.log(csd.size)
    spread, skew = _moments(size, csd.volume_fraction)
    surface = csd.volume_fraction / csd.size
    surface_spread, _ = _moments(size, surface / surface.sum())
    loose = round(yu_zou_standish(csd, LOOSE) - LOOSE, 12) + 0.0  # not -0 of one size
    return np.array([farr_groot(csd, RODS), loose, spread, skew, surface_spread])


def _moments(values: FloatArray, weights: FloatArray) -> tuple[float, float]:
    """Return the standard deviation and the cube root of the third central moment."""
    centred = values - float(weights @ values)
    return math.sqrt(float(weights @ centred**2)), float(np.cbrt(weights @ centred**3))


def friction_feature(friction: float, half: float = HALF_FRICTION) -> float:
    """Share of the loosening by friction that a coefficient has reached, 0 to 1; a half at ``half``."""
    return friction / (friction + half)


def counting_spheres(csd: CrystalSizeDistribution, particles: int) -> float:
    """Count the equal spheres that scatter as much as so many of a distribution: ``(sum d^3)^2 / sum d^6``.

    A few coarse spheres hold most of the volume, and the fine ones among them add little.
    """
    volume = (csd.size / csd.largest) ** 3
    number = csd.number_fraction
    return particles * float(number @ volume) ** 2 / float(number @ volume**2)


FALL_FEATURES: Final = ("stickiness", "impact", "depth")
"""Names of what :func:`fall_features` returns."""


def fall_features(scene: Scene) -> FloatArray:
    """Describe how a bed settles, shape (3,): strength over impact, impact over stiffness, depth over the mean size.

    The contacts hold ``p_c`` (:func:`filtercake.packing.contact_law.cohesive_strength`), an impact from half the height
    of the cloud brings ``rho v^2``; the bed's own weight is in about the same ratio to it in all beds. The first is
    ``t/(1 + t)`` with t their ratio to the power 2/3, which goes as the square of the cohesion; the second and the
    third are logarithms.
    """
    strength = contact_law.cohesive_strength(scene.cohesion, scene.youngs_modulus, scene.poisson_ratio)
    speed = scene.settling_velocity**2 + GRAVITY * scene.cloud_height
    impact = scene.density * speed
    modulus = contact_law.effective_modulus(scene.youngs_modulus, scene.poisson_ratio)
    ratio = (strength / impact) ** (2.0 / 3.0)
    solids = scene.particles * scene.csd.mean_particle_volume / scene.box_length**2
    return np.array([ratio / (1.0 + ratio), math.log(impact / modulus), math.log(solids / scene.csd.sauter_mean)])
