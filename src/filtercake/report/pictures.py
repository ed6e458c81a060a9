"""Figures as pictures that a page holds itself."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Final

from PIL import Image

REDUCTION: Final = 2
"""Pixels of a figure, which is made for print at 300 dpi, over those on a screen: half as many are read well."""
COLOURS: Final = 128
"""Colours of a picture on a screen: lines, markers and their soft edges need no more, and a third of the bytes."""


def on_screen(figure: Path) -> str:
    """Return a PNG at the resolution of a screen, as a data URI for a page that loads nothing.

    Raises
    ------
    OSError
        If it cannot be read, or is no picture.
    """
    with Image.open(figure) as image:
        size = (max(1, image.width // REDUCTION), max(1, image.height // REDUCTION))
        smaller = image.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    stream = io.BytesIO()
    smaller.quantize(COLOURS, dither=Image.Dither.NONE).save(stream, format="PNG", optimize=True)
    return f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}"
