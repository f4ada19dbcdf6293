"""The state of a machine, or of a cell, and its lanes, as JSON, so that a processor can be killed anywhere and go on anywhere.

Floats are written with as many digits as make them come back the same, NaN and the infinities as Python's JSON writes them.
Nothing is unpickled: what comes back is validated against the state's type.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from pydantic import TypeAdapter, ValidationError

from processors.discovery import AnyProcessor
from processors.errors import SnapshotError
from processors.running.emission import Emission
from processors.running.fold import Fold
from processors.running.lane import Lane
from sparkplug.metric import Change, NodeId, Reading
from sparkplug.quality import Quality

FORMAT = 2
PLAIN_TYPES = (float, int, str, type(None))  # and bool, which is an int; the most frequent one first
_to_json = json.JSONEncoder(separators=(",", ":"), ensure_ascii=False, check_circular=False).encode


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


def _adapter_of(processor: AnyProcessor) -> TypeAdapter[Any]:
    """Return what reads and writes a processor's states: it takes milliseconds to make, and each partition of a log needs one."""
    if (adapter := _adapters.get(processor.state)) is None:
        adapter = _adapters[processor.state] = TypeAdapter(processor.state)
    return adapter


_adapters: dict[Any, TypeAdapter[Any]] = {}


class _ChallengerKept(NamedTuple):
    version: str
    state: Any
    latest: dict[str, Change]
    others: dict[str, Reading]


class SnapshotCodec:
    """Snapshots of one processor; `unit` is the machine, or the cell, that has a state."""

    def __init__(self, processor: AnyProcessor) -> None:
        self._name, self._version = processor.name, processor.version
        self._adapter = _adapter_of(processor)

    def encode(self, unit: str, live: Fold, lanes: Mapping[str, Lane], history: Fold | None, late: Mapping[str, Lane]) -> bytes:
        """The snapshot of a unit: its state and the lanes that lead to it, live and of its history."""
        document = {
            "format": FORMAT,
            "processor": self._name,
            "version": self._version,
            "unit": unit,
            "live": self._part(live, lanes),
            "history": None if history is None else self._part(history, late),
        }
        return _to_json(document).encode()

    def unit(self, payload: bytes) -> tuple[str, dict[str, Any]]:
        """The unit's name and the document. Raises SnapshotError where it is none of ours."""
        try:
            document = json.loads(payload)
        except (ValueError, RecursionError) as error:
            raise SnapshotError(f"not JSON: {error}") from error
        if not isinstance(document, dict) or not isinstance(document.get("unit"), str):
            raise SnapshotError("no JSON object with a unit")
        found = (document.get("format"), document.get("processor"), document.get("version"))
        if found != (FORMAT, self._name, self._version):
            raise SnapshotError(f"format, processor, version are {found}; this is {(FORMAT, self._name, self._version)}")
        return document["unit"], document

    def restore(self, document: Any, fold: Fold, lane_of: Callable[[str], Lane]) -> None:
        """Put one part of a document into a fresh fold and fresh lanes. Raises SnapshotError before the state is changed."""
        try:
            lanes = [(lane_of(name), _lane_values(entry, fold.is_history)) for name, entry in document["machines"].items()]
            state = decode_state(self._adapter, document["state"])
            kept = self._challenger_kept(document, fold, lanes)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise SnapshotError(f"{type(error).__name__}: {error}") from error
        for lane, (clock_ms, last_ms, ticking, is_silent, row, latest, births, owner) in lanes:
            lane.clock_ms, lane.last_ms, lane.ticking, lane.is_silent = clock_ms, last_ms, ticking, is_silent
            lane.row.update(row)
            lane.emission.latest.update(latest)
            lane.is_restored = lane.births_are_old = True
            lane.births, lane.owner = births, owner
        fold.state = state
        if kept is not None:
            self._restore_challenger(kept, document.get("description", ""), fold, lanes[0][0])

    def _challenger_kept(self, document: Any, fold: Fold, lanes: Sequence[Any]) -> _ChallengerKept | None:
        """Return the challenger's part of a snapshot; None where that is of no use any more."""
        told = document.get("challenger")
        challenger = "" if fold.challenger is None else fold.challenger.version
        if told is None or not lanes or told["version"] not in {challenger, fold.version}:
            return None
        latest = {name: _change(name, change, False) for name, change in told["latest"].items()}
        others = {name: _reading(name, reading) for name, reading in told["others"].items()}
        return _ChallengerKept(told["version"], decode_state(self._adapter, told["state"]), latest, others)

    @staticmethod
    def _restore_challenger(kept: _ChallengerKept, lived_by: str, fold: Fold, lane: Lane) -> None:
        """Have the challenger go on. Where it was made live since the snapshot was saved, its state is the live one."""
        if kept.version == fold.version != lived_by:
            fold.state = kept.state
        if fold.challenger is not None and fold.challenger.version == kept.version:
            fold.challenger.state = kept.state
            fold.challenger.emission.latest.update(kept.latest)
            lane.others.update(kept.others)

    def _part(self, fold: Fold, lanes: Mapping[str, Lane]) -> dict[str, Any]:
        part = {
            "state": encode_state(self._adapter, fold.state),
            "machines": {name: _lane_document(lane) for name, lane in lanes.items()},
        }
        if fold.version:
            part["description"] = fold.version
        if (challenger := fold.challenger) is not None:
            (lane,) = lanes.values()
            part["challenger"] = {
                "version": challenger.version,
                "state": encode_state(self._adapter, challenger.state),
                "latest": _latest(challenger.emission),
                "others": _rows(lane.others),
            }
        return part


# The fields that a snapshot holds of each, in their order; JSON writes a quality as its number, and a tuple as a list.
_TOLD_OF_READING = slice(Reading._fields.index("value"), Reading._fields.index("reason") + 1)
_TOLD_OF_CHANGE = slice(Change._fields.index("value"), Change._fields.index("reason") + 1)


def _lane_document(lane: Lane) -> dict[str, Any]:
    return {
        "clock_ms": lane.clock_ms,
        "last_ms": lane.last_ms,
        "ticking": lane.ticking,
        "is_silent": lane.is_silent,
        "births": lane.births,
        "owners": _owners(lane.owner),
        # The broker gives tables, bytes and templates again with the next birth.
        "row": _rows(lane.row),
        "latest": _latest(lane.emission),
    }


def _owners(owner: Mapping[str, NodeId]) -> dict[str, list[str]]:
    """Return the signals that are taken from each node, in their order."""
    owners: dict[str, list[str]] = {}
    for name, node in owner.items():
        owners.setdefault(str(node), []).append(name)
    return owners


def _rows(row: Mapping[str, Reading]) -> dict[str, Any]:
    return {name: reading[_TOLD_OF_READING] for name, reading in row.items() if isinstance(reading[1], PLAIN_TYPES)}


def _latest(emission: Emission) -> dict[str, Any]:
    return {name: change[_TOLD_OF_CHANGE] for name, change in emission.latest.items()}


def latest_of(entry: Mapping[str, Any]) -> tuple[Change, ...]:
    """Return what a machine's twin device said last, by the entry of a machine in a snapshot."""
    return tuple(_change(name, change, False) for name, change in entry["latest"].items())


_Values = tuple[int | None, int, bool, bool, dict[str, Reading], dict[str, Change], dict[str, int], dict[str, NodeId]]


def _lane_values(entry: Any, is_history: bool) -> _Values:
    row = {name: _reading(name, reading) for name, reading in entry["row"].items()}
    latest = {name: _change(name, change, is_history) for name, change in entry["latest"].items()}
    clock_ms, last_ms = _whole(entry["clock_ms"]), _whole(entry["last_ms"]) or 0
    births = {str(node): int(stamp_ms) for node, stamp_ms in entry.get("births", {}).items()}
    owner = {str(name): _node(node) for node, names in entry.get("owners", {}).items() for name in names}
    return clock_ms, last_ms, entry["ticking"] is True, entry["is_silent"] is True, row, latest, births, owner


def _node(text: str) -> NodeId:
    group, _, node = text.partition("/")
    return NodeId(group, node)


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
