"""What is measured on packings that stand: porosity, and porosity over height."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from filtercake.errors import CsdError, PackingRejected
from filtercake.packing.porosity import measure, porosity_profile
from filtercake.packing.result import Packing
from filtercake.packing.scene import Scene
from filtercake.packing.slab import bed_height
from filtercake.units import MICROMETRE

if TYPE_CHECKING:
    import pandas as pd

SLICES_PER_DIAMETER = 20


@dataclass(frozen=True)
class PackingPorosity:
    """Porosities of one packing.

    Attributes
    ----------
    porosity : float
        Exact, in the interior of the bed: the answer. Of a pressed cell, that of rigid spheres under the last load.
    porosity_from_floor : float or None
        Exact, from the floor up, the layer ordered by the floor included; None without a floor.
    porosity_paper_count : float or None
        The paper's estimate: spheres counted whole by centre; None without a floor.
    soft_contact_compaction : float
        Estimated loss of porosity because contacts overlap.
    interior_from_um, interior_to_um, bed_height_um : float
        Heights, um.
    particles : int
        Number of spheres.
    engine : str
        Name of the engine.
    """

    porosity: float
    porosity_from_floor: float | None
    porosity_paper_count: float | None
    soft_contact_compaction: float
    interior_from_um: float
    interior_to_um: float
    bed_height_um: float
    particles: int
    engine: str


def porosity(npz: str | Path) -> PackingPorosity:
    """Measure a packing's porosity; its record (``.json``) lies beside the ``npz`` file.

    Raises
    ------
    PackingRejected
        If a file is missing, damaged, not what was accepted, or the bed has no interior.
    """
    packing, scene = load_packing(Path(npz))
    try:
        found = measure(packing, scene)
    except ValueError as error:
        raise PackingRejected([f"{npz}: {error}; use more particles"]) from None
    return PackingPorosity(
        porosity=found.interior,
        porosity_from_floor=None if packing.is_cell else found.from_floor,
        porosity_paper_count=None if packing.is_cell else found.paper_count,
        soft_contact_compaction=found.compaction,
        interior_from_um=found.slab.lower / MICROMETRE,
        interior_to_um=found.slab.upper / MICROMETRE,
        bed_height_um=(packing.length if packing.is_cell else bed_height(packing.position, packing.radius))
        / MICROMETRE,
        particles=int(packing.radius.size),
        engine=scene.engine,
    )


def profile(npz: str | Path, slices_per_diameter: int = SLICES_PER_DIAMETER) -> pd.DataFrame:
    """Tabulate a packing's porosity over height, in exact slices from the floor to the topmost sphere.

    The columns are height_um (of a slice's middle) and porosity; errors are those of :func:`porosity`. A pressed cell
    is cut from its lower face to the upper one, with what reaches in from beyond.
    """
    import pandas as pd

    packing, _ = load_packing(Path(npz))
    if packing.is_cell:
        packing = _stacked(packing)
    top = packing.length if packing.is_cell else float((packing.position[:, 2] + packing.radius).max())
    slices = max(1, math.ceil(top * slices_per_diameter / (2.0 * float(packing.radius.max()))))
    edges = np.linspace(0.0, top, slices + 1)
    values = porosity_profile(packing.position, packing.radius, packing.length, edges)
    return pd.DataFrame({"height_um": 0.5 * (edges[1:] + edges[:-1]) / MICROMETRE, "porosity": values})


def _stacked(packing: Packing) -> Packing:
    """Put a cell's spheres that reach through its lower or upper face beyond the other one as well."""
    lifts = packing.length * np.array([0.0, 1.0, -1.0])
    position = np.concatenate([packing.position + np.array([0.0, 0.0, lift]) for lift in lifts])
    radius = np.tile(packing.radius, lifts.size)
    inside = (position[:, 2] + radius > 0.0) & (position[:, 2] - radius < packing.length)
    return replace(packing, position=position[inside], radius=radius[inside])


def load_packing(npz: Path) -> tuple[Packing, Scene]:
    """Read a packing and what it is made of, and make sure that it is one.

    Raises
    ------
    PackingRejected
        If a file is missing, damaged, or not what was accepted.
    """
    if not npz.name:
        raise PackingRejected([f"{str(npz)!r} is not the name of a packing's file"])
    try:
        packing = Packing.load(npz)
    except PackingRejected as error:
        raise PackingRejected([f"{npz.parent}: {error}"]) from None
    try:
        scene = Scene.from_dict(packing.diagnostics["scene"])
    except KeyError:
        raise PackingRejected([f"{npz.with_suffix('.json')} does not say what was packed (no scene)"]) from None
    except (CsdError, OverflowError, TypeError, ValueError) as error:
        raise PackingRejected([f"{npz.with_suffix('.json')} does not say what was packed: {error}"]) from None
    n = packing.radius.size
    sound = n > 0 and packing.radius.shape == (n,) and packing.position.shape == (n, 3) and packing.length > 0.0
    if not (sound and np.isfinite(packing.position).all() and (packing.radius > 0.0).all()):
        raise PackingRejected([f"{npz} does not hold a packing"])
    return packing, scene
