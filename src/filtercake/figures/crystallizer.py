"""Growth and nucleation rates against the crystallizer's volume (paper, Fig. 13)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from filtercake.figures import selection, style

if TYPE_CHECKING:
    from filtercake.figures.catalogue import StudyData

LITRE = 1e-3
"""m3."""


def draw(data: StudyData) -> Figure:
    """Draw both rates: a curve over the study's range of volumes, and a marker at each of its residence times."""
    figure, panels = style.panels(2, height=4.2, sharex=True)
    upper, lower = panels
    times = np.array([time for _, time in selection.products(data)])
    largest = selection.crystallizer_volume(data, float(times.max())) if times.size else np.nan
    style.volume_axis(lower, largest)
    upper.set_ylabel("Growth rate G\n(m/s)")
    lower.set_ylabel("Nucleation rate B₀\n(#/(L s))")
    notes: list[str] = []
    if not times.size:
        reason = "no distribution is made by a crystallizer"
    elif selection.steady(data, float(times[0])) is None:
        reason = f"rates are not known: {selection.OWN_KINETICS}"
    else:
        reason = ""
    if reason:
        for axes in panels:
            style.nothing(axes, reason)
        return figure
    for sampled, line, gid in ((np.geomspace(times.min(), times.max(), 201), "-", "curve"), (times, "o", "study")):
        states = [selection.steady(data, float(time)) for time in sampled]
        volumes = [selection.crystallizer_volume(data, float(time)) for time in sampled]
        rates = np.array([(state.growth_rate, state.nucleation_rate * LITRE) for state in states if state])
        for k, axes in enumerate(panels):
            axes.plot(volumes, rates[:, k], line, color=style.colour(k), gid=gid)
    style.power_axis(upper, rates[:, 0], "Growth rate G\n", "m/s")
    style.power_axis(lower, rates[:, 1], "Nucleation rate B₀\n", "#/(L s)")
    for k, axes in enumerate(panels):
        axes.set_ylim(0.0, 1.08 * rates[:, k].max())
    crystallizer = data.study.crystallizer
    if crystallizer is not None:
        notes.append(f"kinetics: {crystallizer.kinetics}, {crystallizer.slurry_density_kg_m3:g} kg/m³ of crystals")
        notes.append(f"{crystallizer.slurry_flow_m3_h:g} m³/h of slurry; no packing enters")
    keys = [
        style.key("steady state of the kinetics", color=style.FAINT),
        style.key("residence times of the study", color=style.FAINT, marker="o", linewidth=0.0),
    ]
    style.legend(figure, panels, columns=1, extra=keys)
    style.footer(figure, data.summary.iloc[:0], *notes)
    return figure
