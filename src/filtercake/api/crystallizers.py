"""What a continuous crystallizer makes: mixed, with fines dissolution and classified removal, or a cascade."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from filtercake.api.arguments import ORIGIN
from filtercake.crystals.cascade import MOST_STAGES, cascade, cascade_product
from filtercake.crystals.crystallizer import Kinetics, get_kinetics, load_kinetics
from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.crystals.r_z import Withdrawal, r_z_product, r_z_steady_state
from filtercake.study.config.values import TO_NUMBER, Model, Name, PathText
from filtercake.study.parsing import parse
from filtercake.units import MICROMETRE, MINUTE


def _listed(value: Any) -> Any:
    """Take one number, numbers with commas between, or a list."""
    if isinstance(value, str):
        return [part.strip() for part in value.split(",")]
    return list(value) if isinstance(value, Sequence) else [value]


Size = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False), TO_NUMBER]
Ratio = Annotated[float, Field(ge=1, le=1000, allow_inf_nan=False), TO_NUMBER]
Stages = Annotated[
    list[Annotated[float, Field(ge=0.001, le=100_000, allow_inf_nan=False), TO_NUMBER]],
    Field(min_length=1, max_length=MOST_STAGES),
    BeforeValidator(_listed),
]


class CrystallizerOptions(Model):
    """Arguments of :func:`crystallizer`."""

    kinetics: Name = Field(description="A preset (ammonium_alum, potassium_nitrate), or a name in kinetics_file.")
    kinetics_file: PathText | None = Field(default=None, description="YAML with kinetics of your own.")
    residence_time_min: Stages = Field(description="Residence time, min; of a cascade, one for each stage.")
    slurry_concentration_kg_m3: Stages = Field(
        description="Crystals in the slurry, kg/m3 (= g/L); of a cascade, one for each stage, rising."
    )
    fines_ratio: Ratio = Field(
        default=1.0, description="How much faster than the product fines leave, to be dissolved."
    )
    fines_size_um: Size | None = Field(default=None, description="Fines are smaller than this, um.")
    classification_ratio: Ratio = Field(
        default=1.0, description="How much faster than the mixed product coarse crystals leave, as product."
    )
    classification_size_um: Size | None = Field(default=None, description="Coarse crystals are larger than this, um.")
    bin_width_um: Annotated[float, Field(ge=0.01, le=10_000, allow_inf_nan=False), TO_NUMBER] = Field(
        default=5.0, description="Width of the size classes, um."
    )

    @model_validator(mode="after")
    def _pairs(self) -> CrystallizerOptions:
        if (self.fines_ratio > 1.0) != (self.fines_size_um is not None):
            raise ValueError("fines_ratio above 1 and fines_size_um go together")
        if (self.classification_ratio > 1.0) != (self.classification_size_um is not None):
            raise ValueError("classification_ratio above 1 and classification_size_um go together")
        if len(self.residence_time_min) > 1 and (self.fines_ratio > 1.0 or self.classification_ratio > 1.0):
            raise ValueError("a cascade has neither fines_ratio nor classification_ratio")
        return self


@dataclass(frozen=True)
class CrystallizerProduct:
    """What a crystallizer, or a cascade of them, makes.

    Attributes
    ----------
    csd : CrystalSizeDistribution
        The product.
    density_kg_m3 : float
        Crystal density of the kinetics, kg/m3.
    growth_rate_m_s, nucleation_rate_m3_s : tuple of float
        G, m/s, and B0, #/(m3 s), of each stage.
    product_concentration_kg_m3 : float
        Crystals per volume of mixed product flow, kg/m3.
    warnings : tuple of str
        Residence times that the kinetics are not meant for.
    """

    csd: CrystalSizeDistribution
    density_kg_m3: float
    growth_rate_m_s: tuple[float, ...]
    nucleation_rate_m3_s: tuple[float, ...]
    product_concentration_kg_m3: float
    warnings: tuple[str, ...]


def crystallizer(**options: Any) -> CrystallizerProduct:
    """Product of a continuous crystallizer: mixed, with fines dissolution and classified removal, or a cascade.

    Parameters
    ----------
    **options
        ``kinetics``, ``kinetics_file``, ``residence_time_min`` and ``slurry_concentration_kg_m3`` (lists for a
        cascade), ``fines_ratio`` with ``fines_size_um``, ``classification_ratio`` with ``classification_size_um``, and
        ``bin_width_um``.

    Raises
    ------
    ConfigError, CrystallizerError, CsdError
        With every problem.
    """
    given = parse(CrystallizerOptions, options, str(ORIGIN))
    own = None if given.kinetics_file is None else load_kinetics(Path(given.kinetics_file))
    kinetics = get_kinetics(given.kinetics, own)
    times = [minutes * MINUTE for minutes in given.residence_time_min]
    if len(times) == 1 and len(given.slurry_concentration_kg_m3) == 1:
        return _single(given, kinetics, times[0])
    stages = cascade(kinetics, times, given.slurry_concentration_kg_m3)
    return CrystallizerProduct(
        csd=cascade_product(stages, given.bin_width_um * MICROMETRE),
        density_kg_m3=kinetics.density,
        growth_rate_m_s=tuple(stage.growth_rate for stage in stages),
        nucleation_rate_m3_s=tuple(stage.nucleation_rate for stage in stages),
        product_concentration_kg_m3=stages[-1].slurry_concentration,
        warnings=_doubts(kinetics, times),
    )


def _single(given: CrystallizerOptions, kinetics: Kinetics, residence_time: float) -> CrystallizerProduct:
    coarse = given.classification_size_um
    withdrawal = Withdrawal(
        fines_ratio=given.fines_ratio,
        fines_size=(given.fines_size_um or 0.0) * MICROMETRE,
        classification_ratio=given.classification_ratio,
        classification_size=math.inf if coarse is None else coarse * MICROMETRE,
    )
    state = r_z_steady_state(kinetics, residence_time, given.slurry_concentration_kg_m3[0], withdrawal)
    return CrystallizerProduct(
        csd=r_z_product(state, given.bin_width_um * MICROMETRE),
        density_kg_m3=kinetics.density,
        growth_rate_m_s=(state.growth_rate,),
        nucleation_rate_m3_s=(state.nucleation_rate,),
        product_concentration_kg_m3=state.product_concentration,
        warnings=_doubts(kinetics, [residence_time]),
    )


def _doubts(kinetics: Kinetics, residence_times: Sequence[float]) -> tuple[str, ...]:
    outside = dict.fromkeys(f"{time / MINUTE:g}" for time in residence_times if not kinetics.covers(time))
    if not outside or kinetics.residence_time_range is None:
        return ()
    shortest, longest = (time / MINUTE for time in kinetics.residence_time_range)
    return (
        f"residence_time_min = {', '.join(outside)}: the kinetics {kinetics.name} are meant for {shortest:g} to "
        f"{longest:g} min",
    )
