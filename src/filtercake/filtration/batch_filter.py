"""Batch filters at constant pressure (Nutsche, leaf, plate and frame): the times of a cycle and the best cake.

Everything is in SI units. A cycle filters, washes, deliquors, and stands still to be emptied and closed (turnaround).
With w kg of dry cake per area, c kg of it per m3 of filtrate and a cake of resistance alpha on a medium Rm, Ruth's law
gives the time of filtration, and Darcy's law through the full cake that of washing with N times the liquor in it:

``t_f = mu / (c dP) (alpha w^2 / 2 + Rm w)``, ``t_w = N mu_w eps / (rho (1 - eps) dP) (alpha w^2 + Rm w)``.

Deliquoring and turnaround take a time t_0 that does not depend on w. So the cycle takes ``a w^2 + b w + t_0``. The most
cake per area and time is made where ``d/dw (w / (a w^2 + b w + t_0)) = 0``, at ``w = sqrt(t_0 / a)``, whatever the
medium: there the cake's own resistance takes as much time as standing still. Where that is thicker than the filter has
room for, the thickest cake is best.

Assumptions: a cake of one resistance (no compression, no settling of the slurry), full pores until deliquoring, wash
liquor through all of the cake. Source: B. F. Ruth, Ind. Eng. Chem. 27 (1935) 708; any textbook, e.g. Svarovsky,
Solid-Liquid Separation.

All functions take arrays, in the filter's and the cake's values too, that broadcast against each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from filtercake.errors import FilterError
from filtercake.filtration.ranges import FRACTION, NOT_NEGATIVE, POSITIVE, Values, problem, refuse, require
from filtercake.units import FloatArray

NO_LIMIT: Final = math.inf


@dataclass(frozen=True)
class BatchCake:
    """The cake that a batch filter makes.

    Attributes
    ----------
    resistance : float
        Specific resistance alpha, m/kg; positive.
    porosity : float
        Porosity eps, in (0, 1).
    density : float
        Density rho of the crystals, kg/m3.

    Raises
    ------
    FilterError
        If a value is out of range; names every such value and what is allowed.
    """

    resistance: Values
    porosity: Values
    density: Values

    def __post_init__(self) -> None:
        refuse(
            problem("resistance", self.resistance, "m/kg", POSITIVE),
            problem("porosity", self.porosity, "", FRACTION),
            problem("density", self.density, "kg/m3", POSITIVE),
        )

    @property
    def dry_density(self) -> Values:
        """Crystals per volume of cake, ``rho (1 - eps)``, kg/m3."""
        return self.density * (1.0 - self.porosity)


@dataclass(frozen=True)
class BatchFilter:
    """A batch filter at constant pressure, and how it is run.

    Attributes
    ----------
    pressure_drop : float
        Pressure drop dP across cake and medium, Pa; the same for washing.
    medium_resistance : float
        Resistance Rm of the medium, 1/m; 0 for one that does not resist.
    viscosity : float
        Viscosity mu of the filtrate, Pa s.
    solids_per_filtrate : float
        Dry cake mass c per volume of filtrate, kg/m3 (:func:`solids_per_filtrate`).
    turnaround_time : float
        Time to empty, clean, close and fill the filter, s.
    deliquoring_time : float
        Time of deliquoring, s; :func:`filtercake.filtration.deliquoring.time_to_moisture` says what a moisture needs.
    wash_ratio : float
        Volume of wash liquor over that of the cake's pores; 0 for no washing.
    wash_viscosity : float or None
        Viscosity of the wash liquor, Pa s; that of the filtrate if None.
    height_limit : float
        Thickest cake that there is room for, m (of a filter press half its chamber's depth).

    Raises
    ------
    FilterError
        If a value is out of range; names every such value and what is allowed.
    """

    pressure_drop: Values
    medium_resistance: Values
    viscosity: Values
    solids_per_filtrate: Values
    turnaround_time: Values
    deliquoring_time: Values = 0.0
    wash_ratio: Values = 0.0
    wash_viscosity: Values | None = None
    height_limit: Values = NO_LIMIT

    def __post_init__(self) -> None:
        limit = np.where(np.isposinf(self.height_limit), 1.0, self.height_limit)
        refuse(
            problem("pressure_drop", self.pressure_drop, "Pa", POSITIVE),
            problem("medium_resistance", self.medium_resistance, "1/m", NOT_NEGATIVE),
            problem("viscosity", self.viscosity, "Pa s", POSITIVE),
            problem("solids_per_filtrate", self.solids_per_filtrate, "kg/m3", POSITIVE),
            problem("turnaround_time", self.turnaround_time, "s", NOT_NEGATIVE),
            problem("deliquoring_time", self.deliquoring_time, "s", NOT_NEGATIVE),
            problem("wash_ratio", self.wash_ratio, "", NOT_NEGATIVE),
            None if self.wash_viscosity is None else problem("wash_viscosity", self.wash_viscosity, "Pa s", POSITIVE),
            problem("height_limit", limit, "m", POSITIVE),
        )

    @property
    def standing_time(self) -> Values:
        """Part of the cycle that does not depend on the cake, ``t_0``, s."""
        return self.turnaround_time + self.deliquoring_time


@dataclass(frozen=True, eq=False)
class Cycle:
    """A cycle of a batch filter.

    Attributes
    ----------
    cake_mass : ndarray
        Dry cake w per area, kg/m2.
    height : ndarray
        Its height, m.
    filtration_time, wash_time, standing_time, time : ndarray
        Times of filtration, washing, of deliquoring and turnaround, and of all, s.
    productivity : ndarray
        Dry cake per area and time, kg/(m2 s).
    fits : ndarray of bool
        Whether the cake is within the filter's height limit.
    """

    cake_mass: FloatArray
    height: FloatArray
    filtration_time: FloatArray
    wash_time: FloatArray
    standing_time: FloatArray
    time: FloatArray
    productivity: FloatArray
    fits: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


def solids_per_filtrate(slurry_concentration: ArrayLike, cake: BatchCake) -> FloatArray:
    """Dry cake mass per volume of filtrate, kg/m3, from that per volume of slurry.

    ``c / (1 - c / (rho (1 - eps)))``: what does not stay in the cake, as crystals or as liquor in its full pores, is
    filtrate.

    Raises
    ------
    FilterError
        If the concentration is not positive, or the slurry holds as many crystals as the cake.
    """
    slurry = require("slurry_concentration", slurry_concentration, "kg/m3", POSITIVE)
    share = slurry / cake.dry_density
    if (share >= 1.0).any():
        raise FilterError(
            f"slurry_concentration = {slurry.max():g} kg/m3: must be below the {np.min(cake.dry_density):g} kg/m3 of "
            "crystals in the cake, or there is no liquid to filter off"
        )
    return np.asarray(slurry / (1.0 - share))


def cycle(batch: BatchFilter, cake: BatchCake, height: ArrayLike) -> Cycle:
    """Return times and productivity of a cycle that makes a cake of some height (m).

    Raises
    ------
    FilterError
        If the height is not positive and finite.
    """
    thick = require("height", height, "m", POSITIVE)
    mass = np.asarray(thick * cake.dry_density)
    quadratic, linear = _filtration(batch, cake)
    filtering = quadratic * mass**2 + linear * mass
    quadratic, linear = _washing(batch, cake)
    washing = quadratic * mass**2 + linear * mass
    standing = np.asarray(batch.standing_time)
    total = np.asarray(filtering + washing + standing)
    shape = np.broadcast_shapes(mass.shape, total.shape)

    def filled(values: FloatArray) -> FloatArray:
        return np.broadcast_to(values, shape)

    return Cycle(
        cake_mass=filled(mass),
        height=filled(thick),
        filtration_time=filled(filtering),
        wash_time=filled(washing),
        standing_time=filled(standing),
        time=filled(total),
        productivity=filled(mass / total),
        fits=np.broadcast_to(thick <= batch.height_limit, shape),
    )


def best_height(batch: BatchFilter, cake: BatchCake) -> FloatArray:
    """Cake height of the most cake per area and time, m: ``sqrt(t_0 / a) / (rho (1 - eps))``, or the height limit.

    Raises
    ------
    FilterError
        If deliquoring and turnaround take no time: then the thinnest cake is best, and there is no best height.
    """
    standing = np.asarray(batch.standing_time)
    if (standing <= 0.0).any():
        raise FilterError(
            "turnaround_time = 0 s: must be positive where deliquoring_time = 0 s, or ever thinner cakes are better"
        )
    growing = _filtration(batch, cake)[0] + _washing(batch, cake)[0]
    return np.asarray(np.minimum(np.sqrt(standing / growing) / cake.dry_density, batch.height_limit))


def height_after(batch: BatchFilter, cake: BatchCake, filtration_time: ArrayLike) -> FloatArray:
    """Height of the cake after some time of filtration, m: the inverse of :func:`cycle`'s filtration time.

    Raises
    ------
    FilterError
        If the time (s) is not positive and finite.
    """
    time = require("filtration_time", filtration_time, "s", POSITIVE)
    quadratic, linear = _filtration(batch, cake)
    # the root of a w^2 + b w = t without cancellation, whatever the medium
    mass = 2.0 * time / (np.sqrt(linear**2 + 4.0 * quadratic * time) + linear)
    return np.asarray(mass / cake.dry_density)


def area_for(found: Cycle, solids_flow: ArrayLike) -> FloatArray:
    """Filter area, m2, that a flow of crystals (kg/s, mean over the cycles) needs.

    Raises
    ------
    FilterError
        If the flow is not positive and finite.
    """
    return np.asarray(require("solids_flow", solids_flow, "kg/s", POSITIVE) / found.productivity)


def capacity_of(found: Cycle, filter_area: ArrayLike) -> FloatArray:
    """Flow of crystals, kg/s (mean over the cycles), that an area (m2) takes: the inverse of :func:`area_for`.

    Raises
    ------
    FilterError
        If the area is not positive and finite.
    """
    return np.asarray(require("filter_area", filter_area, "m2", POSITIVE) * found.productivity)


def _filtration(batch: BatchFilter, cake: BatchCake) -> tuple[FloatArray, FloatArray]:
    """Time of filtration over w^2 and over w."""
    per = batch.viscosity / (batch.solids_per_filtrate * batch.pressure_drop)
    return np.asarray(0.5 * per * cake.resistance), np.asarray(per * batch.medium_resistance)


def _washing(batch: BatchFilter, cake: BatchCake) -> tuple[FloatArray, FloatArray]:
    """Time of washing over w^2 and over w."""
    viscosity = batch.viscosity if batch.wash_viscosity is None else batch.wash_viscosity
    liquor = batch.wash_ratio * cake.porosity / cake.dry_density
    per = viscosity * liquor / batch.pressure_drop
    return np.asarray(per * cake.resistance), np.asarray(per * batch.medium_resistance)
