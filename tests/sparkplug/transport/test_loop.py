"""The loop: who turns it, what it sends together, how many it serves."""

from __future__ import annotations

import os
import resource
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from sparkplug.transport.loop import DRIVEN_S, TICK_S, Loop

PATIENCE_S = 5.0


class Counting:
    """A connection that notes what the loop asks of it, and in which thread."""

    def __init__(self, descriptor: int = -1) -> None:
        self.descriptor = descriptor
        self.read: list[bytes] = []
        self.threads: list[int] = []
        self.flushed = self.served = self.ticked = 0
        self.on_read: Callable[[], None] = lambda: None

    def ready(self, *, readable: bool, writable: bool) -> None:
        self.threads.append(threading.get_ident())
        self.read.append(os.read(self.descriptor, 4096))
        self.on_read()

    def flush(self) -> None:
        self.flushed += 1

    def serve(self) -> None:
        self.served += 1
        self.threads.append(threading.get_ident())

    def tick(self, now_s: float) -> None:
        self.ticked += 1


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    here, there = os.pipe()
    yield here, there
    os.close(here)
    os.close(there)


@pytest.fixture
def looped(pipe: tuple[int, int]) -> Iterator[tuple[Loop, Counting]]:
    """A loop that serves the reading end of the pipe."""
    loop, served = Loop(), Counting(pipe[0])
    loop.add(served)
    loop.watch(pipe[0], served, for_writing=False)
    yield loop, served
    loop.unwatch(pipe[0])
    loop.remove(served)
    loop.join(PATIENCE_S)
    assert not [thread for thread in threading.enumerate() if thread.name == "mqtt"]


def wait_until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.005)


def test_whoever_turns_the_loop_reads(looped: tuple[Loop, Counting], pipe: tuple[int, int]) -> None:
    loop, served = looped
    assert loop.turn(0.0)
    os.write(pipe[1], b"one")
    while not served.read:
        assert loop.turn(PATIENCE_S)
    assert (served.read, served.threads) == ([b"one"], [threading.get_ident()])


def test_the_loops_own_thread_reads_where_nobody_turns(looped: tuple[Loop, Counting], pipe: tuple[int, int]) -> None:
    loop, served = looped
    assert loop.turn(0.0)
    os.write(pipe[1], b"one")
    wait_until(lambda: bool(served.read))
    assert threading.get_ident() not in served.threads
    assert loop.turn(0.0), "and steps aside for whoever turns again"
    wait_until(lambda: loop.turn(0.01) and served.ticked > 0)


def test_what_a_driver_sends_waits_for_its_next_turn(looped: tuple[Loop, Counting]) -> None:
    loop, served = looped
    assert loop.turn(0.0)
    for _ in range(3):
        loop.push(served, now=False)
    assert (served.flushed, served.served) == (0, 0)
    assert loop.turn(0.0)
    assert (served.flushed, served.served) == (0, 1)
    loop.push(served, now=True)
    assert served.flushed == 1, "much has gathered"


def test_what_a_driver_sends_that_never_turns_again_goes_out_all_the_same(looped: tuple[Loop, Counting]) -> None:
    loop, served = looped
    assert loop.turn(0.0)
    loop.push(served, now=False)
    wait_until(lambda: served.served > 0)
    assert threading.get_ident() not in served.threads


def test_what_another_thread_sends_goes_out_at_once(looped: tuple[Loop, Counting]) -> None:
    loop, served = looped
    assert loop.turn(0.0)
    sender = threading.Thread(target=loop.push, args=(served,), kwargs={"now": False})
    sender.start()
    sender.join()
    assert served.flushed + served.served == 1


def test_two_drivers_do_not_wait_for_each_other(looped: tuple[Loop, Counting]) -> None:
    loop, _ = looped
    turned: list[bool] = []
    in_turn = threading.Event()
    waiting = threading.Thread(target=lambda: (in_turn.set(), turned.append(loop.turn(10 * TICK_S))))
    assert loop.turn(0.0)
    waiting.start()
    in_turn.wait()
    wait_until(lambda: loop._is_driven or not waiting.is_alive())
    if waiting.is_alive():
        began_s = time.monotonic()
        loop.turn(0.0)
        assert time.monotonic() - began_s < TICK_S
    waiting.join()
    assert turned == [True]


def test_what_comes_within_the_gathering_time_is_read_together(looped: tuple[Loop, Counting], pipe: tuple[int, int]) -> None:
    loop, served = looped
    assert loop.turn(0.0)
    os.write(pipe[1], b"a")
    while not served.read:
        assert loop.turn(PATIENCE_S, 0.5)
    os.write(pipe[1], b"b")
    later = threading.Timer(0.1, os.write, (pipe[1], b"c"))
    later.start()
    while len(served.read) < 2:
        assert loop.turn(PATIENCE_S, 0.5)
    later.join()
    assert served.read == [b"a", b"bc"]


def test_a_first_message_after_a_pause_is_not_held_back(looped: tuple[Loop, Counting], pipe: tuple[int, int]) -> None:
    loop, served = looped
    while not loop.turn(0.0):  # from now on the loop's own thread steps aside
        pass
    os.write(pipe[1], b"a")
    began_s = time.monotonic()
    while not served.read:
        assert loop.turn(PATIENCE_S, 60.0)
    assert time.monotonic() - began_s < PATIENCE_S


def test_an_idle_loop_sleeps(looped: tuple[Loop, Counting]) -> None:
    loop, _ = looped
    time.sleep(2 * DRIVEN_S)
    thread = loop._thread
    assert thread is not None and thread.native_id is not None
    switches = [voluntary_switches(thread.native_id)]
    time.sleep(1.0)
    switches.append(voluntary_switches(thread.native_id))
    assert switches[1] - switches[0] <= 1.0 / TICK_S + 5


def voluntary_switches(thread_id: int) -> int:
    with open(f"/proc/self/task/{thread_id}/status", encoding="ascii") as status:  # noqa: PTH123 — not a file of ours
        return next(int(line.split()[1]) for line in status if line.startswith("voluntary"))


def test_a_loop_that_has_served_all_can_serve_again(pipe: tuple[int, int]) -> None:
    loop = Loop()
    for text in (b"one", b"two"):
        served = Counting(pipe[0])
        loop.add(served)
        loop.watch(pipe[0], served, for_writing=False)
        os.write(pipe[1], text)
        wait_until(lambda served=served: bool(served.read))
        loop.unwatch(pipe[0])
        loop.remove(served)
        loop.join(PATIENCE_S)
        assert served.read == [text]
        assert not loop.turn(0.0)


def test_waiting_knows_descriptors_above_1023() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 1_200), hard))
    held = [os.dup(0) for _ in range(1_100)]
    here, there = os.pipe()
    loop, served = Loop(), Counting(here)
    try:
        assert here > 1_023
        loop.add(served)
        loop.watch(here, served, for_writing=False)
        assert loop.turn(0.0)
        assert not served.read
        os.write(there, b"x")
        assert loop.turn(1.0)
        assert served.read == [b"x"]
    finally:
        loop.unwatch(here)
        loop.remove(served)
        loop.join(5.0)
        for descriptor in (*held, here, there):
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
