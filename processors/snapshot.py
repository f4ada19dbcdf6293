"""The state of one machine's lanes as JSON, so that a processor can be killed anywhere and go on anywhere.

Floats are written with as many digits as make them come back the same, NaN and the infinities as Python's JSON writes them.
Nothing is unpickled: what comes back is validated against the state's type.
"""

import json
from typing import Any

from pydantic import TypeAdapter, ValidationError

from processors.contract import Processor
from processors.errors import SnapshotError
from processors.lane import Lane
from sparkplug.metric import Change, Reading
from sparkplug.quality import Quality

FORMAT = 1
PLAIN_TYPES = (bool, int, float, str)


def encode_state(adapter: TypeAdapter[Any], state: Any) -> Any:
    """The state as JSON values."""
    return adapter.dump_python(state, mode="json")


def decode_state(adapter: TypeAdapter[Any], dumped: Any) -> Any:
    """The state again. Raises SnapshotError where it is not the same thing: a field too many, too few, or of another type."""
    try:
        state = adapter.validate_python(dumped)
    except ValidationError as error:
        first = error.errors()[0]
        raise SnapshotError(f"state: {'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    if json.dumps(encode_state(adapter, state), sort_keys=True) != json.dumps(dumped, sort_keys=True):
        raise SnapshotError("state has another form than this version writes")
    return state


class SnapshotCodec:
    """Snapshots of one processor."""

    def __init__(self, processor: Processor[Any, Any]) -> None:
        self._name, self._version = processor.name, processor.version
        self._adapter: TypeAdapter[Any] = TypeAdapter(processor.state)

    def encode(self, machine: str, live: Lane, history: Lane | None) -> bytes:
        """The snapshot of a machine."""
        document = {
            "format": FORMAT,
            "processor": self._name,
            "version": self._version,
            "machine": machine,
            "live": self._lane(live),
            "history": None if history is None else self._lane(history),
        }
        return json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()

    def machine(self, payload: bytes) -> tuple[str, dict[str, Any]]:
        """The machine's name and the document. Raises SnapshotError where it is none of ours."""
        try:
            document = json.loads(payload)
        except (ValueError, RecursionError) as error:
            raise SnapshotError(f"not JSON: {error}") from error
        if not isinstance(document, dict) or not isinstance(document.get("machine"), str):
            raise SnapshotError("no JSON object with a machine")
        found = (document.get("format"), document.get("processor"), document.get("version"))
        if found != (FORMAT, self._name, self._version):
            raise SnapshotError(f"format, processor, version are {found}; this is {(FORMAT, self._name, self._version)}")
        return document["machine"], document

    def restore(self, document: Any, lane: Lane) -> None:
        """Put one lane's part of a document into a fresh lane. Raises SnapshotError before anything is changed."""
        try:
            clock_ms, last_ms = _whole(document["clock_ms"]), _whole(document["last_ms"])
            ticking, is_silent = document["ticking"] is True, document["is_silent"] is True
            row = {name: _reading(name, entry) for name, entry in document["row"].items()}
            latest = {name: _change(name, entry, lane.emission.is_history) for name, entry in document["latest"].items()}
            state = decode_state(self._adapter, document["state"])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise SnapshotError(f"{type(error).__name__}: {error}") from error
        lane.clock_ms, lane.last_ms, lane.ticking, lane.is_silent = clock_ms, last_ms or 0, ticking, is_silent
        lane.row.update(row)
        lane.emission.latest.update(latest)
        lane.state = state
        lane.is_restored = True

    def _lane(self, lane: Lane) -> dict[str, Any]:
        return {
            "clock_ms": lane.clock_ms,
            "last_ms": lane.last_ms,
            "ticking": lane.ticking,
            "is_silent": lane.is_silent,
            "state": encode_state(self._adapter, lane.state),
            # The broker gives tables, bytes and templates again with the next birth.
            "row": {
                name: [reading.value, reading.timestamp_ms, int(reading.quality), reading.unit, reading.reason]
                for name, reading in lane.row.items()
                if reading.value is None or isinstance(reading.value, PLAIN_TYPES)
            },
            "latest": {
                name: [change.value, change.timestamp_ms, int(change.quality), change.reason]
                for name, change in lane.emission.latest.items()
            },
        }


def _whole(value: Any) -> int | None:
    if value is not None and type(value) is not int:
        raise TypeError(f"{value!r} is no whole number")
    return value


def _reading(name: str, entry: Any) -> Reading:
    value, timestamp_ms, quality, unit, reason = entry
    return Reading(name, value, int(timestamp_ms), Quality(quality), unit, reason, is_historical=False)


def _change(name: str, entry: Any, is_history: bool) -> Change:
    value, timestamp_ms, quality, reason = entry
    return Change(name, value, int(timestamp_ms), Quality(quality), reason, is_history)
