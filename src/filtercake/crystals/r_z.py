"""A continuous crystallizer with fines dissolution and classified product removal: the R-z model.

Every function is in SI units. The crystallizer is well mixed. Crystals below the size L_f leave it R times as fast as
the mixed product does (the surplus is dissolved and returned), those above L_p z times as fast, all others with it. The
population balance ``G dn/dL = -h(L) n / tau``, with h = R, 1 and z, gives the number density

``n = n0 exp(-R L/a)`` below L_f, ``C2 exp(-L/a)`` with ``C2 = n0 exp(-(R - 1) L_f / a)`` between, and
``C3 exp(-z L/a)`` with ``C3 = C2 exp((z - 1) L_p / a)`` above L_p,

with ``a = G tau`` and ``n0 = B0 / G``. The product has z times the crystallizer's density above L_p. The slurry
concentration in the crystallizer, ``MT = kv rho int L^3 n dL``, and the kinetics ``B0 = K_R MT^j G^i`` leave one
unknown, G. MT grows with G, so that there is one root, wherever i >= 1, and for any i > -3 where z = 1; other kinetics
are refused. R = z = 1 is the MSMPR crystallizer of :mod:`filtercake.crystals.crystallizer`.

Assumptions: crystals grow at one rate whatever their size, neither break nor cluster; nuclei have no size; what is
dissolved returns to the solution. Source: A. D. Randolph and M. A. Larson, Theory of Particulate Processes, 2nd ed.,
Academic Press 1988.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from filtercake.crystals.crystallizer import BIN_WIDTH, LARGEST_LOGARITHM, Kinetics, SteadyState, steady_state
from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.crystals.number_density import cut_moments
from filtercake.errors import CrystallizerError
from filtercake.units import FloatArray

LARGEST_RATIO: Final = 1000.0
"""R and z that a crystallizer may have."""

FACTORIALS: Final = (1.0, 1.0, 2.0, 6.0)


@dataclass(frozen=True)
class Withdrawal:
    """How a crystallizer withdraws its crystals.

    Attributes
    ----------
    fines_ratio : float
        R: how much faster than the mixed product the fines leave, 1 (as fast) or above.
    fines_size : float
        L_f, m: fines are smaller; 0 or above.
    classification_ratio : float
        z: how much faster than the mixed product coarse crystals leave, 1 or above.
    classification_size : float
        L_p, m: coarse crystals are larger; at least ``fines_size``.

    Raises
    ------
    CrystallizerError
        If a value is out of range; names it and what is allowed.
    """

    fines_ratio: float = 1.0
    fines_size: float = 0.0
    classification_ratio: float = 1.0
    classification_size: float = math.inf

    def __post_init__(self) -> None:
        for name in ("fines_ratio", "classification_ratio"):
            value = getattr(self, name)
            if not 1.0 <= value <= LARGEST_RATIO:
                raise CrystallizerError(f"{name} = {value:g}: must be from 1 to {LARGEST_RATIO:g}")
        if not 0.0 <= self.fines_size < math.inf:
            raise CrystallizerError(f"fines_size = {self.fines_size:g} m: must be finite and not negative")
        if not self.classification_size >= self.fines_size:
            raise CrystallizerError(
                f"classification_size = {self.classification_size:g} m: must be at least fines_size = "
                f"{self.fines_size:g} m"
            )

    @property
    def pieces(self) -> tuple[tuple[float, float, float, float], ...]:
        """Lower and upper size (m), rate of withdrawal and density in the product over that in the crystallizer."""
        fines, coarse = self.fines_size, self.classification_size
        return (
            (0.0, fines, self.fines_ratio, 1.0),
            (fines, coarse, 1.0, 1.0),
            (coarse, math.inf, self.classification_ratio, self.classification_ratio),
        )


@dataclass(frozen=True)
class RzState:
    """An R-z crystallizer at steady state.

    Attributes
    ----------
    growth_rate : float
        G, m/s.
    nucleation_rate : float
        B0, #/(m3 s).
    size_scale : float
        a = G tau, m.
    residence_time : float
        tau, s: slurry volume over the flow of mixed product.
    slurry_concentration : float
        MT in the crystallizer, kg/m3.
    product_concentration : float
        Crystals in the product, kg per m3 of mixed product flow; above MT where coarse crystals are removed faster.
        A slurry cannot hold as much as a cake does: a z that asks for it is out of reach.
    withdrawal : Withdrawal
        How crystals leave it.
    kinetics : str
        Name of the kinetics.
    """

    growth_rate: float
    nucleation_rate: float
    size_scale: float
    residence_time: float
    slurry_concentration: float
    product_concentration: float
    withdrawal: Withdrawal
    kinetics: str


def r_z_steady_state(
    kinetics: Kinetics, residence_time_s: float, slurry_concentration_kg_m3: float, withdrawal: Withdrawal
) -> RzState:
    """Solve for the growth rate of an R-z crystallizer at a residence time and slurry concentration.

    Parameters
    ----------
    kinetics : Kinetics
        Nucleation kinetics, shape factor and density of the crystals.
    residence_time_s : float
        Residence time tau of the mixed product, s.
    slurry_concentration_kg_m3 : float
        Slurry concentration MT in the crystallizer, kg/m3.
    withdrawal : Withdrawal
        How crystals leave it.

    Raises
    ------
    CrystallizerError
        If a value is not positive and finite, the kinetics may have several roots, or there is none in the range of
        floating-point numbers.
    """
    if kinetics.growth_rate_exponent < 1.0 and withdrawal.classification_ratio > 1.0:
        raise CrystallizerError(
            f"kinetics {kinetics.name}: growth_rate_exponent = {kinetics.growth_rate_exponent:g}: must be at least 1 "
            "where classification_ratio is above 1, or several growth rates may do"
        )
    plain = steady_state(kinetics, residence_time_s, slurry_concentration_kg_m3)
    ratio = _growth_over_mixed(kinetics, plain, withdrawal)
    scale = plain.size_scale * ratio
    nucleation = plain.nucleation_rate * ratio**kinetics.growth_rate_exponent
    crystals = kinetics.shape_factor * kinetics.density * nucleation / (plain.growth_rate * ratio)
    product = float(crystals * _moment(scale, withdrawal, 3, in_product=True))
    return RzState(
        growth_rate=plain.growth_rate * ratio,
        nucleation_rate=nucleation,
        size_scale=scale,
        residence_time=plain.residence_time,
        slurry_concentration=plain.slurry_concentration,
        product_concentration=product,
        withdrawal=withdrawal,
        kinetics=kinetics.name,
    )


def number_density(state: RzState, size: ArrayLike, *, in_product: bool = False) -> FloatArray:
    """Return the number density n of the crystallizer, or of its product, #/(m3 m).

    Sizes L in m, of any shape; a negative one or one that is not finite raises a CrystallizerError.
    """
    sizes = np.asarray(size, dtype=np.float64)
    wrong = sizes[~((sizes >= 0.0) & np.isfinite(sizes))]
    if wrong.size:
        raise CrystallizerError(f"size = {wrong.flat[0]:g}: must be finite and not negative, in m")
    decay = np.exp(-_withdrawn(state.withdrawal, sizes) / state.size_scale)
    coarse = in_product & (sizes > state.withdrawal.classification_size)
    weight = np.where(coarse, state.withdrawal.classification_ratio, 1.0)
    return np.asarray(state.nucleation_rate / state.growth_rate * weight * decay)


def r_z_product(state: RzState, bin_width: float = BIN_WIDTH) -> CrystalSizeDistribution:
    """Cut the product of an R-z crystallizer into size classes of about ``bin_width`` (m).

    Every class adds to the sums of x/d and x/d^2 what its crystals do.

    Raises
    ------
    CrystallizerError, CsdError
        As :func:`filtercake.crystals.number_density.cut_moments`.
    """

    def cumulative(size: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        length, surface, volume = (
            np.asarray(_moment(state.size_scale, state.withdrawal, power, size, in_product=True)) for power in (1, 2, 3)
        )
        return length, surface, volume

    whole = float(_moment(state.size_scale, state.withdrawal, 3, in_product=True))
    return cut_moments(cumulative, whole, state.size_scale, bin_width)


def _growth_over_mixed(kinetics: Kinetics, plain: SteadyState, withdrawal: Withdrawal) -> float:
    """Growth rate over that of the MSMPR crystallizer of the same residence time and slurry concentration."""
    from scipy import optimize

    mixed = FACTORIALS[3] * plain.size_scale**4

    def surplus(log_ratio: float) -> float:
        """Logarithm of the slurry concentration over the one asked for; it rises with the growth rate."""
        volume = float(_moment(plain.size_scale * math.exp(log_ratio), withdrawal, 3))
        return (kinetics.growth_rate_exponent - 1.0) * log_ratio + math.log(volume / mixed)

    # faster withdrawal leaves fewer crystals: they must grow at least as fast as in the MSMPR crystallizer
    if surplus(0.0) >= 0.0:
        return 1.0
    high = 1.0
    while surplus(high) < 0.0:
        high *= 2.0
        if high > 0.25 * LARGEST_LOGARITHM:
            raise CrystallizerError(
                f"kinetics {kinetics.name}: no growth rate in the range of numbers gives the slurry concentration; "
                "check fines_size and classification_size, in m"
            )
    return math.exp(float(optimize.brentq(surplus, 0.0, high, xtol=1e-14, rtol=1e-14)))


def _withdrawn(withdrawal: Withdrawal, size: FloatArray) -> FloatArray:
    """Integral of h(L) from 0 to sizes, m: n is n0 exp of minus this over G tau."""
    pieces = (rate * np.maximum(np.minimum(size, upper) - lower, 0.0) for lower, upper, rate, _ in withdrawal.pieces)
    return np.asarray(sum(pieces))


def _moment(
    size_scale: float, withdrawal: Withdrawal, power: int, size: ArrayLike = math.inf, *, in_product: bool = False
) -> FloatArray:
    """Integral of ``L^power n / n0`` from 0 up to sizes; by parts, piece by piece."""
    sizes = np.asarray(size, dtype=np.float64)
    total = np.zeros(sizes.shape)
    for lower, upper, rate, in_product_over in withdrawal.pieces:
        ends = (np.asarray(lower), np.clip(sizes, lower, upper))
        start, stop = (_tail(size_scale, withdrawal, power, rate, end) for end in ends)
        total += (in_product_over if in_product else 1.0) * (start - stop)
    return total


def _tail(size_scale: float, withdrawal: Withdrawal, power: int, rate: float, size: FloatArray) -> FloatArray:
    """Integral of ``L^power n / n0`` from sizes to infinity if the rate of withdrawal stayed what it is there."""
    finite = np.where(np.isfinite(size), size, 0.0)
    scaled = rate * finite / size_scale
    series = sum(scaled**k / FACTORIALS[k] for k in range(power + 1))
    decay = np.exp(-_withdrawn(withdrawal, finite) / size_scale)
    whole = (size_scale / rate) ** (power + 1) * FACTORIALS[power]
    return np.asarray(np.where(np.isfinite(size), whole * decay * series, 0.0))
