# Finds config/config.yaml, and checks it before Snakemake reads it: Snakemake's own reader expands aliases, and runs the
# code of a file that asks for it (__use_yte__).
import os
import sys
from pathlib import Path

from filtercake.study.loading import load_workflow
from filtercake.errors import FiltercakeError
from filtercake.user_files import read_yaml


def stop(error):
    print(f"\nfiltercake cannot start:\n{error}\n", file=sys.stderr)
    sys.exit(1)


# of this file, not workflow.basedir: where another workflow uses this one as a module, that is the other's
here = workflow.current_basedir.get_path_or_uri(secret_free=True)
if not os.path.isdir(here):
    stop(f"it reads files beside {here}: clone the repository, and name its Snakefile")
ROOT = Path(os.path.normpath(here)).parents[1]


def in_use(file):
    """A file or folder of the configuration: the working directory's, or the one that comes with the workflow."""
    return file if os.path.exists(file) else str(ROOT / file)


# in a module, the working directory's file is the other workflow's
is_module = not workflow.modifier.is_main_snakefile()
has_no_rule_yet = workflow.default_target is None
CONFIG_FILE = "config/config.yaml"
CONFIG_FILE = str(ROOT / CONFIG_FILE) if is_module else in_use(CONFIG_FILE)
if workflow.modifier.skip_configfile:
    CONFIG_FILE = "(config of the module)"
else:
    try:
        load_workflow(read_yaml(Path(CONFIG_FILE)), CONFIG_FILE)
    except FiltercakeError as error:
        stop(error)
