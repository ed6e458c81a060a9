"""Captions and front pages with live values: the prose is a template, every number comes from the results."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from PIL import Image

from filtercake.crystals.csd import kept_volume
from filtercake.design.words import OBJECTIVES
from filtercake.figures import calibrated, selection
from filtercake.figures.calibrated import CalibrationData
from filtercake.figures.catalogue import answering, title_of
from filtercake.figures.cohesion import FREE
from filtercake.figures.designed import DesignData, sentence
from filtercake.figures.filtered import filtered
from filtercake.figures.selection import StudyData
from filtercake.figures.style import FOOTER
from filtercake.packing.result import publish
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL, PROTOCOLS
from filtercake.report.pages import engine_names, environment
from filtercake.report.pictures import Picture, on_screen
from filtercake.report.words import heading, number, with_interval
from filtercake.results.resistance_columns import LAW_CI95
from filtercake.study.config.sweep import SWEPT

MADE = {
    GRAVITY_PROTOCOL: "settle under gravity from a random cloud",
    FILTRATION_PROTOCOL: "are pressed from a random cloud as in a filter",
}
"""How spheres are packed by each protocol."""
SUFFIX, FRONT = ".html.j2", "front"


class Shown(NamedTuple):
    """A figure on the front page: its title, and the picture itself."""

    title: str
    picture: Picture


def write(templates: Path, figures: Iterable[Path], values: Mapping[str, Any], target: Path) -> None:
    """Write one caption per figure, named as the figure, and ``front.html`` for the front page, with the answers.

    Parameters
    ----------
    templates : Path
        Folder of the templates: one per figure, one per kind of front page.
    figures : iterable of Path
        PNGs; each carries the line that stands below it.
    values : mapping
        What the templates name (see :func:`study_values`, :func:`calibration_values` and :func:`design_values`).
    target : Path
        Folder of the captions.
    """
    prose, listed = environment(templates), list(figures)
    texts = {
        figure.stem: prose.get_template(figure.stem + SUFFIX).render(**values, footer=footer_of(figure))
        for figure in listed
    }
    files = {figure.stem: figure for figure in listed}
    shown = [Shown(title_of(name), on_screen(files[name])) for name in answering(files)]
    texts[FRONT] = prose.get_template(f"{FRONT}_{values['kind']}{SUFFIX}").render(**values, shown=shown)
    for name, text in texts.items():
        with publish(target / f"{name}.html") as temporary:
            temporary.write_text(text, encoding="utf-8")


def footer_of(figure: Path) -> str:
    """Read the line that a figure's PNG carries: how many packings it shows, how many failed, what made them."""
    with Image.open(figure) as image:
        return str(image.info.get(FOOTER, ""))


def packing_counts(packings: pd.DataFrame) -> dict[str, Any]:
    """Count packings, accepted and failed, and name their engines; those that several points share count once."""
    if "packings" in packings:
        packings = packings.drop_duplicates(["packings", "replicate"])
    good = int((packings["status"] == "ok").sum())
    return {"n": good, "n_failed": len(packings) - good, "engines": engine_names(packings["engine"])}


def study_values(data: StudyData) -> dict[str, Any]:
    """Collect what captions and front page may say of a study.

    Returns
    -------
    dict
        ``kind``, ``name``, ``title``; ``law`` (of the resistance); ``counts`` (see :func:`packing_counts`);
        ``particles`` (smallest and largest number of spheres in a packing), ``made`` (how they are packed); ``base``
        (porosity and resistance at the base material by distribution), ``points`` (their number) and ``swept`` (values
        by heading); ``lowest`` and ``highest`` resistance of all; ``cohesion`` and ``sensitivity`` (ends of the series
        that vary a property); ``products``, ``filter`` and ``kept`` (crystallizer, filter and truncation by
        distribution); ``compared`` (published porosities).
    """
    summary = data.summary
    known = summary[summary["resistance_m_kg"].notna()].sort_values("resistance_m_kg")
    spheres = data.replicates["particles"].dropna()
    return {
        "kind": "study",
        "name": data.name,
        "title": data.study.title or data.name,
        "law": selection.law_title(data.study.resistance_law),
        "counts": packing_counts(data.replicates),
        "particles": (int(spheres.min()), int(spheres.max())) if len(spheres) else None,
        "made": " or ".join(MADE[name] for name in PROTOCOLS if name in set(summary["protocol"])),
        "base": [_point(data, row) for row in selection.base_points(data).to_dict("records")],
        "points": len(summary),
        "swept": _swept(summary),
        "lowest": _point(data, known.iloc[0].to_dict()) if len(known) else None,
        "highest": _point(data, known.iloc[-1].to_dict()) if len(known) else None,
        "cohesion": _series(data, FREE, "cohesion_kJ_m3"),
        "sensitivity": [
            {**line, "property": heading(name)}
            for name in ("poisson_ratio", "restitution")
            for line in _series(data, (name,), name)
        ],
        "products": [
            {
                "label": selection.label(data, str(row["csd"])),
                "minutes": number(row["residence_time_min"]),
                "volume": number(row["crystallizer_volume_m3"]),
                "growth": number(row["growth_rate_m_s"], 3),
                "nucleation": number(row["nucleation_rate_1_L_s"], 3),
                "size": number(row["mass_mean_size_um"]),
            }
            for row in data.crystallizer.to_dict("records")
        ],
        "filter": _filter(data),
        "kept": [
            {"label": selection.label(data, name), "share": number(100.0 * share), "classes": classes}
            for name, share, classes in _truncated(data)
        ],
    }


def _point(data: StudyData, row: Mapping[Any, Any]) -> dict[str, Any]:
    return {
        "label": selection.label(data, str(row["csd"])),
        "cohesion": f"{row['cohesion_kJ_m3']:g}",
        "where": _where(row),
        "friction": f"{row['friction']:g}",
        "porosity": with_interval(float(row["porosity"]), float(row["porosity_ci95"])),
        "resistance": with_interval(float(row["resistance_m_kg"]), float(row["resistance_ci95_m_kg"]), "m/kg"),
        "by_law": f"± {number(float(row[LAW_CI95]), 2)} m/kg",
        "n": int(row["n"]),
        "n_failed": int(row["n_failed"]),
    }


def _where(row: Mapping[Any, Any]) -> str:
    """Name the attraction, the friction and the pressure of a point."""
    words = [f"cohesion {row['cohesion_kJ_m3']:g} kJ/m³", f"friction {row['friction']:g}"]
    if row["protocol"] == FILTRATION_PROTOCOL:
        if row["cohesion_kJ_m3"] == 0.0:
            words[0] = f"adhesion {row['adhesion_mJ_m2']:g} mJ/m²"
        words.append(f"{row['pressure_kPa']:g} kPa")
    return ", ".join(words)


def _swept(summary: pd.DataFrame) -> dict[str, str]:
    """Values of every property that varies over the points, by its heading."""
    found = {}
    for name in ("residence_time_min", *SWEPT):
        values = sorted(summary[name].dropna().unique())
        if len(values) > 1:
            found[heading(name)] = ", ".join(f"{value:g}" for value in values)
    return found


def _series(data: StudyData, free: tuple[str, ...], name: str) -> list[dict[str, Any]]:
    """Both ends of every line that varies a property: one line per distribution and value of what else is free."""
    others = [other for other in free if other != name]
    lines = []
    for csd, rows in selection.varied(data, free, name):
        for value in sorted(rows[others[0]].unique()) if others else [None]:
            line = (rows if value is None else rows[rows[others[0]] == value]).sort_values(name)
            if line[name].nunique() > 1:
                first, last = ({**_point(data, row), "at": f"{row[name]:g}"} for row in _ends(line))
                of = "" if value is None else f"{value:g}"
                lines.append({"label": selection.label(data, csd), "of": of, "first": first, "last": last})
    return lines


def _ends(rows: pd.DataFrame) -> list[dict[Any, Any]]:
    return rows.iloc[[0, -1]].to_dict("records")


def _filter(data: StudyData) -> list[dict[str, Any]]:
    if data.study.filter is None:
        return []
    return [
        {
            "label": selection.label(data, str(row["csd"])),
            "volume": number(row["crystallizer_volume_m3"]),
            "resistance": with_interval(row["resistance_m_kg"], row["resistance_ci95_m_kg"], "m/kg"),
            "area": number(row["filter_area_m2"], 3),
            "low": number(row["filter_area_low_m2"], 3),
            "high": number(row["filter_area_high_m2"], 3),
            "by_law": f"{number(row['filter_area_law_low_m2'], 3)} to {number(row['filter_area_law_high_m2'], 3)}",
            "additive": number(row["filter_area_additive_m2"], 3),
            "carman": number(row["filter_area_carman_m2"], 3),
            "change": number(100.0 * row["area_change_by_carman"], 2),
            "share": number(100.0 * row["medium_share"], 2),
        }
        for row in filtered(data).to_dict("records")
    ]


def _truncated(data: StudyData) -> Iterable[tuple[str, float, int]]:
    for name, (full, packed) in data.csds.items():
        if name in data.study.csds and data.study.csds[name].truncation:
            yield name, kept_volume(full, packed), packed.size.size


def calibration_values(data: CalibrationData) -> dict[str, Any]:
    """Collect what captions and front page may say of a calibration.

    Returns
    -------
    dict
        ``kind``, ``name``, ``title``; ``law`` (of the resistance); ``counts``; ``estimates`` (value and interval by
        parameter), ``axis`` (property along which packings were made), ``held`` (the one beside it,
        where it was taken and not fitted); ``measured`` (means by distribution),
        ``measurements`` (their number), ``predictions``; ``findings`` (sentences), ``ended`` (why the rounds ended);
        ``tests`` and ``pressures`` (numbers of filtration tests and of resistances with a pressure).
    """
    given = data.measurements
    return {
        "kind": "calibration",
        "name": data.name.removeprefix("calibration_"),
        "title": data.title or data.name,
        "law": selection.law_title(data.summary["resistance_law"]),
        "counts": packing_counts(data.packings),
        "estimates": {
            heading(name): calibrated.with_interval(*data.estimate(name)) for name in data.summary["parameters"]
        },
        "held": "" if data.fits_both else f"{heading(data.beside)} {data.held:g}",
        "axis": calibrated.PROPERTIES[data.axis][0],
        "measurements": len(data.parity),
        "measured": [
            {
                "label": calibrated.cake_label(data, cake, 200),
                "measured": _range(row, "measured"),
                "modelled": number(row["modelled_m_kg"], 3),
            }
            for row, cake in zip(calibrated.measured_means(data).to_dict("records"), data.cakes, strict=True)
        ],
        "predictions": []
        if data.predictions is None
        else [
            {"label": data.label(str(row["csd"]), 200), "resistance": _range(row, "resistance")}
            for row in data.predictions.to_dict("records")
        ],
        "findings": [sentence(finding["text"]) for finding in data.summary["findings"]],
        "ended": data.summary["ended"],
        "tests": len(given.tests) if given else 0,
    }


def design_values(data: DesignData) -> dict[str, Any]:
    """Collect what captions and front page may say of a design.

    Returns
    -------
    dict
        ``kind``, ``name``, ``title``; ``law`` (of the resistance); ``counts``; ``objective`` and ``trade_off`` in
        words; ``findings`` (sentences), the first of which is the answer; ``range`` (residence times, min).
    """
    times = data.search["residence_time_min"]
    words = {name: OBJECTIVES.get(data.summary[name] or "", "") for name in ("objective", "trade_off")}
    return {
        "kind": "design",
        "name": data.name,
        "title": data.title or data.name,
        "law": selection.law_title(data.summary["resistance_law"]),
        "counts": packing_counts(data.packings),
        **words,
        "findings": [sentence(finding["text"]) for finding in data.summary["findings"]],
        "range": (number(times.min(), 3), number(times.max(), 3)),
    }


def _range(row: Mapping[Any, Any], name: str) -> str:
    """Write a resistance and the ends of its 95 % interval."""
    value, low, high = (number(row[f"{name}{end}_m_kg"], 3) for end in ("", "_low", "_high"))
    return f"{value} m/kg (95 %: {low} to {high})"
