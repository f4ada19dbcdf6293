"""The fate of each message: received = emitted + dropped(reason) + buffered, at every moment."""

from collections import Counter
from collections.abc import Sequence
from enum import Enum

from sparkplug.admission.refusal import Refusal
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
    REFUSED_NAME = "refused_name"  # not let in: a name that no topic can hold, or one of the host's own
    REFUSED_STAMP = "refused_stamp"  # not let in: a time stamp that no clock has
    REFUSED_SIZE = "refused_size"  # not let in: a value that is too long
    REFUSED_QUOTA = "refused_quota"  # not let in: too many metrics, devices or nodes
    REFUSED_RATE = "refused_rate"  # not let in: too many messages a second
    OVERLOAD = "overload"  # passed over while more came than could be folded; a newer one of its device was
    FAULT = "fault"  # handling it has failed, or its machine or the processor is set aside after faults


_REFUSED = {
    Refusal.NAME: DropReason.REFUSED_NAME,
    Refusal.RESERVED: DropReason.REFUSED_NAME,
    Refusal.STAMP: DropReason.REFUSED_STAMP,
    Refusal.SIZE: DropReason.REFUSED_SIZE,
    Refusal.QUOTA: DropReason.REFUSED_QUOTA,
    Refusal.RATE: DropReason.REFUSED_RATE,
}
Fates = tuple[DropReason | None, ...]
"""The fates of messages; None = it was folded."""
FOLDED: Fates = (None,)


class Ledger:
    """Counts of one processor, made by its engine. Unit: messages of devices (births, data, deaths)."""

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

    def count(self, fates: Sequence[DropReason | None], received: int = 1) -> None:
        """Count `received` new messages, and the fates of as many as have one by now, of those that waited too; the others wait.

        >>> ledger = Ledger()
        >>> ledger.count(())  # it is held back
        >>> ledger.count((DropReason.LATE, None))  # the next one says that it was late
        >>> ledger.received, ledger.emitted, ledger.dropped_total, ledger.buffered
        (2, 1, 1, 0)
        """
        self.received += received
        if fates is FOLDED and received == 1:  # what nearly every message is
            self.emitted += 1
            return
        self.buffered += received - len(fates)
        for fate in fates:
            if fate is None:
                self.emitted += 1
            else:
                self.dropped[fate] += 1

    def overflowed(self, count: int, reason: DropReason = DropReason.QUEUE_FULL) -> None:
        """Count messages that a queue has lost."""
        self.received += count
        self.dropped[reason] += count

    def refused(self, refusal: Refusal | None, count: int) -> None:
        """Count messages that the host session did not let in. One of which only a part was let in counts as two."""
        if refusal is not None:
            self.received += count
            self.dropped[_REFUSED[refusal]] += count

    def unsent(self, reason: DropReason = DropReason.BROKER_OFFLINE) -> None:
        """The message just emitted could not be sent after all."""
        self.emitted -= 1
        self.dropped[reason] += 1

    def metrics(self) -> dict[str, int]:
        """The ledger by metric name; every reason is there, also at 0."""
        counts = {
            RECEIVED: self.received,
            EMITTED: self.emitted,
            BUFFERED: self.buffered,
            DROPPED: self.dropped_total,
        }
        return counts | {f"{DROPPED_PREFIX}{reason.value}": self.dropped[reason] for reason in DropReason}
