"""A connection of the server with deadlines and a limit for each address; uvicorn has a deadline for idle connections only.

    begun ──HEADER_S_MAX──▸ headers are whole ──BODY_S_MAX──▸ body is whole ──▸ answered ──keep-alive──▸ begun again

A connection that misses a deadline is closed. So is one that goes on with a body `LINGER_S_MAX` after it was answered: what it
sends until then is read and thrown away, since a connection that is closed with unread bytes may lose its answer.

Where an address, or all together, have as many connections as there may be, the oldest that asks for nothing makes room for a new
one. So whoever opens connections and stays silent shuts out neither others nor people at the same address.
"""

import asyncio
from collections import Counter
from collections.abc import Iterable
from typing import Any, ClassVar

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from cnctwin.api.access import same_address, sender

CONNECTIONS_MAX = 300
OF_ONE_MAX = 64
HEADER_S_MAX = 10.0
BODY_S_MAX = 30.0
LINGER_S_MAX = 2.0
_FULL = b'{"error": "too many connections; close some, or ask again in a moment"}'
_REFUSAL = (
    b"HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/json\r\nRetry-After: 2\r\nConnection: close\r\n"
    b"Content-Length: %d\r\n\r\n%s" % (len(_FULL), _FULL)
)


class Connection(H11Protocol):
    """One connection. `proxy` is the address of a reverse proxy, whose connections are limited together with all others only."""

    proxy: ClassVar[str | None] = None

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.sender = ""
        self.heard_s = 0.0
        self._deadline: asyncio.TimerHandle | None = None
        self._is_in_body = False

    @property
    def is_open(self) -> bool:
        """True until it is closed or closing."""
        return not self.transport.is_closing()

    @property
    def is_idle(self) -> bool:
        """True while it asks for nothing: there is no request of it that was begun to be answered."""
        return self.cycle is None or self.cycle.response_complete

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, and close another one for it where there are too many; refuse it where none can be closed."""
        super().connection_made(transport)
        self.sender = sender(self.client[0]) if self.client else ""
        self.heard_s = self.loop.time()
        if not self._finds_room():
            transport.write(_REFUSAL)
            transport.close()
            return
        self._within(HEADER_S_MAX)

    def data_received(self, data: bytes) -> None:
        """Take bytes, and set the deadline for what has to follow them."""
        self.heard_s = self.loop.time()
        super().data_received(data)
        if not self.is_open:
            return
        if self.conn.their_state is h11.SEND_BODY:
            self._await_body()
        elif self.conn.their_state is h11.IDLE and self.is_idle:
            if self._is_in_body or self._deadline is None:  # a body that nobody wanted has ended, or a further request begins
                self._is_in_body = False
                self._within(HEADER_S_MAX)
        else:
            self._is_in_body = False
            self._forget_deadline()

    def on_response_complete(self) -> None:
        """Go on to the next request, or wait a moment for the rest of a body that nobody wants."""
        is_unread = self.conn.their_state is h11.SEND_BODY
        super().on_response_complete()
        if not self.is_open:
            return
        if is_unread:
            self._is_in_body = True
            self._within(LINGER_S_MAX)
        elif self.conn.their_state is h11.SEND_BODY:
            self._await_body()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the deadline."""
        self._forget_deadline()
        super().connection_lost(exc)

    def _finds_room(self) -> bool:
        """Return True if this connection may stay; close an idle one for it where it has to."""
        others = [one for one in self.connections if isinstance(one, Connection) and one is not self and one.is_open]
        own = [one for one in others if one.sender == self.sender]
        is_proxy = self.proxy is not None and self.client is not None and same_address(self.client[0], self.proxy)
        if len(own) >= OF_ONE_MAX and not is_proxy:
            return _closes_one(own)
        if len(others) >= CONNECTIONS_MAX:
            counts = Counter(one.sender for one in others)
            return any(_closes_one([one for one in others if one.sender == name]) for name, _ in counts.most_common())
        return True

    def _await_body(self) -> None:
        if not self._is_in_body:
            self._is_in_body = True
            self._within(BODY_S_MAX)

    def _within(self, seconds: float) -> None:
        self._forget_deadline()
        self._deadline = self.loop.call_later(seconds, self._missed)

    def _forget_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _missed(self) -> None:
        self._deadline = None
        self.transport.close()


def _closes_one(held: Iterable[Connection]) -> bool:
    """Close the connection that asks for nothing and was not heard for longest; False where all ask for something."""
    idle = [one for one in held if one.is_idle]
    if not idle:
        return False
    min(idle, key=lambda one: one.heard_s).transport.close()
    return True
