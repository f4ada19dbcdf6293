"""Each fault that can be switched on, as a client sees it."""

import struct
import time

import pytest

from cnctwin.standins.focas_server.faults import Refusal, Wrong
from tests.cnctwin.standins.focas_server.client import RawClient, ask, command
from tests.cnctwin.standins.focas_server.moments import Serve


def test_while_it_hangs_nothing_comes_and_afterwards_the_late_answer(serve: Serve) -> None:
    server = serve()
    with RawClient(server.port) as client:
        server.faults.hang = True
        client.socket.settimeout(0.1)
        client.socket.sendall(command((1, 0x1D)))
        with pytest.raises(TimeoutError):
            client.take()
        server.faults.hang = False
        client.socket.settimeout(30.0)
        assert len(client.take()) == 10 + 2 + 16 + 4


def test_clients_that_gave_up_while_it_hung_do_not_keep_their_sessions(serve: Serve) -> None:
    server = serve()
    server.faults.hang = True
    for _ in range(5):
        with pytest.raises(TimeoutError):
            RawClient(server.port, timeout_s=0.02)
    server.faults.hang = False
    until_s = time.monotonic() + 30.0
    while server.clients and time.monotonic() < until_s:
        time.sleep(0.005)
    with RawClient(server.port) as client:
        assert ask(client, (1, 0x1D))[0].code == 0


def test_slow_answers_are_late_and_right(serve: Serve) -> None:
    server = serve()
    with RawClient(server.port) as client:
        server.faults.delay_s = 0.05
        began_s = time.monotonic()
        assert ask(client, (1, 0x1D))[0].data == struct.pack(">i", 2)
        assert time.monotonic() - began_s >= 0.05


def test_new_clients_are_turned_away_and_those_that_are_there_stay(serve: Serve) -> None:
    server = serve()
    with RawClient(server.port) as client:
        server.faults.refusal = Refusal.CONNECTION
        with RawClient(server.port, is_opened=False) as refused:
            assert refused.is_hung_up()
        server.faults.refusal = Refusal.SESSION
        with RawClient(server.port) as refused:
            assert refused.opened[6:8] == b"\x01\x03"
        assert ask(client, (1, 0x1D))[0].code == 0
        server.faults.clear()
        with RawClient(server.port) as taken:
            assert ask(taken, (1, 0x1D))[0].code == 0


@pytest.mark.parametrize("sent", [0, 9, 10, 31])
def test_an_answer_can_break_off_anywhere(serve: Serve, sent: int) -> None:
    server = serve()
    with RawClient(server.port) as client:
        server.faults.drop_after_bytes = sent
        client.socket.sendall(command((1, 0x1D)))
        assert len(client.socket.recv(100)) == sent
        assert not sent or client.is_hung_up()


def test_some_functions_can_fail_with_a_code_and_the_others_not(serve: Serve) -> None:
    server = serve()
    server.faults.failing = {(1, 0x24): -1, (2, 0x8001): 1}
    with RawClient(server.port) as client:
        answers = ask(client, (1, 0x24), (1, 0x25), (2, 0x8001, 12, 12, 0, 0))
    assert [(block.code, bool(block.data)) for block in answers] == [(-1, False), (0, True), (1, False)]
    assert server.ledger.balances


@pytest.mark.parametrize("wrong", Wrong)
def test_wrong_answers_come_while_the_switch_is_on_only(serve: Serve, wrong: Wrong) -> None:
    server = serve()
    with RawClient(server.port) as client:
        right = client.exchange(command((1, 0x1D), (1, 0x1C)))
        server.faults.wrong = wrong
        client.socket.sendall(command((1, 0x1D), (1, 0x1C)))
        spoiled = client.socket.recv(4096)
        assert spoiled != right
        server.faults.clear()
        assert client.exchange(command((1, 0x1D), (1, 0x1C))) == right
