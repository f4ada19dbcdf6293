"""The loop: who turns it, what it sends together, how many it serves."""

import os
import resource

from sparkplug.transport.loop import Loop


class Counting:
    """A connection that counts what the loop asks of it."""

    def __init__(self) -> None:
        self.readable = self.flushed = self.served = self.ticked = 0

    def ready(self, *, readable: bool, writable: bool) -> None:
        self.readable += readable

    def flush(self) -> None:
        self.flushed += 1

    def serve(self) -> None:
        self.served += 1

    def tick(self, now_s: float) -> None:
        self.ticked += 1


def test_waiting_knows_descriptors_above_1023() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 1_200), hard))
    held = [os.dup(0) for _ in range(1_100)]
    loop, served = Loop(), Counting()
    here, there = os.pipe()
    try:
        assert here > 1_023
        loop.add(served)
        loop.watch(here, served, for_writing=False)
        assert loop.turn(0.0)
        assert served.readable == 0
        os.write(there, b"x")
        assert loop.turn(1.0)
        assert served.readable == 1
    finally:
        loop.unwatch(here)
        loop.remove(served)
        loop.join(5.0)
        for descriptor in (*held, here, there):
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
