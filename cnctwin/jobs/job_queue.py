"""The queue: jobs are accepted in order, done one at a time, and kept for a while when they are over.

What is accepted is on the disk before anybody is told. Where the disk takes nothing, a new job is refused; how an old one stands
is known all the same, and written when there is room.
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from cnctwin.errors import UsageError
from cnctwin.jobs.files_root import FilesRoot
from cnctwin.jobs.job import Job, JobState
from cnctwin.jobs.jobs_folder import JobsFolder
from cnctwin.jobs.request import Request

DAY_MS = 86_400_000
MACHINE_MAX = 100  # letters of its name
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Limits:
    """The bounds of the queue.

    queued_max: jobs that wait; kept_max, kept_days: jobs that are over; attempts_max: starts of a job; seconds_max: of them all
    pause_s: before an attempt is repeated
    """

    queued_max: int = 50
    kept_max: int = 100
    kept_days: float = 30.0
    attempts_max: int = 3
    seconds_max: float = 86_400.0
    pause_s: float = 1.0


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a request.

    answer: accepted, known (the same was asked before), refused, cancelled; place: as in `Job.shown`
    """

    id: str
    answer: str
    reason: str = ""
    state: str = ""
    place: int | None = None

    def document(self) -> dict[str, Any]:
        """As JSON has it."""
        return {"id": self.id, "answer": self.answer, "reason": self.reason, "state": self.state, "place": self.place}


class JobQueue:
    """All jobs by id. `changed` names those of which readers are to be told; whoever tells them empties it."""

    def __init__(self, folder: JobsFolder, files: FilesRoot, limits: Limits, now_ms: int) -> None:
        self.folder, self.files, self.limits = folder, files, limits
        self._jobs = {job.id: job for job in folder.jobs(now_ms)}
        self._number = max((job.number for job in self._jobs.values()), default=0)
        self._unsaved: set[str] = set()
        self.disk_trouble = ""
        self.changed: set[str] = set(self._jobs)
        self.gone: list[str] = []

    def __getitem__(self, job_id: str) -> Job:
        return self._jobs[job_id]

    def __contains__(self, job_id: str) -> bool:
        return job_id in self._jobs

    def __iter__(self) -> Iterator[Job]:
        """In the order of acceptance."""
        return iter(self._jobs.values())

    def __len__(self) -> int:
        return len(self._jobs)

    @property
    def waiting(self) -> list[Job]:
        """Those that run and wait, in their order."""
        return sorted((job for job in self if not job.state.is_over), key=lambda job: (job.state is JobState.QUEUED, job.number))

    def place(self, job_id: str) -> int | None:
        """0 = running, 1 = next; None = over."""
        waiting = self.waiting
        first = 0 if waiting and waiting[0].state is JobState.RUNNING else 1
        return next((place for place, job in enumerate(waiting, start=first) if job.id == job_id), None)

    def take(self, request: Request, now_ms: int) -> Answer:
        """Accept a request, or say why not."""
        known = self._jobs.get(request.id)
        if known is not None and known.digest != request.digest:
            return Answer(request.id, "refused", f"id = {request.id!r} is that of another request; take another id")
        if known is not None:
            return Answer(request.id, "known", known.reason, str(known.state), self.place(known.id))
        if sum(job.state is JobState.QUEUED for job in self) >= self.limits.queued_max:
            return Answer(request.id, "refused", f"{self.limits.queued_max} jobs wait already; send it again when some are done")
        head: dict[str, Any] = {
            "id": request.id,
            "kind": request.kind.name,
            "digest": request.digest,
            "reply_topic": request.reply_topic,
            "by": request.by,
        }
        try:
            named = "".join(filter(str.isprintable, request.parameters.machine_of(self.files)))
            job = Job(number=self._number + 1, accepted_ms=now_ms, changed_ms=now_ms, machine=named[:MACHINE_MAX], **head)
            self.folder.add(job, request.document)
        except UsageError as error:
            return Answer(request.id, "refused", str(error))
        except OSError as error:
            return Answer(
                request.id, "refused", f"the consumer cannot keep it: {error.strerror}; send it again when there is room"
            )
        self._number += 1
        self._jobs[job.id] = job
        self.changed |= {job.id}
        return Answer(job.id, "accepted", "", str(job.state), self.place(job.id))

    def put(self, job: Job) -> None:
        """A job stands otherwise than before."""
        places = job.state is not self._jobs[job.id].state
        self._jobs[job.id] = job
        self.changed |= {one.id for one in self.waiting} | {job.id} if places else {job.id}
        self._unsaved.add(job.id)
        self.save()

    def show(self, job: Job) -> None:
        """Only its progress is another: told, and not written."""
        self._jobs[job.id] = job
        self.changed.add(job.id)

    def told(self, job_id: str) -> None:
        """Note that whoever asked for a job has been told of its end."""
        self._jobs[job_id] = self._jobs[job_id].model_copy(update={"is_told": True})
        self._unsaved.add(job_id)

    def save(self) -> None:
        """Write what is not on the disk yet."""
        for job_id in list(self._unsaved):
            try:
                self.folder.save(self._jobs[job_id])
            except OSError as error:
                trouble = error.strerror or str(error)
                if trouble != self.disk_trouble:
                    _log.error("%s: how jobs stand cannot be written, and will be when it can: %s", self.folder.folder, trouble)
                self.disk_trouble = trouble
                return
            self._unsaved.discard(job_id)
        self.disk_trouble = ""

    def sweep(self, now_ms: int) -> None:
        """Forget jobs that were over long ago, or are too many."""
        over = sorted((job for job in self if job.state.is_over), key=lambda job: job.ended_ms or 0)
        too_many = max(len(over) - self.limits.kept_max, 0)
        oldest_ms = now_ms - self.limits.kept_days * DAY_MS
        for job in (job for number, job in enumerate(over) if number < too_many or (job.ended_ms or 0) < oldest_ms):
            _log.warning("job %s (%s, %s) and its files go: more than %d are kept, or for more than %g days", job.id, job.kind,
                         job.state, self.limits.kept_max, self.limits.kept_days)  # fmt: skip
            self.folder.remove(job.id)
            del self._jobs[job.id]
            self._unsaved.discard(job.id)
            self.changed.discard(job.id)
            self.gone.append(job.id)
