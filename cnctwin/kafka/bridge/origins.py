"""The life of its node that a message belongs to: the number of its birth, and the time stamp of its NBIRTH."""

from collections.abc import Callable

from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId
from sparkplug.node_picture import NodePicture
from sparkplug.records.record import Origin

_BIRTH = EventKind.BIRTH


class Origins:
    """See the module. Events are to be given in their order."""

    def __init__(self, picture: Callable[[NodeId], NodePicture | None]) -> None:
        self._picture = picture
        self._lives: dict[NodeId, tuple[int, int]] = {}

    def of(self, event: HostEvent) -> Origin:
        """Return the origin of an event; the birth of a node begins a life."""
        life = self._lives.get(event.node)
        if life is None or (event.device is None and event.kind is _BIRTH):
            picture = self._picture(event.node)
            bd_seq = -1 if picture is None or picture.bd_seq is None else picture.bd_seq
            born_ms = event.timestamp_ms if event.kind is _BIRTH or picture is None else picture.own.birth_ms
            life = self._lives[event.node] = bd_seq, born_ms
        return Origin(life[0], life[1], event.seq)
