"""Constant-pressure filtration tests: specific cake resistance, medium resistance and compressibility, with intervals.

Everything is in SI units. At constant pressure, filtrate volume V and time t follow

``t/V = (mu alpha c / (2 A^2 dP)) V + mu Rm / (A dP)`` (integral form) and
``dt/dV = (mu alpha c / (A^2 dP)) V + mu Rm / (A dP)`` (differential form)

with c the dry cake mass per volume of filtrate. Source: B. F. Ruth, Ind. Eng. Chem. 27 (1935) 708 and 806; in any
textbook, e.g. Svarovsky, Solid-Liquid Separation.

Weights
-------
Both forms are fitted to the time itself, t = t0 + b V + a V^2. A reading's error is one of its time (or, times the
slope dt/dV, of its volume), about the same from reading to reading; the quotient t/V then scatters as 1/V, and an
ordinary regression of it would give the early readings, which scatter most, the same say as the late ones. Least
squares of t/V with weights V^2 is least squares of t = b V + a V^2.

Intervals
---------
They are 95 % Student intervals with heteroscedasticity-consistent errors (HC3; MacKinnon & White, J. Econometrics 29
(1985) 305), because it is not known whether times or volumes err. Simulated tests with equal errors of all times are
covered with probability 0.95, on eight readings or fewer 0.96 to 0.99; tests with equal errors of all volumes, which
make errors of the times that grow with V, 0.935 to 0.99, where ordinary errors may give less than 0.90. Errors of
different readings are supposed independent: a slow drift of the pressure is not in the interval, nor is an error of c,
mu, A or dP.

Few readings
------------
Fewer than ``FEWEST_WITH_SCATTER`` readings say nothing of their errors: two determine a line exactly. Then every time
and every volume is taken to err by ``reading_error`` of its value, independently, and the interval is the normal one
(or Student's, where three or four readings scatter more than that).

Which readings are used, and how their errors grow, is the caller's choice: see
:mod:`filtercake.filtration.analysis`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filtercake.errors import FiltrationError
from filtercake.statistics import quantile
from filtercake.units import FloatArray

BoolArray = NDArray[np.bool_]
Form = Literal["integral", "differential"]

MINIMUM_READINGS: Final = 2
"""Readings below which a test is refused: a line needs two."""
WIDEST_SPAN: Final = 1e8
"""Factor by which a reading may differ from the median of its test: no instrument shows more."""

FEWEST_WITH_SCATTER: Final = 5
"""Readings from which their scatter tells their errors: two more than the differential form has unknowns."""

READING_ERROR: Final = 0.02
"""Standard error of a reading of time or volume over its value, where nothing else is known."""

ROUND_OFF: Final = 1e-9
"""One form's result differs from the other's by round-off alone below this share."""

REFERENCE_PRESSURE: Final = 100e3
"""Pressure drop at which a compressible cake's resistance is quoted unless another is asked for, Pa."""

ALL: Final = slice(None)
"""Every reading of a test."""
_POWERS: Final[dict[Form, tuple[int, ...]]] = {"integral": (1, 2), "differential": (0, 1, 2)}
_SLOPE_OVER_CURVATURE: Final[dict[Form, float]] = {"integral": 1.0, "differential": 2.0}
_WORST_CONDITION: Final = 1e9
_MILLILITRE: Final = 1e-6


@dataclass(frozen=True, eq=False)
class FiltrationTest:
    """A filtration test at constant pressure.

    Attributes
    ----------
    name : str
        Its name.
    csd : str
        Name of the crystals' size distribution.
    time : ndarray, shape (n,)
        Times of the readings since the filtration began, s; positive (or 0 without a known zero) and ascending.
    volume : ndarray, shape (n,)
        Volumes of filtrate, m3; positive.
    area : float
        Filter area A, m2.
    pressure_drop : float
        Pressure drop dP across cake and medium, Pa.
    viscosity : float
        Viscosity mu of the filtrate, Pa s.
    solids_per_filtrate : float
        Dry cake mass c per volume of filtrate, kg/m3.
    notes : tuple of str
        Repairs made when the readings were read.
    lines : tuple of int
        Line of each reading in its file; empty where it has none.
    known_zero : bool
        Whether the clock was, as far as anyone knows, started with the filtration.
    reading_error : float
        Relative standard error of a time or volume, for tests of too few readings to tell.

    Raises
    ------
    FiltrationError
        If a value is out of range, or there are fewer than ``MINIMUM_READINGS`` readings.
    """

    name: str
    csd: str
    time: FloatArray
    volume: FloatArray
    area: float
    pressure_drop: float
    viscosity: float
    solids_per_filtrate: float
    notes: tuple[str, ...] = ()
    lines: tuple[int, ...] = ()
    known_zero: bool = True
    reading_error: float = READING_ERROR

    def __post_init__(self) -> None:
        _check_readings(self)
        for key, unit in (
            ("area", "m2"),
            ("pressure_drop", "Pa"),
            ("viscosity", "Pa s"),
            ("solids_per_filtrate", "kg/m3"),
            ("reading_error", ""),
        ):
            value = getattr(self, key)
            if not 0.0 < value < math.inf:
                raise FiltrationError(
                    f"{self.name}: {key} = {value:g} {unit}".rstrip() + ": must be positive and finite"
                )

    def named(self, first: int, last: int) -> str:
        """Name the readings first..last-1 by their lines, or else by their numbers."""
        kind, numbers = ("line", self.lines) if self.lines else ("reading", tuple(range(1, self.time.size + 1)))
        one, other = numbers[first], numbers[last - 1]
        return f"{kind} {one}" if one == other else f"{kind}s {one} to {other}"


@dataclass(frozen=True, eq=False)
class FiltrationFit:
    """What a test says of cake and medium by one of the two forms.

    Half-widths (``*_ci95``) are of 95 % intervals, see the module's docstring.

    Attributes
    ----------
    form : {"integral", "differential"}
        Which.
    resistance, resistance_se, resistance_ci95 : float
        Specific cake resistance alpha, its standard error and the half-width of its interval, m/kg.
    medium_resistance, medium_resistance_se, medium_resistance_ci95 : float
        The same of the medium's resistance Rm, 1/m.
    slope : float
        Of the form's straight line against V, s/m6.
    intercept : float
        Of that line, s/m3.
    n : int
        Readings used.
    dof : float
        Degrees of freedom of the errors; infinite where they are the stated ones.
    kept : ndarray of bool, shape (readings,)
        Which readings were used.
    notes : tuple of str
        What is doubtful.
    time_offset : float
        Time at which the filtration begins, s; in the integral form as it was given.
    covariance : ndarray, shape (3, 3)
        Of time_offset, intercept and slope.
    """

    form: Form
    resistance: float
    resistance_se: float
    resistance_ci95: float
    medium_resistance: float
    medium_resistance_se: float
    medium_resistance_ci95: float
    slope: float
    intercept: float
    n: int
    dof: float
    kept: BoolArray
    notes: tuple[str, ...]
    time_offset: float
    covariance: FloatArray

    @property
    def left_out(self) -> int:
        """Number of readings that were left out."""
        return int(self.kept.size - self.n)

    def time_per_volume(self, volume: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the fitted t/V at given volumes and the half-width of its 95 % interval, both s/m3.

        Parameters
        ----------
        volume : array_like, shape (m,)
            Volumes of filtrate, m3, positive.
        """
        v = np.atleast_1d(np.asarray(volume, dtype=np.float64))
        rows = np.stack([1.0 / v, np.ones_like(v), v / _SLOPE_OVER_CURVATURE[self.form]], axis=1)
        line = rows @ np.array([self.time_offset, self.intercept, self.slope])
        variance = np.einsum("ij,jk,ik->i", rows, self.covariance, rows)
        # round-off may leave a variance of nothing a little below it
        return np.asarray(line), np.asarray(quantile(self.dof) * np.sqrt(np.maximum(variance, 0.0)))


def fit_integral(
    test: FiltrationTest, used: slice = ALL, *, time_zero: float = 0.0, growth: float = 0.0
) -> FiltrationFit:
    """Fit the integral form: t/V against V with weights V^2, i.e. t = b V + a V^2.

    Parameters
    ----------
    test : FiltrationTest
        The test.
    used : slice
        The readings to use.
    time_zero : float
        Time of the clock at which the filtration began, s.
    growth : float
        The standard deviation of a time's error grows with V to this power.

    Raises
    ------
    FiltrationError
        If the volumes hardly differ, or the resistance is not positive.
    """
    return _fit(test, "integral", used, time_zero, growth)


def fit_differential(test: FiltrationTest, used: slice = ALL, *, growth: float = 0.0) -> FiltrationFit:
    """Fit the differential form, dt/dV against V, in the way that knows how differences of readings err.

    The difference quotient of two readings is the derivative at their mean volume, exactly. Neighbouring quotients
    share a reading, so that their errors are correlated, and an ordinary regression of them is inefficient and its
    intervals are wrong. With D the matrix that takes differences, the errors of D t have the covariance D D^T; the
    generalised least squares with it is the ordinary fit of t = t0 + b V + a V^2 with t0 free, because D takes away
    a constant and nothing else. That is what is fitted. The result does not depend on when the clock was started.

    Parameters
    ----------
    test, used, growth
        As for :func:`fit_integral`.

    Raises
    ------
    FiltrationError
        If the volumes hardly differ, or the resistance is not positive.
    """
    return _fit(test, "differential", used, 0.0, growth)


def disagreement(integral: FiltrationFit, differential: FiltrationFit) -> str | None:
    """Say where the two forms differ by more than their 95 % intervals, added in quadrature; None where they agree.

    The intervals are taken as independent. They are not quite, since both forms see the same readings: a
    disagreement is then the more remarkable.
    """
    found = []
    for what, unit, name in (("cake", "m/kg", "resistance"), ("medium", "1/m", "medium_resistance")):
        one, other = getattr(integral, name), getattr(differential, name)
        allowed = math.hypot(getattr(integral, f"{name}_ci95"), getattr(differential, f"{name}_ci95"))
        if abs(one - other) > max(allowed, ROUND_OFF * max(abs(one), abs(other))):
            found.append(f"{what} {one:.4g} and {other:.4g} {unit} (95 % limit of the difference {allowed:.2g})")
    if not found:
        return None
    return (
        f"integral and differential form disagree: {', '.join(found)}; the differential form puts the beginning at "
        f"{differential.time_offset:.3g} s: the time zero or the start-up is doubtful"
    )


@dataclass(frozen=True, eq=False)
class CompressibilityFit:
    """How a cake's resistance grows with pressure: ``alpha = alpha0 (dP / reference_pressure)^exponent``.

    Attributes
    ----------
    reference_pressure : float
        Pressure drop that alpha0 belongs to, Pa.
    alpha0, alpha0_low, alpha0_high : float
        Specific resistance there and its 95 % interval, m/kg.
    exponent, exponent_ci95 : float
        The compressibility exponent k and the half-width of its 95 % interval.
    n : int
        Points.
    notes : tuple of str
        What is doubtful.
    squares : ndarray, shape (2, 2)
        Covariance of ln(alpha0) and k times the square of the interval's quantile; nan where there is no interval.
    """

    reference_pressure: float
    alpha0: float
    alpha0_low: float
    alpha0_high: float
    exponent: float
    exponent_ci95: float
    n: int
    notes: tuple[str, ...]
    squares: FloatArray = field(repr=False)

    def resistance_at(self, pressure_drop: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the fitted resistance at a pressure drop (Pa) and both ends of its 95 % interval, m/kg.

        The interval is of the fitted line, not of a further test.

        Raises
        ------
        FiltrationError
            If a pressure is not positive.
        """
        pressure = _positive("pressure_drop", pressure_drop, "Pa")
        x = np.log(pressure / self.reference_pressure)
        value = self.alpha0 * np.exp(self.exponent * x)
        factor = np.exp(np.sqrt(self.squares[0, 0] + x * (2.0 * self.squares[0, 1] + x * self.squares[1, 1])))
        return np.asarray(value), np.asarray(value / factor), np.asarray(value * factor)


def compressibility(
    pressure_drop: ArrayLike,
    resistance: ArrayLike,
    relative_se: ArrayLike | None = None,
    reference_pressure: float = REFERENCE_PRESSURE,
) -> CompressibilityFit:
    """Fit ln(alpha) = ln(alpha0) + k ln(dP / reference_pressure).

    The 95 % interval is the larger of two: the one that the points' own errors give (normal), and the one that their
    spread about the line gives (Student, n - 2 degrees of freedom). The first knows nothing of what differs from run
    to run, the second little of anything when points are few.

    Parameters
    ----------
    pressure_drop : array_like, shape (n,)
        Pressure drops, Pa.
    resistance : array_like, shape (n,)
        Specific cake resistances, m/kg.
    relative_se : array_like, shape (n,) or scalar, optional
        Standard errors of the resistances over their values; weights 1/relative_se^2. All alike if left out.
    reference_pressure : float
        Pressure drop to quote alpha0 at, Pa.

    Raises
    ------
    FiltrationError
        If a number is not positive, the shapes differ, or there are fewer than two different pressures.
    """
    pressure = np.atleast_1d(_positive("pressure_drop", pressure_drop, "Pa"))
    alpha = np.atleast_1d(_positive("resistance", resistance, "m/kg"))
    reference = float(_positive("reference_pressure", reference_pressure, "Pa"))
    if pressure.shape != alpha.shape or pressure.ndim != 1:
        raise FiltrationError(f"{pressure.size} pressures but {alpha.size} resistances: must be one each")
    pressures = np.unique(pressure)
    if pressures.size < 2 or math.log(pressures[-1] / pressures[0]) < ROUND_OFF:
        raise FiltrationError("a compressibility needs resistances at two different pressures, better three or more")
    error = None if relative_se is None else _errors(relative_se, alpha.size)
    (ln_alpha0, exponent), squares = _power_law(np.log(pressure / reference), np.log(alpha), error)
    half = np.sqrt(np.diag(squares))
    alpha0 = math.exp(ln_alpha0)
    return CompressibilityFit(
        reference_pressure=reference,
        alpha0=alpha0,
        alpha0_low=alpha0 * math.exp(-half[0]),
        alpha0_high=alpha0 * math.exp(half[0]),
        exponent=float(exponent),
        exponent_ci95=float(half[1]),
        n=alpha.size,
        notes=_power_law_notes(alpha.size, pressures.size),
        squares=squares,
    )


def _power_law(x: FloatArray, y: FloatArray, error: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    """Intercept and slope of a weighted line, and their covariance times the squared quantile of the interval."""
    weight = np.ones_like(x) if error is None else 1.0 / error
    centre = float(np.average(x, weights=weight**2))  # uncorrelated there; moved to x = 0 afterwards
    design = np.stack([np.ones_like(x), x - centre], axis=1) * weight[:, None]
    squared = np.sum(design**2, axis=0)
    level, slope = (design.T @ (y * weight)) / squared
    dof = x.size - 2
    quantile2 = math.nan
    if dof > 0:
        spread2 = float(np.sum((y * weight - design @ np.array([level, slope])) ** 2)) / dof
        quantile2 = spread2 * quantile(dof) ** 2
        if error is not None:
            quantile2 = max(quantile2, quantile() ** 2)
    at_centre = np.diag(quantile2 / squared) if dof > 0 else np.full((2, 2), math.nan)
    move = np.array([[1.0, -centre], [0.0, 1.0]])
    return move @ np.array([level, slope]), np.asarray(move @ at_centre @ move.T)


def _power_law_notes(points: int, pressures: int) -> tuple[str, ...]:
    if points == 2:
        return ("two points determine the exponent without an interval; measure at a third pressure",)
    if pressures == 2:
        return ("with two pressures nothing tells whether a power law holds; measure at a third one",)
    return ()


def _fit(test: FiltrationTest, form: Form, used: slice, time_zero: float, growth: float) -> FiltrationFit:
    powers, largest, longest = np.array(_POWERS[form]), float(test.volume.max()), float(test.time.max())
    kept = np.zeros(test.time.size, dtype=np.bool_)
    kept[used] = True
    volume, time = test.volume[kept] / largest, (test.time[kept] - time_zero) / longest
    design = volume[:, None] ** powers
    _require_spread(test.name, design, form)
    if time.size < FEWEST_WITH_SCATTER:
        scaled, covariance, dof = _with_stated_errors(design, time, volume, test.reading_error)
    else:
        scaled, covariance = _least_squares(design, time, volume**-growth)
        dof = float(time.size - powers.size)
    # t0, b and a of t = t0 + b V + a V^2; t0 is given in the integral form; the differential form's slope is 2 a
    scale = longest / largest**powers
    scale[-1] *= _SLOPE_OVER_CURVATURE[form]
    whole, errors = np.array([time_zero, 0.0, 0.0]), np.zeros((3, 3))
    whole[-powers.size :] = scaled * scale
    errors[-powers.size :, -powers.size :] = covariance * np.outer(scale, scale)
    return _result(test, form, kept, whole, errors, dof)


def _result(
    test: FiltrationTest, form: Form, kept: BoolArray, coefficients: FloatArray, covariance: FloatArray, dof: float
) -> FiltrationFit:
    """Turn the form's line into resistances and say what is doubtful about them."""
    offset, intercept, slope = (float(value) for value in coefficients)
    driving = test.area * test.pressure_drop / test.viscosity
    per_slope = 2.0 * driving * test.area / (test.solids_per_filtrate * _SLOPE_OVER_CURVATURE[form])
    alpha, medium = slope * per_slope, intercept * driving
    _, medium_se, alpha_se = np.sqrt(np.diag(covariance)) * [1.0, driving, per_slope]
    n = int(kept.sum())
    if not alpha > 0.0:
        raise FiltrationError(
            f"{test.name}: the {form} form gives a cake resistance of {alpha:.4g} m/kg: must be positive; the readings "
            "do not slow down as a growing cake makes them (is the test long enough, is the pressure constant?)"
        )
    alpha_ci, medium_ci = float(quantile(dof) * alpha_se), float(quantile(dof) * medium_se)
    return FiltrationFit(
        form=form,
        resistance=alpha,
        resistance_se=float(alpha_se),
        resistance_ci95=alpha_ci,
        medium_resistance=medium,
        medium_resistance_se=float(medium_se),
        medium_resistance_ci95=medium_ci,
        slope=slope,
        intercept=intercept,
        n=n,
        dof=dof,
        kept=kept,
        notes=_doubts(alpha, alpha_ci, medium, medium_ci),
        time_offset=offset,
        covariance=covariance,
    )


def _doubts(alpha: float, alpha_ci: float, medium: float, medium_ci: float) -> tuple[str, ...]:
    notes = []
    if alpha <= alpha_ci:
        notes.append(f"the cake resistance, {alpha:.3g} ± {alpha_ci:.2g} m/kg, is not told from zero")
    if medium < 0.0:
        value = f"the medium resistance is negative, {medium:.3g} ± {medium_ci:.2g} 1/m"
        within = medium + medium_ci >= 0.0
        notes.append(f"{value}: {'not told from zero' if within else 'the start-up or the time zero is doubtful'}")
    return tuple(notes)


def _least_squares(design: FloatArray, time: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients (p,) and their HC3 covariance (p, p)."""
    q, r = np.linalg.qr(design * weight[:, None])
    inverse = np.linalg.inv(r)
    coefficients = inverse @ (q.T @ (time * weight))
    residual = (time - design @ coefficients) * weight
    free = 1.0 - np.sum(q**2, axis=1)
    common = float(residual @ residual) / (time.size - design.shape[1])
    # a reading that alone decides a coefficient has no residual: it errs like the others
    alone = free < 1e-6
    variance = np.where(alone, common, (residual / np.where(alone, 1.0, free)) ** 2)
    return np.asarray(coefficients), np.asarray(inverse @ (q.T * variance) @ q @ inverse.T)


def _with_stated_errors(
    design: FloatArray, time: FloatArray, volume: FloatArray, error: float
) -> tuple[FloatArray, FloatArray, float]:
    """Coefficients, their covariance and its degrees of freedom where readings are too few to tell their errors.

    An error of the volume is one of the time, times the slope dt/dV.
    """
    first = np.linalg.lstsq(design, time, rcond=None)[0]
    powers = np.arange(3 - design.shape[1], 3)
    slope = np.where(powers > 0, powers * volume[:, None] ** np.maximum(powers - 1, 0), 0.0) @ first
    sd = error * np.hypot(time, volume * slope)
    q, r = np.linalg.qr(design / sd[:, None])
    inverse = np.linalg.inv(r)
    coefficients = inverse @ (q.T @ (time / sd))
    dof = time.size - design.shape[1]
    squares = float(np.sum(((time - design @ coefficients) / sd) ** 2))
    if dof > 0 and squares > dof:  # they scatter more than was stated
        return coefficients, inverse @ inverse.T * squares / dof, float(dof)
    return coefficients, inverse @ inverse.T, math.inf


def _check_readings(test: FiltrationTest) -> None:
    if test.time.ndim != 1 or test.time.shape != test.volume.shape:
        raise FiltrationError(f"{test.name}: {test.time.size} times but {test.volume.size} volumes: must be one each")
    if test.time.size < MINIMUM_READINGS:
        raise FiltrationError(f"{test.name}: {test.time.size} readings: must be at least {MINIMUM_READINGS}")
    for key, unit, values in (("time", "s", test.time), ("volume", "m3", test.volume)):
        least = -math.ulp(0.0) if key == "time" and not test.known_zero else 0.0
        bad = ~((values > least) & (values < math.inf))
        if bad.any():
            raise FiltrationError(f"{test.name}: {key} = {values[bad][0]:g} {unit}: must be positive and finite")
        _check_span(test, key, unit, values)
    back = np.flatnonzero(np.diff(test.time) <= 0.0)
    if back.size:
        at, before = test.time[back[0] + 1], test.time[back[0]]
        raise FiltrationError(f"{test.name}: time = {at:g} s after {before:g} s: times must ascend")


def _check_span(test: FiltrationTest, key: str, unit: str, values: FloatArray) -> None:
    """Refuse a reading that no instrument shows beside the others of the same test."""
    positive = values[values > 0.0]
    usual = float(np.median(positive)) if positive.size else 1.0
    shown = np.where(values > 0.0, values, usual)
    odd = np.flatnonzero(np.abs(np.log(shown) - math.log(usual)) > math.log(WIDEST_SPAN))
    if odd.size:
        where = test.named(odd[0], odd[0] + 1)
        raise FiltrationError(
            f"{test.name}: {where}: {key} = {values[odd[0]]:g} {unit} beside {usual:g} {unit} of the others: must be "
            f"within a factor of {WIDEST_SPAN:g}"
        )


def _require_spread(name: str, design: FloatArray, form: Form) -> None:
    """Refuse readings whose volumes hardly differ: they decide no line."""
    if design.shape[0] < design.shape[1] or np.linalg.cond(design) > _WORST_CONDITION:
        raise FiltrationError(
            f"{name}: the volumes of the readings hardly differ, and the {form} form needs them to: leave out what was "
            "read after the filtration ended"
        )


def _errors(relative_se: ArrayLike, size: int) -> FloatArray:
    error = _positive("relative_se", relative_se, "")
    if error.shape not in ((), (size,)):
        raise FiltrationError(f"{error.size} values of relative_se but {size} resistances: must be one each")
    return np.broadcast_to(error, (size,))


def _positive(name: str, value: ArrayLike, unit: str) -> FloatArray:
    values = np.asarray(value, dtype=np.float64)
    bad = ~((values > 0.0) & (values < math.inf))
    if bad.any():
        shown = f"{name} = {np.atleast_1d(values)[np.atleast_1d(bad)][0]:g} {unit}".rstrip()
        raise FiltrationError(f"{shown}: must be positive and finite")
    return values
