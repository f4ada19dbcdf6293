"""The loops of the machines as last heard: a document each, as `cnctwin twin run` retains it."""

import threading
from typing import Any

from pydantic import Field

from cnctwin.api.answers import Answer
from cnctwin.api.live.documents import read_document
from twin.vocabulary.topics import LOOP

MACHINES_MAX = 5000


class LoopAnswer(Answer):
    """The answer to a request."""

    id: str
    request: str
    done: bool
    text: str
    t: int


class LoopDocument(Answer):
    """The loop of a machine as it stands (docs/how-to/loop.md); times are ms since 1970, UTC, gaps in floors."""

    machine: str = Field(examples=["vmc"])
    step: str | None = Field(description="watching, composing, diagnosing, shadow, promoted or refused", examples=["shadow"])
    since: int = 0
    text: str = ""
    progress: float | None = None
    case: str | None = None
    job: str | None = None
    live: dict[str, Any] | None = None
    challenger: dict[str, Any] | None = None
    standing: dict[str, dict[str, float | None]] = Field(default_factory=dict)
    score: dict[str, Any] | None = None
    may_promote: bool = False
    why_not: str | None = None
    last: dict[str, Any] | None = None
    steps: list[dict[str, Any]] = Field(default_factory=list)
    answers: list[LoopAnswer] = Field(default_factory=list)


class LiveLoops:
    """Fed by the viewer's thread, asked by the server's. `filters`: the topics to listen to."""

    filters = (f"{LOOP}+",)

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._each: dict[str, dict[str, Any]] = {}

    def take(self, topic: str, payload: bytes) -> None:
        """A message of those topics; of others, nothing happens. Raises DocumentError, and what was known stays so."""
        machine = topic.removeprefix(LOOP)
        if not topic.startswith(LOOP) or "/" in machine:
            return
        document = read_document(payload, LoopDocument) if payload else None  # empty is one that was taken away
        with self._lock:
            if document is None:
                self._each.pop(machine, None)
            elif machine in self._each or len(self._each) < MACHINES_MAX:
                self._each[machine] = document

    def of(self, machine: str) -> dict[str, Any] | None:
        """Return the document of a machine; None where none was heard."""
        with self._lock:
            return self._each.get(machine)
