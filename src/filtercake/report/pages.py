"""The report's pages of one study or calibration: tables, failed packings, provenance."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd

from filtercake.filtration.resistance import law_of
from filtercake.packing.engines import label_of
from filtercake.packing.result import publish
from filtercake.report import words
from filtercake.report.catalogue import PAGES
from filtercake.results.tables import read_table
from filtercake.study.config.study import Study
from filtercake.user_files import templates

FAILED_COLUMNS = ("point", "replicate", "csd", "cohesion_kJ_m3", "friction", "engine", "reason")


@dataclass(frozen=True)
class Content:
    """Content of a page below its title.

    Attributes
    ----------
    lead : str
        Introductory prose.
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
    return ", ".join(label_of(name) for name in sorted(set(engines)))


def contents(folder: Path, packings: pd.DataFrame, study: Study, provenance: Mapping[str, Any]) -> dict[str, Content]:
    """Collect the pages of a study or a calibration, by the names of :data:`filtercake.report.catalogue.PAGES`.

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
    """
    found = {}
    for name, spec in PAGES.items():
        path = folder / spec.file
        if spec.file and path.exists():
            table = read_table(path)
            if len(table):
                found[name] = Content(spec.lead, table, path.read_bytes())
    found["table3"] = Content(PAGES["table3"].lead, parameters(study))
    found["failed"] = failed(packings)
    found["provenance"] = origin(packings, provenance)
    return found


def parameters(study: Study) -> pd.DataFrame:
    """Tabulate the settings that are given or have a default, and the resistance law: parameter, value, meaning."""
    rows = [
        (words.heading(name), words.cell(getattr(part, name)), info.description or "")
        for part in (study.material, study.packing)
        for name, info in type(part).model_fields.items()
        if getattr(part, name) is not None
    ]
    law = law_of(study.resistance_law)
    rows.append((words.heading("resistance_law"), law.title, f"{law.equation}; {law.validity}"))
    return pd.DataFrame(rows, columns=["parameter", "value", "meaning"])


def failed(packings: pd.DataFrame) -> Content:
    """Tabulate the packings that failed, with their reasons."""
    rows = packings.loc[packings["status"] != "ok", list(FAILED_COLUMNS)]
    total = words.plural(len(packings), "packing")
    if rows.empty:
        return Content(f"None of {total} failed.")
    lead = f"{len(rows)} of {total} failed. They are left out of every mean and interval; make retry makes them anew."
    return Content(lead, rows, rows.to_csv(index=False).encode())


def origin(packings: pd.DataFrame, provenance: Mapping[str, Any]) -> Content:
    """Tabulate the origin of the results: engine, versions, machine, commit, and the seed of every packing."""
    packings = packings.drop_duplicates(["packings", "replicate"]) if "packings" in packings else packings
    versions = pd.DataFrame(provenance["versions"].items(), columns=["package", "version"])
    machine = pd.DataFrame(provenance["machine"].items(), columns=["machine", "value"])
    lead = (
        f"{words.plural(len(packings), 'packing')} by the {engine_names(packings['engine'])}, with filtercake "
        f"{provenance['versions']['filtercake']} at commit {provenance['commit']}."
    )
    seeds = packings[["point", "replicate", "engine", "seed"]].astype({"seed": "str"})
    return Content(lead, versions, details={"Machine": machine, f"Seeds of {len(seeds)} packings": seeds})


def write(template: Path, pages: Mapping[str, Content], target: Path) -> None:
    """Write pages as HTML into ``target``, each named as in :data:`filtercake.report.catalogue.PAGES`."""
    for name, content in pages.items():
        with publish(target / f"{name}.html") as temporary:
            temporary.write_text(render(template, PAGES[name].title, content), encoding="utf-8")


def render(template: Path, title: str, content: Content) -> str:
    """Write a page as HTML that needs no other file."""
    return environment(template.parent).get_template(template.name).render(title=title, content=content, body="")


def prose(template: Path, title: str, body: str) -> str:
    """Write a page of prose, whose body is HTML already."""
    return environment(template.parent).get_template(template.name).render(title=title, content=None, body=body)


def environment(folder: Path) -> jinja2.Environment:
    """Return the HTML templates of a folder, with the filters they use."""
    made = templates(folder, html=True)
    made.filters |= {
        "readable": words.readable,
        "number": words.number,
        "engines": engine_names,
        "base64": lambda data: base64.b64encode(data).decode(),
    }
    made.globals |= {"plural": words.plural, "with_interval": words.with_interval}
    return made
