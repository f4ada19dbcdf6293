"""The batch consumer: takes requests from the broker, does them one at a time in processes of their own, and says how they stand.

One process, one thread; it holds the jobs folder. A turn: what was said to it, how the running job stands, what is to be told.
"""

import json
import logging
import sys
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Any

from cnctwin.jobs.announcer import CANCEL, NODE_METRICS, REQUEST, Announcer
from cnctwin.jobs.attempt import Attempt, how_ended
from cnctwin.jobs.durable import EXIT_DISK
from cnctwin.jobs.files_root import FilesRoot
from cnctwin.jobs.job import Job, JobState
from cnctwin.jobs.job_queue import Answer, JobQueue, Limits
from cnctwin.jobs.jobs_folder import JobsFolder, clean
from cnctwin.jobs.left_over import end_left_over
from cnctwin.jobs.request import RequestError, is_id, read_cancel, read_request
from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.edge_session import Command
from sparkplug.host import HostApplication
from sparkplug.host_session import HostEvent
from sparkplug.metric import NodeId
from twin.vocabulary import topics
from twin.vocabulary.nodes import JOBS_NODE

CHILD = (sys.executable, "-m", "cnctwin.jobs.child")
POLL_S = 0.05
LOOK_S = 0.2
SWEEP_S = 60.0
INBOX_MAX = 200  # messages that wait for us
COMMANDS_MAX = 200
RESULT_BYTES_MAX = 20_000
FAREWELL_S = 2.0
REFUSED_S = 1.0  # between two that are logged; all are counted
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Setting:
    """The settings of a consumer.

    files: below which lie those that requests name; session_file: keeps bdSeq; child: the command of a job
    """

    files: Path | None = None
    group: str = "cnc"
    session_file: Path | None = None
    workers: int = 1
    dask: str | None = None
    limits: Limits = field(default_factory=Limits)
    child: Sequence[str] = CHILD

    @property
    def command(self) -> list[str]:
        """The command line of the process of a job, but for its folder."""
        files = [] if self.files is None else ["--files", str(self.files.resolve())]
        dask = [] if self.dask is None else ["--dask", self.dask]
        return [*self.child, *files, "--workers", str(self.workers), *dask]


class Consumer:
    """See the module. Raises UsageError where another one holds the folder."""

    def __init__(self, folder: Path, broker: BrokerAddress, setting: Setting) -> None:
        self.broker = broker
        self._setting, self._limits = setting, setting.limits
        self._folder = JobsFolder(folder)
        self.queue = JobQueue(self._folder, FilesRoot(setting.files), setting.limits, _now_ms())
        self._commands: deque[Command] = deque()
        self._host = HostApplication(broker, JOBS_NODE, (), queue_max=INBOX_MAX)
        node = NodeId(setting.group, JOBS_NODE)
        session_file = setting.session_file
        self._edge = EdgeNode(broker, node, NODE_METRICS, session_file=session_file, on_command=self._command_came)
        self.announcer = Announcer(self._host, self._edge, self.queue)
        self._attempt: Attempt | None = None
        self._running = ""
        self._not_before_s = self._looked_s = self._swept_s = self._refused_s = 0.0

    def run(self, stop: Event) -> None:
        """Work until `stop` is set; the job that runs then goes on when a consumer is started again."""
        self._recover()
        for topic in (topics.JOB_REQUEST, topics.JOB_CANCEL, topics.state_of_job("+")):
            self._host.subscribe_plain(topic)
        self._host.start()
        self._edge.start()
        try:
            while not stop.is_set():
                self.turn()
        finally:
            self._interrupt()
            self._say_goodbye()
            self._folder.close()

    def turn(self) -> None:
        """One round."""
        for event in self._host.poll(POLL_S):
            self._guarded(self._hear, event)
        while self._commands:
            self._guarded(self._obey, self._commands.popleft())
        if self.queue.changed:
            self.announcer.tell()  # that it is queued, before it runs
        self._drive()
        self.queue.save()
        if time.monotonic() - self._swept_s >= SWEEP_S:
            self._swept_s = time.monotonic()
            self.queue.sweep(_now_ms())
        self.announcer.tell()

    # What is said to us.

    def _guarded(self, hear: Any, what: Any) -> None:
        """A message must never end the consumer; one that would is a bug of ours, and said."""
        try:
            hear(what)
        except Exception:
            _log.exception("a message was not understood")
            self.announcer.counts["requests_refused"] += 1

    def _hear(self, event: HostEvent) -> None:
        if event.topic == topics.JOB_REQUEST:
            answer, topic = self._take(event.payload)
            if topic:
                self.announcer.reply(topic, answer.document())
        elif event.topic == topics.JOB_CANCEL:
            answer, topic = self._cancel_asked(event.payload)
            if topic:
                self.announcer.reply(topic, answer.document())
        elif event.payload and event.topic.startswith(topics.JOBS):
            job_id = event.topic.split("/")[2]
            if job_id not in self.queue and is_id(job_id):
                self.announcer.clear(job_id)  # of a life that was forgotten while the broker was away

    def _command_came(self, command: Command) -> None:
        """From the connection's thread."""
        if len(self._commands) < COMMANDS_MAX:
            self._commands.append(command)
        else:
            self.announcer.counts["requests_refused"] += 1

    def _obey(self, command: Command) -> None:
        text = command.value if isinstance(command.value, str) else ""
        if command.name == REQUEST:
            answer, topic = self._take(text.encode(errors="replace"))
            if answer.id and topic and answer.answer != "refused":
                self.announcer.reply(topic, answer.document())
        elif command.name == CANCEL:
            answer = self._cancel(text)
        else:
            return
        self.announcer.answer(command.device, answer.document())

    def _take(self, payload: bytes) -> tuple[Answer, str]:
        """Return the outcome of a request, and the topic for it (empty: nobody asks to be told)."""
        try:
            request = read_request(payload)
        except RequestError as error:
            answer, topic = Answer(error.job_id, "refused", str(error)), error.reply_topic
        else:
            answer, topic = self.queue.take(request, _now_ms()), request.reply_topic
        self.announcer.counts["requests_refused" if answer.answer == "refused" else "requests_accepted"] += 1
        if answer.answer == "refused" and time.monotonic() - self._refused_s >= REFUSED_S:
            self._refused_s = time.monotonic()
            _log.warning("a request is refused: %s", answer.reason)
        return answer, topic

    def _cancel_asked(self, payload: bytes) -> tuple[Answer, str]:
        try:
            job_id, topic, by = read_cancel(payload)
        except RequestError as error:
            return Answer(error.job_id, "refused", str(error)), error.reply_topic
        return self._cancel(job_id, by), topic

    def _cancel(self, job_id: str, by: str = "") -> Answer:
        if not is_id(job_id) or job_id not in self.queue:
            return Answer(job_id[:64], "refused", f"there is no job {job_id[:64]!r}")
        job = self.queue[job_id]
        if job.state.is_over:
            return Answer(job_id, "refused", f"job {job_id} is {job.state} already", str(job.state))
        if job_id == self._running and self._attempt is not None:
            self._attempt.kill()
            self._attempt = None
        self._over(job, JobState.CANCELLED, reason=f"cancelled by {by or 'request'}")
        return Answer(job_id, "cancelled", "", str(JobState.CANCELLED))

    # The job that runs.

    def _recover(self) -> None:
        """Take over what came of a job that an earlier consumer left running, else queue it again."""
        for job in [job for job in self.queue if job.state is JobState.RUNNING]:
            end_left_over(self._folder.of(job.id))
            self._conclude(job, "cut short, since the consumer ended")

    def _drive(self) -> None:
        now_s = time.monotonic()
        if self._attempt is None:
            waiting = self.queue.waiting
            if waiting and now_s >= self._not_before_s:
                self._start(waiting[0])
            return
        job = self.queue[self._running]
        how = self._attempt.ended()
        if how is not None:
            self._finish(job, how)
        elif job.ran_s + self._attempt.seconds > self._limits.seconds_max:
            self._attempt.kill()
            self._attempt = None
            hours = self._limits.seconds_max / 3600
            self._over(job, JobState.FAILED, reason=f"ended by us: it took more than {hours:g} h; see --hours-max")
        elif now_s - self._looked_s >= LOOK_S:
            self._looked_s = now_s
            progress_pct, doing = self._folder.progress(job.id)
            if (progress_pct, doing) != (job.progress_pct, job.doing) and progress_pct >= job.progress_pct:
                self.queue.show(job.now(_now_ms(), progress_pct=progress_pct, doing=doing))

    def _start(self, job: Job) -> None:
        began = {"started_ms": job.started_ms or _now_ms(), "attempt": job.attempt + 1}
        job = job.now(_now_ms(), state=JobState.RUNNING, progress_pct=0.0, doing="", reason="", **began)
        self.queue.put(job)
        try:
            end_left_over(self._folder.of(job.id))  # where the disk was full it may not have been noted
            self._folder.clear(job.id)
            self._attempt, self._running = Attempt(self._setting.command, self._folder.of(job.id), job.attempt), job.id
        except OSError as error:
            self._lost(job, f"could not be started: {error.strerror or error}")

    def _finish(self, job: Job, how: str) -> None:
        assert self._attempt is not None
        job = job.now(_now_ms(), ran_s=round(job.ran_s + self._attempt.seconds, 3))
        self._attempt = None
        self._conclude(job, how)

    def _conclude(self, job: Job, how: str) -> None:
        """An attempt is over: by what it said, else by how it ended."""
        outcome = self._folder.outcome(job) or {}
        state, reason = outcome.get("state"), clean(str(outcome.get("reason", "")))
        if state is None and how == how_ended(EXIT_DISK):
            self._over(job, JobState.FAILED, reason="the disk is full; make room, and ask for it again under another id")
        elif state == "done":
            result = _bounded(outcome.get("result"))
            self._over(job, JobState.DONE, progress_pct=100.0, doing="", reason="", result=result)
        elif state == "failed":
            self._over(job, JobState.FAILED, reason=reason)
        else:
            self._lost(job, reason or how)

    def _lost(self, job: Job, how: str) -> None:
        self.announcer.counts["attempts_lost"] += 1
        if job.attempt >= self._limits.attempts_max:
            tried = "1 attempt; it" if job.attempt == 1 else f"{job.attempt} attempts; the last one"
            self._over(job, JobState.FAILED, reason=f"given up after {tried}: {how}")
            return
        _log.warning("job %s, attempt %d: %s; it goes on", job.id, job.attempt, how)
        self._not_before_s = time.monotonic() + self._limits.pause_s * job.attempt
        reason = f"attempt {job.attempt} of {self._limits.attempts_max}: {how}; it goes on from its checkpoint"
        self.queue.put(job.now(_now_ms(), state=JobState.QUEUED, reason=reason))

    def _over(self, job: Job, state: JobState, **changed: Any) -> None:
        now_ms = _now_ms()
        self.queue.put(job.now(now_ms, state=state, ended_ms=now_ms, **changed))
        if state is JobState.FAILED:
            _log.warning("job %s failed: %s", job.id, changed.get("reason"))
        self.queue.sweep(now_ms)

    def _interrupt(self) -> None:
        """We end in order: the attempt does not count."""
        if self._attempt is None:
            return
        ran_s = self._attempt.seconds
        self._attempt.kill()
        self._attempt = None
        job = self.queue[self._running]
        if self._folder.outcome(job) is not None:
            self._conclude(job, "")
            return
        again = {"state": JobState.QUEUED, "attempt": job.attempt - 1, "ran_s": round(job.ran_s + ran_s, 3)}
        self.queue.put(job.now(_now_ms(), reason="the consumer was ended; it goes on when one is started again", **again))

    def _say_goodbye(self) -> None:
        deadline_s = time.monotonic() + FAREWELL_S
        with suppress(Exception):
            self.announcer.tell()
            while not self.announcer.is_quiet and self._host.online and time.monotonic() < deadline_s:
                self._host.poll(POLL_S)
                self.announcer.tell()
        self._edge.stop()
        self._host.stop()


def _bounded(result: Any) -> dict[str, Any]:
    """A summary that fits into a message."""
    if not isinstance(result, dict):
        return {}
    text = clean(json.dumps(result, ensure_ascii=False), RESULT_BYTES_MAX + 1)
    if len(text) <= RESULT_BYTES_MAX:
        return dict(json.loads(text))
    return {"sentence": clean(str(result.get("sentence", ""))), "cut": f"more than {RESULT_BYTES_MAX} bytes; see the files"}


def _now_ms() -> int:
    return time.time_ns() // 1_000_000
