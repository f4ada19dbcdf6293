"""A sample that the fold could not take: what it was, and one line of why."""

import json

from processors.sample import Sample

SIGNALS_MAX = 50
TEXT_MAX = 200


def dead_letter(processor: str, sample: Sample, error: Exception) -> bytes:
    """The letter as JSON, bounded in size, so that a reader can see at once which value did it."""
    shown = sample.changed[:SIGNALS_MAX]
    readings = {name: _shown(sample.row[name].value) for name in shown if name in sample.row}
    letter = {
        "processor": processor,
        "machine": sample.machine,
        "error": " ".join(f"{type(error).__name__}: {error}".split())[:TEXT_MAX],
        "kind": sample.kind.value,
        "at_s": sample.at_s,
        "gap_s": sample.gap_s,
        "is_history": sample.is_history,
        "changed": readings,
        "changed_not_shown": len(sample.changed) - len(shown),
    }
    return json.dumps(letter, ensure_ascii=False).encode()


def _shown(value: object) -> object:
    """A value as JSON shows it; what is no plain finite number is shown as text, so that the letter is always valid JSON."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, (int, float)) and abs(value) < 1e300:
        return value
    return str(value)[:TEXT_MAX]
