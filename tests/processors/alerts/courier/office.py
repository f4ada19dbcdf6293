"""A stand-in for the alerts processor, for the tests of the courier on a broker."""

import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.host_session import EventKind

PATIENCE_S = 60.0
ROOT = Path(__file__).parents[4]
OUTBOX, CLAIM, DELIVERY, RECEIPT = (f"cnctwin/alerts/{name}/" for name in ("outbox", "claim", "delivery", "receipt"))
STATE = "cnctwin/alerts/state"


def until(true: Callable[[], Any], what: str, seconds: float = PATIENCE_S) -> Any:
    """Wait for something; the value that was not false."""
    deadline_s = time.monotonic() + seconds
    while time.monotonic() < deadline_s:
        if value := true():
            return value
        time.sleep(0.02)
    raise AssertionError(f"{what} did not come within {seconds:g} s")


class Office:
    """Stands in for the alerts processor: puts notifications into the outbox, and reads everything under cnctwin/alerts."""

    def __init__(self, broker: BrokerAddress) -> None:
        self.topics: dict[str, bytes] = {}
        self.deliveries: dict[str, list[dict[str, Any]]] = {}
        self.commands: list[tuple[str, dict[str, Any]]] = []
        self._host = HostApplication(broker, "office", (), publish_state=False)
        self._host.subscribe_plain("cnctwin/alerts/#")
        self._host.subscribe_plain("cnctwin/marker/+")
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read)
        self._host.start()
        self._thread.start()
        until(lambda: self._host.online, "the broker")

    def _read(self) -> None:
        while not self._stop.is_set():
            for event in self._host.poll(0.02):
                if event.kind is not EventKind.PLAIN:
                    continue
                if not event.payload:
                    self.topics.pop(event.topic, None)
                elif event.topic.startswith("cnctwin/alerts/command/"):
                    self.commands.append((event.topic, json.loads(event.payload)))
                else:
                    self.topics[event.topic] = event.payload
                    if event.topic.startswith(DELIVERY):
                        said = json.loads(event.payload)
                        self.deliveries.setdefault(said["id"], []).append(said)

    @property
    def online(self) -> bool:
        return self._host.online

    def outbox(self) -> dict[str, bytes]:
        """Return what is in the outbox now."""
        topics = self.topics.copy()  # the thread goes on reading
        return {topic: payload for topic, payload in topics.items() if topic.startswith(OUTBOX)}

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._host.stop()

    def publish(self, topic: str, payload: bytes, retain: bool = True) -> None:
        until(lambda: self._host.publish_plain(topic, payload, qos=1, retain=retain), "room to publish")

    def put(self, key: str, receiver: str = "desk", **values: Any) -> None:
        """A notification into the outbox."""
        said = {
            "id": key, "receiver": receiver, "kind": "notify", "severity": "high", "title": key, "text": key,
            "says": [f"f{key}.1795000000000.firing.0.high"], "expires_s": time.time() + 3600.0,
            "body": {"version": "4", "alerts": []},
        }  # fmt: skip
        self.publish(OUTBOX + key, json.dumps(said | values).encode())

    def outcome(self, key: str) -> str:
        return str(self.deliveries[key][-1]["outcome"]) if key in self.deliveries else ""

    def state(self, *firing: tuple[str, int], told: tuple[str, ...] = (), phase: str = "firing") -> None:
        """The state of alerts, with these firing."""
        alerts = [
            {
                "fingerprint": fingerprint, "episode": episode, "phase": phase, "told": list(told), "status": "firing",
                "labels": {"alertname": "x", "severity": "high"}, "annotations": {}, "generatorURL": "",
                "startsAt": "2026-11-18T11:06:40.000Z", "endsAt": "0001-01-01T00:00:00Z",
            }
            for fingerprint, episode in firing
        ]  # fmt: skip
        self.publish(STATE, json.dumps({"alerts": alerts, "alerts_not_shown": 0}).encode())
