"""The server's sessions: how many, what is refused, how it stops and starts, and that nothing that is sent can break it."""

import random
import socket
import struct
import threading
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cnctwin.errors import ApplicationError
from cnctwin.standins.focas_server.functions import FUNCTIONS, WRITES
from cnctwin.standins.focas_server.server import FocasServer
from tests.cnctwin.standins.focas_server import captured
from tests.cnctwin.standins.focas_server.client import RawClient, ask, blocks, command
from tests.cnctwin.standins.focas_server.moments import CHANGING, DESCRIPTION, Serve, control_at


def soon(condition: object, timeout_s: float = 30.0) -> bool:
    """Return whether this comes true."""
    assert callable(condition)
    until_s = time.monotonic() + timeout_s
    while not condition() and time.monotonic() < until_s:
        time.sleep(0.002)
    return bool(condition())


def test_a_session_is_opened_asked_and_closed(serve: Serve) -> None:
    server = serve()
    with RawClient(server.port) as client:
        assert [block.code for block in ask(client, (1, 0x18), (1, 0x19))] == [0, 0]
        assert client.exchange(captured.CLOSE) == captured.CLOSED_31I
        assert client.is_hung_up()
    assert soon(lambda: server.clients == 0)


def test_it_listens_on_loopback_only(serve: Serve) -> None:
    server = serve()
    addresses = {str(info[4][0]) for info in socket.getaddrinfo(socket.gethostname(), server.port, socket.AF_INET)}
    for address in addresses - {"127.0.0.1", "127.0.1.1"}:
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((address, server.port), timeout=1)
    assert server.url == f"focas://127.0.0.1:{server.port}"


def test_a_function_that_it_has_not_got_is_refused_and_the_others_are_answered(serve: Serve) -> None:
    with RawClient(serve().port) as client:
        answers = ask(client, (1, 0x1D), (1, 0x61), (3, 0x18), (2, 0x18), (1, 0x1D))
    assert [block.code for block in answers] == [0, 1, 1, 1, 0]


def test_no_function_writes_and_each_attempt_is_counted(serve: Serve) -> None:
    assert not WRITES.keys() & FUNCTIONS.keys()
    server = serve()
    with RawClient(server.port) as client:
        before = ask(client, (1, 0x15, 500, 501))
        answers = ask(client, *((device, function, 500, 500, 0, 0) for device, function in WRITES))
        answers += blocks(client.exchange(captured.SELECT_PROGRAM)) + blocks(client.exchange(captured.DELETE_PROGRAM))
        assert ask(client, (1, 0x15, 500, 501)) == before
    assert {block.code for block in answers} == {1}
    assert server.ledger["refused/write"] == len(answers) == len(WRITES) + 2
    assert server.ledger.balances


@pytest.mark.parametrize("kind", [0x1101, 0x1201, 0x1301, 0x1501, 0x1702, 0x2102, 0xFFFF])
def test_file_transfer_and_other_frames_end_the_connection(serve: Serve, kind: int) -> None:
    server = serve()
    with RawClient(server.port) as client:
        client.socket.sendall(b"\xa0\xa0\xa0\xa0" + struct.pack(">HHH", 1, kind, 4) + b"O1\0\0")
        assert client.is_hung_up()
    assert server.ledger["malformed"] == 1


def test_a_connection_opened_for_files_takes_no_commands(serve: Serve) -> None:
    with RawClient(serve().port, is_opened=False) as client:
        assert client.exchange(captured.OPEN)
        client.socket.sendall(captured.SYSINFO)
        assert client.is_hung_up()


def test_commands_before_the_open_end_the_connection(serve: Serve) -> None:
    with RawClient(serve().port, is_opened=False) as client:
        client.socket.sendall(captured.SYSINFO)
        assert client.is_hung_up()


def test_the_sixth_session_is_told_that_all_are_in_use_until_one_ends(serve: Serve) -> None:
    server = serve()
    clients = [RawClient(server.port) for _ in range(5)]
    try:
        with RawClient(server.port) as sixth:
            assert sixth.opened.hex().startswith("a0a0a0a0000401030008")
            assert sixth.is_hung_up()
        clients.pop().socket.close()
        assert soon(lambda: server.clients == 4)
        with RawClient(server.port) as seventh:
            assert ask(seventh, (1, 0x1D))[0].code == 0
    finally:
        for client in clients:
            client.socket.close()
    assert server.ledger["sessions refused"] == 1


def test_connections_beyond_the_limit_are_hung_up_on(serve: Serve) -> None:
    server = serve(connections_max=3)
    clients = [RawClient(server.port, is_opened=False) for _ in range(3)]
    assert soon(lambda: server.clients == 3)
    with RawClient(server.port, is_opened=False) as fourth:
        assert fourth.is_hung_up()
    for client in clients:
        client.socket.close()


def test_five_clients_at_once_each_get_their_own_answers(serve: Serve) -> None:
    server, wrong = serve(), list[object]()

    def asks(number: int) -> None:
        with RawClient(server.port) as client:
            for turn in range(60):
                axis = 1 + (number + turn) % 3
                position, count = ask(client, (1, 0x26, 1, axis), (1, 0xA4, 2))
                expected = round(CHANGING.axis_pos_mm[axis - 1] * 1000)
                if struct.unpack(">i", position.data[:4])[0] != expected or count.data != b"\0\3":
                    wrong.append((number, turn, position))

    threads = [threading.Thread(target=asks, args=(number,)) for number in range(5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert server.ledger["answered"] == 5 * 60 * 2
    assert server.ledger.balances


def test_it_stops_at_once_with_clients_that_wait_and_leaves_no_thread() -> None:
    server = FocasServer(control_at(CHANGING), DESCRIPTION)
    server.start()
    with RawClient(server.port) as idle, RawClient(server.port) as hanging:
        server.faults.hang = True
        hanging.socket.sendall(command((1, 0x18)))
        began_s = time.monotonic()
        server.stop()
        assert time.monotonic() - began_s < 5.0
        assert idle.is_hung_up()
        assert hanging.is_hung_up()
    assert not [thread.name for thread in threading.enumerate() if thread.name.startswith("focas-")]
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", server.port), timeout=1)


def test_it_starts_again_on_the_same_port_with_the_same_control(serve: Serve) -> None:
    server = serve()
    port = server.port
    for _ in range(3):
        with RawClient(port) as client:
            assert ask(client, (1, 0x1C))[0].data == struct.pack(">ii", 1701, 1701)
            server.stop()
            server.start()
    assert server.port == port
    assert server.ledger["answered"] == 3


def test_a_port_that_is_taken_is_an_error_of_one_line(serve: Serve) -> None:
    with pytest.raises(ApplicationError, match=r"can't listen on 127\.0\.0\.1 port \d+: .+; give another port, or 0"):
        serve(port=serve().port)


def _mutated(chance: random.Random) -> bytes:
    """A real conversation with some bytes changed, cut off or put in."""
    raw = bytearray(captured.OPEN_FOR_COMMANDS + captured.NINE + captured.LOADS + captured.CLOSE)
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(len(raw))
        raw[at : at + chance.randint(0, 3)] = chance.randbytes(chance.randint(0, 3))
    return bytes(raw)


@pytest.fixture(scope="module")
def long_lived() -> object:
    with FocasServer(control_at(CHANGING), DESCRIPTION) as server:
        yield server


@settings(max_examples=60)
@given(raw=st.one_of(st.binary(max_size=300), st.integers(0, 2**32).map(lambda seed: _mutated(random.Random(seed)))))
def test_whatever_is_sent_it_serves_the_next_client(long_lived: FocasServer, raw: bytes) -> None:
    with socket.create_connection(("127.0.0.1", long_lived.port), timeout=5) as connection:
        try:
            connection.sendall(raw)
            connection.shutdown(socket.SHUT_WR)
            taken = 0
            while part := connection.recv(4096):
                taken += len(part)
        except (ConnectionResetError, BrokenPipeError, OSError):
            taken = 0
        assert taken < 20_000
    with RawClient(long_lived.port) as client:
        assert ask(client, (1, 0x1D))[0].code == 0
    assert soon(lambda: long_lived.clients == 0)
    assert long_lived.ledger.balances


def test_a_body_that_is_too_long_is_refused_before_it_is_read(serve: Serve) -> None:
    server = serve()
    with RawClient(server.port) as client:
        client.socket.sendall(b"\xa0\xa0\xa0\xa0" + struct.pack(">HHH", 1, 0x2101, 0xFFFF))
        assert client.is_hung_up()
    assert server.ledger["malformed"] == 1
