"""An edge node as a host session watches it: its picture, with what is needed to keep its messages in order."""

from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from sparkplug.node_picture import NodePicture
from sparkplug.sequence import SequenceWindow
from sparkplug.topics import Topic

DOUBTS_MAX = 3
DOUBT_MS = 600_000


@dataclass(slots=True)
class Watched:
    """See the module.

    received_ms: when its last birth or death came, by the host's clock
    awaiting: devices that were known before the last NBIRTH and have not been born since
    doubts_ms: when its numbers were last doubted
    """

    picture: NodePicture
    window: SequenceWindow
    received_ms: int = 0
    awaiting: set[str] | None = None
    doubts_ms: deque[int] = field(default_factory=lambda: deque(maxlen=DOUBTS_MAX))

    def is_doubted(self, now_ms: int) -> bool:
        """Its numbers did not fit: return True where its birth should be asked for.

        A peer that counts sloppily is let be; but its numbers may also have begun again with a birth that was lost. The birth is
        asked for, at most `DOUBTS_MAX` times in `DOUBT_MS`, so that a sloppy peer is not made to repeat it for ever.
        """
        doubts_ms = self.doubts_ms
        if len(doubts_ms) == DOUBTS_MAX and now_ms - doubts_ms[0] < DOUBT_MS:
            return False
        doubts_ms.append(now_ms)
        return True


class Received(NamedTuple):
    """A message and the bytes from which it was parsed."""

    topic: Topic
    message: Any
    payload: bytes
