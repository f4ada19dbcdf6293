"""Real servers that are killed with -9 and cut off under load, and a writer that is killed: every sample is there, once."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from uuid import uuid4

import httpx
import pytest

from cnctwin.memory.store.contract import Query
from cnctwin.memory.store.influx.address import parse
from cnctwin.memory.store.influx.influx1 import Influx1
from cnctwin.memory.store.influx.influx2 import Influx2
from cnctwin.memory.store.influx.influx_reader import InfluxReader
from cnctwin.memory.store.influx.opening import open_influx
from cnctwin.memory.store.influx.sender import Patience
from cnctwin.memory.store.influx.server import Server
from cnctwin.memory.store.influx.spool import RingLimits
from cnctwin.memory.store.influx.store import Reader, ServerStore
from cnctwin.memory.store.influx.victoria import Victoria
from cnctwin.memory.store.influx.victoria_reader import VictoriaReader
from tests.cnctwin.memory.store.influx.gate import Gate
from tests.cnctwin.memory.store.influx.servers import Influxd, ServerProcess, VictoriaMetrics
from tests.cnctwin.memory.store.influx.suite import T0_MS, reading, told

EVERY_MS = 10
ROOT = Path(__file__).parents[5]


class DeduplicatingVictoria(VictoriaMetrics):
    """The server is started as docs/how-to/influx.md describes."""

    deduplicates = True


@pytest.fixture(params=[DeduplicatingVictoria, Influxd], ids=lambda kind: kind.name)
def server(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[ServerProcess]:
    kind: type[ServerProcess] = request.param
    if reason := kind.missing():
        pytest.skip(reason)
    server = kind(tmp_path / kind.name)
    server.start()
    yield server
    server.stop()


def opened(server: ServerProcess, port: int, ring: Path) -> ServerStore:
    """A store that asks again soon."""
    address = parse(server.url(port), {})
    is_victoria = isinstance(server, VictoriaMetrics)
    sink: Server = Victoria(address, settle_s=7.0) if is_victoria else Influx1(address)
    reader: Reader = VictoriaReader(address) if is_victoria else InfluxReader(address)
    patience = Patience(delay_s_min=0.05, delay_s_max=0.2, samples_at_once=1000)
    limits = RingLimits(free_bytes_min=0)
    return ServerStore(
        sink, reader, address.base, ring, knows_texts=not is_victoria, limits=limits, chance=Random(1), patience=patience
    )


def until(condition: Callable[[], bool], timeout_s: float = 90.0) -> None:
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, "did not happen"
        time.sleep(0.05)


def numbers_kept(store: ServerStore, machine: str, samples: int) -> list[float]:
    """Return what the server holds of the numbered samples, raw."""
    [column] = store.query(Query(machine, ("spindle_rpm",), T0_MS, T0_MS + samples * EVERY_MS))
    assert column.t_us == sorted(set(column.t_us)), "each time once"
    return [float(value) for value in column.value if isinstance(value, int | float)]


def test_a_server_that_is_killed_and_cut_off_under_load_has_every_sample_once(server: ServerProcess, tmp_path: Path) -> None:
    machine, samples, at_once = f"vmc-{uuid4().hex[:6]}", 12_000, 200
    events: dict[int, Callable[[], object]] = {}
    with Gate(server.port) as gate:
        store = opened(server, gate.port, tmp_path / "ring")
        events[10] = gate.shut
        events[20] = gate.open
        events[30] = server.kill
        events[40] = server.start
        for number in range(0, samples, at_once):
            events.get(number // at_once, lambda: None)()
            told_now = [
                told(machine, reading("spindle_rpm", n, n * EVERY_MS), t_ms=n * EVERY_MS) for n in range(number, number + at_once)
            ]
            assert store.append(told_now).stored == at_once
            if number // at_once in {15, 35}:
                until(lambda: "does not answer" in store.status().trouble)
                assert store.status().waiting > 0
            time.sleep(0.02)
        until(lambda: store.account()["held"] == 0)
        assert store.account() == {
            "taken": samples, "sent": samples, "held": 0, "refused": 0, "refused by the server": 0, "repeated": 0,
        }  # fmt: skip
        assert store.status().trouble == ""
        assert numbers_kept(store, machine, samples) == list(range(samples))
        assert _count(server, machine) == samples
        store.close()


def _count(server: ServerProcess, machine: str) -> int:
    """Return how many samples the server itself counts."""
    base = f"http://127.0.0.1:{server.port}"
    if isinstance(server, VictoriaMetrics):
        server.flush()
        asked = {
            "query": f'sum(count_over_time(cnc_raw_value{{machine="{machine}"}}[1d]))',
            "time": str(time.time() + 60),
            "nocache": "1",
        }
        told_back = httpx.get(f"{base}/api/v1/query", params=asked, verify=False).json()["data"]["result"]
        return int(told_back[0]["value"][1])
    asked = {"db": "cnc_raw", "q": f"SELECT count(value) FROM cnc_raw WHERE machine = '{machine}'"}
    counted: int = httpx.get(f"{base}/query", params=asked, verify=False).json()["results"][0]["series"][0]["values"][0][1]
    return counted


def test_a_writer_that_is_killed_loses_nothing_of_what_it_acknowledged(server: ServerProcess, tmp_path: Path) -> None:
    machine, samples, acknowledged, kills = f"vmc-{uuid4().hex[:6]}", 6_000, 0, 0
    for lives_s in (0.1, None):
        command = [
            sys.executable,
            "-m",
            "tests.cnctwin.memory.store.influx.writer",
            server.url(),
            str(tmp_path / "ring"),
            machine,
        ]
        with subprocess.Popen(
            [*command, str(acknowledged), str(samples), str(T0_MS)], stdout=subprocess.PIPE, cwd=ROOT, text=True
        ) as writer:
            assert writer.stdout is not None
            acknowledged = int(writer.stdout.readline())
            if lives_s is not None:
                time.sleep(lives_s)
                writer.kill()
                kills += writer.wait() == -9
            acknowledged = max([acknowledged, *(int(line) for line in writer.stdout if line.endswith("\n"))])
    assert acknowledged == samples and kills == 1
    store = opened(server, server.port, tmp_path / "ring")
    assert store.drain(60.0)
    if isinstance(server, VictoriaMetrics):
        server.flush()
    assert numbers_kept(store, machine, samples) == list(range(samples))
    store.close()


def test_influxdb_client_writes_to_a_real_server(tmp_path: Path) -> None:
    if reason := VictoriaMetrics.missing():
        pytest.skip(reason)
    server = VictoriaMetrics(tmp_path / "victoria")
    server.start()
    try:
        sink = Influx2(parse(f"influx+http://127.0.0.1:{server.port}?org=plant", {}))
        sink.write("cnc_raw", f"cnc_raw,machine=m,signal=spindle_rpm value=7 {T0_MS}000000\n".encode())
        server.flush()
        told_back = httpx.get(
            f"http://127.0.0.1:{server.port}/api/v1/export", params={"match[]": "cnc_raw_value"}, verify=False
        ).json()
        assert told_back["values"] == [7] and told_back["timestamps"] == [T0_MS]
        server.kill()
        with pytest.raises(Exception, match="does not answer"):
            sink.write("cnc_raw", b"cnc_raw value=7\n")
        sink.close()
    finally:
        server.stop()


def test_a_store_opens_and_takes_samples_while_its_server_is_down(tmp_path: Path) -> None:
    store = open_influx("influx1+http://127.0.0.1:1", writable=True, spool=tmp_path)
    assert store.append([told("m", reading("spindle_rpm", 1, 0))]).stored == 1
    until(lambda: "does not answer" in store.status().trouble)
    assert store.status().waiting == 1
    begun_s = time.monotonic()
    store.close()
    assert time.monotonic() - begun_s < 10.0
