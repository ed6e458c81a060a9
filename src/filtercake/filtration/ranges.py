"""Ranges of the quantities of filters and cakes, and the errors that name what is outside."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from filtercake.errors import FilterError
from filtercake.units import FloatArray

Values = float | FloatArray
"""One value, or as many as are wanted at once."""


class Rule(NamedTuple):
    """Range of a quantity; comparisons with nan are false, so that no rule accepts it."""

    accepts: Callable[[FloatArray], np.ndarray[tuple[int, ...], np.dtype[np.bool_]]]
    text: str


POSITIVE = Rule(lambda x: (x > 0.0) & (x < math.inf), "must be positive and finite")
NOT_NEGATIVE = Rule(lambda x: (x >= 0.0) & (x < math.inf), "must be zero or positive, and finite")
FRACTION = Rule(lambda x: (x > 0.0) & (x < 1.0), "must be above 0 and below 1")
WHOLE_OR_LESS = Rule(lambda x: (x > 0.0) & (x <= 1.0), "must be above 0 and at most 1")
SATURATION = Rule(lambda x: (x >= 0.0) & (x <= 1.0), "must be from 0 to 1")
SHARE = Rule(lambda x: (x >= 0.0) & (x < 1.0), "must be at least 0 and below 1")
TURNING = Rule(POSITIVE.accepts, "must be positive and finite (a drum at rest would need an infinite area)")


def require(name: str, value: ArrayLike, unit: str, rule: Rule) -> FloatArray:
    """Return values that a rule accepts, as an array.

    Raises
    ------
    FilterError
        If it does not accept one of them; names it and what is allowed.
    """
    refuse(problem(name, value, unit, rule))
    return np.asarray(value, dtype=np.float64)


def problem(name: str, value: ArrayLike, unit: str, rule: Rule) -> str | None:
    """Message about the first value that a rule does not accept, None where it accepts all."""
    values = np.atleast_1d(np.asarray(value, dtype=np.float64))
    bad = values[~rule.accepts(values)]
    return f"{f'{name} = {bad[0]:g} {unit}'.rstrip()}: {rule.text}" if bad.size else None


def refuse(*problems: str | None) -> None:
    """Raise one error of all problems, where there are some.

    Raises
    ------
    FilterError
        With each problem on a line.
    """
    found = [text for text in problems if text is not None]
    if found:
        raise FilterError("\n".join(found))
