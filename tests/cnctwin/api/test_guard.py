"""The guard counts what a client has under way, and lets go of the count however a request ends."""

import asyncio

import httpx
import pytest
from starlette.types import Receive, Scope, Send

from cnctwin.api import guard
from cnctwin.api.access import Access
from cnctwin.api.door.audit import AuditLog
from cnctwin.api.errors import error_response
from cnctwin.api.failures import Failures
from cnctwin.api.guard import Guard


async def ask(through: Guard, peer: str) -> int:
    transport = httpx.ASGITransport(app=through, client=(peer, 1), raise_app_exceptions=False)
    async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
        return (await client.get("/machines")).status_code


def test_what_one_client_has_under_way_is_limited_and_ends_with_its_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "UNDER_WAY_MAX", 3)

    async def run() -> None:
        open_door = asyncio.Event()

        async def app(scope: Scope, receive: Receive, send: Send) -> None:
            await open_door.wait()
            if scope["client"][0] == "10.0.0.9":
                raise RuntimeError("a bug of the application")
            await error_response(200, "well")(scope, receive, send)

        through = Guard(app, Access(), Failures(), AuditLog())
        waiting = [asyncio.create_task(ask(through, "10.0.0.7")) for _ in range(3)]
        failing = asyncio.create_task(ask(through, "10.0.0.9"))
        while sum(through._under_way.values()) < 4:
            await asyncio.sleep(0)
        assert await ask(through, "10.0.0.7") == 503
        other = asyncio.create_task(ask(through, "10.0.0.8"))
        open_door.set()
        assert [await one for one in (*waiting, other, failing)] == [200, 200, 200, 200, 500]
        assert await ask(through, "10.0.0.7") == 200
        assert not through._under_way

    asyncio.run(run())
