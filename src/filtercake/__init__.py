"""Porosity and specific resistance of filter cakes from DEM packings of a crystal size distribution."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("filtercake")
except PackageNotFoundError:  # used from a source tree that was never installed
    __version__ = "0+unknown"
