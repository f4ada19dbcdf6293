"""Streams over a real broker and a real server: complete, shared, bounded, and back after anything was killed."""

import socket
import time

import pytest

from cnctwin.api.application import create_app
from cnctwin.api.errors import ApiError
from cnctwin.api.live import event_stream, fan_out
from cnctwin.api.live.batches import machine_rows
from cnctwin.api.live.fan_out import FanOut
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.server import Server
from cnctwin.api.sources import Sources
from tests.cnctwin.api.served_plant import LOAD, Stream, get, machine, served, streamed, tell, wait_until_known
from tests.cnctwin.api.small_plant import birth, data, now, small_plant
from tests.edge.host_watch import wait
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker


def fleet_rows(fleet: Stream) -> list[list[object]]:
    """All that the fleet's readers were told."""
    return [row for event in list(fleet.events) if event.name == "fleet_rows" for row in event.data["rows"]]


def fleet_news(fleet: Stream) -> list[list[object]]:
    """Signal and value of it."""
    return [row[2:4] for row in fleet_rows(fleet)]


def test_a_stream_begins_with_the_state_and_goes_on_with_every_row_in_order(mosquitto: Mosquitto) -> None:
    with machine(mosquitto) as edge, served(mosquitto) as server:
        wait_until_known(server, edge)
        with Stream(server.url) as one, Stream(server.url) as other, Stream(server.url, None) as fleet:
            assert one.events[0].name == "state"
            assert one.events[0].data["measured"][LOAD]["unit"] == "%"
            tell(edge, 0.5)
            for reader in (one, other):
                wait(lambda reader=reader: 0.5 in reader.loads(), "what was told before")
                reader.events.clear()
            begun_s = time.monotonic()
            for value in range(1, 101):
                tell(edge, float(value))
                time.sleep(0.01)
            for reader in (one, other):
                wait(lambda reader=reader: 100.0 in reader.loads(), "all rows")
                told_s = time.monotonic() - begun_s
                assert reader.loads() == [float(value) for value in range(1, 101)]
                batches = [event for event in reader.events if event.name == "rows" and event.data["rows"]]
                assert len(batches) <= told_s * 10.0 + 3
            wait(lambda: [LOAD, 100.0] in fleet_news(fleet), "the fleet's rows")
            assert fleet.events[0].name == "fleet"
            assert fleet.events[0].data["machines"][0]["machine"] == "vmc"
            (row,) = [row for row in fleet_rows(fleet) if row[3] == 100.0]
            assert [row[0], row[2], row[4]] == ["vmc", LOAD, "good"]


def test_a_broker_that_is_killed_and_comes_back_is_seen_by_the_page_without_anybody_s_help(mosquitto: Mosquitto) -> None:
    with machine(mosquitto) as edge, served(mosquitto) as server:
        wait_until_known(server, edge)
        with Stream(server.url) as stream, Stream(server.url, None) as fleet:
            mosquitto.kill()
            wait(lambda: stream.last("state")["online"] is False, "the machine to be offline")
            assert stream.last("state")["measured"][LOAD]["quality"] == "stale"
            parts = {part["part"]: part for part in get(f"{server.url}/health").json()["parts"]}
            assert parts["broker"]["state"] == "missing"
            assert get(f"{server.url}/readyz").status_code == 200
            mosquitto.restart()
            wait(lambda: stream.last("state")["online"] is True, "the machine to be online again")
            assert stream.last("state")["measured"][LOAD]["quality"] == "good"
            tell(edge, 55.0)
            wait(lambda: 55.0 in stream.loads(), "a new value")
            assert stream.connections == 1
            wait(lambda: ["online", False] in fleet_news(fleet) and ["online", True] in fleet_news(fleet), "the fleet to be told")


def test_a_server_that_is_started_anew_tells_a_reader_all_again(mosquitto: Mosquitto) -> None:
    with machine(mosquitto) as edge, served(mosquitto) as server:
        wait_until_known(server, edge)
        tell(edge, 41.0)
        with Stream(server.url) as stream:
            port = server.port
            server.stop()
            live_after = small_plant()
            with Server(create_app(Sources(live_after)), port=port):
                wait(lambda: stream.last("state")["measured"].get("spindle_rpm", {}).get("value") == 6000.0, "the new state")
                assert stream.connections == 2


def test_a_stream_is_never_silent_for_long(monkeypatch: pytest.MonkeyPatch, mosquitto: Mosquitto) -> None:
    monkeypatch.setattr("cnctwin.api.live.plant.SILENCE_MS_MAX", 300)
    monkeypatch.setattr(event_stream, "KEEP_ALIVE_S", 0.2)
    with machine(mosquitto) as edge, served(mosquitto) as server:
        wait_until_known(server, edge)
        with Stream(server.url) as stream:
            wait(lambda: len([event for event in stream.events if event.name == "rows"]) >= 3, "rows without news")
            assert stream.last("rows")["rows"] == []
        with streamed("GET", f"{server.url}/stream?machine=vmc") as answer:
            lines = answer.iter_lines()
            assert any(line == ": still here" for line, _ in zip(lines, range(40), strict=False))


def has_read(reader: Stream, load: float) -> bool:
    """Return whether the reader's last rows begin with this load."""
    rows = reader.last("rows").get("rows")
    return bool(rows) and rows[0][1:3] == [LOAD, load]


def test_who_does_not_read_is_let_go_and_holds_up_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fan_out, "BEHIND_MAX", 5)
    monkeypatch.setattr(event_stream, "SEND_S_MAX", 0.5)
    live = small_plant()
    app = create_app(Sources(live))
    wide = {f"signal_{number:03}": 0.0 for number in range(1900)}
    live.take([birth({LOAD: 0.0, **wide}, now())], now())
    with Server(app) as server, Stream(server.url) as reader:
        sleeper = socket.create_connection((server.host, server.port))
        sleeper.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sleeper.sendall(b"GET /stream?machine=vmc HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        wait(lambda: len(app.state.fan_out) == 2, "both readers")
        for value in range(400):
            t_ms = now() + value
            live.take([data({LOAD: float(value), **dict.fromkeys(wide, float(value))}, t_ms)], t_ms)
            app.state.fan_out.send(live.flush(t_ms))
            if len(app.state.fan_out) == 1:
                break
            wait(lambda value=value: has_read(reader, value), "who reads to have read it")
        assert len(app.state.fan_out) == 1
        tell_ms = now() + 1000
        live.take([data({LOAD: 77.0}, tell_ms)], tell_ms)
        app.state.fan_out.send(live.flush(tell_ms))
        wait(lambda: has_read(reader, 77.0), "the other reader's row")
        assert reader.connections == 1
        sleeper.close()


def test_streams_are_bounded_and_one_that_goes_makes_room(monkeypatch: pytest.MonkeyPatch) -> None:
    app = create_app(Sources(small_plant()))
    app.state.fan_out._readers_max = 2
    with Server(app) as server:
        with streamed("GET", f"{server.url}/stream"), streamed("GET", f"{server.url}/stream?machine=vmc"):
            refused = get(f"{server.url}/stream")
            assert refused.status_code == 503
            assert "2 streams are open" in refused.json()["error"]
            assert get(f"{server.url}/machines").status_code == 200
        wait(lambda: len(app.state.fan_out) == 0, "the streams to end")
        with streamed("GET", f"{server.url}/stream") as answer:
            assert answer.status_code == 200


def test_one_client_does_not_have_all_the_streams(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fan_out, "OF_ONE_MAX", 2)
    streams = FanOut(small_plant())
    held = [streams.open(None, "10.0.0.7"), streams.open("vmc", "10.0.0.7")]
    with pytest.raises(ApiError, match=r"2 streams of 10.0.0.7 are open"):
        streams.open(None, "10.0.0.7")
    assert streams.open(None, "10.0.0.8")
    streams.close(held[0])
    assert streams.open(None, "10.0.0.7")


def test_a_message_is_encoded_once_for_all_who_read_it(monkeypatch: pytest.MonkeyPatch) -> None:
    encoded: list[str] = []
    monkeypatch.setattr(
        "cnctwin.api.live.plant.machine_rows", lambda name, *a, **k: encoded.append(name) or machine_rows(name, *a, **k)
    )
    live = small_plant()
    for _ in range(10):
        live.watch("vmc")
    live.flush(now())
    encoded.clear()
    live.take([data({LOAD: 1.0}, now())], now())
    assert len(live.flush(now())) == 1
    assert encoded == ["vmc"]


def test_nothing_is_collected_for_a_machine_that_nobody_reads() -> None:
    live = small_plant()
    live.watch("vmc")
    live.unwatch("vmc")
    live.take([data({LOAD: 1.0}, now())], now())
    assert live.flush(now()) == []


def test_rows_that_wait_are_bounded_and_what_is_left_out_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.api.live.plant.ROWS_MAX", 10)
    live = small_plant()
    live.watch("vmc")
    live.flush(now())
    for value in range(25):
        live.take([data({LOAD: float(value)}, now() + value)], now())
    (batch,) = live.flush(now())
    assert b'"left_out":15' in batch.payload


def test_a_server_that_stops_ends_its_streams_and_lets_nobody_in_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.api.server.STOP_S_MAX", 60)
    server = Server(create_app(Sources(small_plant())))
    server.start()
    with Stream(server.url) as machine_stream, Stream(server.url, None) as fleet:
        begun_s = time.monotonic()
        server.stop()
        assert time.monotonic() - begun_s < 30.0, "somebody held it up"
        wait(lambda: not (machine_stream.is_open or fleet.is_open), "both streams to end")
        assert machine_stream.connections == fleet.connections == 1


def test_a_stream_that_a_request_under_way_opens_while_the_server_stops_ends_at_once() -> None:
    streams = FanOut(LivePlant())
    streams.end()
    assert streams.open(None).messages.get_nowait() is None
