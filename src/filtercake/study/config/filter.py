"""The section ``filter``: where the slurry goes."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from filtercake.filtration.drum_filter import DrumFilter
from filtercake.study.config.values import TO_NUMBER, Density, Model
from filtercake.units import KILOPASCAL, MILLIPASCAL_SECOND, MINUTE


class Filter(Model):
    """The rotary drum filter that the crystallizer's slurry goes to."""

    pressure_drop_kPa: Annotated[float, Field(ge=0.001, le=10_000, allow_inf_nan=False), TO_NUMBER] = Field(  # noqa: N815
        description="Pressure drop across cake and medium, kPa."
    )
    submerged_fraction: Annotated[float, Field(ge=0.001, lt=1, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Fraction of the drum that is immersed."
    )
    rotation_rate_rpm: Annotated[float, Field(ge=1e-6, le=100, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Rotation rate of the drum, 1/min."
    )
    medium_resistance_1_m: Annotated[float, Field(ge=0, le=1e15, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Resistance of the filter medium, 1/m."
    )
    viscosity_mPa_s: Annotated[float, Field(ge=0.001, le=1e6, allow_inf_nan=False), TO_NUMBER] = Field(  # noqa: N815
        default=1.0, description="Viscosity of the filtrate, mPa s."
    )
    liquid_density_kg_m3: Density = Field(default=1000.0, description="Density of the filtrate, kg/m3.")


def drum_filter(settings: Filter, slurry_concentration: float) -> DrumFilter:
    """Return a drum filter for a slurry with so many kg of crystals per m3, in SI."""
    return DrumFilter(
        pressure_drop=settings.pressure_drop_kPa * KILOPASCAL,
        submerged_fraction=settings.submerged_fraction,
        rotation_rate=settings.rotation_rate_rpm / MINUTE,
        medium_resistance=settings.medium_resistance_1_m,
        viscosity=settings.viscosity_mPa_s * MILLIPASCAL_SECOND,
        slurry_concentration=slurry_concentration,
    )
