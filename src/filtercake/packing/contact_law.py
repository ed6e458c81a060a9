"""Closed forms of the Hertz contact with SJKR cohesion or with adhesion: what the law says before any packing is run.

Every function is in SI units. ``cohesion`` is the cohesion energy density s in J/m3, ``density`` the crystal's.
Sources: paper eqs. 6-9; SJKR closed forms derived from eq. 6 with area ``A -> 2 pi R* d`` at small overlap.
"""

from __future__ import annotations

import math


def effective_modulus(youngs_modulus: float, poisson_ratio: float) -> float:
    """Effective Young's modulus E* of two equal materials in contact, Pa: ``E / (2 (1 - nu^2))``."""
    return youngs_modulus / (2.0 * (1.0 - poisson_ratio**2))


def shear_modulus(youngs_modulus: float, poisson_ratio: float) -> float:
    """Shear modulus G, Pa (paper eq. 9): ``E / (2 (1 + nu))``."""
    return youngs_modulus / (2.0 * (1.0 + poisson_ratio))


def effective_radius(radius_i: float, radius_j: float) -> float:
    """Effective radius R* of two spheres, m; with ``math.inf`` for a flat wall."""
    if math.isinf(radius_j):
        return radius_i
    return radius_i * radius_j / (radius_i + radius_j)


def rayleigh_time_step(radius: float, density: float, youngs_modulus: float, poisson_ratio: float) -> float:
    """Rayleigh time step of a sphere, s (paper eqs. 7-9).

    Parameters
    ----------
    radius : float
        Radius of the smallest sphere, m.
    density : float
        Crystal density, kg/m3.
    youngs_modulus : float
        Young's modulus, Pa.
    poisson_ratio : float
        Poisson's ratio.
    """
    modulus = shear_modulus(youngs_modulus, poisson_ratio)
    return math.pi * radius * math.sqrt(density / modulus) / (0.1631 * poisson_ratio + 0.8766)


def damping_ratio(restitution: float) -> float:
    """Positive damping coefficient ``-ln e / sqrt(ln^2 e + pi^2)`` of the Hertz model; 0 at e = 1."""
    log_e = math.log(restitution)
    return -log_e / math.sqrt(log_e**2 + math.pi**2)


def equilibrium_overlap(
    cohesion: float, youngs_modulus: float, poisson_ratio: float, radius_i: float, radius_j: float
) -> float:
    """Overlap at which Hertz repulsion balances SJKR cohesion, m: ``(3 pi s / (2 E*))^2 R*``."""
    modulus = effective_modulus(youngs_modulus, poisson_ratio)
    return (1.5 * math.pi * cohesion / modulus) ** 2 * effective_radius(radius_i, radius_j)


def relative_overlap(cohesion: float, youngs_modulus: float, poisson_ratio: float) -> float:
    """Equilibrium overlap of two equal spheres over their diameter, a pure number independent of size."""
    return equilibrium_overlap(cohesion, youngs_modulus, poisson_ratio, 0.5, 0.5)


def pull_off_force(
    cohesion: float, youngs_modulus: float, poisson_ratio: float, radius_i: float, radius_j: float
) -> float:
    """Largest attractive force of a contact, N: ``(2 pi^3 / 3) s^3 R*^2 / E*^2``."""
    modulus = effective_modulus(youngs_modulus, poisson_ratio)
    radius = effective_radius(radius_i, radius_j)
    return 2.0 * math.pi**3 / 3.0 * cohesion**3 * radius**2 / modulus**2


def cohesive_strength(cohesion: float, youngs_modulus: float, poisson_ratio: float) -> float:
    """Stress that SJKR cohesion holds, Pa: pull-off of equal spheres over their diameter squared, whatever the size.

    ``(pi^3 / 24) s^3 / E*^2``.
    """
    return math.pi**3 / 24.0 * cohesion**3 / effective_modulus(youngs_modulus, poisson_ratio) ** 2


def cohesion_of_strength(strength: float, youngs_modulus: float, poisson_ratio: float) -> float:
    """Cohesion energy density that holds a stress (Pa), J/m3: the inverse of :func:`cohesive_strength`."""
    modulus = effective_modulus(youngs_modulus, poisson_ratio)
    return math.cbrt(24.0 / math.pi**3 * strength * modulus**2)


def adhesive_force(adhesion: float, radius_i: float, radius_j: float) -> float:
    """Constant attraction of two spheres that touch, and their pull-off force, N: ``1.5 pi W R*``.

    The force of a contact is Hertz's less this, from the first touch to the last, and nothing across a gap: DMT's form
    (Derjaguin, Muller & Toporov 1975) with the pull-off of JKR (Johnson, Kendall & Roberts 1971); DMT's own is
    ``2 pi W R*``. Kept of JKR is the pull-off, hence how it depends on the sizes. Left out are the neck, which holds
    spheres that draw apart across a gap, with it the hysteresis (making and breaking a contact costs no energy but the
    damping's), and that adhesion changes the stiffness. All this happens within overlaps and gaps of the order of
    :func:`adhesive_overlap`; where they vanish against the spheres, in the rigid limit, so does the difference at rest.
    As with SJKR, the Coulomb limit is mu times the repulsive part alone: without load mu times this force, where SJKR
    has mu times 27/4 of its pull-off.

    Parameters
    ----------
    adhesion : float
        Work of adhesion W, J/m2.
    radius_i, radius_j : float
        Radii, m.
    """
    return 1.5 * math.pi * adhesion * effective_radius(radius_i, radius_j)


def adhesive_overlap(
    adhesion: float, youngs_modulus: float, poisson_ratio: float, radius_i: float, radius_j: float
) -> float:
    """Overlap at which Hertz repulsion balances adhesion, m: ``(3 F / (4 E* sqrt(R*)))^(2/3)`` with its force F."""
    modulus = effective_modulus(youngs_modulus, poisson_ratio)
    root = math.sqrt(effective_radius(radius_i, radius_j))
    return math.cbrt(0.75 * adhesive_force(adhesion, radius_i, radius_j) / (modulus * root)) ** 2


def adhesive_strength(adhesion: float, diameter: float) -> float:
    """Stress that a surface's work of adhesion W holds, Pa: ``(3 pi / 8) W / d``.

    The pull-off force of two equal spheres (JKR) is ``1.5 pi W R*`` with R* = d/4; over d squared.

    Parameters
    ----------
    adhesion : float
        Work of adhesion W, J/m2.
    diameter : float
        Diameter of the spheres, m.
    """
    return 3.0 * math.pi / 8.0 * adhesion / diameter


def adhesion_of_strength(strength: float, diameter: float) -> float:
    """Work of adhesion that holds a stress (Pa) between spheres of a diameter (m), J/m2.

    The inverse of :func:`adhesive_strength`.
    """
    return 8.0 / (3.0 * math.pi) * strength * diameter


def effective_shear_modulus(youngs_modulus: float, poisson_ratio: float) -> float:
    """Effective shear modulus G* of two equal materials in contact, Pa: ``G / (2 (2 - nu))``."""
    return shear_modulus(youngs_modulus, poisson_ratio) / (2.0 * (2.0 - poisson_ratio))


def shear_stiffness_ratio(youngs_modulus: float, poisson_ratio: float) -> float:
    """Tangential over normal stiffness constant of Mindlin's contact: 8 G* over 4/3 E*."""
    return (
        6.0 * effective_shear_modulus(youngs_modulus, poisson_ratio) / effective_modulus(youngs_modulus, poisson_ratio)
    )


def shear_damping_ratio(youngs_modulus: float, poisson_ratio: float) -> float:
    """Tangential over normal damping constant: the root of 8 G* over 2 E*."""
    modulus = effective_modulus(youngs_modulus, poisson_ratio)
    return math.sqrt(4.0 * effective_shear_modulus(youngs_modulus, poisson_ratio) / modulus)


def cohesion_at_overlap(relative: float, youngs_modulus: float, poisson_ratio: float) -> float:
    """Cohesion energy density at which equal spheres overlap by ``relative`` of their diameter, J/m3."""
    modulus = effective_modulus(youngs_modulus, poisson_ratio)
    return math.sqrt(relative / 0.25) * modulus / (1.5 * math.pi)


def soft_contact_compaction(porosity: float, cohesion: float, youngs_modulus: float, poisson_ratio: float) -> float:
    """Estimated loss of porosity because contacts overlap: ``3 (1 - eps) d_eq / diameter`` (positive)."""
    return 3.0 * (1.0 - porosity) * relative_overlap(cohesion, youngs_modulus, poisson_ratio)
