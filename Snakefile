# filtercake: porosity and resistance of filter cakes over a parameter study.
# Everything a user sets is in config/; what the rules call is in src/filtercake/.
from snakemake.utils import min_version

min_version("9.20")


include: "workflow/rules/config_file.smk"


configfile: CONFIG_FILE


include: "workflow/rules/common.smk"
include: "workflow/rules/common_report.smk"
include: "workflow/rules/csd.smk"
include: "workflow/rules/packing.smk"
include: "workflow/rules/permeability.smk"
include: "workflow/rules/resistance.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/common_calibration.smk"
include: "workflow/rules/calibration.smk"
include: "workflow/rules/common_design.smk"
include: "workflow/rules/design.smk"
include: "workflow/rules/report.smk"


if validation_is_asked():

    include: "workflow/rules/common_validation.smk"
    include: "workflow/rules/validation.smk"


rule all:
    default_target: has_no_rule_yet
    input:
        expand("{results}/{study}/provenance.json", results=RESULTS, study=STUDIES),
    localrule: True


onstart:
    begin_run()


onsuccess:
    print(console.success(Path(RESULTS), points_of_run()))


onerror:
    print(
        console.failure(Path(RESULTS), points_of_run(), STARTED, cluster_logs()),
        file=sys.stderr,
    )
