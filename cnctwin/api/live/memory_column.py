"""A column of the last minutes, as the store would give it: samples as they came, or a value for each window."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any

from cnctwin.api.live.trace import Sample
from cnctwin.api.value_object import QUALITY_NAMES
from sparkplug.quality import Quality

_WORST = (Quality.BAD, Quality.STALE, Quality.GOOD)


def column(signal: str, unit: str | None, samples: Sequence[Sample], every_ms: int | None) -> dict[str, Any]:
    """One column as JSON.

    >>> from cnctwin.api.live.trace import Sample
    >>> column("spindle_load_pct", "%", [Sample(0, 1.0, 192, None), Sample(900, 2.0, 192, None)], 1000)["value"]
    [1.5]
    """
    rows = [_as_it_came(sample) for sample in samples] if every_ms is None else list(_windows(samples, every_ms))
    names = ("t", "value", "quality", "reason", "low", "high", "count")
    columns = {name: [row[index] for row in rows] for index, name in enumerate(names)}
    if every_ms is None:
        columns |= {"low": [], "high": [], "count": []}
    return {"signal": signal, "unit": unit, **columns}


def _as_it_came(sample: Sample) -> tuple[Any, ...]:
    return (sample.t_ms, sample.value, QUALITY_NAMES.get(sample.quality, "bad"), sample.reason, None, None, 1)


def _windows(samples: Iterable[Sample], every_ms: int) -> Iterator[tuple[Any, ...]]:
    for index, group in groupby(samples, lambda sample: sample.t_ms // every_ms):
        held = list(group)
        numbers = [number for one in held if (number := _good_number(one)) is not None]
        quality = min((one.quality for one in held), key=lambda one: _WORST.index(Quality(one)))
        reason = next((one.reason for one in reversed(held) if one.quality == quality), None)
        is_number = not isinstance(held[-1].value, str | bool)
        value = (sum(numbers) / len(numbers) if numbers else None) if is_number else held[-1].value
        low, high = (min(numbers, default=None), max(numbers, default=None)) if is_number else (None, None)
        yield (index * every_ms, value, QUALITY_NAMES[quality], reason, low, high, len(held))


def _good_number(sample: Sample) -> float | None:
    value = sample.value
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and sample.quality == Quality.GOOD
    return float(value) if is_number and value is not None else None
