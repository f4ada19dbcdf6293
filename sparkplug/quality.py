"""Trust in a value (Sparkplug 3.0.0, 6.4.14: the property `Quality`)."""

from enum import IntEnum

QUALITY_PROPERTY = "Quality"
REASON_PROPERTY = "reason"


class Quality(IntEnum):
    """The three codes that the specification names."""

    BAD = 0
    GOOD = 192
    STALE = 500
