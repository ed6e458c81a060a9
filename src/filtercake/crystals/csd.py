"""Crystal size distributions: classes of (diameter, volume fraction), their moments, and where they come from."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filtercake.errors import CsdError
from filtercake.units import MICROMETRE, FloatArray

if TYPE_CHECKING:
    import pandas as pd

SMALLEST_SIZE, LARGEST_SIZE = 1e-9, 1.0
"""Diameters, m, that a class may have: far beyond what is filtered, and safe to compute with."""

MOST_CLASSES: Final = 10_000
"""Classes of a distribution at most."""

SUM_TOLERANCE: Final = 0.01
"""Volume fractions are normalised when their sum is within this of 1; further off is an error."""

SAME_SIZE = 1e-9
"""Relative difference of sizes that is rounding (20 um and 0.02 mm)."""


@dataclass(frozen=True)
class CrystalSizeDistribution:
    """A discrete crystal size distribution.

    Attributes
    ----------
    size : ndarray, shape (n,)
        Class diameters in m, ascending and distinct.
    volume_fraction : ndarray, shape (n,)
        Volume (= mass) fraction of each class, positive, sum 1.
    x_over_d, x_over_d2 : ndarray, shape (n,), or None
        What each class adds to the sums of x/d (1/m) and x/d^2 (1/m2), where its crystals are of several sizes;
        None where all have the size of their class.
    understood : str
        How it was read or made, in words; empty where that needs none.
    """

    size: FloatArray
    volume_fraction: FloatArray
    x_over_d: FloatArray | None = None
    x_over_d2: FloatArray | None = None
    understood: str = ""

    @classmethod
    def from_classes(cls, size: ArrayLike, volume_fraction: ArrayLike) -> CrystalSizeDistribution:
        """Build a distribution from classes in any order; equal sizes are merged, empty classes dropped.

        Parameters
        ----------
        size : array_like, shape (n,)
            Diameters, m.
        volume_fraction : array_like, shape (n,)
            Volume fractions; normalised if their sum is within 1 % of 1.

        Raises
        ------
        CsdError
            If a size is not positive and finite, a fraction is negative, or the sum is off by more than 1 %.
        """
        sizes = np.atleast_1d(np.asarray(size, dtype=np.float64))
        fractions = np.atleast_1d(np.asarray(volume_fraction, dtype=np.float64))
        _check_classes(sizes, fractions)
        keep = fractions > 0.0
        distinct, where = np.unique(sizes[keep], return_inverse=True)
        merged = np.bincount(where, weights=fractions[keep])
        return cls(distinct, merged / merged.sum())

    @cached_property
    def number_fraction(self) -> FloatArray:
        """Number fraction of each class, shape (n,), proportional to x/d^3."""
        number = self.volume_fraction / self.size**3
        return np.asarray(number / number.sum())

    @property
    def smallest(self) -> float:
        """Diameter of the smallest class, m."""
        return float(self.size[0])

    @property
    def largest(self) -> float:
        """Diameter of the largest class, m."""
        return float(self.size[-1])

    @property
    def mean_particle_volume(self) -> float:
        """Number-mean sphere volume, m3."""
        return float(np.pi / 6.0 * np.sum(self.number_fraction * self.size**3))

    @property
    def sum_x_over_d2(self) -> float:
        """Sum of x/d^2 over the classes, 1/m2: the size term of the paper's eq. 3."""
        return float(np.sum(self.volume_fraction / self.size**2 if self.x_over_d2 is None else self.x_over_d2))

    @property
    def sum_x_over_d(self) -> float:
        """Sum of x/d over the classes, 1/m: one over the Sauter mean diameter."""
        return float(np.sum(self.volume_fraction / self.size if self.x_over_d is None else self.x_over_d))

    @property
    def sauter_mean(self) -> float:
        """Sauter mean diameter d32, m."""
        return 1.0 / self.sum_x_over_d

    def class_counts(self, particles: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """Whole numbers of spheres per class that add up to ``particles``, by largest remainder, shape (n,)."""
        ideal = self.number_fraction * particles
        counts = np.floor(ideal).astype(np.int64)
        order = np.argsort(-(ideal - counts), kind="stable")
        counts[order[: particles - int(counts.sum())]] += 1
        return counts


FullAndTruncated: TypeAlias = tuple[CrystalSizeDistribution, CrystalSizeDistribution]
"""A distribution, whole and as it is packed."""


def kept_classes(full: CrystalSizeDistribution, truncated: CrystalSizeDistribution) -> NDArray[np.bool_]:
    """Whether each class of the full distribution is packed, shape (n,); sizes may differ by rounding."""
    nearest = np.searchsorted(truncated.size, full.size * (1.0 - SAME_SIZE)).clip(max=truncated.size.size - 1)
    return np.asarray(np.isclose(full.size, truncated.size[nearest], rtol=SAME_SIZE, atol=0.0))


def kept_volume(full: CrystalSizeDistribution, truncated: CrystalSizeDistribution) -> float:
    """Share of the crystal volume that is packed."""
    return float(full.volume_fraction[kept_classes(full, truncated)].sum())


@dataclass(frozen=True)
class Truncation:
    """A truncated distribution and the volume it kept.

    Attributes
    ----------
    csd : CrystalSizeDistribution
        The renormalised classes that were kept.
    kept_volume : float
        Their share of the full distribution's volume.
    """

    csd: CrystalSizeDistribution
    kept_volume: float


def truncate(
    csd: CrystalSizeDistribution, smallest_share: float = 0.0, smallest: float = 0.0, largest: float = math.inf
) -> Truncation:
    """Drop classes below a volume share or beyond a size, and renormalise (paper section 3.1, Fig 5: 0.1 vol%).

    What is kept is what is packed: spheres of the size of their class.

    Parameters
    ----------
    csd : CrystalSizeDistribution
        The full distribution.
    smallest_share : float
        Volume share, of the full distribution, under which a class is dropped.
    smallest, largest : float
        Diameters, m, under and over which a class is dropped.

    Raises
    ------
    CsdError
        If nothing would be left.
    """
    inside = (csd.size >= smallest * (1.0 - SAME_SIZE)) & (csd.size <= largest * (1.0 + SAME_SIZE))
    keep = inside & (csd.volume_fraction >= smallest_share)
    if not keep.any():
        raise CsdError(_nothing_left(csd, inside, smallest_share, smallest, largest))
    kept = float(csd.volume_fraction[keep].sum())
    fractions = csd.volume_fraction[keep] / kept
    return Truncation(CrystalSizeDistribution(csd.size[keep], fractions), kept)


def _nothing_left(
    csd: CrystalSizeDistribution,
    inside: NDArray[np.bool_],
    share: float,
    smallest: float,
    largest: float,
) -> str:
    sizes = f"between {smallest / MICROMETRE:g} and {largest / MICROMETRE:g} um"
    if not inside.any():
        return (
            f"truncation leaves no class: none is {sizes}; "
            f"the sizes run from {csd.smallest / MICROMETRE:g} to {csd.largest / MICROMETRE:g} um"
        )
    where = "" if inside.all() else f" {sizes}"
    return (
        f"truncation at {share:g} per class leaves no class: the largest class{where} holds "
        f"{csd.volume_fraction[inside].max():.3g}; lower the truncation below that"
    )


def discretise(
    cumulative_volume: Callable[[FloatArray], FloatArray],
    upper: float,
    bin_width: float,
    cumulative_sums: Callable[[FloatArray], tuple[FloatArray, FloatArray]] | None = None,
) -> CrystalSizeDistribution:
    """Cut a continuous distribution into bins of about ``bin_width``, each class at its bin's centre.

    Parameters
    ----------
    cumulative_volume : callable
        Cumulative volume fraction at given diameters (m); shape (n,) to shape (n,).
    upper : float
        Largest diameter considered, m.
    bin_width : float
        Wanted bin width, m; the width used divides ``upper`` into a whole number of bins (rounded down).
    cumulative_sums : callable or None
        The sums of x/d (1/m) and x/d^2 (1/m2) up to given diameters, shape (n,) each: with them the classes add exactly
        what the continuous distribution has, without them that of crystals at the bins' centres.

    Raises
    ------
    CsdError
        If there is less than one bin or no volume below ``upper``.
    """
    bins = int(upper / bin_width)
    if bins < 1:
        raise CsdError(f"a bin width of {bin_width:g} m leaves no bin below {upper:g} m")
    edges = np.linspace(0.0, upper, bins + 1)
    volume = np.diff(cumulative_volume(edges))
    if not volume.sum() > 0.0:
        raise CsdError(f"the distribution has no volume below {upper:g} m")
    fractions = volume / volume.sum()
    csd = CrystalSizeDistribution.from_classes(0.5 * (edges[1:] + edges[:-1]), fractions)
    if cumulative_sums is None:
        return csd
    over_d, over_d2 = (np.diff(sums)[fractions > 0.0] for sums in cumulative_sums(edges))
    return replace(csd, x_over_d=over_d, x_over_d2=over_d2)


def read_csd(path: Path) -> CrystalSizeDistribution:
    """Read a distribution from a file of a spreadsheet or an instrument; ``understood`` says how.

    Parameters
    ----------
    path : Path
        As :func:`filtercake.crystals.instruments.read_classes` takes it, for example a CSV with the header
        ``size_um,volume_fraction``.

    Raises
    ------
    CsdError
        If the file cannot be read, may mean more than one distribution, or its classes are none.
    """
    from filtercake.crystals.instruments import read_classes

    found = read_classes(path)
    try:
        csd = CrystalSizeDistribution.from_classes(found.size, found.volume_fraction)
    except CsdError as error:
        raise CsdError(f"{path}: {error}") from None
    return replace(csd, understood=found.understood)


def mixture(sizes: Sequence[float], volume_fractions: Sequence[float]) -> CrystalSizeDistribution:
    """Mix discrete sizes (m) by volume fraction, e.g. the paper's bimodal PMMA."""
    return CrystalSizeDistribution.from_classes(sizes, volume_fractions)


def columns(full: CrystalSizeDistribution, truncated: CrystalSizeDistribution) -> dict[str, FloatArray]:
    """List a distribution and its truncation; classes left out of the packing have truncated fractions 0.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Columns size_um, volume_fraction, number_fraction, x_over_d_1_m, x_over_d2_1_m2, truncated_volume_fraction,
        truncated_number_fraction; one value per class of the full distribution.
    """
    inside = kept_classes(full, truncated)
    volume, number = np.zeros(full.size.size), np.zeros(full.size.size)
    volume[inside], number[inside] = truncated.volume_fraction, truncated.number_fraction
    return {
        "size_um": full.size / MICROMETRE,
        "volume_fraction": full.volume_fraction,
        "number_fraction": full.number_fraction,
        "x_over_d_1_m": full.volume_fraction / full.size if full.x_over_d is None else full.x_over_d,
        "x_over_d2_1_m2": full.volume_fraction / full.size**2 if full.x_over_d2 is None else full.x_over_d2,
        "truncated_volume_fraction": volume,
        "truncated_number_fraction": number,
    }


def to_table(full: CrystalSizeDistribution, truncated: CrystalSizeDistribution) -> pd.DataFrame:
    """Tabulate a distribution and its truncation: :func:`columns`, one row per class of the full distribution."""
    import pandas as pd  # who asks for a resistance needs no table

    return pd.DataFrame(columns(full, truncated))


def from_table(table: Mapping[Any, ArrayLike] | pd.DataFrame) -> FullAndTruncated:
    """Read back the full and the truncated distribution from :func:`to_table`'s columns.

    Raises
    ------
    CsdError
        If a column is missing or the classes are not a distribution.
    """
    needed = ["size_um", "volume_fraction", "truncated_volume_fraction", "x_over_d_1_m", "x_over_d2_1_m2"]
    missing = sorted(name for name in needed if name not in table)
    if missing:
        raise CsdError(f"the table of a size distribution lacks the columns {', '.join(missing)}")
    size, volume, truncated, over_d, over_d2 = (np.asarray(table[name], dtype=np.float64) for name in needed)
    full = CrystalSizeDistribution.from_classes(size * MICROMETRE, volume)
    full = replace(full, x_over_d=over_d, x_over_d2=over_d2)
    return full, CrystalSizeDistribution.from_classes(size * MICROMETRE, truncated)


def read_table(path: str | Path) -> FullAndTruncated:
    """Read the distributions that :func:`to_table` tabulated from a file, to the last digit.

    Raises
    ------
    CsdError
        As :func:`from_table`, or if it is no table; names the file.
    OSError
        If it cannot be read.
    """
    # a packing's job waits for no pandas
    header, *lines = Path(path).read_text(encoding="utf-8").splitlines() or [""]
    names = header.split(",")
    try:
        rows = [[float(value) for value in line.split(",")] for line in lines]
        values = list(zip(*rows, strict=True)) or [()] * len(names)
        return from_table(dict(zip(names, values, strict=True)))
    except (ValueError, CsdError) as error:
        raise CsdError(f"{path}: {error}") from None


def read_tables(paths: Iterable[str | Path]) -> dict[str, FullAndTruncated]:
    """Read distributions, named by their files: :func:`read_table` of each."""
    return {Path(path).stem: read_table(path) for path in paths}


def _check_classes(sizes: FloatArray, fractions: FloatArray) -> None:
    if sizes.shape != fractions.shape or sizes.ndim != 1:
        raise CsdError(f"{sizes.size} sizes but {fractions.size} volume fractions")
    if sizes.size == 0:
        raise CsdError("the distribution has no class; give at least one size with its volume fraction")
    if not (np.isfinite(sizes).all() and (sizes > 0.0).all()):
        bad = sizes[~(np.isfinite(sizes) & (sizes > 0.0))][0]
        raise CsdError(f"size {bad / MICROMETRE:g} um: sizes must be positive and finite")
    if not ((sizes >= SMALLEST_SIZE * (1.0 - SAME_SIZE)) & (sizes <= LARGEST_SIZE * (1.0 + SAME_SIZE))).all():
        bad = sizes[(sizes < SMALLEST_SIZE) | (sizes > LARGEST_SIZE)][0]
        limits = f"{SMALLEST_SIZE / MICROMETRE:g} to {LARGEST_SIZE / MICROMETRE:g} um"
        raise CsdError(f"size {bad / MICROMETRE:g} um: sizes must be {limits}; is the unit right?")
    if not (np.isfinite(fractions).all() and (fractions >= 0.0).all()):
        bad = fractions[~(np.isfinite(fractions) & (fractions >= 0.0))][0]
        raise CsdError(f"volume fraction {bad:g}: fractions must be finite and not negative")
    total = float(fractions.sum())
    if abs(total - 1.0) > SUM_TOLERANCE:
        raise CsdError(f"the volume fractions sum to {total:.6g}; they must sum to 1 within {SUM_TOLERANCE:g}")
