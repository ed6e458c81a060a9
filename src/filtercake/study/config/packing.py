"""The section ``packing``: how packings are made."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from filtercake.packing.engines import ENGINES, kind_of
from filtercake.packing.scene import GRAVITY_PROTOCOL
from filtercake.study import limits
from filtercake.study.config.values import (
    LARGEST_INTEGER,
    MOST_PARTICLES,
    TO_NUMBER,
    TO_WHOLE,
    Model,
    Pressure,
    Protocol,
)
from filtercake.study.limits import FRICTIONAL_TIME_STEP, FRICTIONLESS_TIME_STEP

AUTO = "auto"
"""Stands for the engine that this machine is best served with."""


def _engine(name: str) -> str:
    if name not in (AUTO, *ENGINES):
        raise ValueError(f"allowed: {', '.join(map(repr, (AUTO, *ENGINES)))}")
    return name


EngineName = Annotated[str, AfterValidator(_engine), WithJsonSchema({"enum": [AUTO, *ENGINES], "type": "string"})]


class Packing(Model):
    """How the packings are made."""

    protocol: Protocol = Field(
        default=GRAVITY_PROTOCOL,
        description="gravity drops the spheres, as the paper does; filtration presses them as a filter does.",
    )
    pressure_kPa: Pressure | None = Field(  # noqa: N815
        default=None,
        description="Pressure drop across the cake, kPa (protocol: filtration); the filter's if left out.",
    )
    particles: Annotated[int, Field(ge=50, le=MOST_PARTICLES), TO_WHOLE] | None = Field(
        default=None,
        description=(
            "Spheres in one packing; if left out, 2000, or as many as make a bed of a broad distribution deep enough "
            "(largest over smallest size above 4) or fill a wide enough cell (protocol: filtration)."
        ),
    )
    initial_void_fraction: Annotated[float, Field(ge=0.5, le=0.95, allow_inf_nan=False), TO_NUMBER] = Field(
        default=0.65, description="Void fraction of the initial cloud; 0.65, or 0.60 for broad distributions."
    )
    bed_depth_factor: Annotated[float, Field(ge=0.5, le=10, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None,
        description=(
            "Depth of the bed in units of its box side, over the paper's: fewer spheres make a bed as deep as a wider "
            "one's. If left out, 1, or chosen with particles."
        ),
    )
    settling_velocity_m_s: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False), TO_NUMBER] = Field(
        default=0.01, description="Initial downward speed of the spheres, m/s."
    )
    time_step_rayleigh: (
        Annotated[float, Field(ge=limits.SMALLEST_TIME_STEP, lt=1, allow_inf_nan=False), TO_NUMBER] | None
    ) = Field(
        default=None,
        description=(
            "Time step over the Rayleigh time step of the smallest sphere; "
            f"{FRICTIONLESS_TIME_STEP:g} without friction and {FRICTIONAL_TIME_STEP:g} with it if left out."
        ),
    )
    time_step_us: Annotated[float, Field(ge=1e-9, le=1e6, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None, description="Time step, us; overrides time_step_rayleigh."
    )
    replicates: Annotated[int, Field(ge=1, le=1000), TO_WHOLE] = Field(
        default=3,
        description="Packings per point, from different initial clouds; at least so many with porosity_ci95_target.",
    )
    porosity_ci95_target: Annotated[float, Field(ge=1e-4, le=0.1, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None,
        description="Add packings until the half-width of the porosity's 95 % interval is at most this (3 at least).",
    )
    max_replicates: Annotated[int, Field(ge=2, le=1000), TO_WHOLE] = Field(
        default=64, description="Packings per point after which porosity_ci95_target gives up, and says so."
    )
    engine: EngineName = Field(
        default=AUTO,
        description="auto takes the fastest engine that agrees with the others, the embedded one; or name one.",
    )
    seed: Annotated[int, Field(ge=0, le=LARGEST_INTEGER), TO_WHOLE] = Field(
        default=1, description="Base seed of all random numbers."
    )
    porosity_tolerance: Annotated[float, Field(ge=1e-9, le=0.01, allow_inf_nan=False), TO_NUMBER] = Field(
        default=1e-4, description="The bed is at rest when its porosity falls by less than this per check."
    )
    max_fall_times: Annotated[float, Field(ge=1, le=100, allow_inf_nan=False), TO_NUMBER] = Field(
        default=4.0, description="Unsettled after this many free-fall times of the highest sphere."
    )
    skin_um: Annotated[float, Field(ge=1e-5, le=100_000, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None, description="Neighbour skin, um; the engine chooses if left out."
    )
    processes: Annotated[int, Field(ge=0, le=256), TO_WHOLE] = Field(
        default=0, description="MPI processes of one packing; 0 chooses by size."
    )
    time_limit_min: Annotated[float, Field(ge=0.001, le=1e6, allow_inf_nan=False), TO_NUMBER] = Field(
        default=240.0, description="Wall-clock limit of one packing, min."
    )
    write_vtk: bool = Field(default=False, description="Keep pictures of the settling for ParaView.")

    @model_validator(mode="after")
    def _paper_box(self) -> Packing:
        if kind_of(self.engine).own_spheres and self.bed_depth_factor not in (None, 1.0):
            raise ValueError(f"the engine {self.engine} has the paper's own box: bed_depth_factor must be 1")
        return self
