"""The refusals of a plant: by the host session that looks, and by the processors, which publish their table."""

import json
from collections.abc import Iterable, Mapping, Sequence

from sparkplug.admission.refusal import Quarantined
from sparkplug.values import Value

QUARANTINE = "health/quarantine"
SHOWN_MAX = 10


def refused_lines(rows: Sequence[Quarantined], own_values: Iterable[tuple[str, Mapping[str, Value]]]) -> list[str]:
    """Return a line for each of `refusals`."""
    return [f"{name}: refused: {text}" for name, text in refusals(rows, own_values)]


def refusals(rows: Sequence[Quarantined], own_values: Iterable[tuple[str, Mapping[str, Value]]]) -> list[tuple[str, str]]:
    """Return each node or device of which something is refused, with the reason, in the order of their names.

    own_values: the metrics of each node, by its name
    """
    texts = {_name(str(row.node), row.device): row.text for row in rows}
    for _, values in own_values:
        for told in _table(values.get(QUARANTINE)):
            node, device, text = told.get("node"), told.get("device"), told.get("text")
            if isinstance(node, str) and isinstance(text, str) and (device is None or isinstance(device, str)):
                texts.setdefault(_name(node, device), text)
    return sorted(texts.items())


def _table(value: Value) -> list[Mapping[str, object]]:
    try:
        told = json.loads(value) if isinstance(value, str) else []
    except (ValueError, RecursionError):
        return []
    return [row for row in told if isinstance(row, dict)] if isinstance(told, list) else []


def _name(node: str, device: str | None) -> str:
    return node if device is None else f"{device} of {node}"
