"""A peer whose program runs beside ours, or not: what both kinds of pairings share."""

from __future__ import annotations

import json
from typing import Any

from tests.peers.pairing import Peer
from tests.peers.process import PeerProcess
from tests.peers.toolchain import command_of


class Counterpart:
    """A peer of which a program is running, or not."""

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        self.process: PeerProcess | None = None

    @property
    def theirs(self) -> PeerProcess:
        """The peer's program."""
        assert self.process is not None
        return self.process

    def begin(self, *arguments: str) -> None:
        """Run the peer's program."""
        command, folder = command_of(self.peer.name)
        self.process = PeerProcess([*command, *arguments], folder)

    def end(self) -> None:
        """Kill the peer's program."""
        if self.process is not None:
            self.process.kill()
            self.process = None

    def tell(self, **line: Any) -> None:
        """Write a line to the program."""
        self.theirs.tell(json.dumps(line))
