"""GET /whoami and /audit: who asks and what they may, and who did what."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from pydantic import Field

from cnctwin.api.access import Access
from cnctwin.api.answers import Answer, Problem
from cnctwin.api.door.audit import REMEMBERED_MAX, AuditLog
from cnctwin.api.door.role import Role


class Me(Answer):
    """The person who asks, and what their role may do."""

    user: str | None = Field(description="null where users have no names: on loopback, or with the one token", examples=["ada"])
    role: str = Field(description="reader, operator or administrator", examples=["operator"])
    logs_out: bool = Field(description="whether there is a session to end")


class DeedDone(Answer):
    """A line of the record."""

    at: str = Field(examples=["2026-11-22T10:00:00.000Z"])
    user: str = Field(examples=["ada"])
    role: str = Field(examples=["operator"])
    address: str = Field(examples=["10.0.0.7"])
    action: str = Field(examples=["acknowledge"])
    object: str = Field(examples=["ea33a6"])
    outcome: str = Field(description="`done`, or the refusal", examples=["done"])


class Audit(Answer):
    """The newest lines, the newest first."""

    file: str | None = Field(description="where the older ones are; null = kept in memory only")
    trouble: str
    deeds: list[DeedDone]


def people_routes(access: Access, audit: AuditLog) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["people"])

    @router.get("/whoami", response_model=Me)
    async def whoami(request: Request) -> Any:
        """Name and role of who asks."""
        role: Role = request.state.role
        is_proxied = access.is_proxy(request.client.host if request.client else "")
        return {"user": request.state.user, "role": role.title, "logs_out": access.has_tokens and not is_proxied}

    @router.get("/audit", response_model=Audit, responses={403: {"model": Problem}})
    async def deeds(limit: Annotated[int, Query(ge=1, le=REMEMBERED_MAX)] = 100) -> Any:
        """The record of who did what, for administrators."""
        file = None if audit.file is None else str(audit.file)
        found = [one for one in audit.newest(limit) if DeedDone.model_fields.keys() <= one.keys()]
        return {"file": file, "trouble": audit.trouble, "deeds": found}

    return router
