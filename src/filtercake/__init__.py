"""Porosity and specific resistance of filter cakes from DEM packings of a crystal size distribution."""

__version__: str


def __getattr__(name: str) -> str:
    """Look up the version when it is first asked for: the search takes as long as a short command."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version

    try:
        found = version("filtercake")
    except PackageNotFoundError:  # used from a source tree that was never installed
        found = "0+unknown"
    globals()["__version__"] = found
    return found
