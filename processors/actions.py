"""The actions that an engine asks its worker to carry out, in order."""

from typing import NamedTuple, Self

from sparkplug.actions import Publish as PlainMessage
from sparkplug.metric import Change


class Publish(NamedTuple):
    """Send these values of a machine's twin device in one message."""

    machine: str
    changes: tuple[Change, ...]


class PlainOutput(PlainMessage):
    """Send a plain message on a declared topic, outside Sparkplug; retained, so that whoever comes later reads it too.

    The connection takes it as it is. qos: is filled in by the declaration of its topic
    """

    __slots__ = ()

    def __new__(cls, topic: str, payload: bytes, qos: int = 0, retain: bool = True) -> Self:
        """Retain the message if nothing else is asked."""
        return super().__new__(cls, topic, payload, qos, retain)


class Declare(NamedTuple):
    """The machine is online: give birth to its twin device, with what is known of it already.

    is_challenged: the challenger's metrics are declared too
    """

    machine: str
    latest: tuple[Change, ...] = ()
    is_challenged: bool = False


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
