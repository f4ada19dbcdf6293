"""A store on a log: killed anywhere, it has each message once."""

from pathlib import Path
from random import Random

import pytest

from cnctwin.errors import UsageError
from cnctwin.kafka.store_sink import StoreSink, sink_of
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.embedded import EmbeddedStore
from processors.actions import Pin
from processors.historian import HistorianConfig
from tests.processors.partition.test_partition import shift

PLACE = ("cnctwin.cnc.readings", 3)


def sink(folder: Path) -> StoreSink:
    return StoreSink(EmbeddedStore(folder, writable=True))


def messages(folder: Path) -> list[Message]:
    store = EmbeddedStore(folder)
    try:
        return list(store.messages("okuma", 0, 1 << 62))
    finally:
        store.close()


def filled(folder: Path, chance: Random | None) -> list[Message]:
    """Write a log into a store; with `chance` kill it now and then."""
    log, one = shift(), sink(folder)
    offset = one.begin(PLACE, 0)
    while offset < len(log):
        one.keep(PLACE, offset, log[offset])
        offset += 1
        fate = 1.0 if chance is None else chance.random()
        if fate < 0.2:
            one.write()
        elif fate < 0.3:
            one.close()  # what was not written is lost
            one = sink(folder)
            offset = one.begin(PLACE, len(log))
    one.write()
    one.close()
    return messages(folder)


@pytest.mark.parametrize("kills", range(4))
def test_killed_anywhere_it_has_each_message_once(tmp_path: Path, kills: int) -> None:
    whole = filled(tmp_path / "whole", None)
    assert whole
    assert filled(tmp_path / "killed", Random(kills)) == whole


def test_a_new_store_begins_with_what_the_log_holds_and_an_old_one_where_it_stopped(tmp_path: Path) -> None:
    one = sink(tmp_path)
    assert one.begin(PLACE, 50) == 0
    for offset, record in enumerate(shift()[:20]):
        one.keep(PLACE, offset, record)
    one.write()
    assert one.begin(PLACE, 50) == 20
    assert one.begin(("cnctwin.cnc.readings", 4), 7) == 0
    one.close()
    again = sink(tmp_path)
    assert again.begin(PLACE, 50) == 20
    assert again.begin(PLACE, 10) == 10  # its folds go on earlier
    again.close()


def test_a_pin_that_comes_again_after_a_kill_is_one(tmp_path: Path) -> None:
    one = sink(tmp_path)
    for _ in range(2):
        one.pin(Pin("okuma", 1000, 2000, "rule"))
        one.write()
    one.close()
    store = EmbeddedStore(tmp_path)
    assert [(pin.machine, pin.from_ms, pin.to_ms) for pin in store.pins()] == [("okuma", 1000, 2000)]
    store.close()


class Closed:
    """A store of another kind."""

    def __init__(self) -> None:
        self.is_closed = False

    def close(self) -> None:
        self.is_closed = True


def test_a_store_that_keeps_no_offsets_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    store = Closed()
    monkeypatch.setattr("cnctwin.kafka.store_sink.store_of", lambda _: store)
    with pytest.raises(UsageError, match="cannot keep the offsets"):
        sink_of(HistorianConfig(store="influx+http://influx:8086"))
    assert store.is_closed
