"""The rest of an NBIRTH, beside its metrics: the number of the session, and how well it keeps to the specification."""

from typing import Any

from sparkplug.datatype import DataType
from sparkplug.edge_session import BD_SEQ, REBIRTH


def is_sloppy(message: Any) -> bool:
    """Return True if an NBIRTH leaves out what the specification demands and we can do without: said, and accepted."""
    types = {metric.name: metric.datatype for metric in message.metrics}
    well_formed = types.get(BD_SEQ) == DataType.INT64 and types.get(REBIRTH) == DataType.BOOLEAN
    return not well_formed or not all(metric.timestamp for metric in message.metrics)


def bd_seq_of(message: Any) -> int | None:
    """Return the birth/death sequence number of an NBIRTH or NDEATH; None where it has none."""
    for metric in message.metrics:
        if metric.name == BD_SEQ:
            return int(metric.long_value or metric.int_value) % 256
    return None
