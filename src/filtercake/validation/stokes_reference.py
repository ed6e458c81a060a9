"""Permeability by finite differences: a second solver of Stokes flow through spheres, to hold the first against.

Velocities sit on the faces of cubic cells and pressures in their middles. A face whose middle is solid is shut; the
viscous term of the others knows how far the wall is along each axis (Gibou et al., J. Comput. Phys. 176 (2002) 205,
doi 10.1006/jcph.2001.6977), which keeps the equations symmetric. They are solved for velocity and pressure together by
the minimal residual method; its preconditioner is Chebyshev's iteration for the viscous term, and for the pressure
what a cell sees (its own faces) and what a bed sees (Darcy's law, solved by Fourier transforms).

The permeability is of second order in the spacing and falls towards its limit, so that it may be extrapolated; a bed's
values at a Sauter diameter of 12, 17 and 24 spacings have the same limit as those of 17, 24 and 35 within 0.1 %. Boxes
are periodic along all axes. ``python -m filtercake.validation.stokes_reference --output FILE`` makes the table of three
beds.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
import scipy.fft
import scipy.optimize
import scipy.sparse
import scipy.sparse.csgraph
import scipy.sparse.linalg
from numpy.typing import NDArray

from filtercake import api
from filtercake.errors import FiltercakeError
from filtercake.packing.porosity import porosity_profile, volume_below
from filtercake.packing.result import Packing
from filtercake.packing.slab import bed_height, interior_slab
from filtercake.units import FloatArray
from filtercake.validation.stokes_kernels import (
    PLATE,
    Indices,
    add_gradient,
    add_inflow,
    add_viscous,
    connect,
    number_open,
    paint_spheres,
    smooth,
)

METHOD: Final = "finite differences"
ORDER: Final = 2.0
"""Order of the method in the spacing."""
TOLERANCE: Final = 3e-7
"""Residual at which the solution ends, over the norms of equations and solution."""
MOST_ITERATIONS: Final = 1500
CHEBYSHEV_STEPS: Final = 5
CHEBYSHEV_RANGE: Final = 20.0
"""Largest over smallest eigenvalue that the Chebyshev iteration is made for."""
PRESSURE_SHARE: Final = 5.0
"""Weight of the pressure in the preconditioner; 3 to 10 need the fewest iterations."""
USUAL_KOZENY_CONSTANT: Final = 170.0
"""A first guess of the permeability; decides the number of iterations, not the result."""
FREE_DIAMETERS: Final = 0.3
"""Fluid below and above a bed, in Sauter diameters."""
SLICES: Final = 200
"""Slices in which a slab is averaged."""

RESOLUTIONS: Final = (12.0, 17.0, 24.0)
"""Sauter diameters of the slab over the spacing, about."""
FINER: Final = {"5:1": (17.0, 24.0, 30.0)}
"""The same for a bed whose pores are narrower."""
SEED: Final = 1
MATERIAL: Final[dict[str, Any]] = {
    "density_kg_m3": 1180,
    "youngs_modulus_MPa": 5,
    "poisson_ratio": 0.2,
    "restitution": 0.3,
}
PACKING: Final[dict[str, Any]] = {
    "protocol": "gravity",
    "engine": "embedded",
    "friction": 0,
    "initial_void_fraction": 0.65,
    "replicates": 1,
    "seed": SEED,
}
BEDS: Final[dict[str, tuple[dict[float, float], dict[str, Any]]]] = {
    "one size": ({30.0: 1.0}, {"particles": 700, "cohesion_kJ_m3": 50}),
    "PMMA 50/50": ({20.0: 0.5, 50.0: 0.5}, {"particles": 1000, "cohesion_kJ_m3": 50}),
    "5:1": ({20.0: 0.5, 100.0: 0.5}, {"particles": 2500, "cohesion_kJ_m3": 0, "bed_depth_factor": 2}),
}
"""Mixtures (um: volume fraction) and options of :func:`filtercake.api.pack`."""


class ReferenceBed(NamedTuple):
    """A bed that both methods are run on, lengths in m: centres (n, 3), radii (n,), side of the periodic box."""

    name: str
    position: FloatArray
    radius: FloatArray
    length: float


@dataclass(frozen=True)
class Spheres:
    """Spheres in a periodic box, all lengths in node spacings.

    Attributes
    ----------
    centre, radius : ndarray, shapes (n, 3) and (n,)
        Spheres; they wrap, and may overlap.
    nodes : tuple of int
        Cells along x, y and z.
    half_plate : float
        Half the thickness of a plate in the plane x = 0; 0 for none.
    permeability : float
        A guess, in squares of the spacing; decides the number of iterations, not the result.
    """

    centre: FloatArray
    radius: FloatArray
    nodes: tuple[int, int, int]
    half_plate: float = 0.0
    permeability: float = 1.0


@dataclass(frozen=True)
class Flow:
    """Flow at viscosity 1, in node spacings.

    Attributes
    ----------
    velocity : float
        Superficial velocity along z.
    pressure : ndarray, shape (nz,)
        Pressure averaged over the fluid cells of each plane, those of closed pockets left out.
    unknowns, iterations : int
        Velocities and pressures; iterations to the tolerance.
    """

    velocity: float
    pressure: FloatArray
    unknowns: int
    iterations: int


class System:
    """The equations of the flow around spheres."""

    def __init__(self, spheres: Spheres):
        self.nodes, self.guess = spheres.nodes, spheres.permeability
        owner = _owners(spheres)
        number = number_open(owner)
        self.faces = int(number.max()) + 1
        self.neighbour: Indices = np.empty((self.faces, 6), dtype=np.int32)
        self.diagonal = np.empty(self.faces, dtype=np.float32)
        cell: Indices = np.empty((self.faces, 2), dtype=np.int32)
        connect(owner, number, spheres.centre, spheres.radius, spheres.half_plate, self.neighbour, self.diagonal, cell)
        self.along_z = slice(int(np.count_nonzero(owner[:2] == 0)), self.faces)
        self.plane = np.flatnonzero(owner[2].ravel() == 0) % self.nodes[2]
        self._number_cells(cell)

    def _number_cells(self, cell: Indices) -> None:
        """Give a number to each cell that has an open face: it has a pressure."""
        size = math.prod(self.nodes)
        own = sum(np.bincount(cell[:, side], 1.0 / self.diagonal, size) for side in (0, 1))
        self.fluid = np.flatnonzero(own)
        self.own: FloatArray = np.asarray(own)[self.fluid]
        number = np.full(size, -1, dtype=np.int32)
        number[self.fluid] = np.arange(self.fluid.size, dtype=np.int32)
        self.cell: Indices = number[cell]

    @property
    def unknowns(self) -> int:
        """Velocities and pressures."""
        return self.faces + self.fluid.size

    def connected(self) -> NDArray[np.bool_]:
        """Say which fluid cells belong to the largest connected part; pockets have a pressure of their own."""
        joins = scipy.sparse.coo_array(
            (np.ones(self.faces, dtype=np.int8), (self.cell[:, 0], self.cell[:, 1])), shape=(self.fluid.size,) * 2
        )
        part = scipy.sparse.csgraph.connected_components(joins, directed=False)[1]
        return np.asarray(part == np.bincount(part).argmax())

    def apply(self, unknown: FloatArray) -> FloatArray:
        """Left side of momentum and mass balance, shape (unknowns,)."""
        out = np.zeros(self.unknowns)
        velocity = np.append(unknown[: self.faces], 0.0)
        add_viscous(velocity, self.neighbour, self.diagonal, out[: self.faces])
        add_gradient(unknown[self.faces :], self.cell, out[: self.faces])
        add_inflow(velocity, self.cell, out[self.faces :])
        return out

    def precondition(self, residual: FloatArray) -> FloatArray:
        """Approximate inverse, symmetric and positive, shape (unknowns,)."""
        return np.concatenate(
            [self._viscous_inverse(residual[: self.faces]), self._pressure_inverse(residual[self.faces :])]
        )

    def _viscous_inverse(self, residual: FloatArray) -> FloatArray:
        """Chebyshev's iteration on the scaled viscous operator, whose eigenvalues lie between 0 and 2."""
        low = 2.0 / CHEBYSHEV_RANGE
        middle, half = 0.5 * (2.0 + low), 0.5 * (2.0 - low)
        wanted = residual.astype(np.float32)
        change = wanted / (self.diagonal * np.float32(middle))
        velocity, other = np.append(change, np.float32(0.0)), np.zeros(self.faces + 1, dtype=np.float32)
        ratio = half / middle
        for _ in range(CHEBYSHEV_STEPS - 1):
            following = 1.0 / (2.0 * middle / half - ratio)
            keep, step = np.float32(following * ratio), np.float32(2.0 * following / half)
            smooth(velocity, change, wanted, self.neighbour, self.diagonal, keep, step, other)
            velocity, other, ratio = other, velocity, following
        return velocity[:-1].astype(np.float64)

    @cached_property
    def _darcy(self) -> NDArray[np.float32]:
        """Inverse of Darcy's operator for each wave."""
        square = [2.0 - 2.0 * np.cos(2.0 * np.pi * np.fft.fftfreq(n)) for n in self.nodes]
        square[2] = square[2][: self.nodes[2] // 2 + 1]
        total = square[0][:, None, None] + square[1][:, None] + square[2]
        total[0, 0, 0] = np.inf
        return np.asarray(1.0 / (self.guess * total), dtype=np.float32)

    def _pressure_inverse(self, residual: FloatArray) -> FloatArray:
        grid = np.zeros(self.nodes, dtype=np.float32)
        grid.reshape(-1)[self.fluid] = residual
        waves = scipy.fft.rfftn(grid)
        waves *= self._darcy
        smoothed = scipy.fft.irfftn(waves, s=self.nodes, overwrite_x=True)
        return np.asarray(PRESSURE_SHARE * (smoothed.reshape(-1)[self.fluid] + residual / self.own))


def _owners(spheres: Spheres) -> Indices:
    """Find what covers the middle of each face, shape (3, nx, ny, nz): 0 where it is fluid."""
    owner: Indices = np.zeros((3, *spheres.nodes), dtype=np.int32)
    for axis in range(3):
        offset = np.where(np.arange(3) == axis, 0.0, 0.5)
        paint_spheres(owner[axis], spheres.centre, spheres.radius, offset)
        along = np.arange(spheres.nodes[0]) + offset[0]
        owner[axis, np.minimum(along, spheres.nodes[0] - along) < spheres.half_plate] = PLATE
    return owner


def solve(spheres: Spheres, force: FloatArray) -> Flow:
    """Solve the flow that a force along z drives.

    Parameters
    ----------
    spheres : Spheres
        The box.
    force : ndarray, shape (nz,)
        Force per volume on the low faces of each plane of cells.

    Raises
    ------
    FiltercakeError
        If the equations are not solved to the tolerance.
    """
    system = System(spheres)
    right = np.zeros(system.unknowns)
    right[system.along_z] = force[system.plane]
    iterations = 0

    def count(_: FloatArray) -> None:
        nonlocal iterations
        iterations += 1

    operator, inverse = (_operator(system.unknowns, call) for call in (system.apply, system.precondition))
    found, failed = scipy.sparse.linalg.minres(
        operator, right, M=inverse, rtol=TOLERANCE, maxiter=MOST_ITERATIONS, callback=count
    )
    if failed:
        raise FiltercakeError(f"the flow is not solved after {iterations} iterations")
    flowing = system.connected()
    plane, level = system.fluid[flowing] % spheres.nodes[2], found[system.faces :][flowing]
    count_in_plane = np.bincount(plane, minlength=spheres.nodes[2])
    pressure = np.bincount(plane, level, spheres.nodes[2]) / np.maximum(count_in_plane, 1)
    velocity = float(found[system.along_z].sum()) / math.prod(spheres.nodes)
    return Flow(velocity, pressure, system.unknowns, iterations)


def _operator(size: int, call: Callable[[FloatArray], FloatArray]) -> Any:
    return scipy.sparse.linalg.LinearOperator((size, size), matvec=call, dtype=np.float64)


def cell_permeability(
    position: FloatArray, radius: FloatArray, shape: Sequence[float], nodes: int, plate: float = 0.0
) -> float:
    """Permeability of a periodic cell along z, m2.

    Parameters
    ----------
    position, radius : ndarray, shapes (n, 3) and (n,)
        Centres and radii, m.
    shape : sequence of float
        Sides of the cell, m; multiples of the spacing.
    nodes : int
        Nodes along x.
    plate : float
        Thickness of a solid plate in the plane x = 0, m.

    Raises
    ------
    ValueError
        If a side is no multiple of the spacing.
    FiltercakeError
        If the flow is not solved.
    """
    spacing = shape[0] / nodes
    sides = np.asarray(shape) / spacing
    counts = np.rint(sides).astype(int)
    if not np.allclose(sides, counts, rtol=0.0, atol=1e-6):
        raise ValueError(f"the sides of the cell are {sides} spacings; they must be whole numbers")
    guess = 1.0
    if radius.size:
        solids = float(np.sum(radius**3)) * 4.0 / 3.0 * np.pi / math.prod(shape)
        guess = usual_permeability(max(1.0 - solids, 0.2), sauter_mean(radius)) / spacing**2
    box = Spheres(position / spacing, radius / spacing, _triple(counts), 0.5 * plate / spacing, guess)
    return solve(box, np.ones(counts[2])).velocity * spacing**2


def bed_permeability(position: FloatArray, radius: FloatArray, length: float, nodes: int) -> float:
    """Permeability of a settled bed's interior slab along z, m2.

    The bed stands in a box that is periodic along z, too, with fluid below and above; a force drives the flow in the
    bed only. The gradient is the slope of the potential (force less pressure gradient, averaged over the fluid of each
    plane), weighted as a regression over the slab weights it.

    Parameters
    ----------
    position, radius : ndarray, shapes (n, 3) and (n,)
        Centres and radii, m; floor at z = 0.
    length : float
        Side of the box, periodic in x and y, m.
    nodes : int
        Nodes along that side.

    Raises
    ------
    FiltercakeError
        If the flow is not solved.
    """
    spacing = length / nodes
    porosity, diameter = slab_averages(position, radius, length)
    bottom = float((position[:, 2] - radius).min()) - FREE_DIAMETERS * diameter
    top = float((position[:, 2] + radius).max()) + FREE_DIAMETERS * diameter
    planes = int(scipy.fft.next_fast_len(math.ceil((top - bottom) / spacing), real=True))
    guess = usual_permeability(porosity, diameter) / spacing**2
    centre = (position - np.array([0.0, 0.0, bottom])) / spacing
    height: FloatArray = bottom + spacing * np.arange(planes, dtype=np.float64)
    force = np.where((height > 0.0) & (height < bed_height(position, radius)), 1.0, 0.0)
    flow = solve(Spheres(centre, radius / spacing, (nodes, nodes, planes), permeability=guess), force)
    slab = interior_slab(position, radius)
    weight = parabola(height, slab.lower, slab.upper)
    gradient = float(np.sum(weight * (force - flow.pressure + np.roll(flow.pressure, 1))))
    return flow.velocity / gradient * spacing**2


def parabola(height: FloatArray, lower: float, upper: float) -> FloatArray:
    """Weights of the local slopes in a regression over lower..upper, sum 1: a parabola, 0 at both ends."""
    weight = np.maximum((height - lower) * (upper - height), 0.0)
    return np.asarray(weight / weight.sum())


def slab_averages(position: FloatArray, radius: FloatArray, length: float) -> tuple[float, float]:
    """Porosity and Sauter mean diameter (m) of a bed's interior slab, with the weights of the gradient.

    Parameters are those of :func:`bed_permeability`. What spheres share counts once in the porosity.
    """
    slab = interior_slab(position, radius)
    edges = np.linspace(slab.lower, slab.upper, SLICES + 1)
    weight = parabola(0.5 * (edges[1:] + edges[:-1]), slab.lower, slab.upper)
    porosity = float(weight @ porosity_profile(position, radius, length, edges))
    below = volume_below(edges[:, None], position[:, 2], radius)
    volume = weight @ np.diff(below, axis=0)
    return porosity, float(volume.sum() / np.sum(volume / (2.0 * radius)))


def sauter_mean(radius: FloatArray) -> float:
    """Sauter mean diameter of spheres, in the unit of the radii."""
    return 2.0 * float(np.sum(radius**3) / np.sum(radius**2))


def usual_permeability(porosity: float, diameter: float) -> float:
    """Kozeny and Carman's permeability with the constant usual for spheres, in squares of the diameter's unit."""
    return float(porosity**3 * diameter**2 / (USUAL_KOZENY_CONSTANT * (1.0 - porosity) ** 2))


def drag_factor(permeability: float, solids: float, diameter: float) -> float:
    """Drag on a sphere of an array over Stokes's: ``D^2 / (18 phi k)``."""
    return diameter**2 / (18.0 * solids * permeability)


@dataclass(frozen=True)
class Limit:
    """A permeability at no spacing.

    Attributes
    ----------
    value : float
        Limit of second order through the two finest values.
    order : float
        Order that three values show; NaN where they show none.
    error : float
        Estimate of the relative error: change of the limit when the finest value is left out.
    """

    value: float
    order: float
    error: float


def extrapolate(spacing: Sequence[float], value: Sequence[float]) -> Limit:
    """Extrapolate three values, coarsest first, to no spacing."""
    coarse, finest = (_limit(spacing[k : k + 2], value[k : k + 2]) for k in (0, 1))
    return Limit(finest, observed_order(spacing, value), abs(coarse / finest - 1.0))


def _limit(spacing: Sequence[float], value: Sequence[float]) -> float:
    return value[1] - (value[0] - value[1]) / (math.pow(spacing[0] / spacing[1], ORDER) - 1.0)


def observed_order(spacing: Sequence[float], value: Sequence[float]) -> float:
    """Order p for which ``value = limit + c spacing^p`` at three spacings; NaN if there is none from 0.1 to 8."""
    h = [s / spacing[2] for s in spacing]

    def excess(p: float) -> float:
        power = [math.pow(x, p) for x in h]
        return (value[0] - value[1]) * (power[1] - power[2]) - (value[1] - value[2]) * (power[0] - power[1])

    low, high = 0.1, 8.0
    if excess(low) * excess(high) >= 0.0:
        return math.nan
    return float(scipy.optimize.brentq(excess, low, high))


def reference_beds() -> list[ReferenceBed]:
    """Make the three beds that both methods are run on; the embedded engine makes the same ones every time."""
    return [_make_bed(name) for name in BEDS]


def _make_bed(name: str) -> ReferenceBed:
    mixture, options = BEDS[name]
    with tempfile.TemporaryDirectory(prefix="filtercake-") as folder:
        made = api.pack(api.distribution(mixture=mixture), folder, **MATERIAL, **PACKING, **options)
        if made.failures:
            raise FiltercakeError(f"the bed {name} was not made: {made.failures[0]}")
        packing = Packing.load(made.files[0])
    return ReferenceBed(name, packing.position, packing.radius, packing.length)


def measure_bed(
    bed: ReferenceBed, resolutions: Sequence[float] = RESOLUTIONS, report: Callable[[str], None] = lambda _: None
) -> dict[str, Any]:
    """Permeability of a bed at three resolutions (about; coarsest first) and in the limit: a row of the table."""
    porosity, diameter = slab_averages(bed.position, bed.radius, bed.length)
    nodes = [int(scipy.fft.next_fast_len(round(bed.length / diameter * r), real=True)) for r in resolutions]
    fineness = [n * diameter / bed.length for n in nodes]
    values = []
    for n, fine in zip(nodes, fineness, strict=True):
        values.append(bed_permeability(bed.position, bed.radius, bed.length, n))
        report(f"{bed.name}: D/h {fine:.1f}, k {values[-1]:.4e} m2")
    limit = extrapolate([1.0 / fine for fine in fineness], values)
    constant = porosity**3 * diameter**2 / (limit.value * (1.0 - porosity) ** 2)
    return {
        "bed": bed.name,
        "spheres": bed.radius.size,
        "seed": SEED,
        "method": METHOD,
        "porosity": porosity,
        "sauter_um": diameter * 1e6,
        **{f"diameter_over_spacing_{k}": fine for k, fine in enumerate(fineness, 1)},
        **{f"k_{k}_m2": value for k, value in enumerate(values, 1)},
        "k_m2": limit.value,
        "order": limit.order,
        "kozeny_constant": constant,
        "relative_error": limit.error,
    }


def _triple(counts: NDArray[np.int_]) -> tuple[int, int, int]:
    return int(counts[0]), int(counts[1]), int(counts[2])


def _say(line: str) -> None:
    print(line, flush=True)


def main() -> None:
    """Make the table of the documentation."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args()
    rows = [measure_bed(bed, FINER.get(bed.name, RESOLUTIONS), _say) for bed in reference_beds()]
    table = pd.DataFrame(rows)
    table.to_csv(options.output, index=False, float_format="%.6g")
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
