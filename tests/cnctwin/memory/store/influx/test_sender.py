"""The ring and the sender, with a server that is away, refuses, or is started again."""

import threading
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.influx.sender import Patience, Sender
from cnctwin.memory.store.influx.server import RefusedError, ServerAwayError, TooLargeError
from cnctwin.memory.store.influx.spool import Batch, RingLimits, Spool
from tests.cnctwin.memory.store.influx.stand_in import MemoryServer, refuses

QUICK = Patience(delay_s_min=0.001, delay_s_max=0.01, samples_at_once=100)
ROOM = RingLimits(free_bytes_min=0)


def batch(first: int, samples: int = 10, bucket: str = "cnc_raw") -> Batch:
    return Batch(
        bucket, samples, first, "".join(f"cnc_raw,signal=s value={n} {n}\n" for n in range(first, first + samples)).encode()
    )


def until(condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, "did not happen"
        time.sleep(0.002)


def balanced(spool: Spool) -> dict[str, int]:
    """The account, after a look whether it adds up."""
    account = spool.account()
    gone = sum(n for name, n in account.items() if name.startswith("evicted"))
    assert account["taken"] == account.get("sent", 0) + account.get("refused by the server", 0) + gone + account["held"]
    return account


@pytest.fixture
def spool(tmp_path: Path) -> Iterator[Spool]:
    spool = Spool(tmp_path, ROOM, wall_ms=count(1_000_000).__next__)
    yield spool
    spool.close()


@pytest.fixture
def sending(spool: Spool) -> Iterator[Callable[..., Sender]]:
    begun: list[Sender] = []

    def begin(server: MemoryServer, patience: Patience = QUICK) -> Sender:
        sender = Sender(spool, server, clock=time.monotonic, chance=Random(1), patience=patience)
        sender.start()
        begun.append(sender)
        return sender

    yield begin
    for sender in begun:
        sender.stop()


def test_all_batches_arrive_in_their_buckets(spool: Spool, sending: Callable[..., Sender]) -> None:
    server = MemoryServer()
    spool.put([batch(0), batch(10, bucket="cnc_twin_state"), batch(20)])
    assert sending(server).drain(60.0)
    assert server.distinct() == 30 and {bucket for bucket, _ in server.kept} == {"cnc_raw", "cnc_twin_state"}
    assert balanced(spool) == {"taken": 30, "sent": 30, "held": 0, "refused by the server": 0}
    assert spool.ask("SELECT count(*) FROM rows") == [(0,)]


def test_what_could_not_be_sent_is_sent_after_a_restart(tmp_path: Path) -> None:
    away = MemoryServer(lambda lines: ServerAwayError("503"))
    for number in range(3):
        spool = Spool(tmp_path, ROOM, wall_ms=lambda: 1_000_000)
        spool.put([batch(number * 10)])
        sender = Sender(spool, away, clock=time.monotonic, chance=Random(1), patience=QUICK)
        sender.start()
        until(lambda number=number: len(away.writes) > 2 * (number + 1))
        assert sender.trouble == "503" and sender.waiting == 10 * (number + 1)
        sender.stop()
        spool.close()
    spool, server = Spool(tmp_path, ROOM, wall_ms=lambda: 1_000_000), MemoryServer()
    sender = Sender(spool, server, clock=time.monotonic, chance=Random(1), patience=QUICK)
    sender.start()
    assert sender.drain(60.0) and server.distinct() == 30 and sender.trouble == ""
    sender.stop()
    spool.close()


def test_a_request_never_holds_much_more_than_it_may(spool: Spool, sending: Callable[..., Sender]) -> None:
    server = MemoryServer()
    spool.put([batch(n * 10) for n in range(200)])
    assert sending(server).drain(60.0)
    assert max(server.writes) <= QUICK.samples_at_once and server.distinct() == 2000


def test_the_delay_grows_to_its_limit_and_honours_what_the_server_asks(spool: Spool) -> None:
    sender = Sender(spool, MemoryServer(), clock=time.monotonic, chance=Random(1))
    delays_s = [sender._later(ServerAwayError("away")) for _ in range(40)]
    assert all(min(0.5 * 2**n, 60.0) / 2 <= delay_s <= min(0.5 * 2**n, 60.0) for n, delay_s in enumerate(delays_s))
    assert len(set(delays_s)) == 40, "chance spreads those who wait for the same server"
    assert sender._later(ServerAwayError("busy", retry_after_s=120.0)) == 120.0


@given(bad=st.sets(st.integers(0, 59), max_size=12))
@settings(max_examples=25)
def test_lines_at_fault_are_left_out_and_all_others_go_through(bad: set[int], tmp_path_factory: pytest.TempPathFactory) -> None:
    def judge(lines: list[str]) -> RefusedError | None:
        at_fault = [line for line in lines if int(line.rsplit(" ", 1)[1]) in bad]
        return RefusedError(f"400: unable to parse {at_fault[0]!r}") if at_fault else None

    spool = Spool(tmp_path_factory.mktemp("ring"), ROOM, wall_ms=lambda: 1_000_000)
    spool.put([batch(0, 30), batch(30, 30)])
    server = MemoryServer(judge)
    sender = Sender(spool, server, clock=time.monotonic, chance=Random(1), patience=QUICK)
    sender.start()
    assert sender.drain(60.0)
    sender.stop()
    assert server.distinct() == 60 - len(bad)
    assert balanced(spool).get("refused by the server", 0) == len(bad)
    assert ("unable to parse" in sender.refused) == bool(bad)
    spool.close()


def test_a_refusal_that_hits_every_line_and_names_no_fault_loses_nothing(spool: Spool, sending: Callable[..., Sender]) -> None:
    server = MemoryServer(lambda lines: RefusedError("400: The plain HTTP request was sent to HTTPS port", is_sure=False))
    spool.put([batch(0, 8)])
    sender = sending(server)
    until(lambda: "HTTPS port" in sender.trouble)
    assert balanced(spool)["held"] == 8
    server.trouble = lambda lines: None
    assert sender.drain(60.0) and server.distinct() == 8


def test_a_batch_that_is_too_large_is_halved(spool: Spool, sending: Callable[..., Sender]) -> None:
    server = MemoryServer(lambda lines: TooLargeError("413") if len(lines) > 4 else None)
    spool.put([batch(0, 50)])
    assert sending(server).drain(60.0) and server.distinct() == 50
    assert balanced(spool)["sent"] == 50


def test_what_the_server_itself_left_out_is_counted(spool: Spool, sending: Callable[..., Sender]) -> None:
    server = MemoryServer(lambda lines: RefusedError("partial write: points beyond retention policy dropped=3", dropped=3))
    spool.put([batch(0, 10)])
    assert sending(server).drain(60.0)
    assert len(server.writes) == 1 and balanced(spool)["refused by the server"] == 3


def test_a_batch_on_which_the_server_breaks_does_not_hold_up_the_next(spool: Spool, sending: Callable[..., Sender]) -> None:
    def judge(lines: list[str]) -> ServerAwayError | None:
        return ServerAwayError("500: panic", is_fault=True) if any(line.endswith(" 7") for line in lines) else None

    server = MemoryServer(judge)
    spool.put([batch(0)])
    sender = sending(server)
    until(lambda: len(server.writes) > 20)
    assert balanced(spool)["held"] == 10, "as long as nothing else passes, the server is at fault"
    spool.put([batch(100, 100)])
    sender.wake()
    assert sender.drain(60.0)
    assert server.distinct() == 109 and balanced(spool)["refused by the server"] == 1 and "500: panic" in sender.refused


def test_what_a_server_had_not_settled_is_sent_again_when_it_was_started_anew(
    spool: Spool, sending: Callable[..., Sender]
) -> None:
    server = MemoryServer(settle_s=0.3)
    spool.put([batch(0)])
    sender = sending(server)
    assert sender.drain(60.0) and spool.held == 10, "acknowledged, and kept until it is settled"
    server.kept.clear()
    server.started = 2
    until(lambda: server.distinct() == 10)
    until(lambda: spool.held == 0)
    assert balanced(spool)["sent"] == 10 and set(server.kept.values()) == {1}


@pytest.mark.parametrize(
    ("limits", "name"),
    [
        (RingLimits(bytes_max=3_000, free_bytes_min=0), "evicted: bytes"),
        (RingLimits(age_s_max=5.0, free_bytes_min=0), "evicted: age"),
        (RingLimits(free_bytes_min=1_000), "evicted: disk"),
    ],
)
def test_the_oldest_goes_first_and_is_counted_by_its_reason(tmp_path: Path, limits: RingLimits, name: str) -> None:
    now_ms = count(0, 1000)
    spool = Spool(tmp_path, limits, wall_ms=now_ms.__next__, free_bytes=lambda _: 500)
    for number in range(60):
        spool.put([batch(number * 10)])
    spool.sweep()
    account = balanced(spool)
    assert account[name] > 0
    first = spool.after(0, 10)
    assert not first or first[0].sequence == account[name] // 10 + 1, "what is left are the newest"
    spool.close()


def test_two_writers_cannot_share_a_ring(tmp_path: Path, spool: Spool) -> None:
    with pytest.raises(StoreError, match="another process writes to this ring"):
        Spool(tmp_path, ROOM, wall_ms=lambda: 0)


def test_a_disk_that_is_full_loses_nothing_of_what_was_acknowledged(tmp_path: Path) -> None:
    spool = Spool(tmp_path, ROOM, wall_ms=lambda: 0)
    pages = spool.ask("PRAGMA page_count")[0][0]
    spool.write(f"PRAGMA max_page_count = {pages + 4}")
    acknowledged = 0
    with pytest.raises(StoreError, match="cannot be written"):
        spool.put([Batch("cnc_raw", 1, 0, Random(1).randbytes(200_000))])
    for number in range(40):
        spool.put([Batch("cnc_raw", 1, 0, Random(number).randbytes(2_000))])
        acknowledged += 1
    account = balanced(spool)
    assert account["taken"] == acknowledged and account["evicted: disk"] > 0
    spool.close()


def test_appending_goes_on_while_the_server_hangs(spool: Spool, sending: Callable[..., Sender]) -> None:
    hangs = threading.Event()

    def judge(lines: list[str]) -> None:
        hangs.wait(60.0)

    server = MemoryServer(judge)
    sender = sending(server)
    spool.put([batch(0)])
    sender.wake()
    until(lambda: bool(server.writes))
    begun_s = time.monotonic()
    for number in range(1, 50):
        spool.put([batch(number * 10)])
    assert time.monotonic() - begun_s < 30.0 and sender.waiting == 500
    hangs.set()
    assert sender.drain(60.0) and server.distinct() == 500


def test_a_defect_does_not_end_the_sending(spool: Spool, sending: Callable[..., Sender]) -> None:
    defects = iter([ValueError("a defect of ours")])

    def judge(lines: list[str]) -> None:
        for defect in defects:
            raise defect

    server = MemoryServer(judge)
    spool.put([batch(0)])
    assert sending(server).drain(60.0) and server.distinct() == 10


def test_refused_lines_are_said_once(spool: Spool, sending: Callable[..., Sender], caplog: pytest.LogCaptureFixture) -> None:
    server = MemoryServer(refuses("value=3 "))
    spool.put([batch(0)])
    sender = sending(server)
    assert sender.drain(60.0)
    spool.put([batch(0)])
    sender.wake()
    assert sender.drain(60.0)
    assert len([record for record in caplog.records if "value=3" in record.getMessage()]) == 1
