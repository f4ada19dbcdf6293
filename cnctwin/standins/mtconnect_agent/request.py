"""From a request to an answer: routes, parameters and errors of both generations. No sockets.

Every error is a document; agent 1.4 sends it with status 200 (`Dialect.status`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from urllib.parse import parse_qs, unquote, urlsplit

from cnctwin.standins.mtconnect_agent.agent import Agent
from cnctwin.standins.mtconnect_agent.assets import Asset
from cnctwin.standins.mtconnect_agent.device_model import DataItem, Device
from cnctwin.standins.mtconnect_agent.documents import (
    assets_document,
    devices_document,
    error_document,
    items_of,
    streams_document,
)
from cnctwin.standins.mtconnect_agent.xpath import PathError, matching_ids, parse_path

COUNT_DEFAULT = 100
HEARTBEAT_MS_DEFAULT = 10_000
PARAMETERS_MAX = 16
INTEGER_MAX = 2**31 - 1


@dataclass(frozen=True)
class Answer:
    """A whole document."""

    status: int
    body: str


@dataclass(frozen=True)
class SampleStream:
    """A stream of what comes next. `start` None begins at the oldest observation."""

    start: int
    count: int
    interval_ms: int
    heartbeat_ms: int
    wanted: frozenset[DataItem] | None


@dataclass(frozen=True)
class CurrentStream:
    """A stream of snapshots."""

    interval_ms: int
    wanted: frozenset[DataItem] | None


class RequestError(Exception):
    """A request that is answered with an error document."""

    def __init__(self, status: int, code: str, text: str) -> None:
        super().__init__(text)
        self.status, self.code, self.text = status, code, text


def answer(agent: Agent, method: str, target: str) -> Answer | SampleStream | CurrentStream:
    """Answer a request, or say what to stream. The caller holds the agent's lock."""
    try:
        return _route(_Request(agent, method, target))
    except RequestError as error:
        return Answer(agent.dialect.status(error.status), error_document(agent, error.code, error.text))


class _Request:
    """The parts of a request, and its parameters with the range checks of the agent's generation."""

    def __init__(self, agent: Agent, method: str, target: str) -> None:
        self.agent = agent
        if method != "GET":
            if agent.dialect.is_modern:
                text = "PUT, POST, and DELETE are not allowed. MTConnect Agent is read only and only GET is allowed."
                raise RequestError(400, "INVALID_REQUEST", text)
            raise RequestError(400, "UNSUPPORTED", "Only the HTTP GET request is supported")
        try:
            url = urlsplit(target)
            query = parse_qs(url.query, keep_blank_values=True, max_num_fields=PARAMETERS_MAX)
        except ValueError as error:  # a broken host in the target, or too many parameters
            raise RequestError(400, "INVALID_REQUEST", f"The request can't be read: {error}") from error
        self.path = url.path
        self.segments = [unquote(part) for part in url.path.split("/") if part]
        self.query = {name: values[-1] for name, values in query.items()}

    def integer(self, name: str, *, low: int, high: int = INTEGER_MAX) -> int | None:
        """Return a parameter if it is given; `low` and `high` are both allowed values."""
        text = self.query.get(name)
        if text is None:
            return None
        modern = self.agent.dialect.is_modern
        if not text.removeprefix("-").isascii() or not text.removeprefix("-").isdigit() or len(text) > 20:
            raise self._not_a_number(name, text)
        value = int(text)
        if modern and name == "count" and value == 0:
            raise RequestError(400, "OUT_OF_RANGE", f"'{name}' must not be zero(0)")
        if value < low:
            bound = f"greater than {low - 1}" if modern else f"greater than or equal to {low}."
            raise RequestError(400, "OUT_OF_RANGE", f"'{name}' must be {bound}")
        if value > high:
            bound = f"less than {high + 1}" if modern else f"less than or equal to {high}."
            raise RequestError(400, "OUT_OF_RANGE", f"'{name}' must be {bound}")
        return value

    def _not_a_number(self, name: str, text: str) -> RequestError:
        if self.agent.dialect.is_modern:
            reason = f"cannot convert string '{text}' to integer"
            return RequestError(400, "INVALID_REQUEST", f"for query parameter '{name}': {reason}")
        if not text:
            return RequestError(400, "QUERY_ERROR", f"'{name}' cannot be empty.")
        return RequestError(400, "OUT_OF_RANGE", f"'{name}' must be a positive integer.")

    def device(self, key: str) -> Device:
        found = self.agent.model.device(key)
        if found is None:
            raise RequestError(404, "NO_DEVICE", f"Could not find the device '{key}'")
        return found

    def wanted(self, device: Device | None) -> frozenset[DataItem] | None:
        """Return the items of the device that the path selects; None means all items there are."""
        devices = [device] if device else list(self.agent.model.devices)
        items = items_of(devices)
        path = self.query.get("path")
        if path is None:
            return items if device else None
        try:
            ids = matching_ids(parse_path(path), [d.element for d in devices])
        except PathError as error:
            raise self._bad_path(path, str(error)) from error
        if not ids:
            raise self._bad_path(path, "it selects no data item")
        return frozenset(item for item in items if item.id in ids)

    def _bad_path(self, path: str, reason: str) -> RequestError:
        if self.agent.dialect.is_modern:
            return RequestError(400, "INVALID_XPATH", f"The path could not be parsed. Invalid syntax: {path}: {reason}")
        return RequestError(400, "INVALID_XPATH", f"The path could not be parsed. Invalid syntax: {path}")


def _route(request: _Request) -> Answer | SampleStream | CurrentStream:
    match request.segments:
        case [] | ["probe"]:
            return _probe(request, None)
        case [name] if name in _WITH_DEVICE:
            return _WITH_DEVICE[name](request, None)
        case ["asset" | "assets", ids]:
            return _assets_by_id(request, ids)
        case [device_key]:
            return _probe(request, request.device(device_key))
        case [device_key, "probe"]:
            return _probe(request, request.device(device_key))
        case [device_key, name] if name in _WITH_DEVICE:
            return _WITH_DEVICE[name](request, _device_of_stream(request, device_key))
        case [_, "asset" | "assets", ids]:
            return _assets_by_id(request, ids)
        case _:
            code = "INVALID_REQUEST" if request.agent.dialect.is_modern else "UNSUPPORTED"
            raise RequestError(404, code, f"The following path is invalid: {request.path}")


def _device_of_stream(request: _Request, key: str) -> Device:
    """Agent 1.4 looks the device up by an XPath, and so says that the path is wrong."""
    if request.agent.model.device(key) is None and not request.agent.dialect.is_modern:
        path = f'//Devices/Device[@name="{key}" or @uuid="{key}"]'
        raise RequestError(404, "INVALID_XPATH", f"The path could not be parsed. Invalid syntax: {path}")
    return request.device(key)


def _probe(request: _Request, device: Device | None) -> Answer:
    devices: Sequence[Device] = [device] if device else request.agent.model.devices
    return Answer(200, devices_document(request.agent, devices))


def _current(request: _Request, device: Device | None) -> Answer | CurrentStream:
    buffer = request.agent.buffer
    wanted = request.wanted(device)
    interval_ms = request.integer("interval", low=1 if request.agent.dialect.is_modern else 0)
    at = request.integer("at", low=buffer.first_sequence, high=buffer.next_sequence - 1)
    if interval_ms is not None:
        if at is not None:
            raise RequestError(400, "INVALID_REQUEST", "You cannot specify both the at and frequency arguments")
        return CurrentStream(interval_ms, wanted)
    return Answer(200, current_body(request.agent, wanted, at))


def current_body(agent: Agent, wanted: frozenset[DataItem] | None, at: int | None = None) -> str:
    """Write the latest values, or those that were so at a sequence number."""
    latest = agent.buffer.latest if at is None else agent.buffer.latest_at(at)
    return streams_document(agent, latest.all(wanted), agent.buffer.next_sequence)


def _sample(request: _Request, device: Device | None) -> Answer | SampleStream:
    buffer = request.agent.buffer
    wanted = request.wanted(device)
    # `from` may be the next sequence number: nothing is there yet, and that is no error.
    start = request.integer("from", low=buffer.first_sequence, high=buffer.next_sequence)
    count = request.integer("count", low=1, high=buffer.size)
    interval_ms = request.integer("interval", low=0)
    heartbeat_ms = request.integer("heartbeat", low=2 if request.agent.dialect.is_modern else 1)
    start = buffer.first_sequence if start is None else start
    count = min(COUNT_DEFAULT, buffer.size) if count is None else count
    if interval_ms is not None:
        return SampleStream(start, count, interval_ms, heartbeat_ms or HEARTBEAT_MS_DEFAULT, wanted)
    observations, next_sequence = buffer.since(start, count, wanted)
    return Answer(200, streams_document(request.agent, observations, next_sequence))


def _assets(request: _Request, device: Device | None) -> Answer:
    agent = request.agent
    count = request.integer("count", low=1)
    found = agent.assets.newest_first(
        asset_type=request.query.get("type"),
        device_uuid=device.uuid if device else None,
        removed=request.query.get("removed") == "true",
    )
    return Answer(200, assets_document(agent, found[:count]))


def _assets_by_id(request: _Request, ids: str) -> Answer:
    found: list[Asset] = []
    for asset_id in filter(None, ids.split(";")):
        asset = request.agent.assets.get(asset_id)
        if asset is None:
            text = f"Cannot find asset: {asset_id}" if request.agent.dialect.is_modern else (f"Could not find asset: {asset_id}")
            raise RequestError(404, "ASSET_NOT_FOUND", text)
        found.append(asset)
    return Answer(200, assets_document(request.agent, found))


_Handler = Callable[[_Request, Device | None], Answer | SampleStream | CurrentStream]
_WITH_DEVICE: dict[str, _Handler] = {"current": _current, "sample": _sample, "asset": _assets, "assets": _assets}
