"""The peers and what is known of them (pairings.toml): their roles, what they lack, where they break the specification."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import pytest

from tests.deploy.plant import need_programs
from tests.depth import IS_FULL
from tests.hivemq.hivemq import HiveMQ, built
from tests.wire.mosquitto import Mosquitto, find_mosquitto

KNOWN = tomllib.loads((Path(__file__).parent / "pairings.toml").read_text())
PATIENCE_S = 60.0
QUIET_S = 2.0
WRAP = 600
DEVICE = "lathe"
FAULT_S = 4.0
"""The time that a known fault may take to show."""


class Broker(Protocol):
    """A broker that can be started again."""

    @property
    def address(self) -> tuple[str, int]:
        """The address at which clients connect."""

    def restart(self) -> None:
        """End it and start it again on the same port."""


@dataclass(frozen=True)
class Peer:
    """A peer in one role."""

    name: str
    version: str
    role: str
    lacks: Mapping[str, str]
    """The things that the package does not offer, by check: not tried."""
    faults: Mapping[str, str]
    """The faults of the peer against the specification, by check: tried, and has to fail."""
    types_lacking: tuple[str, ...]
    not_on: Mapping[str, str]
    """The brokers on which a fault of the peer leaves nothing to check."""

    def __str__(self) -> str:
        return self.name


def peers(role: str) -> list[Peer]:
    """Return the peers that have a role."""
    return [
        Peer(
            name,
            known["version"],
            role,
            known[role].get("lacks", {}),
            known[role].get("faults", {}),
            tuple(known.get("types_lacking", ())),
            known[role].get("not_on", {}),
        )
        for name, known in KNOWN.items()
        if role in known
    ]


@contextmanager
def broker_of(name: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Broker]:
    """A broker of its own for a pairing; HiveMQ only with CNCTWIN_FULL=1, since each takes seconds to start."""
    with ExitStack() as stack:
        if name == "mosquitto":
            if find_mosquitto() is None:
                pytest.skip("no mosquitto on this machine; install the package mosquitto")
            yield stack.enter_context(Mosquitto())
        else:
            built()
            need_programs()
            yield stack.enter_context(HiveMQ(tmp_path_factory.mktemp("hivemq")))


def pairs(role: str) -> list[tuple[Peer, str]]:
    """Return the peers that have a role, each with the brokers that it is tried on."""
    brokers = ["mosquitto", "hivemq"] if IS_FULL else ["mosquitto"]
    return [(peer, broker) for peer in peers(role) for broker in brokers if broker not in peer.not_on]


def judge(peer: Peer, check: str, run: Callable[[float], None]) -> None:
    """Run a check with its patience: it holds, or it fails where the peer is known to be at fault."""
    if check not in peer.faults:
        run(PATIENCE_S)
        return
    with pytest.raises((AssertionError, TimeoutError, EOFError)):
        run(FAULT_S)
