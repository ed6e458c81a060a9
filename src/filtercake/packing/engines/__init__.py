"""The packing engines by name. A new engine is one module here and one line in ``ENGINES``."""

from __future__ import annotations

from filtercake.errors import EngineMissing
from filtercake.packing.engines.base import Engine, SettleRequest
from filtercake.packing.engines.embedded import Embedded
from filtercake.packing.engines.liggghts import Liggghts
from filtercake.packing.engines.liggghts_as_published import LiggghtsAsPublished

ENGINES: dict[str, type[Engine]] = {
    Liggghts.name: Liggghts,
    Embedded.name: Embedded,
    LiggghtsAsPublished.name: LiggghtsAsPublished,
}

__all__ = ["ENGINES", "Engine", "SettleRequest", "get_engine"]


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
