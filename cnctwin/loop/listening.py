"""A short listening for the standing gap of one machine, for the command line: with the loop's service, or without it."""

import os
import time
from uuid import uuid4

from cnctwin.loop.standing import Standing, standing_of
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.metric import NodeId
from sparkplug.topics import NAMESPACE
from twin.vocabulary.nodes import twin_node

GAP, TOOL_WEAR = twin_node("gap"), twin_node("tool_wear")
POLL_S = 0.05


def heard_gap(broker: BrokerAddress, group: str, machine: str, wait_s: float) -> Standing | None:
    """Return what the processor `gap` tells of a machine; None where it tells nothing within `wait_s`."""
    node = NodeId(group, GAP)
    name = f"show-{os.getpid()}-{uuid4().hex[:8]}"
    host = HostApplication(
        broker,
        name,
        (f"{NAMESPACE}/{group}/+/{GAP}/#",),
        publish_state=False,
        wanted=lambda one: one == node,
        trusted=lambda _: True,
    )
    host.start()
    try:
        has_asked, until_s = False, time.monotonic() + wait_s
        while time.monotonic() < until_s:
            host.poll(POLL_S)
            if host.online and not has_asked:
                has_asked = host.request_rebirth(node)
            picture = host.picture(node)
            device = None if picture is None else picture.devices.get(machine)
            if device is not None and device.readings:
                return standing_of(device.readings.values())
        return None
    finally:
        host.stop(1.0)
