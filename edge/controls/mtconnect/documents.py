"""The documents of an agent, parsed: streams and errors here, the device description in `model`.

Source: MTConnect part 1 (protocol) and part 3 (streams). What real agents do and this file allows for: errors come with HTTP 200
or 4xx and are told by the root element alone; an element without text is an empty value, not a missing one; the name of a
condition's element is its level; a data set has entries in place of text; document order is not sequence order.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from typing import NamedTuple
from xml.etree.ElementTree import Element

from edge.controls.mtconnect.model import DeviceModel, devices_of
from edge.controls.mtconnect.tool_asset import ToolAsset, tools_of
from edge.controls.mtconnect.xml import local_name, local_tag, parse_small, parse_xml
from edge.errors import DocumentError

UNAVAILABLE = "UNAVAILABLE"
SEQUENCE_MAX = 2**63
_SEVERAL = ("DataSet", "Table", "TimeSeries")  # the ends of names of elements with several values


class Header(NamedTuple):
    """The header of a document: the agent, and where it is. Sequence numbers are None where the document has none.

    created_ms: the agent's clock when it made the document, to within `resolution_ms`; None where it cannot be read
    """

    instance_id: str
    buffer_size: int | None
    first_sequence: int | None
    last_sequence: int | None
    next_sequence: int | None
    created_ms: int | None = None
    resolution_ms: int = 1000


class Observation(NamedTuple):
    """One observation. `sequence` and `timestamp_ms` are None where they cannot be read; `value` of an empty element is ""."""

    device_uuid: str
    device_name: str
    data_item_id: str
    name: str
    element: str
    is_condition: bool
    sequence: int | None
    timestamp_ms: int | None
    value: str
    native_code: str
    has_entries: bool
    native_severity: str = ""
    entries: tuple[tuple[str, str], ...] = ()  # of a data set: key and value


@dataclass(frozen=True, slots=True)
class DevicesDocument:
    """The answer to /probe."""

    header: Header
    devices: tuple[DeviceModel, ...]


@dataclass(frozen=True, slots=True)
class StreamsDocument:
    """The answer to /current and /sample, in document order."""

    header: Header
    observations: tuple[Observation, ...]


@dataclass(frozen=True, slots=True)
class AssetsDocument:
    """The answer to /asset: the cutting tools in it."""

    header: Header
    tools: tuple[ToolAsset, ...]


@dataclass(frozen=True, slots=True)
class ErrorDocument:
    """An answer that is none: code and text of each error."""

    header: Header
    errors: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        return "; ".join(f"{code}: {text}" if text else code for code, text in self.errors) or "an error without a code"


Document = DevicesDocument | StreamsDocument | AssetsDocument | ErrorDocument


def parse_document(raw: bytes) -> Document:
    """The document in these bytes, or DocumentError."""
    root = parse_small(raw)
    if root is None or local_name(root) != "MTConnectStreams":  # of which no more than six levels are read
        root = parse_xml(raw)
    kind = local_name(root)
    header = _header(root)
    if kind == "MTConnectDevices":
        return DevicesDocument(header, devices_of(root))
    if kind == "MTConnectStreams":
        if header.next_sequence is None:
            raise DocumentError("streams document without a nextSequence in its header")
        return StreamsDocument(header, tuple(_observations(root)))
    if kind == "MTConnectAssets":
        return AssetsDocument(header, tools_of(root))
    if kind == "MTConnectError":
        errors = tuple((e.get("errorCode", ""), (e.text or "").strip()) for e in root.iter() if e.get("errorCode") is not None)
        return ErrorDocument(header, errors)
    raise DocumentError(f"root element {kind!r} is none of MTConnectDevices, MTConnectStreams, MTConnectAssets, MTConnectError")


@lru_cache(maxsize=1024)  # the observations of a document have few different times
def timestamp_ms(text: str) -> int | None:
    """Milliseconds since 1970 of an ISO 8601 time with any number of digits, UTC if it has no zone; None where it is no time.

    >>> timestamp_ms("2022-08-08T13:51:34.7167146Z")
    1659966694716
    """
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    if time.tzinfo is None:
        time = time.replace(tzinfo=UTC)
    since = time - _EPOCH
    milliseconds = since.days * 86_400_000 + since.seconds * 1000 + since.microseconds // 1000
    return milliseconds if milliseconds >= 0 else None


_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def _header(root: Element) -> Header:
    element = next((child for child in root if local_name(child) == "Header"), None)
    if element is None:
        raise DocumentError("document without a Header")
    created = element.get("creationTime", "")
    return Header(
        element.get("instanceId", ""),
        buffer_size=_sequence(element.get("bufferSize")),
        first_sequence=_sequence(element.get("firstSequence")),
        last_sequence=_sequence(element.get("lastSequence")),
        next_sequence=_sequence(element.get("nextSequence")),
        created_ms=timestamp_ms(created),
        resolution_ms=_resolution_ms(created),
    )


def _resolution_ms(text: str) -> int:
    """Return how fine a time is that is written so. Both agents that were looked at write whole seconds, and truncate.

    >>> [_resolution_ms(f"2026-05-04T06:00:{seconds}") for seconds in ("00Z", "00.25Z", "00.000Z", "00.123456+09:00")]
    [1000, 10, 1000, 1]
    """
    digits = text.rpartition(".")[2].partition("+")[0].rstrip("Zz") if "." in text else ""
    return 10 ** max(0, 3 - len(digits)) if digits.strip("0") else 1000


def _observations(root: Element) -> Iterator[Observation]:
    streams = next((child for child in root if local_name(child) == "Streams"), None)
    for device in () if streams is None else streams:
        uuid, name = device.get("uuid", ""), device.get("name", "")
        for component in device:
            for group in component:
                is_condition = local_name(group) == "Condition"
                for element in group:
                    yield _observation(uuid, name, element, is_condition)


def _observation(uuid: str, device_name: str, element: Element, is_condition: bool) -> Observation:
    kind, get = local_tag(element.tag), element.get
    return Observation(
        uuid,
        device_name,
        get("dataItemId", ""),
        get("name", ""),
        kind,
        is_condition,
        _sequence(get("sequence")),
        timestamp_ms(get("timestamp", "")),
        (element.text or "").strip(),
        get("nativeCode", ""),
        len(element) > 0 or kind.endswith(_SEVERAL),
        get("nativeSeverity", ""),
        _entries(element) if len(element) else (),
    )


def _entries(element: Element) -> tuple[tuple[str, str], ...]:
    """The entries of a data set. One that was removed has no value any more."""
    entries = (entry for entry in element if local_tag(entry.tag) == "Entry")
    return tuple(
        (entry.get("key", ""), UNAVAILABLE if entry.get("removed") == "true" else (entry.text or "").strip()) for entry in entries
    )


def _sequence(text: str | None) -> int | None:
    if text is None or not text.isascii() or not text.isdigit() or len(text) > 19:
        return None
    number = int(text)
    return number if number < SEQUENCE_MAX else None
