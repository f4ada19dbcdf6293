"""The records of parts as a store keeps them: values of the signal `twin/part_record`."""

import json
from typing import Any, NamedTuple

from cnctwin.memory.store.contract import Query, Store
from sparkplug.quality import Quality
from twin.vocabulary.twin_signals import PART_RECORD


class Part(NamedTuple):
    """One record: when the part was finished (ms since 1970), its id, the JSON as it was published, and the same parsed."""

    ended_ms: int
    id: str
    text: str
    record: dict[str, Any]


def parts(store: Store, machine: str, from_ms: int, to_ms: int) -> list[Part]:
    """The parts of a machine that were finished in [from_ms, to_ms), oldest first, each once. What is no record is left out."""
    (column,) = store.query(Query(machine, (PART_RECORD,), from_ms, to_ms))
    found: dict[str, Part] = {}
    for t_us, value, quality in zip(column.t_us, column.value, column.quality, strict=True):
        part = _part(t_us // 1000, value) if isinstance(value, str) and quality is not Quality.BAD else None
        if part is not None:
            found.setdefault(part.id, part)
    return list(found.values())


def _part(ended_ms: int, text: str) -> Part | None:
    try:
        record = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(record, dict) or not isinstance(record.get("id"), str):
        return None
    return Part(ended_ms, record["id"], text, record)
