"""HiveMQ in the place of Mosquitto, so that the same tests run against it."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

import pytest

from tests.deploy.plant import need_programs
from tests.deploy.wire_client import WireClient
from tests.hivemq.hivemq import HiveMQ, built
from tests.sparkplug.conformance.life import STATE_TOPIC


@pytest.fixture(scope="session")
def hivemq(tmp_path_factory: pytest.TempPathFactory) -> Iterator[HiveMQ]:
    """HiveMQ, started once: a Java process takes seconds."""
    built()
    need_programs()
    with HiveMQ(tmp_path_factory.mktemp("hivemq")) as broker:
        yield broker


@contextmanager
def _empty(broker: HiveMQ) -> Iterator[HiveMQ]:
    """Without what an earlier test had it retain."""
    with WireClient(broker.open) as client:
        client.settle(client.publish(STATE_TOPIC, b"", retain=True))
    yield broker


@pytest.fixture
def mosquitto(hivemq: HiveMQ) -> Iterator[HiveMQ]:
    """What the tests that are taken over call the broker."""
    with _empty(hivemq) as broker:
        yield broker


@pytest.fixture(scope="module")
def new_broker(hivemq: HiveMQ) -> Callable[[], AbstractContextManager[HiveMQ]]:
    """As `mosquitto`, for lives that are recorded once for a module."""
    return lambda: _empty(hivemq)
