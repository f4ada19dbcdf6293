"""What a host application does on NDEATH and DDEATH (5.5 and 5.7)."""

import pytest

from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import MetricSpec
from sparkplug.node_picture import NodePicture
from sparkplug.quality import Quality
from tests.sparkplug.conformance.life import NODE, NODE_METRICS, OKUMA_METRICS, PROBE_METRICS, EdgeLife, HostLife

CLOCK_AHEAD_MS = 777_777


@pytest.fixture
def watching(host: HostLife, edge: EdgeLife) -> HostLife:
    """A host with another clock than the edge's, that knows the node and its two devices."""
    edge.declare("probe", PROBE_METRICS)
    host.connect()
    host.receive(*edge.rebirth())
    host.now_ms = edge.now_ms + CLOCK_AHEAD_MS
    assert all(reading.quality is Quality.GOOD for _, owner in _picture(host).owners() for reading in owner.readings.values())
    return host


def _picture(host: HostLife) -> NodePicture:
    picture = host.session.picture(NODE)
    assert picture is not None
    return picture


@pytest.mark.tck(
    "tck-id-operational-behavior-edge-node-termination-host-action-ndeath-node-offline",
    "tck-id-operational-behavior-edge-node-termination-host-action-ndeath-devices-offline",
)
def test_an_ndeath_takes_the_node_and_all_its_devices_offline_by_the_hosts_clock(watching: HostLife, edge: EdgeLife) -> None:
    events = watching.receive(*edge.close())
    assert [(event.kind, event.device, event.timestamp_ms) for event in events] == [
        (EventKind.DEATH, None, watching.now_ms),
        (EventKind.DEATH, "okuma", watching.now_ms),
        (EventKind.DEATH, "probe", watching.now_ms),
    ]
    assert not _picture(watching).online
    assert not any(owner.online for _, owner in _picture(watching).owners())


@pytest.mark.tck("tck-id-operational-behavior-edge-node-termination-host-action-ndeath-node-tags-stale")
def test_an_ndeath_makes_the_metrics_of_the_node_stale_by_the_hosts_clock(watching: HostLife, edge: EdgeLife) -> None:
    event = next(event for event in watching.receive(*edge.close()) if event.device is None)
    _all_stale(watching, event, None, {spec.name for spec in NODE_METRICS}, watching.now_ms)


@pytest.mark.tck("tck-id-operational-behavior-edge-node-termination-host-action-ndeath-devices-tags-stale")
@pytest.mark.parametrize(("device", "metrics"), [("okuma", OKUMA_METRICS), ("probe", PROBE_METRICS)])
def test_an_ndeath_makes_the_metrics_of_all_devices_stale_by_the_hosts_clock(
    watching: HostLife, edge: EdgeLife, device: str, metrics: tuple[MetricSpec, ...]
) -> None:
    event = next(event for event in watching.receive(*edge.close()) if event.device == device)
    _all_stale(watching, event, device, {spec.name for spec in metrics}, watching.now_ms)


@pytest.mark.tck(
    "tck-id-operational-behavior-edge-node-termination-host-action-ndeath-node-offline",
    "tck-id-operational-behavior-edge-node-termination-host-action-ndeath-node-tags-stale",
)
def test_the_will_does_the_same_and_the_will_of_an_earlier_session_does_nothing(watching: HostLife, edge: EdgeLife) -> None:
    old, present = edge.connects[-2].will, edge.connects[-1].will
    assert watching.session.message(old.topic, old.payload, watching.now_ms) == []
    assert _picture(watching).online
    assert len(watching.session.message(present.topic, present.payload, watching.now_ms)) == 3
    assert not _picture(watching).online


@pytest.mark.tck(
    "tck-id-operational-behavior-edge-node-termination-host-action-ddeath-devices-offline",
    "tck-id-operational-behavior-edge-node-termination-host-action-ddeath-devices-tags-stale",
)
def test_a_ddeath_takes_its_device_offline_and_makes_its_metrics_stale_by_the_payloads_time(
    watching: HostLife, edge: EdgeLife
) -> None:
    (death,) = edge.remove("probe")
    (event,) = watching.receive(death)
    assert (event.kind, event.device, event.timestamp_ms) == (EventKind.DEATH, "probe", death.at_ms)
    _all_stale(watching, event, "probe", {spec.name for spec in PROBE_METRICS}, death.at_ms)
    picture = _picture(watching)
    assert not picture.devices["probe"].online
    assert picture.online
    assert picture.devices["okuma"].online
    assert all(reading.quality is Quality.GOOD for reading in picture.devices["okuma"].readings.values())


def _all_stale(host: HostLife, event: HostEvent, device: str | None, names: set[str], at_ms: int) -> None:
    owner = _picture(host).owner(device)
    assert owner is not None
    for readings in (event.readings, owner.readings.values()):
        assert {reading.name for reading in readings} == names
        assert {(reading.quality, reading.timestamp_ms) for reading in readings} == {(Quality.STALE, at_ms)}
