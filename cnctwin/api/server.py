"""uvicorn in a thread of its own, on a socket that was bound before, so that its port is known."""

import socket
import threading
import time
from types import TracebackType
from typing import Self

import uvicorn
from fastapi import FastAPI

from cnctwin.api.door.connection import Connection
from cnctwin.api.i3x.subscriptions import Subscriptions
from cnctwin.api.live.fan_out import FanOut
from cnctwin.errors import ApplicationError, UsageError

KEEP_ALIVE_S = 20
STOP_S_MAX = 3
START_S_MAX = 10.0
UNACKNOWLEDGED_MS_MAX = 30_000


class _StreamServer(uvicorn.Server):
    """Listens no more before it ends the streams: their clients come back at once, and would be let in by the one that stops."""

    def __init__(self, config: uvicorn.Config, *streams: FanOut | Subscriptions) -> None:
        super().__init__(config)
        self._streams = streams

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop, within `STOP_S_MAX` for what is under way."""
        for listener in self.servers:
            listener.close()
        for streams in self._streams:
            streams.end()
        await super().shutdown(sockets)


class Server:
    """Serves an application between `start` and `stop`. `port` 0 takes a free one."""

    def __init__(self, app: FastAPI, host: str = "127.0.0.1", port: int = 0) -> None:
        self._socket = _bound(host, port)

        class OfThisServer(Connection):
            proxy = app.state.sources.access.proxy

        self.host, self.port = host, self._socket.getsockname()[1]
        config = uvicorn.Config(
            app,
            http=OfThisServer,
            access_log=False,  # an address may hold what is nobody's business
            log_level="warning",
            proxy_headers=False,  # who asks is who connects; the proxy is named, not believed
            server_header=False,
            ws="none",
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=STOP_S_MAX,
        )
        self._server = _StreamServer(config, app.state.fan_out, app.state.subscriptions)
        self._thread = threading.Thread(target=self._server.run, args=([self._socket],), name="http", daemon=True)

    @property
    def url(self) -> str:
        """The address at which a browser on this machine finds it."""
        name = "127.0.0.1" if self.host in ("0.0.0.0", "") else "[::1]" if self.host == "::" else self.host  # noqa: S104
        return f"http://[{name}]:{self.port}" if ":" in name and not name.startswith("[") else f"http://{name}:{self.port}"

    @property
    def alive(self) -> bool:
        """True if it serves."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Serve; returns when it does. Raises ApplicationError."""
        self._thread.start()
        deadline_s = time.monotonic() + START_S_MAX
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() > deadline_s:
                raise ApplicationError(f"the server on {self.host}:{self.port} did not start; the lines before say why")
            time.sleep(0.01)

    def stop(self) -> None:
        """End the server and its open streams."""
        self._server.should_exit = True
        self._thread.join(STOP_S_MAX + 5.0)
        self._socket.close()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None) -> None:
        self.stop()


def _bound(host: str, port: int) -> socket.socket:
    """A listening socket. Raises UsageError where the address cannot be had."""
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        # With the protocol named, asyncio sends at once what it is given, instead of waiting for more.
        bound = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    except OSError as error:
        raise UsageError(f"--host {host} is no address of this machine: {error.strerror or error}") from None
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            # Connections inherit it: one whose client reads no more is ended by the kernel, with what waits for it.
            bound.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS_MAX)
        bound.bind(address)
    except OSError as error:
        bound.close()
        raise UsageError(f"port {port} of {host} cannot be had: {error.strerror}; name another one with --port") from None
    return bound
