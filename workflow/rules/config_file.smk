# Checks config/config.yaml before Snakemake reads it: Snakemake's own reader expands aliases, and runs the code of a
# file that asks for it (__use_yte__).
import sys
from pathlib import Path

from filtercake.study.loading import load_workflow
from filtercake.errors import FiltercakeError
from filtercake.user_files import read_yaml

CONFIG_FILE = "config/config.yaml"


def stop(error):
    print(f"\nfiltercake cannot start:\n{error}\n", file=sys.stderr)
    sys.exit(1)


try:
    load_workflow(read_yaml(Path(CONFIG_FILE)), CONFIG_FILE)
except FiltercakeError as error:
    stop(error)
