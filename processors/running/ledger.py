"""Where each message went: received = emitted + dropped(reason) + buffered, at every moment."""

from collections import Counter
from enum import Enum

from twin.vocabulary.node_ledger import BUFFERED, DROPPED, DROPPED_PREFIX, EMITTED, RECEIVED


class DropReason(Enum):
    """Why a message of a device led to nothing."""

    QUEUE_FULL = "queue_full"  # the queue behind the network thread was full
    BEFORE_BIRTH = "before_birth"  # data of a device that has not said what it offers
    ALREADY_DEAD = "already_dead"  # a second death
    SUPERSEDED = "superseded"  # only readings that are older than what is known of the same signals
    LATE = "late"  # far behind the machine's clock, and no second message agreed
    NAME_CLASH = "name_clash"  # only signals that another edge of the same machine owns
    SIGNALS_MAX = "signals_max"  # a birth with more signals than a row may hold
    MACHINES_MAX = "machines_max"  # one machine too many
    DEAD_LETTER = "dead_letter"  # the step failed
    BROKER_OFFLINE = "broker_offline"  # folded, but its results could not be sent


class Ledger:
    """Counts of one processor. Unit: messages of devices (births, data, deaths)."""

    __slots__ = ("buffered", "dropped", "emitted", "received")

    def __init__(self) -> None:
        self.received = 0
        self.emitted = 0
        self.buffered = 0
        self.dropped: Counter[DropReason] = Counter()

    @property
    def dropped_total(self) -> int:
        """Messages dropped for any reason."""
        return sum(self.dropped.values())

    @property
    def balance(self) -> int:
        """0, or we have a bug."""
        return self.received - self.emitted - self.buffered - self.dropped_total

    def drop(self, reason: DropReason, count: int = 1) -> None:
        """Count messages that led to nothing."""
        self.dropped[reason] += count

    def unsent(self) -> None:
        """The message just emitted could not be sent after all."""
        self.emitted -= 1
        self.dropped[DropReason.BROKER_OFFLINE] += 1

    def metrics(self) -> dict[str, int]:
        """The ledger by metric name; every reason is there, also at 0."""
        counts = {
            RECEIVED: self.received,
            EMITTED: self.emitted,
            BUFFERED: self.buffered,
            DROPPED: self.dropped_total,
        }
        return counts | {f"{DROPPED_PREFIX}{reason.value}": self.dropped[reason] for reason in DropReason}
