"""One edge from its configuration file: the broker, the node and the loop put together."""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from edge.accelerometer import sensor as accelerometer
from edge.adapter import Adapter, find
from edge.clock import offset as clock
from edge.config import BrokerSection, EdgeConfig
from edge.errors import ConfigError
from edge.running.driver import Driver
from edge.running.forwarder import Forwarder
from edge.running.health import HEALTH
from edge.running.ledger import Ledger
from edge.running.ring import Ring
from edge.running.runtime import EdgeRuntime, Publisher
from sparkplug.actions import HostState
from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.edge_session import Command
from sparkplug.errors import SparkplugError
from sparkplug.metric import NodeId
from twin.vocabulary.nodes import HISTORIAN_NODE
from twin.vocabulary.topics import edge_barrier


def broker_addresses(section: BrokerSection, path: Path) -> tuple[BrokerAddress, ...]:
    """The brokers in their order, with the secret that the environment holds."""
    urls = section.urls or (section.url,)
    addresses = tuple(_address(url, "urls" if section.urls else "url", section, path) for url in urls)
    if len({address.mqtt_version for address in addresses}) > 1:
        raise ConfigError(f"{path}: broker.urls: one edge speaks one version of MQTT; give all addresses version=5, or none")
    return addresses


def _address(url: str, key: str, section: BrokerSection, path: Path) -> BrokerAddress:
    try:
        address = BrokerAddress.from_url(url)
    except SparkplugError as error:
        raise ConfigError(f"{path}: broker.{key}: {error}") from error
    if section.username:
        address = replace(address, username=section.username)
    if section.password_env and section.password_file:
        raise ConfigError(f"{path}: broker has password_env and password_file; name one of them")
    if section.password_file:
        return address.with_password(_secret_in(Path(section.password_file), path))
    if section.password_env:
        if section.password_env not in os.environ:
            raise ConfigError(
                f"{path}: broker.password_env = {section.password_env!r}: no such environment variable; set it to the password"
            )
        address = address.with_password(os.environ[section.password_env])
    return address


def _secret_in(file: Path, path: Path) -> str:
    """The first line of a file that only its owner can read."""
    try:
        mode, lines = file.stat().st_mode, file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: broker.password_file = {str(file)!r}: cannot be read: {error}") from error
    if mode & 0o077:
        raise ConfigError(f"{path}: broker.password_file = {str(file)!r}: others can read it; chmod 600 it")
    if not lines or not lines[0]:
        raise ConfigError(f"{path}: broker.password_file = {str(file)!r}: is empty; put the password into its first line")
    return lines[0]


def edge_runtime(
    config: EdgeConfig[Any],
    brokers: Sequence[BrokerAddress] = (),
    *,
    adapter: Adapter | None = None,
    restarts: int = 0,
    driver: Driver | None = None,
) -> EdgeRuntime:
    """An edge that publishes to the configured brokers, or to these.

    adapter: in place of the configured one, for a control that is no real one; restarts: how often the edge was begun again;
    driver: the one that edges share
    """
    broker, ledger = config.broker, Ledger()

    def confirmed(token: int) -> None:
        runtime.confirmed(token)

    def commanded(command: Command) -> None:
        runtime.commanded(command)

    def host_state(host: str, state: HostState | None) -> None:
        runtime.host_state(host, state)

    node = EdgeNode(
        brokers or broker_addresses(broker, config.path),
        NodeId(broker.group, config.node),
        [*HEALTH, *clock.HEALTH, *(accelerometer.HEALTH if config.accelerometer.url else ()), *ledger.metrics()],
        session_file=Path(broker.session_file) if broker.session_file else None,
        primary_host=broker.primary_host or None,
        barrier_topic=edge_barrier(broker.group, config.node),
        on_confirmed=confirmed,
        on_command=commanded,
        watched_hosts=[HISTORIAN_NODE] if config.store.await_receipt == "auto" else [],
        on_host_state=host_state,
        loop=None if driver is None else driver.loop,
    )
    runtime = EdgeRuntime(
        config,
        adapter or find(config.machine.adapter),
        node,
        ledger=ledger,
        place_file=Path(broker.session_file + ".place") if broker.session_file else None,
        open_store=_opener(config),
        restarts=restarts,
        driver=driver,
    )
    return runtime


def _opener(config: EdgeConfig[Any]) -> Callable[[Publisher], Forwarder] | None:
    """Return what opens the store of this edge, in the thread that uses it; None where it has none."""
    limits, session_file = config.store, config.broker.session_file
    if limits.await_receipt == "auto" and config.broker.primary_host == HISTORIAN_NODE:
        # It is named as part of the plant; on a broker where its STATE is removed it is only to be found elsewhere.
        limits = limits.model_copy(update={"await_receipt": True})
    if not limits.enabled or not (limits.file or session_file):
        return None
    file = Path(limits.file or session_file + ".store")

    def opened(node: Publisher) -> Forwarder:
        ring = Ring(file, limits, wall_ms=lambda: time.time_ns() // 1_000_000, clock=time.monotonic)
        return Forwarder(ring, node, config.machine.name, limits, time.monotonic)

    return opened
