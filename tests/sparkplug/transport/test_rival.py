"""Two connections with one client id on a real broker: each is told that another one runs, in words."""

import time
from collections.abc import Callable

import pytest
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.transport import rival
from sparkplug.transport.rival import Rival
from tests.wire.mosquitto import Mosquitto


class Reason:
    """As paho gives it."""

    def __init__(self, value: int, text: str = "Unspecified error") -> None:
        self.value, self._text = value, text

    def __str__(self) -> str:
        return self._text


def until(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    deadline_s = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.02)


@pytest.mark.parametrize("version", [4, 5])
def test_two_of_a_name_are_told_of_each_other(version: int, mosquitto: Mosquitto) -> None:
    """Mosquitto 2.0.11 closes the connection without a word with MQTT 5 too."""
    address = BrokerAddress(*mosquitto.address)
    hosts = [HostApplication(address, "h", (), publish_state=False, mqtt_version=version) for _ in range(2)]
    for host in hosts:
        host.start()
    try:
        until(lambda: any("another one" in host.last_error and "host-h; end one of the two" in host.last_error for host in hosts))
    finally:
        for host in hosts:
            host.stop()


def test_a_broker_that_says_it_is_believed_at_once() -> None:
    watched = Rival("edge")
    watched.began(0.0)
    reason = ReasonCode(PacketTypes.DISCONNECT, identifier=rival.SESSION_TAKEN_OVER)
    assert str(reason) == "Session taken over"
    assert watched.ended(100.0, reason) == "another one runs, which has taken over the session of edge; end one of the two"


def test_a_session_that_lasted_is_no_sign_of_another_one() -> None:
    watched = Rival("edge")
    for turn in range(10):
        watched.began(100.0 * turn)
        assert watched.ended(100.0 * turn + rival.STABLE_S, Reason(128)) == "Unspecified error"
    for turn in range(rival.CUT_SHORT_MAX):
        watched.began(2000.0 + turn)
        told = watched.ended(2000.5 + turn, Reason(128))
        assert ("another one seems to run as edge" in told) == (turn + 1 >= rival.CUT_SHORT_MAX)
