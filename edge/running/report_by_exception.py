"""Report by exception: a sample is published where it says something new.

New is another value by more than the deadband, another quality or reason, or (with `interval_s_max`) the same value after so long
in the machine's own time. The deadband is measured from the value published last, so a slow drift is not lost: |x - x_published|
> deadband.

>>> before = EdgeSample("spindle_load_pct", 20.0, 0)
>>> verdict(None, before) is None, verdict(before, EdgeSample("spindle_load_pct", 21.5, 100), deadband=2.0)
(True, <Drop.DEADBAND: 'deadband'>)
"""

from edge.sample import Drop, EdgeSample
from sparkplug.quality import Quality


def verdict(last: EdgeSample | None, sample: EdgeSample, *, deadband: float = 0.0, interval_ms_max: int = 0) -> Drop | None:
    """Return why the sample is not published after `last`, the one of its signal that was published last (None: it is)."""
    if last is None or last.quality is not sample.quality or last.reason != sample.reason:
        return None
    if interval_ms_max and abs(sample.timestamp_ms - last.timestamp_ms) >= interval_ms_max:
        return None
    if type(last.value) is type(sample.value) and last.value == sample.value:
        return Drop.UNCHANGED
    if deadband and last.quality is Quality.GOOD and _is_number(last.value) and _is_number(sample.value):
        return Drop.DEADBAND if abs(float(sample.value or 0) - float(last.value or 0)) <= deadband else None
    return None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
