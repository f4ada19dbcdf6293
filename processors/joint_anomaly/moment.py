"""One tick of a machine as its control tells it, for a model that compares parts; it waits in the state for its peers."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from processors.joint_anomaly.expectations import Expectations, expected_at
from processors.sample import Sample
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.anomaly.parts.told import Told

PROGRAM, TOOL, LINE = "program", "tool_number", "nc_line"
FEED_OVERRIDE, SPINDLE_OVERRIDE = "feed_override_pct", "spindle_override_pct"
MOMENT_INPUTS = frozenset({PROGRAM, TOOL, LINE, FEED_OVERRIDE, SPINDLE_OVERRIDE})
WHOLE_MAX = 2.0**53


_VALUE, _QUALITY = Reading._fields.index("value"), Reading._fields.index("quality")
_GOOD = Quality.GOOD


class Moment(NamedTuple):
    """values: in the order of the model's signals; None = not known, as with all the others"""

    values: tuple[float | None, ...]
    program: str | None
    tool: int | None
    line: int | None
    feed_override_pct: float | None
    spindle_override_pct: float | None


def moment_of(signals: tuple[str, ...], sample: Sample) -> Moment:
    """Return what a machine's row tells of these signals, and of where it is in its part."""
    row = sample.row
    values = []
    for name in signals:
        reading = row.get(name)
        value = None if reading is None or reading[_QUALITY] is not _GOOD else reading[_VALUE]
        if type(value) is not float or not -math.inf < value < math.inf:  # a float is what nearly every reading is
            value, _ = sample.number(name)
        values.append(value)
    overrides = _number(row, FEED_OVERRIDE), _number(row, SPINDLE_OVERRIDE)
    return Moment(tuple(values), _text(row, PROGRAM), _whole(row, TOOL), _whole(row, LINE), *overrides)


def told_of(moment: Moment, expectations: Expectations, tick: int, is_gated: bool) -> Told:
    """Return a tick as the scores take it, with what the twin expects at its line; expectations: by program."""
    values, program, tool, line, feed_pct, spindle_pct = moment
    expected = expected_at(expectations, program, line, tool)
    return Told(tick, values, program, tool, line, feed_pct, spindle_pct, expected, is_gated)


def _text(row: Mapping[str, Reading], name: str) -> str | None:
    reading = row.get(name)
    value = None if reading is None or reading[_QUALITY] is not _GOOD else reading[_VALUE]
    return None if value is None or value == "" else str(value)


def _number(row: Mapping[str, Reading], name: str) -> float | None:
    reading = row.get(name)
    value = None if reading is None or reading[_QUALITY] is not _GOOD else reading[_VALUE]
    if type(value) is float or type(value) is int:
        return float(value) if -WHOLE_MAX < value < WHOLE_MAX else None
    return None


def _whole(row: Mapping[str, Reading], name: str) -> int | None:
    value = _number(row, name)
    return None if value is None else int(value)
