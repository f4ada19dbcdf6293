"""A job as it stands. It lives: queued → running → done, failed or cancelled; killed, it is queued again."""

from enum import StrEnum
from typing import Any

from pydantic import BaseModel, ConfigDict


class JobState(StrEnum):
    """The state of a job."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def is_over(self) -> bool:
        """True if nothing more becomes of it."""
        return self not in (JobState.QUEUED, JobState.RUNNING)


class Job(BaseModel):
    """As `state.json` and the topics have it. All times: ms since 1970, UTC.

    number: the order of acceptance; attempt: how often it was started; machine: empty where the request states none
    doing: what it is at; reason: why it failed, was cancelled or was started again; result: a summary with the names of its files
    by: who asked for it, as the request says; empty where it does not
    ran_s: of the attempts that are over; is_told: whether its end went to who asked
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    id: str
    kind: str
    number: int
    digest: str
    accepted_ms: int
    changed_ms: int
    machine: str = ""
    by: str = ""
    reply_topic: str = ""
    state: JobState = JobState.QUEUED
    attempt: int = 0
    started_ms: int | None = None
    ended_ms: int | None = None
    progress_pct: float = 0.0
    doing: str = ""
    reason: str = ""
    result: dict[str, Any] = {}
    ran_s: float = 0.0
    is_told: bool = False

    def now(self, now_ms: int, **changed: Any) -> "Job":
        """The job with something changed."""
        return self.model_copy(update={"changed_ms": now_ms, **changed})

    def shown(self, place: int | None) -> dict[str, Any]:
        """For readers. place: 0 = running, 1 = next; None = over."""
        told = self.model_dump(mode="json", exclude={"digest", "number", "reply_topic", "is_told"})
        return {**told, "place": place}
