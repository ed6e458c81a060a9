"""Cohesion, friction or adhesion from measured resistances: a smooth model of the packings, weighted least squares.

The packings give ln(alpha) at a few values of a parameter, with the noise of a few replicates. A Gaussian process per
cake joins them (a cake is a distribution, at a pressure where its packings know one); the parameters are those at which
all measured ln(alpha) are most likely; intervals come from the profile of the likelihood, so that they hold what the
measurements and the packings leave open.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from filtercake.calibration.pooling import Pool, improbable, pool
from filtercake.calibration.response import Parameter, Responds
from filtercake.errors import CalibrationError
from filtercake.statistics import CONFIDENCE, effective_freedom, likelihood_limit
from filtercake.units import FloatArray, IntArray

GRID = (801, 41)
"""Grid points of the cohesion and, where it is fitted, of the friction."""
ADVISED_FRICTIONS = (0.0, 0.05)
"""What the paper advises for dense and for loose cakes."""
UNITS = {"cohesion_kJ_m3": "kJ/m3", "friction": "", "adhesion_mJ_m2": "mJ/m2"}
"""Units of parameters."""
FLAT = 0.8
"""Share of a parameter's range from which its interval says that it is not determined."""
DRAWS = 20_000
"""Random draws behind the interval of a prediction."""
ENDS = (0.5 * (1.0 - CONFIDENCE), 0.5, 0.5 * (1.0 + CONFIDENCE))
"""Quantiles of a 95 % interval's ends and of the median."""
SHARED_DISCREPANCY = 0.5
"""Correlation of what no packing explains, between cakes of one distribution at several pressures.

What a sphere is not may be the same at all of them, or change with the pressure: nothing tells how much of it does.
"""


@dataclass(frozen=True)
class Observation:
    """A measured resistance.

    Attributes
    ----------
    name, csd : str
        Its name, and that of the distribution.
    ln_resistance : float
        Natural logarithm of the resistance in m/kg.
    standard_error : float
        Standard error of that, i.e. the relative one of the resistance.
    pressure_kPa : float or None
        Pressure drop, kPa, where the packings know it.
    """

    name: str
    csd: str
    ln_resistance: float
    standard_error: float
    pressure_kPa: float | None = None  # noqa: N815

    @property
    def cake(self) -> str:
        """Name of the cake: measurements of one are of the same quantity."""
        return cake_of(self.csd, self.pressure_kPa)


def cake_of(csd: str, pressure_kpa: float | None) -> str:
    """Name the cake of a distribution, at a pressure drop in kPa where its packings know one."""
    return csd if pressure_kpa is None else f"{csd} at {pressure_kpa:g} kPa"


@dataclass(frozen=True)
class Estimate:
    """A fitted parameter.

    Attributes
    ----------
    parameter : Parameter
        Which.
    value : float
        Best value.
    low, high : float
        Ends of the 95 % interval (profile likelihood).
    regions : int
        Separate stretches that the interval consists of.
    """

    parameter: Parameter
    value: float
    low: float
    high: float
    regions: int

    @property
    def half_width(self) -> float:
        """Half of the interval's width."""
        return 0.5 * (self.high - self.low)


@dataclass(frozen=True)
class Finding:
    """Something a user must know before believing a calibration.

    Attributes
    ----------
    kind : str
        ``flat``, ``several``, ``edge``, ``zero``, ``soft``, ``confounded``, ``contradiction``, ``pressure``,
        ``misfit``, ``failed`` or ``friction``.
    text : str
        The same in a sentence.
    """

    kind: str
    text: str


@dataclass(frozen=True)
class Calibration:
    """The outcome of a fit.

    Attributes
    ----------
    parameters : tuple of Parameter
        The fitted ones: cohesion, and friction where it is fitted.
    axes : tuple of ndarray
        Values of each parameter at which the objective was evaluated.
    deviance : ndarray, one axis per parameter
        -2 ln(likelihood), less its smallest value.
    estimates : tuple of Estimate
        One per parameter.
    scale, scale_freedom : float
        Scale of the weighted squares that the interval goes by, and its degrees of freedom (infinite where the errors
        are known).
    chi_square : float
        Weighted sum of squares at the best parameters, with the discrepancy left out.
    degrees_of_freedom : int
        Cakes measured less parameters fitted; at least 0.
    discrepancy : float
        Standard deviation of ln(alpha) between measurements and packings that nothing else explains; 0 where
        nothing is left to explain.
    findings : tuple of Finding
        What a user must know.
    model_share : float
        Share of the packings in the variance of the residuals at the best parameters.
    residual, measured_variance, packed_variance : ndarray, shape (cakes,)
        Measured less packed ln(alpha) at the best parameters, and the variances of both, by cake.
    """

    parameters: tuple[Parameter, ...]
    axes: tuple[FloatArray, ...]
    deviance: FloatArray
    estimates: tuple[Estimate, ...]
    scale: float
    scale_freedom: float
    chi_square: float
    degrees_of_freedom: int
    discrepancy: float
    findings: tuple[Finding, ...]
    model_share: float
    residual: FloatArray
    measured_variance: FloatArray
    packed_variance: FloatArray

    @property
    def best(self) -> tuple[float, ...]:
        """The best parameters."""
        return tuple(estimate.value for estimate in self.estimates)

    @property
    def threshold(self) -> float:
        """Deviance up to which parameters belong to the 95 % interval of one of them."""
        return self.scale * likelihood_limit(self.scale_freedom)


@dataclass(frozen=True)
class Prediction:
    """A predicted resistance with its interval.

    Attributes
    ----------
    resistance, low, high : float
        Median and ends of the 95 % interval, m/kg.
    """

    resistance: float
    low: float
    high: float


def calibrate(
    observations: Sequence[Observation], responses: Mapping[str, Responds], packed_correlation: float = 0.0
) -> Calibration:
    """Find the parameters at which the packings' resistances are the measured ones.

    Maximum likelihood: weighted least squares in ln(alpha), the weights made of the measurements' errors and of the
    packings' own. Measurements of one cake share the error of its packings. Where they contradict each other,
    their scatter is added to the errors of each. Where the cakes scatter more than the errors do on average, a
    discrepancy between measurements and packings, one per cake, is estimated and added. Cakes of one distribution at
    several pressures are of the same packings: their errors are correlated (``packed_correlation``), and their
    discrepancies by ``SHARED_DISCREPANCY``.

    An interval is the wider of two: by the errors, and by the spread of the distributions about the best parameters
    (Student, with the degrees of freedom that the fit leaves them). The second covers whatever stands between the
    distributions, also where they agree by chance (G. Knapp & J. Hartung, Stat. Med. 22 (2003) 2693); a single
    distribution leaves only the first, at however many pressures, unless these contradict the packings' course.

    Parameters
    ----------
    observations : sequence of Observation
        What was measured.
    responses : mapping of str to Response or SharedResponse
        The packings, by cake; all of the same parameters.
    packed_correlation : float
        Correlation of the packings' errors between cakes of one distribution, 0 to 1.

    Raises
    ------
    CalibrationError
        Without observations, or without the packings of one.
    """
    if not observations:
        raise CalibrationError("there is no measurement to calibrate with")
    missing = sorted({item.cake for item in observations} - set(responses))
    if missing:
        raise CalibrationError(f"not enough packings of {', '.join(missing)} for a fit")
    parameters = responses[observations[0].cake].parameters
    axes = tuple(
        np.linspace(parameter.low, parameter.high, points) for parameter, points in zip(parameters, GRID, strict=False)
    )
    grid = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)
    shape = tuple(axis.size for axis in axes)
    residual, chosen = _residuals(observations, responses, grid, packed_correlation)
    freedom = max(len(chosen.names) - len(parameters), 0)
    chi_square, discrepancy = _misfit(residual, chosen, freedom)
    deviance = _deviance(residual, chosen, discrepancy).reshape(shape)
    deviance -= deviance.min()
    between = max(len({item.csd for item in observations}) - len(parameters), 0)
    if not between and improbable(chi_square, freedom):
        between = freedom
    scale, scale_freedom = _scale(chosen, min(chi_square / freedom, 1.0) if freedom else 0.0, between)
    estimates = tuple(
        _profile(parameter, axis, deviance, number, scale * likelihood_limit(scale_freedom))
        for number, (parameter, axis) in enumerate(zip(parameters, axes, strict=True))
    )
    at_best = int(np.argmin(deviance))
    packed = chosen.model[:, at_best]
    share = float(np.mean(packed / (packed + chosen.measured + discrepancy**2)))
    calibration = Calibration(
        parameters=parameters,
        axes=axes,
        deviance=deviance,
        estimates=estimates,
        scale=scale,
        scale_freedom=scale_freedom,
        chi_square=chi_square,
        degrees_of_freedom=freedom,
        discrepancy=discrepancy,
        findings=(),
        model_share=share,
        residual=residual[:, at_best],
        measured_variance=chosen.measured,
        packed_variance=packed,
    )
    return replace(calibration, findings=(*_contradictions(pooled(observations)), *_findings(calibration)))


def pooled(observations: Sequence[Observation]) -> dict[str, Pool]:
    """Average ln(alpha) by cake, the scatter of measurements that contradict each other included."""
    found = {}
    for name in sorted({item.cake for item in observations}):
        own = [item for item in observations if item.cake == name]
        found[name] = pool([item.ln_resistance for item in own], [item.standard_error for item in own])
    return found


@dataclass(frozen=True)
class _Groups:
    """Variances by cake: of the mean of its measurements (m,), and of its packings on the grid (m, n).

    ``freedom`` (m,) is that of the measurements' variances, infinite where they are known. ``packed`` and
    ``discrepant`` (m, m) are the correlations of the packings' errors and of the discrepancies.
    """

    names: tuple[str, ...]
    measured: FloatArray
    freedom: FloatArray
    model: FloatArray
    packed: FloatArray
    discrepant: FloatArray

    @property
    def apart(self) -> bool:
        """Whether every cake has packings of its own."""
        return not np.any(self.discrepant - np.eye(len(self.names)))


def _residuals(
    observations: Sequence[Observation], responses: Mapping[str, Responds], grid: FloatArray, correlation: float
) -> tuple[FloatArray, _Groups]:
    """Measured less packed ln(alpha) by cake, shape (m, n), and the variances.

    The measurements of a cake enter by their weighted mean: it holds all they say about the parameters.
    """
    measured = pooled(observations)
    packed = [responses[name](grid) for name in measured]
    residual = np.array([own.mean - mean for own, (mean, _) in zip(measured.values(), packed, strict=True)])
    variance = np.array([own.variance for own in measured.values()])
    freedom = np.array([own.freedom for own in measured.values()])
    csds = {item.cake: item.csd for item in observations}
    same = np.array([[float(csds[one] == csds[other]) for other in measured] for one in measured])
    alike = same - np.eye(len(measured))
    return residual, _Groups(
        names=tuple(measured),
        measured=variance,
        freedom=freedom,
        model=np.array([model for _, model in packed]),
        packed=np.eye(len(measured)) + correlation * alike,
        discrepant=np.eye(len(measured)) + SHARED_DISCREPANCY * alike,
    )


def _squares(residual: FloatArray, groups: _Groups, discrepancy: float) -> tuple[FloatArray, FloatArray]:
    """Weighted sum of squares and ln(determinant of the covariance), each of shape (n,)."""
    if groups.apart:
        variance = groups.measured[:, None] + groups.model + discrepancy**2
        return np.sum(residual**2 / variance, axis=0), np.sum(np.log(variance), axis=0)
    spread = np.sqrt(groups.model).T
    covariance = spread[:, :, None] * spread[:, None, :] * groups.packed
    covariance = covariance + np.diag(groups.measured) + discrepancy**2 * groups.discrepant
    factor = np.linalg.cholesky(covariance)
    whitened = np.linalg.solve(factor, residual.T[:, :, None])[:, :, 0]
    diagonal = np.diagonal(factor, axis1=1, axis2=2)
    return np.sum(whitened**2, axis=1), 2.0 * np.sum(np.log(diagonal), axis=1)


def _deviance(residual: FloatArray, groups: _Groups, discrepancy: float) -> FloatArray:
    return np.add(*_squares(residual, groups, discrepancy))


def _misfit(residual: FloatArray, groups: _Groups, freedom: int) -> tuple[float, float]:
    """Sum of squares at the optimum, and the discrepancy that makes it no more than it should be."""

    def least(discrepancy: float) -> float:
        return float(_squares(residual, groups, discrepancy)[0].min())

    chi_square = least(0.0)
    if freedom == 0 or chi_square <= freedom:
        return chi_square, 0.0
    weakest = float(np.linalg.eigvalsh(groups.discrepant)[0])
    widest = float(np.sqrt(np.mean(residual**2, axis=0).min() * len(groups.names) / freedom / weakest))
    return chi_square, float(scipy.optimize.brentq(lambda d: least(d) - freedom, 0.0, 1.01 * widest + 1e-9))


def _scale(groups: _Groups, mean_square: float, freedom: int) -> tuple[float, float]:
    """Scale of the squares and its degrees of freedom, by which the interval is the widest.

    By the errors it is 1: known, or resting on the scatter of measurements that contradict each other. A cake's part in
    the variance of a weighted mean is its weight, the inverse of its variance: one whose measurements scatter counts
    for little beside others that are sharp. By the distributions it is the mean square about the best parameters (at
    most 1, and 1 with a discrepancy), with the degrees of freedom that those leave.
    """
    scales = [(1.0, effective_freedom(1.0 / groups.measured, groups.freedom))]
    if freedom:
        scales.append((mean_square, float(freedom)))
    return max(scales, key=lambda found: found[0] * likelihood_limit(found[1]))


def _profile(parameter: Parameter, axis: FloatArray, deviance: FloatArray, number: int, threshold: float) -> Estimate:
    others = tuple(k for k in range(deviance.ndim) if k != number)
    profile = deviance.min(axis=others) if others else deviance
    inside = profile <= threshold
    _, regions = scipy.ndimage.label(inside)
    best = int(np.argmin(profile))
    low, high = np.flatnonzero(inside)[[0, -1]]
    return Estimate(
        parameter,
        _vertex(axis, profile, best),
        _crossing(axis, profile, int(low), -1, threshold),
        _crossing(axis, profile, int(high), 1, threshold),
        int(regions),
    )


def _vertex(axis: FloatArray, profile: FloatArray, best: int) -> float:
    """Lowest point of the parabola through the best grid point and its neighbours."""
    if best in (0, axis.size - 1):
        return float(axis[best])
    left, middle, right = profile[best - 1 : best + 2]
    curvature = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / curvature if curvature > 0.0 else 0.0
    return float(axis[best] + shift * (axis[1] - axis[0]))


def _crossing(axis: FloatArray, profile: FloatArray, last: int, step: int, threshold: float) -> float:
    """Where the profile crosses the threshold beyond its last point inside; the end of the range where it doesn't."""
    beyond = last + step
    if not 0 <= beyond < axis.size:
        return float(axis[last])
    share = (threshold - profile[last]) / (profile[beyond] - profile[last])
    return float(axis[last] + share * (axis[beyond] - axis[last]))


def _contradictions(pools: Mapping[str, Pool]) -> Iterable[Finding]:
    for name, own in pools.items():
        if own.scatter > 0.0:
            text = (
                f"the {own.degrees_of_freedom + 1} measurements of {name} contradict each other (chi-square "
                f"{own.chi_square:.1f} with {_degrees(own.degrees_of_freedom)} of freedom): a scatter of "
                f"{100.0 * own.scatter:.0f} % is added to the error of each"
            )
            yield Finding("contradiction", text)


def _degrees(number: int) -> str:
    return f"{number} degree{'' if number == 1 else 's'}"


def _findings(calibration: Calibration) -> tuple[Finding, ...]:
    found: list[Finding] = []
    cakes = calibration.residual.size
    for estimate, axis in zip(calibration.estimates, calibration.axes, strict=True):
        found += _findings_of(estimate, float(axis[1] - axis[0]))
    fitted = len(calibration.parameters)
    if cakes < fitted:
        names = " and ".join(words_of(parameter.name) for parameter in calibration.parameters)
        pressed = any(parameter.name == "adhesion_mJ_m2" for parameter in calibration.parameters)
        more = "distributions, or at more pressures," if pressed else "distributions"
        found.append(
            Finding(
                "confounded",
                f"{cakes} measured {'cake' if pressed else 'distribution'}{'s' if cakes > 1 else ''} cannot determine "
                f"{fitted} parameters: {names} trade off against each other; measure more {more} or fix one of them",
            )
        )
    if improbable(calibration.chi_square, calibration.degrees_of_freedom):
        found.append(
            Finding(
                "misfit",
                "no parameters describe all measurements within their errors "
                f"(chi-square {calibration.chi_square:.1f} with "
                f"{_degrees(calibration.degrees_of_freedom)} of freedom): "
                f"a discrepancy of {100.0 * calibration.discrepancy:.0f} % per distribution is added to the errors",
            )
        )
    elif calibration.degrees_of_freedom == 0 and calibration.chi_square > calibration.threshold:
        found.append(
            Finding(
                "misfit",
                "the measurements lie outside what the packings reach: even the best parameters miss them by "
                f"{math.sqrt(calibration.chi_square):.1f} standard errors, and the interval means nothing",
            )
        )
    return tuple(found)


def _findings_of(estimate: Estimate, grain: float) -> list[Finding]:
    parameter, what, width = estimate.parameter, words_of(estimate.parameter.name), estimate.parameter.span
    found = []
    if estimate.high - estimate.low >= FLAT * width:
        text = f"the measurements do not determine the {what}: nearly its whole range is in the interval"
        found.append(Finding("flat", text))
    if estimate.regions > 1:
        text = f"the {what} has {estimate.regions} separate stretches that describe the measurements about equally well"
        found.append(Finding("several", text))
    if estimate.value >= parameter.high - grain or estimate.high >= parameter.high - grain:
        text = f"the {what} may lie beyond the upper end of its range ({parameter.high:g}): widen the range"
        found.append(Finding("edge", text))
    if estimate.value <= parameter.low + grain or estimate.low <= parameter.low + grain:
        if parameter.low > 0.0:
            text = f"the {what} may lie below the lower end of its range ({parameter.low:g}): widen the range"
            found.append(Finding("edge", text))
        else:
            found.append(Finding("zero", f"the measurements do not tell the {what} from zero"))
    return found


def words_of(parameter: str) -> str:
    """Name a parameter in words."""
    known = {
        "cohesion_kJ_m3": "cohesion energy density",
        "friction": "coefficient of friction",
        "adhesion_mJ_m2": "work of adhesion",
    }
    return known.get(parameter, parameter)


def with_unit(parameter: str, value: str) -> str:
    """Write a parameter's value with its unit, where it has one."""
    return f"{value} {UNITS.get(parameter, '')}".rstrip()


def leave_one_out(
    observations: Sequence[Observation], responses: Mapping[str, Responds], packed_correlation: float = 0.0
) -> dict[str, float]:
    """Error of predicting each cake from those of all other distributions, in ln(alpha), predicted less measured.

    Empty where those are fewer than the parameters.
    """
    measured = pooled(observations)
    errors: dict[str, float] = {}
    fitted = max((len(responses[name].parameters) for name in measured), default=0)
    for csd in sorted({item.csd for item in observations}):
        others = [item for item in observations if item.csd != csd]
        if len({item.cake for item in others}) < fitted or not others:
            continue
        best = calibrate(others, responses, packed_correlation).best
        for name in sorted({item.cake for item in observations if item.csd == csd}):
            errors[name] = float(responses[name](np.array([best]))[0][0]) - measured[name].mean
    return errors


def predict(calibration: Calibration, response: Responds) -> Prediction:
    """Resistance of a distribution at the calibrated parameters, with an interval.

    It holds the uncertainty of the parameters (their likelihood), of the packings of this distribution, and the
    discrepancy that the calibration found. Where the errors' scale was estimated, it is drawn with the parameters:
    their distribution is Student's, and the discrepancy's too.
    """
    random = np.random.default_rng(0)
    drawn, scale, grid = _drawn(calibration, random)
    mean, variance = response(grid)
    spread = np.sqrt(variance[drawn] + scale * calibration.discrepancy**2)
    values = mean[drawn] + spread * random.standard_normal(DRAWS)
    low, median, high = np.exp(np.quantile(values, ENDS))
    return Prediction(float(median), float(low), float(high))


@dataclass(frozen=True)
class Slope:
    """How ln(alpha) of calibrated packings changes with the logarithm of the pressure drop.

    Attributes
    ----------
    value, low, high : float
        Median and ends of the 95 % interval.
    """

    value: float
    low: float
    high: float


def slope(
    calibration: Calibration, ln_pressure: FloatArray, responses: Sequence[Responds], packed_correlation: float
) -> Slope:
    """Compressibility of a distribution's cakes at the calibrated parameters, with an interval.

    It holds the uncertainty of the parameters and of the packings, whose errors are alike at all pressures. A
    discrepancy that the calibration found is left out: what the packings do is held against what was measured.

    Parameters
    ----------
    calibration : Calibration
        The fit.
    ln_pressure : ndarray, shape (n,)
        Logarithms of the pressure drops; at least two different ones.
    responses : sequence of n Response or SharedResponse
        The packings at those.
    packed_correlation : float
        Correlation of their errors between pressures.
    """
    random = np.random.default_rng(0)
    drawn, _, grid = _drawn(calibration, random)
    found = [response(grid) for response in responses]
    mean, deviation = (np.array([part[k] for part in found]) for k in (0, 1))
    centred = ln_pressure - ln_pressure.mean()
    weight = centred / np.sum(centred**2)
    weighted = weight[:, None] * np.sqrt(deviation[:, drawn])
    alike = _alike(len(responses))
    noise = np.einsum("id,ij,jd->d", weighted, np.eye(len(responses)) + packed_correlation * alike, weighted)
    spread = np.sqrt(np.maximum(noise, 0.0))
    low, median, high = np.quantile(weight @ mean[:, drawn] + spread * random.standard_normal(DRAWS), ENDS)
    return Slope(float(median), float(low), float(high))


def _alike(count: int) -> FloatArray:
    return np.ones((count, count)) - np.eye(count)


def _drawn(calibration: Calibration, random: np.random.Generator) -> tuple[IntArray, float | FloatArray, FloatArray]:
    """Draw parameters by their likelihood: places on the grid, scales of the squares, and the grid (n, d)."""
    grid = np.stack([axis.ravel() for axis in np.meshgrid(*calibration.axes, indexing="ij")], axis=1)
    deviance, freedom = calibration.deviance.ravel() / calibration.scale, calibration.scale_freedom
    posterior = freedom + len(calibration.parameters)
    known = math.isinf(freedom)
    likelihood = np.exp(-0.5 * deviance) if known else (1.0 + deviance / freedom) ** (-0.5 * posterior)
    drawn = random.choice(len(grid), size=DRAWS, p=likelihood / likelihood.sum())
    scale = 1.0 if known else (freedom + deviance[drawn]) / random.chisquare(posterior, DRAWS)
    return np.asarray(drawn), scale, grid


def advised_friction(porosity: float) -> float:
    """Coefficient of friction for a cake of some porosity: none under 0.4, 0.05 above (paper, Fig. 15)."""
    return ADVISED_FRICTIONS[0] if porosity < 0.4 else ADVISED_FRICTIONS[1]


def compare_friction(fits: Mapping[float, Calibration]) -> tuple[Finding, ...]:
    """Say which of several fixed coefficients of friction the measurements prefer.

    Both fits of a comparison are judged by the same errors, or the friction that more packings were made of would
    win by being packed more often: the larger variance of the packings, and the discrepancy of the fit that needs
    less of it. Where even that one needs some, the errors are known from the distributions alone, and F takes the
    place of chi-square.

    Parameters
    ----------
    fits : mapping of float to Calibration
        A calibration of the cohesion alone by coefficient of friction; the first is the one taken.

    Returns
    -------
    tuple of Finding
        One per rival: whether it describes the measurements better, worse or as well as the one taken.
    """
    (taken, own), *rivals = fits.items()
    return tuple(Finding("friction", _compared(taken, own, friction, fit)) for friction, fit in rivals)


def _compared(taken: float, own: Calibration, friction: float, rival: Calibration) -> str:
    discrepancy = min(own.discrepancy, rival.discrepancy)
    packed = np.maximum(own.packed_variance, rival.packed_variance)
    variance = own.measured_variance + packed + discrepancy**2
    squares = {mu: float(np.sum(fit.residual**2 / variance)) for mu, fit in ((taken, own), (friction, rival))}
    (better, least), (worse, most) = sorted(squares.items(), key=lambda item: item[1])
    needed = likelihood_limit()
    if discrepancy > 0.0:
        freedom = own.degrees_of_freedom
        needed = likelihood_limit(freedom) * least / freedom
    numbers = (
        f"at equal errors chi-square {squares[friction]:.1f} with {friction:g} and {squares[taken]:.1f} with "
        f"{taken:g}; it takes a difference of {needed:.1f} to tell them apart"
    )
    if most - least > needed:
        return f"the measurements prefer a friction of {better:g} to {worse:g} ({numbers})"
    why = ", as a cohesion makes up for either" if own.degrees_of_freedom == 0 else ""
    return f"the measurements do not tell a friction of {friction:g} from {taken:g}{why} ({numbers})"


def next_values(
    calibration: Calibration | None, candidates: Sequence[float], visited: Sequence[float], coarse: int, most: int
) -> list[float]:
    """Choose the values of the first parameter at which to pack next.

    Parameters
    ----------
    calibration : Calibration or None
        The fit so far; None before the first.
    candidates : sequence of float
        All that may be visited, ascending.
    visited : sequence of float
        Those that have been.
    coarse : int
        How many to begin with, evenly spaced.
    most : int
        How many at once later on: those in the interval and next to it that are nearest to the best.
    """
    values = np.asarray(candidates, dtype=np.float64)
    if calibration is None:
        picked = np.unique(np.round(np.linspace(0, values.size - 1, min(coarse, values.size))).astype(int))
        return [float(values[k]) for k in picked]
    first = calibration.estimates[0]
    # the nearest candidates below and above the interval too
    low = values[values < first.low].max(initial=values[0])
    high = values[values > first.high].min(initial=values[-1])
    wanted = [float(value) for value in values if low <= value <= high and not np.isclose(visited, value).any()]
    return sorted(sorted(wanted, key=lambda value: abs(value - first.value))[:most])


def good_enough(calibration: Calibration, relative: float) -> bool:
    """Whether the first parameter's interval is as narrow as asked for, or more packings won't help.

    Its half-width is held against its value; packings do not help where they make less than a tenth of the variance.
    """
    first = calibration.estimates[0]
    narrow = first.half_width <= relative * max(first.value, math.ulp(1.0))
    return narrow or calibration.model_share < 0.1
