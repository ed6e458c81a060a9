"""Products of a crystallizer: a distribution per residence time, and the density of the crystals."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from filtercake.crystals.crystallizer import Kinetics, get_kinetics, load_kinetics
from filtercake.errors import ConfigError, CrystallizerError, Problem
from filtercake.study.config.crystals import Crystallizer, Csd
from filtercake.study.config.material import Material
from filtercake.study.config.published import Published
from filtercake.study.config.study import Study
from filtercake.study.config.sweep import Sweep
from filtercake.units import MINUTE

SETTLED_SOLIDS = 0.35
"""Share of the crystals in the volume of the loosest cake considered.

That of the paper's initial cloud (void fraction 0.65): a bed is denser than the cloud that it settles from. A slurry
with more crystals is no slurry but a cake.
"""

SAME_DENSITY = 1e-3
"""Relative difference of densities that is rounding."""


def product_name(residence_time_min: float) -> str:
    """Name of the crystallizer's product at a residence time, as a distribution of the study."""
    return f"tau_{residence_time_min:g}min".replace(".", "p")


def resolve(model: Study, path: Path) -> tuple[Study, Kinetics | None, list[str]]:
    """Give the residence times of sweeps a distribution each, and the material the kinetics' density if it has none.

    Returns
    -------
    tuple of Study, Kinetics or None, list of str
        The study with a distribution for every product, without published values of other kinetics; the crystallizer's
        kinetics; warnings.

    Raises
    ------
    ConfigError
        If the kinetics are not known, residence times or a density are asked for that nothing gives, or two products
        would have one name.
    """
    if model.crystallizer is None:
        problems = list(_without_crystallizer(model, str(path)))
        if problems:
            raise ConfigError(problems)
        return model, None, []
    kinetics = _kinetics(model.crystallizer, path)
    csds, sweeps = _with_products(model, model.crystallizer, str(path))
    published, warnings = _of_kinetics(model.published, kinetics.name, str(path))
    warnings += _doubts(model.material, csds, kinetics, str(path))
    changes = {
        "csds": csds,
        "sweeps": sweeps,
        "material": _with_density(model.material, kinetics),
        "published": published,
    }
    return model.model_copy(update=changes), kinetics, warnings


def slurry_problems(model: Study, file: str) -> Iterator[Problem]:
    """Find a slurry (of a resolved study) that holds as many crystals as a cake: nothing could be filtered off."""
    if model.crystallizer is None:
        return
    given, most = model.crystallizer.slurry_concentration_kg_m3, SETTLED_SOLIDS * model.material.density
    if given >= most:
        density = f"{model.material.density:g}"
        allowed = (
            f"must be below {most:.4g} kg/m3, {SETTLED_SOLIDS:.0%} of the crystals' density {density}: "
            "a slurry with more crystals is as dense as a cake and leaves no liquid to filter off"
        )
        yield Problem(file, "crystallizer.slurry_concentration_kg_m3", f"{given:g}", allowed)


def _without_crystallizer(model: Study, file: str) -> Iterator[Problem]:
    """Keys that need a crystallizer, in a study without one."""
    asked = [
        f"csds.{name}.residence_time_min" for name, csd in model.csds.items() if csd.residence_time_min is not None
    ]
    asked += [f"sweeps[{i}].residence_time_min" for i, s in enumerate(model.sweeps) if s.residence_time_min is not None]
    asked += [f"published[{i}].kinetics" for i, entry in enumerate(model.published) if entry.kinetics is not None]
    for key in asked:
        yield Problem(file, key, "", "needs a crystallizer in the study")
    if model.filter is not None:
        yield Problem(file, "filter", "", "needs a crystallizer in the study, for its slurry")
    if model.material.density_kg_m3 is None:
        yield Problem(file, "material.density_kg_m3", "(missing)", "must be given")


def _kinetics(crystallizer: Crystallizer, path: Path) -> Kinetics:
    own: dict[str, Kinetics] = {}
    if crystallizer.kinetics_file is not None:
        try:
            own = load_kinetics(path.parent / crystallizer.kinetics_file)
        except CrystallizerError as error:
            key, asked = "crystallizer.kinetics_file", repr(crystallizer.kinetics_file)
            raise ConfigError([Problem(str(path), key, asked, line) for line in str(error).splitlines()]) from None
    try:
        return get_kinetics(crystallizer.kinetics, own)
    except CrystallizerError as error:
        asked = repr(crystallizer.kinetics)
        allowed = str(error).removeprefix(f"kinetics = {asked}: ")
        raise ConfigError([Problem(str(path), "crystallizer.kinetics", asked, allowed)]) from None


def _with_density(material: Material, kinetics: Kinetics) -> Material:
    if material.density_kg_m3 is not None:
        return material
    return material.model_copy(update={"density_kg_m3": kinetics.density})


def _with_products(model: Study, crystallizer: Crystallizer, file: str) -> tuple[dict[str, Csd], list[Sweep]]:
    """Distributions with those of every residence time, and sweeps that name them."""
    csds, sweeps = dict(model.csds), []
    problems: list[Problem] = []
    for index, sweep in enumerate(model.sweeps):
        times = sweep.residence_time_min
        if times is not None:
            for k, time in enumerate(times):
                known = csds.setdefault(product_name(time), _product(time, crystallizer))
                if known.residence_time_min != time:
                    problems.append(_same_name(known, time, f"sweeps[{index}].residence_time_min[{k}]", file))
            sweep = sweep.model_copy(update={"csd": [product_name(time) for time in times], "residence_time_min": None})
        sweeps.append(sweep)
    if problems:
        raise ConfigError(problems)
    return csds, sweeps


def _same_name(known: Csd, time: float, key: str, file: str) -> Problem:
    other = (
        "a distribution in csds" if known.residence_time_min is None else f"that of {known.residence_time_min!r} min"
    )
    allowed = f"its product would be called {product_name(time)}, as {other} is; leave one out, or rename it in csds"
    return Problem(file, key, repr(time), allowed)


def _product(time: float, crystallizer: Crystallizer) -> Csd:
    return Csd(
        label=f"{time:g} min",
        residence_time_min=time,
        truncate_below_volume_fraction=crystallizer.truncate_below_volume_fraction,
        truncate_below_um=crystallizer.truncate_below_um,
        truncate_above_um=crystallizer.truncate_above_um,
    )


def _of_kinetics(published: list[Published], kinetics: str, file: str) -> tuple[list[Published], list[str]]:
    """Keep the published values of the study's kinetics or of none, with a warning about each other kinetics."""
    others = dict.fromkeys(entry.kinetics for entry in published if entry.kinetics not in (None, kinetics))
    kept = [entry for entry in published if entry.kinetics not in others]
    counts = {other: sum(entry.kinetics == other for entry in published) for other in others}
    return kept, [
        f"{file}: published: {count} value{'' if count == 1 else 's'} of the kinetics {other} "
        f"{'is' if count == 1 else 'are'} not shown: the study's crystallizer.kinetics = {kinetics}"
        for other, count in counts.items()
    ]


def _doubts(material: Material, csds: dict[str, Csd], kinetics: Kinetics, file: str) -> Iterator[str]:
    """Warn of what the kinetics are not meant for, and of crystals as heavy as theirs in the crystallizer only."""
    times = dict.fromkeys(csd.residence_time_min for csd in csds.values() if csd.residence_time_min is not None)
    outside = [f"{time:g}" for time in times if not kinetics.covers(time * MINUTE)]
    if outside and kinetics.residence_time_range is not None:
        shortest, longest = (time / MINUTE for time in kinetics.residence_time_range)
        yield (
            f"{file}: residence_time_min = {', '.join(outside)}: the kinetics {kinetics.name} are meant for "
            f"{shortest:g} to {longest:g} min"
        )
    density = material.density_kg_m3
    if density is not None and abs(density / kinetics.density - 1.0) > SAME_DENSITY:
        yield (
            f"{file}: material.density_kg_m3 = {density:g}: the kinetics {kinetics.name} have {kinetics.density:g}, "
            "which the crystals' size follows from; leave the key out, or correct the density of the kinetics"
        )
