"""A bed that fell and a cell that was pressed, side by side: what the two protocols are.

``python -m filtercake.validation.figures.protocols --output docs/images/protocols.png`` packs both (10 s).
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any, Final

from filtercake.api.packings import pack
from filtercake.api.steps import distribution
from filtercake.figures import style
from filtercake.figures.cross_section import draw_levels, draw_spheres
from filtercake.packing.result import Packing
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL

MIXTURE: Final = {20.0: 0.5, 50.0: 0.5}
TITLES: Final = {
    GRAVITY_PROTOCOL: "gravity: dropped onto a floor",
    FILTRATION_PROTOCOL: "filtration: pressed at 53 kPa",
}


def packed(protocol: str) -> Packing:
    """Pack the mixture by a protocol, without friction."""
    options: dict[str, Any] = {"pressure_kPa": 53.32} if protocol == FILTRATION_PROTOCOL else {"cohesion_kJ_m3": 50.0}
    with tempfile.TemporaryDirectory() as folder:
        made = pack(
            distribution(mixture=MIXTURE),
            folder,
            protocol=protocol,
            density_kg_m3=1180.0,
            engine="embedded",
            replicates=1,
            **options,
        )
        return Packing.load(made.files[0])


def main() -> None:
    """Draw both protocols."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--output", type=Path, required=True, help="PNG")
    output = parser.parse_args().output
    with style.applied():
        figure, panels = style.panels(2, width=style.DOUBLE, height=3.6, columns=2)
        for axes, (protocol, title) in zip(panels, TITLES.items(), strict=True):
            packing = packed(protocol)
            draw_spheres(figure, axes, packing)
            if not packing.is_cell:
                draw_levels(axes, packing)
            axes.set(title=title, xlabel="x (µm)", ylabel="z (µm)")
        style.legend(figure, panels, columns=5)
    style.save(figure, output, Path(tempfile.gettempdir()) / f"{output.stem}.pdf")


if __name__ == "__main__":
    main()
