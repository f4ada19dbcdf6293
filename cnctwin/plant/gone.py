"""Processors that are gone: they ran on this broker, and are heard of no more.

A processor leaves two retained messages: the STATE of its process's host application, which has the name of one of the process's
processors, and, where it is `alerts`, the state of all alerts. One that was ended and one that died leave the same STATE, offline
with a time, and the plant is as badly off without either; so both are reported. A processor that never ran is no fault.
"""

import time
from dataclasses import dataclass, field
from typing import Any

from cnctwin.plant.alert_desk import ALERTS, FRESH_S_MAX, silent_since
from cnctwin.plant.view import Pictures
from cnctwin.processes import published_state
from processors.discovery import modules
from sparkplug.actions import HostState
from sparkplug.errors import PayloadError
from sparkplug.topics import STATE_PREFIX
from twin.vocabulary.nodes import twin_node
from twin.vocabulary.topics import ALERT_STATE

FILTERS = (f"{STATE_PREFIX}+", ALERT_STATE)


@dataclass(slots=True)
class LastWords:
    """The retained messages that processors leave behind."""

    _states: dict[str, HostState] = field(default_factory=dict)
    _alerts: dict[str, Any] = field(default_factory=dict)

    def take_state(self, host_id: str, payload: bytes) -> None:
        """Note the STATE of a host application, if it is one of a processor's name."""
        try:
            if host_id in map(twin_node, modules()):
                self._states[host_id] = HostState.decode(payload)
        except PayloadError:
            self._states.pop(host_id, None)

    def take(self, topic: str, payload: bytes) -> None:
        """Note the state of alerts; what comes on another topic is left alone."""
        if topic == ALERT_STATE:
            self._alerts = published_state.parsed(payload)

    def gone(self, pictures: Pictures) -> list[str]:
        """Return a sentence for each processor that has left something and of which no node is heard."""
        heard = {node.node for node in pictures.nodes()}
        return [self._sentence(name) for name in modules() if twin_node(name) not in heard and self._has_left(name)]

    def _has_left(self, name: str) -> bool:
        state = self._states.get(twin_node(name))
        if state is not None and not state.online:
            return True
        return name == ALERTS and bool(self._alerts) and published_state.age_s(self._alerts, time.time()) > FRESH_S_MAX

    def _sentence(self, name: str) -> str:
        left = [f"{STATE_PREFIX}{twin_node(name)}"] * (twin_node(name) in self._states)
        since = ""
        if name == ALERTS and self._alerts:
            left.append(ALERT_STATE)
            since = silent_since(self._alerts)
        return (
            f"nothing heard from the processor {name}{since}; is `cnctwin process {name}` running? Those that ran in its process "
            f"are gone too. If it is no longer wanted, clear what it left on the broker: {', '.join(left)}"
        )
