"""Figures as pictures that a page holds itself."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Final, NamedTuple

from PIL import Image

REDUCTION: Final = 2
"""Pixels of a figure, which is made for print at 300 dpi, over those of its picture."""
ENLARGEMENT: Final = 0.75
"""Width on the screen, in the browser's pixels, over that of the picture: 8 point are read, fine screens are sharp."""
COLOURS: Final = 128
"""Colours of a picture on a screen: lines, markers and their soft edges need no more, and a third of the bytes."""


class Picture(NamedTuple):
    """A figure for a page that loads nothing.

    Attributes
    ----------
    uri : str
        The PNG itself, as a data URI.
    width : int
        Width on the screen, in the browser's pixels.
    """

    uri: str
    width: int


def on_screen(figure: Path) -> Picture:
    """Make a picture for a screen from a figure's PNG.

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
    uri = f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}"
    return Picture(uri, round(ENLARGEMENT * size[0]))
