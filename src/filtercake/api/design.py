"""What equipment costs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from filtercake.api.arguments import ORIGIN
from filtercake.design.costs import costs_side_by_side, load_correlations
from filtercake.errors import ConfigError, Problem
from filtercake.study.config.values import TO_NUMBER, Model, Name, PathText
from filtercake.study.parsing import parse

SIZE_OF = {"m2": "filter_area_m2", "m3": "crystallizer_volume_m3", "kg/s": "crystals_kg_s"}
"""Argument that holds the size of equipment, by its unit."""

Positive = Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False), TO_NUMBER]


class CostOptions(Model):
    """Arguments of :func:`cost`."""

    equipment: Name = Field(
        description="drum_filter, leaf_filter, plate_and_frame_filter, batch_evaporative_crystallizer, "
        "forced_circulation_crystallizer, or one of costs_file."
    )
    filter_area_m2: Positive | None = Field(default=None, description="Size of a filter, m2.")
    crystallizer_volume_m3: Positive | None = Field(default=None, description="Size of a crystallizer, m3.")
    crystals_kg_s: Positive | None = Field(
        default=None, description="Production of crystals, kg/s, where that sizes it."
    )
    cost_index: Annotated[float, Field(ge=1, le=100_000, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Chemical Engineering Plant Cost Index (CEPCI) of the year asked for: 397 in 2001, 798 in 2023."
    )
    currency_per_usd: Positive = Field(default=1.0, description="Units of your currency that a US dollar buys.")
    costs_file: PathText | None = Field(default=None, description="YAML with cost correlations of your own.")


@dataclass(frozen=True)
class EquipmentCost:
    """What equipment costs by one correlation.

    Attributes
    ----------
    correlation, title : str
        Its name, and that for readers.
    purchase, installed : float
        Cost of buying it, and of having it in place, in the currency asked for.
    installed_as : str
        What the second is: ``bare module`` or ``installed``.
    in_range : bool
        Whether the size is in the correlation's range; False where the source states none.
    size_unit : str
        m2, m3 or kg/s.
    smallest, largest : float or None
        That range; None where the source states none.
    cost_index, index_year : float, int
        CEPCI of the correlation's own prices, and its year.
    source : str
        Where it is from.
    """

    correlation: str
    title: str
    purchase: float
    installed: float
    installed_as: str
    in_range: bool
    size_unit: str
    smallest: float | None
    largest: float | None
    cost_index: float
    index_year: int
    source: str


def cost(**options: Any) -> list[EquipmentCost]:
    """Cost of equipment by every correlation that there is of it, side by side.

    Parameters
    ----------
    **options
        ``equipment``, its size (``filter_area_m2``, ``crystallizer_volume_m3`` or ``crystals_kg_s``), ``cost_index``,
        ``currency_per_usd`` and ``costs_file``.

    Raises
    ------
    ConfigError, CostError
        With every problem.
    """
    given = parse(CostOptions, options, str(ORIGIN))
    known = load_correlations(None if given.costs_file is None else Path(given.costs_file))
    units = {correlation.si_unit for correlation in known.values() if correlation.equipment == given.equipment}
    wanted = {SIZE_OF[unit] for unit in units}
    sizes = {name: size for name in SIZE_OF.values() if (size := getattr(given, name)) is not None}
    if wanted and set(sizes) != wanted:
        surplus = next((name for name in sizes if name not in wanted), None)
        key = surplus or next(iter(wanted - set(sizes)))
        value = "(missing)" if surplus is None else f"{sizes[key]:g}"
        allowed = f"must be given for a {given.equipment}" if surplus is None else f"is no size of a {given.equipment}"
        raise ConfigError([Problem(str(ORIGIN), key, value, allowed)])
    size = next(iter(sizes.values()), 1.0)  # of unknown equipment, which the next line refuses
    found = costs_side_by_side(given.equipment, size, given.cost_index, given.currency_per_usd, known)
    return [
        EquipmentCost(
            correlation=item.name,
            title=item.correlation.title,
            purchase=float(item.purchase),
            installed=float(item.installed),
            installed_as=item.correlation.installed_as,
            in_range=bool(item.in_range),
            size_unit=item.correlation.si_unit,
            smallest=None if item.correlation.si_range is None else item.correlation.si_range[0],
            largest=None if item.correlation.si_range is None else item.correlation.si_range[1],
            cost_index=item.correlation.cost_index,
            index_year=item.correlation.index_year,
            source=item.correlation.source,
        )
        for item in found
    ]
