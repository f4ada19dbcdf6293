"""POST /demo/reveal: opens the seal of the effect that the demo hides in its machine, for everybody who looks."""

from typing import Any

from fastapi import APIRouter, Request
from pydantic import BaseModel, Field

from cnctwin.api.answers import Answer, Problem
from cnctwin.api.envelope import Envelope
from cnctwin.api.errors import ApiError


class Revealed(Answer):
    """The sealed text, opened. SHA-256 of `salt`, a line feed and `text` is the hash that was shown from the start."""

    added: dict[str, Any] = Field(description="the effect, as a machine file has it")
    equation: str
    parameters: dict[str, dict[str, Any]]
    salt: str
    text: str


class SealedEffect(BaseModel):
    """The hidden effect of the demo's machine: its hash from the start, and what it is once somebody has revealed it."""

    sha256: str
    revealed: Revealed | None = None


def sealed_routes(envelope: Envelope) -> APIRouter:
    """The routes."""
    router = APIRouter(tags=["demo"])

    @router.post("/demo/reveal", response_model=SealedEffect, responses={404: {"model": Problem}})
    async def reveal(request: Request) -> Any:
        """Reveal the effect that is hidden in the demo's machine. It cannot be hidden again."""
        if not envelope.exists:
            raise ApiError(404, "nothing is hidden here; `cnctwin demo` hides an effect in its simulated machine")
        envelope.open()
        shown = envelope.shown()
        request.state.object = shown["sha256"][:12] if shown else ""
        return shown

    return router
