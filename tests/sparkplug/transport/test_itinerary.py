"""The next broker, and the pause before it."""

from random import Random

import pytest

from sparkplug.broker import BrokerAddress
from sparkplug.transport.itinerary import ABSENT_S_MAX, PAUSE_S_MAX, PAUSE_S_MIN, STABLE_S, Itinerary

BROKERS = tuple(BrokerAddress(port=port) for port in (1883, 1884, 1885))


def _itinerary(brokers: int = 3) -> Itinerary:
    return Itinerary(BROKERS[:brokers], Random(1))


def _pauses_s(itinerary: Itinerary, number: int, *, somebody_listens: bool) -> list[float]:
    return [itinerary.ended(float(at), somebody_listens=somebody_listens) for at in range(number)]


@pytest.mark.parametrize(("somebody_listens", "longest_s"), [(True, PAUSE_S_MAX), (False, ABSENT_S_MAX)])
def test_the_pause_doubles_up_to_a_bound(somebody_listens: bool, longest_s: float) -> None:
    pauses_s = _pauses_s(_itinerary(), 12, somebody_listens=somebody_listens)
    for place, pause_s in enumerate(pauses_s):
        middle_s = min(PAUSE_S_MIN * 2 ** (place + 1), longest_s)
        assert 0.8 * middle_s <= pause_s <= 1.2 * middle_s


def test_attempts_that_fail_go_round_all_brokers() -> None:
    itinerary = _itinerary()
    visited = [itinerary.broker]
    for _ in range(5):
        itinerary.ended(0.0, somebody_listens=False)
        visited.append(itinerary.broker)
    assert visited == [*BROKERS, *BROKERS]


def test_a_connection_that_lasted_is_made_again_at_the_same_broker_and_soon() -> None:
    itinerary = _itinerary()
    _pauses_s(itinerary, 4, somebody_listens=True)
    itinerary.accepted(10.0)
    assert itinerary.ended(10.1 + STABLE_S, somebody_listens=True) <= 1.2 * PAUSE_S_MIN
    assert itinerary.server == 1


def test_a_connection_that_did_not_last_gives_the_next_broker_its_turn() -> None:
    itinerary = _itinerary()
    itinerary.accepted(10.0)
    assert itinerary.ended(9.9 + STABLE_S, somebody_listens=True) >= 0.8 * 2 * PAUSE_S_MIN
    assert itinerary.server == 1


def test_an_attempt_that_took_long_has_not_lasted() -> None:
    itinerary = _itinerary()
    for at_s in (100.0, 200.0):
        itinerary.ended(at_s, somebody_listens=False)
    assert itinerary.server == 2


def test_a_walk_goes_to_the_next_broker_with_the_shortest_pause_however_often() -> None:
    itinerary = _itinerary()
    for number in range(1, 20):
        itinerary.accepted(float(number))
        itinerary.walk()
        assert itinerary.ended(number + 0.1, somebody_listens=True) <= 1.2 * PAUSE_S_MIN
        assert itinerary.server == number % 3


def test_one_broker_is_always_the_next_one() -> None:
    itinerary = _itinerary(brokers=1)
    itinerary.walk()
    _pauses_s(itinerary, 3, somebody_listens=True)
    assert itinerary.broker == BROKERS[0]
