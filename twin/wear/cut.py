"""A cut record: an operation of a part that has ended, as JSON in `twin/cut_record`.

`load_ratio` is the cutting load over a reference that never changes, so wear stays visible in it. A ratio that is not known is
null.

>>> text = '{"version":1,"program":"O1","tool":3,"operation":"O1|T3|1","part":7,"ended_s":9.0,"load_ratio":1.1}'
>>> cut_of(text).load_ratio
1.1
>>> cut_of('{"version":2}')
'cut record has version 2, and 1 is read'
"""

import json
from math import isfinite
from typing import Any, NamedTuple

VERSION = 1
RATIO_MIN, RATIO_MAX = 0.05, 20.0
"""A ratio outside of these is no wear: the reference is of another cut."""
TEXT_MAX = 120
RECORD_MAX = 4000
STAMP_S_MAX = 253_402_300_000.0
WHOLE_MAX = 2**53


class Cut(NamedTuple):
    """One operation of one part. load_ratio_sd: the spread of the ratio over healthy parts; None = not known"""

    program: str
    tool: int
    operation: str
    part: int
    ended_s: float
    load_ratio: float | None
    load_ratio_sd: float | None = None
    vibration_ratio: float | None = None
    reference: str = "parts"
    is_alarmed: bool = False


def cut_of(text: str) -> Cut | str:
    """Return the cut that a record tells, or why it tells none."""
    if len(text) > RECORD_MAX:
        return f"cut record has {len(text)} characters, and {RECORD_MAX} are read"
    try:
        told = json.loads(text)
    except (ValueError, RecursionError):
        return "cut record is not JSON"
    if not isinstance(told, dict):
        return "cut record is not a JSON object"
    if told.get("version") != VERSION:
        return f"cut record has version {str(told.get('version'))[:20]}, and {VERSION} is read"
    tool, part, ended_s = _whole(told.get("tool")), _whole(told.get("part")), _number(told.get("ended_s"))
    if tool is None or part is None or ended_s is None or abs(ended_s) > STAMP_S_MAX:
        return "cut record lacks its tool, part or end"
    return Cut(
        str(told.get("program") or "")[:TEXT_MAX],
        tool,
        str(told.get("operation") or "")[:TEXT_MAX],
        part,
        ended_s,
        _ratio(told.get("load_ratio")),
        _number(told.get("load_ratio_sd")),
        _ratio(told.get("vibration_ratio")),
        "twin" if told.get("reference") == "twin" else "parts",
        told.get("is_alarmed") is True,
    )


def _number(value: Any) -> float | None:
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300
    return float(value) if is_number and isfinite(value) else None


def _whole(value: Any) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) and abs(value) <= WHOLE_MAX else None


def _ratio(value: Any) -> float | None:
    number = _number(value)
    return number if number is not None and RATIO_MIN <= number <= RATIO_MAX else None
