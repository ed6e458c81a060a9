"""What a seeded batch crystallization makes of its seeds, where no others are born.

All seeds grow by the same length, whatever their size. Their number stays, so that the moments of their sizes give the
crystals' mass over the seeds', ``M / M_seed = (m3 + 3 dL m2 + 3 dL^2 m1 + dL^3 m0) / m3``. It rises with dL from 1: one
growth dL for each mass, without kinetics. The shape stays, too. Where supersaturation makes new crystals, the product
is finer than this, which good seeding approaches. The relative width falls; the Sauter mean may fall at first where
seeds are of very different sizes, since small ones take on more for their mass. Source: J. W. Mullin, Crystallization,
4th ed., Butterworth-Heinemann 2001, chapter on programmed cooling of seeded batches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import CrystallizerError

LARGEST_MASS_RATIO: Final = 1e9
"""Mass of the crystals over that of the seeds that is surely a mistake."""


@dataclass(frozen=True)
class Grown:
    """Seeds after a batch.

    Attributes
    ----------
    csd : CrystalSizeDistribution
        The crystals.
    growth : float
        Length dL by which every seed grew, m, measured as the sizes are.
    """

    csd: CrystalSizeDistribution
    growth: float


def grow_seeds(seeds: CrystalSizeDistribution, mass_ratio: float) -> Grown:
    """Grow all seeds by the length that makes so many times their mass.

    Parameters
    ----------
    seeds : CrystalSizeDistribution
        The seeds' classes, each grown as one size.
    mass_ratio : float
        Mass of the crystals over that of the seeds, 1 or above.

    Raises
    ------
    CrystallizerError
        If the ratio is out of range.
    """
    if not 1.0 <= mass_ratio <= LARGEST_MASS_RATIO:
        raise CrystallizerError(f"mass_ratio = {mass_ratio:g}: must be from 1 to {LARGEST_MASS_RATIO:g}")
    size, fraction = seeds.size, seeds.volume_fraction
    cubes = float(np.sum(fraction / size**3))
    most = math.cbrt((mass_ratio - 1.0) / cubes)  # if dL^3 m0 alone made the mass

    def mass(growth: float) -> float:
        return float(np.sum(fraction * (1.0 + growth / size) ** 3))

    growth = 0.0
    if most > 0.0:
        root = scipy.optimize.brentq(lambda share: mass(share * most) - mass_ratio, 0.0, 1.0 + 1e-9, xtol=1e-15)
        growth = float(root) * most
    grown = fraction * (1.0 + growth / size) ** 3
    return Grown(CrystalSizeDistribution.from_classes(size + growth, grown / grown.sum()), growth)
