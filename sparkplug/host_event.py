"""The events that a host session hands to its application."""

from enum import Enum
from typing import NamedTuple

from sparkplug.admission.refusal import Refusal
from sparkplug.layouts.layout import Packed
from sparkplug.metric import NodeId, Reading

NODE_OFFLINE = "edge node offline"
"""The detail of a death that came with that of its edge node: it was killed, stopped or cut off."""


class EventKind(Enum):
    """The kind of an event."""

    BIRTH = "birth"
    DATA = "data"
    DEATH = "death"
    HOLE = "hole"
    PLAIN = "plain"
    REFUSED = "refused"


class HostEvent(NamedTuple):
    """Something that an application should know; `device` None means the edge node itself.

    BIRTH carries all readings, DATA what changed, DEATH what became stale; HOLE says in `detail` how many messages are lost
    for good; PLAIN is a message outside Sparkplug, with `topic` and `payload`. REFUSED says in `detail` what was not let in,
    and in `refusal` why; its `device` is a printable, shortened name, and `refused` the number of messages of devices that it
    stands for. Where a part of a message is refused, the rest comes as an event of its own.

    `names` are those of a DATA event's readings: the same tuple for all messages of one layout, so that it can be recognised by
    identity. It is () where it is not given, and where a reading is historical. Where it is given, `oldest_ms` and `newest_ms`
    are those of the readings' time stamps. `seq` is the number of the message that the event comes from, -1 where it comes from
    none, or the node's death. `packed` is the whole message where the session leaves it packed; then there are no readings yet,
    and `read` takes them out.
    """

    kind: EventKind
    node: NodeId
    device: str | None
    timestamp_ms: int
    readings: tuple[Reading, ...] = ()
    detail: str = ""
    topic: str = ""
    payload: bytes = b""
    names: tuple[str, ...] = ()
    oldest_ms: int = 0
    newest_ms: int = 0
    refused: int = 0
    refusal: Refusal | None = None
    seq: int = -1
    packed: Packed | None = None

    def read(self) -> tuple[Reading, ...]:
        """Return the readings, packed or not."""
        return self.readings if self.packed is None else self.packed.readings()
