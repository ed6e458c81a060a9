# Loads and checks the configuration, and offers the helpers that the rules share. Stops here, before any job,
# with every problem of every file when something is wrong.
import atexit
import os
import re
import time
from dataclasses import replace
from functools import cache

from filtercake.crystals.csd import read_table
from filtercake.figures import catalogue
from filtercake.packing.engines.base import parallelism
from filtercake.packing.pack import MANIFEST, count_kept, point_key
from filtercake.packing.result import read_record
from filtercake.run import console, slurm
from filtercake.run.job import FOLDER_VARIABLE, PROGRESS_VARIABLE, Progress
from filtercake.run.provenance import code_hash, packing_code, sources
from filtercake.study import engine_choice, estimate
from filtercake.study.cross_check import drawn as drawn_for_cross_check
from filtercake.study.loading import (
    find_studies,
    load_studies,
    with_names_as_written,
)
from filtercake.study.points import expand as expand_points
from filtercake.study.points import packed
from filtercake.units import MICROMETRE, MINUTE
from snakemake.exceptions import WorkflowError
from snakemake.logging import logger

for handler in logger.handlers:
    if handler.name == "DefaultStreamHandler":
        handler.addFilter(console.worth_reading)

STUDY_FILES = Path(in_use("config/studies"))
CALIBRATION_FILES = Path(in_use("config/calibrations"))
VALIDATION = ROOT / "workflow" / "rules" / "validation.smk"
# studies whose names do not hold that of a rule of validation
BED_SIZES = ["alum", "alum_full"]


def points_by_name(studies):
    return {
        name: {
            point.name: point for point in expand_points(study, engine_choice.choose)
        }
        for name, study in studies.items()
    }


try:
    files = [*workflow.overwrite_configfiles]
    if not workflow.modifier.skip_configfile:
        files.insert(0, CONFIG_FILE)
    named = with_names_as_written(
        config, map(Path, files), workflow.config_settings.config_args or []
    )
    settings = load_workflow(named, CONFIG_FILE)
    STUDIES = {
        study.name: engine_choice.of_this_machine(study)
        for study in load_studies(find_studies(settings, STUDY_FILES, CONFIG_FILE))
    }
    POINTS = points_by_name(STUDIES)
    CALIBRATIONS = []
    if settings.calibrations:
        # imports the solvers, which studies need not wait for
        from filtercake.calibration.config import load_calibrations

        CALIBRATIONS = load_calibrations(
            settings.calibrations,
            CALIBRATION_FILES,
            STUDY_FILES,
            CONFIG_FILE,
        )
    DESIGNS = {}
    if any(study.model.design for study in STUDIES.values()):
        # reads the models of the instant estimate, which other studies need not wait for
        from filtercake.design.loading import load_designs

        DESIGNS = load_designs(STUDIES.values())
    engine_choice.check([*STUDIES.values(), *(item.study for item in CALIBRATIONS)])
except FiltercakeError as error:
    stop(error)

# what the rules can look up: the studies asked for, and those of benchmarks
KNOWN = dict(STUDIES)
KNOWN_POINTS = dict(POINTS)
RESULTS = settings.results
STARTED = time.time()
os.environ[FOLDER_VARIABLE] = str(Path.cwd().resolve())
os.environ[PROGRESS_VARIABLE] = str(Path(RESULTS, ".progress").resolve())


wildcard_constraints:
    study="[A-Za-z0-9_-]+",
    csd="[A-Za-z0-9_-]+",
    point="[A-Za-z0-9_.-]+",
    figure="[a-z0-9_]+",


def library(module):
    """Hash of the library's code behind a module: a param of rules, because Snakemake does not see imports."""
    return code_hash(sources(module))


def study_of(wildcards):
    return KNOWN[wildcards.study]


@cache
def packings_of(study):
    """What is packed for a study, by name: pressed cakes serve several points."""
    return packed(KNOWN_POINTS[study].values())


def cross_checked(study):
    """Points of a study with what another engine makes of them."""
    return drawn_for_cross_check(KNOWN[study], KNOWN_POINTS[study].values())


@cache
def everything_packed(study):
    """What is packed for a study, for its design and for its cross-check, by name."""
    others = {other.name: other for _, other in cross_checked(study)}
    return {**packed_for_design(study), **packings_of(study), **others}


def packed_for_design(study):
    """What may be packed for a study's design, by name."""
    if study not in DESIGNS:
        return {}
    return packed(ask.point for ask in DESIGNS[study].asks(engine_choice.choose))


def packed_of(wildcards):
    return everything_packed(wildcards.study)[wildcards.point]


def cross_check_manifests(wildcards):
    folder = f"{RESULTS}/{wildcards.study}/packings"
    pairs = cross_checked(wildcards.study)
    return [f"{folder}/{point.name}/{MANIFEST}" for pair in pairs for point in pair]


def cross_check_tables(wildcards):
    """The cross-check's table, where the study has one."""
    has_one = study_of(wildcards).model.cross_check is not None
    return [f"{RESULTS}/{wildcards.study}/tables/cross_check.csv"] if has_one else []


def manifests(wildcards):
    return [
        f"{RESULTS}/{wildcards.study}/packings/{name}/{MANIFEST}"
        for name in packings_of(wildcards.study)
    ]


def csd_tables(wildcards):
    return [
        f"{RESULTS}/{wildcards.study}/csd/{name}.csv"
        for name in study_of(wildcards).csds
    ]


def point_rows(wildcards):
    """The study's points as plain values, fit for a rule's params."""
    return [point.as_dict() for point in KNOWN_POINTS[wildcards.study].values()]


def filter_tables(wildcards):
    """The filter's table, where the study has a filter."""
    has_one = study_of(wildcards).model.filter is not None
    return [f"{RESULTS}/{wildcards.study}/tables/filter.csv"] if has_one else []


def crystallizer_tables(wildcards):
    """The crystallizer's table, where the study has a crystallizer."""
    has_one = study_of(wildcards).model.crystallizer is not None
    folder = f"{RESULTS}/{wildcards.study}/tables"
    return [f"{folder}/crystallizer.csv"] if has_one else []


def crystallizer_states(wildcards):
    """The crystallizer behind each of its products, as plain values."""
    csds = study_of(wildcards).csds.items()
    return {name: vars(csd.crystallizer) for name, csd in csds if csd.crystallizer}


def figures_of(study):
    return catalogue.figures_of(KNOWN_POINTS[study].values(), KNOWN[study].model)


def study_with_csd(wildcards):
    """The study as it holds a distribution: its design has some of its own."""
    study = study_of(wildcards)
    return study if wildcards.csd in study.csds else DESIGNS[wildcards.study].study


def csd_params(wildcards):
    study = study_with_csd(wildcards)
    csd, state = study.model.csds[wildcards.csd], study.csds[wildcards.csd].crystallizer
    found = {**csd.recipe, "truncation": csd.truncation}
    if state is not None:
        found["size_scale_um"] = state.size_scale / MICROMETRE
        found["bin_width_um"] = study.model.crystallizer.bin_width_um
    return found


def csd_file(wildcards):
    file = study_with_csd(wildcards).csds[wildcards.csd].file
    return [str(file)] if file else []


def is_slurm():
    """Whether this process submits to Slurm; known once all rules are read."""
    return getattr(workflow.executor_plugin, "name", None) == "slurm"


@cache
def partitions():
    return slurm.partitions() if is_slurm() else []


@cache
def partition():
    """The partition that packings are submitted to; None where it is not known, or there is no cluster."""
    asked = {
        **(workflow.resource_settings.default_resources or {}),
        **workflow.resource_settings.overwrite_resources.get("packing", {}),
    }.get("slurm_partition")
    return slurm.partition_of(
        None if asked is None else str(getattr(asked, "value", asked)), partitions()
    )


def flow_memory_mb(wildcards):
    accuracy = study_of(wildcards).model.permeability.accuracy
    return estimate.flow_memory_mb(packed_of(wildcards).scene, accuracy)


def solved_flows(wildcards):
    """Records of the flow of every point, where the study has it solved."""
    if study_of(wildcards).model.permeability is None:
        return []
    return [
        f"{RESULTS}/{wildcards.study}/permeability/{name}/permeability.json"
        for name in packings_of(wildcards.study)
    ]


def granted_minutes():
    """Longest walltime of a submission."""
    limit = partition() and partition().longest_minutes
    return min(limit or estimate.LONGEST_MINUTES, estimate.LONGEST_MINUTES)


def packing_minutes(wildcards, attempt):
    """Walltime from measured run times; doubled on every retry, within what is granted."""
    return estimate.walltime_minutes(
        packed_of(wildcards), attempt, granted=granted_minutes()
    )


def figure_minutes(wildcards):
    """Walltime of a figure: those of all studies may share a submission."""
    together = workflow.group_settings.group_components.get("figures", 1)
    together = min(together, 12 * (len(STUDIES) + len(CALIBRATIONS)))
    return max(1, min(15, granted_minutes() // together))


def packing_group(wildcards):
    """Name of the submissions that short points share on a cluster; the profile says how many."""
    size = estimate.group_size(packed_of(wildcards), granted=granted_minutes())
    return f"packing_{size}" if size > 1 else None


def points_of_run():
    """Points by study that the run's jobs are about, whether they are to be made or stand already."""
    found = {}
    for job in workflow.dag.jobs:
        if job.rule.name == "packing":
            point = packed_of(job.wildcards)
            found.setdefault(job.wildcards.study, {})[point.name] = point
    return found


def points_to_make():
    """Points by study and name whose packings are about to be made."""
    found = {}
    for job in workflow.dag.needrun_jobs(exclude_finished=False):
        if job.rule.name == "packing":
            point = packed_of(job.wildcards)
            found.setdefault(job.wildcards.study, {})[point.name] = point
    return found


def missing_packings(study, point):
    """How many of a point's packings are to be made; those finished before are kept."""
    folder, table = Path(RESULTS, study), Path(
        RESULTS, study, "csd", f"{point.csd}.csv"
    )
    packings = folder / "packings" / point.name
    if not (packings.is_dir() and table.is_file()):
        return point.replicates
    _, csd = read_table(table)
    key = point_key(packing_code(point.scene.engine), replace(point.scene, csd=csd))
    return point.replicates - count_kept(packings, key, point.replicates)


def cost_of(points_by_study, missing):
    """What the packings of points will cost."""
    return estimate.together(
        estimate.estimate(
            [
                replace(point, replicates=missing[study][name])
                for name, point in points.items()
            ],
            on_cluster=not workflow.local_exec,
        )
        for study, points in points_by_study.items()
    )


def too_long():
    """Say which points are expected to take longer than their partition grants."""
    seconds = [
        estimate.job_seconds(point)
        for points in points_to_make().values()
        for point in points.values()
    ]
    late = [item for item in seconds if item > MINUTE * granted_minutes()]
    if late and partition():
        text = slurm.too_long(partition(), partitions(), len(late), max(late))
        return [f"warning: {text}"]
    return []


def announcement():
    """The plan of the run, and the number of packings in it."""
    to_make = points_to_make()
    missing = {
        study: {name: missing_packings(study, point) for name, point in points.items()}
        for study, points in to_make.items()
    }
    lines = too_long()
    for name in points_of_run():
        lines += [f"warning: {warning}" for warning in KNOWN[name].warnings]
        lines += [
            f"{name}: {csd}: {item.file}: {item.full.understood}"
            for csd, item in KNOWN[name].csds.items()
            if item.file is not None
        ]
    if points_of_run():
        lines.append(console.plan(points_of_run(), missing))
    if to_make:
        lines.append(cost_of(to_make, missing).words(cores_of_run()))
    return "\n".join(lines), sum(sum(group.values()) for group in missing.values())


def cluster_logs():
    """Where a cluster's own logs of this run are, None on this machine alone."""
    return None if workflow.local_exec else Path(".snakemake/slurm_logs")


def cores_of_run():
    """Cores that the run may keep busy: this machine's, or those of as many submissions as the profile allows."""
    if workflow.local_exec:
        return workflow.cores
    return workflow.cores * min(workflow.nodes, len(workflow.dag))


def begin_run():
    text, packings = announcement()
    try:
        Progress.begin(Path(os.environ[PROGRESS_VARIABLE]), packings)
    except OSError as error:
        raise WorkflowError(
            f"the results folder {RESULTS} cannot be written: {error.strerror}"
        )
    if text:
        print(text, file=sys.stderr)
    if is_slurm():
        slurm.watch(
            Path.cwd().resolve(), lambda line: print(line, file=sys.stderr, flush=True)
        )


def announce_dry_run():
    # there are no jobs where the run could not even be planned
    if workflow.dryrun and workflow.dag is not None:
        print(announcement()[0], file=sys.stderr)


if not is_module:
    # Snakemake starts no handler for a dry run, and says after the rules are read that it is one
    atexit.register(announce_dry_run)


def validation_is_asked():
    """Whether the command line names a rule of validation, one of its files or one of its studies; in doubt, yes.

    Snakemake gives a workflow its targets only once all rules are read, so the words it was started with are
    searched; it starts itself for single jobs, here or on a cluster, with their rules and wildcards in plain words.
    """
    program, *words = sys.argv
    started_by = [part.removesuffix(".py") for part in Path(program).parts]
    if started_by[-1] != "snakemake" and started_by[-2:] != ["snakemake", "__main__"]:
        return True
    if any(word.startswith(("--li", "--lt", "-l")) for word in words):
        return True  # lists or checks every rule
    names = re.findall(r"^rule\s(\w+)", VALIDATION.read_text(), re.MULTILINE)
    names += [name for name in BED_SIZES if name not in STUDIES]
    keys = tuple(f"{key}=" for key in type(settings).model_fields)
    targets = [word for word in words if not word.startswith(keys)]
    return any(name in target for target in targets for name in names)
