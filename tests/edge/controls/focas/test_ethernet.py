"""The client of the Ethernet protocol on real connections: to our own server, and to one that answers what real controls did."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from cnctwin.standins.focas_server.faults import Refusal, Wrong
from cnctwin.standins.focas_server.server import FocasServer
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from edge.controls.focas import wire
from edge.controls.focas.calls import Call, Request
from edge.controls.focas.config import FocasConfig
from edge.controls.focas.ethernet import EthernetBackend
from edge.controls.focas.policy import CODES, HANDLE, NUMBER, PROTOCOL, SOCKET, Policy, policy_of
from tests.edge.controls.focas import captured_frames as captured

TIMEOUT_S = 1.0
STATE = ControlState(exec_state="ACTIVE", program="O1701", line=12, spindle_rpm=3500.0, axis_pos_mm=(1.5, -2.25, 3.0))
STATUS, LOAD = Request(Call.STATUS), Request(Call.SPINDLE_LOAD)


@pytest.fixture(scope="module")
def serving() -> Iterator[FocasServer]:
    with FocasServer(SimulatedControl([STATE]), sessions_max=100) as one:
        yield one


@pytest.fixture
def server(serving: FocasServer) -> Iterator[FocasServer]:
    yield serving
    serving.faults.clear()


@pytest.fixture
def backend(server: FocasServer) -> Iterator[EthernetBackend]:
    one = EthernetBackend(FocasConfig(port=server.port, timeout_s=TIMEOUT_S))
    assert one.open().code == 0
    yield one
    one.close()


def test_it_finds_out_who_is_there(server: FocasServer) -> None:
    backend = EthernetBackend(FocasConfig(port=server.port))
    opened = backend.open()
    backend.close()
    assert (opened.code, opened.identity.mt_type, opened.identity.axes) == (0, "M", ("X", "Y", "Z"))


def test_several_calls_are_one_frame_and_their_answers_come_in_order(server: FocasServer, backend: EthernetBackend) -> None:
    before = server.ledger["frames"]
    dynamic, status, tool = backend.ask([Request(Call.DYNAMIC), STATUS, Request(Call.TOOL)])
    assert server.ledger["frames"] == before + 1
    found = {one.key: one.value for one in (*dynamic.found, *status.found)}
    assert [found[key] for key in ("spindle_rpm", "sequence", "position.Y", "status.run")] == [3500, 12, -2.25, 3]
    assert tool.code == 1  # no command is known for it


@pytest.mark.parametrize("code", [code for code in CODES if code != 0])
def test_each_code_of_one_function_comes_through_and_leaves_the_others_alone(
    code: int, server: FocasServer, backend: EthernetBackend
) -> None:
    server.faults.failing = {(wire.CNC, 0x40): code}
    status, load = backend.ask([STATUS, LOAD])
    assert (load.code, load.found) == (code, ())
    assert status.code == 0
    server.faults.clear()
    if policy_of(code) is not Policy.RECONNECT:
        assert backend.ask([LOAD])[0].code == 0


def test_a_control_that_hangs_costs_its_timeout_and_the_handle(server: FocasServer, backend: EthernetBackend) -> None:
    server.faults.hang = True
    began_s = time.monotonic()
    assert {answer.code for answer in backend.ask([STATUS, LOAD])} == {SOCKET}
    assert time.monotonic() - began_s < TIMEOUT_S + 5.0
    server.faults.clear()
    assert backend.ask([STATUS])[0].code == SOCKET
    assert backend.open().code == 0
    assert backend.ask([STATUS])[0].code == 0


@pytest.mark.parametrize("wrong", [wrong for wrong in Wrong if wrong is not Wrong.CODES])
def test_no_value_comes_from_an_answer_that_is_wrong(wrong: Wrong, server: FocasServer, backend: EthernetBackend) -> None:
    server.faults.wrong = wrong
    answers = backend.ask([STATUS, LOAD])
    assert {answer.code for answer in answers} <= {PROTOCOL, SOCKET}
    assert not any(answer.found for answer in answers)


@pytest.mark.parametrize("length", [0, 5, 10, 30])
def test_no_value_comes_from_a_torn_answer(length: int, server: FocasServer, backend: EthernetBackend) -> None:
    server.faults.drop_after_bytes = length
    assert {answer.code for answer in backend.ask([STATUS, LOAD])} == {SOCKET}


def test_a_control_without_a_free_session_says_so(server: FocasServer) -> None:
    server.faults.refusal = Refusal.SESSION
    backend = EthernetBackend(FocasConfig(port=server.port, timeout_s=TIMEOUT_S))
    opened = backend.open()
    assert (opened.code, "sessions are in use" in opened.why) == (HANDLE, True)
    server.faults.refusal = Refusal.CONNECTION
    assert backend.open().code in (SOCKET, PROTOCOL)


def test_nobody_there_is_said_at_once() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    opened = EthernetBackend(FocasConfig(port=port, timeout_s=TIMEOUT_S)).open()
    assert (opened.code, "refused" in opened.why) == (SOCKET, True)


@contextmanager
def answering(reply: Callable[[bytes], bytes]) -> Iterator[int]:
    """A server for one client that answers each frame with what `reply` makes of it; the port."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        client, _ = listener.accept()
        with client:
            client.settimeout(5)
            while head := client.recv(10):
                asked = head + client.recv(int.from_bytes(head[8:10], "big")) if head[9] or head[8] else head
                client.sendall(reply(asked))

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield listener.getsockname()[1]
    finally:
        thread.join(5)
        listener.close()


def real_control(asked: bytes) -> bytes:
    """Return what real controls answered, as it was captured; who is there is put together from two of them."""
    if asked[6:8] == b"\x01\x01":
        return wire.MAGIC + bytes.fromhex("0004010200020000")
    if asked[6:8] == b"\x02\x01":
        return wire.MAGIC + bytes.fromhex("000402020000")
    system, multi = bytes.fromhex(captured.SYSTEM_ANSWERED)[12:], bytes.fromhex(captured.MULTI_ANSWERED)
    if asked[10:12] == b"\0\x03":  # identity: 18, a4, 89
        body = b"\0\3" + system + multi[12:30] + multi[30:62]
        return wire.MAGIC + bytes.fromhex("00042102") + len(body).to_bytes(2, "big") + body
    if asked[10:12] == b"\0\1" and asked[18:20] == b"\0\x56":
        body = b"\0\1" + multi[62:334]
        return wire.MAGIC + bytes.fromhex("00042102") + len(body).to_bytes(2, "big") + body
    return wire.MAGIC + bytes.fromhex("0003210300080000ffef00010000")  # no such number, as a 0i-MD said it


def test_blocks_of_real_controls_are_read_over_a_connection() -> None:
    with answering(real_control) as port:
        backend = EthernetBackend(FocasConfig(port=port, timeout_s=1))
        opened = backend.open()
        assert opened.identity == ("0", "M", "D5F3", "11.0", ("X", "Y", "Z", "B"))
        (loads,) = backend.ask([Request(Call.SERVO_LOAD)])
        assert [one.value for one in loads.found] == [0, -3, 33, 0]
        backend.close()


def test_a_question_that_spoils_its_frame_is_asked_alone_from_then_on() -> None:
    frames: list[bytes] = []

    def reply(asked: bytes) -> bytes:
        frames.append(asked)
        return real_control(asked)

    with answering(reply) as port:
        backend = EthernetBackend(FocasConfig(port=port, timeout_s=1))
        backend.open()
        requests = [Request(Call.SERVO_LOAD), Request(Call.OFFSET, "length 999")]
        for _ in range(2):
            loads, offset = backend.ask(requests)
            assert (loads.code, offset.code) == (0, NUMBER)
        backend.close()
    asked = [int.from_bytes(frame[10:12], "big") for frame in frames if frame[6:8] == b"\x21\x01"]
    assert asked == [3, 2, 1, 1, 1, 1]  # who, both (refused), each; then at once each


def test_closing_from_another_thread_wakes_a_call() -> None:
    with FocasServer(SimulatedControl([STATE])) as server:
        backend = EthernetBackend(FocasConfig(port=server.port, timeout_s=60))
        backend.open()
        server.faults.hang = True
        closer = threading.Timer(0.1, backend.close)
        closer.start()
        began_s = time.monotonic()
        assert backend.ask([STATUS])[0].code == SOCKET
        assert time.monotonic() - began_s < 45.0, "the call would wait for 60 s"
        closer.join()
