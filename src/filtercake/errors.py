"""Errors a user may meet. Each message says what was wrong, where, and what would be right."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

MOST_SHOWN = 20
"""Problems that a message lists; a file of nonsense has thousands."""
LONGEST_SHOWN = 60
"""Characters of a value that a message shows."""

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = LONGEST_SHOWN


def shown(value: Any) -> str:
    """Text of a value for a message, shortened however large or deep it is."""
    try:
        text = _SHORT.repr(value)
    except ValueError:  # an int of more digits than Python writes
        return "(a number of very many digits)"
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """End of a message that proposes the known word nearest to the one given; empty where none is near."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f"; did you mean {close[0]}?" if close else ""


def visible(text: str) -> str:
    """Write what a terminal would obey, and halves of characters, as escapes; lines and tabs stay."""
    if all(character.isprintable() or character in "\n\t" for character in text):
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else repr(c)[1:-1] for c in text)


class FiltercakeError(Exception):
    """Base of every error raised on purpose; its text is meant for the user, without a traceback."""

    def __str__(self) -> str:
        """Return the text, fit for a terminal whatever the files and values it names are called."""
        return visible(super().__str__())


@dataclass(frozen=True)
class Problem:
    """One invalid value of an input.

    Attributes
    ----------
    file : str
        File that holds the value.
    key : str
        Path of the key, e.g. ``material.restitution`` or ``sweeps[1].friction[0]``.
    value : str
        The offending value as the user wrote it.
    allowed : str
        Values that are accepted.
    """

    file: str
    key: str
    value: str
    allowed: str

    def __str__(self) -> str:
        value = f" = {self.value}" if self.value else ""
        return f"{self.file}: {self.key}{value}: {self.allowed}"


class ConfigError(FiltercakeError):
    """The configuration is invalid; holds every problem found and lists the first ``MOST_SHOWN``."""

    def __init__(self, problems: Sequence[Problem]):
        self.problems = tuple(problems)
        lines = [str(problem) for problem in self.problems[:MOST_SHOWN]]
        if len(self.problems) > MOST_SHOWN:
            lines.append(f"... and {len(self.problems) - MOST_SHOWN} more problems")
        super().__init__("\n".join(lines))


class CsdError(FiltercakeError):
    """A crystal size distribution is not usable."""


class CloudError(FiltercakeError):
    """The spheres could not be placed without overlap."""


class CellError(FiltercakeError):
    """A pressure cell cannot be made of what is given, or its stress leaves the limit of rigid spheres."""


class EngineError(FiltercakeError):
    """The packing engine could not run, or stopped with an error of its own.

    Attributes
    ----------
    transient : bool
        True where the same packing may well succeed when tried again at once (killed, truncated output).
    may_pass : bool
        True where another run may make it: a transient error, a program that is missing or another one, a time limit.
    outcome : {"refused", "exploded", "unsettled"}
        What became of the bed: the engine would not start it, it flew apart, or it did not come to rest in time.
    """

    def __init__(self, message: str, *, transient: bool = False, may_pass: bool = False, outcome: str = "refused"):
        super().__init__(message)
        self.transient = transient
        self.may_pass = transient or may_pass
        self.outcome = outcome


class TimeLimitReached(EngineError):  # noqa: N818
    """A packing was stopped at its time limit: another try would be as long; its state, if it has one, is kept."""

    def __init__(self, seconds: float):
        text = f"time limit of {seconds:g} s reached; the packing was stopped (packing.time_limit_min)"
        super().__init__(text, may_pass=True, outcome="unsettled")


class EngineMissing(EngineError):  # noqa: N818 - reads better than EngineMissingError where it is caught
    """The engine asked for is not installed on this machine."""


class PackingRejected(FiltercakeError):  # noqa: N818
    """A packing ran but is not acceptable; the text lists every reason.

    Attributes
    ----------
    reasons : tuple of str
        Every reason.
    transient, may_pass : bool
        As for :class:`EngineError`.
    outcome : {"refused", "exploded", "unsettled"}
        As for :class:`EngineError`.
    """

    def __init__(self, reasons: Sequence[str], *, transient: bool = False, outcome: str = "refused"):
        self.reasons = tuple(reasons)
        self.transient = self.may_pass = transient
        self.outcome = outcome
        super().__init__("; ".join(self.reasons))


class CrystallizerError(FiltercakeError):
    """A crystallizer has no steady state, or its kinetics are not usable."""


class FilterError(FiltercakeError):
    """A drum filter, or a cake on it, has a value that makes no sense."""


class CostError(FiltercakeError):
    """Equipment has no cost by a correlation: no such correlation, or a size that it cannot say anything about."""


class CalibrationError(FiltercakeError):
    """A calibration has too little to go on."""


class FiltrationError(FiltercakeError):
    """A filtration test cannot be read or fitted."""
