"""Records of parts reach a receiver that fails, hangs and comes back: each at least once, in order, and with the same id."""

import json
from pathlib import Path

import pytest

from cnctwin.memory.parts.delivery import Delivery, Receiver, signature
from cnctwin.memory.parts.journal import Journal
from cnctwin.memory.parts.record_log import parts
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.opening import open_store
from processors.alerts.courier.outcome import Outcome, Verdict
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from tests.processors.alerts.courier.receiving_server import Answer, ReceivingServer

T0_MS = 1_700_000_000_000
TWIN = NodeId("cnc", "twin-events")


@pytest.fixture
def store(tmp_path: Path):
    opened = open_store(tmp_path / "store", writable=True)
    opened.append([part(number) for number in range(3)])
    yield opened
    opened.close()


def part(number: int) -> Message:
    at_ms = T0_MS + number * 60_000
    text = json.dumps({"id": f"part-{number}", "machine": "vmc", "part_number": number, "program": "Ø1"}, ensure_ascii=False)
    return Message(
        at_ms,
        HostEvent(
            EventKind.DATA, TWIN, "vmc", at_ms, (Reading("twin/part_record", text, at_ms, Quality.GOOD, None, None, False),)
        ),
    )


def test_a_store_gives_each_part_once_and_in_order(store) -> None:
    store.append([part(1)])
    assert [one.id for one in parts(store, "vmc", T0_MS, T0_MS + 10**6)] == ["part-0", "part-1", "part-2"]


def test_a_receiver_that_fails_hangs_and_returns_is_given_each_part_in_order(store, tmp_path: Path) -> None:
    with ReceivingServer() as server:
        server.answers.extend([Answer(503), Answer(wait_s=6.0), Answer(drop=True), Answer(201), Answer(400)])
        receiver = Receiver(f"{server.url}/parts", "token", "shared", timeout_s=1.5)
        delivery = Delivery(store, receiver, Journal.read(tmp_path / "journal.json"))
        rounds = [delivery.round(["vmc"], T0_MS + 200_000 + 1000 * number) for number in range(4)]
        ids = [one.id for one in server.received]
    assert ids == ["part-0"] * 4 + ["part-1", "part-2"]
    assert [(one.delivered, one.refused) for one in rounds] == [(0, 0), (0, 0), (0, 0), (2, 1)]
    assert [one.waits_s for one in rounds] == [1.0, 2.0, 4.0, None]
    last = server.received[-1]
    assert last.headers["x-cnctwin-signature"] == signature("shared", last.body)
    assert (last.headers["authorization"], last.json["program"]) == ("Bearer token", "Ø1")


def test_a_restart_sends_nothing_anew_and_what_is_finished_later_follows(store, tmp_path: Path) -> None:
    seen: list[str] = []

    def send(_: Receiver, one) -> Outcome:
        seen.append(one.id)
        return Outcome(Verdict.DELIVERED)

    for number in (3, 4):
        Delivery(store, Receiver("http://127.0.0.1:1/"), Journal.read(tmp_path / "j.json"), send).round(["vmc"], T0_MS + 10**6)
        store.append([part(number)])
    Delivery(store, Receiver("http://127.0.0.1:1/"), Journal.read(tmp_path / "j.json"), send).round(["vmc"], T0_MS + 10**6)
    assert seen == [f"part-{number}" for number in range(5)]


def test_what_cannot_be_delivered_for_a_day_is_given_up_and_the_next_one_is_sent(store, tmp_path: Path) -> None:
    def send(_: Receiver, one) -> Outcome:
        return Outcome(Verdict.UNSURE if one.id == "part-0" else Verdict.DELIVERED, "hangs")

    delivery = Delivery(store, Receiver("http://127.0.0.1:1/"), Journal.read(tmp_path / "j.json"), send)
    first = delivery.round(["vmc"], T0_MS + 10**6)
    later = delivery.round(["vmc"], T0_MS + 10**6 + 86_400_000)
    assert (first.waits_s, first.reason) == (1.0, "hangs")
    assert (later.delivered, later.given_up) == (2, 1)
    assert json.loads((tmp_path / "j.json").read_text())["ids"]["part-0"] == "given up"
