"""One native text, or typed value, to one canonical value, with quality and reason.

>>> read(Target("Fact", "feed_mm_min", factor=60.0, low=0, high=300000), "2.5")
(150.0, <Quality.GOOD: 192>, None)
>>> read(Target("Sload", "spindle_load_pct", low=0, high=200), "950")
(None, <Quality.BAD: 0>, 'outside 0 to 200 %: 950')
"""

import math
import re
import struct
from dataclasses import dataclass, replace

from edge.sample import EMPTY, UNAVAILABLE
from edge.signals import signal
from sparkplug.quality import Quality
from twin.vocabulary.signals import Kind, Signal

TEXT_LENGTH_MAX = 8192
_FLOAT32 = struct.Struct("<f")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?", re.ASCII)
_FLAGS = {"ON": True, "ACTIVE": True, "OPEN": True, "TRUE": True, "1": True} | {
    "OFF": False,
    "INACTIVE": False,
    "CLOSED": False,
    "FALSE": False,
    "0": False,
}
_SYNONYMS = {"MDI": "MANUAL_DATA_INPUT", "AUTO": "AUTOMATIC", "MEMORY": "AUTOMATIC", "JOG": "MANUAL", "HANDLE": "MANUAL"}
_SYNONYMS |= {"IDLE": "READY", "RUNNING": "ACTIVE", "HOLD": "FEED_HOLD"}

Value = str | int | float | bool | None
Outcome = tuple[Value, Quality, str | None]


@dataclass(frozen=True, slots=True)
class Target:
    """One data item and the signal that it feeds: canonical = value * factor + offset.

    `kind` is that of a chosen PLC address; None: as the vocabulary has it.
    """

    data_item_id: str
    signal: str
    factor: float = 1.0
    offset: float = 0.0
    low: float | None = None
    high: float | None = None
    kind: Kind | None = None

    @property
    def known(self) -> Signal:
        """Return the canonical signal, of the kind that the configuration chose."""
        known = signal(self.signal)
        return known if self.kind is None else replace(known, kind=self.kind)


def read(target: Target, text: str) -> Outcome:
    """The value that this text stands for. A null always has a reason."""
    known = target.known
    if text == "UNAVAILABLE":
        return None, Quality.BAD, UNAVAILABLE
    if len(text) > TEXT_LENGTH_MAX:
        return bad(f"text of {len(text)} characters")
    if known.kind is Kind.TEXT:
        return _text(known, text)
    if not text:
        # A control that shows no tool number says that there is none: that is a good answer. An empty figure is not.
        return None, Quality.GOOD if target.signal == "tool_number" else Quality.BAD, EMPTY
    if known.kind is Kind.FLAG:
        flag = _FLAGS.get(text.upper())
        return bad(f"neither on nor off: {text[:80]!r}") if flag is None else (flag, Quality.GOOD, None)
    if not _NUMBER.fullmatch(text):
        return bad(f"not a number: {text[:80]!r}")
    return _figure(target, known, float(text))


def read_value(target: Target, value: Value) -> Outcome:
    """The value that this typed value stands for, from a control that does not answer in text. A null always has a reason.

    >>> read_value(Target("acts", "spindle_rpm", low=0, high=60000), 3500)
    (3500.0, <Quality.GOOD: 192>, None)
    >>> read_value(Target("tool", "tool_number"), 7.5)
    (None, <Quality.BAD: 0>, 'not a whole number: 7.5')
    """
    known = target.known
    if value is None:
        return None, Quality.BAD, UNAVAILABLE
    if isinstance(value, str):
        return read(target, value)
    if known.kind is Kind.FLAG:
        return (bool(value), Quality.GOOD, None) if value in (0, 1) else bad(f"neither on nor off: {value}")
    if isinstance(value, bool):
        return bad(f"not a {'text' if known.kind is Kind.TEXT else 'number'}: {value}")
    if isinstance(value, float) and not math.isfinite(value):
        return bad(f"not a finite number: {value:g}")
    if known.kind is Kind.TEXT:
        return _text(known, str(value))
    if known.kind is Kind.INTEGER and isinstance(value, int):  # not by way of a float, which has 53 bits
        return (value, Quality.GOOD, None) if abs(value) < 2**63 else bad("not a whole number of 64 bits")
    return _figure(target, known, float(value)) if abs(value) <= 1e300 else bad("not a finite number: above 1e300")


def bad(reason: str) -> Outcome:
    """A null that cannot be used, and why."""
    return None, Quality.BAD, reason


def _text(known: Signal, text: str) -> Outcome:
    if not known.words:
        return text, Quality.GOOD, None
    word = text.upper()
    word = _SYNONYMS.get(word, word)
    return (word, Quality.GOOD, None) if word in known.words else bad(f"no word of the vocabulary: {text[:80]!r}")


def without_noise(computed: float) -> float:
    """Return 12 digits of a value that was computed, beyond which there is only the noise of binary fractions.

    >>> without_noise(3.0 * 0.1), 3.0 * 0.1
    (0.3, 0.30000000000000004)
    """
    return float(f"{computed:.12g}")


def shortest_of_float32(value: float) -> float:
    """Return the shortest decimal that is the same value in 32 bits, which is what the control's own screen shows.

    >>> shortest_of_float32(12.300000190734863)
    12.3
    """
    for digits in range(6, 10):
        short = float(f"{value:.{digits}g}")
        if _FLOAT32.unpack(_FLOAT32.pack(short))[0] == value:
            return short
    return value


def _figure(target: Target, known: Signal, native: float) -> Outcome:
    if abs(native) > 1e300:
        return bad(f"not a finite number: {native:g}")
    if known.kind is Kind.INTEGER:
        whole = native == int(native) and abs(native) < 2**63
        return (int(native), Quality.GOOD, None) if whole else bad(f"not a whole number: {native:g}")
    is_as_it_was = target.factor == 1.0 and not target.offset
    value = native if is_as_it_was else without_noise(native * target.factor + target.offset)
    if target.low is None or target.high is None or target.low <= value <= target.high:
        return value, Quality.GOOD, None
    return bad(replace(known, low=target.low, high=target.high).plausible(value) or "")
