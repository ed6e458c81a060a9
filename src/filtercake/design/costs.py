"""What filters and crystallizers cost to buy and to put in place, by published correlations of their size.

The correlations are in ``costs.yaml``, each with its range, the cost index of its prices and its source; a file of your
own adds to them. They are of study grade: +-30 % is usual, and no factor for material or pressure is among them. Prices
go from one year to another by the ratio of the cost index (CEPCI), and into a currency by what a US dollar is worth.

A cost outside the correlation's range is marked as such. It is refused where extrapolation makes no sense: more than
:data:`FARTHEST` times outside the range, or where the correlation would have a larger piece cost less.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from filtercake.errors import CostError, did_you_mean
from filtercake.study.config.values import TO_NUMBER, TO_TEXT, TO_WHOLE, Model, Name
from filtercake.study.parsing import parse
from filtercake.units import HOUR, FloatArray
from filtercake.user_files import read_yaml

PRESETS: Final = Path(__file__).with_name("costs.yaml")
"""The correlations that come with the package."""

CEPCI: Final = {2001: 397.0, 2007: 525.0, 2013: 567.0, 2018: 603.0, 2021: 708.0, 2023: 798.0}
"""Chemical Engineering Plant Cost Index by year, rounded."""

FARTHEST: Final = 10.0
"""Factor outside of its range up to which a correlation is extrapolated."""

SIZE_UNITS: Final = {
    "m2": ("m2", 1.0),
    "ft2": ("m2", 0.3048**2),
    "m3": ("m3", 1.0),
    "ft3": ("m3", 0.3048**3),
    "kg/s": ("kg/s", 1.0),
    "kg/h": ("kg/s", 1.0 / HOUR),
}
"""SI unit and factor to it of each unit that a correlation may have."""

FEWEST_COEFFICIENTS, MOST_COEFFICIENTS = 2, 5

Positive = Annotated[float, Field(gt=0, le=1e12, allow_inf_nan=False), TO_NUMBER]
Coefficient = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False), TO_NUMBER]
Text = Annotated[str, Field(min_length=1, max_length=300), TO_TEXT]
Bools = NDArray[np.bool_]


class Correlation(Model):
    """Purchase cost of a kind of equipment, US dollars, from its size."""

    title: Text = Field(description="The equipment, for readers.")
    equipment: Name = Field(description="What it is; correlations of the same are shown side by side.")
    formula: Literal["log10", "ln", "power"] = Field(description="Form of the correlation.")
    coefficients: Annotated[list[Coefficient], Field(min_length=FEWEST_COEFFICIENTS, max_length=MOST_COEFFICIENTS)] = (
        Field(description="k0, k1 and so on.")
    )
    size_unit: Literal["m2", "ft2", "m3", "ft3", "kg/s", "kg/h"] = Field(description="Unit of the size.")
    size_range: tuple[Positive, Positive] | None = Field(description="Smallest and largest size, or null.")
    cost_index: Positive = Field(description="CEPCI of the prices.")
    index_year: Annotated[int, Field(ge=1950, le=2100), TO_WHOLE] = Field(description="Year of that index.")
    installed_factor: Annotated[float, Field(ge=1, le=10, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Cost of the equipment in its place over its purchase cost."
    )
    installed_as: Literal["bare module", "installed"] = Field(description="What the cost in place is.")
    source: Text = Field(description="Where it is from.")

    @model_validator(mode="after")
    def _sound(self) -> Correlation:
        if self.size_range is not None and not self.size_range[0] < self.size_range[1]:
            raise ValueError("size_range must be the smallest size, then the largest")
        if self.formula == "power" and (len(self.coefficients) != 2 or min(self.coefficients) <= 0.0):
            raise ValueError("power has two coefficients, both positive: C = k0 S^k1")
        return self

    @property
    def si_unit(self) -> str:
        """SI unit of the size."""
        return SIZE_UNITS[self.size_unit][0]

    @property
    def si_range(self) -> tuple[float, float] | None:
        """Smallest and largest size, in the SI unit; None where the source states none."""
        if self.size_range is None:
            return None
        factor = SIZE_UNITS[self.size_unit][1]
        return self.size_range[0] * factor, self.size_range[1] * factor

    def purchase(self, size: FloatArray) -> FloatArray:
        """Purchase cost at the correlation's own cost index, US dollars, for sizes in the SI unit."""
        return np.asarray(np.exp(self._polynomial(size)[0]))

    def exponent(self, size: FloatArray) -> FloatArray:
        """Local exponent ``d ln C / d ln S`` at sizes in the SI unit; negative where the cost falls with the size."""
        return self._polynomial(size)[1]

    def _polynomial(self, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Natural logarithm of the cost, and its slope over that of the size."""
        own = np.asarray(size, dtype=np.float64) / SIZE_UNITS[self.size_unit][1]
        k = np.array(self.coefficients)
        if self.formula == "power":
            k[0] = math.log(k[0])
        scale = math.log(10.0) if self.formula == "log10" else 1.0
        x = np.log(own) / scale
        polynomial = np.polynomial.Polynomial(k)
        return np.asarray(scale * polynomial(x)), np.asarray(polynomial.deriv()(x))


class CostFile(Model):
    """A file of correlations."""

    correlations: Annotated[dict[Name, Correlation], Field(min_length=1, max_length=1000)] = Field(
        description="Correlations by name."
    )


@dataclass(frozen=True, eq=False)
class Cost:
    """What equipment of some sizes costs by one correlation.

    Attributes
    ----------
    name : str
        Name of the correlation.
    correlation : Correlation
        The correlation: range, index, source.
    size : ndarray
        Sizes, in the correlation's SI unit.
    purchase : ndarray
        Cost of buying it, in the currency asked for.
    installed : ndarray
        Cost of having it in place: ``correlation.installed_as`` says what that is.
    in_range : ndarray of bool
        Whether the size is in the correlation's range; False where the source states none.
    cost_index : float
        CEPCI that the costs are of.
    """

    name: str
    correlation: Correlation
    size: FloatArray
    purchase: FloatArray
    installed: FloatArray
    in_range: Bools
    cost_index: float


def load_correlations(path: Path | None = None) -> dict[str, Correlation]:
    """Read correlations by name: those of the package, and those of a file, which go before of the same name.

    Parameters
    ----------
    path : Path or None
        YAML with the keys of the package's own ``costs.yaml``.

    Raises
    ------
    ConfigError
        With every problem: file, key, value and what is allowed.
    """
    found = _read(PRESETS)
    return found if path is None else {**found, **_read(path)}


def equipment_cost(
    name: str,
    size: ArrayLike,
    cost_index: float,
    currency_per_usd: float = 1.0,
    correlations: Mapping[str, Correlation] | None = None,
) -> Cost:
    """Cost of equipment by one correlation.

    Parameters
    ----------
    name : str
        Name of the correlation.
    size : array_like
        Sizes in the correlation's SI unit: m2 of filter area, m3 of crystallizer, kg/s of crystals.
    cost_index : float
        CEPCI of the year that the cost is for (:data:`CEPCI` has some).
    currency_per_usd : float
        Units of the currency asked for that a US dollar buys.
    correlations : mapping or None
        Correlations to choose from; those of the package if None.

    Raises
    ------
    CostError
        If there is no such correlation, a number is not positive, or a size is where extrapolation makes no sense.

    Examples
    --------
    >>> round(float(equipment_cost("drum_filter_turton", 3.44, 397.0).purchase))
    95004
    """
    known = load_correlations() if correlations is None else correlations
    if name not in known:
        raise CostError(f"correlation = {name!r}: allowed: {', '.join(known)}{did_you_mean(name, known)}")
    correlation = known[name]
    sizes = np.asarray(size, dtype=np.float64)
    _require_positive("cost_index", np.asarray(cost_index), "")
    _require_positive("currency_per_usd", np.asarray(currency_per_usd), "")
    _require_positive("size", sizes, correlation.si_unit)
    _require_sense(name, correlation, sizes)
    purchase = correlation.purchase(sizes) * (cost_index / correlation.cost_index * currency_per_usd)
    inside = np.zeros(sizes.shape, np.bool_)
    if (limits := correlation.si_range) is not None:
        inside = np.asarray((sizes >= limits[0]) & (sizes <= limits[1]))
    return Cost(name, correlation, sizes, purchase, purchase * correlation.installed_factor, inside, cost_index)


def costs_side_by_side(
    equipment: str,
    size: ArrayLike,
    cost_index: float,
    currency_per_usd: float = 1.0,
    correlations: Mapping[str, Correlation] | None = None,
) -> list[Cost]:
    """Cost of a kind of equipment by every correlation that there is of it; arguments as of :func:`equipment_cost`.

    Raises
    ------
    CostError
        If there is none, or as :func:`equipment_cost`.
    """
    known = load_correlations() if correlations is None else correlations
    kinds = dict.fromkeys(correlation.equipment for correlation in known.values())
    if equipment not in kinds:
        raise CostError(f"equipment = {equipment!r}: allowed: {', '.join(kinds)}{did_you_mean(equipment, kinds)}")
    names = [name for name, correlation in known.items() if correlation.equipment == equipment]
    return [equipment_cost(name, size, cost_index, currency_per_usd, known) for name in names]


def _read(path: Path) -> dict[str, Correlation]:
    return dict(parse(CostFile, read_yaml(path), str(path)).correlations)


def _require_positive(name: str, values: FloatArray, unit: str) -> None:
    bad = values[~((values > 0.0) & np.isfinite(values))]
    if bad.size:
        raise CostError(f"{f'{name} = {bad.flat[0]:g} {unit}'.rstrip()}: must be positive and finite")


def _require_sense(name: str, correlation: Correlation, sizes: FloatArray) -> None:
    """Refuse sizes far outside the range, and those at which a larger piece would cost less."""
    unit, limits = correlation.si_unit, correlation.si_range
    if limits is not None:
        far = sizes[(sizes < limits[0] / FARTHEST) | (sizes > limits[1] * FARTHEST)]
        if far.size:
            raise CostError(
                f"size = {far.flat[0]:g} {unit}: {name} is of {limits[0]:.4g} to {limits[1]:.4g} {unit}; "
                f"must be within a factor of {FARTHEST:g} of that"
            )
    falling = sizes[correlation.exponent(sizes) <= 0.0]
    if falling.size:
        raise CostError(
            f"size = {falling.flat[0]:g} {unit}: by {name} a larger one would cost less there; "
            "must be where the cost grows with the size"
        )
