"""A mixed-suspension mixed-product-removal (MSMPR) crystallizer: from kinetics and residence time to crystal sizes.

Every function is in SI units; sizes are diameters. At steady state the number density of the product is
``b(L) = (B0/G) exp(-L/(G tau))`` (paper eq. 11), so a single length, the size scale ``a = G tau``, sets the whole size
distribution. Nucleation rate B0 and growth rate G follow from the kinetics (eqs. 13, 16) and the mass balance (eq. 14).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from filtercake.crystals.csd import MOST_CLASSES, CrystalSizeDistribution, discretise
from filtercake.errors import ConfigError, CrystallizerError, Problem, did_you_mean, shown
from filtercake.units import MICROMETRE, MINUTE, FloatArray
from filtercake.user_files import read_yaml

PRESETS: Final = Path(__file__).with_name("kinetics.yaml")
"""The kinetics that come with the package."""

NUCLEATION_UNITS: Final[dict[str, float]] = {"B0 #/(L s), MT g/L, G m/s": 1e3, "B0 #/(m3 s), MT kg/m3, G m/s": 1.0}
"""Units a nucleation coefficient may be published in, as factors to SI; g/L and kg/m3 are the same number."""

BIN_WIDTH: Final = 5.0 * MICROMETRE
"""Wanted width of a size class, m (paper section 3.1)."""

UPPER_SCALES: Final = 15.0
"""Largest size considered, in size scales: all but 2e-4 of the crystal volume is below it."""

LARGEST_LOGARITHM: Final = 690.0
"""Natural logarithms beyond this do not fit a floating-point number."""

T = TypeVar("T")


@dataclass(frozen=True)
class Kinetics:
    """Nucleation kinetics ``B0 = K_R MT^j G^i`` of a crystal system (paper eqs. 13, 16).

    Attributes
    ----------
    name : str
        Name of the system.
    nucleation_coefficient : float
        K_R as published, in the units that ``units`` names; positive.
    units : str
        A key of :data:`NUCLEATION_UNITS`.
    slurry_concentration_exponent : float
        Exponent j of the slurry concentration MT.
    growth_rate_exponent : float
        Exponent i of the growth rate G; above -3.
    shape_factor : float
        Volume shape factor kv, crystal volume over size cubed; positive.
    density : float
        Crystal density, kg/m3; positive.
    source : str
        Source of the values.
    residence_time_range : tuple of float or None
        Shortest and longest residence time the kinetics are meant for, s; None where the source states none.

    Raises
    ------
    CrystallizerError
        If a value is not allowed.
    """

    name: str
    nucleation_coefficient: float
    units: str
    slurry_concentration_exponent: float
    growth_rate_exponent: float
    shape_factor: float
    density: float
    source: str
    residence_time_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Check every value, so that no steady state is ever computed from a bad one."""
        for attribute, check in _CHECKS.items():
            value = _checked(f"kinetics {self.name}: {attribute}", getattr(self, attribute), check)
            object.__setattr__(self, attribute, value)

    @property
    def nucleation_factor(self) -> float:
        """Factor from the published nucleation coefficient to SI."""
        return NUCLEATION_UNITS[self.units]

    def covers(self, residence_time_s: float) -> bool:
        """Whether a residence time (s) is in the stated range; True where none is stated."""
        if self.residence_time_range is None:
            return True
        shortest, longest = self.residence_time_range
        return shortest <= residence_time_s <= longest


@dataclass(frozen=True)
class SteadyState:
    """An MSMPR crystallizer at steady state.

    Attributes
    ----------
    growth_rate : float
        G, m/s.
    nucleation_rate : float
        B0, #/(m3 s).
    size_scale : float
        G tau, m: the one length of the size distribution.
    residence_time : float
        tau, s.
    slurry_concentration : float
        MT, crystal mass per slurry volume, kg/m3.
    kinetics : str
        Name of the kinetics.
    """

    growth_rate: float
    nucleation_rate: float
    size_scale: float
    residence_time: float
    slurry_concentration: float
    kinetics: str

    @property
    def number_mean(self) -> float:
        """Number mean size d10, m: ``G tau``."""
        return self.size_scale

    @property
    def sauter_mean(self) -> float:
        """Sauter mean size d32, m: ``3 G tau``."""
        return 3.0 * self.size_scale

    @property
    def volume_mean(self) -> float:
        """Volume mean size d43, m: ``4 G tau``."""
        return 4.0 * self.size_scale


def steady_state(kinetics: Kinetics, residence_time_s: float, slurry_concentration_kg_m3: float) -> SteadyState:
    """Solve for the growth and nucleation rates at a residence time and slurry concentration.

    The mass balance ``MT = 6 kv rho B0 G^3 tau^4`` (paper eq. 14) and the kinetics ``B0 = K_R MT^j G^i`` (eqs. 13, 16)
    combine to ``G^(i+3) = MT^(1-j) / (6 kv rho K_R tau^4)``: a closed form for every i and j, so nothing is iterated.

    Parameters
    ----------
    kinetics : Kinetics
        Nucleation kinetics, shape factor and density of the crystals.
    residence_time_s : float
        Residence time tau, s.
    slurry_concentration_kg_m3 : float
        Slurry concentration MT, kg of crystals per m3 of slurry (g/L is the same number).

    Raises
    ------
    CrystallizerError
        If a value is not positive and finite, or a rate or size is beyond the range of floating-point numbers.
    """
    residence_time = _checked("residence_time_s", residence_time_s, _positive)
    slurry_concentration = _checked("slurry_concentration_kg_m3", slurry_concentration_kg_m3, _positive)
    i, j = kinetics.growth_rate_exponent, kinetics.slurry_concentration_exponent
    # logarithms, because tau^4 and K_R leave the range of floats long before G does
    log_tau, log_mt = math.log(residence_time), math.log(slurry_concentration)
    log_k = math.log(kinetics.nucleation_coefficient) + math.log(kinetics.nucleation_factor)
    log_balance = math.log(6.0) + math.log(kinetics.shape_factor) + math.log(kinetics.density)
    log_growth = ((1.0 - j) * log_mt - log_balance - log_k - 4.0 * log_tau) / (i + 3.0)
    growth_rate, nucleation_rate, size_scale = (
        _exponential(what, logarithm, kinetics)
        for what, logarithm in (
            ("growth rate (m/s)", log_growth),
            ("nucleation rate (#/(m3 s))", log_k + j * log_mt + i * log_growth),
            ("size scale (m)", log_growth + log_tau),
        )
    )
    return SteadyState(growth_rate, nucleation_rate, size_scale, residence_time, slurry_concentration, kinetics.name)


def volume_density(state: SteadyState, size: ArrayLike) -> FloatArray:
    """Evaluate the volume (= mass) density w(L), 1/m: ``L^3 exp(-L/a) / (6 a^4)`` with ``a = G tau``.

    Sizes L in m, of any shape; a negative one or one that is not finite raises a CrystallizerError.
    """
    scaled = _sizes(size) / state.size_scale
    return np.asarray(scaled**3 * np.exp(-scaled) / (6.0 * state.size_scale))


def cumulative_volume(size_scale: float, size: ArrayLike) -> FloatArray:
    """Volume fraction of crystals smaller than L: the regularised incomplete gamma function ``P(4, L/(G tau))``.

    Size scale G tau and sizes L in m; a size scale that is not positive and finite, or a size that is negative or not
    finite, raises a CrystallizerError.
    """
    from scipy import special

    return np.asarray(special.gammainc(4.0, _sizes(size) / _checked("size_scale", size_scale, _positive)))


def cumulative_sums(size_scale: float, size: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Sum x/d (1/m) and x/d^2 (1/m2) over the crystals smaller than L.

    The integrals of w/L and w/L^2 up to L are ``P(3, L/a)/(3 a)`` and ``P(2, L/a)/(6 a^2)`` with ``a = G tau``.

    Arguments and errors as of :func:`cumulative_volume`.
    """
    from scipy import special

    a = _checked("size_scale", size_scale, _positive)
    scaled = _sizes(size) / a
    first, second = (special.gammainc(order, scaled) for order in (3.0, 2.0))
    return np.asarray(first / (3.0 * a)), np.asarray(second / (6.0 * a**2))


def crystal_size_distribution(size_scale: float, bin_width: float = BIN_WIDTH) -> CrystalSizeDistribution:
    """Cut the product of size scale G tau (m) into size classes of about ``bin_width`` (m; paper section 3.1, Fig 5).

    Every class adds to the sums of x/d and x/d^2 what its crystals do, not what as many at its centre would: that would
    be 0.5 % more resistance for the paper's alum. The width used divides the largest size into a whole number of
    classes.

    Raises
    ------
    CrystallizerError
        If a value is not positive and finite, or asks for more than :data:`MOST_CLASSES` classes.
    CsdError
        If a class is wider than the largest size.
    """
    upper = _checked("size_scale", size_scale, _positive) * UPPER_SCALES
    width = _checked("bin_width", bin_width, _positive)
    if upper > MOST_CLASSES * width:
        raise CrystallizerError(
            f"size_scale = {size_scale:g} m: cannot be cut into classes of {width:g} m up to {upper:g} m; "
            f"at most {MOST_CLASSES} classes are allowed"
        )
    return discretise(
        lambda size: cumulative_volume(size_scale, size),
        upper,
        width,
        lambda size: cumulative_sums(size_scale, size),
    )


def load_kinetics(path: Path | None = None) -> dict[str, Kinetics]:
    """Read kinetics by name from a YAML file.

    Parameters
    ----------
    path : Path or None
        A file with the keys of the package's own ``kinetics.yaml``, which is read if None.

    Raises
    ------
    CrystallizerError
        With every problem: file, key, value and what is allowed.
    """
    file = PRESETS if path is None else path
    entries = _read_mapping(file)
    problems: list[Problem] = []
    kinetics: dict[str, Kinetics] = {}
    for name, entry in entries.items():
        values, found = _read_entry(name, entry, str(file))
        problems += found
        if not found:
            kinetics[name] = Kinetics(name=name, **values)
    if problems:
        raise CrystallizerError("\n".join(str(problem) for problem in problems))
    return kinetics


def get_kinetics(name: str, extra: Mapping[str, Kinetics] | None = None) -> Kinetics:
    """Look kinetics up by name, first in ``extra``, then among the presets.

    Raises
    ------
    CrystallizerError
        If there are none of that name.
    """
    known = {**load_kinetics(), **(extra or {})}
    if name not in known:
        raise CrystallizerError(f"kinetics = {_shown(name)}: {_unknown('kinetics', name, sorted(known))}")
    return known[name]


def _exponential(what: str, logarithm: float, kinetics: Kinetics) -> float:
    if not abs(logarithm) < LARGEST_LOGARITHM:
        raise CrystallizerError(
            f"kinetics {kinetics.name}: the {what} would be 10^{logarithm / math.log(10.0):.0f}, beyond the range of "
            f"numbers; check nucleation_coefficient = {kinetics.nucleation_coefficient:g} and its units "
            f"({kinetics.units}), the exponents, the residence time and the slurry concentration"
        )
    return math.exp(logarithm)


def _sizes(size: ArrayLike) -> FloatArray:
    sizes = np.asarray(size, dtype=np.float64)
    allowed = np.isfinite(sizes) & (sizes >= 0.0)
    if not allowed.all():
        raise CrystallizerError(f"size = {sizes[~allowed].flat[0]:g}: must be finite and not negative, in m")
    return sizes


def _checked(name: str, value: Any, check: Callable[[Any], T]) -> T:
    """Check a value; the error names it."""
    try:
        return check(value)
    except ValueError as error:
        raise CrystallizerError(f"{name} = {_shown(value)}: {error}") from None


def _as_number(value: Any) -> float:
    """Accept what YAML 1.1 reads as text (9e16) as well; NaN for what is no number."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str, np.integer, np.floating)):
        return math.nan
    try:
        return float(value)
    except (ValueError, OverflowError):
        return math.nan


def _finite(value: Any) -> float:
    number = _as_number(value)
    if not math.isfinite(number):
        raise ValueError("must be a finite number")
    return number


def _positive(value: Any) -> float:
    number = _as_number(value)
    if not 0.0 < number < math.inf:
        raise ValueError("must be a positive and finite number")
    return number


def _above_minus_three(value: Any) -> float:
    number = _as_number(value)
    if not -3.0 < number < math.inf:
        raise ValueError("must be a finite number above -3: G^(i+3) = MT^(1-j) / (6 kv rho K_R tau^4) sets G only then")
    return number


def _known_units(value: Any) -> str:
    if not isinstance(value, str) or value not in NUCLEATION_UNITS:
        raise ValueError(f"allowed: {' or '.join(repr(units) for units in NUCLEATION_UNITS)}")
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ValueError("must be text, not empty")
    return value


def _range(value: Any) -> tuple[float, float] | None:
    if value is None:
        return None
    if not isinstance(value, (list, tuple)) or len(value) != 2:
        raise ValueError("must be the shortest and the longest residence time, e.g. [15, 60], or null")
    shortest, longest = _positive(value[0]), _positive(value[1])
    if not shortest <= longest:
        raise ValueError("the shortest residence time must come first")
    return shortest, longest


_CHECKS: Final[dict[str, Callable[[Any], Any]]] = {
    "name": _text,
    "nucleation_coefficient": _positive,
    "units": _known_units,
    "slurry_concentration_exponent": _finite,
    "growth_rate_exponent": _above_minus_three,
    "shape_factor": _positive,
    "density": _positive,
    "source": _text,
    "residence_time_range": _range,
}
"""Check of each attribute of the kinetics."""

_ATTRIBUTES: Final[dict[str, str]] = {
    "nucleation_coefficient": "nucleation_coefficient",
    "units": "units",
    "slurry_concentration_exponent": "slurry_concentration_exponent",
    "growth_rate_exponent": "growth_rate_exponent",
    "shape_factor": "shape_factor",
    "density_kg_m3": "density",
    "source": "source",
    "residence_time_range_min": "residence_time_range",
}
"""Attribute of the kinetics behind each key of a file."""

_OPTIONAL: Final = frozenset({"residence_time_range_min"})


def _read_mapping(file: Path) -> dict[Any, Any]:
    """Parse a kinetics file down to its entries."""
    try:
        content = read_yaml(file)
    except ConfigError as error:
        raise CrystallizerError("\n".join(f"{file}: {_said(problem)}" for problem in error.problems)) from None
    if not isinstance(content, dict) or not content:
        raise CrystallizerError(f"{file}: holds no kinetics; must be a mapping of names to {', '.join(_ATTRIBUTES)}")
    return content


def _said(problem: Problem) -> str:
    return problem.allowed if problem.key == "(file)" else f"{problem.key}: {problem.allowed}"


def _read_entry(name: Any, entry: Any, file: str) -> tuple[dict[str, Any], list[Problem]]:
    """Attributes of one entry of a kinetics file, and everything that is wrong with it."""
    if not isinstance(name, str) or not name.strip():
        return {}, [Problem(file, "(name)", _shown(name), "must be text; put quotes around it")]
    if not isinstance(entry, dict):
        return {}, [Problem(file, name, _shown(entry), f"must be a mapping with the keys {', '.join(_ATTRIBUTES)}")]
    problems = [
        Problem(file, f"{name}.{key}", _shown(entry[key]), _unknown("key", str(key), _ATTRIBUTES))
        for key in entry
        if key not in _ATTRIBUTES
    ]
    values: dict[str, Any] = {}
    for key, attribute in _ATTRIBUTES.items():
        if key not in entry:
            if key not in _OPTIONAL:
                problems.append(Problem(file, f"{name}.{key}", "(missing)", "must be given"))
            continue
        try:
            values[attribute] = _CHECKS[attribute](entry[key])
        except ValueError as error:
            problems.append(Problem(file, f"{name}.{key}", _shown(entry[key]), str(error)))
    if values.get("residence_time_range"):
        shortest, longest = values["residence_time_range"]
        values["residence_time_range"] = (shortest * MINUTE, longest * MINUTE)
    return values, problems


def _unknown(what: str, word: str, known: Iterable[str]) -> str:
    names = list(known)
    return f"no such {what}; allowed: {', '.join(names)}{did_you_mean(word, names)}"


def _shown(value: Any) -> str:
    return shown(value.item() if isinstance(value, np.generic) else value)
