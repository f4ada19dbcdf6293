"""A person's request of the loop: diagnose, promote, back or withdraw; JSON on a topic of its own.

    cnctwin/loop/request/promote    {"machine": "vmc", "by": "anna", "version": "3f2a…", "id": "…"}

`version` is the challenger that is meant, of `back` the live description that is to go: so the same message twice does one thing.
`id` lets whoever asks find the answer in the loop's document.
"""

import json
from dataclasses import dataclass
from enum import StrEnum

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cnctwin.errors import ApplicationError
from twin.vocabulary.topics import LOOP_REQUEST

BYTES_MAX = 10_000


class RequestError(ApplicationError):
    """A request that cannot be read, in one line."""


class Word(StrEnum):
    """The last level of the topic."""

    DIAGNOSE = "diagnose"
    PROMOTE = "promote"
    BACK = "back"
    WITHDRAW = "withdraw"


class _Document(BaseModel):
    model_config = ConfigDict(extra="ignore")
    machine: str = Field(min_length=1, max_length=200)
    by: str = Field(min_length=1, max_length=100)
    version: str = Field(default="", max_length=64, pattern=r"^[0-9a-f]*$")
    why: str = Field(default="", max_length=1000)
    id: str = Field(default="", max_length=64)


@dataclass(frozen=True, slots=True)
class Request:
    """See the module."""

    word: Word
    machine: str
    by: str
    version: str = ""
    why: str = ""
    id: str = ""


def read_request(topic: str, payload: bytes) -> Request:
    """Return the request in a message. Raises RequestError.

    >>> read_request("cnctwin/loop/request/back", b'{"machine": "vmc", "by": "anna", "version": "3f2a"}').word
    <Word.BACK: 'back'>
    """
    try:
        word = Word(topic.removeprefix(LOOP_REQUEST))
        if len(payload) > BYTES_MAX:
            raise ValueError(f"more than {BYTES_MAX} bytes")
        found = _Document.model_validate(json.loads(payload))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise RequestError(f"{topic}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    except (ValueError, RecursionError) as error:
        raise RequestError(f"{topic[:100]}: {error}") from None
    if word is Word.BACK and not found.version:
        raise RequestError(f"{topic}: version is missing; name the live description that is to go, so that it goes once")
    return Request(word, found.machine, found.by, found.version, found.why, found.id)
