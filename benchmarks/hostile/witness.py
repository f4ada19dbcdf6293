"""The machine that stands beside a hostile sender: it says a number five times a second, and once it is overloaded.

Its number is the count of its messages, so that a reader knows which are missing, and how old each is.
"""

import json
import threading
import time
from typing import Any

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import Change, MetricSpec, NodeId
from twin.vocabulary.nodes import edge_node
from twin.vocabulary.topics import ALERT_STATE, MIRROR

HZ = 5.0
ARRIVES_S_MAX = 5.0
DWELL_S = 5.0  # of the rule, processors/rules/rules.toml
OVERLOADED = 150.0
COUNT, LOAD = "part_count", "spindle_load_pct"


class Witness:
    """One machine with an edge node of its own, and what a plain MQTT client sees of it."""

    def __init__(self, broker: BrokerAddress, name: str) -> None:
        self.name = name
        self.sent: dict[int, float] = {}
        self.ages: list[float] = []
        self.seen: set[int] = set()
        self.overloaded_s: float | None = None
        self.alarmed_s: float | None = None
        self._is_over = False
        self._stop = threading.Event()
        specs = [
            MetricSpec(COUNT, DataType.DOUBLE, value=0.0),
            MetricSpec(LOAD, DataType.DOUBLE, "%", value=20.0),
            MetricSpec("spindle_rpm", DataType.DOUBLE, "rev/min", value=5_000.0),
        ]
        self._edge = EdgeNode(broker, NodeId("cnc", edge_node(name)))
        self._edge.declare_device(name, specs)
        self._reader = mqtt.Client(CallbackAPIVersion.VERSION2, client_id=f"witness-{name}")
        self._reader.on_message = self._heard
        self._reader.on_connect = lambda client, *_: client.subscribe([(f"{MIRROR}{name}/{COUNT}", 0), (ALERT_STATE, 0)])
        self._reader.connect(broker.host, broker.port)
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        """Begin to speak."""
        self._reader.loop_start()
        self._edge.start()
        self._thread.start()

    def overload(self) -> None:
        """Have the load rise over the limit of the rule."""
        self._is_over = True

    def stop(self) -> None:
        """Fall silent."""
        self._stop.set()
        self._thread.join()
        until_s = time.monotonic() + ARRIVES_S_MAX
        while self.missing and time.monotonic() < until_s:  # what is on its way may arrive
            time.sleep(0.1)
        self._edge.stop()
        self._reader.loop_stop()
        self._reader.disconnect()

    @property
    def missing(self) -> int:
        """The number of values that never reached the reader, of those after the first that did."""
        first = min(self.seen, default=0)
        return sum(count >= first and count not in self.seen for count in list(self.sent))

    @property
    def alert_s(self) -> float | None:
        """The time from the end of the rule's dwell until the alert stood on the broker; None where it never did."""
        if self.overloaded_s is None or self.alarmed_s is None:
            return None
        return max(0.0, self.alarmed_s - self.overloaded_s - DWELL_S)

    def _run(self) -> None:
        count = 0
        while not self._stop.wait(1.0 / HZ):
            count += 1
            if self._is_over and self.overloaded_s is None:
                self.overloaded_s = time.monotonic()
            now_ms = time.time_ns() // 1_000_000
            changes = [
                Change(COUNT, float(count), now_ms),
                Change(LOAD, OVERLOADED if self._is_over else 20.0 + count % 3, now_ms),
            ]
            self.sent[count] = time.monotonic()  # before it is sent: it may be back at once
            if not self._edge.publish(self.name, changes):
                del self.sent[count]

    def _heard(self, _client: Any, _data: Any, message: mqtt.MQTTMessage) -> None:
        now_s = time.monotonic()
        try:
            said = json.loads(message.payload)
            if message.topic == ALERT_STATE:
                if self.alarmed_s is None and any(self._is_of_rule(alert) for alert in said["alerts"]):
                    self.alarmed_s = now_s
            elif said["value"] and int(said["value"]) in self.sent and int(said["value"]) not in self.seen:
                self.seen.add(int(said["value"]))
                self.ages.append(now_s - self.sent[int(said["value"])])
        except (ValueError, TypeError, KeyError):
            return  # what a hostile sender put there

    def _is_of_rule(self, alert: dict[str, Any]) -> bool:
        return alert["labels"].get("machine") == self.name and alert.get("phase") == "firing"
