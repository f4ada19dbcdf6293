"""Live rows from a real Mosquitto: in a loop, from asyncio, over TLS, too slow a reader, an end at any time."""

import asyncio
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import cnctwin
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.sparkplug.test_tls import secured  # noqa: F401  a fixture
from tests.wire.mosquitto import Mosquitto, free_port

pytestmark = pytest.mark.broker
PATIENCE_S = 30.0


class Machine:
    """An edge whose machine counts up."""

    def __init__(self, broker: BrokerAddress) -> None:
        self.edge = EdgeNode(broker, NodeId("cnc", "edge-vmc"))
        self.edge.declare_device("vmc", [MetricSpec("part_count", DataType.INT64, unit="1")])
        self.count = 0
        self.edge.start()
        deadline_s = time.monotonic() + PATIENCE_S
        while not self.edge.online and time.monotonic() < deadline_s:
            time.sleep(0.01)

    def tell(self, times: int) -> None:
        for _ in range(times):
            self.count += 1
            assert self.edge.publish("vmc", [Change("part_count", self.count, 1_790_000_000_000 + self.count)])


@pytest.fixture
def url(mosquitto: Mosquitto) -> str:
    return f"mqtt://127.0.0.1:{mosquitto.port}"


@pytest.fixture
def machine(url: str) -> Iterator[Machine]:
    told = Machine(BrokerAddress.from_url(url))
    yield told
    told.edge.stop()


def first_row(watch: cnctwin.Watch, machine: Machine) -> cnctwin.Row:
    """The first row; a viewer that comes later than a birth asks for it when it hears of the machine."""
    deadline_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline_s:
        machine.tell(1)
        if (row := watch.read(0.2)) is not None:
            return row
    raise AssertionError(watch.trouble)


def test_a_loop_sees_every_change_in_order(url: str, machine: Machine) -> None:
    with cnctwin.watch(url, "vmc", patience_s=PATIENCE_S) as watch:
        first_row(watch, machine)
        machine.tell(50)
        seen = []
        for row in watch:
            signal = row["part_count"]
            assert (signal.unit, signal.quality, row.machine) == ("1", "good", "vmc")
            seen.append(signal.value)
            if signal.value == machine.count:
                break
        assert seen[-50:] == list(range(machine.count - 49, machine.count + 1))
        counts = watch.counts
        assert counts["received"] == counts["emitted"] and counts["dropped"] == counts["buffered"] == counts["lost"] == 0


def test_while_the_broker_is_away_the_row_is_stale_and_then_it_goes_on(mosquitto: Mosquitto, url: str, machine: Machine) -> None:
    with cnctwin.watch(url, "vmc", patience_s=PATIENCE_S) as watch:
        first_row(watch, machine)
        machine.tell(1)
        mosquitto.kill()
        stale = next(row for row in watch if row["part_count"].quality == "stale")
        assert stale.values() == {"part_count": None}
        assert watch.trouble
        mosquitto.restart()
        good = next(row for row in watch if row["part_count"].quality == "good")
        assert good["part_count"].value == machine.count


def test_a_reader_that_is_too_slow_loses_the_oldest_rows_and_is_told_how_many(url: str, machine: Machine) -> None:
    with cnctwin.watch(url, "vmc", queue_max=5) as watch:
        first_row(watch, machine)
        machine.tell(40)
        deadline_s = time.monotonic() + PATIENCE_S
        while watch.counts["received"] < 41 and time.monotonic() < deadline_s:
            time.sleep(0.02)
        counts = watch.counts
        assert counts["buffered"] == 5
        assert counts["received"] == counts["emitted"] + counts["dropped"] + counts["buffered"]
        rows = [watch.read(1.0) for _ in range(5)]
        assert [row and row["part_count"].value for row in rows] == list(range(machine.count - 4, machine.count + 1))
    counts = watch.counts
    assert counts["received"] == counts["emitted"] + counts["dropped"]


def test_asyncio_sees_the_same_and_a_cancelled_wait_loses_no_row(url: str, machine: Machine) -> None:
    async def seen() -> list[object]:
        async with cnctwin.watch(url, "vmc", patience_s=PATIENCE_S) as watch:
            await asyncio.to_thread(first_row, watch, machine)
            while watch.counts["buffered"]:
                await anext(watch)
            waiting = asyncio.ensure_future(anext(watch))
            await asyncio.sleep(0.2)
            waiting.cancel()
            await asyncio.to_thread(machine.tell, 3)
            values = []
            async for row in watch:
                values.append(row["part_count"].value)
                if row["part_count"].value == machine.count:
                    return values
        return []

    assert asyncio.run(seen())[-3:] == [machine.count - 2, machine.count - 1, machine.count]


def test_a_loop_that_waits_ends_when_another_thread_closes_it(url: str) -> None:
    watch = cnctwin.watch(url, "vmc")
    closer = threading.Timer(0.3, watch.close)
    closer.start()
    assert list(watch) == []
    closer.join()
    watch.close()
    assert watch.read() is None
    assert not [thread for thread in threading.enumerate() if thread.name == "watch-vmc"]


@pytest.mark.parametrize("way", ["for", "async for"])
def test_patience_ends_with_the_machines_that_were_heard_of(url: str, machine: Machine, way: str) -> None:
    async def anyone(watch: cnctwin.Watch) -> None:
        async for _ in watch:
            pass

    with cnctwin.watch(url, "vmx", patience_s=1.5) as watch:
        stop = threading.Event()
        teller = threading.Thread(target=lambda: [machine.tell(1) for _ in iter(lambda: stop.wait(0.1), True)])
        teller.start()
        try:
            with pytest.raises(
                cnctwin.BrokerError, match=r"^vmx: no row from mqtt://.* for 1\.5 s; machines that were heard of: vmc$"
            ):
                list(watch) if way == "for" else asyncio.run(anyone(watch))
        finally:
            stop.set()
            teller.join()


def test_a_broker_that_does_not_answer_is_named() -> None:
    with (
        cnctwin.watch(f"mqtt://127.0.0.1:{free_port()}", "vmc", patience_s=0.5) as watch,
        pytest.raises(cnctwin.BrokerError, match=r"vmc: no row from mqtt://127\.0\.0\.1:\d+ for 0\.5 s; .+"),
    ):
        next(watch)
    assert watch.trouble


@pytest.mark.parametrize("told_by", ["argument", "environment"])
def test_rows_come_over_tls_with_user_and_password(
    secured: BrokerAddress,  # noqa: F811
    told_by: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    if told_by == "environment":
        monkeypatch.setenv("CNCTWIN_PASSWORD", secured.password or "")
        monkeypatch.setenv("CNCTWIN_BROKER", secured.url)
    machine = Machine(secured)
    try:
        given = (None, None) if told_by == "environment" else (secured.url, secured.password)
        with cnctwin.watch(given[0], "vmc", password=given[1]) as watch:
            assert first_row(watch, machine)["part_count"].unit == "1"
            assert "pass word" not in repr(vars(watch)) and watch.broker == secured.url
    finally:
        machine.edge.stop()
