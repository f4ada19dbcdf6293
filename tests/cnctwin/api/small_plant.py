"""A plant of one machine, told by hand, and applications over it."""

import asyncio
import time
from collections.abc import Mapping
from typing import Any, Self

import httpx
from fastapi import FastAPI

from cnctwin.api.application import create_app
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.sources import Sources
from sparkplug.datatype import DataType
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from sparkplug.values import PropertySet, PropertyValue, Value

EDGE, THERMAL = NodeId("cnc", "edge-vmc"), NodeId("cnc", "twin-thermal")
UNITS = {"spindle_load_pct": "%", "spindle_rpm": "rev/min", "twin/spindle_temp_c": "°C"}


def now() -> int:
    """ms since 1970."""
    return time.time_ns() // 1_000_000


def reading(name: str, value: Value, t_ms: int, quality: Quality = Quality.GOOD, reason: str | None = None) -> Reading:
    """A reading with the unit of its name."""
    return Reading(name, value, t_ms, quality, UNITS.get(name), reason, False)


def birth(values: Mapping[str, Value], t_ms: int, node: NodeId = EDGE, machine: str | None = "vmc") -> HostEvent:
    """A birth certificate."""
    return HostEvent(EventKind.BIRTH, node, machine, t_ms, tuple(reading(name, value, t_ms) for name, value in values.items()))


def data(values: Mapping[str, Value], t_ms: int, node: NodeId = EDGE, machine: str | None = "vmc") -> HostEvent:
    """Return what has changed."""
    return HostEvent(EventKind.DATA, node, machine, t_ms, tuple(reading(name, value, t_ms) for name, value in values.items()))


def death(values: Mapping[str, Value], t_ms: int, node: NodeId = EDGE, machine: str | None = "vmc") -> HostEvent:
    """The end of a connection: all values are stale."""
    stale = tuple(reading(name, value, t_ms, Quality.STALE, "edge node offline") for name, value in values.items())
    return HostEvent(EventKind.DEATH, node, machine, t_ms, stale, "edge node offline")


def modelled(_node: NodeId, _device: str | None) -> Mapping[str, PropertySet]:
    """Return what the birth of a twin says of its metrics."""
    text = DataType.STRING
    return {
        "twin/spindle_temp_c": {"provenance": PropertyValue(text, "modelled"), "meaning": PropertyValue(text, "rise + ambient")}
    }


def small_plant(t_ms: int | None = None) -> LivePlant:
    """One machine with its twin, online."""
    at_ms = now() if t_ms is None else t_ms
    live = LivePlant()
    live.take([birth({"spindle_load_pct": 37.25, "spindle_rpm": 6000.0, "exec_state": "ACTIVE", "tool_number": 5}, at_ms)], at_ms)
    live.take([birth({"twin/spindle_temp_c": 31.5, "twin/gap_spindle_rpm": 1.5}, at_ms, THERMAL)], at_ms, modelled)
    return live


class Client:
    """Asks an application without a server, from an address that a test chooses."""

    def __init__(self, app: FastAPI, peer: str, host: str, scheme: str = "http") -> None:
        self.app = app
        self._runner = asyncio.Runner()
        transport = httpx.ASGITransport(app=app, client=(peer, 50_000), raise_app_exceptions=False)
        self._client = httpx.AsyncClient(transport=transport, base_url=f"{scheme}://{host}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._runner.run(self._client.aclose())
        self._runner.close()

    @property
    def cookies(self) -> httpx.Cookies:
        """Return what was set."""
        return self._client.cookies

    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        """One request, to its end."""
        return self._runner.run(self._client.request(method, path, **options))

    def get(self, path: str, **options: Any) -> httpx.Response:
        """Likewise."""
        return self.request("GET", path, **options)

    def post(self, path: str, **options: Any) -> httpx.Response:
        """Likewise."""
        return self.request("POST", path, **options)


def client_of(
    live: LivePlant | None = None, *, peer: str = "127.0.0.1", host: str = "127.0.0.1", scheme: str = "http", **parts: Any
) -> Client:
    """A client of an application over a plant."""
    return Client(create_app(Sources(live=LivePlant() if live is None else live, **parts)), peer, host, scheme)
