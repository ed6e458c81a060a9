"""The packing engines by name. A new engine is one module here and one line in ``ENGINES``."""

from __future__ import annotations

from filtercake.errors import EngineMissing
from filtercake.packing.engines.base import Engine, SettleRequest
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.engines.liggghts import Liggghts
from filtercake.packing.engines.liggghts_as_published import LiggghtsAsPublished

ENGINES: dict[str, type[Engine]] = {
    Embedded.name: Embedded,
    Liggghts.name: Liggghts,
    LiggghtsAsPublished.name: LiggghtsAsPublished,
}
"""In the order in which ``engine: auto`` prefers them."""

__all__ = ["ENGINES", "Engine", "SettleRequest", "get_engine", "kind_of", "label_of"]


def kind_of(name: str) -> type[Engine]:
    """Return an engine's class; the plain one, which starts from the cloud and stops by the rule, if not listed."""
    return ENGINES.get(name, Engine)


def label_of(name: str) -> str:
    """Return an engine's name for readers; one that is not listed keeps its own."""
    return ENGINES[name].label if name in ENGINES else name


def get_engine(name: str) -> Engine:
    """Return an engine that can run here.

    Raises
    ------
    EngineMissing
        If it is not known or not installed.
    """
    if name not in ENGINES:
        raise EngineMissing(f"engine {name!r} is not known; choose one of {', '.join(ENGINES)}")
    engine = ENGINES[name]()
    reason = engine.why_missing()
    if reason is not None:
        raise EngineMissing(reason)
    return engine
