"""A cascade of mixed-suspension, mixed-product-removal crystallizers: the product of each feeds the next.

Every function is in SI units. In stage k of residence time tau_k, ``G_k tau_k dn_k/dL = n_{k-1} - n_k`` with
``n_k(0) = B_k / G_k``. So its moments ``m_p = int L^p n dL`` follow those of the stage before, m_p', with
``a_k = G_k tau_k``:

``m0 = m0' + B_k tau_k``, ``m1 = m1' + a_k m0``, ``m2 = m2' + 2 a_k m1``, ``m3 = m3' + 3 a_k m2``.

The slurry concentration of each stage, ``MT_k = kv rho m3``, and the kinetics ``B_k = K_R MT_k^j G_k^i`` leave one
unknown, G_k. All that G_k makes in m3 rises with it for i > -3, so that there is one root. One stage is the MSMPR
crystallizer of :mod:`filtercake.crystals.crystallizer`, in closed form.

Assumptions: the same flow of slurry through all stages, and a clear feed; each stage is mixed and takes neither fines
nor coarse crystals out; crystals grow at one rate whatever their size, and neither dissolve, break nor cluster; one set
of kinetics for all temperatures. What crystallizes in which stage is given by the slurry concentrations, which follow
from solubilities, temperatures and evaporation and are the user's: nothing here knows of heat. Source: A. D. Randolph
and M. A. Larson, Theory of Particulate Processes, 2nd ed., Academic Press 1988.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from filtercake.crystals.crystallizer import BIN_WIDTH, LARGEST_LOGARITHM, Kinetics, steady_state
from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.crystals.number_density import cut_moments
from filtercake.errors import CrystallizerError
from filtercake.units import FloatArray

MOST_STAGES: Final = 20
"""Stages that a cascade may have."""

POWERS: Final = 4
"""Powers of the size, 0 to 3, that are followed."""


class Moments(NamedTuple):
    """Moments of a number density, ``int L^p n dL`` for p of 0 to 3, #/m3 times m^p."""

    m0: float
    m1: float
    m2: float
    m3: float


@dataclass(frozen=True)
class Stage:
    """One crystallizer of a cascade at steady state.

    Attributes
    ----------
    growth_rate : float
        G, m/s.
    nucleation_rate : float
        B0, #/(m3 s).
    residence_time : float
        tau, s.
    slurry_concentration : float
        MT, kg/m3.
    moments : Moments
        Of the crystals in it.
    """

    growth_rate: float
    nucleation_rate: float
    residence_time: float
    slurry_concentration: float
    moments: Moments

    @property
    def size_scale(self) -> float:
        """G tau, m."""
        return self.growth_rate * self.residence_time

    @property
    def sauter_mean(self) -> float:
        """Sauter mean size d32 of its crystals, m."""
        return self.moments.m3 / self.moments.m2


def cascade(
    kinetics: Kinetics, residence_times_s: Sequence[float], slurry_concentrations_kg_m3: Sequence[float]
) -> tuple[Stage, ...]:
    """Solve for the growth rates of a cascade, stage by stage.

    Parameters
    ----------
    kinetics : Kinetics
        Nucleation kinetics, shape factor and density of the crystals, in all stages.
    residence_times_s : sequence of float
        Residence time of each stage, s.
    slurry_concentrations_kg_m3 : sequence of float
        Slurry concentration MT in each stage, kg/m3; it must rise from stage to stage.

    Raises
    ------
    CrystallizerError
        If there are no stages or too many, the numbers of values differ, a value is not positive and finite, the
        slurry concentrations do not rise, or a growth rate is beyond the range of floating-point numbers.
    """
    times, slurries = list(residence_times_s), list(slurry_concentrations_kg_m3)
    if not 1 <= len(times) <= MOST_STAGES or len(times) != len(slurries):
        raise CrystallizerError(
            f"{len(times)} residence times and {len(slurries)} slurry concentrations: must be as many, one for each of "
            f"1 to {MOST_STAGES} stages"
        )
    stages: list[Stage] = []
    for time, slurry in zip(times, slurries, strict=True):
        before = stages[-1] if stages else None
        stages.append(_first(kinetics, time, slurry) if before is None else _next(kinetics, before, time, slurry))
    return tuple(stages)


def cascade_product(stages: Sequence[Stage], bin_width: float = BIN_WIDTH) -> CrystalSizeDistribution:
    """Cut the product of a cascade's last stage into size classes of about ``bin_width`` (m).

    Every class adds to the sums of x/d and x/d^2 what its crystals do. The densities of all stages and their integrals
    are one linear system over the size, which is stepped exactly by a matrix exponential.

    Raises
    ------
    CrystallizerError, CsdError
        As :func:`filtercake.crystals.number_density.cut_moments`.
    """
    scale = max(stage.size_scale for stage in stages)
    system, start = _system(stages, scale)

    def cumulative(size: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        integrals = _stepped(system, start, size / scale)
        length, surface, volume = (integrals[:, k] * scale ** (k + 2) for k in range(3))
        return length, surface, volume

    return cut_moments(cumulative, stages[-1].moments.m3, scale, bin_width)


def _first(kinetics: Kinetics, time: float, slurry: float) -> Stage:
    state = steady_state(kinetics, time, slurry)
    nothing = Moments(0.0, 0.0, 0.0, 0.0)
    moments = _after(nothing, state.size_scale, state.nucleation_rate * state.residence_time)
    return Stage(state.growth_rate, state.nucleation_rate, state.residence_time, state.slurry_concentration, moments)


def _next(kinetics: Kinetics, before: Stage, time: float, slurry: float) -> Stage:
    from scipy import optimize

    alone = steady_state(kinetics, time, slurry)  # its crystals would all be born here; and it checks the values
    time, slurry = alone.residence_time, alone.slurry_concentration
    if not slurry > before.slurry_concentration:
        raise CrystallizerError(
            f"slurry_concentration_kg_m3 = {slurry:g}: must be above the {before.slurry_concentration:g} of the stage "
            "before"
        )
    wanted = (slurry - before.slurry_concentration) / (kinetics.shape_factor * kinetics.density)

    def rates(log_ratio: float) -> tuple[float, float]:
        ratio = math.exp(log_ratio)
        return alone.growth_rate * ratio, alone.nucleation_rate * ratio**kinetics.growth_rate_exponent

    def surplus(log_ratio: float) -> float:
        """Logarithm of what is crystallized here over what must be; it rises with the growth rate."""
        growth, nucleation = rates(log_ratio)
        grown = _after(before.moments, growth * time, nucleation * time)
        return math.log(3.0 * growth * time * grown.m2 / wanted)

    # alone, the stage would crystallize all of its slurry: with crystals to grow on, and less to crystallize, more
    low = -1.0
    while surplus(low) > 0.0:
        low *= 2.0
        if low < -0.25 * LARGEST_LOGARITHM:
            raise CrystallizerError(
                f"slurry_concentration_kg_m3 = {slurry:g}: too near that of the stage before to compute a growth rate"
            )
    root = float(optimize.brentq(surplus, low, 1.0, xtol=1e-14, rtol=1e-14))
    growth, nucleation = rates(root)
    return Stage(growth, nucleation, time, slurry, _after(before.moments, growth * time, nucleation * time))


def _after(before: Moments, size_scale: float, born: float) -> Moments:
    """Moments of a stage from those of its feed, its G tau (m) and the nuclei that it adds (#/m3)."""
    m0 = before.m0 + born
    m1 = before.m1 + size_scale * m0
    m2 = before.m2 + 2.0 * size_scale * m1
    return Moments(m0, m1, m2, before.m3 + 3.0 * size_scale * m2)


def _system(stages: Sequence[Stage], scale: float) -> tuple[FloatArray, FloatArray]:
    """Matrix and start of the linear system of x^p n_k and the integrals of x^p n of the last stage, with x = L/scale.

    ``d(x^p n_k)/dx = p x^(p-1) n_k + x^p (n_{k-1} - n_k) / (a_k / scale)``.
    """
    count = len(stages)
    size = POWERS * count + POWERS - 1
    system, start = np.zeros((size, size)), np.zeros(size)
    for k, stage in enumerate(stages):
        start[k] = stage.nucleation_rate / stage.growth_rate
        for power in range(POWERS):
            row = power * count + k
            system[row, row] = -scale / stage.size_scale
            if k > 0:
                system[row, row - 1] = scale / stage.size_scale
            if power > 0:
                system[row, row - count] = power
    for power in range(1, POWERS):
        system[POWERS * count + power - 1, power * count + count - 1] = 1.0
    return system, start


def _stepped(system: FloatArray, start: FloatArray, at: FloatArray) -> FloatArray:
    """Integrals at ascending places, shape (n, 3); equal steps share one matrix exponential."""
    from scipy import linalg

    state, place, step, found = start, 0.0, math.nan, []
    move = np.eye(start.size)
    for end in at:
        if not math.isclose(end - place, step, rel_tol=1e-9):
            step = float(end - place)
            move = np.asarray(linalg.expm(step * system))
        state, place = move @ state, float(end)
        found.append(state[1 - POWERS :])
    return np.array(found)
