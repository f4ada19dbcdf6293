"""The page on the real interface, fed with a birth and live values as a broker would bring them; no broker, no store."""

import re
import threading
import time
from collections.abc import Iterator, Mapping

import pytest
from playwright.sync_api import Browser, expect

from cnctwin.api.application import create_app
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.server import Server
from cnctwin.api.sources import Sources
from sparkplug.datatype import DataType
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from sparkplug.values import PropertySet, PropertyValue
from tests.cnctwin.page.conftest import Visit
from tests.cnctwin.page.fake_server import now_ms
from tests.cnctwin.page.simulated_shop import SignalValue, signals

EDGE, TWIN = NodeId("cnc", "edge-vmc"), NodeId("cnc", "twin-thermal")


def event(kind: EventKind, node: NodeId, told: Mapping[str, SignalValue], t_ms: int, quality: Quality | None = None) -> HostEvent:
    """Return what a host application hears of the node; twins come of a node of their own."""
    is_twin = node is TWIN
    readings = tuple(
        Reading(name, one.value, t_ms, quality or (Quality.BAD if one.reason else Quality.GOOD), one.unit, one.reason, False)
        for name, one in told.items()
        if name.startswith("twin/") is is_twin
    )
    return HostEvent(kind, node, "vmc", t_ms, readings)


def describe(node: NodeId, _device: str | None) -> Mapping[str, PropertySet]:
    """Return what the birth certificates say of the twin's metrics."""
    if node is not TWIN:
        return {}
    told = signals(0, 0.0)
    return {name: {"provenance": PropertyValue(DataType.STRING, one.provenance)} for name, one in told.items()}


@pytest.fixture
def live() -> Iterator[tuple[Server, LivePlant, threading.Event]]:
    """A server whose machine lives until the event is set; then its edge dies."""
    plant, died, stop = LivePlant(), threading.Event(), threading.Event()
    app = create_app(Sources(live=plant))

    def feed() -> None:
        began = now_ms()
        plant.take([event(EventKind.BIRTH, node, signals(0, began / 1000), began) for node in (EDGE, TWIN)], began, describe)
        dead = False
        while not stop.is_set():
            t_ms = now_ms()
            if not died.is_set():
                plant.take([event(EventKind.DATA, node, signals(0, t_ms / 1000), t_ms) for node in (EDGE, TWIN)], t_ms, describe)
            elif not dead:
                dead = True
                told = signals(0, t_ms / 1000)
                plant.take([event(EventKind.DEATH, node, told, t_ms, Quality.STALE) for node in (EDGE, TWIN)], t_ms, describe)
            app.state.fan_out.send(plant.flush(t_ms))
            time.sleep(0.1)

    with Server(app) as server:
        thread = threading.Thread(target=feed)
        thread.start()
        yield server, plant, died
        stop.set()
        thread.join()


def test_the_page_and_the_interface_understand_each_other(
    browser: Browser, live: tuple[Server, LivePlant, threading.Event]
) -> None:
    server, _, died = live
    visit = Visit(browser, server.url)
    page = visit.open("")
    page.get_by_role("link", name=re.compile("vmc")).click()
    tile = page.locator('[data-tile="spindle_temp_c"]')
    expect(tile.locator(".big .figure")).to_have_text(re.compile(r"\d"))
    expect(tile.locator(".line").nth(0)).to_have_text(re.compile(r"twin.*modelled.*\d"))
    expect(tile.locator(".line.rest")).to_have_text(re.compile(r"gap.*\d.*K"))
    for view in ("gap", "alerts", "replay", "parts"):
        visit.open(f"#/{view}" if view == "alerts" else f"#/{view}/vmc")
        page.wait_for_timeout(400)
    visit.open("#/machine/vmc")
    died.set()
    expect(page.locator(".machine-head")).to_contain_text("stale since")
    expect(tile).to_have_class(re.compile("stale"))
    visit.context.close()
    # Parts without a store are a 503, of which the browser writes a line, whenever it comes.
    assert [error for error in visit.errors if "503 (Service Unavailable)" not in error] == []
