"""What N spheres hold of a size distribution: rare classes merged, whole counts, and what that does to the porosity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.packing.analytic_models import yu_zou_standish

LEAST_EXPECTED = 1.0 - 1e-9
"""Spheres that a class must be expected to hold; rarer ones are merged with their neighbours."""
CLOSE_PACKED = 0.36
"""Porosity of equal spheres for the analytic model that judges a representation."""


@dataclass(frozen=True)
class Representation:
    """A distribution as N spheres hold it.

    Attributes
    ----------
    csd : CrystalSizeDistribution
        The classes that are drawn from, rare ones merged: same volume and number of spheres, fewer sizes.
    merged : int
        Number of classes that were too rare to stand alone.
    share : float
        Their share of the crystal volume.
    porosity_shift : float
        What whole numbers of spheres of these sizes change in the porosity, by an analytic packing model.
    """

    csd: CrystalSizeDistribution
    merged: int
    share: float
    porosity_shift: float

    @property
    def words(self) -> str:
        """What is too rare, in words."""
        if not self.merged:
            return "whole numbers of spheres hold other shares of the size classes"
        classes = "one size class holds" if self.merged == 1 else f"{self.merged} size classes hold"
        return f"{classes} less than one sphere each ({self.share:.2%} of the volume)"


def merge_rare(csd: CrystalSizeDistribution, particles: int) -> CrystalSizeDistribution:
    """Merge classes that would hold less than one sphere with their finer neighbours, coarsest first.

    Largest remainders alone would give such a class no sphere and lose its volume. The size of merged classes conserves
    volume and number: ``d^3 = sum(x) / sum(x / d^3)``.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The distribution to be packed.
    particles : int
        Number of spheres.

    Returns
    -------
    CrystalSizeDistribution
        ``csd`` itself where no class is rare.
    """
    size, volume = csd.size.copy(), csd.volume_fraction.copy()
    while size.size > 1:
        number = volume / size**3
        rare = np.flatnonzero(particles * number / number.sum() < LEAST_EXPECTED)
        if rare.size == 0:
            break
        first = max(int(rare[-1]) - 1, 0)
        pair = slice(first, first + 2)
        size[first] = (volume[pair].sum() / number[pair].sum()) ** (1.0 / 3.0)
        volume[first] = volume[pair].sum()
        size, volume = np.delete(size, first + 1), np.delete(volume, first + 1)
    return csd if size.size == csd.size.size else CrystalSizeDistribution.from_classes(size, volume)


def represent(csd: CrystalSizeDistribution, particles: int) -> Representation:
    """Say what N spheres hold of a distribution, and how far its porosity moves by that.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The distribution to be packed.
    particles : int
        Number of spheres.

    Notes
    -----
    The shift is that of the Yu-Zou-Standish model with eps0 = 0.36. Its absolute error, a few hundredths, cancels
    between two distributions so alike.
    """
    rare = particles * csd.number_fraction < LEAST_EXPECTED
    merged = merge_rare(csd, particles)
    counts = merged.class_counts(particles)
    drawn = counts * merged.size**3
    whole = CrystalSizeDistribution.from_classes(merged.size, drawn / drawn.sum())
    shift = yu_zou_standish(whole, CLOSE_PACKED) - yu_zou_standish(csd, CLOSE_PACKED)
    return Representation(merged, int(rare.sum()), float(csd.volume_fraction[rare].sum()), shift)


def particles_for(csd: CrystalSizeDistribution, largest_shift: float, most: int) -> int | None:
    """Return a number of spheres that represents a distribution, None where ``most`` do not.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The distribution to be packed.
    largest_shift : float
        Change of the porosity that is allowed.
    most : int
        Largest number of spheres.
    """
    particles = int(np.ceil(LEAST_EXPECTED / csd.number_fraction.min()))
    while particles <= most:
        if abs(represent(csd, particles).porosity_shift) <= largest_shift:
            return particles
        particles *= 2
    return None
