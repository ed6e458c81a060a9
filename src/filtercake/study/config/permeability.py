"""The section ``permeability``: whether the flow is solved in the packings."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from filtercake.permeability.resolution import ACCURACY, COARSEST_ACCURACY, FINEST_ACCURACY
from filtercake.study.config.values import TO_NUMBER, TO_WHOLE, Model


class Permeability(Model):
    """Stokes flow solved in packings of every point."""

    packings: Annotated[int, Field(ge=1, le=100), TO_WHOLE] = Field(
        default=2, description="Packings of each point to solve the flow in: its first accepted ones."
    )
    accuracy: Annotated[float, Field(ge=FINEST_ACCURACY, le=COARSEST_ACCURACY, allow_inf_nan=False), TO_NUMBER] = Field(
        default=ACCURACY, description="Relative half-width of the numerical error that is asked for."
    )
