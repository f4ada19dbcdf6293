"""The births that a bridge keeps: what a picture of the plant is made of again."""

from cnctwin.kafka.bridge.births import Births
from sparkplug.topics import Topic

NBIRTH, DBIRTH = "spBv1.0/cnc/NBIRTH/edge", "spBv1.0/cnc/DBIRTH/edge/okuma"


class Log:
    """A compacted topic with room, or without."""

    def __init__(self) -> None:
        self.kept: dict[str, bytes] = {}
        self.has_room = True

    def keep(self, topic: str, payload: bytes | None) -> bool:
        if self.has_room and payload is None:
            self.kept.pop(topic, None)
        elif self.has_room and payload is not None:
            self.kept[topic] = payload
        return self.has_room


def told(births: Births, *messages: str) -> None:
    for topic in messages:
        births.take(Topic.parse(topic), topic.encode())


def test_a_birth_is_kept_until_its_death() -> None:
    log = Log()
    births = Births(log.keep)
    told(births, NBIRTH, DBIRTH)
    assert list(log.kept) == [NBIRTH, DBIRTH]
    told(births, "spBv1.0/cnc/DDEATH/edge/okuma")
    assert list(log.kept) == [NBIRTH]
    told(births, DBIRTH, "spBv1.0/cnc/NDEATH/edge")
    assert log.kept == {}


def test_a_new_nbirth_takes_back_the_devices_that_were_born_before_it() -> None:
    log = Log()
    births = Births(log.keep)
    told(births, NBIRTH, DBIRTH, "spBv1.0/cnc/DBIRTH/edge/mazak", NBIRTH, DBIRTH)
    assert list(log.kept) == [NBIRTH, DBIRTH]


def test_nbirths_are_given_back_first_and_devices_without_one_not_at_all() -> None:
    births = Births(Log().keep)
    orphan = "spBv1.0/cnc/DBIRTH/other/mazak"
    assert [topic for topic, _ in births.restored({DBIRTH: b"d", orphan: b"o", NBIRTH: b"n"})] == [NBIRTH, DBIRTH]


def test_a_bridge_that_restored_births_takes_back_their_devices_too() -> None:
    log = Log()
    log.kept = {NBIRTH: b"n", DBIRTH: b"d"}
    births = Births(log.keep)
    births.restored(log.kept)
    told(births, NBIRTH)
    assert list(log.kept) == [NBIRTH]


def test_what_finds_no_room_is_written_later_in_its_order() -> None:
    log = Log()
    births = Births(log.keep)
    log.has_room = False
    told(births, NBIRTH, DBIRTH, "spBv1.0/cnc/DDEATH/edge/okuma")
    assert log.kept == {}
    births.catch_up()
    log.has_room = True
    told(births, "spBv1.0/cnc/DBIRTH/edge/mazak")
    births.catch_up()
    assert sorted(log.kept) == ["spBv1.0/cnc/DBIRTH/edge/mazak", NBIRTH]
