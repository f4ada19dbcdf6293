"""A tool's life on a control that says what is left of it: used = limit - left.

>>> limits = noted((), EdgeSample("tool_life_limit_min", 60.0, 1))
>>> counted_up(EdgeSample("tool_life_used_min", 45.0, 2), "tool_life_limit_min", limits).value
15.0
"""

from dataclasses import replace

from edge.reading import bad
from edge.sample import EdgeSample
from edge.signals import signal

Limits = tuple[tuple[str, int | float | None], ...]


def noted(limits: Limits, sample: EdgeSample) -> Limits:
    """Return the limits with this one, which may be null."""
    value = sample.value if isinstance(sample.value, int | float) else None
    return tuple(sorted({**dict(limits), sample.signal: value}.items()))


def counted_up(sample: EdgeSample, limit_signal: str, limits: Limits) -> EdgeSample:
    """Return the sample as what was used; null with a reason where that cannot be known. No `limit_signal`: it counts up."""
    left = sample.value
    if not limit_signal or isinstance(left, str) or left is None:
        return sample
    limit = dict(limits).get(limit_signal)
    if limit is None:
        why = f"the control tells what is left, {left:g}, and no limit"
    elif left > limit:
        why = f"the control tells what is left, {left:g}, which is more than the limit of {limit:g}"
    else:
        why = signal(sample.signal).plausible(limit - left) or ""
    value, quality, reason = bad(why) if why or limit is None else (limit - left, sample.quality, sample.reason)
    return replace(sample, value=value, quality=quality, reason=reason)
