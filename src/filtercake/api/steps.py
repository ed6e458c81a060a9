"""The library for scripts and notebooks: the steps of a study, one function each, without Snakemake.

Arguments have the names, units, defaults and ranges of the configuration (docs/config-reference.md) and are checked the
same way; results have the names of the columns of ``summary.csv``. Examples are in docs/api.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from filtercake.api.arguments import ORIGIN, OUT_OF_REACH, SOURCES
from filtercake.crystals.crystallizer import SteadyState
from filtercake.crystals.csd import CrystalSizeDistribution, kept_volume
from filtercake.errors import ConfigError, Problem
from filtercake.filtration.resistance import CARMAN, KozenyConstant, law_of, log_sensitivity
from filtercake.packing.cloud import NARROW_PARTICLES
from filtercake.results.resistance_columns import ALWAYS, LAW_CI95, resistance_columns
from filtercake.study.config.crystals import Lognormal, RosinRammler
from filtercake.study.config.values import TO_NUMBER, Density, LawName, Model
from filtercake.study.limits import unit_problems
from filtercake.study.loading import LoadedStudy, check_study
from filtercake.study.parsing import parse
from filtercake.units import MICROMETRE

CSD = "csd"
"""Name of the distribution in the study of one point."""
CRYSTALLIZER_OPTIONS = ("kinetics", "kinetics_file", "slurry_concentration_kg_m3", "bin_width_um")
PLAIN_DENSITY = 1000.0
"""Density, kg/m3, for checking a distribution on its own: nothing about its sizes follows from it, or from the spheres
that a bed of it needs."""
LARGEST_RESISTANCE = 1e100
"""m/kg; beyond, squares leave floating point."""


@dataclass(frozen=True)
class Distribution:
    """A crystal size distribution, whole and as it is packed.

    Attributes
    ----------
    full, truncated : CrystalSizeDistribution
        The whole distribution, which the resistance needs, and the one that is packed.
    density_kg_m3 : float or None
        Crystal density, kg/m3, where a crystallizer's kinetics say it.
    crystallizer : SteadyState or None
        The crystallizer that makes it.
    options : dict
        The arguments it was made from.
    """

    full: CrystalSizeDistribution
    truncated: CrystalSizeDistribution
    density_kg_m3: float | None
    crystallizer: SteadyState | None
    options: dict[str, Any]

    @property
    def kept_volume_fraction(self) -> float:
        """Share of the crystal volume that is packed."""
        return kept_volume(self.full, self.truncated)


@dataclass(frozen=True)
class Resistance:
    """Specific resistance of a cake.

    Attributes
    ----------
    resistance_law : str
        The law asked for.
    resistance_m_kg : float
        By that law, m/kg.
    resistance_ci95_m_kg : float or None
        Half-width of its 95 % interval from that of the porosity, to first order; None where that is not given.
    resistance_law_ci95_m_kg : float or None
        Half-width of its 95 % interval from the law itself; None where a solved constant's is not given.
    resistance_additive_m_kg, resistance_carman_m_kg : float
        By the laws ``additive`` (paper, eq. 3) and ``carman`` (Sauter mean), m/kg.
    resistance_sauter_m_kg : float
        By Carman's form with eq. 3's constant, m/kg.
    change_per_0p01_porosity : float
        Relative change of all of them when the porosity rises by 0.01, to first order.
    """

    resistance_law: str
    resistance_m_kg: float
    resistance_ci95_m_kg: float | None
    resistance_law_ci95_m_kg: float | None
    resistance_additive_m_kg: float
    resistance_carman_m_kg: float
    resistance_sauter_m_kg: float
    change_per_0p01_porosity: float


class ResistanceOptions(Model):
    """Arguments of :func:`resistance`, besides the distribution."""

    law: LawName = Field(
        default=CARMAN,
        description="Law of the resistance: additive is the paper's eq. 3, carman takes the Sauter mean, stokes a "
        "constant from the flow solved in packings.",
    )

    porosity: Annotated[float, Field(ge=0.001, le=0.999, allow_inf_nan=False), TO_NUMBER] = Field(
        description="Porosity of the cake."
    )
    porosity_ci95: Annotated[float, Field(ge=0, le=0.5, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None, description="Half-width of the porosity's 95 % interval, for the resistance's."
    )
    kozeny_constant: Annotated[float, Field(ge=1, le=10_000, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None, description="Kozeny constant solved on packings; goes with the law stokes."
    )
    kozeny_constant_ci95: Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False), TO_NUMBER] | None = Field(
        default=None, description="Half-width of that constant's 95 % interval."
    )
    density_kg_m3: Density | None = Field(
        default=None, description="Crystal density, kg/m3; that of the crystallizer's kinetics if left out."
    )
    sphericity: Annotated[float, Field(ge=0.01, le=1, allow_inf_nan=False), TO_NUMBER] = Field(
        default=1.0, description="Sphericity of the crystals."
    )
    trust_units: bool = Field(default=False, description="Take density and sizes as they are, however unlikely.")


def distribution(**options: Any) -> Distribution:
    """Make a crystal size distribution: a mixture, a file, a law of few numbers, or a crystallizer's product.

    Parameters
    ----------
    **options
        Exactly one of ``mixture`` (a mapping or pairs of sizes in um and volume fractions), ``file`` (a CSV with the
        columns size_um, volume_fraction, or as a spreadsheet or an instrument writes it), ``lognormal`` (d10, d50 and
        d90 in um), ``rosin_rammler`` (size in um and exponent) and ``kinetics`` (with ``residence_time_min`` and
        ``slurry_concentration_kg_m3``; ``kinetics_file``, ``bin_width_um``); besides,
        ``truncate_below_volume_fraction``, ``truncate_below_um`` and ``truncate_above_um``, which leave classes out
        of the packing.

    Raises
    ------
    ConfigError
        With every problem.

    Examples
    --------
    >>> round(distribution(mixture={20: 0.5, 50: 0.5}).full.sauter_mean * 1e6, 2)
    28.57
    """
    options = {name: value for name, value in options.items() if value is not None}
    material = {"trust_units": True, **({} if "kinetics" in options else {"density_kg_m3": PLAIN_DENSITY})}
    study = load(options, material, {"particles": NARROW_PARTICLES}, packed=False)
    return _distribution(study, options)


def resistance(source: Distribution, **options: Any) -> Resistance:
    """Specific cake resistance from porosity and size distribution, by a law, with the others beside it.

    Parameters
    ----------
    source : Distribution
        The size distribution; all of it counts, whatever is left out of the packing.
    **options
        ``porosity``, ``porosity_ci95``, ``density_kg_m3`` (not needed with kinetics), ``sphericity``,
        ``trust_units``; ``law`` (carman if left out), and with ``stokes`` ``kozeny_constant`` and
        ``kozeny_constant_ci95``.

    Raises
    ------
    ConfigError
        With every problem.
    """
    given = parse(ResistanceOptions, options, str(ORIGIN))
    density = given.density_kg_m3 if given.density_kg_m3 is not None else source.density_kg_m3
    if density is None:
        raise ConfigError([_problem("density_kg_m3", "(missing)", "must be given")])
    unlikely = () if given.trust_units else unit_problems(source.full, density)
    problems = [
        _problem(
            "distribution" if finding.key == "sizes" else "density_kg_m3",
            "" if finding.key == "sizes" else f"{density:g}",
            f"{finding.text}; if the unit is right, say trust_units",
        )
        for finding in unlikely
    ]
    if problems:
        raise ConfigError(problems)
    kozeny = _kozeny(given)
    try:
        found = resistance_columns(
            given.law, given.porosity, (source.full, source.full), density, given.sphericity, kozeny
        )
        if max(found[f"resistance_{law}_m_kg"] for law in ALWAYS) <= LARGEST_RESISTANCE:
            return _resistance(given, found)
    except (ZeroDivisionError, OverflowError):
        pass
    allowed = f"is too small to compute with, at {density:g} kg/m3 and a sphericity of {given.sphericity:g}"
    raise ConfigError([_problem("porosity", f"{given.porosity:g}", allowed)])


def _kozeny(given: ResistanceOptions) -> KozenyConstant | None:
    """Constant of the law ``stokes``; refuses one that is missing, or that the law has no use for."""
    constant, half = given.kozeny_constant, given.kozeny_constant_ci95
    if law_of(given.law).needs_kozeny_constant:
        if constant is None:
            raise ConfigError([_problem("kozeny_constant", "(missing)", f"must be given with the law {given.law}")])
        return KozenyConstant(constant, math.nan if half is None else half / constant)
    for name, value in (("kozeny_constant", constant), ("kozeny_constant_ci95", half)):
        if value is not None:
            raise ConfigError([_problem(name, f"{value:g}", f"goes with the law stokes, not {given.law}")])
    return None


def _resistance(given: ResistanceOptions, found: Mapping[str, Any]) -> Resistance:
    """Make the answer from the columns of a table."""
    sensitivity, law_half = log_sensitivity(given.porosity), found[LAW_CI95]
    names = [field.name for field in fields(Resistance) if field.name in found]
    shown = {name: found[name] for name in names if name != LAW_CI95}
    return Resistance(
        **shown,
        resistance_ci95_m_kg=(
            None if given.porosity_ci95 is None else found["resistance_m_kg"] * abs(sensitivity) * given.porosity_ci95
        ),
        resistance_law_ci95_m_kg=law_half if math.isfinite(law_half) else None,
        change_per_0p01_porosity=0.01 * sensitivity,
    )


def load(
    source: Mapping[str, Any],
    material: Mapping[str, Any],
    packing: Mapping[str, Any],
    law: str = CARMAN,
    *,
    packed: bool = True,
) -> LoadedStudy:
    """Check a study of one point: a :func:`distribution`'s arguments, the blocks ``material`` and ``packing``, a law.

    Raises
    ------
    ConfigError
        With every problem.
    """
    problems = list(_source_problems(source))
    if problems:
        raise ConfigError(problems)
    cut = {name: value for name, value in source.items() if name.startswith("truncate_")}
    study: dict[str, Any] = {"material": dict(material), "resistance_law": law, "packing": dict(packing)}
    if "kinetics" in source:
        mixer = {name: source[name] for name in CRYSTALLIZER_OPTIONS if name in source}
        study["crystallizer"] = {**mixer, **cut}
        study["sweeps"] = [{"residence_time_min": [source.get("residence_time_min")]}]
    else:
        study["csds"] = {CSD: {**_origin(source), **cut}}
        study["sweeps"] = [{"csd": [CSD]}]
    with np.errstate(all="ignore"):
        try:
            loaded = check_study(study, ORIGIN, packed=packed)
        except (ZeroDivisionError, OverflowError):
            raise ConfigError([_problem("options", "", OUT_OF_REACH)]) from None
        except ConfigError as error:
            named = {"resistance_law": "law"}  # the argument that the key is here
            raise ConfigError([replace(p, key=named.get(p.key, p.key)) for p in error.problems]) from None
        _check_sums(loaded)
    return loaded


def csd_name(study: LoadedStudy) -> str:
    """Name of the distribution of a study of one point."""
    return next(iter(study.csds))


def _distribution(study: LoadedStudy, options: dict[str, Any]) -> Distribution:
    found = study.csds[csd_name(study)]
    density = study.model.material.density if "kinetics" in options else None
    return Distribution(found.full, found.truncated, density, found.crystallizer, options)


def _source_problems(source: Mapping[str, Any]) -> Sequence[Problem]:
    """Missing, surplus and contradictory arguments of a distribution."""
    known = (*SOURCES[:-1], "residence_time_min", *CRYSTALLIZER_OPTIONS)
    cuts = ("truncate_below_volume_fraction", "truncate_below_um", "truncate_above_um")
    problems = [
        _problem(name, repr(value), f"unknown option; allowed: {', '.join((*known, *cuts))}")
        for name, value in source.items()
        if name not in (*known, *cuts)
    ]
    named = [name for name in SOURCES if name in source]
    if len(named) != 1:
        said = " and ".join(named) or "(missing)"
        allowed = f"needs exactly one of {', '.join(SOURCES[:-1])} and {SOURCES[-1]}"
        problems.append(_problem("distribution", said, allowed))
    elif named == ["kinetics"]:
        asked = [name for name in ("residence_time_min", "slurry_concentration_kg_m3") if name not in source]
        problems += [_problem(name, "(missing)", "must be given with kinetics") for name in asked]
    else:
        idle = [name for name in ("residence_time_min", *CRYSTALLIZER_OPTIONS) if name in source]
        problems += [_problem(name, str(source[name]), "needs kinetics") for name in idle]
    return problems


def _origin(source: Mapping[str, Any]) -> dict[str, Any]:
    """Key of a study's distribution, with its value, from the arguments."""
    for name, law in (("lognormal", Lognormal), ("rosin_rammler", RosinRammler)):
        if name in source:
            given = source[name]
            keys = list(law.model_fields)
            if isinstance(given, Mapping):
                return {name: dict(given)}
            if (
                isinstance(given, (str, bytes))
                or not isinstance(given, Iterable)
                or len(values := list(given)) != len(keys)
            ):
                raise ConfigError([_problem(name, repr(given)[:60], f"must be {len(keys)} numbers: {', '.join(keys)}")])
            return {name: dict(zip(keys, values, strict=True))}
    return {"file": str(source["file"])} if "file" in source else {"mixture": _classes(source["mixture"])}


def _classes(mixture: Any) -> list[dict[str, Any]]:
    """Classes of a mixture given as a mapping or as pairs."""
    pairs = mixture.items() if isinstance(mixture, Mapping) else mixture
    try:
        return [{"size_um": size, "volume_fraction": fraction} for size, fraction in pairs]
    except (TypeError, ValueError):
        allowed = "must be sizes in um with their volume fractions, e.g. {20: 0.5, 50: 0.5}"
        raise ConfigError([_problem("mixture", repr(mixture)[:60], allowed)]) from None


def _check_sums(study: LoadedStudy) -> None:
    """Refuse sizes so far apart, or so small, that their numbers leave floating point."""
    csd = study.csds[csd_name(study)].full
    sums = np.array([csd.sum_x_over_d, csd.sum_x_over_d2, csd.mean_particle_volume])
    if not (np.isfinite(csd.number_fraction).all() and np.isfinite(sums**2).all() and (sums**2 > 0.0).all()):
        shown = f"{csd.smallest / MICROMETRE:g} to {csd.largest / MICROMETRE:g} um"
        raise ConfigError([_problem("distribution", shown, "sizes are too small or too far apart to compute with")])


def _problem(key: str, value: str, allowed: str) -> Problem:
    return Problem(str(ORIGIN), key, value, allowed)
