"""A sample that the fold could not take: what it was, and one line of why."""

import json

from processors.sample import Sample
from sparkplug.host_event import HostEvent

SIGNALS_MAX = 50
TEXT_MAX = 200


def dead_letter(processor: str, sample: Sample, error: Exception) -> bytes:
    """The letter as JSON, bounded in size, so that a reader can see at once which value did it."""
    shown = sample.changed[:SIGNALS_MAX]
    return _encoded(
        {
            "processor": processor,
            "machine": sample.machine,
            "error": " ".join(f"{type(error).__name__}: {error}".split())[:TEXT_MAX],
            "kind": sample.kind.value,
            "at_s": sample.at_s,
            "gap_s": sample.gap_s,
            "is_history": sample.is_history,
            "changed": {name: _shown(sample.row[name].value) for name in shown if name in sample.row},
            "changed_not_shown": len(sample.changed) - len(shown),
        }
    )


def letter_of_message(processor: str, event: HostEvent, error: Exception) -> bytes:
    """The letter of a message that could not be handled at all, by a fault of ours."""
    shown = event.readings[:SIGNALS_MAX]
    return _encoded(
        {
            "processor": processor,
            "machine": (event.device or "")[:TEXT_MAX],
            "error": " ".join(f"{type(error).__name__}: {error}".split())[:TEXT_MAX],
            "kind": event.kind.value,
            "at_s": event.timestamp_ms / 1000,
            "node": str(event.node)[:TEXT_MAX],
            "changed": {reading.name[:TEXT_MAX]: _shown(reading.value) for reading in shown},
            "changed_not_shown": len(event.readings) - len(shown),
        }
    )


def _encoded(letter: dict[str, object]) -> bytes:
    return json.dumps(letter, ensure_ascii=False).encode("utf-8", "replace")


def _shown(value: object) -> object:
    """A value as JSON shows it; what is no plain finite number is shown as text, so that the letter is always valid JSON."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, (int, float)) and abs(value) < 1e300:
        return value
    return str(value)[:TEXT_MAX]
