"""The actions that an engine asks its worker to carry out, in order."""

from typing import NamedTuple

from sparkplug.metric import Change


class Publish(NamedTuple):
    """Send these values of a machine's twin device in one message."""

    machine: str
    changes: tuple[Change, ...]


class PlainOutput(NamedTuple):
    """Send a plain message on a declared topic, outside Sparkplug; retained, so that whoever comes later reads it too.

    qos: is filled in by the declaration of its topic
    """

    topic: str
    payload: bytes
    retain: bool = True
    qos: int = 0


class Declare(NamedTuple):
    """The machine is online: give birth to its twin device, with what is known of it already."""

    machine: str
    latest: tuple[Change, ...] = ()


class Remove(NamedTuple):
    """The machine is offline: the twin device dies, so that every value of it turns stale at its readers."""

    machine: str


class DeadLetter(NamedTuple):
    """A sample that the fold could not take, as JSON."""

    machine: str
    payload: bytes


class Pin(NamedTuple):
    """Keep what came of a machine in [from_ms, to_ms) for good, and why."""

    machine: str
    from_ms: int
    to_ms: int
    reason: str


Action = Publish | PlainOutput | Declare | Remove | DeadLetter | Pin
