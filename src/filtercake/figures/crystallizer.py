"""Growth and nucleation rates against the crystallizer's volume (paper, Fig. 13)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from filtercake.figures import selection, style
from filtercake.figures.selection import StudyData
from filtercake.units import LITRE, FloatArray


def draw(data: StudyData) -> Figure:
    """Draw both rates: a curve over the study's range of volumes, and a marker at each of its residence times."""
    figure, panels = style.panels(2, height=4.2, sharex=True)
    upper, lower = panels
    products = selection.products(data)
    volumes = np.array([volume for _, volume, _ in products])
    rates = np.array([(state.growth_rate, state.nucleation_rate * LITRE) for _, _, state in products])
    style.volume_axis(lower, float(volumes.max()) if products else np.nan)
    upper.set_ylabel("Growth rate G\n(m/s)")
    lower.set_ylabel("Nucleation rate B₀\n(#/(L s))")
    if not products:
        for axes in panels:
            style.nothing(axes, "no distribution is made by a crystallizer")
        return figure
    for k, axes in enumerate(panels):
        axes.plot(*_power_laws(volumes, rates[:, k]), "-", color=style.colour(k), gid="curve")
        axes.plot(volumes, rates[:, k], "o", color=style.colour(k), gid="study")
    style.power_axis(upper.yaxis, rates[:, 0], "Growth rate G\n", "m/s")
    style.power_axis(lower.yaxis, rates[:, 1], "Nucleation rate B₀\n", "#/(L s)")
    for k, axes in enumerate(panels):
        axes.set_ylim(0.0, 1.08 * rates[:, k].max())
    keys = [
        style.key("steady state of the kinetics", color=style.FAINT),
        style.key("residence times of the study", color=style.FAINT, marker="o", linewidth=0.0),
    ]
    style.legend(figure, panels, columns=1, extra=keys)
    style.footer(figure, data.summary.iloc[:0], *_notes(data))
    return figure


def _power_laws(volume: FloatArray, rate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Interpolate rates as power laws of the residence time: linearly between logarithms."""
    sampled = np.geomspace(volume[0], volume[-1], 201)
    return sampled, np.exp(np.interp(np.log(sampled), np.log(volume), np.log(rate)))


def _notes(data: StudyData) -> list[str]:
    crystallizer = data.study.crystallizer
    if crystallizer is None:
        return []
    return [
        f"kinetics: {crystallizer.kinetics}, {crystallizer.slurry_concentration_kg_m3:g} kg/m³ of crystals",
        f"{crystallizer.slurry_flow_m3_h:g} m³/h of slurry; no packing enters",
    ]
