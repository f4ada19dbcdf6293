"""A real broker, and an office at it."""

from collections.abc import Iterator

import pytest

from sparkplug.broker import BrokerAddress
from tests.processors.alerts.courier.office import Office
from tests.wire.mosquitto import Mosquitto


@pytest.fixture
def broker(mosquitto: Mosquitto) -> BrokerAddress:
    return BrokerAddress(*mosquitto.address)


@pytest.fixture
def office(broker: BrokerAddress) -> Iterator[Office]:
    office = Office(broker)
    yield office
    office.close()
