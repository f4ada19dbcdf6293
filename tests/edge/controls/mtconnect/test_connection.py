"""The connection against agents: a real HTTP replay agent in both dialects, and small servers that misbehave."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace

import pytest

from cnctwin.standins.mtconnect_agent.replay_agent import ReplayAgent
from edge.config import EdgeConfig
from edge.controls.mtconnect.config import MtconnectConfig
from edge.controls.mtconnect.connection import Agent, MtconnectConnection, fetch
from edge.controls.mtconnect.cursor import Config, Request, parse, start
from edge.controls.mtconnect.draft import draft
from edge.controls.mtconnect.state import Phase
from edge.controls.mtconnect.tool_asset import SIGNALS as TOOL_SIGNALS
from edge.errors import ConfigError, ConnectionLostError
from edge.sample import Drop, EdgeSample, Gap, SampleSet
from tests.edge.controls.mtconnect.agent_documents import DIALECTS, error, probe, streams, value
from tests.recordings import recording

HANG_S = 20.0


class Reader:
    """A connection that is read and parsed in a thread; what came is kept."""

    def __init__(self, url: str, **options: object) -> None:
        self.config: Config = EdgeConfig(
            source=MtconnectConfig.model_validate({"url": url, "interval_ms": 10, "heartbeat_ms": 200, "poll_ms": 20} | options)
        )
        self.connection = MtconnectConnection(self.config)
        self.frames: list[SampleSet] = []
        self.cursor = start(self.config)
        self._thread = threading.Thread(target=self._read, daemon=True)

    def _read(self) -> None:
        self.connection.follow(self.cursor)
        for raw in self.connection.frames():
            self.cursor, frame = parse(self.config, self.cursor, raw)
            self.connection.follow(self.cursor)
            assert frame.accounted()
            self.frames.append(frame)

    def __enter__(self) -> "Reader":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        begin = time.monotonic()
        self.connection.close()
        self._thread.join(60)
        assert not self._thread.is_alive()
        assert time.monotonic() - begin < HANG_S / 2, "close must wake a blocked read"

    def wait(self, condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
        deadline = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline, (
                f"waited for {timeout_s} s; {self.connection.last_error or 'no error'}; {self.cursor.phase}"
            )
            time.sleep(0.01)

    @property
    def samples(self) -> list[EdgeSample]:
        return [sample for frame in self.frames for sample in frame.samples]

    @property
    def gaps(self) -> list[Gap]:
        return [gap for frame in self.frames for gap in frame.gaps]

    @property
    def received(self) -> int:
        return sum(frame.received for frame in self.frames)


def okuma(version: str, **options: object) -> ReplayAgent:
    files = recording("mtconnect/okuma.txt"), recording("mtconnect/okuma_devices.xml")
    return ReplayAgent(*files, device="OKUMA", style=version, **options)  # type: ignore[arg-type]


def play(agent: ReplayAgent, lines: int) -> None:
    for _ in range(lines):
        agent.step()


dialects = pytest.mark.parametrize("version", DIALECTS)


@dialects
def test_a_stream_gives_each_observation_once(version: str) -> None:
    with okuma(version, speed=0) as agent, Reader(agent.url, device="OKUMA", heartbeat_ms=5000) as reader:
        reader.wait(lambda: reader.cursor.phase is Phase.SAMPLE)
        for _ in range(20):
            play(agent, 20)
            time.sleep(0.01)
        newest = agent.agent.buffer.next_sequence
        reader.wait(lambda: reader.cursor.next_sequence == newest)
        sequences = [one.sequence for one in reader.samples if one.observations and one.signal not in TOOL_SIGNALS]
        assert len(sequences) == len(set(sequences)) > 500
        assert (reader.gaps, reader.connection.reconnects) == ([], 0)
        assert not any(Drop.DUPLICATE in frame.dropped for frame in reader.frames)


@dialects
def test_heartbeats_keep_a_quiet_stream_alive(version: str) -> None:
    with okuma(version, speed=0) as agent, Reader(agent.url, device="OKUMA", heartbeat_ms=500) as reader:
        reader.wait(lambda: reader.cursor.phase is Phase.SAMPLE)
        before = len(reader.frames)
        reader.wait(lambda: len(reader.frames) >= before + 4)
        assert (reader.connection.reconnects, reader.frames[-1].received) == (0, 0)


@dialects
def test_a_restarted_agent_is_found_again_and_the_hole_is_counted(version: str) -> None:
    with okuma(version, speed=0) as agent, Reader(agent.url, device="OKUMA") as reader:
        play(agent, 50)
        reader.wait(lambda: reader.cursor.phase is Phase.SAMPLE)
        old = reader.cursor.instance_id
        agent.restart()
        reader.wait(lambda: reader.cursor.instance_id != old and reader.cursor.phase is Phase.SAMPLE)
        play(agent, 50)
        newest = agent.agent.buffer.next_sequence
        reader.wait(lambda: reader.cursor.next_sequence == newest)
        assert [gap.reason.split(":")[0] for gap in reader.gaps] == ["agent restarted"]


@dialects
def test_falling_behind_a_small_buffer_is_one_counted_hole_and_then_goes_on(version: str) -> None:
    with okuma(version, speed=0, buffer_size=128) as agent, Reader(agent.url, device="OKUMA") as reader:
        play(agent, 5)
        reader.wait(
            lambda: reader.cursor.phase is Phase.SAMPLE and reader.cursor.next_sequence == agent.agent.buffer.next_sequence
        )
        received, wanted = reader.received, reader.cursor.next_sequence
        with agent.agent.changed:  # nobody can be answered while 700 lines come in
            play(agent, 700)
            newest = agent.agent.buffer.next_sequence
        # The cursor is ahead of what the reader has noted by a moment.
        reader.wait(lambda: bool(reader.gaps) and reader.cursor.next_sequence == newest and reader.cursor.phase is Phase.SAMPLE)
        (gap,) = reader.gaps
        assert gap.first_sequence == wanted
        assert 0 < gap.lost <= newest - wanted
        play(agent, 10)
        reader.wait(lambda: reader.cursor.next_sequence == agent.agent.buffer.next_sequence)
        assert len(reader.gaps) == 1
        assert reader.received > received


@dialects
def test_a_lost_adapter_makes_all_unavailable_and_comes_back(version: str) -> None:
    with okuma(version, speed=0) as agent, Reader(agent.url, device="OKUMA") as reader:
        play(agent, 100)
        reader.wait(lambda: reader.cursor.next_sequence == agent.agent.buffer.next_sequence)
        agent.adapter_lost()
        reader.wait(lambda: any(frame.available is False for frame in reader.frames[-3:]))
        agent.adapter_back()
        reader.wait(lambda: any(frame.available for frame in reader.frames[-3:]))


# Servers that misbehave.


@contextmanager
def server(*answers: Callable[[socket.socket], None], asked: list[bytes] | None = None) -> Iterator[str]:
    """Answers the n-th connection with the n-th answer, the last one again and again. `asked`: for the requests."""
    listener = socket.create_server(("127.0.0.1", 0))
    stop = threading.Event()
    open_sockets: list[socket.socket] = []

    def one(connection: socket.socket, answer: Callable[[socket.socket], None]) -> None:
        with connection, suppress(OSError):
            request = connection.recv(65536)
            if asked is not None:
                asked.append(request)
            answer(connection)

    def serve() -> None:
        count = 0
        while not stop.is_set():
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            open_sockets.append(connection)
            threading.Thread(target=one, args=(connection, answers[min(count, len(answers) - 1)]), daemon=True).start()
            count += 1

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        stop.set()
        with suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        for connection in open_sockets:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
            connection.close()
        thread.join(5)


def answer(body: bytes, *, status: str = "200 OK", kind: str = "text/xml") -> Callable[[socket.socket], None]:
    head = f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\nConnection: close\r\n\r\n"
    return lambda connection: connection.sendall(head.encode() + body)


def hang(connection: socket.socket) -> None:
    time.sleep(HANG_S)


def part(body: bytes) -> bytes:
    return b"--b\r\nContent-length: %d\r\n\r\n%s\r\n" % (len(body), body)


def multipart(*parts: bytes, then: Callable[[socket.socket], None] = hang) -> Callable[[socket.socket], None]:
    def send(connection: socket.socket) -> None:
        connection.sendall(
            b"HTTP/1.1 200 OK\r\nContent-Type: multipart/mixed; boundary=b\r\nConnection: close\r\n\r\n" + b"".join(parts)
        )
        then(connection)

    return send


BASELINE = answer(streams(10, [value("rpm", 3, "100")]))


def test_an_agent_that_does_not_stream_is_polled() -> None:
    document = streams(12, [value("rpm", 10, "1"), value("rpm", 11, "2")])
    with server(answer(probe()), BASELINE, answer(document), answer(streams(12))) as url, Reader(url) as reader:
        reader.wait(lambda: len(reader.frames) > 5)
        assert [sample.value for sample in reader.samples] == [100.0, 1.0, 2.0]
        assert (reader.connection.reconnects, reader.gaps) == (0, [])


@pytest.mark.parametrize("status", ["200 OK", "400 Bad Request", "404 Not Found"])
def test_an_error_is_told_by_its_document_and_not_by_the_status(status: str) -> None:
    refusal = answer(error("OUT_OF_RANGE"), status=status)
    with (
        server(answer(probe()), BASELINE, refusal, answer(streams(90, [value("rpm", 80, "7")], first=50))) as url,
        Reader(url) as reader,
    ):
        reader.wait(lambda: reader.gaps != [])
        assert [sample.value for sample in reader.samples] == [100.0, 7.0]
        assert reader.gaps[0].lost == 79


def test_a_stream_that_ends_or_breaks_is_taken_up_where_it_was() -> None:
    first = multipart(part(streams(11, [value("rpm", 10, "1")])), then=lambda connection: connection.close())
    torn = multipart(
        part(streams(12, [value("rpm", 11, "2")])),
        part(streams(13, [value("rpm", 12, "3")]))[:200],
        then=lambda connection: connection.close(),
    )
    rest = multipart(part(streams(14, [value("rpm", 12, "3"), value("rpm", 13, "4")])))
    with server(answer(probe()), BASELINE, first, torn, rest) as url, Reader(url, heartbeat_ms=2000) as reader:
        reader.wait(lambda: reader.cursor.next_sequence == 14)
        assert [sample.value for sample in reader.samples] == [100.0, 1.0, 2.0, 3.0, 4.0]
        assert (reader.connection.reconnects, reader.gaps) == (2, [])


def test_a_stream_says_where_it_waits_and_before_what_it_blocks() -> None:
    def close_later(connection: socket.socket) -> None:
        time.sleep(0.2)
        connection.close()

    stream = multipart(part(streams(11, [value("rpm", 10, "1")])), then=close_later)
    with server(answer(probe()), BASELINE, stream) as url:
        reader, told = Reader(url, heartbeat_ms=2000), list[str]()
        reader.connection.follow(reader.cursor)
        for step in reader.connection.steps():
            if isinstance(step, bytes):
                reader.cursor, _ = parse(reader.config, reader.cursor, step)
                reader.connection.follow(reader.cursor)
                told.append("frame")
            else:
                told.append("blocks" if step.sock is None else "waits")
                if step.sock is not None:
                    assert not step.sock.getblocking()
                    time.sleep(0.01)
            if told.count("blocks") == 3:
                break
        assert reader.connection.reconnects == 0, "it connects again only when it is told to go on"
    assert "waits" in told
    assert [one for one in told if one != "waits"] == ["frame", "blocks"] * 3


def test_a_corrupt_part_is_asked_for_again_and_not_skipped() -> None:
    corrupt = multipart(part(b"<MTConnectStreams><Header next"), part(streams(13, [value("rpm", 12, "9")])))
    whole = multipart(part(streams(13, [value("rpm", 10, "1"), value("rpm", 12, "9")])))
    with server(answer(probe()), BASELINE, corrupt, whole) as url, Reader(url, heartbeat_ms=2000) as reader:
        reader.wait(lambda: reader.cursor.next_sequence == 13)
        assert [sample.value for sample in reader.samples] == [100.0, 1.0, 9.0]


def test_an_agent_that_hangs_is_given_up_after_three_heartbeats() -> None:
    alive = multipart(part(streams(11, [value("rpm", 10, "1")])))
    with server(answer(probe()), BASELINE, hang, alive) as url, Reader(url, heartbeat_ms=100, timeout_s=0.3) as reader:
        reader.wait(lambda: reader.cursor.next_sequence == 11)
        assert "timed out" in reader.connection.last_error


def test_after_a_long_outage_a_document_that_comes_in_pieces_is_waited_for() -> None:
    whole = part(streams(11, [value("rpm", 10, "1")]))

    def rest(connection: socket.socket) -> None:
        time.sleep(0.1)
        connection.sendall(whole[300:])
        hang(connection)

    pieces = multipart(whole[:300], then=rest)
    with server(answer(probe()), BASELINE, hang, pieces) as url, Reader(url, heartbeat_ms=500, timeout_s=1.5) as reader:
        reader.wait(lambda: reader.cursor.next_sequence == 11)
        assert reader.connection.reconnects == 1


def test_an_agent_that_drips_without_ever_finishing_a_part_is_given_up() -> None:
    def drip(connection: socket.socket) -> None:
        for _ in range(200):
            connection.sendall(b" ")
            time.sleep(0.02)

    endless = multipart(b"--b\r\nContent-length: 100000\r\n\r\n", then=drip)
    with server(answer(probe()), BASELINE, endless) as url, Reader(url, heartbeat_ms=100, timeout_s=0.3) as reader:
        reader.wait(lambda: "no document within 0.3 s" in reader.connection.last_error)


def test_a_refusal_that_is_no_document_is_a_lost_connection() -> None:
    with server(answer(b"<html>who are you</html>", status="401 Unauthorized", kind="text/html")) as url, Reader(url) as reader:
        reader.wait(lambda: reader.connection.reconnects > 0)
        assert reader.connection.last_error == f"{url}: HTTP 401 Unauthorized for /probe"


def test_an_agent_that_is_not_there_is_tried_again_later_and_later() -> None:
    with socket.socket() as nobody:  # it has the port, and does not listen
        nobody.bind(("127.0.0.1", 0))
        begin = time.monotonic()
        with Reader(f"http://127.0.0.1:{nobody.getsockname()[1]}") as reader:
            reader.wait(lambda: reader.connection.reconnects == 2)
            assert time.monotonic() - begin >= 0.25
            assert "refused" in reader.connection.last_error


def test_a_single_document_that_is_not_there_names_the_way_out() -> None:
    with pytest.raises(ConnectionLostError, match="is the agent running, and the address right"):
        fetch(EdgeConfig(source=MtconnectConfig(url="http://127.0.0.1:1")), Request("/probe"))


@pytest.mark.parametrize(
    ("reply", "way_out"),
    [
        (answer(b"", status="401 Unauthorized"), "HTTP 401 Unauthorized; it wants mtconnect.username and password_env"),
        (answer(b"", status="404 Not Found"), "HTTP 404 Not Found; is this the address of an MTConnect agent?"),
        (answer(b"<html>log in", kind="text/html"), "is this the address of an MTConnect agent?"),
    ],
)
def test_whoever_is_no_agent_is_told_apart(reply: Callable[[socket.socket], None], way_out: str) -> None:
    with server(reply) as url, pytest.raises(ConnectionLostError) as refused:
        draft(url)
    assert str(refused.value).startswith(f"{url}/probe: ")
    assert way_out in str(refused.value)


def test_a_page_in_the_agents_place_does_not_end_the_streaming() -> None:
    page, alive = answer(b"<html>log in</html>", kind="text/html"), multipart(part(streams(11, [value("rpm", 10, "1")])))
    asked = list[bytes]()
    with server(answer(probe()), BASELINE, page, alive, asked=asked) as url, Reader(url, heartbeat_ms=2000) as reader:
        reader.wait(lambda: reader.cursor.next_sequence == 11)
    assert [b"interval=10" in request for request in asked] == [False, False, True, True]


def test_the_password_comes_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    config = EdgeConfig(source=MtconnectConfig(username="edge", password_env="AGENT_SECRET"))
    with pytest.raises(ConfigError, match="no such environment variable"):
        Agent(config)
    monkeypatch.setenv("AGENT_SECRET", "s3cret")
    asked = list[bytes]()
    with server(answer(probe()), asked=asked) as url:
        fetch(replace(config, source=config.source.model_copy(update={"url": url})), Request("/probe"))
    assert b"Authorization: Basic ZWRnZTpzM2NyZXQ=" in asked[0].split(b"\r\n")
    with pytest.raises(ConfigError, match=r"ca_file = '/none\.pem'"):
        Agent(EdgeConfig(source=MtconnectConfig(ca_file="/none.pem")))
