"""Pinned stretches on a real InfluxDB 1.x, and an embedded store beside a server."""

import time
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import httpx
import pytest

from cnctwin.memory.store.contract import Pinned, Query, Snapshot, Store, StoreError
from cnctwin.memory.store.influx.both import Both
from cnctwin.memory.store.influx.opening import open_influx
from cnctwin.memory.store.influx.store import ServerStore, steady_wall_ms
from cnctwin.memory.store.opening import open_store
from sparkplug.host_session import EventKind
from tests.cnctwin.memory.store.influx.servers import Influxd
from tests.cnctwin.memory.store.influx.suite import BAD, T0_MS, points, reading, told


@pytest.fixture(scope="module")
def influxd(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Influxd]:
    if reason := Influxd.missing():
        pytest.skip(reason)
    server = Influxd(tmp_path_factory.mktemp("influxd"))
    server.start()
    yield server
    server.stop()


@pytest.fixture
def machine() -> str:
    return f"vmc-{uuid4().hex[:8]}"


def asked(server: Influxd, database: str, statement: str) -> None:
    """Do something to the server as its administrator."""
    httpx.post(f"http://127.0.0.1:{server.port}/query", params={"db": database, "q": statement}, verify=False).raise_for_status()


def tidied(store: Store, now_ms: int) -> int:
    """Tidy until nothing more is copied."""
    whole = 0
    for _ in range(5):
        whole += store.tidy(now_ms).pinned
    return whole


def test_a_pinned_stretch_outlives_its_bucket(influxd: Influxd, tmp_path: Path, machine: str) -> None:
    store = open_influx(influxd.url(), writable=True, spool=tmp_path)
    assert isinstance(store, ServerStore)
    before = [told(machine, reading("spindle_rpm", n, n * 1000), t_ms=n * 1000) for n in range(120)]
    store.append(
        [*before, told(machine, reading("twin/raw_score", 9.5, 61_500), reading("spindle_rpm", None, 61_500, BAD, "why"))]
    )
    assert store.drain(60.0)
    store.pin(Pinned(machine, T0_MS + 60_000, T0_MS + 180_000, "gap grows"))
    store.append([told(machine, reading("spindle_rpm", n, n * 1000), t_ms=n * 1000) for n in range(120, 240)])
    assert store.drain(60.0)
    assert tidied(store, T0_MS + 240_000) == 1
    assert store.drain(60.0)
    query = Query(machine, ("spindle_rpm", "twin/raw_score"), T0_MS, T0_MS + 300_000)
    both_there = store.query(query)
    assert len(both_there[0].t_us) == 241, "what lies in both buckets is told once"
    windows = Query(machine, ("spindle_rpm",), T0_MS, T0_MS + 300_000, 60_000)
    assert store.query(windows)[0].count == [60, 61, 60, 60]
    for name in ("cnc_raw", "cnc_twin_state"):  # as its retention would
        asked(influxd, name, f"DELETE FROM {name} WHERE machine = '{machine}'")
    rpm, score = store.query(query)
    assert [t for t, _ in points(rpm)] == sorted([*range(60_000, 180_000, 1000), 61_500])
    assert points(score) == [(61_500, 9.5)] and rpm.unit == "rev/min"
    assert rpm.reason[[t for t, _ in points(rpm)].index(61_500)] == "why"
    assert store.query(windows)[0].count == [61, 60]
    store.close()


def test_what_comes_late_into_a_pinned_stretch_is_pinned_too(influxd: Influxd, tmp_path: Path, machine: str) -> None:
    store = open_influx(influxd.url(), writable=True, spool=tmp_path)
    assert isinstance(store, ServerStore)
    store.append([told(machine, reading("spindle_rpm", 1, 0))])
    store.pin(Pinned(machine, T0_MS, T0_MS + 60_000, "score"))
    assert store.drain(60.0) and tidied(store, T0_MS + 3_600_000) == 1
    store.close()
    store = open_influx(influxd.url(), writable=True, spool=tmp_path)
    assert isinstance(store, ServerStore)
    store.append([told(machine, reading("spindle_rpm", 2, 30_000, history=True), t_ms=3_600_000)])
    assert store.drain(60.0)
    asked(influxd, "cnc_raw", f"DELETE FROM cnc_raw WHERE machine = '{machine}'")
    [rpm] = store.query(Query(machine, ("spindle_rpm",), T0_MS, T0_MS + 60_000))
    assert points(rpm) == [(0, 1), (30_000, 2)]
    store.close()


def test_a_real_server_refuses_what_does_not_fit_and_takes_the_rest(influxd: Influxd, tmp_path: Path, machine: str) -> None:
    prefix = f"p{uuid4().hex[:6]}_"
    store = open_influx(f"{influxd.url()}?bucket_prefix={prefix}", writable=True, spool=tmp_path)
    assert isinstance(store, ServerStore)
    asked(influxd, "", f"CREATE DATABASE {prefix}cnc_raw")
    somebodys = f"cnc_raw,machine=x value=1i {T0_MS}000000"  # makes `value` a whole number in this database
    address = f"http://127.0.0.1:{influxd.port}/write"
    httpx.post(address, params={"db": f"{prefix}cnc_raw"}, content=somebodys, verify=False).raise_for_status()
    store.append([told(machine, reading("spindle_rpm", n, n), reading("program", f"O{n}", n), t_ms=n) for n in range(20)])
    assert store.drain(60.0)
    assert store.account()["refused by the server"] == 20 and store.account()["sent"] == 20
    assert "field type conflict" in store.status().trouble and "the first line refused: cnc_raw" in store.status().trouble
    [program] = store.query(Query(machine, ("program",), T0_MS, T0_MS + 1000))
    assert program.value == [f"O{n}" for n in range(20)]
    store.close()


def test_samples_older_than_a_real_server_keeps_are_counted(influxd: Influxd, tmp_path: Path, machine: str) -> None:
    prefix = f"p{uuid4().hex[:6]}_"
    asked(influxd, "", f"CREATE DATABASE {prefix}cnc_raw WITH DURATION 1h")
    store = open_influx(f"{influxd.url()}?bucket_prefix={prefix}", writable=True, spool=tmp_path)
    assert isinstance(store, ServerStore)
    now_ms = int(time.time() * 1000) - T0_MS
    store.append([told(machine, reading("spindle_rpm", 1, 0), reading("spindle_rpm", 2, now_ms))])
    assert store.drain(60.0)
    assert (store.account()["sent"], store.account()["refused by the server"]) == (1, 1)
    assert "beyond retention policy" in store.status().trouble
    store.close()


def test_a_server_alone_keeps_no_messages_and_says_the_way_out(tmp_path: Path) -> None:
    store = open_influx("influx1+http://127.0.0.1:1", writable=False, spool=tmp_path)
    with pytest.raises(StoreError, match="add also=<folder>"):
        list(store.messages("m", 0, 1))
    with pytest.raises(StoreError, match="opened for reading only"):
        store.append([])
    store.close()


@pytest.fixture
def both(influxd: Influxd, tmp_path: Path) -> Iterator[Store]:
    store = open_influx(f"{influxd.url()}?also={tmp_path / 'embedded'}", writable=True, spool=tmp_path / "ring")
    yield store
    store.close()


def test_with_an_embedded_store_beside_it_a_replay_finds_its_messages(both: Store, machine: str) -> None:
    messages = [told(machine, reading("spindle_rpm", n, n * 100), t_ms=n * 100) for n in range(20)]
    messages.insert(0, told(machine, reading("spindle_rpm", 0, 0), kind=EventKind.BIRTH))
    assert both.append(messages).stored == 20
    assert [m.event.kind for m in both.messages(machine, T0_MS, T0_MS + 60_000)][:2] == [EventKind.BIRTH, EventKind.DATA]
    both.keep_snapshot(Snapshot("thermal", machine, T0_MS, b"{}"))
    kept = both.snapshot_before("thermal", machine, T0_MS + 1)
    assert kept is not None and kept.payload == b"{}"
    both.pin(Pinned(machine, T0_MS, T0_MS + 1000, "gap"))
    assert both.pins(machine) == [Pinned(machine, T0_MS, T0_MS + 1000, "gap")]
    assert both.latest(machine)["spindle_rpm"].value == 19 and machine in both.machines()
    assert both.status().samples >= 20 and both.status().trouble == ""
    both.tidy(int(time.time() * 1000))


def test_a_question_is_put_together_at_the_border(both: Store, machine: str) -> None:
    assert isinstance(both, Both)
    hours = [told(machine, reading("spindle_rpm", n, n * 60_000), t_ms=n * 60_000) for n in range(180)]
    both.append(hours)
    server = both._server
    assert isinstance(server, ServerStore)
    whole = Query(machine, ("spindle_rpm",), T0_MS, T0_MS + 180 * 60_000)
    assert points(both.query(whole)[0]) == [(n * 60_000, n) for n in range(180)]
    assert server.drain(60.0)
    assert points(both.query(whole)[0]) == [(n * 60_000, n) for n in range(180)]
    windows = Query(machine, ("spindle_rpm",), T0_MS, T0_MS + 180 * 60_000, 7 * 60_000)
    [column] = both.query(windows)
    assert sum(column.count) == 180 and len(column.t_us) == len(set(column.t_us))
    assert column.value == server.query(windows)[0].value


def test_the_page_lives_on_the_embedded_store_while_the_server_is_down(tmp_path: Path, machine: str) -> None:
    where = f"influx1+http://127.0.0.1:1?also={tmp_path / 'embedded'}"
    both = open_influx(where, writable=True, spool=tmp_path / "ring")
    both.append([told(machine, reading("spindle_rpm", n, n * 100), t_ms=n * 100) for n in range(20)])
    reader = open_influx(where, writable=False, spool=tmp_path / "ring")
    [rpm] = reader.query(Query(machine, ("spindle_rpm",), T0_MS, T0_MS + 2000))
    assert rpm.value == list(range(20)), "what waits for the server is asked of the embedded store"
    assert reader.machines() == [machine] and reader.latest(machine)["spindle_rpm"].value == 19
    assert reader.status().waiting == 20
    both.close()
    assert open_store(tmp_path / "embedded").machines() == [machine]
    reader.close()


def test_a_ring_that_takes_nothing_holds_up_no_pin_of_the_embedded_store(
    tmp_path: Path, machine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    where = f"influx1+http://127.0.0.1:1?also={tmp_path / 'embedded'}"
    both = open_influx(where, writable=True, spool=tmp_path / "ring")
    said = [told(machine, reading("spindle_rpm", 1.0, 0))]

    def full(*_: object) -> None:
        raise StoreError("the ring's disk is full")

    with monkeypatch.context() as failing:
        failing.setattr("cnctwin.memory.store.influx.spool.Spool.write", full)
        failing.setattr("cnctwin.memory.store.influx.spool.Spool.put", full)
        both.append(said)
        both.pin(Pinned(machine, T0_MS, T0_MS + 1000, "score 9.1"))
    assert both.pins(machine) and "1 samples did not come" in both.status().trouble
    both.tidy(T0_MS)
    both.close()
    ring = open_influx(where.partition("?")[0], writable=True, spool=tmp_path / "ring")
    assert [pinned.reason for pinned in ring.pins(machine)] == ["score 9.1"], "given to the ring with the next tidy"
    ring.close()


def test_what_a_server_that_is_away_had_is_asked_of_the_embedded_store(tmp_path: Path, machine: str) -> None:
    where = f"influx1+http://127.0.0.1:1?also={tmp_path / 'embedded'}"
    both = open_influx(where, writable=True, spool=tmp_path / "ring")
    both.append([told(machine, reading("spindle_rpm", n, n * 3_600_000), t_ms=n * 3_600_000) for n in range(5)])
    both.close()
    reader = open_influx(where, writable=False, spool=tmp_path / "elsewhere")
    [rpm] = reader.query(Query(machine, ("spindle_rpm",), T0_MS, T0_MS + 5 * 3_600_000))
    assert rpm.value == list(range(5))
    reader.close()


def test_a_clock_that_is_set_while_we_run_evicts_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.memory.store.influx.store.time.time_ns", lambda: 0)
    wall_ms = steady_wall_ms()
    monkeypatch.setattr("cnctwin.memory.store.influx.store.time.time_ns", lambda: 1_790_000_000_000_000_000)
    assert 0 <= wall_ms() < 60_000
