"""The jobs on the disk: a folder for each, one process that writes them.

`<jobs>/<id>/` holds request.json (as it was taken), state.json, and of the process that does it progress.json, outcome.json,
checkpoint.json, child.log and result/. A job begins to be there by one rename, and ends by one.
"""

import fcntl
import os
import shutil
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from pydantic import ValidationError

from cnctwin.errors import UsageError
from cnctwin.files.synced import sync
from cnctwin.jobs.durable import read_json, write_json
from cnctwin.jobs.job import Job, JobState
from cnctwin.jobs.request import is_id

LOCK = "consumer.lock"
TEXT_MAX = 1000
_NEW, _GONE = ".new-", ".gone-"


def clean(text: str, length_max: int = TEXT_MAX) -> str:
    """A text of another process as a message can hold it: cut, and without half characters.

    >>> clean("a" + chr(0xD800) + "b", 2)
    'a?'
    """
    return text[:length_max].encode(errors="replace").decode()


class JobsFolder:
    """Held by one consumer until `close`, or the end of its process. Raises UsageError where another one holds it."""

    def __init__(self, folder: Path) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock: IO[str] = (folder / LOCK).open("a+", encoding="utf-8")
        except OSError as error:
            raise UsageError(f"{folder}: cannot keep jobs: {error.strerror}; name another folder with --dir") from None
        self.folder = folder.resolve()
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.seek(0)
            holder = self._lock.read(80).strip() or "another process"
            self._lock.close()
            raise UsageError(
                f"{folder}: {holder} runs these jobs already, and only one may; end that one, or use --dir"
            ) from None
        self._lock.truncate(0)
        self._lock.write(f"process {os.getpid()} ({Path(sys.argv[0]).name})")
        self._lock.flush()
        for left in (*self.folder.glob(f"{_NEW}*"), *self.folder.glob(f"{_GONE}*")):
            shutil.rmtree(left, ignore_errors=True)

    def close(self) -> None:
        """Let go of it."""
        self._lock.close()

    def of(self, job_id: str) -> Path:
        """The folder of a job."""
        return self.folder / job_id

    def jobs(self, now_ms: int) -> list[Job]:
        """All that are there, in the order in which they were accepted. One whose state cannot be read has failed."""
        found = [self._job(path, now_ms) for path in self.folder.iterdir() if path.is_dir() and is_id(path.name)]
        return sorted(found, key=lambda job: job.number)

    def add(self, job: Job, request: dict[str, Any]) -> None:
        """Keep a new job: when this returns, it survives a power cut. Raises OSError, and nothing is left."""
        begun = self.folder / f"{_NEW}{job.id}"
        try:
            begun.mkdir()
            write_json(begun / "request.json", request)
            write_json(begun / "state.json", job.model_dump(mode="json"))
            begun.rename(self.of(job.id))
        except OSError:
            shutil.rmtree(begun, ignore_errors=True)
            raise
        sync(self.folder)

    def save(self, job: Job) -> None:
        """Keep how it stands. Raises OSError."""
        write_json(self.of(job.id) / "state.json", job.model_dump(mode="json"))

    def request(self, job_id: str) -> bytes:
        """As it was taken. Raises OSError."""
        return (self.of(job_id) / "request.json").read_bytes()

    def progress(self, job_id: str) -> tuple[float, str]:
        """Per cent, and what is being done, as the process that does it says."""
        told = read_json(self.of(job_id) / "progress.json") or {}
        fraction, doing = told.get("fraction"), told.get("doing")
        known = isinstance(fraction, int | float) and 0.0 <= fraction <= 1.0
        return (round(100.0 * float(fraction), 1) if known and fraction is not None else 0.0), clean(str(doing or ""), 200)

    def outcome(self, job: Job) -> dict[str, Any] | None:
        """Return the outcome that the process wrote at the end of this attempt."""
        told = read_json(self.of(job.id) / "outcome.json")
        return told if told is not None and told.get("attempt") == job.attempt else None

    def clear(self, job_id: str) -> None:
        """Take away what earlier attempts said, but for their checkpoint."""
        for name in ("progress.json", "outcome.json"):
            (self.of(job_id) / name).unlink(missing_ok=True)

    def remove(self, job_id: str) -> None:
        """Forget a job and its files."""
        gone = self.folder / f"{_GONE}{job_id}"
        with suppress(OSError):
            self.of(job_id).rename(gone)
        shutil.rmtree(gone, ignore_errors=True)

    def _job(self, path: Path, now_ms: int) -> Job:
        try:
            job = Job.model_validate_json((path / "state.json").read_bytes())
            if job.id != path.name:
                raise ValueError(f"it is that of {job.id}")
        except (OSError, ValueError) as error:
            told = error.strerror if isinstance(error, OSError) else str(error)
            fault = "it is not that of a job" if isinstance(error, ValidationError) else told
            reason = f"its state.json cannot be read ({fault}); what became of it is unknown, so it was not started again"
            lost = {"state": JobState.FAILED, "reason": reason, "ended_ms": now_ms, "is_told": True}
            return Job(id=path.name, kind="unknown", number=0, digest="", accepted_ms=now_ms, changed_ms=now_ms).now(
                now_ms, **lost
            )
        return job
