"""Streams: parts as they come, heartbeats, falling behind, and the end."""

import contextlib
import http.client
import re
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from cnctwin.standins.mtconnect_agent import ReplayAgent
from tests.cnctwin.standins.mtconnect_agent.small_machine import (
    at,
    error,
    fetch,
    header,
    observations,
    played,
    values,
    write_machine,
)

STYLES = ("2.3", "1.4")


class Parts:
    """A multipart stream, read part by part; `http.client` undoes the chunks."""

    def __init__(self, agent: ReplayAgent, path: str) -> None:
        self._connection = http.client.HTTPConnection(urlsplit(agent.url).netloc, timeout=60.0)
        self._connection.request("GET", path)
        self.response = self._connection.getresponse()
        self.boundary = self.response.headers.get_boundary() or ""

    def next(self) -> str | None:
        """Return the next document, None where the stream has ended. Every part is held to its Content-length."""
        head = self.response.readline()
        while head == b"\r\n":
            head = self.response.readline()
        if not head:
            return None
        assert head == f"--{self.boundary}\r\n".encode()
        assert self.response.readline() == b"Content-type: text/xml\r\n"
        length = re.fullmatch(rb"Content-length: (\d+)\r\n", self.response.readline())
        assert length is not None
        assert self.response.readline() == b"\r\n"
        body = self.response.read(int(length[1]))
        assert body.rstrip().endswith(b">")
        return body.decode()

    def close(self) -> None:
        self.response.close()
        self._connection.close()


@contextlib.contextmanager
def stream(agent: ReplayAgent, path: str) -> Iterator[Parts]:
    parts = Parts(agent, path)
    try:
        yield parts
    finally:
        parts.close()


@pytest.fixture(params=STYLES)
def agent(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[ReplayAgent]:
    """An agent that has played nothing yet; `step()` plays the next of 1000 tool numbers."""
    recording, devices = write_machine(tmp_path, [at(n, f"tool|{n}") for n in range(1000)])
    with ReplayAgent(recording, devices, speed=0, style=request.param, buffer_size=100) as serving:
        yield serving


def _sequences(document: str | None) -> list[int]:
    assert document is not None
    return sorted(int(o.attrib["sequence"]) for o in observations(document))


def test_the_kind_of_multipart_is_the_generations_own(agent: ReplayAgent) -> None:
    with stream(agent, "/sample?interval=0") as parts:
        kind = "multipart/mixed" if agent.agent.dialect.is_modern else "multipart/x-mixed-replace"
        assert parts.response.headers["content-type"] == f"{kind};boundary={parts.boundary}"
        assert parts.response.headers["transfer-encoding"] == "chunked"


def test_a_stream_misses_nothing_and_repeats_nothing(agent: ReplayAgent) -> None:
    start = agent.agent.buffer.next_sequence
    with stream(agent, f"/sample?interval=0&from={start}&count=7&heartbeat=5000") as parts:
        first = parts.next()
        assert first is not None
        assert not observations(first)  # at once, although there is nothing yet
        found: list[int] = []
        for _ in range(5):
            agent.step(10)
            while len(found) < agent.agent.buffer.next_sequence - start:
                document = parts.next()
                found += _sequences(document)
                assert document is not None
                assert len(observations(document)) <= 7
                assert int(header(document)["nextSequence"]) == found[-1] + 1
    assert found == list(range(start, start + 50))


def test_a_heartbeat_is_an_empty_document_in_time(agent: ReplayAgent) -> None:
    path = f"/sample?interval=10&heartbeat=600&from={agent.agent.buffer.next_sequence}"
    with stream(agent, path + "&path=//Linear") as parts:
        parts.next()
        begun = time.monotonic()
        agent.step(3)  # none of it is on the path
        document = parts.next()
        waited_s = time.monotonic() - begun
    assert document is not None
    assert not observations(document)
    assert "<Streams/>" in document
    assert 0.2 < waited_s < 8.0  # ten seconds are usual
    assert header(document)["nextSequence"] == str(agent.agent.buffer.next_sequence)


def test_the_interval_keeps_parts_apart(agent: ReplayAgent) -> None:
    with stream(agent, f"/sample?interval=600&from={agent.agent.buffer.next_sequence}&heartbeat=60000") as parts:
        parts.next()
        begun = time.monotonic()
        agent.step(5)
        assert len(_sequences(parts.next())) == 5
    assert 0.2 < time.monotonic() - begun < 30.0


def test_a_client_that_falls_behind_is_disconnected(agent: ReplayAgent) -> None:
    with stream(agent, "/sample?interval=300&count=10") as parts:
        parts.next()
        agent.step(500)  # the buffer holds 100: what comes next is gone before the interval is over
        last, more = None, parts.next()
        while more is not None:  # where it has taken us long, a part of what we did comes first
            last, more = more, parts.next()
        if not agent.agent.dialect.is_modern:
            assert last is not None
            assert error(last) == ("OUT_OF_RANGE", "Client can't keep up with event stream, disconnecting")


def test_a_restart_ends_the_stream_and_begins_anew(agent: ReplayAgent) -> None:
    agent.step(20)
    before = fetch(agent, "/current")
    with stream(agent, f"/sample?interval=0&from={header(before)['nextSequence']}") as parts:
        parts.next()
        agent.restart()
        assert parts.next() is None
    after = fetch(agent, "/current")
    assert int(header(after)["instanceId"]) > int(header(before)["instanceId"])
    assert header(after)["firstSequence"] == "1"
    assert values(after, "tool") == ["19"]  # the adapter connects again and sends its present values
    status = 400 if agent.agent.dialect.is_modern else 200
    assert error(fetch(agent, f"/sample?from={header(before)['nextSequence']}", status))[0] == "OUT_OF_RANGE"


def test_current_can_be_streamed(agent: ReplayAgent) -> None:
    with stream(agent, '/current?interval=20&path=//DataItem[@id="tool"]') as parts:
        assert values(parts.next() or "", "tool") == ["UNAVAILABLE"]
        agent.step(1)
        seen = [values(parts.next() or "", "tool") for _ in range(3)]
    assert seen[-1] == ["0"]


def test_a_bad_from_is_answered_plainly(agent: ReplayAgent) -> None:
    text = fetch(agent, "/sample?interval=10&from=99999", 400 if agent.agent.dialect.is_modern else 200)
    assert error(text)[0] == "OUT_OF_RANGE"


def test_stopping_the_agent_ends_its_streams(agent: ReplayAgent) -> None:
    with stream(agent, "/sample?interval=0&heartbeat=60000") as parts:
        parts.next()
        begun = time.monotonic()
        agent.stop()
        assert time.monotonic() - begun < 30.0
        with contextlib.suppress(http.client.IncompleteRead, ConnectionError):
            assert parts.next() is None


def test_too_many_clients_are_turned_away(tmp_path: Path) -> None:
    with played(tmp_path, [at(0, "tool|1")], clients_max=2) as agent, contextlib.ExitStack() as streams:
        for _ in range(2):
            streams.enter_context(stream(agent, "/sample?interval=0")).next()
        with pytest.raises((http.client.HTTPException, ConnectionError)):
            Parts(agent, "/probe")
        assert agent.clients_turned_away == 1
