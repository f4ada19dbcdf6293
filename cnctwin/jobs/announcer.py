"""Announcements of jobs: replies to who asked, retained JSON for the page and the command line, twin metrics for the plant.

Plain: `cnc/jobs/state` (all in short), `cnc/jobs/<id>/state` (one in full), both retained. Sparkplug: the node `twin-jobs` with a
device for each machine that a job concerns, and the device `jobs`, which shows the last change of any and takes commands.
"""

import json
import logging
import time
from collections import deque
from datetime import UTC, datetime
from typing import Any

from cnctwin.jobs.job import Job, JobState
from cnctwin.jobs.job_queue import JobQueue
from processors.contract import Provenance
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.errors import SparkplugError
from sparkplug.host import HostApplication
from sparkplug.metric import Change, MetricSpec
from sparkplug.quality import Quality
from twin.vocabulary.topics import JOBS_STATE, state_of_job

JOB_ID, JOB_KIND, JOB_STATE = "twin/job_id", "twin/job_kind", "twin/job_state"
PROGRESS, RESULT = "twin/job_progress_pct", "twin/job_result"
DEVICE = "jobs"
REQUEST, CANCEL, ANSWER = "Job/Request", "Job/Cancel", "Job/Answer"
STATE_S_MIN, STATE_S_MAX = 0.25, 10.0  # of progress only; how jobs stand is told at once
OVER_SHOWN_MAX = 100
REPLIES_MAX = 1000
DEVICES_MAX = 200
_log = logging.getLogger(__name__)

_COMMANDS = (
    MetricSpec(REQUEST, DataType.STRING, value="", properties={"meaning": "write a request here, as JSON"}),
    MetricSpec(CANCEL, DataType.STRING, value="", properties={"meaning": "write the id of a job here"}),
    MetricSpec(ANSWER, DataType.STRING, value="", properties={"meaning": "what became of the last command, as JSON"}),
)
_INFERRED = {"provenance": Provenance.INFERRED.value}
METRICS = (
    MetricSpec(JOB_ID, DataType.STRING, properties={**_INFERRED, "meaning": "the job that changed last"}),
    MetricSpec(JOB_KIND, DataType.STRING, properties={**_INFERRED, "meaning": "optimise, identify or diagnose"}),
    MetricSpec(JOB_STATE, DataType.STRING, properties={**_INFERRED, "meaning": "queued, running, done, failed, cancelled"}),
    MetricSpec(PROGRESS, DataType.DOUBLE, "%", 0.0, 100.0, properties={**_INFERRED, "meaning": "how far it is"}),
    MetricSpec(RESULT, DataType.STRING, properties={**_INFERRED, "meaning": "summary of the result, as JSON"}),
)
NODE_METRICS = (
    *_COMMANDS,
    MetricSpec("health/jobs_queued", DataType.INT64, properties={"meaning": "jobs that wait"}),
    MetricSpec("health/jobs_kept", DataType.INT64, properties={"meaning": "jobs whose files are there"}),
    MetricSpec("health/requests_accepted", DataType.INT64, properties={"meaning": "since the start"}),
    MetricSpec("health/requests_refused", DataType.INT64, properties={"meaning": "since the start"}),
    MetricSpec("health/messages_dropped", DataType.INT64, properties={"meaning": "that came faster than they were read"}),
    MetricSpec("health/attempts_lost", DataType.INT64, properties={"meaning": "processes of jobs that were killed"}),
    MetricSpec("health/replies_dropped", DataType.INT64, properties={"meaning": "answers that waited for the broker in vain"}),
    MetricSpec("health/disk_trouble", DataType.STRING, properties={"meaning": "why jobs cannot be written; empty: they can"}),
    MetricSpec("health/reconnects", DataType.INT64, properties={"meaning": "connections made again"}),
)


class Announcer:
    """Call `tell` often; it says what is due, and keeps what the broker does not take."""

    def __init__(self, host: HostApplication, edge: EdgeNode, queue: JobQueue) -> None:
        self.counts = {"requests_accepted": 0, "requests_refused": 0, "attempts_lost": 0, "replies_dropped": 0}
        self._host, self._edge, self._queue = host, edge, queue
        self._due: set[str] = set()
        self._replies: deque[tuple[str, bytes]] = deque()
        self._devices: dict[str, dict[str, tuple[str | float | None, str | None]]] = {}
        self._state_is_due, self._state_s, self._reconnects = True, 0.0, 0
        self._states_told: dict[str, JobState] = {}
        self._told_health: dict[str, Any] = {}
        edge.declare_device(DEVICE, (*_COMMANDS, *METRICS))
        self._devices[DEVICE] = {}

    @property
    def is_quiet(self) -> bool:
        """True once everything has been published."""
        return not (self._replies or self._due or self._state_is_due or self._queue.changed)

    def reply(self, topic: str, document: dict[str, Any]) -> None:
        """Say to who asked what becomes of it."""
        if len(self._replies) >= REPLIES_MAX:
            self._replies.popleft()
            self.counts["replies_dropped"] += 1
        self._replies.append((topic, _payload(document)))

    def answer(self, device: str | None, document: dict[str, Any]) -> None:
        """The same to who sent a Sparkplug command."""
        text = json.dumps(document, ensure_ascii=False)
        self._edge.publish(device, [Change(ANSWER, text, time.time_ns() // 1_000_000)])

    def clear(self, job_id: str) -> None:
        """Take away what the broker retains of a job that is not there any more."""
        self._host.publish_plain(state_of_job(job_id), b"", qos=1, retain=True)

    def tell(self) -> None:
        """Publish what is due."""
        queue = self._queue
        changed, queue.changed = queue.changed, set()
        for job in sorted((queue[job_id] for job_id in changed if job_id in queue), key=lambda job: (job.changed_ms, job.number)):
            self._tell_plant(job)
        self._due |= changed
        self._state_is_due = self._state_is_due or bool(changed or queue.gone)
        self._tell_health()
        if not self._host.online:
            return
        if self._host.reconnects != self._reconnects:
            self._reconnects = self._host.reconnects
            self._due |= {job.id for job in queue}  # a broker that was killed may have forgotten what it retained
            self._state_is_due = True
        while queue.gone:
            self.clear(queue.gone.pop())
            for machine in self._devices.keys() - {job.machine for job in queue} - {DEVICE}:
                del self._devices[machine]
                self._edge.remove_device(machine)
        self._tell_jobs()
        self._tell_state()
        while self._replies and self._host.publish_plain(*self._replies[0], qos=1):
            self._replies.popleft()  # after the state: who has his answer finds his job in it

    def _tell_jobs(self) -> None:
        for job_id in sorted(self._due):
            if job_id in self._queue:
                job, place = self._queue[job_id], self._queue.place(job_id)
                if not self._host.publish_plain(state_of_job(job_id), _payload(job.shown(place)), qos=1, retain=True):
                    return
                if job.state.is_over and not job.is_told:
                    if job.reply_topic:
                        self.reply(job.reply_topic, {"id": job.id, "answer": str(job.state), **job.shown(None)})
                    self._queue.told(job_id)
            self._due.discard(job_id)

    def _tell_state(self) -> None:
        now_s, states = time.monotonic(), {job.id: job.state for job in self._queue}
        age_s = now_s - self._state_s
        if states == self._states_told and age_s < (STATE_S_MIN if self._state_is_due else STATE_S_MAX):
            return
        if self._host.publish_plain(JOBS_STATE, _payload(state_of(self._queue)), qos=1, retain=True):
            self._state_s, self._state_is_due, self._states_told = now_s, False, states

    def _tell_plant(self, job: Job) -> None:
        result = json.dumps(job.result, ensure_ascii=False) if job.result else None
        told: dict[str, str | float | None] = {
            JOB_ID: job.id,
            JOB_KIND: job.kind,
            JOB_STATE: str(job.state),
            PROGRESS: job.progress_pct,
            RESULT: result,
        }
        for device in dict.fromkeys((DEVICE, self._device_of(job.machine))):
            before = self._devices[device]
            changes = [
                Change(name, value, job.changed_ms, Quality.GOOD if value is not None else Quality.BAD, _reason(job, value))
                for name, value in told.items()
                if before.get(name) != (value, _reason(job, value))
            ]
            self._devices[device] = {name: (value, _reason(job, value)) for name, value in told.items()}
            if changes:
                self._edge.publish(device, changes)

    def _device_of(self, machine: str) -> str:
        """The device of a machine; `jobs` for one that states no name, or none that a device may have."""
        if machine in self._devices or not machine:
            return machine or DEVICE
        if len(self._devices) > DEVICES_MAX:
            return DEVICE
        try:
            self._edge.declare_device(machine, METRICS)
        except SparkplugError as error:
            _log.debug("machine %r is shown as %r only: %s", machine, DEVICE, error)
            return DEVICE
        self._devices[machine] = {}
        return machine

    def _tell_health(self) -> None:
        queue = self._queue
        health: dict[str, int | str] = {
            "jobs_queued": sum(job.state == "queued" for job in queue),
            "jobs_kept": len(queue),
            **self.counts,
            "messages_dropped": self._host.dropped,
            "disk_trouble": queue.disk_trouble,
            "reconnects": self._host.reconnects,
        }
        new = {name: value for name, value in health.items() if self._told_health.get(name) != value}
        if new:
            self._told_health = health
            now_ms = time.time_ns() // 1_000_000
            self._edge.publish(None, [Change(f"health/{name}", value, now_ms) for name, value in new.items()])


def state_of(queue: JobQueue) -> dict[str, Any]:
    """All jobs in short: what runs and waits in its order, then what is over, newest first."""
    waiting = queue.waiting
    over = sorted((job for job in queue if job.state.is_over), key=lambda job: -(job.ended_ms or 0))[:OVER_SHOWN_MAX]
    running = next((job.id for job in waiting if job.state == "running"), None)
    return {
        "at": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "queued": sum(job.state == "queued" for job in waiting),
        "running": running,
        "disk_trouble": queue.disk_trouble,
        "jobs": [_short(job, queue.place(job.id)) for job in (*waiting, *over)],
    }


def _short(job: Job, place: int | None) -> dict[str, Any]:
    told = job.shown(place)
    return {**{key: value for key, value in told.items() if key != "result"}, "sentence": str(job.result.get("sentence", ""))}


def _reason(job: Job, value: Any) -> str | None:
    return None if value is not None else job.reason or f"the job is {job.state}"


def _payload(document: dict[str, Any]) -> bytes:
    return json.dumps(document, ensure_ascii=False).encode()
