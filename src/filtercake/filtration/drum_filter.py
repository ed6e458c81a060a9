"""Constant-pressure rotary drum filter with medium resistance: area, cake and what the model may be trusted for.

Everything is in SI units. Source: paper, eq. 10 and Fig. 14. With the filtration time f/n of one revolution,
constant-pressure filtration of a slurry of c kg crystals per m3 through cake and medium gives

``A = alpha c V / (sqrt(2 c alpha dP f n / mu + (n Rm)^2) - n Rm)``.

The difference in the denominator cancels as alpha goes to 0. Multiplied by its conjugate, the area per slurry flow is

``A / V = sqrt(mu c alpha / (2 dP f n) + R^2) + R`` with ``R = mu Rm / (2 dP f)``,

without cancellation, and exact at alpha = 0 (2 R: the medium alone) and at Rm = 0. It grows as 1/sqrt(n) when n goes
to 0, so a drum at rest has no area and is refused.

Slurry or filtrate
------------------
Eq. 10 counts the slurry's whole volume as filtrate, and so does the paper: its c is per volume of slurry. A share
``1 - phi = c / (rho (1 - eps))`` of the slurry stays in the cake as crystals and liquor. Counting the filtrate that
passes, phi V with c / phi kg of crystals per m3 of it, is the same formula with phi mu in place of mu. A drum has the
slurry basis unless it is given ``filtrate_per_slurry``, for example by :func:`on_filtrate_basis`. For the paper's alum
phi is 0.885, and the area 8 to 9 % larger on the slurry basis.

A horizontal belt filter is the same apparatus unrolled: :func:`belt`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from filtercake.errors import FilterError
from filtercake.filtration.ranges import (
    FRACTION,
    NOT_NEGATIVE,
    POSITIVE,
    SHARE,
    TURNING,
    WHOLE_OR_LESS,
    Values,
    problem,
    refuse,
    require,
)
from filtercake.units import LENGTH_UNITS, MICROMETRE, FloatArray, duration

if TYPE_CHECKING:
    import pandas as pd

WATER_DENSITY: Final = 1000.0
"""Density the paper assumes for the filtrate, kg/m3."""

MINIMUM_THICKNESS: Final = 5e-3
"""Thinnest cake that leaves a drum without trouble, m.

A rule of thumb: scraper discharge fails at a few millimetres (Anlauf, Wet Cake Filtration, Wiley-VCH 2019, chapter 6),
and 1/8 inch should form within 5 min (Walas, Chemical Process Equipment, rules of thumb).
"""

MAXIMUM_THICKNESS: Final = 50e-3
"""Thickest usual cake, m.

A rule of thumb: slurries fit for a drum form 30 to 50 mm (Mujumdar, ed., Handbook of Industrial Drying, chapter on
solid-liquid separation for pretreatment).
"""

MINIMUM_LAYERS: Final = 10.0
"""Thinnest packed bed, in diameters of its largest crystal.

Floor and free surface each disturb one to two of them, so that below ten the undisturbed interior is not most of it.
"""

MAXIMUM_REYNOLDS: Final = 10.0
"""Particle Reynolds number (see :func:`particle_reynolds`) above which Darcy's law is left.

The usual limit of the Blake-Kozeny equation (Bird, Stewart & Lightfoot, Transport Phenomena). By Ergun's equation,
inertia adds 1.2 % to the cake's resistance at 1 and 12 % at 10.
"""

FORMING_THICKNESS: Final = 3e-3
"""Cake, m, that a continuous filter must form within :data:`LONGEST_FORMING` (1/8 inch, rounded)."""

LONGEST_FORMING: Final = 300.0
"""Time, s, within which it must: slower slurries go to batch filters (Walas, Chemical Process Equipment, rules of
thumb)."""

MAXIMUM_CAKE_VOLUME: Final = 0.2
"""Share of the slurry's volume that may stay in the cake before eq. 10 misleads: it counts all of it as filtrate."""

DESIGN_COLUMNS: Final = (
    "filter_area_m2",
    "medium_share",
    "cake_mass_kg_m2",
    "cake_thickness_mm",
    "filtrate_velocity_mm_s",
    "particle_reynolds",
    "filter_warnings",
)

_MILLIMETRE: Final = LENGTH_UNITS["mm"]
_ERGUN_VISCOUS: Final = 150.0
_ERGUN_INERTIAL: Final = 1.75


@dataclass(frozen=True)
class DrumFilter:
    """A rotary drum filter at its operating point.

    Attributes
    ----------
    pressure_drop : float
        Pressure drop dP across cake and medium, Pa.
    submerged_fraction : float
        Fraction f of the drum that is immersed in the slurry, in (0, 1).
    rotation_rate : float
        Rotation rate n, 1/s.
    medium_resistance : float
        Resistance Rm of the filter medium, 1/m; 0 for a medium that does not resist.
    viscosity : float
        Viscosity mu of the filtrate, Pa s.
    slurry_concentration : float
        Slurry concentration c (the crystallizer's MT): kg of crystals per m3 of slurry.
    filtrate_per_slurry : float
        Volume phi of filtrate that a volume of slurry gives, in (0, 1]; 1 is the paper's slurry basis.

    Raises
    ------
    FilterError
        If a value is out of range; names every such value and what is allowed.

    Notes
    -----
    Values may be arrays, too, that broadcast against each other and the arguments of the functions here, so that many
    drums are sized at once; warnings and tables take one drum at a time.
    """

    pressure_drop: Values
    submerged_fraction: Values
    rotation_rate: Values
    medium_resistance: Values
    viscosity: Values
    slurry_concentration: Values
    filtrate_per_slurry: Values = 1.0

    def __post_init__(self) -> None:
        refuse(
            problem("pressure_drop", self.pressure_drop, "Pa", POSITIVE),
            problem("submerged_fraction", self.submerged_fraction, "", FRACTION),
            problem("rotation_rate", self.rotation_rate, "1/s", TURNING),
            problem("medium_resistance", self.medium_resistance, "1/m", NOT_NEGATIVE),
            problem("viscosity", self.viscosity, "Pa s", POSITIVE),
            problem("slurry_concentration", self.slurry_concentration, "kg/m3", POSITIVE),
            problem("filtrate_per_slurry", self.filtrate_per_slurry, "", WHOLE_OR_LESS),
        )


@dataclass(frozen=True)
class Cake:
    """Properties of a cake from its packing and size distribution.

    Attributes
    ----------
    resistance : float
        Specific cake resistance alpha, m/kg; nan where no packing was accepted.
    porosity : float
        Cake porosity, in (0, 1); nan where no packing was accepted.
    density : float
        Crystal density, kg/m3.
    sauter_mean : float
        Sauter mean diameter d32 of the crystals, m.
    largest : float
        Diameter of the largest crystals, m.

    Raises
    ------
    FilterError
        If a value is out of range; names every such value and what is allowed.
    """

    resistance: float
    porosity: float
    density: float
    sauter_mean: float
    largest: float

    def __post_init__(self) -> None:
        refuse(
            None if math.isnan(self.resistance) else problem("resistance", self.resistance, "m/kg", NOT_NEGATIVE),
            None if math.isnan(self.porosity) else problem("porosity", self.porosity, "", FRACTION),
            problem("density", self.density, "kg/m3", POSITIVE),
            problem("sauter_mean", self.sauter_mean, "m", POSITIVE),
            problem("largest", self.largest, "m", POSITIVE),
        )

    @property
    def known(self) -> bool:
        """Whether porosity and resistance are known."""
        return not (math.isnan(self.resistance) or math.isnan(self.porosity))


def on_filtrate_basis(drum: DrumFilter, porosity: ArrayLike, density: ArrayLike) -> DrumFilter:
    """Return the drum that counts as filtrate what passes it, and not the slurry's whole volume.

    Parameters
    ----------
    drum : DrumFilter
        The drum, on whatever basis.
    porosity, density : array_like
        Porosity of the cake, in (0, 1), whose pores are full, and density of the crystals, kg/m3.

    Raises
    ------
    FilterError
        If an argument is out of range, or the slurry holds as many crystals as the cake.
    """
    share = drum.slurry_concentration / _cake_density(drum, porosity, density)
    return replace(drum, filtrate_per_slurry=1.0 - share)


def belt(drum: DrumFilter, form_share: Values, belt_speed: Values, belt_length: Values) -> DrumFilter:
    """Return a horizontal belt filter: a drum that turns once while the belt passes its vacuum zones.

    Parameters
    ----------
    drum : DrumFilter
        Pressure drop, medium, filtrate and slurry; its submerged fraction and rotation rate are left aside.
    form_share : float
        Share of the belt's length on which the cake forms, in (0, 1); washing and deliquoring take the rest.
    belt_speed : float
        Speed of the belt, m/s.
    belt_length : float
        Length of the belt under vacuum, m. The area of :func:`area` is this length times the belt's width.

    Raises
    ------
    FilterError
        If an argument is out of range.
    """
    share = require("form_share", form_share, "", FRACTION)
    speed = require("belt_speed", belt_speed, "m/s", POSITIVE)
    length = require("belt_length", belt_length, "m", POSITIVE)
    return replace(drum, submerged_fraction=share, rotation_rate=speed / length)


def forming_time(drum: DrumFilter, resistance: ArrayLike, cake_mass: ArrayLike) -> FloatArray:
    """Time that a cake of some mass per area (kg/m2) takes to form, s, whatever the drum's speed.

    By Ruth's law, ``phi mu w (alpha w / 2 + Rm) / (c dP)``; ``f / n`` for the cake of :func:`cake_mass_per_area`.

    Raises
    ------
    FilterError
        If an argument is out of range.
    """
    alpha = require("resistance", resistance, "m/kg", NOT_NEGATIVE)
    mass = require("cake_mass", cake_mass, "kg/m2", POSITIVE)
    resisting = drum.filtrate_per_slurry * drum.viscosity * (0.5 * alpha * mass + drum.medium_resistance)
    return np.asarray(resisting * mass / (drum.slurry_concentration * drum.pressure_drop))


def area(drum: DrumFilter, resistance: ArrayLike, slurry_flow: ArrayLike) -> FloatArray:
    """Filter area that a slurry flow needs, m2 (paper, eq. 10).

    Parameters
    ----------
    drum : DrumFilter
        The filter.
    resistance : array_like
        Specific cake resistance alpha, m/kg, zero or positive; broadcasts against ``slurry_flow``.
    slurry_flow : array_like
        Slurry flow V, m3/s, positive.

    Raises
    ------
    FilterError
        If an argument is out of range or nan, or neither cake nor medium resists; so do all functions here.

    Notes
    -----
    On the slurry basis, the paper's, the slurry's whole volume counts as filtrate (see the module's docstring): an area
    smaller by at most ``c / (rho (1 - eps))`` would do. A drum of :func:`on_filtrate_basis` has that area.
    """
    # ASSUME: on the slurry basis, filtrate volume = slurry volume; model_warnings says where that misleads
    return np.asarray(require("slurry_flow", slurry_flow, "m3/s", POSITIVE) * _area_per_flow(drum, resistance))


def capacity(drum: DrumFilter, resistance: ArrayLike, filter_area: ArrayLike) -> FloatArray:
    """Slurry flow that a filter area (m2) can take, m3/s: the inverse of :func:`area`."""
    return np.asarray(require("filter_area", filter_area, "m2", POSITIVE) / _area_per_flow(drum, resistance))


def cake_mass_per_area(drum: DrumFilter, resistance: ArrayLike) -> FloatArray:
    """Cake mass per area and revolution, ``w = c V / (n A)``, kg/m2, on a drum of the area of eq. 10.

    It follows from the cake's resistance (m/kg) alone: area and flow are proportional.
    """
    return np.asarray(drum.slurry_concentration / (drum.rotation_rate * _area_per_flow(drum, resistance)))


def cake_thickness(drum: DrumFilter, resistance: ArrayLike, porosity: ArrayLike, density: ArrayLike) -> FloatArray:
    """Thickness of the cake that leaves the drum, ``w / (rho (1 - eps))``, m.

    Resistance (m/kg), porosity (0 to 1) and crystal density (kg/m3) broadcast against each other.

    Raises
    ------
    FilterError
        If an argument is out of range or nan, or the slurry holds as many crystals as the cake.
    """
    return np.asarray(cake_mass_per_area(drum, resistance) / _cake_density(drum, porosity, density))


def medium_share(drum: DrumFilter, resistance: ArrayLike) -> FloatArray:
    """Share of the medium in the overall resistance, ``Rm / (Rm + alpha w / 2)`` (paper, section 4.2).

    The cake counts with half its final mass w, its mean while the cake grows at constant pressure. The share is also
    the area the medium alone would need over the area needed.
    """
    cake = 0.5 * np.asarray(resistance, dtype=np.float64) * cake_mass_per_area(drum, resistance)
    return np.asarray(drum.medium_resistance / (drum.medium_resistance + cake))


def resistance_for_cake_share(drum: DrumFilter, share: ArrayLike) -> FloatArray:
    """Specific cake resistance at which the cake holds a share (in [0, 1)) of the overall resistance, m/kg.

    With ``s`` the share, eq. 10 and :func:`medium_share` give ``alpha = 2 mu n Rm^2 s / (dP f c (1 - s)^2)``.

    Raises
    ------
    FilterError
        If the share is out of range or nan, or the medium has no resistance (the cake then always holds all).
    """
    if np.any(np.equal(drum.medium_resistance, 0.0)):
        raise FilterError("medium_resistance = 0 1/m: must be positive, or the cake holds all of the resistance")
    s = require("share", share, "", SHARE)
    resisting = 2.0 * drum.filtrate_per_slurry * drum.viscosity * drum.rotation_rate * drum.medium_resistance**2
    driving = drum.pressure_drop * drum.submerged_fraction * drum.slurry_concentration
    return np.asarray(resisting / driving * s / (1.0 - s) ** 2)


def filtrate_velocity(drum: DrumFilter, resistance: ArrayLike) -> FloatArray:
    """Superficial velocity of the filtrate while submerged, mean over the time, ``phi V / (f A)``, m/s."""
    return np.asarray(drum.filtrate_per_slurry / (drum.submerged_fraction * _area_per_flow(drum, resistance)))


def particle_reynolds(
    drum: DrumFilter,
    resistance: ArrayLike,
    porosity: ArrayLike,
    sauter_mean: ArrayLike,
    liquid_density: float = WATER_DENSITY,
) -> FloatArray:
    """Particle Reynolds number of the flow through the cake, ``rho_l u d32 / (mu (1 - eps))`` (packed-bed form).

    The resistance (m/kg) sets the velocity u of :func:`filtrate_velocity`; porosity in (0, 1), Sauter mean diameter d32
    (six over the crystals' specific surface) in m, density rho_l of the filtrate in kg/m3.
    """
    size = require("sauter_mean", sauter_mean, "m", POSITIVE)
    solids = 1.0 - require("porosity", porosity, "", FRACTION)
    momentum = require("liquid_density", liquid_density, "kg/m3", POSITIVE) * filtrate_velocity(drum, resistance)
    return np.asarray(momentum * size / (drum.viscosity * solids))


def model_warnings(drum: DrumFilter, cake: Cake, liquid_density: float = WATER_DENSITY) -> list[str]:
    """Warnings where filter or model leave their range; empty where none do or no cake is known.

    The density of the filtrate is in kg/m3.

    Raises
    ------
    FilterError
        If that is not positive, neither cake nor medium resists, or the slurry holds as many crystals as the cake.
    """
    if not cake.known:
        return []
    found = (
        _thickness_warning(drum, cake),
        _layers_warning(drum, cake),
        _reynolds_warning(drum, cake, liquid_density),
        _slurry_warning(drum, cake),
        forming_warning(drum, cake.resistance, cake.porosity, cake.density),
    )
    return [text for text in found if text is not None]


def forming_warning(drum: DrumFilter, resistance: float, porosity: float, density: float) -> str | None:
    """Warn of a slurry too slow for any continuous filter, drum or belt; None where it is not.

    Specific cake resistance in m/kg, crystal density in kg/m3.

    Raises
    ------
    FilterError
        If an argument is out of range.
    """
    solids = 1.0 - require("porosity", porosity, "", FRACTION)
    mass = FORMING_THICKNESS * solids * require("density", density, "kg/m3", POSITIVE)
    seconds = float(forming_time(drum, resistance, mass))
    if seconds <= LONGEST_FORMING:
        return None
    return (
        f"{FORMING_THICKNESS / _MILLIMETRE:g} mm of cake take {duration(seconds)} to form: over "
        f"{duration(LONGEST_FORMING)} no continuous filter should be tried; take a batch filter"
    )


def design_table(
    drum: DrumFilter, cakes: Sequence[Cake], slurry_flow: ArrayLike, liquid_density: float = WATER_DENSITY
) -> pd.DataFrame:
    """Tabulate the filter that each of n cakes needs; a cake that is not known gives a row of nan.

    Parameters
    ----------
    drum : DrumFilter
        The filter.
    cakes : sequence of Cake
        One per row.
    slurry_flow : array_like, scalar or shape (n,)
        Slurry flow, m3/s.
    liquid_density : float
        Density of the filtrate, kg/m3.

    Returns
    -------
    DataFrame
        The columns of ``DESIGN_COLUMNS``, n rows; warnings are joined by ``"; "``, empty where there is none.

    Raises
    ------
    FilterError
        As :func:`area` and :func:`cake_thickness`; or if the flows are neither one nor n.
    """
    import pandas as pd  # who sizes one filter needs no table

    flows = require("slurry_flow", slurry_flow, "m3/s", POSITIVE)
    if flows.shape not in ((), (len(cakes),)):
        raise FilterError(f"slurry_flow has shape {flows.shape}: must be one number or one per cake ({len(cakes)})")
    each = np.broadcast_to(flows, len(cakes))
    rows = [_design_row(drum, cake, float(flow), liquid_density) for cake, flow in zip(cakes, each, strict=True)]
    return pd.DataFrame(rows, columns=list(DESIGN_COLUMNS))


def _design_row(drum: DrumFilter, cake: Cake, slurry_flow: float, liquid_density: float) -> tuple[float | str, ...]:
    if not cake.known:
        return (*(math.nan,) * (len(DESIGN_COLUMNS) - 1), "")
    alpha = cake.resistance
    return (
        float(area(drum, alpha, slurry_flow)),
        float(medium_share(drum, alpha)),
        float(cake_mass_per_area(drum, alpha)),
        float(cake_thickness(drum, alpha, cake.porosity, cake.density)) / _MILLIMETRE,
        float(filtrate_velocity(drum, alpha)) / _MILLIMETRE,
        float(particle_reynolds(drum, alpha, cake.porosity, cake.sauter_mean, liquid_density)),
        "; ".join(model_warnings(drum, cake, liquid_density)),
    )


def _thickness_warning(drum: DrumFilter, cake: Cake) -> str | None:
    thickness = float(cake_thickness(drum, cake.resistance, cake.porosity, cake.density))
    says = f"the cake is {thickness / _MILLIMETRE:.3g} mm thick"
    if thickness < MINIMUM_THICKNESS:
        return f"{says}: under {MINIMUM_THICKNESS / _MILLIMETRE:g} mm it is hard to discharge (a slower drum helps)"
    if thickness > MAXIMUM_THICKNESS:
        return f"{says}: over {MAXIMUM_THICKNESS / _MILLIMETRE:g} mm is unusual on a drum (a faster one helps)"
    return None


def _layers_warning(drum: DrumFilter, cake: Cake) -> str | None:
    layers = float(cake_thickness(drum, cake.resistance, cake.porosity, cake.density)) / cake.largest
    if layers >= MINIMUM_LAYERS:
        return None
    return (
        f"the cake is {layers:.3g} times as thick as its largest crystals ({cake.largest / MICROMETRE:.4g} um): "
        f"under {MINIMUM_LAYERS:g} times it is no packed bed, and the porosity of one does not hold"
    )


def _reynolds_warning(drum: DrumFilter, cake: Cake, liquid_density: float) -> str | None:
    reynolds = float(particle_reynolds(drum, cake.resistance, cake.porosity, cake.sauter_mean, liquid_density))
    if reynolds <= MAXIMUM_REYNOLDS:
        return None
    velocity = float(filtrate_velocity(drum, cake.resistance)) / _MILLIMETRE
    return (
        f"the particle Reynolds number is {reynolds:.3g} (filtrate at {velocity:.3g} mm/s): over "
        f"{MAXIMUM_REYNOLDS:g} the flow leaves Darcy's law; inertia adds about "
        f"{_ERGUN_INERTIAL / _ERGUN_VISCOUS * reynolds:.0%} to the cake's resistance"
    )


def _slurry_warning(drum: DrumFilter, cake: Cake) -> str | None:
    share = float(drum.slurry_concentration / _cake_density(drum, cake.porosity, cake.density))
    if share <= MAXIMUM_CAKE_VOLUME or drum.filtrate_per_slurry < 1.0:
        return None
    return (
        f"{share:.3g} of the slurry's volume stays in the cake (slurry of {drum.slurry_concentration:.4g} kg/m3): over "
        f"{MAXIMUM_CAKE_VOLUME:g} the area is clearly too large, since eq. 10 counts all slurry as filtrate"
    )


def _area_per_flow(drum: DrumFilter, resistance: ArrayLike) -> FloatArray:
    """Area per slurry flow, s/m: the stable form of eq. 10 in the module's docstring."""
    alpha = require("resistance", resistance, "m/kg", NOT_NEGATIVE)
    if np.any(np.equal(drum.medium_resistance, 0.0) & (alpha == 0.0)):
        raise FilterError("resistance = 0 m/kg: must be positive where medium_resistance = 0 1/m (nothing resists)")
    driving = 2.0 * drum.pressure_drop * drum.submerged_fraction
    viscosity = drum.filtrate_per_slurry * drum.viscosity
    medium = viscosity * drum.medium_resistance / driving
    cake = viscosity * drum.slurry_concentration * alpha / (driving * drum.rotation_rate)
    return np.asarray(np.hypot(np.sqrt(cake), medium) + medium)


def _cake_density(drum: DrumFilter, porosity: ArrayLike, density: ArrayLike) -> FloatArray:
    """Crystals per volume of cake, kg/m3; refused where the slurry has no liquid to spare."""
    solids = 1.0 - require("porosity", porosity, "", FRACTION)
    dense = np.asarray(require("density", density, "kg/m3", POSITIVE) * solids)
    if (dense <= drum.slurry_concentration).any():
        raise FilterError(
            f"slurry_concentration = {np.max(drum.slurry_concentration):g} kg/m3: must be below the {dense.min():g} "
            "kg/m3 of crystals in the cake, or there is no liquid to filter off"
        )
    return dense
