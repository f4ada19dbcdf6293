"""The state of the loop of one machine, as it is kept over restarts in `history/<machine>/loop.json`."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

ANSWERS_MAX = 20


class StepName(StrEnum):
    """The step of the loop.

    refused: a diagnosis led to no challenger; promoted: a new description is live, and its gap is watched
    """

    WATCHING = "watching"
    COMPOSING = "composing"
    DIAGNOSING = "diagnosing"
    SHADOW = "shadow"
    PROMOTED = "promoted"
    REFUSED = "refused"


class _Kept(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class Answer(_Kept):
    """The answer to a request. id: its own; t: ms since 1970."""

    id: str
    request: str
    done: bool
    text: str
    t: int


class Last(_Kept):
    """The last promotion: of what, in which signal, its standing gap before and now, in floors; since: ms since 1970."""

    says: str
    signal: str = ""
    words: str = ""
    before: float | None = None
    after: float | None = None
    since: int = 0


class State(_Kept):
    """See the module. Wall-clock times are `…_ms`, those by the machine's own clock `…_at_ms`.

    since_ms: since when it is in this step; text: what it does, in a sentence
    of: the live version that the question is about; span_at_ms: the stretch of history that it is put to; case: its name
    asked_by: who asked for it, empty = it began by itself; next_experiment: what would tell more, where it led to nothing
    challenger, shadow_from_at_ms: the one that was seen beside the live one, and since when; 0 = no figure of it was heard yet
    live: the live version as it was seen last; standing: its gap by signal
    before, promoted_at_ms: that gap when the live version was promoted, and when
    quiet_until_at_ms: nothing begins by itself before
    at_ms: the machine's time as it was heard last, which holds until it is heard again
    """

    step: StepName = StepName.WATCHING
    since_ms: int = 0
    text: str = "watching the gap"
    of: str = ""
    span_at_ms: tuple[int, int] = (0, 0)
    case: str = ""
    asked_by: str = ""
    next_experiment: dict[str, Any] | None = None
    challenger: str = ""
    shadow_entry_at_ms: int = 0
    shadow_from_at_ms: int = 0
    live: str = ""
    standing: Mapping[str, float] = Field(default_factory=dict)
    before: Mapping[str, float] = Field(default_factory=dict)
    promoted_at_ms: int = 0
    quiet_until_at_ms: int = 0
    at_ms: int = 0
    last: Last | None = None
    answers: tuple[Answer, ...] = ()

    def now(self, **changed: Any) -> Self:
        """Return the state with something changed."""
        return self.model_copy(update=changed)

    def answered(self, answer: Answer) -> Self:
        """Return the state with one more answer; the oldest goes."""
        return self.now(answers=(*self.answers, answer)[-ANSWERS_MAX:])

    def has_answered(self, request_id: str) -> bool:
        """Return True if a request with this id was answered."""
        return bool(request_id) and any(answer.id == request_id for answer in self.answers)


def read_state(document: Mapping[str, Any] | None) -> State:
    """Return the state in a document; a fresh one where there is none that can be read: it finds its place by the folder."""
    try:
        return State() if document is None else State.model_validate(document)
    except ValidationError:
        return State()
