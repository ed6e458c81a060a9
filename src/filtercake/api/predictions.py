"""Porosity and resistance at once, without a packing: what a few hundred packings let expect of another one."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from filtercake.api.arguments import ORIGIN
from filtercake.api.packings import as_packed_by_default
from filtercake.api.predict_options import PredictOptions
from filtercake.api.steps import Distribution, csd_name, load, resistance
from filtercake.design.emulator import cake_of
from filtercake.design.emulator_file import shipped
from filtercake.errors import ConfigError, Problem
from filtercake.filtration.resistance import law_of
from filtercake.packing.cloud import NARROW_PARTICLES, cell_for
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.scene import FILTRATION_PROTOCOL, Scene
from filtercake.results.resistance_columns import ALWAYS
from filtercake.study import engine_choice
from filtercake.study.loading import LoadedStudy
from filtercake.study.parsing import parse
from filtercake.study.points import base_point


@dataclass(frozen=True)
class Prediction:
    """What is expected of a cake that was not packed.

    Attributes
    ----------
    protocol : str
        How packings of it would be made.
    porosity : float
        Expected mean of many packings; of a pressed cake, that of the even cake with the same resistance.
    porosity_ci95 : float
        Half-width of the 95 % interval of that mean. It holds what is not known of the model; not that real crystals
        are no spheres, nor what friction and attraction were taken for.
    porosity_packing_ci95 : float
        Half-width of the 95 % interval of one packing, as large as ``pack`` makes it: its own scatter as well.
    porosity_at_medium, compressibility : float or None
        Of a pressed cake: porosity under the whole pressure drop, and exponent n of the average resistance.
    load_over_strength : float or None
        Pressure drop over what the contacts hold; None without attraction, and of settled beds.
    resistance_law : str
        The law asked for.
    resistance_m_kg, resistance_ci95_m_kg, resistance_law_ci95_m_kg : float
        By that law, m/kg; half-widths of its 95 % intervals, from that of the porosity's mean and from the law itself.
    resistance_additive_m_kg, resistance_carman_m_kg : float
        By both laws, m/kg.
    packings : int
        Packings that the estimate is learnt from.
    outside : tuple of str
        Where the cake lies outside of what was packed for it, in words; the intervals are wider there.
    warnings : tuple of str
        Doubts about allowed arguments.
    """

    protocol: str
    porosity: float
    porosity_ci95: float
    porosity_packing_ci95: float
    porosity_at_medium: float | None
    compressibility: float | None
    load_over_strength: float | None
    resistance_law: str
    resistance_m_kg: float
    resistance_ci95_m_kg: float | None
    resistance_law_ci95_m_kg: float | None
    resistance_additive_m_kg: float
    resistance_carman_m_kg: float
    packings: int
    outside: tuple[str, ...]
    warnings: tuple[str, ...]


def predict(source: Distribution, **options: Any) -> Prediction:
    """Estimate porosity and specific resistance of a cake in milliseconds, without a packing.

    Parameters
    ----------
    source : Distribution
        The size distribution; its classes as they would be packed.
    **options
        The fields of :class:`PredictOptions`: what :func:`pack` takes of the crystals and the pressure. Everything else
        is at ``pack``'s defaults.

    Raises
    ------
    ConfigError
        With every problem; also where a cake is too far from all that was packed for an estimate.
    """
    given = parse(PredictOptions, options, str(ORIGIN))
    if law_of(given.law).needs_kozeny_constant:
        allowed = f"needs a packing to solve the flow in; allowed here: {', '.join(ALWAYS)}"
        raise ConfigError([Problem(str(ORIGIN), "law", repr(given.law), allowed)])
    study = _study(source, given)
    scene = _as_large_as_packed(base_point(study, csd_name(study), engine_choice.choose).scene)
    model = shipped()[scene.protocol]
    found = model.estimate(scene)
    cake = cake_of(scene, found.curve)
    half, packing_half = found.half_widths(lambda curve: cake_of(scene, curve).porosity)
    return Prediction(
        protocol=scene.protocol,
        porosity=cake.porosity,
        porosity_ci95=half,
        porosity_packing_ci95=packing_half,
        porosity_at_medium=cake.porosity_at_medium if scene.is_pressed else None,
        compressibility=cake.exponent if scene.is_pressed else None,
        load_over_strength=_finite(scene),
        **_resistances(source, given, scene, (cake.porosity, half)),
        packings=model.packings,
        outside=found.outside,
        warnings=study.warnings,
    )


def _study(source: Distribution, given: PredictOptions) -> LoadedStudy:
    """Check the study of one point that the packings would be of; no bed is made, so none is too small."""
    own = {
        name: value for name, value in given if value is not None and name not in ("protocol", "pressure_kPa", "law")
    }
    packing: dict[str, Any] = {"protocol": given.protocol, "engine": Embedded.name}
    if given.protocol == FILTRATION_PROTOCOL:
        packing["particles"] = NARROW_PARTICLES
    if given.pressure_kPa is not None:
        packing["pressure_kPa"] = given.pressure_kPa
    material, made = as_packed_by_default(own, packing)
    return load(source.options, material, made, given.law, packed=False)


def _as_large_as_packed(scene: Scene) -> Scene:
    """Give a pressed cell the spheres that ``pack`` would take, however many."""
    return replace(scene, particles=cell_for(scene.csd)) if scene.is_pressed else scene


def _finite(scene: Scene) -> float | None:
    """Load over strength of a pressed cake with attraction."""
    known = scene.is_pressed and math.isfinite(scene.load_over_strength)
    return scene.load_over_strength if known else None


def _resistances(
    source: Distribution, given: PredictOptions, scene: Scene, porosity: tuple[float, float]
) -> dict[str, Any]:
    """Resistances by the laws, with the intervals that follow from the porosity's and from the law asked for."""
    found = resistance(
        source,
        porosity=porosity[0],
        porosity_ci95=porosity[1],
        density_kg_m3=scene.density,
        sphericity=given.sphericity,
        law=given.law,
        trust_units=given.trust_units,
    )
    names = ("resistance_law", "resistance_m_kg", "resistance_ci95_m_kg", "resistance_law_ci95_m_kg")
    return {name: getattr(found, name) for name in (*names, *(f"resistance_{law}_m_kg" for law in ALWAYS))}
