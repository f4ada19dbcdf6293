"""Blocks from a sensor over TCP to a host behind a real broker, and what the vibration processor makes of them there."""

import time

import pytest

from edge.accelerometer.fold import BLOCK, RMS
from edge.accelerometer.frame import encode
from edge.accelerometer.section import AccelerometerSection, Publish
from edge.accelerometer.sensor import Accelerometer
from edge.running.birth import device_metrics
from processors.vibration import PROCESSOR
from processors.vibration import RMS as TWIN_RMS
from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.host import HostApplication
from sparkplug.metric import Change, NodeId
from tests.edge.accelerometer.test_fold import blocks, shaken
from tests.edge.accelerometer.test_sensor import Sender, sends
from tests.processors.streams import engine_of, published
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker


def test_raw_blocks_reach_the_processor_which_finds_what_the_edge_found(mosquitto: Mosquitto) -> None:
    wires = [encode(block) for block in blocks(shaken(2.6))]
    address = BrokerAddress(*mosquitto.address)
    node, host = EdgeNode(address, NodeId("cnc", "edge-vmc"), []), HostApplication(address, "onlooker")
    engine, found, by_edge = engine_of(PROCESSOR), list[object](), list[object]()
    with Sender(sends(*wires)) as sender:
        sensor = Accelerometer(AccelerometerSection(url=sender.url, publish=Publish.BOTH))
        node.start()
        host.start()
        node.declare_device("vmc", [*device_metrics(sensor.offers(), {}, 0), *sensor.metrics()])
        deadline_s = time.monotonic() + 60.0
        is_started = False
        try:
            while len([value for value in found if value is not None]) < 2 and time.monotonic() < deadline_s:
                events = host.poll(0.02)
                for event in events:
                    found += [value for _, name, value, _ in published(engine.feed(event, 0.0)) if name == TWIN_RMS]
                if not is_started and any(event.device == "vmc" for event in events):
                    sensor.start()
                    is_started = True
                if not is_started and node.online:  # a host that comes late asks for the birth when it hears a message
                    node.publish("vmc", [Change(RMS, None, round(time.time() * 1000))])
                for delivery in sensor.taken():
                    samples = delivery.frame.samples
                    by_edge += [sample.value for sample in samples if sample.signal == RMS]
                    changes = [Change(s.signal, s.value, s.timestamp_ms, s.quality, s.reason) for s in samples]
                    for change in (*changes, *delivery.changes):
                        assert node.publish("vmc", [change])
        finally:
            sensor.close()
            node.stop()
            host.stop()
    values = [value for value in found if value is not None]
    assert len(values) >= 2
    assert values == pytest.approx(by_edge, rel=1e-4), f"{BLOCK} came as FLOAT_ARRAY"
