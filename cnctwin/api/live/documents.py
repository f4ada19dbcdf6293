"""Retained documents of the broker, checked at the door: what does not have its shape is refused in one line.

Whoever may write to a topic may retain anything on it. So a document is JSON of bounded size and depth, without what JSON
cannot hold (NaN, infinity, half a character), and has the keys that are read later, each of its type. Further keys may stand
beside them.
"""

import json
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cnctwin.api.answers import Answer

BYTES_MAX = 4_000_000
DEPTH_MAX = 20
LINE_MAX = 200


class DocumentError(Exception):
    """A document that is refused, with its one line."""


class _Document(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True)


class JobInShort(Answer):
    """A job; times are ms since 1970, UTC."""

    id: str
    kind: str = Field(examples=["optimise"])
    machine: str = ""
    state: str = Field(examples=["running"])
    attempt: int = 0
    progress_pct: float = 0.0
    doing: str = ""
    reason: str = ""
    by: str = Field("", description="who asked for it; empty = somebody without a name")
    caution: str = Field(
        "", description="what its result exceeds; empty = nothing that is known", examples=["2 lines are above a limit"]
    )


class _Result(_Document):
    files: dict[str, Any] = {}


class JobState(JobInShort):
    """A job in full, as the consumer retains it."""

    result: _Result = _Result()


class JobsState(_Document):
    """All jobs in short, as the consumer retains them."""

    at: str
    jobs: list[JobInShort]
    queued: int = 0
    running: str | None = None
    disk_trouble: str | None = None


class JobReply(_Document):
    """The consumer's answer to a request."""

    id: str
    answer: str
    state: str = ""
    place: int | None = None
    reason: str = ""


class _Alert(_Document):
    fingerprint: str
    phase: str
    labels: dict[str, str] = {}
    annotations: dict[str, str] = {}
    severity: str | None = None
    acknowledged_by: str | None = None
    comment: str | None = None
    told: list[str] = []


class _Silence(_Document):
    id: str
    matchers: dict[str, str] = {}


class _Command(_Document):
    id: str
    done: bool
    text: str = ""


class AlertsState(_Document):
    """The alerts processor's state, as it retains it."""

    at: str
    alerts: list[_Alert]
    silences: list[_Silence] = []
    receivers: dict[str, dict[str, Any]] = {}
    failures: list[dict[str, Any]] = []
    commands: list[_Command] = []


def read_document(payload: bytes, shape: type[BaseModel]) -> dict[str, Any]:
    """Return a document as it came, once it is known to have this shape. Raises DocumentError.

    >>> read_document(b'{"at": "2026-11-22T00:00:00Z", "jobs": {}}', JobsState)
    Traceback (most recent call last):
    cnctwin.api.live.documents.DocumentError: jobs: Input should be a valid list
    """
    document = read_object(payload)
    try:
        shape.model_validate(document)
    except ValidationError as error:
        first = error.errors(include_input=False, include_url=False)[0]
        raise DocumentError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}"[:LINE_MAX]) from None
    return document


def read_object(payload: bytes) -> dict[str, Any]:
    """Return a JSON object that can be written as JSON again. Raises DocumentError."""
    if len(payload) > BYTES_MAX:
        raise DocumentError(f"{len(payload)} bytes are above the limit of {BYTES_MAX}")
    try:
        document = json.loads(payload)
        json.dumps(document, ensure_ascii=False, allow_nan=False).encode()
    except (ValueError, RecursionError) as error:
        raise DocumentError(f"no JSON: {error}"[:LINE_MAX]) from None
    if not isinstance(document, dict):
        raise DocumentError(f"a JSON {type(document).__name__}; an object is wanted")
    if not _is_flat(document, DEPTH_MAX):
        raise DocumentError(f"deeper than {DEPTH_MAX} levels")
    return document


def _is_flat(value: Any, levels: int) -> bool:
    if not isinstance(value, dict | list):
        return True
    held = value.values() if isinstance(value, dict) else value
    return levels > 0 and all(_is_flat(one, levels - 1) for one in held)
