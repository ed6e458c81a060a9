"""One module per family of figures: each takes tables and returns a matplotlib figure.

Imports from calibration, results and the rooms below them; the catalogues say which figures a study has.
"""

import os
import sys


def _import_matplotlib() -> None:
    """Import it whatever backend the environment names: one that only a notebook has makes its import fail.

    Figures are drawn without a backend; the one that was named is kept where matplotlib knows it.
    """
    if "matplotlib" in sys.modules or "MPLBACKEND" not in os.environ:
        return  # who plans a study does not wait for it
    named = os.environ.pop("MPLBACKEND")
    import matplotlib

    os.environ["MPLBACKEND"] = named
    try:
        matplotlib.rcParams["backend"] = named
    except ValueError:
        return


_import_matplotlib()
