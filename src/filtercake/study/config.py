"""The typed model of a study and of the workflow's configuration.

The one source of defaults, ranges, units and descriptions: the JSON schemas, the template of a study and the
reference of its keys are generated from it.
"""

from __future__ import annotations

import math
import re
import unicodedata
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from filtercake.study import limits
from filtercake.study.limits import FRICTIONAL_TIME_STEP, FRICTIONLESS_TIME_STEP
from filtercake.units import MICROMETRE, MICROSECOND, NUMBER

SWEPT = ("cohesion_kJ_m3", "friction", "poisson_ratio", "restitution", "youngs_modulus_MPa")
"""Properties a sweep may vary, besides the distribution."""

NAME = re.compile(r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}\Z")
"""What a study or a distribution may be called: it names files and folders."""


LARGEST_INTEGER = 10**18
"""Whole numbers beyond this fit neither the arrays nor the programs they go to."""

UNSEEN = ("Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp")
"""Unicode categories of what cannot be seen: control and format characters, halves of characters, line ends."""

FORMULA_STARTS = ("=", "+", "-", "@")

NOT_IN_PATHS = "{}"
"""Characters that Snakemake would take for a wildcard."""

LONGEST_NAME = 255
"""Bytes of a file's or folder's name that file systems allow."""

MOST_POINTS = 10_000
"""Points of a study; each is a job of its own."""
MOST_PARTICLES = 2_000_000
"""Spheres of a packing."""
MOST_DISTRIBUTIONS = 200
"""Distributions of a study, the crystallizer's products among them."""
MOST_VALUES = 1000
"""Entries of a list."""


def _number(value: Any) -> Any:
    """Accept what YAML 1.1 reads as text (1e5, 5e-1); refuse booleans, and whole numbers that are no floats."""
    if isinstance(value, bool):
        raise ValueError("must be a number, not true/false")
    if isinstance(value, str):
        if not NUMBER.fullmatch(value.strip()):
            raise ValueError("must be a number (with a decimal point)")
        return float(value)
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        raise ValueError(f"must be between -{LARGEST_INTEGER:g} and {LARGEST_INTEGER:g}")
    return value


def _whole(value: Any) -> Any:
    value = _number(value)
    if isinstance(value, float):
        if not math.isfinite(value) or value != int(value):
            raise ValueError("must be a whole number")
        return int(value)
    return value


def _listed(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


def _name(value: Any) -> Any:
    if not isinstance(value, str) or not NAME.match(value):
        raise ValueError("must be letters, digits, - and _, starting with a letter or digit, at most 64 long")
    return value


def _text(value: Any) -> Any:
    """Take away the blanks around a text; refuse what would break a line, a figure or a table that shows it."""
    if not isinstance(value, str):
        return value
    text = value.strip()
    if any(unicodedata.category(character) in UNSEEN for character in text):
        raise ValueError("must be one line of visible characters")
    if "$" in text:
        raise ValueError("must not hold $, which starts a formula in figures")
    if text.startswith(FORMULA_STARTS):
        raise ValueError(f"must not start with {' or '.join(FORMULA_STARTS)}, which start a formula in spreadsheets")
    return text


def _path(value: Any) -> Any:
    """Refuse what no file is called, or Snakemake would not take as it is."""
    if not isinstance(value, str):
        return value
    unseen = any(unicodedata.category(character) in UNSEEN for character in value)
    if unseen or value != value.strip() or set(value) & set(NOT_IN_PATHS):
        raise ValueError("must be a path of visible characters, without { and }")
    if any(len(part.encode()) > LONGEST_NAME for part in value.split("/")):
        raise ValueError(f"must be a path, no part of it longer than {LONGEST_NAME} bytes")
    return value


# the bounds stand before the conversion, or they are lost from the JSON schema
TO_NUMBER = BeforeValidator(_number)
TO_WHOLE = BeforeValidator(_whole)
Name = Annotated[str, BeforeValidator(_name)]
PathText = Annotated[str, Field(min_length=1, max_length=1000), BeforeValidator(_path)]
TO_TEXT = BeforeValidator(_text)
LISTED = BeforeValidator(_listed)
ENTRIES = Field(min_length=1, max_length=MOST_VALUES)

Density = Annotated[float, Field(ge=1, le=limits.LARGEST_DENSITY, allow_inf_nan=False), TO_NUMBER]
YoungsModulus = Annotated[float, Field(ge=0.5, le=100_000, allow_inf_nan=False), TO_NUMBER]
PoissonRatio = Annotated[float, Field(ge=0, lt=0.5, allow_inf_nan=False), TO_NUMBER]
Restitution = Annotated[float, Field(ge=0.001, lt=1, allow_inf_nan=False), TO_NUMBER]
Friction = Annotated[float, Field(ge=0, le=2, allow_inf_nan=False), TO_NUMBER]
Cohesion = Annotated[float, Field(ge=0, le=1e7, allow_inf_nan=False), TO_NUMBER]

TruncationSize = Annotated[float, Field(ge=0.001, le=100_000, allow_inf_nan=False), TO_NUMBER]
ResidenceTime = Annotated[float, Field(ge=0.001, le=100_000, allow_inf_nan=False), TO_NUMBER]

PublishedValue = Annotated[float, Field(ge=0, le=1e20, allow_inf_nan=False), TO_NUMBER]

EngineName = Literal["auto", "liggghts", "embedded", "liggghts_as_published"]


class Model(BaseModel):
    """Base of all parts: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _check_ends(below: float | None, above: float | None) -> None:
    if below is not None and above is not None and not below < above:
        raise ValueError("truncate_below_um must be below truncate_above_um")


class SizeClass(Model):
    """One size of a mixture."""

    size_um: Annotated[
        float, Field(ge=0.001, le=100_000, description="Crystal diameter, um.", allow_inf_nan=False), TO_NUMBER
    ]
    volume_fraction: Annotated[
        float,
        Field(ge=1e-12, le=1, description="Its share of the crystal volume (= mass).", allow_inf_nan=False),
        TO_NUMBER,
    ]


class Csd(Model):
    """A crystal size distribution: a mixture of discrete sizes, a CSV file, or the crystallizer's product."""

    label: Annotated[str, Field(max_length=60), TO_TEXT] | None = Field(
        default=None, description="Name in figures and tables; the key if left out."
    )
    mixture: Annotated[list[SizeClass], Field(min_length=1, max_length=MOST_VALUES)] | None = Field(
        default=None, description="Discrete sizes with their volume fractions."
    )
    file: PathText | None = Field(
        default=None,
        description="CSV with the columns size_um,volume_fraction; path relative to the study file.",
    )
    residence_time_min: ResidenceTime | None = Field(
        default=None, description="Product of the study's crystallizer at this residence time, min."
    )
    truncate_below_volume_fraction: Annotated[float, Field(ge=0, lt=0.5, allow_inf_nan=False), TO_NUMBER] = Field(
        default=0.0,
        description="Classes below this volume share are left out of the packing (not of the resistance).",
    )
    truncate_below_um: TruncationSize | None = Field(
        default=None, description="Classes of smaller crystals than this, um, are left out of the packing likewise."
    )
    truncate_above_um: TruncationSize | None = Field(
        default=None, description="Classes of larger crystals than this, um, are left out of the packing likewise."
    )

    @model_validator(mode="after")
    def _one_source(self) -> Csd:
        if [self.mixture, self.file, self.residence_time_min].count(None) != 2:
            raise ValueError("needs exactly one of mixture, file and residence_time_min")
        _check_ends(self.truncate_below_um, self.truncate_above_um)
        return self

    @property
    def truncation(self) -> dict[str, float]:
        """Keywords of :func:`filtercake.crystals.csd.truncate`: what is left out of the packing, empty for nothing."""
        found = {"smallest_share": self.truncate_below_volume_fraction}
        for name, size in (("smallest", self.truncate_below_um), ("largest", self.truncate_above_um)):
            found[name] = (size or 0.0) * MICROMETRE
        return {name: value for name, value in found.items() if value > 0.0}


class Crystallizer(Model):
    """A mixed-suspension, mixed-product-removal crystallizer, whose residence time a sweep may vary."""

    kinetics: Name = Field(description="Crystallization kinetics: a preset, or a name in kinetics_file.")
    kinetics_file: PathText | None = Field(
        default=None, description="YAML with kinetics of your own; path relative to the study file."
    )
    slurry_concentration_kg_m3: Annotated[float, Field(ge=0.001, le=2000, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Crystals in the slurry, kg/m3 (= g/L)."
    )
    slurry_flow_m3_h: Annotated[float, Field(ge=1e-6, le=1e6, allow_inf_nan=False), TO_NUMBER] = Field(
        default=20.0, description="Slurry that leaves the crystallizer, m3/h; times the residence time, its volume."
    )
    bin_width_um: Annotated[float, Field(ge=0.001, le=1000, allow_inf_nan=False), TO_NUMBER] = Field(
        default=5.0, description="Width of the size classes, um (rounded to a whole number of classes)."
    )
    truncate_below_volume_fraction: Annotated[float, Field(ge=0, lt=0.5, allow_inf_nan=False), TO_NUMBER] = Field(
        default=0.001, description="Classes below this volume share are left out of the packing, not of the resistance."
    )
    truncate_below_um: TruncationSize | None = Field(
        default=None, description="Classes of smaller crystals than this, um, are left out of the packing likewise."
    )
    truncate_above_um: TruncationSize | None = Field(
        default=None, description="Classes of larger crystals than this, um, are left out of the packing likewise."
    )

    @model_validator(mode="after")
    def _ends(self) -> Crystallizer:
        _check_ends(self.truncate_below_um, self.truncate_above_um)
        return self


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


class Material(Model):
    """The crystals, and the base value of every property a sweep may vary."""

    density_kg_m3: Density | None = Field(
        default=None, description="Crystal density, kg/m3; that of the crystallizer's kinetics if left out."
    )
    youngs_modulus_MPa: YoungsModulus = Field(default=5.0, description="Young's modulus, MPa.")  # noqa: N815
    poisson_ratio: PoissonRatio = Field(default=0.2, description="Poisson's ratio.")
    restitution: Restitution = Field(default=0.3, description="Coefficient of restitution.")
    friction: Friction = Field(default=0.0, description="Coefficient of friction.")
    cohesion_kJ_m3: Cohesion = Field(default=50.0, description="Cohesion energy density, kJ/m3.")  # noqa: N815
    sphericity: Annotated[float, Field(ge=0.01, le=1, allow_inf_nan=False), TO_NUMBER] = Field(
        default=1.0, description="Sphericity in the resistance law; packings are of spheres."
    )

    @property
    def density(self) -> float:
        """Crystal density, kg/m3, of a study that has been loaded."""
        if self.density_kg_m3 is None:
            raise ValueError("the study gives no crystal density and was not loaded")
        return self.density_kg_m3


class Packing(Model):
    """How the packings are made."""

    particles: Annotated[int, Field(ge=50, le=MOST_PARTICLES), TO_WHOLE] | None = Field(
        default=None,
        description=(
            "Spheres in one packing; if left out, 2000, or as many as make a bed of a broad distribution deep enough "
            "(largest over smallest size above 4)."
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
        description="Add packings until the half-width of the porosity's 95 % interval is at most this (6 at least).",
    )
    max_replicates: Annotated[int, Field(ge=2, le=1000), TO_WHOLE] = Field(
        default=64, description="Packings per point after which porosity_ci95_target gives up, and says so."
    )
    engine: EngineName = Field(default="auto", description="auto takes the best engine on this machine; or name one.")
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
    def _as_published(self) -> Packing:
        if self.engine == "liggghts_as_published" and self.bed_depth_factor not in (None, 1.0):
            raise ValueError("the engine liggghts_as_published has the paper's own box: bed_depth_factor must be 1")
        return self

    def time_step(self, rayleigh: float, friction: float) -> float:
        """Time step, s, from the Rayleigh time step (s) and the friction of a scene."""
        if self.time_step_us is not None:
            return self.time_step_us * MICROSECOND
        return (self.time_step_rayleigh or limits.default_time_step(friction)) * rayleigh


class Sweep(Model):
    """One block of points: every combination of the values given; what is left out keeps its base value."""

    csd: Annotated[list[Name], LISTED, ENTRIES] | None = Field(
        default=None, description="Names of distributions from csds."
    )
    residence_time_min: Annotated[list[ResidenceTime], LISTED, ENTRIES] | None = Field(
        default=None, description="Residence times of the crystallizer, min, instead of csd."
    )
    cohesion_kJ_m3: Annotated[list[Cohesion], LISTED, ENTRIES] | None = Field(  # noqa: N815
        default=None, description="Cohesion energy densities, kJ/m3."
    )
    friction: Annotated[list[Friction], LISTED, ENTRIES] | None = Field(
        default=None, description="Coefficients of friction."
    )
    poisson_ratio: Annotated[list[PoissonRatio], LISTED, ENTRIES] | None = Field(
        default=None, description="Poisson's ratios."
    )
    restitution: Annotated[list[Restitution], LISTED, ENTRIES] | None = Field(
        default=None, description="Coefficients of restitution."
    )
    youngs_modulus_MPa: (  # noqa: N815
        Annotated[list[YoungsModulus], LISTED, ENTRIES] | None
    ) = Field(default=None, description="Young's moduli, MPa.")
    replicates: Annotated[int, Field(ge=1, le=1000), TO_WHOLE] | None = Field(
        default=None, description="Packings per point of this block, instead of packing.replicates."
    )

    @model_validator(mode="after")
    def _one_product(self) -> Sweep:
        if (self.csd is None) == (self.residence_time_min is None):
            raise ValueError("needs exactly one of csd and residence_time_min")
        return self


class Published(Model):
    """A published value to stand beside ours."""

    csd: Name = Field(description="Name of a distribution from csds.")
    quantity: Literal[
        "porosity",
        "resistance_m_kg",
        "system_dimension_um",
        "smallest_um",
        "largest_um",
        "filter_area_m2",
        "medium_share",
    ] = Field(description="What was published.")
    value: PublishedValue = Field(description="The value, in the unit its name says.")
    source: Annotated[str, Field(max_length=80), TO_TEXT] = Field(description="Where it is from, for the legend.")
    kind: Literal["simulation", "measurement"] = Field(description="Simulated or measured.")
    cohesion_kJ_m3: Cohesion | None = Field(default=None, description="At this cohesion, kJ/m3.")  # noqa: N815
    friction: Friction | None = Field(default=None, description="At this friction.")
    kinetics: Name | None = Field(
        default=None, description="Of the product of these kinetics; not shown beside crystals of others."
    )
    particles: Annotated[int, Field(ge=1, le=LARGEST_INTEGER), TO_WHOLE] | None = Field(
        default=None, description="For this number of spheres (system_dimension_um), if not the study's."
    )
    low: PublishedValue | None = Field(default=None, description="Lower end, where only a range is known.")
    high: PublishedValue | None = Field(default=None, description="Upper end, where only a range is known.")

    @model_validator(mode="after")
    def _range(self) -> Published:
        ends = (self.low, self.high)
        if ends != (None, None) and (None in ends or not float(self.low or 0) <= self.value <= float(self.high or 0)):
            raise ValueError("low and high go together, with the value between them")
        return self


class Study(Model):
    """A parameter study: distributions, material, packing settings and the points to visit."""

    title: Annotated[str, Field(max_length=120), TO_TEXT] = Field(
        default="", description="One line for figures and reports."
    )
    csds: Annotated[dict[Name, Csd], Field(max_length=MOST_DISTRIBUTIONS)] = Field(
        default={}, description="The distributions by name."
    )
    crystallizer: Crystallizer | None = Field(default=None, description="Where the crystals come from.")
    filter: Filter | None = Field(default=None, description="Where the slurry goes; needs a crystallizer.")
    material: Material = Field(description="The crystals.")
    packing: Packing = Field(default=Packing(), description="How the packings are made.")
    sweeps: Annotated[list[Sweep], Field(min_length=1, max_length=MOST_VALUES)] = Field(
        description="Blocks of points; their union is visited."
    )
    published: Annotated[list[Published], Field(max_length=MOST_VALUES)] = Field(
        default=[], description="Published values to show beside ours."
    )


class Workflow(Model):
    """The workflow's configuration: which studies to run, and where their results go."""

    studies: Annotated[list[PathText], LISTED, ENTRIES] = Field(
        default=["pmma"], description="Names of files in config/studies, or paths of study files."
    )
    calibrations: Annotated[list[PathText], LISTED, Field(max_length=MOST_VALUES)] = Field(
        default=[], description="Names of files in config/calibrations, or paths of calibration files."
    )
    results: PathText = Field(default="results", description="Folder of the results.")
    quick: bool = Field(default=False, description="For the benchmarks: a few packings of each case.")
