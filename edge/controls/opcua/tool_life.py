"""A tool's life: on a control that says what is left of it, used = limit - left; and as OPC 40501-1 has it.

>>> limits = noted((), EdgeSample("tool_life_limit_min", 60.0, 1))
>>> counted_up(EdgeSample("tool_life_used_min", 45.0, 2), "tool_life_limit_min", limits).value
15.0
"""

import json
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace

from edge.reading import Target, bad, read_value, without_noise
from edge.sample import EdgeSample
from edge.signals import signal
from edge.sweep import Fact
from sparkplug.quality import Quality

TOOL_LIFE = "tool_life"  # the key of the fact that has all of the life of the tool in the spindle
MINUTES = {"h": 60.0, "min": 1.0, "s": 1 / 60}

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
    value, quality, reason = bad(why) if why or limit is None else (_used(limit, left), sample.quality, sample.reason)
    return replace(sample, value=value, quality=quality, reason=reason)


def _used(limit: float, left: float) -> float:
    return limit - left if isinstance(limit, int) and isinstance(left, int) else without_noise(limit - left)


@dataclass(frozen=True, slots=True)
class LifeEntry:
    """One ToolLifeEntry (OPC 40501-1, 11.1). It counts up from `start` to `limit`, or down; null is what a server leaves out.

    indication: 0 time, 1 parts, 2 usages (12.8); unit: of a time, which is to be hours
    """

    indication: int
    counts_up: bool
    value: float
    start: float | None = None
    limit: float | None = None
    unit: str = ""


def life_fact(entries: Sequence[LifeEntry], at_ms: int | None = None) -> Fact:
    """Return what a server tells of the life of the tool in the spindle as one fact."""
    return Fact(TOOL_LIFE, json.dumps([astuple(entry) for entry in entries], separators=(",", ":")), "", at_ms)


def life_samples(fact: Fact, told: Sequence[str], at_ms: int) -> tuple[EdgeSample, ...]:
    """Return the signals of a tool's life; null those of `told`, the ones published before, that this tool does not have.

    >>> fact = life_fact([LifeEntry(0, counts_up=False, value=0.75, start=1.0, limit=0.0, unit="h")])
    >>> [(sample.signal, sample.value) for sample in life_samples(fact, (), 1)]
    [('tool_life_limit_min', 60.0), ('tool_life_used_min', 15.0)]
    """
    found: dict[str, EdgeSample] = {}
    for entry in [] if fact.fault else _entries(fact):
        kind = "min" if entry.indication == 0 else "count"
        if entry.indication in (0, 1, 2) and f"tool_life_used_{kind}" not in found:
            found |= {sample.signal: sample for sample in _life(entry, kind, at_ms)}
    gone = fact.fault or "the control keeps no such life of this tool"
    null = {name: EdgeSample(name, None, at_ms, Quality.BAD, gone) for name in told if name not in found}
    samples = [*found.values(), *null.values()]
    return tuple(replace(sample, observations=int(not number)) for number, sample in enumerate(samples))


def _life(entry: LifeEntry, kind: str, at_ms: int) -> tuple[EdgeSample, EdgeSample]:
    start, limit = entry.start, entry.limit
    used: float | None = None
    whole: float | None = None
    if entry.counts_up:
        used = entry.value - (start or 0.0)
        whole = None if limit is None else limit - (start or 0.0)
    elif start is not None:
        used, whole = start - entry.value, start - (limit or 0.0)
    factor = MINUTES.get(entry.unit, 60.0) if kind == "min" else 1.0
    missing = "the control tells what is left, and not where it began" if used is None else "the control tells no limit"
    return _figure(f"tool_life_limit_{kind}", whole, factor, missing, at_ms), _figure(
        f"tool_life_used_{kind}", used, factor, missing, at_ms
    )


def _figure(name: str, value: float | None, factor: float, missing: str, at_ms: int) -> EdgeSample:
    known = signal(name)
    outcome = bad(missing) if value is None else read_value(Target(name, name, factor, 0.0, known.low, known.high), value)
    return EdgeSample(name, outcome[0], at_ms, outcome[1], outcome[2])


def _entries(fact: Fact) -> list[LifeEntry]:
    try:
        return [_entry(*row) for row in json.loads(fact.value)] if isinstance(fact.value, str) else []
    except (ValueError, TypeError, RecursionError):
        return []


def _entry(*row: object) -> LifeEntry:
    indication, counts_up, value, start, limit, unit = row
    if type(indication) is not int or not isinstance(counts_up, bool) or not isinstance(unit, str):
        raise TypeError(f"{row!r} is no life of a tool")
    whole, begin, end = (None if one is None else float(one) for one in (value, start, limit))  # type: ignore[arg-type]
    if whole is None:
        raise TypeError("a life without a value")
    return LifeEntry(indication, counts_up, whole, begin, end, unit)
