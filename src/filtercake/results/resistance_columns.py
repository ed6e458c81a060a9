"""Columns of a table that say what resistance a porosity means: by the study's law, and by those beside it."""

from __future__ import annotations

import math
from typing import Any, Final

from filtercake.crystals.csd import FullAndTruncated
from filtercake.filtration.resistance import (
    ADDITIVE,
    CARMAN,
    STOKES,
    KozenyConstant,
    carman_sauter,
    law_relative_ci95,
    resistance,
)

LAW: Final = "resistance_law"
"""Name of the law that ``resistance_m_kg`` follows."""
LAW_CI95: Final = "resistance_law_ci95_m_kg"
"""Half-width of the 95 % interval of that law, m/kg; the spread of packings has its own, ``resistance_ci95_m_kg``."""
ALWAYS: Final = (ADDITIVE, CARMAN)
"""Laws with a column of their own, whatever the study's: they need porosity and sizes only."""
RESISTANCES: Final = (
    "resistance_m_kg",
    *(f"resistance_{law}_m_kg" for law in ALWAYS),
    f"resistance_{STOKES}_m_kg",
    "resistance_sauter_m_kg",
    "resistance_truncated_m_kg",
)
"""Columns of resistances, m/kg."""


def others(law: str) -> tuple[str, ...]:
    """Laws to be shown beside a study's own."""
    return tuple(name for name in ALWAYS if name != law)


def resistance_columns(
    law: str,
    porosity: float,
    csd: FullAndTruncated,
    density: float,
    sphericity: float,
    kozeny: KozenyConstant | None = None,
) -> dict[str, Any]:
    """Resistances of a cake by column: ``LAW``, ``RESISTANCES`` and ``LAW_CI95``.

    ``resistance_m_kg`` is by the study's law with the full distribution, ``resistance_truncated_m_kg`` by the same law
    with the packed classes alone; ``resistance_stokes_m_kg`` is blank without a constant; ``resistance_sauter_m_kg`` is
    Carman's form with eq. 3's constant.

    Parameters
    ----------
    law : str
        The study's law, a name of :data:`filtercake.filtration.resistance.RESISTANCE_LAWS`.
    porosity : float
        Porosity of the cake, in (0, 1).
    csd : pair of CrystalSizeDistribution
        The full distribution and the packed one.
    density, sphericity : float
        Of the crystals; kg/m3 and in (0, 1].
    kozeny : KozenyConstant, optional
        The constant solved on the packings, for ``stokes``.

    Raises
    ------
    ValueError
        If an argument is out of range, or ``stokes`` has no constant.
    """
    full, packed = csd
    constant, known = (None, ()) if kozeny is None else (kozeny.value, (kozeny.relative_ci95,))
    material = (density, sphericity)
    chosen = resistance(law, porosity, full, *material, constant)
    return {
        LAW: law,
        "resistance_m_kg": chosen,
        **{f"resistance_{name}_m_kg": resistance(name, porosity, full, *material) for name in ALWAYS},
        f"resistance_{STOKES}_m_kg": math.nan
        if kozeny is None
        else resistance(STOKES, porosity, full, *material, constant),
        "resistance_sauter_m_kg": carman_sauter(porosity, full, *material),
        "resistance_truncated_m_kg": resistance(law, porosity, packed, *material, constant),
        LAW_CI95: chosen * law_relative_ci95(law, full, *known),
    }
