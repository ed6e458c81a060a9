"""Permeability of a bed or a periodic cell of spheres: Stokes flow at two resolutions, and how far it can be trusted.

What counts is the pores' hydraulic radius in nodes, ``eps D / (6 (1 - eps))`` over the spacing: it chooses the
lattices. The flow on a coarse one starts the flow on the finer, and their difference says how far it can be trusted.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import scipy

from filtercake.errors import FiltercakeError
from filtercake.packing.contacts import find_contacts, lens_volume
from filtercake.packing.slab import Slab, interior_slab, why_too_thin
from filtercake.permeability.lattice import Lattice, Spheres, build
from filtercake.permeability.resolution import (
    ACCURACY,
    COARSEST_ACCURACY,
    FINEST_ACCURACY,
    LEVELS,
    ORDER,
    bytes_needed,
    spacing,
)
from filtercake.permeability.result import Level, Permeability, Picture
from filtercake.permeability.stokes import Flow
from filtercake.statistics import quantile
from filtercake.units import FloatArray, duration

REMAINDER: Final = 0.013
"""Relative half-width, on the second lattice by default, of what both lattices have in common."""
ALIGNMENT: Final = 0.06
"""Relative half-width, on the second lattice by default, of what depends on where the nodes lie in one sphere."""
FREE_UNITS: Final = 2
"""Layers of fluid under and over a bed, in units: six fine nodes."""
CHUNK: Final = 50
"""Steps between two looks."""
LEAST_STEPS: Final = 150
LAST_BALANCE: Final = 350
MOST_STEPS: Final = 6000
SPREAD: Final = 0.56
"""Relative standard deviation of the Kozeny constant of packings of one kind, times the root of their spheres."""

Report = Callable[[str], None]


@dataclass(frozen=True)
class Domain:
    """Spheres in their box, and the slab of it that is measured.

    ``units`` of the box's side set the lattices; ``counted_twice`` is the share of the spheres' volume in two of them.
    """

    spheres: Spheres
    slab: Slab
    units: int
    periodic: bool
    counted_twice: float = 0.0


def measure_bed(
    position: FloatArray,
    radius: FloatArray,
    length: float,
    *,
    accuracy: float = ACCURACY,
    threads: int = 1,
    say: Report = lambda _: None,
) -> Permeability:
    """Solve the flow through a settled bed and return the permeability of its interior slab, upwards.

    A few layers of fluid lie under and over the bed; the force drives the bed alone, shaped like the local gradient,
    and the permeability follows from the slope of the pressure in the slab.

    Parameters
    ----------
    position : ndarray, shape (n, 3)
        Centres, m, floor at z = 0; x and y periodic.
    radius : ndarray, shape (n,)
        Radii, m.
    length : float
        Side of the periodic box, m.
    accuracy : float
        Relative half-width of the numerical error asked for, 0.003 to 0.2.
    threads : int
        Threads.
    say : callable
        Receives a line per lattice.

    Raises
    ------
    FiltercakeError
        If the bed is too shallow, the accuracy out of range or out of reach of the memory, or the flow does not settle.
    """
    return solve(bed_domain(position, radius, length, accuracy), accuracy, threads=threads, say=say)[0]


def measure_cell(
    position: FloatArray,
    radius: FloatArray,
    box: FloatArray,
    *,
    accuracy: float = ACCURACY,
    threads: int = 1,
    say: Report = lambda _: None,
) -> Permeability:
    """Solve the flow along z through a cell that is periodic in all directions; as :func:`measure_bed`.

    The sides ``box`` (3,), m, must be equal, or the second and third whole multiples of the lattices' spacings.
    """
    return solve(cell_domain(position, radius, box, accuracy), accuracy, threads=threads, say=say)[0]


def bed_domain(position: FloatArray, radius: FloatArray, length: float, accuracy: float = ACCURACY) -> Domain:
    """Put a bed into a box with free layers; parameters and errors as those of :func:`measure_bed`."""
    slab = interior_slab(position, radius)
    thin = why_too_thin(slab, radius)
    if thin:
        raise FiltercakeError(thin)
    heights = np.linspace(slab.lower, slab.upper, 201)
    porosity, sauter = _mean_pores(position, radius, length**2, heights, np.ones(heights.size))
    units = _units(length, porosity, sauter, accuracy)
    unit = length / units
    bottom, top = float((position[:, 2] - radius).min()), float((position[:, 2] + radius).max())
    layers = math.ceil((top - bottom) / unit) + 2 * FREE_UNITS
    box = np.array([length, length, layers * unit])
    return Domain(
        Spheres(position, radius, box, bottom - FREE_UNITS * unit),
        slab,
        units,
        False,
        _counted_twice(position, radius, length),
    )


def cell_domain(position: FloatArray, radius: FloatArray, box: FloatArray, accuracy: float = ACCURACY) -> Domain:
    """Take a periodic cell as it is; parameters and errors as those of :func:`measure_cell`."""
    porosity, sauter = _whole(radius, float(np.prod(box)))
    units = _units(float(box[0]), porosity, sauter, accuracy)
    twice = _counted_twice(position, radius, float(box[0])) if box[0] == box[1] else 0.0
    return Domain(Spheres(position, radius, np.asarray(box)), Slab(0.0, float(box[2])), units, True, twice)


def solve(
    domain: Domain, accuracy: float = ACCURACY, *, threads: int = 1, say: Report = lambda _: None, picture: bool = False
) -> tuple[Permeability, Picture | None]:
    """Solve the flow on two lattices, on more where they differ too much, and take the finest.

    With ``picture``, the speed in a cut is returned as well.
    """
    started = time.perf_counter()
    flow, levels, memory = _converge(domain, accuracy, threads, say)
    spheres, value = _effective_spheres(domain), levels[-1].permeability
    pores = _Slabs(domain, flow)
    porosity, sauter = pores.means()
    result = Permeability(
        permeability=value,
        porosity=porosity,
        sauter_diameter=sauter,
        kozeny_constant=_kozeny_constant(value, porosity, sauter),
        resolution=_resolution(levels, spheres, accuracy),
        convergence=levels[-1].convergence,
        slab=quantile() * SPREAD / math.sqrt(spheres),
        levels=tuple(levels),
        seconds=time.perf_counter() - started,
        memory_bytes=memory,
    )
    return result, _cut(domain, flow) if picture else None


def _converge(domain: Domain, accuracy: float, threads: int, say: Report) -> tuple[Flow, list[Level], float]:
    """Solve on finer and finer lattices; return the last flow, what each found, and the most memory taken, bytes."""
    started, levels, memory = time.perf_counter(), list[Level](), 0.0
    spheres = _effective_spheres(domain)
    flow: Flow | None = None
    for multiple in LEVELS:
        across = domain.units * multiple
        memory = max(memory, _check_memory(domain, across))
        coarse, flow = flow, _flow(domain, across, threads)
        if coarse is not None:
            places = (np.arange(flow.force.size) + 0.5) * coarse.force.size / flow.force.size - 0.5
            flow.push(np.interp(places, np.arange(coarse.force.size), coarse.force))
            flow.start_from(coarse)
        levels.append(_settle(domain, flow, accuracy))
        say(_line(levels[-1], time.perf_counter() - started))
        if len(levels) > 1 and _resolution(levels, spheres, accuracy) <= accuracy:
            break
    assert flow is not None
    return flow, levels, memory


def _units(length: float, porosity: float, sauter: float, accuracy: float) -> int:
    if not FINEST_ACCURACY <= accuracy <= COARSEST_ACCURACY:
        raise FiltercakeError(f"accuracy = {accuracy:g}: must be {FINEST_ACCURACY:g} to {COARSEST_ACCURACY:g}")
    return max(2, math.ceil(length / spacing(porosity, sauter, accuracy) / LEVELS[1]))


def _kozeny_constant(permeability: float, porosity: float, sauter: float) -> float:
    return porosity**3 * sauter**2 / (permeability * (1.0 - porosity) ** 2)


def _resolution(levels: list[Level], spheres: float, accuracy: float) -> float:
    """Relative half-width of the finest lattice's permeability."""
    coarse, fine = levels[-2:]
    still = (fine.permeability / coarse.permeability - 1.0) / ((fine.across / coarse.across) ** ORDER - 1.0)
    # the spacing over that of the second lattice at the default accuracy
    coarser = LEVELS[1] / LEVELS[0] * levels[0].across / fine.across * (accuracy / ACCURACY) ** (1.0 / ORDER)
    common = math.hypot(REMAINDER, ALIGNMENT / math.sqrt(spheres)) * coarser**ORDER
    return math.hypot(still, common)


def _effective_spheres(domain: Domain) -> float:
    """Return the spheres of the slab, each counting by its surface: as many equal ones would spread as much."""
    height, slab = domain.spheres.position[:, 2], domain.slab
    inside = ((height >= slab.lower) & (height <= slab.upper)) | domain.periodic
    surface = domain.spheres.radius[inside] ** 2
    return float(surface.sum() ** 2 / np.sum(surface**2)) if surface.size else 1.0


def _flow(domain: Domain, across: int, threads: int) -> Flow:
    lattice = build(domain.spheres, across)
    return Flow(lattice, _force(domain, lattice), threads=threads)


def _settle(domain: Domain, flow: Flow, accuracy: float) -> Level:
    """Run until what is still to come hardly matters."""
    slabs = _Slabs(domain, flow)
    found = [slabs.permeability()]
    left = math.inf
    while not (flow.steps >= LEAST_STEPS and left < accuracy / 10.0):
        _balance(flow, slabs.means()[1])
        flow.run(CHUNK)
        found.append(slabs.permeability())
        if (not found[-1] > 0.0 and flow.steps >= LEAST_STEPS) or flow.steps >= MOST_STEPS:
            nodes = f"{flow.steps} steps on {flow.lattice.fluid:,} nodes"
            raise FiltercakeError(f"the flow has not settled after {nodes}: k = {found[-1]:.4g} m2")
        left = _to_come(found)
    spacing = flow.lattice.spacing
    return Level(flow.lattice.shape[2], slabs.means()[1] / spacing, found[-1], left, flow.steps, flow.lattice.fluid)


def _balance(flow: Flow, sauter: float) -> None:
    """Push less where more flows than on average, as the pressure would after thousands of steps.

    A few times only: where the flow answers late, more would build up.
    """
    if not 2 * CHUNK <= flow.steps <= LAST_BALANCE:
        return
    reach = 0.5 * sauter / flow.lattice.spacing
    pressure, _, flux = flow.layers()
    gradient = flow.force - 0.5 * (np.roll(pressure, -1) - np.roll(pressure, 1))
    gradient, flux = np.maximum(_smooth(gradient, reach), 0.0), _smooth(flux, reach)
    mean = float(np.sum(flux * gradient) / gradient.sum())
    flow.push(flow.force - 0.5 * gradient * np.clip(flux / mean - 1.0, -0.5, 0.5))


def _to_come(found: list[float]) -> float:
    """Relative change still to come if a series goes on as it did, and no less than its last step."""
    if len(found) < 4:
        return math.inf
    last, before = abs(found[-1] - found[-2]), abs(found[-2] - found[-3])
    ratio = min(last / before, 0.9) if before > 0.0 else 0.0
    return max(last * ratio / (1.0 - ratio), last) / abs(found[-1])


def _force(domain: Domain, lattice: Lattice) -> FloatArray:
    """Force of each layer, 1 on average in the slab: in a cell the same everywhere, in a bed like the gradient to come.

    What layers resist goes as the square of their surface over the cube of their porosity; without that, the pressure
    between them would take thousands of steps to build up.
    """
    heights, spheres = _heights(domain, lattice), domain.spheres
    if domain.periodic:
        return np.ones(heights.size)
    area = float(spheres.box[0] * spheres.box[1])
    solid, surface = np.zeros(heights.size), np.zeros(heights.size)
    for z, r in zip(spheres.position[:, 2], spheres.radius, strict=True):
        first, last = np.searchsorted(heights, (z - r, z + r))
        solid[first:last] += np.pi * (r**2 - (heights[first:last] - z) ** 2) / area
        surface[first:last] += 2.0 * np.pi * r / area
    reach = float(np.sum(spheres.radius**3) / np.sum(spheres.radius**2))
    solid, surface = (_smooth(of, reach / lattice.spacing) for of in (solid, surface))
    top = domain.slab.upper + 2.0 * float(spheres.radius.max())
    force = np.where((heights > 0.0) & (heights < top), surface**2 / np.maximum(1.0 - solid, 0.05) ** 3, 0.0)
    force /= force[(heights > domain.slab.lower) & (heights < domain.slab.upper)].mean()
    return np.asarray(force)


def _smooth(layers: FloatArray, reach: float) -> FloatArray:
    """Average over neighbouring layers, so many to either side."""
    window = np.hanning(2 * max(1, int(reach)) + 3)[1:-1]
    return np.asarray(scipy.ndimage.convolve1d(layers, window / window.sum(), mode="wrap"))


def _heights(domain: Domain, lattice: Lattice) -> FloatArray:
    """Heights of the layers of nodes, m."""
    return np.asarray(domain.spheres.bottom + (np.arange(lattice.shape[0]) + 0.5) * lattice.spacing)


def _mean_pores(
    position: FloatArray, radius: FloatArray, area: float, heights: FloatArray, weights: FloatArray
) -> tuple[float, float]:
    """Porosity, overlaps counted twice, and Sauter mean diameter (m) over weighted heights."""
    weights = weights / weights.sum()
    solid = 0.0
    over_diameter = 0.0
    for z, r in zip(position[:, 2], radius, strict=True):
        first, last = np.searchsorted(heights, (z - r, z + r))
        volume = float(np.pi * np.sum(weights[first:last] * (r**2 - (heights[first:last] - z) ** 2)))
        solid += volume
        over_diameter += volume / (2.0 * r)
    return max(1.0 - solid / area, 0.05), solid / over_diameter


def _whole(radius: FloatArray, volume: float) -> tuple[float, float]:
    """Porosity, overlaps counted twice, and Sauter mean diameter (m) of spheres in a volume (m3)."""
    spheres = 4.0 / 3.0 * np.pi * radius**3
    return max(1.0 - float(spheres.sum()) / volume, 0.05), float(spheres.sum() / np.sum(spheres / (2.0 * radius)))


def _counted_twice(position: FloatArray, radius: FloatArray, length: float) -> float:
    """Share of the spheres' volume that lies in two of them; contacts through the faces in z are not looked for."""
    if radius.size < 2:
        return 0.0
    lenses = lens_volume(find_contacts(position, radius, length), radius)
    return float(lenses.sum() / np.sum(4.0 / 3.0 * np.pi * radius**3))


class _Slabs:
    """What the layers of a flow say of slabs of the bed."""

    def __init__(self, domain: Domain, flow: Flow):
        self.domain, self.flow = domain, flow
        self.heights = _heights(domain, flow.lattice)
        self.inside = np.flatnonzero((self.heights > domain.slab.lower) & (self.heights < domain.slab.upper))

    def permeability(self) -> float:
        """Return the permeability of the slab, m2."""
        speed = self.flow.layers()[1]
        if self.domain.periodic:
            gradient, velocity = float(self.flow.force.mean()), float(speed.mean())
        else:
            x = self.inside - self.inside.mean()
            gradient = float(np.sum(x * self.flow.potential()[self.inside]) / np.sum(x * x))
            velocity = float(np.sum(speed[self.inside] * self._weights()))
        return velocity * self.flow.viscosity / gradient * self.flow.lattice.spacing**2

    def means(self) -> tuple[float, float]:
        """Return porosity and Sauter mean diameter (m), each layer weighted as in the slope of the pressure."""
        spheres, counted_twice = self.domain.spheres, self.domain.counted_twice
        if self.domain.periodic:
            porosity, sauter = _whole(spheres.radius, float(np.prod(spheres.box)))
        else:
            area, heights = float(spheres.box[0] * spheres.box[1]), self.heights[self.inside]
            porosity, sauter = _mean_pores(spheres.position, spheres.radius, area, heights, self._weights())
        return 1.0 - (1.0 - porosity) * (1.0 - counted_twice), sauter

    def _weights(self) -> FloatArray:
        """Weights with which the slope of a line over the slab takes the gradient of each layer: a parabola."""
        x = np.arange(self.inside.size) + 0.5
        weights = x * (self.inside.size - x)
        return np.asarray(weights / weights.sum())


def _cut(domain: Domain, flow: Flow) -> Picture:
    """Take the speed in the upright cut through the middle."""
    nz, ny, nx = flow.lattice.shape
    plane = flow.lattice.number[:, ny // 2, :]
    speed = np.full((nz, nx), np.nan)
    fluid = plane >= 0
    speed[fluid] = np.linalg.norm(flow.velocity()[plane[fluid]], axis=1)
    return Picture(speed / float(flow.layers()[1].mean()), flow.lattice.spacing, domain.spheres.bottom)


def _check_memory(domain: Domain, across: int) -> float:
    """Return the bytes that a lattice takes; an error where the machine has fewer."""
    box, spacing = domain.spheres.box, float(domain.spheres.box[0]) / across
    volume = float(np.sum(4.0 / 3.0 * np.pi * domain.spheres.radius**3))
    needed = bytes_needed(box, spacing, max(1.0 - volume / float(np.prod(box)), 0.05))
    free = available_bytes()
    if needed > free:
        raise FiltercakeError(
            f"the flow on {across} nodes across the box takes {needed / 1e9:.3g} GB of memory, and {free / 1e9:.3g} GB "
            "are free: use a larger accuracy, or fewer particles"
        )
    return needed


def available_bytes() -> float:
    """Memory that the machine has to spare."""
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * float(line.split()[1])
    except OSError:
        pass
    return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def _line(level: Level, seconds: float) -> str:
    return (
        f"{level.diameters_per_spacing:.1f} nodes per mean diameter: {level.nodes:,} nodes, {level.steps} steps, k = "
        f"{level.permeability:.4g} m2, {duration(seconds)}"
    )
