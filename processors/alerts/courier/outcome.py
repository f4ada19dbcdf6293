"""The outcome of an attempt to send."""

from enum import Enum
from typing import NamedTuple


class Verdict(Enum):
    """The knowledge about an attempt."""

    DELIVERED = "delivered"  # the receiver has it
    REFUSED = "refused"  # the receiver has it not, and trying again would not help
    NOT_TAKEN = "not taken"  # the receiver has it surely not: it may be tried again
    UNSURE = "unsure"  # it may have it: it is not tried again


class Outcome(NamedTuple):
    """The verdict with its reason; what the receiver asks to wait; the receipt of an emergency."""

    verdict: Verdict
    reason: str = ""
    after_s: float | None = None
    receipt: str = ""
