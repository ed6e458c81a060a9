# What the rules of validation share; read with them only.


def bed_size_tables(wildcards):
    if bed_size_problem:
        raise WorkflowError(f"bed_size cannot start:\n{bed_size_problem}")
    return [f"{RESULTS}/{name}/replicates.csv" for name in BED_SIZES]


def tables_of_page(committed, made):
    """Tables behind a page: this run's, or the committed ones where it is only drawn again."""
    return lambda wildcards: committed if wildcards.folder == REDRAWN else made
