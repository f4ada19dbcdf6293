"""The alerts desk: the alerts processor's state as it publishes it on the broker, and commands to it.

The topics are those of `processors/alerts` (docs/how-to/alerts.md).
"""

import json
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any
from uuid import uuid4

from cnctwin.errors import UsageError
from cnctwin.processes import published_state
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.host_session import EventKind
from sparkplug.topics import NAMESPACE
from twin.vocabulary.nodes import twin_node
from twin.vocabulary.topics import ALERT_COMMAND, ALERT_STATE

ALERTS = "alerts"
FRESH_S_MAX = 150.0  # the state comes once a minute
LIFE_S_MAX = 3.0  # to wait for a sign of life, which comes once a second
ALERTS_NODE = twin_node(ALERTS)
_LIFE = (
    f"{NAMESPACE}/cnc/NDATA/{ALERTS_NODE}",
    f"{NAMESPACE}/+/NDATA/{ALERTS_NODE}",
)  # a reader's rights may end at the first one's group


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


def silent(state: Mapping[str, Any]) -> str:
    """Return the sentence on alerts whose processor does not keep their state up.

    >>> silent({"at": "2026-11-29T08:29:33.000Z"})
    'nothing heard from the processor alerts since 2026-11-29 08:29:33 UTC; is `cnctwin process alerts` running?'
    """
    return f"nothing heard from the processor {ALERTS}{silent_since(state)}; is `cnctwin process {ALERTS}` running?"


def silent_since(state: Mapping[str, Any]) -> str:
    """Return since when nothing was heard, from a state's time; "" where it has none.

    >>> silent_since({"at": "2026-11-29T09:29:33+01:00"}), silent_since({"at": "soon"}), silent_since({})
    (' since 2026-11-29 08:29:33 UTC', '', '')
    """
    try:
        at = datetime.fromisoformat(str(state["at"])).astimezone(UTC)
    except (KeyError, ValueError, OverflowError):
        return ""
    return f" since {at:%Y-%m-%d %H:%M:%S} UTC"


def _line(told: Any) -> str:
    """Return a text that came over the broker, without what would steer a terminal."""
    return "".join(letter if letter.isprintable() else " " for letter in str(told))


@contextmanager
def alert_desk(given: BrokerAddress | None, wait_s: float) -> Iterator[Desk]:
    """Connect, and wait for the state and for a sign that its processor lives: what is retained outlives it. Raises UsageError
    where one is missing."""
    where = given or BrokerAddress()
    name = f"alerts-{os.getpid()}-{uuid4().hex[:8]}"
    # Once the processor has been heard it is not listened to any more, so that it is asked for no births.
    host = HostApplication(
        where, name, _LIFE, publish_state=False, wanted=lambda node: node.node == ALERTS_NODE and not host.nodes()
    )
    host.subscribe_plain(ALERT_STATE)
    host.start()
    try:
        desk = Desk(host, where.url)
        if desk.until(lambda: desk.state, wait_s) is None:
            if not host.online:
                raise UsageError(host.last_error or f"no connection to {where.url}")
            raise UsageError(f"{where.url} knows nothing of alerts; does the processor run? (cnctwin process alerts)")
        desk.until(host.nodes, max(wait_s, LIFE_S_MAX))
        if not host.nodes() or published_state.age_s(desk.state, time.time()) > FRESH_S_MAX:
            raise UsageError(silent(desk.state))
        with published_state.of_its_shape(f"{ALERT_STATE} and its answers on {where.url}", "cnctwin process alerts"):
            yield desk
    finally:
        host.stop()
