"""The thread that edges share: turns when they are due, readers when their sockets can be read."""

import socket
import threading
import time
from collections.abc import Callable

from edge.adapter import Wait
from edge.running.driver import TURN_S, Driver


def wait(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.005)


class Edge:
    """Notes when it had its turns, and in which thread."""

    def __init__(self, pause_s: float = TURN_S) -> None:
        self.pause_s, self.turns, self.threads = pause_s, list[float](), set[int]()

    def turn(self) -> float:
        self.turns.append(time.monotonic())
        self.threads.add(threading.get_ident())
        return self.pause_s


class Echo:
    """A reader of a socket, which notes what it was resumed for; it goes on by itself at "end"."""

    def __init__(self, sock: socket.socket, seconds: float = 60.0) -> None:
        self.sock, self.seconds, self.heard = sock, seconds, list[bytes]()
        sock.setblocking(False)

    def resume(self) -> Wait | None:
        try:
            self.heard.append(self.sock.recv(1000))
        except BlockingIOError:
            self.heard.append(b"nothing")
        return None if self.heard[-1] in (b"end", b"") else Wait(self.sock, self.seconds)


def test_each_edge_has_its_turns_in_one_thread_and_none_after_it_was_removed(driver: Driver) -> None:
    edges = [Edge() for _ in range(3)]
    for edge in edges:
        driver.add(edge)
    wait(lambda: all(len(edge.turns) > 3 for edge in edges))
    assert len(set.union(*(edge.threads for edge in edges))) == 1
    driver.remove(edges[0])
    had = len(edges[0].turns)
    others = len(edges[1].turns)
    wait(lambda: len(edges[1].turns) > others + 2)
    assert len(edges[0].turns) == had
    assert min(after - before for before, after in zip(edges[1].turns, edges[1].turns[1:], strict=False)) > 0.9 * TURN_S


def test_an_edge_says_when_its_next_turn_is(driver: Driver) -> None:
    hurried, calm = Edge(0.01), Edge(30.0)
    driver.add(hurried)
    driver.add(calm)
    wait(lambda: len(hurried.turns) > 20)
    assert len(calm.turns) == 1


def test_a_turn_is_over_when_its_edge_is_removed(driver: Driver) -> None:
    class Slow(Edge):
        is_at_work = False

        def turn(self) -> float:
            self.is_at_work = True
            time.sleep(0.2)
            self.is_at_work = False
            return super().turn()

    slow = Slow()
    driver.add(slow)
    wait(lambda: slow.is_at_work)
    driver.remove(slow)
    assert not slow.is_at_work


def test_a_reader_goes_on_when_its_socket_can_be_read_until_it_goes_on_by_itself(driver: Driver) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        echo = Echo(ours)
        driver.watch(echo, Wait(ours, 60.0))
        for text in (b"one", b"two", b"end"):
            theirs.send(text)
            wait(lambda text=text: echo.heard[-1:] == [text])  # type: ignore[misc]
        theirs.send(b"three")
        time.sleep(3 * TURN_S)
        assert echo.heard == [b"one", b"two", b"end"]


def test_a_reader_whose_time_is_over_goes_on_too(driver: Driver) -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        echo = Echo(ours, 0.05)
        driver.watch(echo, Wait(ours, 0.05))
        wait(lambda: len(echo.heard) > 2)
        assert set(echo.heard) == {b"nothing"}
        theirs.close()
        wait(lambda: echo.heard[-1] == b"")


def test_many_who_ask_at_once_are_all_served_by_a_busy_thread(driver: Driver) -> None:
    driver.add(Edge(0.0))  # always due
    edges = [Edge() for _ in range(50)]
    threads = [threading.Thread(target=driver.add, args=(edge,)) for edge in edges]
    for thread in threads:
        thread.start()
    wait(lambda: all(edge.turns for edge in edges))
    for edge in edges:
        driver.remove(edge)
    for thread in threads:
        thread.join()
