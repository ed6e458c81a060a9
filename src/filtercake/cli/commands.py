"""The command line: the steps of a study on files and numbers, without Snakemake.

A command imports what it needs when it is asked for: ``--help`` and a formula need not wait for what packs and draws.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from filtercake import api
from filtercake.cli import options as words
from filtercake.errors import CloudError, EngineError, EngineMissing, FiltercakeError, PackingRejected, visible

if TYPE_CHECKING:
    from numpy.typing import NDArray

USER_ERROR = 2
FAILED = 1
INTERRUPTED = 130
TRACEBACK_VARIABLE = "FILTERCAKE_TRACEBACK"

Line = tuple[str, Any, str]
"""Name, value and unit of one number."""

EXAMPLES = {
    "template": "filtercake template --output mine.yaml",
    "csd": "filtercake csd --kinetics ammonium_alum --residence-time-min 15 --slurry-concentration-kg-m3 200",
    "pack": "filtercake pack --mixture 20:0.5,50:0.5 --density-kg-m3 1180 "
    "--porosity-ci95-target 0.003 --output packing",
    "predict": "filtercake predict --mixture 20:0.5,50:0.5 --density-kg-m3 1180 --friction 0.1 --adhesion-mJ-m2 10",
    "resistance": "filtercake resistance --porosity 0.36 --density-kg-m3 1180 --mixture 20:0.5,50:0.5",
    "export": "filtercake export pmma pmma_50_s50_mu0_1a2b3c4d --output report",
    "rerun": "filtercake rerun report",
    "estimate": "filtercake estimate config/studies/pmma.yaml --cores 100",
    "porosity": "filtercake porosity packing/r0.npz --profile",
    "permeability": "filtercake permeability packing/r0.npz --accuracy 0.05",
    "test": "filtercake test config/measurements/synthetic_tests.yaml",
    "filter-area": (
        "filtercake filter-area --resistance-m-kg 1e8 --slurry-flow-m3-h 20 --slurry-concentration-kg-m3 200 "
        "--pressure-drop-kPa 53.3 --submerged-fraction 0.3 --rotation-rate-rpm 0.2 --medium-resistance-1-m 5e9"
    ),
    "filter-batch": (
        "filtercake filter-batch --resistance-m-kg 1e10 --porosity 0.4 --density-kg-m3 1500 --slurry-flow-m3-h 1 "
        "--slurry-concentration-kg-m3 100 --pressure-drop-kPa 200 --medium-resistance-1-m 1e10 --turnaround-time-min 20"
    ),
    "deliquor": (
        "filtercake deliquor --resistance-m-kg 1e9 --porosity 0.4 --density-kg-m3 1300 --sauter-mean-um 50 "
        "--cake-height-mm 20 --pressure-drop-kPa 50 --moisture 0.15"
    ),
    "crystallizer": (
        "filtercake crystallizer --kinetics ammonium_alum --residence-time-min 15 --slurry-concentration-kg-m3 200 "
        "--fines-ratio 5 --fines-size-um 50 --output product.csv"
    ),
    "cost": "filtercake cost --equipment drum_filter --filter-area-m2 3.44 --cost-index 800",
}
"""One call of each command, shown by its --help."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command, by default with the arguments of the process.

    The exit status is 0 where all went well, 1 where no packing was accepted, 2 where the command or its input is
    wrong.
    """
    arguments = sys.argv[1:] if argv is None else argv
    parser = build_parser(arguments)
    options = argparse.Namespace()
    try:
        options, rest = parser.parse_known_args(arguments)
        if rest:
            known = vars(options).keys() - {"run", "command"}
            raise words.UsageError(f"{words.unknown(rest, map(words.flag, known))} (see {options.prog} --help)")
        status: int = options.run(options)
        sys.stdout.flush()
        return status
    except SystemExit as end:  # --help and --version
        return int(end.code or 0)
    except FiltercakeError as error:
        return _complain(words.in_words(error, vars(options)))
    except BrokenPipeError:  # the reader of our output (head, less) has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _complain(f"{where}{error.strerror or error}")
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)
    except Exception as error:
        if os.environ.get(TRACEBACK_VARIABLE):
            raise
        text = f"unexpected {type(error).__name__}: {error}; {TRACEBACK_VARIABLE}=1 shows where"
        return _complain(" ".join(text.split()), FAILED)


def build_parser(asked: Collection[str] | None = None) -> words.Parser:
    """Build the parser of all commands.

    Parameters
    ----------
    asked : collection of str, optional
        Commands that get their options, all if left out: what makes the options of a command takes longest to import.
    """
    parser = words.Parser(
        prog="filtercake",
        description="Porosity and specific resistance of filter cakes from crystal size distributions.",
        epilog="Every command: --help for its options with their units, --json for one JSON object.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show program's version number and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, command in COMMANDS.items():
        one: words.Parser = commands.add_parser(
            name,
            help=command.text.replace("%", "%%"),  # argparse formats this one, and takes the description as it is
            description=command.text,
            epilog=f"example:\n  {EXAMPLES[name]}",
        )
        if asked is None or name in asked:
            one.set_defaults(run=command.run, prog=one.prog)
            one.add_argument("--json", action="store_true", help="print one JSON object")
            command.add_options(one)
    return parser


class _Version(argparse.Action):
    """Prints the version, which is not looked up before."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        """Print the version and exit."""
        from filtercake import __version__

        print(f"filtercake {__version__}")
        parser.exit()


def _template_options(parser: words.Parser) -> None:
    parser.add_argument("--output", metavar="YAML", required=True, help="the new file")


def _csd_options(parser: words.Parser) -> None:
    words.add_source(parser)
    parser.add_argument("--output", metavar="CSV", help="write the classes, full and as packed, to this file")


def _pack_options(parser: words.Parser) -> None:
    from filtercake.study.config.material import Material
    from filtercake.study.config.packing import Packing

    words.add_source(parser)
    words.add_model(parser.add_argument_group("crystals"), Material)
    words.add_model(parser.add_argument_group("packing"), Packing)
    words.add_field(parser.add_argument_group("resistance"), "law", api.ResistanceOptions.model_fields["law"])
    parser.add_argument(
        "--output",
        metavar="FOLDER",
        default="packing",
        help="receives the packings, r0.npz and r0.json and so on; those of an earlier call with the same options are "
        "kept. Default: packing",
    )
    parser.add_argument("--replace", action="store_true", help="packings of other options in that folder may be lost")


def _predict_options(parser: words.Parser) -> None:
    words.add_source(parser)
    words.add_model(parser.add_argument_group("cake"), api.PredictOptions)


def _porosity_options(parser: words.Parser) -> None:
    parser.add_argument("packings", nargs="+", metavar="NPZ", help="packing; its record (.json) lies beside it")
    parser.add_argument(
        "--profile", action="store_true", help="porosity over height (um) as well, in slices of 1/20 largest diameter"
    )


def _permeability_options(parser: words.Parser) -> None:
    parser.add_argument(
        "packings",
        nargs="+",
        metavar="NPZ",
        help="packing with its record (.json) beside it; or spheres of your own: arrays position (n, 3) and radius "
        "(n,), and either length, of a settled bed (floor at z = 0, x and y periodic), or box (3,), of a cell that is "
        "periodic in all directions, all in m",
    )
    words.add_model(parser.add_argument_group("flow and solid"), api.PermeabilityOptions)


def _resistance_options(parser: words.Parser) -> None:
    words.add_source(parser)
    words.add_model(parser.add_argument_group("cake"), api.ResistanceOptions)
    parser.add_argument(
        "--list-laws", action="store_true", help="print each law: equation, units, validity, accuracy, source"
    )


def _filter_area_options(parser: words.Parser) -> None:
    words.add_model(parser.add_argument_group("filter and slurry"), api.FilterOptions)


def _filter_batch_options(parser: words.Parser) -> None:
    words.add_model(parser.add_argument_group("filter, cake and slurry"), api.BatchFilterOptions)


def _deliquor_options(parser: words.Parser) -> None:
    words.add_model(parser.add_argument_group("cake, liquor and gas"), api.DeliquoringOptions)


def _crystallizer_options(parser: words.Parser) -> None:
    words.add_model(parser.add_argument_group("crystallizer"), api.CrystallizerOptions)
    parser.add_argument("--output", metavar="CSV", help="write the product's classes to this file")


def _cost_options(parser: words.Parser) -> None:
    words.add_model(parser.add_argument_group("equipment"), api.CostOptions)


def _test_options(parser: words.Parser) -> None:
    from filtercake.calibration.measurements import FiltrationConditions

    parser.add_argument(
        "file",
        metavar="FILE",
        help="CSV of times and filtrate volumes or masses (time_s,volume_mL), with the options below; or a YAML file "
        "of measurements, without them",
    )
    words.add_model(parser.add_argument_group("test, for a CSV"), FiltrationConditions)


def _export_options(parser: words.Parser) -> None:
    parser.add_argument("study", metavar="STUDY", help="name of a file in config/studies, or the path of a study file")
    parser.add_argument("point", metavar="POINT", help="name of the point: column point of summary.csv")
    parser.add_argument("--replicate", metavar="K", help="which packing, from 0. Default: the first that failed, or 0")
    parser.add_argument(
        "--results", metavar="FOLDER", default="results", help="folder of the results. Default: results"
    )
    parser.add_argument("--output", metavar="FOLDER", required=True, help="the new folder")


def _rerun_options(parser: words.Parser) -> None:
    parser.add_argument("folder", metavar="FOLDER", help="what filtercake export wrote")


def _estimate_options(parser: words.Parser) -> None:
    parser.add_argument("study", metavar="STUDY", help="path of a study file")
    parser.add_argument("--cores", metavar="N", default="1", help="cores that are kept busy. Default: 1")
    parser.add_argument("--cluster", action="store_true", help="each point is started on a node of a cluster")


def _run_template(options: argparse.Namespace) -> int:
    from filtercake.cli.schema import study_template

    with Path(options.output).open("x", encoding="utf-8") as stream:
        stream.write(study_template())
    return _print_json({"file": options.output}) if options.json else 0


def _run_csd(options: argparse.Namespace) -> int:
    from filtercake.crystals.csd import columns
    from filtercake.units import MICROMETRE

    found = api.distribution(**words.source(options))
    table = columns(found.full, found.truncated)
    if options.output is not None:
        _write_csv(table, options.output)
    full, packed = found.full, found.truncated
    values = {
        "sum_x_over_d_1_m": full.sum_x_over_d,
        "sum_x_over_d2_1_m2": full.sum_x_over_d2,
        "sauter_mean_um": full.sauter_mean / MICROMETRE,
        "packed_sum_x_over_d2_1_m2": packed.sum_x_over_d2,
        "packed_smallest_um": packed.smallest / MICROMETRE,
        "packed_largest_um": packed.largest / MICROMETRE,
        "packed_classes": int(packed.size.size),
        "kept_volume_fraction": found.kept_volume_fraction,
    }
    if options.json:
        classes = [dict(zip(table, row, strict=True)) for row in _rows(table)]
        return _print_json({"understood": full.understood, "classes": classes, **values})
    if full.understood:
        print(f"{options.file or 'distribution'}: {full.understood}\n")
    shown = ("size_um", "volume_fraction", "number_fraction", "truncated_volume_fraction")
    _print_table(
        ["size, um", "volume fraction", "number fraction", "packed volume fraction"],
        _rows({name: table[name] for name in shown}),
    )
    print()
    return _print_lines(
        [
            ("sum of x/d", values["sum_x_over_d_1_m"], "1/m"),
            ("sum of x/d2", values["sum_x_over_d2_1_m2"], "1/m2"),
            ("Sauter mean diameter", values["sauter_mean_um"], "um"),
            ("packed: kept volume", values["kept_volume_fraction"], ""),
            ("packed: smallest", values["packed_smallest_um"], "um"),
            ("packed: largest", values["packed_largest_um"], "um"),
            ("packed: sum of x/d2", values["packed_sum_x_over_d2_1_m2"], "1/m2"),
        ]
    )


def _rows(columns: Mapping[str, NDArray[Any]]) -> Iterator[tuple[Any, ...]]:
    """Rows of a table given by its columns."""
    return zip(*(values.tolist() for values in columns.values()), strict=True)


def _write_csv(columns: Mapping[str, NDArray[Any]], output: str) -> None:
    from filtercake.packing.result import publish

    target = Path(output)
    if not target.name:
        raise words.UsageError(f"--output = {output!r}: must be the name of a file")
    with publish(target) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(_rows(columns))


def _say_understood(options: argparse.Namespace, source: api.Distribution) -> None:
    """Say how a distribution was read, once nothing else is wrong."""
    if source.full.understood:
        _say(f"{options.file or 'distribution'}: {source.full.understood}")


def _run_pack(options: argparse.Namespace) -> int:
    from filtercake.study.config.material import Material
    from filtercake.study.config.packing import Packing

    source = api.distribution(**words.source(options))
    asked = words.given(options, ("law", *Material.model_fields, *Packing.model_fields))
    found = api.pack(source, options.output, say=_say, replace=options.replace, **asked)
    _say_understood(options, source)
    for warning in found.warnings:
        _say(f"warning: {words.with_flags(warning, vars(options))}")
    summary, status = found.summary, 0 if found.files else FAILED
    if options.json:
        _print_json({**summary, "files": [str(path) for path in found.files], "failures": list(found.failures)})
        return status
    if not found.files:
        return status
    _print_lines(
        [
            ("porosity", summary["porosity"], _interval(summary["porosity_ci95"], "")),
            *_known("porosity as published", summary["porosity_paper_count"]),
            *_known("pressure drop", summary["pressure_kPa"], "kPa"),
            *_known("compressibility n", summary["compressibility"]),
            *_resistances(summary, _interval(summary["resistance_ci95_m_kg"], "m/kg")),
            ("packings", summary["n"], f"of {summary['particles']} spheres by {summary['engine']}"),
        ]
    )
    print(f"packings are in {options.output}")
    return status


def _run_predict(options: argparse.Namespace) -> int:
    source = api.distribution(**words.source(options))
    found = api.predict(source, **words.given(options, api.PredictOptions.model_fields))
    _say_understood(options, source)
    for warning in found.warnings:
        _say(f"warning: {words.with_flags(warning, vars(options))}")
    for doubt in found.outside:
        _say(f"warning: outside of what was packed, and so with a wider interval: {doubt}")
    if options.json:
        return _print_json(asdict(found))
    return _print_lines(
        [
            ("porosity", found.porosity, f"{_interval(found.porosity_ci95, '')}, mean of many packings"),
            ("of one packing", found.porosity, _interval(found.porosity_packing_ci95, "")),
            *_known("porosity at the medium", found.porosity_at_medium),
            *_known("compressibility n", found.compressibility),
            *_known("load over strength", found.load_over_strength),
            *_resistances(asdict(found), _interval(found.resistance_ci95_m_kg, "m/kg")),
            ("learnt from", found.packings, f"packings by {found.protocol}"),
        ]
    )


def _known(name: str, value: float | None, unit: str = "") -> list[Line]:
    """Give the line of a number that not every packing has."""
    return [] if value is None else [(name, value, unit)]


def _resistances(found: dict[str, Any], interval: str) -> list[Line]:
    """Resistance by a law with both parts of its interval, of which the first is in words, and by laws beside it."""
    from filtercake.results.resistance_columns import others

    law, by_law = found["resistance_law"], found["resistance_law_ci95_m_kg"]
    return [
        (f"resistance, {law}", found["resistance_m_kg"], interval),
        ("uncertainty of the law", "-" if by_law is None else by_law, "m/kg (95 %, half-width)"),
        *((f"resistance, {other}", found[f"resistance_{other}_m_kg"], "m/kg") for other in others(law)),
    ]


def _interval(half: float | None, unit: str) -> str:
    return f"+- {'-' if half is None else _number(half)} {unit} (95 %)".replace("  ", " ")


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _run_porosity(options: argparse.Namespace) -> int:
    found = [api.porosity(npz) for npz in options.packings]
    profiles = [api.profile(npz) for npz in options.packings] if options.profile else []
    mean, half = _mean([item.porosity for item in found])
    if options.json:
        rows = [{"file": npz, **asdict(item)} for npz, item in zip(options.packings, found, strict=True)]
        for row, profile in zip(rows, profiles, strict=bool(profiles)):
            row["profile"] = profile.to_dict("records")
        return _print_json({"packings": rows, "porosity": mean, "porosity_ci95": half})
    for k, (npz, item) in enumerate(zip(options.packings, found, strict=True)):
        print(f"{npz} ({item.particles} spheres, {item.engine})")
        _print_lines(
            [
                ("porosity, interior", item.porosity, ""),
                *_known("porosity from the floor", item.porosity_from_floor),
                *_known("porosity as published", item.porosity_paper_count),
                ("loss by soft contacts", item.soft_contact_compaction, ""),
                ("interior from", item.interior_from_um, "um"),
                ("interior to", item.interior_to_um, "um"),
                ("height of the bed", item.bed_height_um, "um"),
            ]
        )
        if profiles:
            _print_table(["height, um", "porosity"], profiles[k].itertuples(index=False))
    if len(found) > 1:
        print(f"mean of {len(found)}: {_number(mean)} +- {_number(half)} (95 %)")
    return 0


def _run_permeability(options: argparse.Namespace) -> int:
    from filtercake.statistics import half_width

    asked = words.given(options, api.PermeabilityOptions.model_fields)
    found = api.permeabilities(options.packings, say=_say, **asked)
    between = half_width([item.kozeny_constant for item in found])
    mean = api.mean_kozeny_constant(found)
    half = mean.value * mean.relative_ci95
    if options.json:
        rows = [{"file": npz, **asdict(item)} for npz, item in zip(options.packings, found, strict=True)]
        constant = {"kozeny_constant": mean.value, "kozeny_constant_ci95": half}
        return _print_json({"packings": rows, **constant, "kozeny_constant_between_packings_ci95": between})
    for npz, item in zip(options.packings, found, strict=True):
        print(f"{npz} ({item.particles} spheres)")
        _print_permeability(item)
    if len(found) > 1:
        alone = f"from the spread of these {len(found)} alone +- {_number(between)}"
        print(f"mean Kozeny constant: {_number(mean.value)} +- {_number(half)} (95 %); {alone}")
    return 0


def _print_permeability(found: api.PackingPermeability) -> None:
    alpha = "m/kg; needs --density-kg-m3"
    if found.density_kg_m3 is not None:
        alpha = f"{_interval(found.resistance_ci95_m_kg, 'm/kg')} at {found.density_kg_m3:g} kg/m3"
    share = "% (95 %, half-width)"
    _print_lines(
        [
            ("permeability", found.permeability_m2, _interval(found.permeability_ci95_m2, "m2")),
            ("resistance", "-" if found.resistance_m_kg is None else found.resistance_m_kg, alpha),
            ("Kozeny constant", found.kozeny_constant, _interval(found.kozeny_constant_ci95, "")),
            ("resolution leaves open", 100.0 * found.resolution_relative_ci95, share),
            ("stopping leaves open", 100.0 * found.convergence_relative_ci95, share),
            ("so few spheres leave open", 100.0 * found.slab_relative_ci95, f"{share}, of the constant only"),
            ("porosity of the slab", found.porosity, ""),
            ("Sauter mean of the slab", found.sauter_mean_um, "um"),
            ("time", found.wall_s, "s"),
            ("memory", found.memory_MB, "MB"),
        ]
    )
    levels = [
        [level.nodes_per_sauter_mean, level.permeability_m2, level.fluid_nodes, level.steps] for level in found.levels
    ]
    _print_table(["nodes per mean diameter", "permeability, m2", "fluid nodes", "steps"], levels)


def _run_resistance(options: argparse.Namespace) -> int:
    if options.list_laws:
        return _list_laws(options)
    source = api.distribution(**words.source(options))
    found = api.resistance(source, **words.given(options, api.ResistanceOptions.model_fields))
    _say_understood(options, source)
    if options.json:
        return _print_json(asdict(found))
    half = found.resistance_ci95_m_kg
    interval = "m/kg" if half is None else _interval(half, "m/kg")
    return _print_lines(
        [
            *_resistances(asdict(found), interval),
            ("change per 0.01 of porosity", 100.0 * found.change_per_0p01_porosity, "%"),
        ]
    )


def _list_laws(options: argparse.Namespace) -> int:
    from filtercake.filtration.resistance import RESISTANCE_LAWS

    names = ("name", "title", "equation", "units", "validity", "accuracy", "source")
    laws = [{name: getattr(law, name) for name in names} for law in RESISTANCE_LAWS.values()]
    if options.json:
        return _print_json({"laws": laws})
    for law in laws:
        print("\n".join(f"{name:<9} {text}" for name, text in law.items()), end="\n\n")
    return 0


def _run_filter_area(options: argparse.Namespace) -> int:
    found = api.filter_area(**words.given(options, api.FilterOptions.model_fields))
    if options.json:
        return _print_json(asdict(found))
    lines: list[Line] = [
        ("filter area", found.filter_area_m2, "m2"),
        ("slurry flow", found.slurry_flow_m3_h, "m3/h"),
        ("share of the medium", 100.0 * found.medium_share, "%"),
        ("cake per area and turn", found.cake_mass_kg_m2, "kg/m2"),
    ]
    if found.cake_thickness_mm is not None:
        lines.append(("cake thickness", found.cake_thickness_mm, "mm"))
    if found.safety:
        lines.append(("area, end of the interval", found.filter_area_upper_m2, "m2"))
        lines.append(("area, paper's factor 2", found.filter_area_paper_factor_m2, "m2"))
        _say(found.safety)
    for warning in found.warnings:
        _say(f"warning: {warning}")
    return _print_lines(lines)


def _run_filter_batch(options: argparse.Namespace) -> int:
    found = api.batch_filter(**words.given(options, api.BatchFilterOptions.model_fields))
    if options.json:
        return _print_json(asdict(found))
    if not found.fits:
        _say(f"warning: the cake is higher than {words.flag('height_limit_mm')}")
    return _print_lines(
        [
            ("filter area", found.filter_area_m2, "m2"),
            ("slurry flow, mean", found.slurry_flow_m3_h, "m3/h"),
            ("slurry per batch", found.slurry_per_batch_m3, "m3"),
            ("cake height", found.cake_height_mm, "mm"),
            ("best cake height", found.best_height_mm, "mm"),
            ("cake per area", found.cake_mass_kg_m2, "kg/m2"),
            ("filtration", found.filtration_time_min, "min"),
            ("washing", found.wash_time_min, "min"),
            ("deliquoring", found.deliquoring_time_min, "min"),
            ("turnaround", found.turnaround_time_min, "min"),
            ("cycle", found.cycle_time_min, "min"),
            ("crystals", found.crystals_kg_m2_h, "kg/(m2 h)"),
        ]
    )


def _run_deliquor(options: argparse.Namespace) -> int:
    found = api.deliquoring(**words.given(options, api.DeliquoringOptions.model_fields))
    if options.json:
        return _print_json(asdict(found))
    if not found.in_range:
        _say("warning: the time is outside of the correlation's range")
    within = f"({_number(found.moisture_low)} to {_number(found.moisture_high)} within the correlation's error)"
    return _print_lines(
        [
            ("time of deliquoring", found.time_min, "min"),
            ("moisture", found.moisture, within),
            ("lowest moisture", found.lowest_moisture, ""),
            ("saturation", found.saturation, ""),
            ("irreducible saturation", found.irreducible_saturation, ""),
            ("threshold pressure", found.threshold_pressure_kPa, "kPa"),
        ]
    )


def _run_crystallizer(options: argparse.Namespace) -> int:
    from filtercake.units import MICROMETRE

    found = api.crystallizer(**words.given(options, api.CrystallizerOptions.model_fields))
    csd = found.csd
    if options.output is not None:
        _write_csv({"size_um": csd.size / MICROMETRE, "volume_fraction": csd.volume_fraction}, options.output)
    values = {
        "sum_x_over_d_1_m": csd.sum_x_over_d,
        "sum_x_over_d2_1_m2": csd.sum_x_over_d2,
        "sauter_mean_um": csd.sauter_mean / MICROMETRE,
        "largest_um": csd.largest / MICROMETRE,
        "classes": int(csd.size.size),
        "product_concentration_kg_m3": found.product_concentration_kg_m3,
        "density_kg_m3": found.density_kg_m3,
        "growth_rate_m_s": found.growth_rate_m_s,
        "nucleation_rate_m3_s": found.nucleation_rate_m3_s,
        "warnings": found.warnings,
    }
    if options.json:
        return _print_json(values)
    for warning in found.warnings:
        _say(f"warning: {words.with_flags(warning, vars(options))}")
    stages: list[Line] = []
    rates = zip(found.growth_rate_m_s, found.nucleation_rate_m3_s, strict=True)
    for number, (growth, nucleation) in enumerate(rates, 1):
        stage = f", stage {number}" if len(found.growth_rate_m_s) > 1 else ""
        stages.append((f"growth rate{stage}", growth, "m/s"))
        stages.append((f"nucleation rate{stage}", nucleation, "1/(m3 s)"))
    return _print_lines(
        [
            *stages,
            ("Sauter mean diameter", values["sauter_mean_um"], "um"),
            ("sum of x/d", values["sum_x_over_d_1_m"], "1/m"),
            ("sum of x/d2", values["sum_x_over_d2_1_m2"], "1/m2"),
            ("crystals in the product", values["product_concentration_kg_m3"], "kg/m3"),
        ]
    )


def _run_cost(options: argparse.Namespace) -> int:
    found = api.cost(**words.given(options, api.CostOptions.model_fields))
    if options.json:
        return _print_json({"costs": [asdict(item) for item in found]})
    currency = "thousand USD" if options.currency_per_usd is None else "thousand"
    lines: list[Line] = []
    for item in found:
        lines.append((f"{item.title}: purchase", item.purchase / 1e3, currency))
        lines.append((f"{item.title}: {item.installed_as}", item.installed / 1e3, currency))
        if item.smallest is None:
            _say(f"{item.correlation}: its source states no range ({item.source})")
        elif not item.in_range:
            limits = f"{_number(item.smallest)} to {_number(item.largest)} {item.size_unit}"
            _say(f"warning: {item.correlation}: outside of its range, {limits} ({item.source})")
    return _print_lines(lines)


def _run_test(options: argparse.Namespace) -> int:
    from filtercake.calibration.measurements import FiltrationConditions

    conditions = words.given(options, FiltrationConditions.model_fields)
    if not options.file.endswith((".yaml", ".yml")):
        found = [api.filtration_test(options.file, **conditions)]
    elif conditions:
        raise words.UsageError(f"{words.flag(next(iter(conditions)))}: goes with a CSV; {options.file} says it itself")
    else:
        found = api.filtration_tests(options.file)
    if options.json:
        return _print_json({"tests": [asdict(item) for item in found]})
    for item in found:
        print(f"{item.name} ({item.readings - item.readings_left_out} of {item.readings} readings, {item.form} form)")
        _print_lines(
            [
                ("cake resistance", item.resistance_m_kg, _interval(item.resistance_ci95_m_kg, "m/kg")),
                ("medium resistance", item.medium_resistance_1_m, _interval(item.medium_resistance_ci95_1_m, "1/m")),
                ("filtration began at", item.time_zero_s, "s of the clock"),
            ]
        )
        for note in item.notes:
            print(f"- {words.with_flags(note, vars(options))}")
    return 0


def _run_export(options: argparse.Namespace) -> int:
    number = options.replicate
    if number is not None and not (number.isascii() and number.isdigit() and len(number) < 10):
        raise words.UsageError(f"--replicate = {number}: must be a whole number, from 0")
    asked = None if number is None else int(number)
    found = api.export(options.study, options.point, options.results, options.output, asked)
    if options.json:
        return _print_json({**asdict(found), "folder": str(found.folder)})
    print(f"{found.point}, replicate {found.replicate} ({found.status}): {found.folder}; see README.md there")
    return 0


def _run_rerun(options: argparse.Namespace) -> int:
    try:
        found = api.rerun(options.folder)
    except EngineMissing:
        raise
    except (CloudError, EngineError, PackingRejected) as error:
        return _complain(f"the packing failed: {error}", FAILED)
    before = api.first_porosity(options.folder)
    if options.json:
        return _print_json({**asdict(found), "first_porosity": before})
    lines: list[Line] = [("porosity, interior", found.porosity, "")]
    return _print_lines([*lines, *([("when first made", before, "")] if before is not None else [])])


def _run_estimate(options: argparse.Namespace) -> int:
    from filtercake.study import engine_choice
    from filtercake.study.estimate import estimate
    from filtercake.study.loading import load_study
    from filtercake.study.points import expand, packed
    from filtercake.units import HOUR

    asked = options.cores
    if not (asked.isascii() and asked.isdigit() and len(asked) < 10 and int(asked) > 0):
        raise words.UsageError(f"--cores = {asked}: must be a whole number, from 1")
    study = engine_choice.of_this_machine(load_study(Path(options.study)))
    points = packed(expand(study, engine_choice.choose)).values()
    found = estimate(points, on_cluster=options.cluster)
    wall = found.wall_seconds(int(asked))
    if options.json:
        return _print_json({**asdict(found), "wall_seconds": wall})
    return _print_lines(
        [
            ("points", found.points, ""),
            ("packings", found.packings, ""),
            ("core-hours", found.core_seconds / HOUR, "h"),
            ("wall time", wall / HOUR, f"h on {asked} cores"),
            ("disk", found.disk / 1e6, "MB"),
        ]
    )


def _mean(values: list[float]) -> tuple[float, float]:
    """Mean, and half-width of its 95 % interval (nan for one value)."""
    from filtercake.statistics import half_width

    return math.fsum(values) / len(values), half_width(values)


def _complain(text: str, status: int = USER_ERROR) -> int:
    print(f"filtercake: {' '.join(visible(text).split())}", file=sys.stderr)
    return status


def _print_json(value: dict[str, Any]) -> int:
    print(json.dumps(_plain(value), indent=1, allow_nan=False))
    return 0


def _plain(value: Any) -> Any:
    """Values that JSON has: null for what is not a finite number."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value.item() if hasattr(value, "item") else value


def _print_lines(lines: Iterable[Line]) -> int:
    rows = [(name, _number(value), unit) for name, value, unit in lines]
    width = max(len(name) for name, _, _ in rows)
    for name, value, unit in rows:
        print(f"{name:<{width}}  {value:>10} {unit}".rstrip())
    return 0


def _print_table(titles: list[str], rows: Iterable[Sequence[Any]]) -> None:
    print("  ".join(titles))
    for row in rows:
        print("  ".join(f"{_number(value):>{len(title)}}" for title, value in zip(titles, row, strict=True)))


def _number(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


class _Command(NamedTuple):
    """What a command does, in words; what adds its options; what runs it."""

    text: str
    add_options: Callable[[words.Parser], None]
    run: Callable[[argparse.Namespace], int]


COMMANDS: dict[str, _Command] = {
    "csd": _Command(
        "Show a crystal size distribution: its classes, its moments, and how much of it is packed.",
        _csd_options,
        _run_csd,
    ),
    "pack": _Command(
        "Pack spheres of a size distribution; print porosity and specific cake resistance (m/kg) with 95 % intervals.",
        _pack_options,
        _run_pack,
    ),
    "predict": _Command(
        "Estimate porosity and specific cake resistance (m/kg) at once, with 95 % intervals, from what a few hundred "
        "packings were: nothing is packed.",
        _predict_options,
        _run_predict,
    ),
    "porosity": _Command(
        "Measure the porosity of packings: in the interior, from the floor, and as the paper counts it.",
        _porosity_options,
        _run_porosity,
    ),
    "permeability": _Command(
        "Permeability (m2), specific resistance (m/kg) and Kozeny constant of packings, with 95 % intervals, from "
        "Stokes flow solved in their pores.",
        _permeability_options,
        _run_permeability,
    ),
    "resistance": _Command(
        "Specific cake resistance (m/kg) from porosity and size distribution by a law, with both parts of its 95 % "
        "interval: the porosity's and the law's.",
        _resistance_options,
        _run_resistance,
    ),
    "filter-area": _Command(
        "Area of a rotary drum filter (m2) for a slurry flow (m3/h), or the flow that an area can take.",
        _filter_area_options,
        _run_filter_area,
    ),
    "filter-batch": _Command(
        "Area of a batch filter (Nutsche, leaf, press; m2) for a slurry flow (m3/h), or the flow that an area takes; "
        "its cycle, and the cake height of most cake per time.",
        _filter_batch_options,
        _run_filter_batch,
    ),
    "deliquor": _Command(
        "Moisture of a cake after some time (min) of deliquoring by gas, or the time that a moisture takes.",
        _deliquor_options,
        _run_deliquor,
    ),
    "crystallizer": _Command(
        "Product of a continuous crystallizer: mixed, with fines dissolution and classified removal (sizes in um), or "
        "a cascade (values of its stages with commas between).",
        _crystallizer_options,
        _run_crystallizer,
    ),
    "cost": _Command(
        "What a filter (size in m2) or crystallizer (m3, or kg/s) costs, by every correlation that there is of it.",
        _cost_options,
        _run_cost,
    ),
    "test": _Command(
        "Specific cake resistance (m/kg) and medium resistance (1/m) of a filtration test at constant pressure, with "
        "95 % intervals; which readings were left out, and why.",
        _test_options,
        _run_test,
    ),
    "export": _Command(
        "Write one packing of a study to a folder that stands alone: deck, cloud, seeds, versions, log, a README.",
        _export_options,
        _run_export,
    ),
    "rerun": _Command(
        "Make an exported packing once more, and print its porosity beside the first one's.",
        _rerun_options,
        _run_rerun,
    ),
    "estimate": _Command(
        "Estimate what a study will cost before it is made: core-hours, wall time, disk.",
        _estimate_options,
        _run_estimate,
    ),
    "template": _Command(
        "Write a study with every key, its default and its meaning: the start of a study of your own.",
        _template_options,
        _run_template,
    ),
}
"""Every command, in the order of the help."""


if __name__ == "__main__":
    sys.exit(main())
