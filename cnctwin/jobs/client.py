"""The other side of the batch consumer: ask for a job and know that it was taken; for the command line and the page.

A message may be lost where no consumer is connected, so a request is repeated, under the same id, until it is answered: the
consumer does it once.
"""

import json
import os
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any
from uuid import uuid4

from cnctwin.errors import ApplicationError, UsageError
from cnctwin.jobs.request import read_request
from cnctwin.processes import published_state
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.host_session import EventKind
from twin.vocabulary.topics import JOB_CANCEL, JOB_REPLY, JOB_REQUEST, JOBS_STATE, state_of_job

REPEAT_S = 2.0
FRESH_S_MAX = 35.0  # the state comes every ten seconds


class NoAnswerError(ApplicationError):
    """Nobody has answered: whether anything was done is not known."""


class JobsClient:
    """A connection, for the length of a `with` block, for one thread."""

    def __init__(self, broker: BrokerAddress) -> None:
        self.broker = broker
        self._host = HostApplication(broker, f"jobs-{os.getpid()}-{uuid4().hex[:8]}", (), publish_state=False)
        self._heard: dict[str, Any] = {}
        self._wanted: set[str] = set()

    def __enter__(self) -> "JobsClient":
        self._host.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._host.stop()
        if isinstance(error, published_state.WRONG_SHAPE) and not isinstance(error, ApplicationError):
            with published_state.of_its_shape(f"jobs and answers on {self.broker.url}", "cnctwin jobs run"):
                raise error

    def submit(self, document: dict[str, Any], wait_s: float = 15.0) -> dict[str, Any]:
        """Have a job accepted: the consumer's answer. Raises RequestError where it is wrong, NoAnswerError where none comes."""
        document = {key: value for key, value in document.items() if key != "reply_to"}
        document.setdefault("id", f"{document.get('job')}-{uuid4().hex[:12]}")
        request = read_request(json.dumps(document).encode())
        answer = self._ask(JOB_REQUEST, document, request.id, wait_s)
        if answer is None:
            said = f"{request.id} was not accepted within {wait_s:g} s{self._why()}; is `cnctwin jobs run` running?"
            raise NoAnswerError(f"{said} It is safe to send it again with the same id: it is done once")
        return answer

    def cancel(self, job_id: str, wait_s: float = 15.0) -> dict[str, Any]:
        """Cancel a job: the consumer's answer. Raises NoAnswerError."""
        answer = self._ask(JOB_CANCEL, {"id": job_id}, job_id, wait_s)
        if answer is None:
            raise NoAnswerError(f"no answer within {wait_s:g} s{self._why()}; is `cnctwin jobs run` running?")
        return answer

    def state(self, wait_s: float = 5.0) -> dict[str, Any]:
        """All jobs in short. Raises NoAnswerError where there is no consumer, or there is none any more."""
        self._listen(JOBS_STATE)
        state = self.until(lambda: self._heard.get(JOBS_STATE), wait_s)
        if state is None:
            raise NoAnswerError(f"{self.broker.url} knows nothing of jobs{self._why()}; is `cnctwin jobs run` running?")
        age_s = published_state.age_s(state, time.time())
        if age_s > FRESH_S_MAX:
            raise NoAnswerError(f"the state of jobs is {age_s:.0f} s old: the consumer does not run any more (cnctwin jobs run)")
        return dict(state)

    def job(self, job_id: str, wait_s: float = 5.0) -> dict[str, Any]:
        """One job in full. Raises UsageError where there is none of that id."""
        self._listen(state_of_job(job_id))
        found = self.until(lambda: self._heard.get(state_of_job(job_id)), wait_s)
        if found is None:
            raise UsageError(f"{self.broker.url} knows no job {job_id!r}{self._why()}; `cnctwin jobs list` shows them")
        return dict(found)

    def until(self, true: Callable[[], Any], seconds: float) -> Any:
        """Listen until something is so; what was not false, or None."""
        deadline_s = time.monotonic() + seconds
        while not (value := true()) and time.monotonic() < deadline_s:
            for event in self._host.poll(0.05):
                if event.kind is EventKind.PLAIN and event.topic in self._wanted and event.payload:
                    self._heard[event.topic] = published_state.parsed(event.payload)
        return value or None

    def _ask(self, topic: str, document: dict[str, Any], job_id: str, wait_s: float) -> dict[str, Any] | None:
        """Send until there is an answer, to us alone: another one who asks for the same hears his own."""
        reply = f"{JOB_REPLY}{job_id}/{uuid4().hex[:8]}"
        payload = json.dumps({**document, "reply_to": reply}, ensure_ascii=False).encode()
        self._listen(reply)
        self._heard.pop(reply, None)
        deadline_s = time.monotonic() + wait_s
        while reply not in self._heard and time.monotonic() < deadline_s:
            self.until(lambda: self._host.online, deadline_s - time.monotonic())
            self._host.publish_plain(topic, payload, qos=1)
            self.until(lambda: self._heard.get(reply), min(REPEAT_S, deadline_s - time.monotonic()))
        return self._heard.get(reply)

    def _listen(self, topic: str) -> None:
        if topic not in self._wanted:
            self._wanted.add(topic)
            self._host.subscribe_plain(topic)

    def _why(self) -> str:
        return "" if self._host.online else f" ({self._host.last_error or 'no connection'})"
