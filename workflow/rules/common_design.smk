# What the rules of designs share: which packings the rounds so far ask for, and what a design gives.
DESIGN_TABLES = ["search", "levels", "packings", "pareto", "safety", "costs"]


def design_csds(wildcards):
    folder = f"{RESULTS}/{wildcards.study}/csd"
    return [f"{folder}/{name}.csv" for name in DESIGNS[wildcards.study].products]


def design_round_file(wildcards, number):
    made = checkpoints.design_round.get(
        results=RESULTS, study=wildcards.study, number=number
    )
    return made.output[0]


def design_rounds_before(wildcards):
    return [
        design_round_file(wildcards, number) for number in range(int(wildcards.number))
    ]


def all_design_rounds(wildcards):
    """Files of the rounds up to the one that found nothing left to do."""
    files = []
    while not (files and read_record(Path(files[-1]))["finished"]):
        files.append(design_round_file(wildcards, len(files)))
    return files


def manifests_of_design(rounds):
    """Packings of the rounds that another function lists."""
    return lambda wildcards: [
        f"{RESULTS}/{wildcards.study}/packings/{name}/{MANIFEST}"
        for file in rounds(wildcards)
        for name in read_record(Path(file))["packings"]
    ]


def design_params(wildcards):
    """The design as plain values, with all packings that it may come to need."""
    return DESIGNS[wildcards.study].params(engine_choice.choose)


def design_title(wildcards):
    return f"Design {wildcards.study}"


def outputs_of_design(name):
    folder = f"{RESULTS}/{name}/design"
    figures = catalogue.figures_of_design(DESIGNS[name].model)
    return [f"{folder}/design.json"] + [
        f"{folder}/figures/{figure}.{suffix}"
        for figure in figures
        for suffix in ("png", "pdf")
    ]


def design_outputs(wildcards):
    if not DESIGNS:
        raise WorkflowError(
            "no design is asked for: give --config studies=<name> (or studies in "
            f"{CONFIG_FILE}) of a study with the section design"
        )
    return [file for name in DESIGNS for file in outputs_of_design(name)]
