"""The alerts desk: the alerts processor's state as it publishes it on the broker, and commands to it.

The topics are those of `processors/alerts` (docs/how-to/alerts.md).
"""

import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from uuid import uuid4

from cnctwin.errors import UsageError
from cnctwin.processes import published_state
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.host_session import EventKind
from twin.vocabulary.topics import ALERT_COMMAND, ALERT_STATE

FRESH_S_MAX = 150.0  # the state comes once a minute


@dataclass
class Desk:
    """A connection to the alerts processor: its state as it comes, and a way to give it a command."""

    host: HostApplication
    url: str
    state: dict[str, Any] = field(default_factory=dict)

    def until(self, true: Callable[[], Any], seconds: float) -> Any:
        """Read until something is so; what was not false, or None."""
        deadline_s = time.monotonic() + seconds
        while True:
            for event in self.host.poll(0.05):
                if event.kind is EventKind.PLAIN and event.topic == ALERT_STATE and event.payload:
                    self.state = published_state.parsed(event.payload)
            if (value := true()) or time.monotonic() > deadline_s:
                return value or None

    def command(self, name: str, wait_s: float, **fields: Any) -> str:
        """Give a command and wait for what becomes of it. Raises UsageError where it is not done."""
        key = uuid4().hex[:16]
        payload = json.dumps({"id": key, **fields}, ensure_ascii=False).encode()
        if not self.host.publish_plain(ALERT_COMMAND + name, payload, qos=1):
            raise UsageError(f"the connection to {self.url} was lost; try again")

        def outcome() -> Any:
            return next((one for one in self.state.get("commands", ()) if one.get("id") == key), None)

        found = self.until(outcome, wait_s)
        if found is None:
            raise UsageError(f"no answer within {wait_s:g} s; does the processor `alerts` run? (cnctwin process alerts)")
        if not found["done"]:
            raise UsageError(_line(found["text"]))
        return _line(found["text"])


def _line(told: Any) -> str:
    """Return a text that came over the broker, without what would steer a terminal."""
    return "".join(letter if letter.isprintable() else " " for letter in str(told))


@contextmanager
def alert_desk(given: BrokerAddress | None, wait_s: float) -> Iterator[Desk]:
    """Connect and wait for the state. Raises UsageError where there is none, or one that is not kept up."""
    where = given or BrokerAddress()
    host = HostApplication(where, f"alerts-{os.getpid()}-{uuid4().hex[:8]}", (), publish_state=False)
    host.subscribe_plain(ALERT_STATE)
    host.start()
    try:
        desk = Desk(host, where.url)
        if desk.until(lambda: desk.state, wait_s) is None:
            if not host.online:
                raise UsageError(host.last_error or f"no connection to {where.url}")
            raise UsageError(f"{where.url} knows nothing of alerts; does the processor run? (cnctwin process alerts)")
        age_s = published_state.age_s(desk.state, time.time())
        if age_s > FRESH_S_MAX:
            raise UsageError(f"the state of alerts is {age_s:.0f} s old: the processor `alerts` does not run any more")
        with published_state.of_its_shape(f"{ALERT_STATE} and its answers on {where.url}", "cnctwin process alerts"):
            yield desk
    finally:
        host.stop()
