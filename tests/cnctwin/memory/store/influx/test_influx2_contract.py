"""The write interface of InfluxDB 2, as documented, from both sides: what we send, and what each answer makes of it.

https://docs.influxdata.com/influxdb/v2/api/#operation/PostWrite and the errors of influxdb's http/write_handler.go.
"""

import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import pytest

from cnctwin.memory.store.contract import Pinned, Query, StoreError
from cnctwin.memory.store.influx.address import TOKEN, parse
from cnctwin.memory.store.influx.influx2 import Influx2
from cnctwin.memory.store.influx.influx_reader import InfluxReader
from cnctwin.memory.store.influx.sender import Patience
from cnctwin.memory.store.influx.store import ServerStore
from sparkplug.host_session import EventKind
from tests.cnctwin.memory.store.influx.stand_in import Answer, HttpServer, error
from tests.cnctwin.memory.store.influx.suite import BAD, STALE, T0_MS, reading, told


@pytest.fixture
def server() -> Iterator[HttpServer]:
    with HttpServer().serving() as server:
        yield server


@pytest.fixture
def store(server: HttpServer, tmp_path: Path) -> Iterator[ServerStore]:
    address = parse(f"influx+http://127.0.0.1:{server.port}?org=my plant&bucket_prefix=h1_&timeout_s=0.5", {TOKEN: "t0k"})
    store = ServerStore(
        Influx2(address),
        InfluxReader(address),
        address.base,
        tmp_path,
        knows_texts=True,
        chance=Random(1),
        patience=Patience(delay_s_min=0.01, delay_s_max=0.02),
    )
    yield store
    store.close()


def until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end_s, "did not happen"
        time.sleep(0.005)


def test_a_write_is_what_the_interface_asks_for(store: ServerStore, server: HttpServer) -> None:
    store.append(
        [
            told("Mill 3", reading("spindle_rpm", 8000, 0), reading("exec_state", "ACTIVE", 0), kind=EventKind.BIRTH),
            told("Mill 3", reading("coolant_on", True, 1), reading("program", 'O1 "a\\b"', 1)),
            told("Mill 3", reading("spindle_rpm", 8000, 2, STALE, "edge offline"), kind=EventKind.DEATH),
            told("Mill 3", reading("spindle_rpm", None, 3, BAD, "UNAVAILABLE"), reading("twin/spindle_temp_c", 31.5, 3)),
        ]
    )
    assert store.drain(60.0)
    by_bucket = {request.query["bucket"][0]: request for request in server.requests}
    assert set(by_bucket) == {"h1_cnc_raw", "h1_cnc_twin_state"}
    request = by_bucket["h1_cnc_raw"]
    assert (request.method, request.path) == ("POST", "/api/v2/write")
    assert request.query == {"bucket": ["h1_cnc_raw"], "org": ["my plant"], "precision": ["ns"]}
    assert request.headers["authorization"] == "Token t0k" and request.headers["content-encoding"] == "gzip"
    assert request.headers["content-type"].startswith("text/plain")
    series = r"cnc_raw,machine=Mill\ 3,node=cnc/hall,signal="
    assert request.body.decode().splitlines() == [
        f"{series}spindle_rpm,unit=rev/min value=8000.0,quality=0 {T0_MS}000000",
        f'{series}exec_state value=0.0,text="ACTIVE",quality=0 {T0_MS}000000',
        f"{series}coolant_on value=1.0,flag=true,quality=0 {T0_MS + 1}000000",
        f'{series}program text="O1 \\"a\\\\b\\"",quality=0 {T0_MS + 1}000000',
        f'{series}spindle_rpm,unit=rev/min held=8000.0,quality=1,reason="edge offline" {T0_MS + 2}000000',
        f'{series}spindle_rpm,unit=rev/min quality=2,reason="UNAVAILABLE" {T0_MS + 3}000000',
    ]
    derived = by_bucket["h1_cnc_twin_state"].body.decode()
    assert derived.startswith("cnc_twin_state,") and derived.endswith(f"value=31.5,quality=0 {T0_MS + 3}000000\n")


@pytest.mark.parametrize(
    ("answer", "trouble"),
    [
        (error(429, "rate limited", "too many requests"), "429: rate limited"),
        (error(503, "unavailable", "unavailable"), "503"),
        (error(500, "engine: error writing WAL entry: no space left on device", "internal error"), "no space left"),
        (error(401, "unauthorized access", "unauthorized"), "is the token right"),
        (error(404, 'bucket "h1_cnc_raw" not found', "not found"), "are the buckets there"),
        (Answer(502, "<html>\nbad gateway</html>"), "502: <html> bad gateway"),
        (Answer(301, "moved", (("Location", "http://127.0.0.1:1/"),)), "says 301"),
    ],
)
def test_what_says_not_now_keeps_everything(store: ServerStore, server: HttpServer, answer: Answer, trouble: str) -> None:
    server.standing = answer
    store.append([told("m", reading("spindle_rpm", 1, 0))])
    until(lambda: trouble in store.status().trouble and len(server.requests) > 2)
    assert store.status().waiting == 1
    server.standing = Answer()
    assert store.drain(60.0) and store.status().trouble == ""
    assert store.account()["sent"] == 1


def test_retry_after_is_honoured(store: ServerStore, server: HttpServer) -> None:
    server.answers.append(error(429, "slow down", "too many requests", Retry_After="1"))
    begun_s = time.monotonic()
    store.append([told("m", reading("spindle_rpm", 1, 0))])
    assert store.drain(60.0)
    assert time.monotonic() - begun_s > 0.9 and len(server.requests) == 2


def test_an_acknowledgement_that_is_lost_sends_the_same_line_again(store: ServerStore, server: HttpServer) -> None:
    server.answers.append(error(500, "timeout", "internal error"))
    store.append([told("m", reading("spindle_rpm", 1, 0))])
    assert store.drain(60.0)
    first, second = server.requests
    assert first.body == second.body and first.query == second.query


@pytest.mark.parametrize(
    "refusal",
    [
        error(400, "unable to parse 'x': bad timestamp"),
        error(422, 'failure writing points to database: partial write: field type conflict: input field "value" on measurement '
                   '"cnc_raw" is type float, already exists as type integer dropped=1', "unprocessable entity"),
    ],
)  # fmt: skip
def test_a_line_at_fault_is_found_counted_and_said(store: ServerStore, server: HttpServer, refusal: Answer) -> None:
    # A batch of four lines: whole, first half, second half, its lines.
    server.answers += [refusal, Answer(), refusal, Answer(), refusal]
    store.append([told("m", *(reading(f"axis_{n}_load_pct", n, 0) for n in range(4)))])
    assert store.drain(60.0)
    account = store.account()
    assert (account["sent"], account["refused by the server"]) == (3, 1)
    assert "the first line refused: cnc_raw,machine=m,node=cnc/hall,signal=axis_3_load_pct" in store.status().trouble


def test_samples_older_than_the_bucket_keeps_are_counted_in_one_go(store: ServerStore, server: HttpServer) -> None:
    server.answers.append(error(422, "partial write: points beyond retention policy dropped=2", "unprocessable entity"))
    store.append([told("m", *(reading(f"axis_{n}_load_pct", n, 0) for n in range(4)))])
    assert store.drain(60.0) and len(server.requests) == 1
    assert store.account()["refused by the server"] == 2


def test_a_server_that_hangs_is_given_up_in_time(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        sink = Influx2(parse(f"influx+http://127.0.0.1:{silent.getsockname()[1]}?org=o&timeout_s=0.2", {}))
        begun_s = time.monotonic()
        with pytest.raises(Exception, match="does not answer"):
            sink.write("cnc_raw", b"m v=1 1\n")
        assert time.monotonic() - begun_s < 8.0
        sink.close()


def test_a_question_goes_to_the_buckets_dbrp_name(store: ServerStore, server: HttpServer) -> None:
    server.standing = Answer(200, '{"results":[{"statement_id":0}]}')
    [column] = store.query(Query("m", ("spindle_rpm",), T0_MS, T0_MS + 1000))
    assert column.t_us == []
    asked = list(server.requests)
    assert {request.path for request in asked} == {"/query"} and {request.method for request in asked} == {"GET"}
    assert {request.query["db"][0] for request in asked} == {"h1_cnc_raw", "h1_cnc_pinned"}
    assert all(request.headers["authorization"] == "Token t0k" for request in asked)
    server.standing = error(404, "no dbrp mapping found", "not found")
    with pytest.raises(StoreError, match="says 404: no dbrp mapping found"):
        store.machines()
    server.standing = Answer(200, "<html>")
    with pytest.raises(StoreError, match="is that an InfluxDB"):
        store.machines()


def test_what_falls_into_a_pinned_stretch_goes_to_both_buckets(store: ServerStore, server: HttpServer) -> None:
    store.pin(Pinned("m", T0_MS + 10, T0_MS + 20, "gap grows"))
    store.append([told("m", *(reading("spindle_rpm", n, n) for n in range(30))), told("other", reading("spindle_rpm", 1, 12))])
    assert store.drain(60.0)
    pinned = [line for r in server.requests if r.query["bucket"] == ["h1_cnc_pinned"] for line in r.body.decode().splitlines()]
    assert len(pinned) == 10 and all("machine=m," in line for line in pinned)
