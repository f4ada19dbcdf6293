"""The reason of an alarm in one line, for a notification; from the JSON that is published, whoever wrote it.

"spindle_load_pct 18 % above the last 12 parts in lines 210–260; looks like packed chips (0.91); no peer shows it"
"""

import json
import math
from collections.abc import Mapping
from typing import Any

LINE_MAX = 300
DIFFERENCES = ("K", "°C")
PCT_MAX = 200.0


def in_words(text: str) -> str:
    """Return the sentence; "" where the text is no reason.

    >>> in_words('{"signal": "feed_mm_min", "measured": 440, "expected": 400, "by": "12 parts", "lines": [210, 260]}')
    'feed_mm_min 10 % above the last 12 parts in lines 210–260; no peer shows it'
    """
    try:
        why = json.loads(text)
    except (ValueError, RecursionError):
        return ""
    if not isinstance(why, dict) or not isinstance(why.get("signal"), str):
        return ""
    parts = [f"{why['signal']} {_away(why)} {_against(why.get('by'))}{_where(why.get('lines'))}", _likes(why), _peers(why)]
    line = "; ".join(filter(None, parts))
    return "".join(sign if sign.isprintable() else " " for sign in line)[:LINE_MAX]


def _away(why: Mapping[str, Any]) -> str:
    measured, expected = _number(why.get("measured")), _number(why.get("expected"))
    if measured is None or expected is None:
        return "away from"
    side = "above" if measured >= expected else "below"
    unit = why.get("unit") if isinstance(why.get("unit"), str) else ""
    if unit in DIFFERENCES or expected <= 0.0:
        return f"{abs(measured - expected):.3g} {unit} {side}".replace("  ", " ")
    pct = 100.0 * abs(measured / expected - 1.0)
    return f"{measured / expected:.2g} times" if pct > PCT_MAX else f"{max(pct, 1.0):.0f} % {side}"


def _against(by: Any) -> str:
    if not isinstance(by, str):
        return "what is usual"
    if by.startswith("the twin"):
        return "what the twin expects"
    return "the part before" if by == "1 part" else f"the last {by}" if by.endswith(" parts") else "what is usual"


def _where(lines: Any) -> str:
    ends = [_number(one) for one in lines] if isinstance(lines, list) else []
    if len(ends) != 2 or ends[0] is None or ends[1] is None:
        return ""
    return f" in line {ends[0]:.0f}" if ends[0] == ends[1] else f" in lines {ends[0]:.0f}–{ends[1]:.0f}"


def _likes(why: Mapping[str, Any]) -> str:
    like = why.get("like")
    first = like[0] if isinstance(like, list) and like and isinstance(like[0], dict) else {}
    likeness = _number(first.get("likeness"))
    return f"looks like {first['label']} ({likeness:.2f})" if isinstance(first.get("label"), str) and likeness is not None else ""


def _peers(why: Mapping[str, Any]) -> str:
    peers = why.get("peers", [])
    if not isinstance(peers, list) or not peers:
        return "no peer shows it"
    return "a peer shows it too" if len(peers) == 1 else f"{len(peers)} peers show it too"


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value) else None
