"""One stream of server-sent events as an HTTP response.

It ends when the client goes, when the reader was let go because it does not keep up, when a send takes longer than `SEND_S_MAX`,
or when the server stops. The client (`EventSource`) comes back by itself and is told the whole state again.
"""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

KEEP_ALIVE_S = 15.0
SEND_S_MAX = 10.0
RETRY_MS = 1000


class EventStream(Response):
    """`first` is sent at once, then what `following` gives, until it gives None. `close` is called at the end."""

    media_type = "text/event-stream"

    def __init__(self, first: bytes, following: Callable[[], Awaitable[bytes | None]], close: Callable[[], None]) -> None:
        super().__init__(headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"})
        del self.headers["content-length"]
        self._following, self._close = following, close
        self._first = b"retry: %d\n\n" % RETRY_MS + first

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send until somebody ends it."""
        told = asyncio.ensure_future(self._tell(send))
        gone = asyncio.ensure_future(_client_gone(receive))
        try:
            await asyncio.wait((told, gone), return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._close()
            for task in (told, gone):
                task.cancel()
                with suppress(asyncio.CancelledError, OSError, TimeoutError):
                    await task

    async def _tell(self, send: Send) -> None:
        await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
        payload: bytes | None = self._first
        while payload is not None:
            await asyncio.wait_for(send({"type": "http.response.body", "body": payload, "more_body": True}), SEND_S_MAX)
            try:
                payload = await asyncio.wait_for(self._following(), KEEP_ALIVE_S)
            except TimeoutError:
                payload = b": still here\n\n"
        await send({"type": "http.response.body", "body": b"", "more_body": False})


async def _client_gone(receive: Receive) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
