"""One observation, and how the values of an SHDR entry become one."""

from typing import NamedTuple

from cnctwin.standins.mtconnect_agent.data_set import DataSet, parse_data_set
from cnctwin.standins.mtconnect_agent.device_model import UNAVAILABLE, DataItem
from cnctwin.standins.mtconnect_agent.shdr import CONDITION_LEVELS
from cnctwin.standins.mtconnect_agent.units import number_text


class Observation(NamedTuple):
    """A value of a data item at a moment. `level` is a condition's (Normal, Warning, Fault, Unavailable), else empty."""

    item: DataItem
    timestamp: str
    value: str
    level: str = ""
    native_code: str = ""
    attributes: tuple[tuple[str, str], ...] = ()
    entries: DataSet | None = None
    is_reset: bool = False
    sequence: int = 0

    @property
    def is_unavailable(self) -> bool:
        return self.level == "Unavailable" if self.item.is_condition else self.value == UNAVAILABLE

    def says_the_same(self, other: "Observation") -> bool:
        """Compare everything but when it was said."""
        return self.level == other.level and self.value == other.value and self.attributes == other.attributes


def unavailable(item: DataItem, timestamp: str) -> Observation:
    """Return the observation that nothing is known; a constant data item says its constant all the same."""
    if item.is_condition:
        return Observation(item, timestamp, "", level="Unavailable")
    if item.is_asset_event:
        return Observation(item, timestamp, UNAVAILABLE, attributes=(("assetType", UNAVAILABLE),))
    return Observation(item, timestamp, item.constant or UNAVAILABLE)


def observe(item: DataItem, timestamp: str, values: tuple[str, ...], *, reads_numbers: bool) -> Observation | None:
    """Make an observation of the values that follow a key; None where a condition's level is none.

    An empty event stays empty: an element without text. With `reads_numbers` (agent 2.x) a sample that is no number,
    an empty one too, becomes UNAVAILABLE; without it (agent 1.4) it is handed on as text.
    """
    first = values[0] if values else UNAVAILABLE
    if item.is_condition:
        return _condition(item, timestamp, values)
    if item.width == 1:
        if first.upper() == UNAVAILABLE:
            return Observation(item, timestamp, UNAVAILABLE)
        if item.is_data_set:
            return _data_set(item, timestamp, first)
        if item.is_sample:
            return Observation(item, timestamp, _sample_text(item, first, reads_numbers))
        return Observation(item, timestamp, first.upper())
    return _with_attributes(item, timestamp, values)


def _condition(item: DataItem, timestamp: str, values: tuple[str, ...]) -> Observation | None:
    level, code, severity, qualifier, text = (*values, "", "", "", "", "")[:5]
    if level.upper() not in CONDITION_LEVELS:
        return None
    level = level.capitalize()
    if level == "Unavailable":
        return Observation(item, timestamp, "", level)
    pairs = (("nativeCode", code), ("nativeSeverity", severity), ("qualifier", qualifier.upper()))
    return Observation(item, timestamp, text, level, code, tuple(p for p in pairs if p[1]))


def _data_set(item: DataItem, timestamp: str, text: str) -> Observation:
    attributes: tuple[tuple[str, str], ...] = ()
    if text.startswith(":"):  # `:MANUAL a=1` empties the set before it is filled
        trigger, _, text = text[1:].partition(" ")
        attributes = (("resetTriggered", trigger.upper()),)
    entries = parse_data_set(text, is_table=item.representation == "TABLE")
    return Observation(item, timestamp, "", attributes=attributes, entries=entries, is_reset=bool(attributes))


def _with_attributes(item: DataItem, timestamp: str, values: tuple[str, ...]) -> Observation:
    """Read the kinds that carry attributes before their text: messages, alarms, time series, asset events."""
    if item.representation == "TIME_SERIES":
        names: tuple[str, ...] = ("sampleCount", "sampleRate")
    elif item.is_message:
        names = ("nativeCode",)
    elif item.is_asset_event:
        names = ("assetType",)
    else:
        names = ("code", "nativeCode", "severity", "state")
    padded = (*values, *[""] * item.width)[: item.width]
    if any(v.upper() == UNAVAILABLE for v in values) or not any(padded):
        return unavailable(item, timestamp)
    pairs = tuple((n, v) for n, v in zip(names, padded, strict=False) if v)
    return Observation(item, timestamp, padded[-1], attributes=pairs)


def _sample_text(item: DataItem, text: str, reads_numbers: bool) -> str:
    if not reads_numbers and item.conversion is None:
        return text
    try:
        numbers = [float(part) for part in text.split()]
    except ValueError:
        return UNAVAILABLE if reads_numbers else text
    if len(numbers) != 1 and not item.is_vector:
        return UNAVAILABLE if reads_numbers else text
    if item.conversion is not None:
        numbers = [item.conversion.apply(n) for n in numbers]
    return " ".join(map(number_text, numbers))
