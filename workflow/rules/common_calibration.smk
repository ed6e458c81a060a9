# What the rules of calibrations share: points, and which of them the rounds so far ask for.
if CALIBRATIONS:
    from filtercake.calibration.config import (
        candidates as calibration_candidates,
        settings_of,
    )

CALIBRATED = {calibration.name: calibration for calibration in CALIBRATIONS}
CANDIDATES = {
    name: {
        item.point.name: item
        for item in calibration_candidates(calibration, engine_choice.choose)
    }
    for name, calibration in CALIBRATED.items()
}
KNOWN.update({name: calibration.study for name, calibration in CALIBRATED.items()})
KNOWN_POINTS.update(
    {
        name: {point: item.point for point, item in group.items()}
        for name, group in CANDIDATES.items()
    }
)
TABLES = ["parity", "objective", "response", "simulated", "pressures"]


def calibration_of(wildcards):
    return CALIBRATED[wildcards.calibration]


def measurement_files(wildcards):
    return [str(path) for path in calibration_of(wildcards).measurements.files]


def calibration_csds(wildcards):
    folder = f"{RESULTS}/{wildcards.calibration}/csd"
    return [f"{folder}/{name}.csv" for name in calibration_of(wildcards).packed]


def round_file(wildcards, number):
    made = checkpoints.choose_round.get(
        results=RESULTS, calibration=wildcards.calibration, number=number
    )
    return made.output[0]


def rounds_before(wildcards):
    return [round_file(wildcards, number) for number in range(int(wildcards.number))]


def all_rounds(wildcards):
    """Files of the rounds up to the one that found nothing left to do."""
    files = []
    while not (files and read_record(Path(files[-1]))["finished"]):
        files.append(round_file(wildcards, len(files)))
    return files


def manifests_of(wildcards, points):
    folder = f"{RESULTS}/{wildcards.calibration}/packings"
    known = KNOWN_POINTS[wildcards.calibration]
    return [f"{folder}/{known[name].packings}/{MANIFEST}" for name in points]


def manifests_of_rounds(rounds):
    """Packings of the rounds that another function lists."""
    return lambda wildcards: manifests_of(
        wildcards,
        [
            name
            for file in rounds(wildcards)
            for name in read_record(Path(file))["points"]
        ],
    )


def prediction_manifests(wildcards):
    made = checkpoints.calibrate_cohesion.get(
        results=RESULTS, calibration=wildcards.calibration
    )
    record = read_record(Path(made.output.summary))
    return manifests_of(wildcards, record["prediction_points"])


def calibration_params(wildcards):
    """The calibration as plain values; its candidates by name, with their batches."""
    calibration = calibration_of(wildcards)
    return {
        "settings": settings_of(calibration).as_dict(),
        "observations": [vars(item) for item in calibration.observations],
        "candidates": [
            {"point": item.point.as_dict(), "batch": item.batch}
            for item in CANDIDATES[wildcards.calibration].values()
        ],
    }


def prediction_tables(wildcards):
    """The predictions' table, where the calibration predicts."""
    has_some = calibration_of(wildcards).model.predict
    folder = f"{RESULTS}/{wildcards.calibration}/tables"
    return [f"{folder}/predictions.csv"] if has_some else []


def outputs_of_calibration(name):
    calibration, folder = CALIBRATED[name], f"{RESULTS}/{name}"
    figures = catalogue.figures_of_calibration(
        bool(calibration.model.predict), calibration.measurements
    )
    found = [f"{folder}/calibration.json", f"{folder}/tables/fits.csv"]
    found += [
        f"{folder}/figures/{figure}.{suffix}"
        for figure in figures
        for suffix in ("png", "pdf")
    ]
    if calibration.model.predict:
        found.append(f"{folder}/tables/predictions.csv")
    return found


def calibration_outputs(wildcards):
    if not CALIBRATED:
        files = CALIBRATION_FILES.glob("*.yaml")
        raise WorkflowError(
            "no calibration is asked for: give --config calibrations=<name> (or calibrations in "
            f"{CONFIG_FILE}); allowed: {', '.join(sorted(file.stem for file in files))}, or the path of a file"
        )
    return [file for name in CALIBRATED for file in outputs_of_calibration(name)]
