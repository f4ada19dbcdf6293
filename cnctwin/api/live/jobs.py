"""The batch consumer's jobs as last heard: all in short, each in full, and answers to what we asked."""

import re
import threading
from typing import Any
from uuid import uuid4

from cnctwin.api.live.documents import JobReply, JobsState, JobState, read_document
from twin.vocabulary.topics import JOB_REPLY, JOBS_STATE, state_of_job

JOBS_MAX = 1000
WAITING_MAX = 100
_OWN = f"{JOB_REPLY}page-{uuid4().hex[:8]}/"
_ONE = re.compile(state_of_job("([^/]+)"))


class LiveJobs:
    """Fed by the viewer's thread, asked by the server's. `filters`: the topics to listen to."""

    filters = (JOBS_STATE, state_of_job("+"), f"{_OWN}+")

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._all: dict[str, Any] | None = None
        self._each: dict[str, dict[str, Any]] = {}
        self._answers: dict[str, dict[str, Any] | None] = {}

    def take(self, topic: str, payload: bytes) -> None:
        """A message of those topics; of others, nothing happens. Raises DocumentError, and what was known stays so."""
        one = _ONE.fullmatch(topic)
        if topic != JOBS_STATE and one is None and topic not in self._answers:
            return
        shape = JobsState if topic == JOBS_STATE else JobState if one else JobReply
        document = read_document(payload, shape) if payload else None  # empty is one that was taken away
        with self._lock:
            if topic == JOBS_STATE:
                self._all = document
            elif one is not None:
                self._take_one(one[1], document)
            elif document is not None and self._answers.get(topic, document) is None:
                self._answers[topic] = document

    def _take_one(self, job_id: str, document: dict[str, Any] | None) -> None:
        if document is None:
            self._each.pop(job_id, None)
        elif job_id in self._each or len(self._each) < JOBS_MAX:
            self._each[job_id] = document

    def all(self) -> dict[str, Any] | None:
        """The consumer's state; None where none was heard."""
        with self._lock:
            return self._all

    def one(self, job_id: str) -> dict[str, Any] | None:
        """A job in full, with its result."""
        with self._lock:
            return self._each.get(job_id)

    def await_answer(self) -> str | None:
        """A topic of our own, on which an answer is kept until it is taken; None where too many are awaited."""
        topic = f"{_OWN}{uuid4().hex[:8]}"
        with self._lock:
            if len(self._answers) >= WAITING_MAX:
                return None
            self._answers[topic] = None
        return topic

    def answer(self, topic: str) -> dict[str, Any] | None:
        """The first answer on that topic; None while there is none."""
        with self._lock:
            return self._answers.get(topic)

    def forget(self, topic: str) -> None:
        """No answer is awaited there any more."""
        with self._lock:
            self._answers.pop(topic, None)
