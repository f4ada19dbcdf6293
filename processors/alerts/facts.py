"""The facts of an alert: what the machine's row says of it when it begins, as plain values that a text can be filled with.

    value, limit, unit      of a rule, as of the moment it was raised; signal: the one to look at; line: of the NC
    lasted_s                how long it had been so by the time it became an alert
    signal, away, …         of a score: how far which signal is from what, in which lines, like what, and how many peers show it
    signal, regime, away, … of a gap that grows: how far which signal is from where it was, in which regime; way: it scatters
                            or has gone up or down
    away, way               of a drift: by how many per cent the load has gone up or down
    value, left, …          of tool wear: load over a sharp one, parts left; tool: the one that wears fast
    value, limit, fed, …    of processors that are behind (processors/alerts/lag.py)
    control_alarm, line     of the control's own alarm: its text, and the line of the NC at which it came up
    program, tool           what the machine was doing; control: the alarm that the control itself shows then

What is not known is left out. Nothing is taken from a reading that is not good.
"""

import json
import math
from collections.abc import Mapping
from typing import Any

from processors.control_alarms import HIGH, NO_TEXT, NONE
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

PROGRAM, TOOL, CONTROL_ALARM = "program", "tool_number", "alarm"
INPUTS = frozenset(
    {
        *(PROGRAM, TOOL, CONTROL_ALARM, twin_signals.ANOMALY_WHY, twin_signals.RULE_FINDINGS, twin_signals.GAP_FINDINGS),
        *(twin_signals.TOOL_LIVES, twin_signals.MACHINE_DRIFT_FINDINGS),
        *(twin_signals.CONTROL_ALARM_TEXT, twin_signals.CONTROL_ALARM_FINDINGS),
    }
)
PARSED = frozenset(
    {
        *(twin_signals.ANOMALY_WHY, twin_signals.RULE_FINDINGS, twin_signals.GAP_FINDINGS, twin_signals.TOOL_LIVES),
        *(twin_signals.MACHINE_DRIFT_FINDINGS, twin_signals.CONTROL_ALARM_FINDINGS),
    }
)
"""Signals whose text is JSON: read as a whole, and not shown."""
TEXT_MAX = 300
DIFFERENCES = ("K", "°C")
"""Units whose values are subtracted: a temperature has no ratio."""
PCT_MAX = 200.0
OF_WEEKS = frozenset(
    {twin_signals.GAP_GROWING, twin_signals.TOOL_WEARS_FAST, twin_signals.MACHINE_DRIFT, twin_signals.SCORE_DRIFT}
)
"""Alarms of what builds up over hours to weeks: what the machine does when they ring says nothing about them."""
Fact = str | int | float
Facts = dict[str, Fact]
Row = Mapping[str, Reading]


def facts_of(signal: str, row: Row, at_ms: int) -> Facts:
    """Return the facts of an alert whose alarm signal came up at `at_ms`."""
    facts: Facts = {}
    if signal.startswith(twin_signals.RULE_PREFIX):
        facts |= _of_rule(signal.removeprefix(twin_signals.RULE_PREFIX), row, at_ms)
    elif signal == twin_signals.ANOMALY_ALARM:
        facts |= of_score(_object(_text(row, twin_signals.ANOMALY_WHY)))
    elif signal == twin_signals.CONTROL_ALARM:
        shown = _text(row, twin_signals.CONTROL_ALARM_TEXT)
        facts["control_alarm"] = "" if shown in (NONE, NO_TEXT) else shown
        if (line := _number(_of_control_alarm(row).get("line"))) is not None:
            facts["line"] = line
    elif signal == twin_signals.GAP_GROWING:
        facts |= _of_gap(_first(_text(row, twin_signals.GAP_FINDINGS)), at_ms)
    elif signal == twin_signals.TOOL_WEARS_FAST:
        facts |= _of_wear(_text(row, twin_signals.TOOL_LIVES))
    elif signal == twin_signals.MACHINE_DRIFT:
        facts |= _of_drift(_object(_text(row, twin_signals.MACHINE_DRIFT_FINDINGS)), at_ms)
    doing: Facts = {"program": _text(row, PROGRAM), "tool": _text(row, TOOL), "control": _text(row, CONTROL_ALARM)}
    if signal == twin_signals.CONTROL_ALARM:
        del doing["control"]  # its own sentence says it
    if signal in OF_WEEKS:
        doing |= {"program": "", "tool": ""}
    return {name: fact for name, fact in (doing | facts).items() if fact != ""}


def control_says_high(row: Row) -> bool:
    """Return True if the control gives an alarm that stands a high severity."""
    return _of_control_alarm(row).get("severity") == HIGH


def _of_control_alarm(row: Row) -> Mapping[str, Any]:
    return _object(_text(row, twin_signals.CONTROL_ALARM_FINDINGS))


def _of_rule(rule: str, row: Row, at_ms: int) -> Facts:
    found = _object(_text(row, twin_signals.RULE_FINDINGS)).get(rule)
    if not isinstance(found, dict):
        return {}
    facts: Facts = {}
    for name in ("value", "limit", "line"):
        if (number := _number(found.get(name))) is not None:
            facts[name] = number
    facts |= {"unit": _clean(found.get("unit")), "signal": _clean(found.get("signal"))}
    return facts | _lasted(found, at_ms)


def _of_gap(found: Mapping[str, Any], at_ms: int) -> Facts:
    """Return the facts of one of `twin/gap_findings`; its regime may name a program, as "cutting O1701", "section 3 of O1701"."""
    regime, _, of = _clean(found.get("regime")).partition(" ")
    section, _, program = of.rpartition(" of ") if regime == "section" else ("", "", of)
    facts: Facts = {"signal": _clean(found.get("signal")), "way": _clean(found.get("way"))}
    facts |= {"regime": regime, "section": section, "program": program}
    if amount := _number(found.get("amount")):
        facts |= {"away": amount, "away_unit": _clean(found.get("unit"))}
    return facts | _lasted(found, at_ms)


def _of_drift(found: Mapping[str, Any], at_ms: int) -> Facts:
    pct = _number(found.get("pct"))
    if pct is None:
        return {}
    return {"way": "up" if pct >= 0.0 else "down", "away": abs(pct), "away_unit": "%"} | _lasted(found, at_ms)


def _of_wear(lives: str) -> Facts:
    """Return the facts of the tool that wears fast, by `twin/tool_lives`; of several, of the one that is worn most."""
    fast = [one for one in _listed(lives) if one.get("is_fast") is True]
    worst = max(fast, key=lambda one: _number(one.get("wear_pct")) or 0.0, default={})
    band = worst.get("parts_left_band")
    low, high = band if isinstance(band, list) and len(band) == 2 else (None, None)
    found = {"value": worst.get("wear_pct"), "left": worst.get("parts_left"), "left_low": low, "left_high": high}
    facts: Facts = {name: number for name, value in found.items() if (number := _number(value)) is not None}
    return facts | {"tool": _clean(worst.get("tool"))}


def _lasted(found: Mapping[str, Any], at_ms: int) -> Facts:
    """Return how long it had been so when it became an alert."""
    since_ms = _number(found.get("since"))
    return {} if since_ms is None or since_ms > at_ms else {"lasted_s": (at_ms - since_ms) / 1000.0}


def of_score(why: Mapping[str, Any]) -> Facts:
    """Return the facts of `twin/anomaly_why`.

    >>> of_score({"signal": "feed_mm_min", "measured": 440, "expected": 400, "by": "12 parts", "lines": [210, 260], "peers": []})
    ... # doctest: +NORMALIZE_WHITESPACE
    {'signal': 'feed_mm_min', 'side': 'above', 'away': 10.0, 'away_unit': '%', 'against': 'parts', 'parts': 12,
     'line_from': 210.0, 'line_to': 260.0, 'peers': 0}
    """
    if not isinstance(why.get("signal"), str):
        return {}
    facts: Facts = {"signal": _clean(why["signal"])}
    measured, expected = _number(why.get("measured")), _number(why.get("expected"))
    if measured is not None and expected is not None:
        facts |= _away(measured, expected, _clean(why.get("unit")))
    facts |= _against(why.get("by"))
    lines = why.get("lines")
    ends = [number for one in (lines if isinstance(lines, list) else []) if (number := _number(one)) is not None]
    if len(ends) == 2:
        facts |= {"line_from": ends[0], "line_to": ends[1]}
    like = why.get("like")
    first = like[0] if isinstance(like, list) and like and isinstance(like[0], dict) else {}
    likeness = _number(first.get("likeness"))
    if isinstance(first.get("label"), str) and likeness is not None:
        facts |= {"like": _clean(first["label"]), "likeness": likeness}
    peers = why.get("peers", [])
    facts["peers"] = len(peers) if isinstance(peers, list) else 0
    return facts


def _away(measured: float, expected: float, unit: str) -> Facts:
    """Return how far a value is from what was expected: in per cent, as a multiple, or in its own unit."""
    side = "above" if measured >= expected else "below"
    if unit in DIFFERENCES or expected <= 0.0:
        return {"side": side, "away": abs(measured - expected), "away_unit": unit}
    pct = 100.0 * abs(measured / expected - 1.0)
    if pct > PCT_MAX:
        return {"side": side, "away": measured / expected, "away_unit": "times"}
    return {"side": side, "away": max(round(pct, 6), 1.0), "away_unit": "%"}


def _against(by: Any) -> Facts:
    if not isinstance(by, str):
        return {"against": "usual"}
    count, _, unit = by.partition(" ")
    if unit in ("part", "parts") and count.isascii() and count.isdigit():
        return {"against": "part"} if count == "1" else {"against": "parts", "parts": int(count[:6])}
    return {"against": "twin" if by.startswith("the twin") else "usual"}


def _value(row: Row, name: str) -> Any:
    reading = row.get(name)
    return reading.value if reading is not None and reading.quality is Quality.GOOD else None


def _text(row: Row, name: str) -> str:
    value = _value(row, name)
    if isinstance(value, str) and name in PARSED:
        return value
    return _clean(value)


def _clean(value: Any) -> str:
    """Return a short text that can be printed; "" for what is neither a text nor a whole number."""
    if not isinstance(value, (str, int)) or isinstance(value, bool):
        return ""
    return "".join(sign if sign.isprintable() else " " for sign in str(value))[:TEXT_MAX]


def _object(text: str) -> Mapping[str, Any]:
    found = _parsed(text)
    return found if isinstance(found, dict) else {}


def _listed(text: str) -> list[Mapping[str, Any]]:
    found = _parsed(text)
    return [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []


def _first(text: str) -> Mapping[str, Any]:
    return next(iter(_listed(text)), {})


def _parsed(text: str) -> Any:
    try:
        return json.loads(text) if text else None
    except (ValueError, RecursionError):
        return None


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value) else None
