"""The permeability of a packing, of filtercake's own or of anybody's spheres, by Stokes flow solved in its pores."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from filtercake.api.arguments import ORIGIN
from filtercake.api.measured import load_packing
from filtercake.api.steps import PLAIN_DENSITY
from filtercake.crystals.csd import mixture
from filtercake.errors import ConfigError, FiltercakeError, PackingRejected, Problem
from filtercake.filtration.resistance import KozenyConstant
from filtercake.packing.own_spheres import OwnSpheres, check_spheres, read_spheres
from filtercake.packing.result import SEAL, Packing, read_record
from filtercake.permeability.replicates import constant_of
from filtercake.permeability.resolution import ACCURACY, COARSEST_ACCURACY, FINEST_ACCURACY
from filtercake.permeability.result import Level, Permeability
from filtercake.study.config.values import TO_NUMBER, TO_WHOLE, Density, Model
from filtercake.study.limits import unit_problems
from filtercake.study.parsing import parse
from filtercake.units import MICROMETRE

MOST_THREADS = 256
ARRAYS = "arrays"
"""Stands for the file in messages about arrays."""


@dataclass(frozen=True)
class FlowLevel:
    """The flow on one lattice.

    Attributes
    ----------
    nodes_across : int
        Nodes along the side of the box.
    nodes_per_sauter_mean : float
        Sauter mean diameter over the spacing.
    permeability_m2 : float
        m2.
    convergence_relative_ci95 : float
        Relative change still to come when it was stopped.
    steps, fluid_nodes : int
        Time steps, and nodes of the fluid.
    """

    nodes_across: int
    nodes_per_sauter_mean: float
    permeability_m2: float
    convergence_relative_ci95: float
    steps: int
    fluid_nodes: int


@dataclass(frozen=True)
class PackingPermeability:
    """Permeability of one packing, and what follows from it.

    Attributes
    ----------
    permeability_m2, permeability_ci95_m2 : float
        Of the interior slab of this very packing, upwards, m2, and the half-width of its 95 % interval.
    resistance_m_kg, resistance_ci95_m_kg : float or None
        Specific cake resistance of this slab and its half-width, m/kg; None without a density.
    kozeny_constant, kozeny_constant_ci95 : float
        A of ``k = eps^3 D^2 / (A (1 - eps)^2)`` and its half-width as that of a large packing of its kind.
    resolution_relative_ci95, convergence_relative_ci95 : float
        Relative half-widths: what the lattice, and stopping, leave open.
    slab_relative_ci95 : float
        What so few spheres leave open; of the constant only.
    porosity, sauter_mean_um : float
        Of the same slab, um.
    density_kg_m3 : float or None
        Density that the resistance is for, kg/m3.
    sphericity : float
        Sphericity that the resistance is for.
    particles : int
        Number of spheres.
    levels : tuple of FlowLevel
        Coarse to fine.
    wall_s, memory_MB : float
        What it took, s and MB.
    """

    permeability_m2: float
    permeability_ci95_m2: float
    resistance_m_kg: float | None
    resistance_ci95_m_kg: float | None
    kozeny_constant: float
    kozeny_constant_ci95: float
    resolution_relative_ci95: float
    convergence_relative_ci95: float
    slab_relative_ci95: float
    porosity: float
    sauter_mean_um: float
    density_kg_m3: float | None
    sphericity: float
    particles: int
    levels: tuple[FlowLevel, ...]
    wall_s: float
    memory_MB: float  # noqa: N815 - the unit


class PermeabilityOptions(Model):
    """Arguments of :func:`permeability`, besides the packing."""

    accuracy: Annotated[float, Field(ge=FINEST_ACCURACY, le=COARSEST_ACCURACY, allow_inf_nan=False), TO_NUMBER] = Field(
        default=ACCURACY, description="Relative half-width asked for, of what the lattice leaves open."
    )
    threads: Annotated[int, Field(ge=1, le=MOST_THREADS), TO_WHOLE] = Field(
        default=1, description="Threads; they change nothing but the time."
    )
    density_kg_m3: Density | None = Field(
        default=None, description="Density of the solid, kg/m3, for the resistance; that of the record if left out."
    )
    sphericity: Annotated[float, Field(ge=0.01, le=1, allow_inf_nan=False), TO_NUMBER] = Field(
        default=1.0, description="Sphericity of the crystals that the spheres stand for; of the resistance only."
    )
    trust_units: bool = Field(default=False, description="Take density and sizes as they are, however unlikely.")


Report = Callable[[str], None]
Source = str | Path | Packing | Mapping[str, Any]
"""What a packing is given as."""


def permeability(packing: Source, *, say: Report = lambda _: None, **options: Any) -> PackingPermeability:
    """Solve Stokes flow in a packing; give its permeability, specific resistance and Kozeny constant with intervals.

    Parameters
    ----------
    packing : str, Path, Packing or mapping
        File ``.npz`` of a packing, or of spheres of one's own; a packing; or arrays by name: ``position`` (n, 3) and
        ``radius`` (n,), and either ``length`` of a settled bed (floor at z = 0, x and y periodic) or ``box`` (3,) of a
        cell that is periodic in all directions, all in m.
    say : callable
        Receives a line per lattice.
    **options
        ``accuracy`` (0.02), ``threads`` (1), ``density_kg_m3`` (that of the packing's record), ``sphericity`` (1),
        ``trust_units``.

    Returns
    -------
    PackingPermeability
        Permeability, resistance (where a density is known) and constant, with what each rests on.

    Raises
    ------
    ConfigError
        With every problem of the options, or of spheres of one's own.
    PackingRejected
        If a packing is damaged, the memory too small, or the flow does not settle.

    Examples
    --------
    >>> cubic = {"position": [[2e-5, 2e-5, 2e-5]], "radius": [2e-5], "box": [4e-5, 4e-5, 4e-5]}
    >>> round(permeability(cubic, accuracy=0.01).permeability_m2 / 1e-12, 1)
    4.0
    """
    return permeabilities([packing], say=say, **options)[0]


def permeabilities(
    packings: Sequence[Source], *, say: Report = lambda _: None, **options: Any
) -> list[PackingPermeability]:
    """Solve the flow in several packings, once all of them are read and checked; as :func:`permeability`."""
    given = parse(PermeabilityOptions, options, str(ORIGIN))
    beds = [_load(packing, given) for packing in packings]
    return [_result(spheres, _solve(spheres, given, say), given.sphericity) for spheres in beds]


def mean_kozeny_constant(found: Sequence[PackingPermeability]) -> KozenyConstant:
    """Mean constant of packings of one kind, at least one, with its interval as that of a large one: as in studies."""
    rows = [
        {
            "kozeny_constant": item.kozeny_constant,
            "slab": item.slab_relative_ci95,
            "numerical_ci95": item.permeability_ci95_m2 / item.permeability_m2,
        }
        for item in found
    ]
    mean = constant_of(rows)
    if mean is None:
        raise ValueError("a mean needs at least one packing")
    return mean


def _load(packing: Source, given: PermeabilityOptions) -> OwnSpheres:
    spheres = _read(packing)
    if given.density_kg_m3 is not None:
        spheres = replace(spheres, density=given.density_kg_m3)
    if not given.trust_units:
        _check_units(spheres)
    return spheres


def _read(packing: Source) -> OwnSpheres:
    if isinstance(packing, Packing):
        return _of_packing(packing, ARRAYS, packing.diagnostics.get("scene", {}).get("density"))
    if isinstance(packing, Mapping):
        return check_spheres(packing, ARRAYS)
    path = Path(packing)
    if not _has_record(path):
        return read_spheres(path)
    found, scene = load_packing(path)
    return _of_packing(found, str(packing), scene.density)


def _of_packing(packing: Packing, origin: str, density: float | None) -> OwnSpheres:
    room = {"box": np.full(3, packing.length)} if packing.is_cell else {"length": packing.length}
    arrays = {"position": packing.position, "radius": packing.radius, **room}
    return check_spheres(arrays, origin, density)


def _has_record(npz: Path) -> bool:
    """Whether a packing's record lies beside a file; JSON of another kind is somebody's own."""
    try:
        record = npz.with_suffix(".json")
        return record.is_file() and not read_record(record).keys().isdisjoint({SEAL, "sha256"})
    except (ValueError, OSError):  # no file has such a name
        return False


def _check_units(spheres: OwnSpheres) -> None:
    """Refuse density and sizes that must be in another unit."""
    ends = np.unique([2.0 * spheres.radius.min(), 2.0 * spheres.radius.max()])
    csd = mixture(ends.tolist(), [1.0 / ends.size] * ends.size)
    density = PLAIN_DENSITY if spheres.density is None else spheres.density
    places = {"sizes": (spheres.origin, "radius", ""), "density": (str(ORIGIN), "density_kg_m3", f"{density:g}")}
    problems = [
        Problem(*places[finding.key], f"{finding.text}; if the unit is right, say trust_units")
        for finding in unit_problems(csd, density)
    ]
    if problems:
        raise ConfigError(problems)


def _solve(spheres: OwnSpheres, given: PermeabilityOptions, say: Report) -> Permeability:
    from filtercake.permeability.measure import measure_bed, measure_cell

    position, radius, box = spheres.position, spheres.radius, spheres.box
    how: dict[str, Any] = {
        "accuracy": given.accuracy,
        "threads": given.threads,
        "say": lambda line: say(f"{spheres.origin}: {line}"),
    }
    try:
        if box is None:
            return measure_bed(position, radius, spheres.length, **how)
        return measure_cell(position, radius, box, **how)
    except FiltercakeError as error:
        raise PackingRejected([f"{spheres.origin}: {error}"]) from None


def _result(spheres: OwnSpheres, found: Permeability, sphericity: float) -> PackingPermeability:
    alpha = None if spheres.density is None else found.resistance(spheres.density) / sphericity**2
    numerical = found.numerical_ci95
    return PackingPermeability(
        permeability_m2=float(found.permeability),
        permeability_ci95_m2=float(found.permeability * numerical),
        resistance_m_kg=None if alpha is None else float(alpha),
        resistance_ci95_m_kg=None if alpha is None else float(alpha * numerical),
        kozeny_constant=float(found.kozeny_constant),
        kozeny_constant_ci95=float(found.kozeny_constant * found.relative_ci95),
        resolution_relative_ci95=float(found.resolution),
        convergence_relative_ci95=float(found.convergence),
        slab_relative_ci95=float(found.slab),
        porosity=float(found.porosity),
        sauter_mean_um=float(found.sauter_diameter / MICROMETRE),
        density_kg_m3=spheres.density,
        sphericity=sphericity,
        particles=int(spheres.radius.size),
        levels=tuple(_level(level) for level in found.levels),
        wall_s=found.seconds,
        memory_MB=float(found.memory_bytes / 1e6),
    )


def _level(level: Level) -> FlowLevel:
    return FlowLevel(
        nodes_across=int(level.across),
        nodes_per_sauter_mean=float(level.diameters_per_spacing),
        permeability_m2=float(level.permeability),
        convergence_relative_ci95=float(level.convergence),
        steps=int(level.steps),
        fluid_nodes=int(level.nodes),
    )
