"""Topics and the ids in them (Sparkplug 3.0.0, chapter 4).

>>> Topic.parse("spBv1.0/cnc/DDATA/edge-okuma/okuma")
Topic(verb=<Verb.DDATA: 'DDATA'>, node=NodeId(group='cnc', node='edge-okuma'), device='okuma')
>>> str(Topic(Verb.NBIRTH, NodeId("cnc", "edge-okuma")))
'spBv1.0/cnc/NBIRTH/edge-okuma'
"""

from enum import StrEnum
from functools import lru_cache
from typing import NamedTuple

from sparkplug.errors import TopicError

NAMESPACE = "spBv1.0"
STATE_PREFIX = f"{NAMESPACE}/STATE/"
REMEMBERED_MAX = 1024  # a longer topic is split again each time
_FORBIDDEN = ("+", "/", "#")


class Verb(StrEnum):
    """The message types; STATE stands apart, since its topic has another shape."""

    NBIRTH = "NBIRTH"
    NDEATH = "NDEATH"
    NDATA = "NDATA"
    NCMD = "NCMD"
    DBIRTH = "DBIRTH"
    DDEATH = "DDEATH"
    DDATA = "DDATA"
    DCMD = "DCMD"

    @property
    def of_device(self) -> bool:
        """Return whether the topic names a device."""
        return self.value.startswith("D")

    @property
    def counted(self) -> bool:
        """Return whether the message carries a sequence number: all but NDEATH and commands (6.4.2)."""
        return self not in (Verb.NDEATH, Verb.NCMD, Verb.DCMD)


class NodeId(NamedTuple):
    """The edge node descriptor: group and node id, unique on a broker."""

    group: str
    node: str

    def __str__(self) -> str:
        return f"{self.group}/{self.node}"


class Topic(NamedTuple):
    """The topic of a message of an edge node or a device."""

    verb: Verb
    node: NodeId
    device: str | None = None

    def __str__(self) -> str:
        base = f"{NAMESPACE}/{self.node.group}/{self.verb.value}/{self.node.node}"
        return base if self.device is None else f"{base}/{self.device}"

    @staticmethod
    def parse(text: str) -> "Topic":
        """Split a topic; raises TopicError where it is none of an edge node or device."""
        return _remembered(text) if len(text) <= REMEMBERED_MAX else _parsed(text)


def _parsed(text: str) -> Topic:
    parts = text.split("/")
    if parts[0] != NAMESPACE:
        raise TopicError(f"topic {text!r} does not begin with {NAMESPACE}/")
    if not 4 <= len(parts) <= 5:
        raise TopicError(f"topic {text!r} has {len(parts)} levels; 4 name a node, 5 a device")
    try:
        verb = Verb(parts[2])
    except ValueError:
        raise TopicError(f"topic {text!r}: {parts[2]!r} is no message type of Sparkplug 3.0.0") from None
    if verb.of_device != (len(parts) == 5):
        raise TopicError(f"topic {text!r}: {verb.value} {'needs' if verb.of_device else 'has no'} device id")
    device = check_id(parts[4], "device id") if len(parts) == 5 else None
    return Topic(verb, NodeId(check_id(parts[1], "group id"), check_id(parts[3], "edge node id")), device)


_remembered = lru_cache(maxsize=4096)(_parsed)


def check_id(text: str, what: str) -> str:
    """Hand back `text` where it may stand in a topic; raises TopicError (any UTF-8 but +, / and #)."""
    if not text:
        raise TopicError(f"{what} is empty; give it at least one character")
    for character in _FORBIDDEN:
        if character in text:
            raise TopicError(f"{what} {text!r} holds {character!r}; '+', '/' and '#' cannot stand in a topic")
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise TopicError(f"{what} {text!r} cannot be written as UTF-8: {error}") from error
    if "\0" in text:
        raise TopicError(f"{what} {text!r} holds a zero byte, which MQTT forbids in a topic")
    return text


def state_topic(host_id: str) -> str:
    """The topic on which a host application says whether it is online (4.1 and 5.6; 2.2 had `STATE/<id>`).

    >>> state_topic("scada")
    'spBv1.0/STATE/scada'
    """
    return f"{STATE_PREFIX}{check_id(host_id, 'host id')}"


def group_filter(group: str) -> str:
    """The filter that hears all messages of a group's edge nodes.

    >>> group_filter("cnc")
    'spBv1.0/cnc/#'
    """
    return f"{NAMESPACE}/{group}/#"


def uncommanded_filters(group: str) -> tuple[str, ...]:
    """The filters that hear all births, data and deaths of a group, and no commands.

    >>> uncommanded_filters("cnc")[:2], len(uncommanded_filters("cnc"))
    (('spBv1.0/cnc/NBIRTH/+', 'spBv1.0/cnc/NDEATH/+'), 6)
    """
    verbs = (verb for verb in Verb if verb not in (Verb.NCMD, Verb.DCMD))
    return tuple(f"{NAMESPACE}/{group}/{verb.value}/{'+/+' if verb.of_device else '+'}" for verb in verbs)
