"""The instant estimate against packings that it was not trained on."""

from __future__ import annotations

from typing import Final

import pandas as pd
from matplotlib.figure import Figure

from filtercake.figures import style
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL

LABELS: Final = {FILTRATION_PROTOCOL: "pressed cells", GRAVITY_PROTOCOL: "settled beds"}


def draw(held: pd.DataFrame) -> Figure:
    """Draw what packings lie off their estimates, from :func:`filtercake.validation.emulator_evidence.held_out`."""
    figure, (axes,) = style.panels(width=style.MEDIUM, height=3.2)
    drawn = held[held["drawn"].astype(bool)].dropna(subset=["error"])
    for index, (protocol, label) in enumerate(LABELS.items()):
        rows = drawn[drawn["protocol"] == protocol]
        axes.errorbar(
            rows["estimate"],
            rows["error"],
            yerr=rows["packing_ci95"],
            color=style.colour(index),
            marker="os"[index],
            markersize=3.5,
            linestyle="none",
            elinewidth=0.7,
            label=label,
        )
    axes.axhline(0.0, color=style.FAINT, linewidth=0.8, zorder=0)
    axes.set_xlabel("Estimated porosity (–)")
    axes.set_ylabel("Porosity of a packing less the estimate (–)")
    style.legend(figure, (axes,), columns=2)
    return figure
