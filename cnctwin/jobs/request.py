"""A request for a job: JSON of whoever may write to a topic, checked before anything is done with it.

`{"job": "diagnose", "id": "night-7", "reply_to": "cell/answers", "case": "vmc/november"}`: what it is, whose it is, where the
answer goes, and the parameters of its kind (cnctwin/jobs/kinds.py). The same id twice is the same job.
"""

import hashlib
import json
import re
from dataclasses import dataclass
from typing import Any, NoReturn
from uuid import uuid4

from pydantic import ValidationError

from cnctwin.errors import UsageError
from cnctwin.jobs.kinds import KINDS, Kind, Parameters
from sparkplug.topics import NAMESPACE
from twin.vocabulary.topics import JOB_REPLY, MIRROR, OWN

REQUEST_BYTES_MAX = 4_000_000
SHOWN_MAX = 60
NAME_MAX = 100
TOPIC_BYTES_MAX = 200
_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_TAKEN = ("reply", "state", "request", "cancel")
"""Levels of topics of ours."""
_RESERVED = (f"{NAMESPACE}/", "$", OWN, MIRROR)
"""Topics on which a reply would be taken for something else: by an edge for a command, by the mirror's readers for a value."""


class RequestError(UsageError):
    """A request that is refused; where it says who asks, the answer can go there."""

    def __init__(self, reason: str, job_id: str = "", reply_to: str = "") -> None:
        super().__init__("".join(sign if sign.isprintable() else "?" for sign in reason))  # it is logged, and shown in terminals
        self.job_id, self.reply_to = job_id, reply_to

    @property
    def reply_topic(self) -> str:
        """The topic for the refusal; empty where nobody can be told."""
        return self.reply_to or (JOB_REPLY + self.job_id if self.job_id else "")


@dataclass(frozen=True, slots=True)
class Request:
    """See the module. digest: of what is asked, without who asks."""

    id: str
    kind: Kind
    parameters: Parameters
    reply_to: str
    by: str = ""

    @property
    def document(self) -> dict[str, Any]:
        """As JSON has it, defaults written out."""
        head = {"job": self.kind.name, "id": self.id, "reply_to": self.reply_to} | ({"by": self.by} if self.by else {})
        return head | self.parameters.model_dump(mode="json", exclude_none=True)

    @property
    def digest(self) -> str:
        """The same for the same request, however its keys are ordered."""
        asked = {key: value for key, value in self.document.items() if key not in ("reply_to", "by")}
        return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()

    @property
    def reply_topic(self) -> str:
        """The topic for answers."""
        return self.reply_to or JOB_REPLY + self.id


def read_request(payload: bytes) -> Request:
    """The request in a message; one without an id gets one. Raises RequestError.

    >>> read_request(b'{"job": "diagnose", "case": "vmc", "id": "../x"}')
    Traceback (most recent call last):
    cnctwin.jobs.request.RequestError: request: id = '../x': 1 to 64 letters, digits, '.', '_' and '-', the first no sign
    """
    document = _object(payload)
    known_id, known_topic, by = _head(document)

    def refuse(reason: str) -> NoReturn:
        raise RequestError(f"request: {reason}", known_id, known_topic)

    name = document.pop("job", None)
    kind = KINDS.get(name) if isinstance(name, str) else None
    if kind is None:
        refuse(f"job = {_shown(repr(name))}: is none of {', '.join(KINDS)}")
    try:
        parameters = kind.parameters.model_validate(document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        if first["type"] == "extra_forbidden":
            refuse(f"{_shown(key)}: no such key for {name}; there are {', '.join(kind.parameters.model_fields)}")
        value = f"{key} = {_shown(repr(first['input']))}: " if key else ""
        refuse(f"{value}{first['msg'].removeprefix('Value error, ')}")
    return Request(known_id or f"{kind.name}-{uuid4().hex[:12]}", kind, parameters, known_topic, by)


def read_cancel(payload: bytes) -> tuple[str, str, str]:
    """The id of the job that is to be cancelled, where the answer goes, and who asks, empty = not said. Raises RequestError.

    >>> read_cancel(b'{"id": "night-7"}')
    ('night-7', 'cnc/jobs/reply/night-7', '')
    """
    document = _object(payload)
    known_id, known_topic, by = _head(document)
    if not known_id or document:
        line = "request: to cancel a job takes its id, and nothing but reply_to and by beside it"
        raise RequestError(line, known_id, known_topic)
    return known_id, known_topic or JOB_REPLY + known_id, by


def _object(payload: bytes) -> dict[str, Any]:
    if len(payload) > REQUEST_BYTES_MAX:
        raise RequestError(f"request: {len(payload):,} bytes are above the limit of {REQUEST_BYTES_MAX:,}; name files instead")
    try:
        document = json.loads(payload, parse_constant=_no_number)
        json.dumps(document, ensure_ascii=False).encode()  # half a character is none
    except (ValueError, RecursionError) as error:
        raise RequestError(f"request: is not JSON: {_shown(str(error))}") from None
    if not isinstance(document, dict):
        raise RequestError(f"request: is a JSON {type(document).__name__}; an object is wanted")
    return document


def _head(document: dict[str, Any]) -> tuple[str, str, str]:
    """Take its id, where the answer goes and who asks out of it; empty where it does not say."""
    by = document.pop("by", "")
    job_id, reply_to = document.pop("id", None), document.pop("reply_to", None)
    known_id = job_id if isinstance(job_id, str) and is_id(job_id) else ""
    fault = _topic_fault(reply_to) if isinstance(reply_to, str) else "is no text"
    known_topic = "" if fault else str(reply_to)
    if job_id is not None and not known_id:
        wanted = "1 to 64 letters, digits, '.', '_' and '-', the first no sign"
        raise RequestError(f"request: id = {_shown(repr(job_id))}: {wanted}", "", known_topic)
    if reply_to not in (None, "") and fault:
        raise RequestError(f"request: reply_to = {_shown(repr(reply_to))}: {fault}", known_id)
    if not isinstance(by, str) or len(by) > NAME_MAX or not by.isprintable():
        line = f"request: by = {_shown(repr(by))}: a name of at most {NAME_MAX} printable characters is wanted"
        raise RequestError(line, known_id, known_topic)
    return known_id, known_topic, by


def is_id(text: str) -> bool:
    """Return True if a job may have this name, which is a folder's and a level of a topic.

    >>> is_id("night-7"), is_id(".."), is_id("reply")
    (True, False, False)
    """
    return _ID.fullmatch(text) is not None and text not in _TAKEN


def _topic_fault(topic: str) -> str | None:
    if not topic or len(topic.encode()) > TOPIC_BYTES_MAX:
        return f"a topic of 1 to {TOPIC_BYTES_MAX} bytes is wanted"
    if any(sign in topic for sign in "+#\0"):
        return "'+', '#' and a zero byte cannot stand in it"
    if topic.startswith(_RESERVED) and not topic.startswith(JOB_REPLY):
        return f"is a topic of others; {JOB_REPLY}… is for answers, or take one of your own"
    return None


def _shown(text: str) -> str:
    """In one line, cut."""
    line = " ".join(text.split())
    return line if len(line) <= SHOWN_MAX else f"{line[:SHOWN_MAX]}…"


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number of JSON")
