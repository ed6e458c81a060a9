"""What the functions of the library say of their arguments alike."""

from __future__ import annotations

from pathlib import Path

PRESSURE = 50.0
"""Pressure drop across a cake where none is given, kPa: a vacuum filter's."""
ORIGIN = Path("options")
"""Stands for the study file in messages about arguments; files that arguments name are looked up from here."""
SOURCES = ("mixture", "file", "lognormal", "rosin_rammler", "kinetics")
"""What a distribution may come from."""
OUT_OF_REACH = "a number is too small or too large to compute with"
MILLIMETRE = 1e-3
