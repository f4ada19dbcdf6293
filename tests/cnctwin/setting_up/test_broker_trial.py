"""A broker that does not answer is named once in the line that says so."""

import pytest

from cnctwin.errors import UsageError
from cnctwin.setting_up.broker_trial import try_broker
from sparkplug.broker import BrokerAddress
from tests.wire.mosquitto import free_port


def test_a_broker_that_does_not_answer_is_named_once() -> None:
    broker = BrokerAddress(port=free_port())
    with pytest.raises(UsageError) as error:
        try_broker(broker)
    assert str(error.value).startswith(f"no connection to {broker.url}: ")
    assert str(error.value).count(broker.url) == 1
