# Loads and checks the configuration, and offers the helpers that the rules share. Stops here, before any job,
# with every problem of every file when something is wrong.
import json
import os
import re
import sys
from pathlib import Path

from filtercake import engine_choice
from filtercake.config_loading import find_studies, load_studies, load_workflow
from filtercake.errors import FiltercakeError
from filtercake.figures import catalogue
from filtercake.job import PROGRESS_VARIABLE, Progress, failure_reason
from filtercake.packing.engines.liggghts import processes as process_count
from filtercake.packing.pack import MANIFEST
from filtercake.provenance import sources
from filtercake.study import expand as expand_points

ROOT = Path(workflow.basedir)
CONFIG_FILE = "config/config.yaml"


def stop(error):
    print(f"\nfiltercake cannot start:\n{error}\n", file=sys.stderr)
    sys.exit(1)


try:
    settings = load_workflow(dict(config), CONFIG_FILE)
    STUDIES = {
        study.name: study
        for study in load_studies(
            find_studies(settings, ROOT / "config" / "studies", CONFIG_FILE)
        )
    }
    POINTS = {
        name: {
            point.name: point for point in expand_points(study, engine_choice.choose)
        }
        for name, study in STUDIES.items()
    }
    engine_choice.check(STUDIES.values())
except FiltercakeError as error:
    stop(error)

RESULTS = settings.results
PACKINGS_LEFT = sum(
    point.replicates
    for name, points in POINTS.items()
    for point in points.values()
    if not Path(RESULTS, name, "packings", point.name, MANIFEST).exists()
)
os.environ[PROGRESS_VARIABLE] = str(Path(RESULTS, ".progress").resolve())


wildcard_constraints:
    study="[A-Za-z0-9_-]+",
    csd="[A-Za-z0-9_-]+",
    point="[A-Za-z0-9_.-]+",
    figure="[a-z0-9_]+",


def library(module):
    """Library files behind a module: inputs, because Snakemake does not see imports."""
    return [str(path) for path in sources(module)]


def study_of(wildcards):
    return STUDIES[wildcards.study]


def point_of(wildcards):
    return POINTS[wildcards.study][wildcards.point]


def manifests(wildcards):
    return [
        f"{RESULTS}/{wildcards.study}/packings/{point}/{MANIFEST}"
        for point in POINTS[wildcards.study]
    ]


def csd_tables(wildcards):
    return [
        f"{RESULTS}/{wildcards.study}/csd/{name}.csv"
        for name in study_of(wildcards).csds
    ]


def point_rows(wildcards):
    """The study's points as plain values, fit for a rule's params."""
    return [point.as_dict() for point in POINTS[wildcards.study].values()]


def figures_of(study):
    return catalogue.figures_of(POINTS[study].values(), STUDIES[study].model)


def begin_run():
    Progress.begin(Path(os.environ[PROGRESS_VARIABLE]), PACKINGS_LEFT)
    for study in STUDIES.values():
        for warning in study.warnings:
            print(f"warning: {warning}", file=sys.stderr)
    engines = sorted(
        {point.spec.engine for points in POINTS.values() for point in points.values()}
    )
    total = sum(len(points) for points in POINTS.values())
    print(
        f"filtercake: {', '.join(STUDIES)}: {total} points, {PACKINGS_LEFT} packings to make with {', '.join(engines)}",
        file=sys.stderr,
    )


def failed_packings(study):
    """(point, replicate, reason) of every packing that failed in a finished study."""
    for point in POINTS[study]:
        manifest = Path(RESULTS, study, "packings", point, MANIFEST)
        if manifest.exists():
            for entry in json.loads(manifest.read_text())["replicates"]:
                if entry["status"] != "ok":
                    yield point, entry["replicate"], entry["reason"]


def report_success():
    for study in STUDIES:
        folder = Path(RESULTS, study)
        print(
            f"\n{study}: figures in {folder / 'figures'}, tables in {folder / 'tables'}, numbers in {folder / 'summary.csv'}"
        )
        failed = list(failed_packings(study))
        if failed:
            print(
                f"{len(failed)} packings failed (rows with status failed in {folder / 'replicates.csv'}):"
            )
        for point, replicate, reason in failed[:5]:
            print(f"  {point} r{replicate}: {reason}")


def report_failure(snakemake_log):
    """Name the failing jobs, their reasons and logs, and the command that resumes."""
    text = Path(snakemake_log).read_text(errors="replace")
    pattern = (
        r"Error in rule (?P<rule>\w+):.*?\n(?P<body>(?:[ ]{4}.*\n)+)"
    )
    seen = set()
    for match in re.finditer(pattern, text):
        logged = re.search(r"^\s*log: (\S+)", match["body"], re.MULTILINE)
        log_file = logged[1] if logged else ""
        if (match["rule"], log_file) in seen:
            continue
        seen.add((match["rule"], log_file))
        reason = failure_reason(Path(log_file)) if log_file else ""
        print(
            f"\nfailed: {match['rule']} {Path(log_file).stem}\n  reason: {reason or 'see the log'}\n  log:    {log_file}",
            file=sys.stderr,
        )
    print(
        "\nFinished packings are kept. Resume with: make resume (or: snakemake --cores 2 --rerun-incomplete)",
        file=sys.stderr,
    )
