"""The report's pages of one study or calibration: tables, failed packings, provenance."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd

from filtercake.config import Study
from filtercake.figures import style
from filtercake.report import words

TABLES, FAILED, PROVENANCE = "Tables", "Failed packings", "Provenance"
"""Parts of a study in the report."""


@dataclass(frozen=True)
class PageSpec:
    """A page's part of the report, its title, and what it says before its table.

    Attributes
    ----------
    part : str
        Part of the study that it stands under.
    title : str
        Title.
    lead : str
        What the table holds.
    file : str
        CSV below the study's folder; empty for a page that has none.
    """

    part: str
    title: str
    lead: str = ""
    file: str = ""


INTERVALS = "Intervals are 95 % intervals of the mean over packings from different initial clouds."
PAGES: dict[str, PageSpec] = {
    "summary": PageSpec(
        TABLES,
        "Summary of all points",
        "One row per point: porosity of the bed's interior and specific cake resistance by the Kozeny-Carman equation "
        f"with the full size distribution. {INTERVALS} n counts accepted packings.",
        "summary.csv",
    ),
    "comparison": PageSpec(
        TABLES,
        "Comparison with published porosities",
        "Published porosities from simulations beside ours by the same count. A published value within three standard "
        "deviations of one packing is no different from ours.",
        "tables/comparison.csv",
    ),
    "table1": PageSpec(
        TABLES,
        "Table 1, dimension of the system",
        "Side of the box that holds the spheres of a packing, for our number of spheres and, where a published value "
        "is for another number, for that.",
        "tables/table1.csv",
    ),
    "table2": PageSpec(
        TABLES,
        "Table 2, size classes in the packing",
        "What each distribution keeps when rare, small or large classes are left out of the packing.",
        "tables/table2.csv",
    ),
    "table3": PageSpec(
        TABLES,
        "Table 3, parameters",
        "Material and settings of the packings. A sweep varies some of the material's values; these are its base values.",
    ),
    "table4": PageSpec(
        TABLES,
        "Table 4, porosity and resistance at the base material",
        f"Ours beside published simulations and measurements. {INTERVALS}",
        "tables/table4.csv",
    ),
    "crystallizer": PageSpec(
        TABLES, "Crystallizer", "Its steady state at every residence time.", "tables/crystallizer.csv"
    ),
    "filter": PageSpec(
        TABLES,
        "Drum filter",
        "The filter that each point's slurry needs; low and high are the areas at the ends of the resistance's 95 % "
        "interval.",
        "tables/filter.csv",
    ),
    "parity": PageSpec(
        TABLES,
        "Measured and modelled resistances",
        "Every measurement beside the calibrated model, and beside what the other distributions predict for it.",
        "tables/parity.csv",
    ),
    "predictions": PageSpec(
        TABLES,
        "Predictions",
        "Cakes that were never tested, at the calibrated parameters, with 95 % intervals.",
        "tables/predictions.csv",
    ),
    "fits": PageSpec(TABLES, "Filtration tests", "Resistances fitted to the tests, by both forms.", "tables/fits.csv"),
    "compressibility": PageSpec(
        TABLES, "Compressibility", "Power laws of the resistance over pressure.", "tables/compressibility.csv"
    ),
    "failed": PageSpec(FAILED, "Failed packings"),
    "provenance": PageSpec(PROVENANCE, "Provenance"),
}
FAILED_COLUMNS = ("point", "replicate", "csd", "cohesion_kJ_m3", "friction", "engine", "reason")


@dataclass(frozen=True)
class Content:
    """What a page shows below its title.

    Attributes
    ----------
    lead : str
        What it holds, in prose.
    table : DataFrame
        Its table, empty for none.
    csv : bytes
        The table's file, offered for download.
    details : dict of str to DataFrame
        Further tables by heading; all but short ones are folded.
    """

    lead: str
    table: pd.DataFrame = field(default_factory=pd.DataFrame)
    csv: bytes = b""
    details: Mapping[str, pd.DataFrame] = field(default_factory=dict)


def engine_names(engines: Iterable[str]) -> str:
    """Names of engines for readers, each once."""
    return ", ".join(style.ENGINES.get(name, name) for name in sorted(set(engines)))


def contents(folder: Path, packings: pd.DataFrame, study: Study, provenance: Mapping[str, Any]) -> dict[str, Content]:
    """Collect the pages of a study or a calibration.

    Parameters
    ----------
    folder : Path
        Folder of its results; of the tables there, those with rows have a page.
    packings : DataFrame
        One row per packing, with the columns ``status``, ``reason``, ``seed`` and :data:`FAILED_COLUMNS`.
    study : Study
        The study that was packed.
    provenance : mapping
        As ``provenance.json`` holds it (versions, machine, commit).

    Returns
    -------
    dict of str to Content
        By the names of :data:`PAGES`.
    """
    found = {}
    for name, spec in PAGES.items():
        path = folder / spec.file
        if spec.file and path.exists():
            table = pd.read_csv(path)
            if len(table):
                found[name] = Content(spec.lead, table, path.read_bytes())
    found["table3"] = Content(PAGES["table3"].lead, parameters(study))
    found["failed"] = failed(packings)
    found["provenance"] = origin(packings, provenance)
    return found


def parameters(study: Study) -> pd.DataFrame:
    """Tabulate material and packing settings that are given or have a default: parameter, value, meaning."""
    rows = [
        (words.heading(name), words.cell(getattr(part, name)), info.description or "")
        for part in (study.material, study.packing)
        for name, info in type(part).model_fields.items()
        if getattr(part, name) is not None
    ]
    return pd.DataFrame(rows, columns=["parameter", "value", "meaning"])


def failed(packings: pd.DataFrame) -> Content:
    """Tabulate the packings that failed, with their reasons."""
    rows = packings.loc[packings["status"] != "ok", list(FAILED_COLUMNS)]
    total = words.plural(len(packings), "packing")
    if rows.empty:
        return Content(f"None of {total} failed.")
    lead = f"{len(rows)} of {total} failed. They are left out of every mean and interval; `make retry` makes them anew."
    return Content(lead, rows, rows.to_csv(index=False).encode())


def origin(packings: pd.DataFrame, provenance: Mapping[str, Any]) -> Content:
    """Say what made the results: engine, versions, machine, commit, and the seed of every packing."""
    versions = pd.DataFrame(provenance["versions"].items(), columns=["package", "version"])
    machine = pd.DataFrame(provenance["machine"].items(), columns=["machine", "value"])
    lead = (
        f"{words.plural(len(packings), 'packing')} by the {engine_names(packings['engine'])}, with filtercake "
        f"{provenance['versions']['filtercake']} at commit {provenance['commit']}."
    )
    seeds = packings[["point", "replicate", "engine", "seed"]].astype({"seed": "str"})
    return Content(lead, versions, details={"Machine": machine, f"Seeds of {len(seeds)} packings": seeds})


def render(template: Path, title: str, content: Content) -> str:
    """Write a page as HTML that needs no other file."""
    return environment(template.parent).get_template(template.name).render(title=title, content=content, body="")


def prose(template: Path, title: str, body: str) -> str:
    """Write a page of prose, whose body is HTML already."""
    return environment(template.parent).get_template(template.name).render(title=title, content=None, body=body)


def environment(folder: Path) -> jinja2.Environment:
    """Templates of HTML in a folder: what they are given is text, and names that do not exist are errors."""
    made = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )
    made.filters |= {
        "readable": words.readable,
        "number": words.number,
        "engines": engine_names,
        "base64": lambda data: base64.b64encode(data).decode(),
    }
    made.globals |= {"plural": words.plural, "with_interval": words.with_interval}
    return made
