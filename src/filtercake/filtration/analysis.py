"""What a filtration test says: resistances with 95 % intervals, the time zero, what was left out and why.

The readings that lie on the parabola of Ruth's law, and whether the clock was right, are found by weighing all choices
(:mod:`filtercake.filtration.undisturbed`). The most probable one gives the answer: by the integral form where its time
zero is the clock's, otherwise by the differential form, which does not depend on the clock. Over the readings used and
from that time zero on, the two forms agree.

The interval is of the mixture of all choices, each with its weight and its Student distribution: what the readings
leave in doubt widens it. It is given as an equal half-width to both sides, the larger of the two. Where choices so
different stay possible that no number may be given, the test is refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from filtercake.errors import FiltrationError
from filtercake.filtration.constant_pressure import (
    FEWEST_WITH_SCATTER,
    FiltrationFit,
    FiltrationTest,
    Form,
    disagreement,
    fit_differential,
    fit_integral,
)
from filtercake.filtration.undisturbed import Choice, choices
from filtercake.statistics import CONFIDENCE
from filtercake.units import FloatArray

WIDE: Final = 0.10
"""Half-width of the resistance's interval over its value from which it is said."""
APART: Final = 2.0
"""Factor between the resistances of two choices that cannot both stand behind one number."""
UNDECIDED: Final = 0.1
"""Probability of choices ``APART`` from the answer from which a test is refused."""
SAID: Final = 0.05
"""Probability from which a rival choice is mentioned, where it gives a resistance outside the answer's own interval."""
EXACT: Final = 1e-6
"""Relative difference of resistances that is none, whatever their intervals."""

_MILLILITRE: Final = 1e-6
_HALVINGS: Final = 60
_REACH: Final = 100.0
"""Standard errors around each choice's value where the mixture's quantiles are looked for."""


@dataclass(frozen=True, eq=False)
class FiltrationAnalysis:
    """What a test says of cake and medium.

    Half-widths (``*_ci95``) are of 95 % intervals, see the module's docstring.

    Attributes
    ----------
    form : {"integral", "differential"}
        The one that the answer is of.
    integral, differential : FiltrationFit
        Both forms over the readings used; the integral one from ``time_zero`` on.
    resistance, resistance_se, resistance_ci95 : float
        Specific cake resistance alpha, its standard error (the half-width over the quantile of the fit taken) and
        half-width, m/kg.
    medium_resistance, medium_resistance_ci95 : float
        The medium's resistance Rm, 1/m.
    time_zero : float
        Time of the clock at which the filtration began, s.
    notes : tuple of str
        What was left out, repaired or is in doubt.
    """

    form: Form
    integral: FiltrationFit
    differential: FiltrationFit
    resistance: float
    resistance_se: float
    resistance_ci95: float
    medium_resistance: float
    medium_resistance_ci95: float
    time_zero: float
    notes: tuple[str, ...]

    @property
    def doubtful(self) -> bool:
        """Whether the interval is wider than ``WIDE``."""
        return self.resistance_ci95 > WIDE * self.resistance


def analyse(test: FiltrationTest) -> FiltrationAnalysis:
    """Find the readings to use and the time zero, and fit both forms.

    Parameters
    ----------
    test : FiltrationTest
        The test.

    Raises
    ------
    FiltrationError
        If the readings do not slow down as a growing cake makes them, or leave open what to believe.
    """
    weighed = _choices(test)
    best = weighed[0]
    taken = _fitted(test, best)
    rivals = [(choice, fit) for choice in weighed[1:] if (fit := _fitted_or_none(test, choice)) is not None]
    chosen, fits = [best, *(choice for choice, _ in rivals)], [taken, *(fit for _, fit in rivals)]
    weight = np.array([choice.weight for choice in chosen])
    weight /= weight.sum()
    _require_decided(test, chosen, fits, weight)
    zero = taken.time_offset
    used = slice(best.start, best.stop)
    integral = fit_integral(test, used, time_zero=zero, growth=best.growth) if best.free_zero else taken
    differential = taken if best.free_zero else _differential(test, best, taken)
    alpha_ci = _half_width(taken.resistance, weight, fits, "resistance")
    medium_ci = _half_width(taken.medium_resistance, weight, fits, "medium_resistance")
    other_medium = _medium_of_offset(taken) if zero != 0.0 else None
    if other_medium is not None:
        medium_ci = max(medium_ci, abs(other_medium - taken.medium_resistance))
    notes = [
        *_left_out(test, best, taken),
        *_zero_notes(test, best, taken, other_medium),
        *_rival_notes(test, chosen, fits, weight),
        *taken.notes,
    ]
    apart = disagreement(integral, differential)
    if apart is not None:
        notes.append(apart)
        alpha_ci = max(alpha_ci, abs(differential.resistance - integral.resistance))
    if alpha_ci > WIDE * taken.resistance:
        notes.append(f"the cake resistance is known to within {100.0 * alpha_ci / taken.resistance:.0f} % only")
    return FiltrationAnalysis(
        form=taken.form,
        integral=integral,
        differential=differential,
        resistance=taken.resistance,
        resistance_se=alpha_ci / quantile_of(taken),
        resistance_ci95=alpha_ci,
        medium_resistance=taken.medium_resistance,
        medium_resistance_ci95=medium_ci,
        time_zero=zero,
        notes=tuple(notes),
    )


def _choices(test: FiltrationTest) -> list[Choice]:
    """Ways to read a test; the one there is for a few readings, whose scatter tells nothing."""
    if test.time.size >= FEWEST_WITH_SCATTER:
        return choices(test.time, test.volume, known_zero=test.known_zero)
    return [Choice(0, test.time.size, not test.known_zero, 0.0, 1.0)]


def _fitted(test: FiltrationTest, choice: Choice) -> FiltrationFit:
    used = slice(choice.start, choice.stop)
    if choice.free_zero:
        return fit_differential(test, used, growth=choice.growth)
    return fit_integral(test, used, growth=choice.growth)


def _fitted_or_none(test: FiltrationTest, choice: Choice) -> FiltrationFit | None:
    try:
        return _fitted(test, choice)
    except FiltrationError:
        return None


def _differential(test: FiltrationTest, best: Choice, taken: FiltrationFit) -> FiltrationFit:
    """Fit the other form too, where the readings suffice and it gives a resistance; else the one taken stands in."""
    other = _fitted_or_none(test, best._replace(free_zero=True))
    return taken if other is None else other


def quantile_of(fit: FiltrationFit) -> float:
    """Half-width of a fit's intervals over their standard errors."""
    return fit.resistance_ci95 / fit.resistance_se if fit.resistance_se > 0.0 else 1.0


def _half_width(value: float, weight: FloatArray, fits: Sequence[FiltrationFit], name: str) -> float:
    """Larger half of the 95 % interval of a mixture of Student distributions about a value."""
    from scipy import special

    centre = np.array([getattr(fit, name) for fit in fits])
    error = np.maximum([getattr(fit, f"{name}_se") for fit in fits], np.finfo(np.float64).tiny)
    freedom = np.array([fit.dof for fit in fits])
    low, high = (float(end) for end in ((centre - _REACH * error).min(), (centre + _REACH * error).max()))

    def at(probability: float) -> float:
        lower, upper = low, high
        for _ in range(_HALVINGS):
            middle = 0.5 * (lower + upper)
            below = float(weight @ special.stdtr(freedom, (middle - centre) / error)) < probability
            lower, upper = (middle, upper) if below else (lower, middle)
        return 0.5 * (lower + upper)

    tail = 0.5 * (1.0 - CONFIDENCE)
    return max(value - at(tail), at(1.0 - tail) - value)


def _medium_of_offset(taken: FiltrationFit) -> float | None:
    """Medium's resistance (1/m) if the clock was right and the volumes are off by a constant instead.

    t = a (V - V0)^2 + b' (V - V0) is t0 + b V + a V^2 with b'^2 = b^2 - 4 a t0; None where that is negative.
    """
    curvature = taken.slope / 2.0 if taken.form == "differential" else taken.slope
    squared = taken.intercept**2 - 4.0 * curvature * taken.time_offset
    return math.sqrt(squared) * taken.medium_resistance / taken.intercept if squared > 0.0 and taken.intercept else None


def _require_decided(
    test: FiltrationTest, chosen: Sequence[Choice], fits: Sequence[FiltrationFit], weight: FloatArray
) -> None:
    """Refuse a test whose choices give resistances too far apart, naming the readings in question."""
    apart = [abs(math.log(fit.resistance / fits[0].resistance)) > math.log(APART) for fit in fits]
    if float(weight[apart].sum()) <= UNDECIDED:
        return
    rival = next(k for k, far in enumerate(apart) if far)
    raise FiltrationError(
        f"{test.name}: the readings do not decide between {_words(test, chosen[0], fits[0])} and "
        f"{_words(test, chosen[rival], fits[rival])}: leave out those that were read before the pressure was constant "
        "or after the cake was dry, the vessel full or the solids used up"
    )


def _words(test: FiltrationTest, choice: Choice, fit: FiltrationFit) -> str:
    return f"{fit.resistance:.3g} m/kg from {test.named(choice.start, choice.stop)}"


def _left_out(test: FiltrationTest, best: Choice, taken: FiltrationFit) -> Iterator[str]:
    """Say which readings are left out at either end, and what they look like."""
    n = test.time.size
    curvature = taken.slope / 2.0 if taken.form == "differential" else taken.slope
    late = test.time - (taken.time_offset + taken.intercept * test.volume + curvature * test.volume**2)
    if best.start > 0:
        faster = late[0] < 0.0
        seen = "more filtrate than" if faster else "less filtrate than"
        yield (
            f"start-up: {test.named(0, best.start)} left out ({best.start} of {n} readings, to "
            f"{_reading(test, best.start - 1)}): {seen} a constant pressure gives"
        )
    if best.stop < n:
        why = "slower than a growing cake (cake dry, or chamber full?)"
        if late[-1] < 0.0:
            why = "faster than a growing cake (no solids left, cake cracked, or a higher pressure?)"
        yield (
            f"end of the test: {test.named(best.stop, n)} left out ({n - best.stop} of {n} readings, from "
            f"{_reading(test, best.stop)}): {why}"
        )


def _reading(test: FiltrationTest, k: int) -> str:
    return f"{test.time[k]:.4g} s, {test.volume[k] / _MILLILITRE:.4g} mL"


def _zero_notes(test: FiltrationTest, best: Choice, taken: FiltrationFit, other_medium: float | None) -> Iterator[str]:
    if not test.known_zero:
        yield f"the beginning is not among the readings: fitted, at {taken.time_offset:.3g} s of the clock"
    elif best.free_zero:
        early = taken.time_offset > 0.0
        why = "clock started early, or filtrate held back" if early else "clock started late, or filtrate there before"
        text = f"time zero: the filtration began at {taken.time_offset:.3g} s of the clock ({why}); fitted, by the "
        text += "differential form, which does not depend on it"
        if other_medium is not None:
            text += f"; if the volumes are off instead, the medium's resistance is {other_medium:.3g} 1/m"
        yield text
    elif test.time.size < FEWEST_WITH_SCATTER:
        yield (
            f"{test.time.size} readings do not tell their errors: {100.0 * test.reading_error:g} % of each time and "
            "volume is supposed, and a clock that was right"
        )


def _rival_notes(
    test: FiltrationTest, chosen: Sequence[Choice], fits: Sequence[FiltrationFit], weight: FloatArray
) -> Iterator[str]:
    """Mention the first rival that gives another resistance with some probability."""
    for choice, fit, share in zip(chosen[1:], fits[1:], weight[1:], strict=True):
        apart = abs(fit.resistance - fits[0].resistance)
        if share >= SAID and apart > max(fits[0].resistance_ci95, EXACT * fits[0].resistance):
            zero = "with the time zero fitted" if choice.free_zero else "with the clock's time zero"
            yield f"in doubt: {_words(test, choice, fit)}, {zero}, is {100.0 * share:.0f} % probable"
            return
