"""The queue and its folder: order, bounds, the same request twice, a disk that is full, a restart."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from cnctwin.errors import UsageError
from cnctwin.jobs import jobs_folder
from cnctwin.jobs.files_root import FilesRoot
from cnctwin.jobs.job import JobState
from cnctwin.jobs.job_queue import DAY_MS, JobQueue, Limits
from cnctwin.jobs.jobs_folder import JobsFolder
from cnctwin.jobs.request import Request, read_request
from tests.cnctwin.jobs.counting import register


def asked(job_id: str, to: int = 1) -> Request:
    """A request."""
    register()
    return read_request(json.dumps({"job": "count", "id": job_id, "to": to}).encode())


def opened(folder: Path, limits: Limits | None = None) -> JobQueue:
    """As after a start."""
    return JobQueue(JobsFolder(folder), FilesRoot(), limits or Limits(), 0)


@pytest.fixture
def queue(tmp_path: Path) -> Iterator[JobQueue]:
    """One in which three may wait and two are kept."""
    queue = opened(tmp_path / "jobs", Limits(queued_max=3, kept_max=2, kept_days=1.0))
    yield queue
    queue.folder.close()


def ids(folder: Path) -> list[str]:
    """The folders that are there."""
    return sorted(path.name for path in folder.iterdir() if path.is_dir())


def test_jobs_wait_in_the_order_in_which_they_came_also_after_a_restart(queue: JobQueue) -> None:
    places = [queue.take(asked(name), at_ms).place for at_ms, name in enumerate("cab")]
    assert places == [1, 2, 3]
    queue.put(queue["c"].now(9, state=JobState.RUNNING, attempt=1))
    queue.folder.close()
    again = opened(queue.folder.folder)
    assert [job.id for job in again.waiting] == ["c", "a", "b"]
    assert [again.place(name) for name in "cab"] == [0, 1, 2]
    again.put(again["c"].now(9, state=JobState.QUEUED))  # killed: it is next again
    assert [job.id for job in again.waiting] == ["c", "a", "b"]
    again.folder.close()


def test_what_is_accepted_is_on_the_disk(queue: JobQueue) -> None:
    queue.take(asked("a", 7), 5)
    kept = queue.folder.of("a")
    assert read_request((kept / "request.json").read_bytes()) == asked("a", 7)
    assert json.loads((kept / "state.json").read_text())["state"] == "queued"


def test_the_queue_is_bounded_and_says_so(queue: JobQueue) -> None:
    for name in "abc":
        assert queue.take(asked(name), 0).answer == "accepted"
    full = queue.take(asked("d"), 0)
    assert (full.answer, full.reason) == ("refused", "3 jobs wait already; send it again when some are done")
    assert queue.take(asked("b"), 0).answer == "known"
    assert ids(queue.folder.folder) == ["a", "b", "c"]


def test_an_id_is_one_job_also_when_it_is_over(queue: JobQueue) -> None:
    queue.take(asked("a", 1), 0)
    assert queue.take(asked("a", 2), 0).answer == "refused"
    queue.put(queue["a"].now(3, state=JobState.FAILED, ended_ms=3, reason="why"))
    again = queue.take(asked("a", 1), 4)
    assert (again.answer, again.state, again.reason, again.place) == ("known", "failed", "why", None)


def test_jobs_that_are_over_go_when_they_are_too_many_or_too_old(queue: JobQueue, caplog: pytest.LogCaptureFixture) -> None:
    for number, name in enumerate("abc"):
        queue.take(asked(name), 0)
        queue.put(queue[name].now(1, state=JobState.DONE, ended_ms=number * 1000))
    queue.sweep(2000)
    assert (ids(queue.folder.folder), queue.gone) == (["b", "c"], ["a"])
    assert "job a (count, done) and its files go" in caplog.text
    queue.take(asked("waiting"), 0)
    queue.sweep(DAY_MS + 1500)
    assert ids(queue.folder.folder) == ["c", "waiting"]


def test_a_full_disk_refuses_what_is_new_and_keeps_what_is_known(queue: JobQueue, monkeypatch: pytest.MonkeyPatch) -> None:
    queue.take(asked("a"), 0)
    with monkeypatch.context() as patch:

        def full(*_: object, **__: object) -> None:
            raise OSError(28, "No space left on device")

        patch.setattr(jobs_folder, "write_json", full)
        refused = queue.take(asked("b"), 0)
        assert refused.answer == "refused"
        assert refused.reason == "the consumer cannot keep it: No space left on device; send it again when there is room"
        queue.put(queue["a"].now(1, state=JobState.DONE, ended_ms=1))
        assert queue["a"].state is JobState.DONE
        assert "No space left" in queue.disk_trouble
    assert ids(queue.folder.folder) == ["a"]
    queue.save()
    assert queue.disk_trouble == ""
    assert json.loads((queue.folder.of("a") / "state.json").read_text())["state"] == "done"


def test_a_state_that_cannot_be_read_is_a_job_that_failed_and_says_so(queue: JobQueue) -> None:
    for name, text in (("a", "{"), ("b", json.dumps({"id": "b"})), ("c", None)):
        queue.take(asked(name), 0)
        file = queue.folder.of(name) / "state.json"
        file.unlink() if text is None else file.write_text(text)
    queue.folder.close()
    again = opened(queue.folder.folder)
    assert {job.state for job in again} == {JobState.FAILED}
    assert all("cannot be read" in job.reason for job in again)
    assert again.take(asked("a"), 0).answer == "refused"
    again.folder.close()


def test_what_a_crash_left_half_made_or_half_removed_is_cleared_away(tmp_path: Path) -> None:
    for name in (".new-a", ".gone-b"):
        (tmp_path / "jobs" / name).mkdir(parents=True)
        (tmp_path / "jobs" / name / "request.json").write_text("{}")
    folder = JobsFolder(tmp_path / "jobs")
    assert ids(folder.folder) == []
    assert folder.jobs(0) == []
    folder.close()


def test_a_folder_that_is_held_is_refused_and_free_again_after_its_end(tmp_path: Path) -> None:
    first = JobsFolder(tmp_path)
    with pytest.raises(UsageError, match=r"process \d+ .*; end that one, or use --dir"):
        JobsFolder(tmp_path)
    first.close()
    JobsFolder(tmp_path).close()


@pytest.mark.parametrize("told", ["{", "[]", '{"fraction": 7}', '{"fraction": "a", "doing": 3}', '{"fraction": true}', "\xff"])
def test_progress_that_cannot_be_read_is_none(queue: JobQueue, told: str) -> None:
    queue.take(asked("a"), 0)
    (queue.folder.of("a") / "progress.json").write_text(told, encoding="latin-1")
    assert queue.folder.progress("a")[0] in (0.0, 100.0)
