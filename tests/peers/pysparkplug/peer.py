"""An edge node or a host application built with pysparkplug; the language on stdin and stdout is that of tests/peers/process.py.

`peer.py edge HOST PORT GROUP NODE PRIMARY_HOST` or `peer.py host HOST PORT GROUP HOST_ID`. Only what the package offers is used:
it has no session of a host application, so that the host is its client with a will and a subscription.
"""

from __future__ import annotations

import datetime
import json
import sys
import threading
from typing import Any

import pysparkplug as spb

WHOLE = {spb.DataType[name] for name in ("INT8", "INT16", "INT32", "INT64", "UINT8", "UINT16", "UINT32", "UINT64")}
KINDS = {kind.name.replace("_", ""): kind for kind in spb.DataType}
"""The types by the name of the specification, in capitals."""
PRINTING = threading.Lock()


def say(event: str, **rest: Any) -> None:
    """Write one line."""
    with PRINTING:
        print(json.dumps({"event": event, **rest}), flush=True)


def value_of(kind: spb.DataType, text: str | None) -> Any:
    """The value of a text."""
    if text is None:
        return None
    if kind in WHOLE:
        return int(text)
    if kind in (spb.DataType.FLOAT, spb.DataType.DOUBLE):
        return float(text)
    if kind is spb.DataType.BOOLEAN:
        return text == "true"
    if kind is spb.DataType.DATETIME:
        return datetime.datetime.fromtimestamp(int(text) / 1000, datetime.UTC)
    if kind in (spb.DataType.BYTES, spb.DataType.FILE):
        return bytes.fromhex(text)
    return text


def text_of(value: Any) -> str | None:
    """The text of a value."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, datetime.datetime):
        return str(round(value.timestamp() * 1000))
    return repr(value)


def metric_of(spec: dict[str, Any]) -> spb.Metric:
    """The metric that a line describes."""
    kind = KINDS[spec["type"].upper()]
    return spb.Metric(
        timestamp=spb.get_current_timestamp(),
        name=spec["name"],
        datatype=kind,
        value=value_of(kind, spec["value"]),
        alias=spec.get("alias"),
        is_null=spec["value"] is None,
    )


def told(metrics: Any) -> list[dict[str, Any]]:
    """Metrics as a line."""
    return [
        {"name": m.name or None, "alias": m.alias, "type": m.datatype.name.replace("_", ""), "value": text_of(m.value)}
        for m in metrics
    ]


def edge(host: str, port: str, group: str, node: str, _primary: str) -> None:
    """Run an edge node with one device. It knows no primary host."""
    metrics = json.loads(sys.stdin.readline())

    def commanded(device: str | None) -> Any:
        return lambda _, message: say("command", device=device, metrics=told(message.payload.metrics))

    client = spb.Client(client_options=spb.ClientOptions(reconnection_delay_min=1, reconnection_delay_max=1))
    one = spb.EdgeNode(group, node, [metric_of(m) for m in metrics["node"]], client=client, cmd_callback=commanded(None))
    device = spb.Device("lathe", [metric_of(m) for m in metrics["device"]], cmd_callback=commanded("lathe"))
    one.register(device)
    one.connect(host, port=int(port))
    say("started")
    for line in sys.stdin:
        asked = json.loads(line)
        if asked["do"] == "data":
            one.update_device("lathe", tuple(metric_of(m) for m in asked["metrics"]))
        elif asked["do"] == "run":
            for number in range(1, asked["count"] + 1):
                one.update_device("lathe", (metric_of({**asked["metric"], "value": str(number)}),))
        elif asked["do"] == "device death":
            one.deregister("lathe")
        elif asked["do"] == "device birth":
            one.register(device)
        elif asked["do"] == "stop":
            one.disconnect()
            return


def listen(host: str, port: str, group: str, host_id: str) -> None:
    """Run a host application: the client of the package with a will and subscriptions."""
    client = spb.Client(client_options=spb.ClientOptions(reconnection_delay_min=1, reconnection_delay_max=1))
    state_topic = spb.Topic(message_type=spb.MessageType.STATE, sparkplug_host_id=host_id)
    stamp = spb.get_current_timestamp()

    def state(online: bool) -> spb.Message:
        return spb.Message(state_topic, spb.State(timestamp=stamp, online=online), spb.QoS.AT_LEAST_ONCE, retain=True)

    def connected(_client: spb.Client) -> None:
        nonlocal stamp
        client.publish(state(online=True))
        stamp = spb.get_current_timestamp()
        client.set_will(state(online=False))  # of the next connection, as the package's edge node does it

    def heard(_client: spb.Client, message: spb.Message) -> None:
        topic = message.topic
        kind = str(topic.message_type.value)
        if kind in ("NBIRTH", "DBIRTH", "NDATA", "DDATA"):
            say(kind[1:].lower(), device=topic.device_id, metrics=told(message.payload.metrics))
        elif kind in ("NDEATH", "DDEATH"):
            say("death", device=topic.device_id)

    client.set_will(state(online=False))
    whole = spb.Topic(group_id=group, message_type=spb.MULTI_LEVEL_WILDCARD)
    client.subscribe(whole, spb.QoS.AT_MOST_ONCE, heard)
    client.connect(host, port=int(port), callback=connected)
    say("started")
    for line in sys.stdin:
        asked = json.loads(line)
        if asked["do"] in ("rebirth", "write"):
            kind = spb.MessageType.DCMD if asked.get("device") else spb.MessageType.NCMD
            topic = spb.Topic(group, kind, asked["node"], asked.get("device"))
            payload = (spb.DCmd if asked.get("device") else spb.NCmd)(
                timestamp=spb.get_current_timestamp(), metrics=tuple(metric_of(m) for m in asked["metrics"])
            )
            client.publish(spb.Message(topic, payload, spb.QoS.AT_MOST_ONCE, retain=False), include_dtypes=True)
        elif asked["do"] == "stop":
            client.publish(state(online=False))
            client.disconnect()
            return


if __name__ == "__main__":
    {"edge": edge, "host": listen}[sys.argv[1]](*sys.argv[2:])
