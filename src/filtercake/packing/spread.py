"""How much one packing's porosity is known to scatter before any is made, from the committed ensembles.

A spread estimated from three to five packings is so uncertain that Student's interval is two to four times as wide as
that of a known one. But packings of a kind scatter alike: with the number of spheres, how evenly they share the volume,
how much of the bed is its interior, friction and protocol, :func:`known_spread` says how much, and as how many degrees
of freedom that counts. :mod:`filtercake.validation.packing_spread` fits it.
"""

from __future__ import annotations

from typing import Final

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing.cloud import PLACEMENT_HEIGHT, SETTLED_POROSITY
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL, Scene
from filtercake.packing.slab import MARGIN_DIAMETERS
from filtercake.statistics import Spread

REFERENCE_SPHERES: Final = 2000
SD: Final = {
    (GRAVITY_PROTOCOL, False): 0.00124,
    (GRAVITY_PROTOCOL, True): 0.00180,
    (FILTRATION_PROTOCOL, False): 0.00094,
    (FILTRATION_PROTOCOL, True): 0.00182,
}
"""Standard deviation of a packing of ``REFERENCE_SPHERES`` equal spheres, all interior, by protocol and friction."""
COUNT_POWER: Final = 0.46
EVENNESS_POWER: Final = 0.12
INTERIOR_POWER: Final = 0.86
"""It falls with these powers of the number of spheres, of the effective number, and of the interior's share.

Fitted to 189 ensembles; remade ones keep them while they fit no better than by chance.
"""
FREEDOM: Final = {GRAVITY_PROTOCOL: 30.0, FILTRATION_PROTOCOL: 10.0}
"""Degrees of freedom that it counts as: scenes scatter about it by 13 and 22 %. The fit finds more (over 100), but many
of its ensembles are of one mixture, and second cells of other distributions differ from the first 1.5 times as much."""
FRICTION_COUNTS: Final = 0.01
"""Coefficient of friction from which packings scatter as those with friction do."""
LEAST_INTERIOR: Final = 0.1


def effective_spheres(csd: CrystalSizeDistribution, particles: int) -> float:
    """Count the equal spheres that share the solids as unevenly: ``(sum V)^2 / sum V^2``, for volumes V.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The (truncated) distribution.
    particles : int
        Number of spheres.
    """
    volume = csd.size**3
    return float(particles * (csd.number_fraction @ volume) / (csd.volume_fraction @ volume))


def interior_share(scene: Scene) -> float:
    """Share of the bed's height that is its interior, roughly; 1 for a pressed cake."""
    if scene.is_pressed:
        return 1.0
    solids = (1.0 - scene.initial_void_fraction) * PLACEMENT_HEIGHT * scene.bed_depth_factor * scene.box_length
    height = solids / (1.0 - SETTLED_POROSITY)
    return max(LEAST_INTERIOR, 1.0 - 2.0 * MARGIN_DIAMETERS * scene.csd.largest / height)


def known_spread(scene: Scene) -> Spread:
    """Return the standard deviation of one packing's interior porosity, and the degrees of freedom it counts as."""
    evenness = effective_spheres(scene.csd, scene.particles) / REFERENCE_SPHERES
    sd = (
        SD[scene.protocol, scene.friction > FRICTION_COUNTS]
        * (scene.particles / REFERENCE_SPHERES) ** -COUNT_POWER
        * evenness**-EVENNESS_POWER
        * interior_share(scene) ** -INTERIOR_POWER
    )
    return Spread(float(sd), FREEDOM[scene.protocol])
