"""A canonical signal (`twin/vocabulary/signals.py`) by its name, which an edge's configuration spells."""

from functools import lru_cache

from edge.errors import ConfigError
from twin.vocabulary.signals import SIGNALS, Signal, canonical


@lru_cache(maxsize=4096)
def signal(name: str) -> Signal:
    """The signal of this canonical name, or ConfigError."""
    known = canonical(name)
    if known is None:
        raise ConfigError(
            f"signal {name!r} is no canonical name; known are {', '.join(SIGNALS)}, axis_<letter>_pos_mm|pos_deg|load_pct, "
            "variable_<name> and plc_<name>"
        )
    return known
