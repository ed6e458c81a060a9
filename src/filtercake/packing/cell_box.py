"""The box of a pressure cell: its spheres, their images, the pairs in a box that deforms, and the time loop.

Pairs are searched as the embedded engine does, in a box periodic in x and y, with the spheres near the bottom once more
on top; then every image that a pair needs becomes a row of its own behind the spheres.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from filtercake.errors import CellError, EngineError
from filtercake.packing import cell_kernels, contact_law
from filtercake.packing.cell import CellScene, Look
from filtercake.packing.cloud import size_levels
from filtercake.packing.engines import embedded_kernels as kernels
from filtercake.packing.engines import pair_kernels
from filtercake.packing.engines.vector_kernels import FORCE, VECTOR, aligned
from filtercake.units import MICROMETRE, FloatArray, IntArray

SKIN_DIAMETERS: Final = (0.06, 1.0)
"""Narrowest and widest neighbour skin, over the smallest diameter."""
LISTING_STEPS: Final = 250
"""Time steps that a list of pairs should last."""
_STATE_ARRAYS: Final = ("spheres", "velocity", "spin", "drag", "identity", "level", "box")
_LISTED: Final = ("first", "last", "neighbour", "spring")
LEAST_SIDES: Final = 2.0
"""Shortest side of the box over the largest diameter and the skin: any two spheres touch at one image only."""


class _Found(NamedTuple):
    """Pairs, each once: the first sphere, the second, and which image of it, (m, 3) in sides of the box."""

    first: IntArray
    second: IntArray
    image: IntArray


class CellBox:
    """Spheres in a periodic box under a servo.

    Rows of the arrays are sorted in space at every listing; ``identity`` says which sphere of the scene each is.
    """

    def __init__(self, scene: CellScene, position: FloatArray, sides: FloatArray | float):
        """Start at rest from centres (n, 3), m, in the order of the scene's radii, in a box of these sides (3,), m.

        One number is the side of a cube.
        """
        n = scene.radius.size
        self.scene, self.step = scene, 0
        self.frictional = scene.friction > 0.0
        mass = scene.density * 4.0 / 3.0 * np.pi * scene.radius**3 * scene.heaviness
        self.spheres = np.column_stack([position, scene.radius, np.zeros((n, 3)), mass])
        self.velocity, self.spin = np.zeros((n, 3)), np.zeros((n, 3))
        self.drag = np.empty(n)
        self.identity, self.level = np.arange(n), size_levels(scene.radius)
        self.largest = np.array(
            [scene.radius[self.level == k].max(initial=0.0) for k in range(int(self.level.max()) + 1)]
        )
        self.smallest = 2.0 * float(scene.radius.min())
        self.widest = 2.0 * float(scene.radius.max())
        self.box = np.array([np.full(3, sides), np.zeros(3)])
        self.find_pairs = kernels.make_find_pairs(False)
        self.pair_constants = kernels.make_pair_constants(False)
        self.room = 8 * n
        self.listed_at = 0
        self.skin = SKIN_DIAMETERS[1] * self.smallest
        self._partners: kernels.Pairs | None = None  # as the pairs, by sphere instead of by image
        self.lead_to(scene)
        self._list_pairs()

    def lead_to(self, scene: CellScene) -> None:
        """Go on to the stress and the attraction of another scene that differs in nothing else.

        Drag and servo follow from the stress.
        """
        self.scene, self.law = scene, _law(scene)
        self.kernel = cell_kernels.make_advance(_attraction(scene), self.frictional, scene.uniaxial)
        self.averages = cell_kernels.make_measure(_attraction(scene), self.frictional)
        # the volume changes as fast, whether one side does or three
        self.servo = cell_kernels.Servo(scene.stress, scene.servo * scene.rate / (1.0 if scene.uniaxial else 3.0))
        self.drag[:] = (scene.drag * scene.rate / scene.heaviness)[self.identity]

    @property
    def sides(self) -> FloatArray:
        """Sides of the box, m, shape (3,)."""
        return np.asarray(self.box[0])

    @property
    def length(self) -> float:
        """Side of the box along x and y, m."""
        return float(self.box[0, 0])

    @property
    def height(self) -> float:
        """Side of the box along z, m."""
        return float(self.box[0, 2])

    @property
    def volume(self) -> float:
        """Volume of the box, m3."""
        # in this order the volume of a cube is the cube of its side to the last bit
        return self.length**3 * (self.height / self.length)

    def positions(self) -> FloatArray:
        """Centres in the box, m, shape (n, 3), in the order of the scene's radii."""
        found = np.empty_like(self.velocity)
        found[self.identity] = _wrapped(self.spheres[:, :3], self.sides)
        return found

    def momentum(self) -> FloatArray:
        """Momentum relative to the box, kg m/s, shape (3,)."""
        return np.asarray(self.spheres[:, pair_kernels.MASS] @ self.velocity)

    def advance(self, steps: int) -> None:
        """Advance by ``steps`` time steps.

        Raises
        ------
        CellError
            If the box becomes too narrow for its largest sphere.
        EngineError
            If the cell explodes.
        """
        end = self.step + steps
        while self.step < end:
            done, worn = self.kernel(
                end - self.step, self.bodies, self.motion, self.pairs, self.law, self.servo, self.reach
            )
            self.step += int(done)
            self.spheres[:, :3] = self.bodies.state[: self.identity.size, :3]
            self.spin[:] = self.bodies.spin[: self.identity.size]
            if not (np.isfinite(self.spheres[:, :3]).all() and np.isfinite(self.box).all()):
                raise EngineError(
                    "the cell exploded: positions are no longer finite; use a shorter time step", outcome="exploded"
                )
            if worn:
                self._list_pairs()

    def saved(self) -> dict[str, Any]:
        """Everything that decides how the cell goes on, to the last bit."""
        arrays = {name: getattr(self, name) for name in _STATE_ARRAYS}
        lists: dict[str, Any] = {
            "owner": self.motion.owner,
            "shift": self.motion.shift,
            "reference": self.reach.reference,
            "reference_sides": self.reach.sides,
        }
        lists |= {f"pairs_{name}": getattr(self.pairs, name) for name in _LISTED}
        if self._partners is not None:
            lists["partners"] = self._partners.neighbour
        numbers = np.array([self.step, self.listed_at, self.room, self.skin])
        return {**arrays, **lists, "numbers": numbers}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on from what :meth:`saved` returned for a cell of the same scene and cloud.

        Raises
        ------
        KeyError, ValueError
            If it is not such a state.
        """
        for name in _STATE_ARRAYS:
            getattr(self, name)[...] = saved[name]
        self.step, self.listed_at, self.room = (int(value) for value in saved["numbers"][:3])
        self.skin = float(saved["numbers"][3])
        self._work_on(np.array(saved["owner"]), np.array(saved["shift"]), *(saved[f"pairs_{name}"] for name in _LISTED))
        if self.frictional:
            self._partners = self.pairs._replace(neighbour=np.array(saved["partners"]))
        self.reach = cell_kernels.Reach(
            np.array(saved["reference"]), np.array(saved["reference_sides"]), self.skin, self.widest
        )

    def look(self) -> Look:
        """Take the averages of the present state."""
        found = self.averages(self.bodies, self.motion, self.pairs, self.law)
        porosity = 1.0 - self.scene.solids / self.volume
        return Look(
            step=self.step,
            stress=found.stress,
            porosity=porosity,
            rigid_porosity=porosity + 3.0 * (1.0 - porosity) * found.overlap,
            coordination=2.0 * found.contacts / self.identity.size,
            overlap=found.overlap,
            force_ratio=found.net_force / found.contact_force if found.contacts else np.inf,
        )

    def _list_pairs(self) -> None:
        """Sort the spheres in space and list their pairs anew; tangential springs are carried over."""
        self.skin, self.listed_at = self._choose_skin(), self.step
        narrowest = float(self.sides.min())
        if narrowest < LEAST_SIDES * (self.widest + self.skin):
            raise CellError(
                f"the box, {narrowest / MICROMETRE:.4g} um, is narrower than {LEAST_SIDES:g} of its largest "
                f"spheres ({self.widest / MICROMETRE:.4g} um) and the neighbour skin; use more spheres than "
                f"{self.identity.size}"
            )
        self.spheres[:, :3] = _wrapped(self.spheres[:, :3], self.sides)
        order = kernels.sort_into_cells(
            self.spheres, np.zeros_like(self.level), self.largest[:1], self.length, self.height
        )[0]
        for array in (self.spheres, self.velocity, self.spin, self.drag, self.identity, self.level):
            array[:] = array[order]
        self._fill(self._search(), order)

    def _choose_skin(self) -> float:
        """Skin, m, that lasts ``LISTING_STEPS``, from how long the last one lasted, within bounds."""
        lasted = self.step - self.listed_at
        low, high = (share * self.smallest for share in SKIN_DIAMETERS)
        wanted = self.skin * LISTING_STEPS / lasted if lasted else self.skin
        # a box of few spheres has little room to list
        high = max(min(high, float(self.sides.min()) / LEAST_SIDES - self.widest), low)
        return min(max(wanted, low), high)

    def _search(self) -> _Found:
        """Find the pairs closer than the skin."""
        n, length = self.identity.size, self.length
        above = np.flatnonzero(self.spheres[:, pair_kernels.Z] < self.spheres[:, 3] + 0.5 * self.widest + self.skin)
        owner = np.concatenate([np.arange(n), above])
        rows = self.spheres[owner]
        rows[n:, pair_kernels.Z] += self.height
        level = self.level[owner]
        cell_size = np.maximum(2.0 * self.largest, self.smallest) + self.skin
        top = float(rows[:, pair_kernels.Z].max())
        index, start, shape, offset = kernels.sort_into_cells(rows, level, cell_size, length, top)
        place = np.empty_like(index)
        place[index] = np.arange(index.size)
        half = 0.5 * self.skin
        course, fast = np.zeros(index.size), np.zeros(index.size, dtype=np.bool_)  # in the box none has its own
        grid = kernels.Grid(
            length=length,
            level=level,
            columns=kernels.in_cells(index, rows, course, rows[:, pair_kernels.RADIUS] + half, fast),
            fast=fast,
            member=index,
            place=place,
            start=start,
            shape=shape,
            offset=offset,
            largest=self.largest,
            cell_size=cell_size,
            stride=np.full((2, self.largest.size), half),
            horizon=0,
        )
        first, neighbour = self._raw_pairs(rows, grid)
        second, code = (
            (neighbour & pair_kernels.INDEX_MASK).astype(np.int64),
            (neighbour >> pair_kernels.IMAGE_SHIFT).astype(np.int64),
        )
        high = (np.arange(owner.size) >= n).astype(np.int64)
        image = np.column_stack([code % 3 - 1, code // 3 - 1, high[second] - high[first]])
        keep = (high[first] == 0) | (high[second] == 0)  # both on top: the pair is below, too
        return _Found(owner[first[keep]], owner[second[keep]], image[keep])

    def _raw_pairs(self, rows: FloatArray, grid: kernels.Grid) -> tuple[IntArray, kernels.Neighbours]:
        """First row of each pair, and the second with the code of its image."""
        size = rows.shape[0]
        first, last = np.empty(size, dtype=np.uint64), np.empty(size, dtype=np.uint64)
        while True:
            neighbour = np.empty(self.room, dtype=np.uint32)
            pairs = _pairs(first, last, neighbour, False)
            count = self.find_pairs(rows, grid, pairs)
            if count < self.room:
                counts = (last - first).astype(np.int64)
                return np.repeat(np.arange(size), counts), pairs.neighbour[:count]
            self.room = int(1.3 * count) + 64

    def _fill(self, found: _Found, order: IntArray) -> None:
        """Make images, pairs by sphere, and what the time loop works on, from the pairs found."""
        n = self.identity.size
        by_first = np.argsort(found.first, kind="stable")
        second, image = found.second[by_first], found.image[by_first]
        key = ((image[:, 2] + 1) * 9 + (image[:, 1] + 1) * 3 + image[:, 0] + 1) * n + second
        away = image.any(axis=1)
        images, which = np.unique(key[away], return_inverse=True)
        row = second.copy()
        row[away] = n + which
        code, owner = np.divmod(images, n)
        shift = np.column_stack([code % 3, code // 3 % 3, code // 9]) - 1.0
        bounds = np.searchsorted(found.first[by_first], np.arange(n + 1)).astype(np.uint64)
        same = np.uint32(pair_kernels.SAME_IMAGE) << pair_kernels.IMAGE_SHIFT
        self._work_on(owner, shift, bounds[:-1], bounds[1:], row.astype(np.uint32) | same, None)
        if self.frictional:
            partners = self.pairs._replace(neighbour=second.astype(np.uint32))
            if self._partners is not None:
                kernels.carry_springs(order, self._partners, partners)
            self._partners = partners
        self.reach = cell_kernels.Reach(self.spheres[:, :3].copy(), self.sides.copy(), self.skin, self.widest)

    def _work_on(
        self,
        owner: IntArray,
        shift: FloatArray,
        first: kernels.Unsigned,
        last: kernels.Unsigned,
        neighbour: kernels.Neighbours,
        spring: FloatArray | None,
    ) -> None:
        """Make what the time loop works on, with springs that are there already."""
        rows = np.concatenate([np.arange(self.identity.size), owner])
        state = aligned(rows.size * VECTOR).reshape(-1, VECTOR)
        state[...] = self.spheres[rows]
        force, torque = aligned(2 * rows.size * FORCE).reshape(2, 1, -1, FORCE)
        self.motion = cell_kernels.Motion(self.velocity, self.drag, owner, shift, self.box)
        self.bodies = kernels.Bodies(state, self.spin[rows], force, torque)
        self.pairs = _pairs(first, last, neighbour, self.frictional)
        if spring is not None:
            self.pairs.spring[...] = spring
        damping_ratio = contact_law.damping_ratio(self.scene.restitution)
        self.pair_constants(self.bodies.state, self.pairs, self.scene.modulus, damping_ratio)


def _wrapped(position: FloatArray, sides: FloatArray) -> FloatArray:
    """Centres in the box, from 0 to less than its sides, m."""
    found = position % sides
    found[found >= sides] = 0.0
    return np.asarray(found)


def _attraction(scene: CellScene) -> int:
    """Choose the kind of attraction that the kernels are compiled for."""
    if scene.adhesion > 0.0:
        return pair_kernels.ADHESION
    return pair_kernels.COHESION if scene.cohesion > 0.0 else pair_kernels.NO_ATTRACTION


def _law(scene: CellScene) -> kernels.Law:
    """Collect what is the same for all spheres; images have rows of their own, so that no length is needed."""
    material = scene.youngs_modulus, scene.poisson_ratio
    return kernels.Law(
        gravity=0.0,
        cohesion=float(scene.cohesion),
        friction=float(scene.friction),
        shear_stiffness=contact_law.shear_stiffness_ratio(*material),
        shear_damping=contact_law.shear_damping_ratio(*material),
        length=0.0,
        time_step=scene.time_step,
        adhesion=float(scene.adhesion),
        capped=True,  # nothing ties the cell to LIGGGHTS
    )


def _pairs(
    first: kernels.Unsigned, last: kernels.Unsigned, neighbour: kernels.Neighbours, frictional: bool
) -> kernels.Pairs:
    """Make a pair list with room for its near ones."""
    size = neighbour.size
    return kernels.Pairs(
        bounds=np.array([0, first.size]),
        halo=np.zeros((1, 2), dtype=np.int64),
        first=first,
        last=last,
        neighbour=neighbour,
        constants=np.empty((size, 2)),
        spring=np.zeros((max(size, 1) if frictional else 1, 3)),
        near_end=np.zeros(1, dtype=np.uint64),
        near_owner=np.empty(size, dtype=np.uint32),
        near_neighbour=np.empty(size, dtype=np.uint32),
        near_constants=np.empty((2, size + pair_kernels.VECTOR)),
        near_pair=np.empty(size, dtype=np.uint32),
    )
