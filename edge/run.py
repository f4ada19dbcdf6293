"""One edge from its configuration file: the broker, the node and the loop put together."""

import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from edge import accelerometer, clock
from edge.adapter import adapters
from edge.config import BrokerSection, EdgeConfig
from edge.errors import ConfigError
from edge.forwarder import Forwarder
from edge.health import HEALTH
from edge.ledger import Ledger
from edge.ring import Ring
from edge.runtime import EdgeRuntime, Publisher
from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.errors import SparkplugError
from sparkplug.metric import NodeId

BARRIER = "cnctwin/barrier"
"""Below it each edge node publishes its barriers, QoS 1; nobody has to read them."""


def broker_address(section: BrokerSection, path: Path) -> BrokerAddress:
    """The broker with the secret that the environment holds."""
    try:
        address = BrokerAddress.from_url(section.url)
    except SparkplugError as error:
        raise ConfigError(f"{path}: broker.url: {error}") from error
    if section.username:
        address = replace(address, username=section.username)
    if section.password_env:
        if section.password_env not in os.environ:
            raise ConfigError(
                f"{path}: broker.password_env = {section.password_env!r}: no such environment variable; set it to the password"
            )
        address = address.with_password(os.environ[section.password_env])
    return address


def edge_runtime(config: EdgeConfig[Any], address: BrokerAddress | None = None, *, restarts: int = 0) -> EdgeRuntime:
    """An edge that publishes to the configured broker, or to this one; `restarts`: how often it was begun again."""
    broker, ledger = config.broker, Ledger()

    def confirmed(token: int) -> None:
        runtime.confirmed(token)

    node = EdgeNode(
        address or broker_address(broker, config.path),
        NodeId(broker.group, config.node),
        [*HEALTH, *clock.HEALTH, *(accelerometer.HEALTH if config.accelerometer.url else ()), *ledger.metrics()],
        session_file=Path(broker.session_file) if broker.session_file else None,
        primary_host=broker.primary_host or None,
        barrier_topic=f"{BARRIER}/{broker.group}/{config.node}",
        on_confirmed=confirmed,
    )
    runtime = EdgeRuntime(
        config,
        adapters()[config.machine.adapter],
        node,
        ledger=ledger,
        place_file=Path(broker.session_file + ".place") if broker.session_file else None,
        open_store=_opener(config),
        restarts=restarts,
    )
    return runtime


def _opener(config: EdgeConfig[Any]) -> Callable[[Publisher], Forwarder] | None:
    """How the store of this edge is opened, by the thread that uses it; None where it has none."""
    limits, session_file = config.store, config.broker.session_file
    if not limits.enabled or not (limits.file or session_file):
        return None
    file = Path(limits.file or session_file + ".store")

    def opened(node: Publisher) -> Forwarder:
        ring = Ring(file, limits, wall_ms=lambda: time.time_ns() // 1_000_000, clock=time.monotonic)
        return Forwarder(ring, node, config.machine.name, limits, time.monotonic)

    return opened
