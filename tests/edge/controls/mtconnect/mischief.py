"""What goes wrong between an agent and an edge, as episodes: each kind equally often, in an order that chance decides."""

import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

from tests.edge.controls.mtconnect.agent_documents import error
from tests.edge.controls.mtconnect.faulty_link import Fault, FaultyLink, http

OVERRUN_S = (35.0, 60.0)  # longer than the agent's buffer
_INSTANCE = re.compile(rb'instanceId="\d')
_LENGTH = re.compile(rb"(Content-length: \d*)(\d)\r\n")


class Shop(Protocol):
    """What can be done to."""

    link: FaultyLink

    def stop(self) -> None: ...
    def go(self) -> None: ...
    def restart(self) -> None: ...
    def lose_adapter(self) -> None: ...
    def find_adapter(self) -> None: ...


def _heal(shop: Shop) -> None:
    shop.link.fault = Fault()


@dataclass(frozen=True)
class Episode:
    """One fault: how long it lasts for the machine, and for how long of our time it is there at least."""

    name: str
    lasts_s: float
    real_s: float
    begin: Callable[[Shop], None]
    end: Callable[[Shop], None] = _heal


def episodes(chance: random.Random) -> Iterator[Episode]:
    """Without end."""
    kinds = [killed, restarted, hung, slow, wrong, wrong, partial, overrun, adapter_lost, changed]
    while True:
        for kind in chance.sample(kinds, len(kinds)):
            yield kind(chance)


def killed(chance: random.Random) -> Episode:
    return Episode("killed", chance.uniform(0.3, 20.0), 0.03, lambda shop: shop.stop(), lambda shop: shop.go())


def restarted(chance: random.Random) -> Episode:
    def anew(shop: Shop) -> None:
        shop.restart()
        shop.go()

    if chance.random() < 0.3:
        return Episode("restarted: at once", 0.0, 0.02, lambda shop: shop.restart())
    return Episode("restarted", chance.uniform(0.3, 20.0), 0.03, lambda shop: shop.stop(), anew)


def hung(chance: random.Random) -> Episode:
    """It stalls, often in the middle of a part; the edge gives it up after 0.3 s."""
    fault, real_s = Fault(passes=chance.choice([0, 1, 80, 700, 3000])), chance.choice([0.05, 0.38])
    return Episode(f"hung: after {fault.passes} bytes", chance.uniform(0.5, 20.0), real_s, _broken(fault, cuts=False))


def slow(chance: random.Random) -> Episode:
    fault = Fault(piece_bytes=chance.choice([500, 2000]), delay_s=0.002)
    return Episode("slow", chance.uniform(5.0, 30.0), 0.03, _broken(fault, cuts=False))


def partial(chance: random.Random) -> Episode:
    """Return what comes is cut into small pieces, or the connection ends in the middle of one."""
    if chance.random() < 0.5:
        pieces = Fault(piece_bytes=chance.choice([17, 101, 333]))
        return Episode("partial: pieces", chance.uniform(2.0, 10.0), 0.02, _broken(pieces, cuts=False))
    fault = Fault(passes=chance.choice([0, 40, 400, 1500, 5000]), cuts=True, resets=chance.random() < 0.5)
    return Episode(f"partial: {fault.passes} bytes", chance.uniform(0.5, 10.0), 0.03, _broken(fault, cuts=False))


def wrong(chance: random.Random) -> Episode:
    what, fault = chance.choice(
        [
            ("garbage", Fault(answer=lambda _: http("200 OK", b"\x00\xff<<MTConnectStreams"))),
            ("page", Fault(answer=lambda _: http("200 OK", b"<html><body>log in first</body></html>", "text/html"))),
            ("empty", Fault(answer=lambda _: http("200 OK", b""))),
            ("HTTP 500", Fault(answer=lambda _: http("500 Internal Server Error", b"<h1>oh</h1>", "text/html"))),
            ("HTTP 503", Fault(answer=lambda _: http("503 Service Unavailable", b""))),
            ("refuses", Fault(answer=lambda _: http("200 OK", error("INTERNAL_ERROR", "the disk is full", instance="")))),
            ("no device", Fault(answer=lambda _: http("404 Not Found", error("NO_DEVICE", instance="")))),
            ("out of range", Fault(answer=lambda _: http("404 Not Found", error("OUT_OF_RANGE", instance="")))),
            ("stranger", Fault(answer=lambda _: http("200 OK", error("OUT_OF_RANGE", instance="9000000000")))),
            ("too short", Fault(answer=lambda _: http("200 OK", b"<MTConnectStreams>", length=9000))),
            ("no multipart", Fault(answer=lambda _: http("200 OK", b"--x\r\n", "multipart/x-mixed-replace"))),
        ]
    )
    return Episode(f"wrong: {what}", chance.uniform(0.3, 15.0), 0.03, _broken(fault, cuts=True))


def changed(chance: random.Random) -> Episode:
    """Bytes of the agent's documents are changed: torn, of a wrong length, or as if another instance had answered."""
    changes: list[tuple[str, Callable[[bytes], bytes]]] = [
        ("torn", lambda data: data.replace(b"</", b"<<")),
        ("length", lambda data: _LENGTH.sub(lambda found: found[1] + (b"7" if found[2] == b"1" else b"1") + b"\r\n", data)),
        ("instance", lambda data: _INSTANCE.sub(b'instanceId="9', data)),
        ("instance", _once(lambda data: _INSTANCE.sub(b'instanceId="9', data))),
    ]
    what, change = chance.choice(changes)
    return Episode(f"changed: {what}", chance.uniform(0.3, 10.0), 0.03, _broken(Fault(change=change), cuts=False))


def overrun(chance: random.Random) -> Episode:
    return Episode("overrun", chance.uniform(*OVERRUN_S), 0.03, lambda shop: shop.stop(), lambda shop: shop.go())


def adapter_lost(chance: random.Random) -> Episode:
    lasts_s = chance.uniform(0.5, 15.0)
    return Episode("adapter lost", lasts_s, 0.0, lambda shop: shop.lose_adapter(), lambda shop: shop.find_adapter())


def _broken(fault: Fault, *, cuts: bool) -> Callable[[Shop], None]:
    def begin(shop: Shop) -> None:
        shop.link.fault = fault
        if cuts:
            shop.link.cut()

    return begin


def _once(change: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    """Changes the first bytes that it can change, and no others."""
    done = list[bool]()

    def change_once(data: bytes) -> bytes:
        after = data if done else change(data)
        if after != data:
            done.append(True)
        return after

    return change_once
