"""``python -m filtercake``: the command line."""

import sys

from filtercake.cli.commands import main

if __name__ == "__main__":
    sys.exit(main())
