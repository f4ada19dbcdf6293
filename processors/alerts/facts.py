"""The facts of an alert: what the machine's row says of it when it begins, as plain values that a text can be filled with.

    value, limit, unit      of a rule, as of the moment it was raised; signal: the one to look at; lasted_s: how long that had
                            lasted by then; line: of the NC
    signal, away, …         of a score: how far which signal is from what, in which lines, like what, and how many peers show it
    what_grows, …           a sentence that the processor publishes itself
    program, tool           what the machine was doing; control: the alarm that the control itself shows then

What is not known is left out. Nothing is taken from a reading that is not good.
"""

import json
import math
from collections.abc import Mapping
from typing import Any

from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

PROGRAM, TOOL, CONTROL_ALARM = "program", "tool_number", "alarm"
INPUTS = frozenset(
    {
        *(PROGRAM, TOOL, CONTROL_ALARM, twin_signals.ANOMALY_WHY, twin_signals.RULE_FINDINGS, twin_signals.GAP_GROWING_SIGNAL),
        *(twin_signals.TOOL_WEAR_PCT, twin_signals.TOOL_PARTS_LEFT, twin_signals.TOOL_PARTS_LEFT_LOW),
        *(twin_signals.TOOL_PARTS_LEFT_HIGH, twin_signals.MACHINE_DRIFT_BASIS, twin_signals.CONTROL_ALARM_TEXT),
    }
)
TEXT_MAX = 300
DIFFERENCES = ("K", "°C")
"""Units whose values are subtracted: a temperature has no ratio."""
PCT_MAX = 200.0
Fact = str | int | float
Facts = dict[str, Fact]
Row = Mapping[str, Reading]
_SENTENCES = {twin_signals.GAP_GROWING: ("what_grows", twin_signals.GAP_GROWING_SIGNAL)} | {
    twin_signals.MACHINE_DRIFT: ("what_drifts", twin_signals.MACHINE_DRIFT_BASIS)
}
_WEAR = {
    "value": twin_signals.TOOL_WEAR_PCT,
    "left": twin_signals.TOOL_PARTS_LEFT,
    "left_low": twin_signals.TOOL_PARTS_LEFT_LOW,
    "left_high": twin_signals.TOOL_PARTS_LEFT_HIGH,
}


def facts_of(signal: str, row: Row, at_ms: int) -> Facts:
    """Return the facts of an alert whose alarm signal came up at `at_ms`."""
    facts: Facts = {}
    if signal.startswith(twin_signals.RULE_PREFIX):
        facts |= _of_rule(signal.removeprefix(twin_signals.RULE_PREFIX), row, at_ms)
    elif signal == twin_signals.ANOMALY_ALARM:
        facts |= of_score(_object(_text(row, twin_signals.ANOMALY_WHY)))
    elif signal == twin_signals.TOOL_WEARS_FAST:
        numbers = {name: _number(_value(row, metric)) for name, metric in _WEAR.items()}
        facts |= {name: number for name, number in numbers.items() if number is not None}
    elif signal == twin_signals.CONTROL_ALARM:
        facts["control_alarm"] = _text(row, twin_signals.CONTROL_ALARM_TEXT)
    elif signal in _SENTENCES:
        name, metric = _SENTENCES[signal]
        facts[name] = _text(row, metric)
    facts |= {"program": _text(row, PROGRAM), "tool": _text(row, TOOL), "control": _text(row, CONTROL_ALARM)}
    if signal == twin_signals.CONTROL_ALARM:
        del facts["control"]  # its own sentence says it
    return {name: fact for name, fact in facts.items() if fact != ""}


def _of_rule(rule: str, row: Row, at_ms: int) -> Facts:
    found = _object(_text(row, twin_signals.RULE_FINDINGS)).get(rule)
    if not isinstance(found, dict):
        return {}
    facts: Facts = {}
    for name in ("value", "limit", "line"):
        if (number := _number(found.get(name))) is not None:
            facts[name] = number
    facts |= {"unit": _clean(found.get("unit")), "signal": _clean(found.get("signal"))}
    since_ms = _number(found.get("since"))
    if since_ms is not None and since_ms <= at_ms:
        facts["lasted_s"] = (at_ms - since_ms) / 1000.0
    return facts


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
    if isinstance(value, str) and name in (twin_signals.RULE_FINDINGS, twin_signals.ANOMALY_WHY):
        return value  # parsed, not shown
    return _clean(value)


def _clean(value: Any) -> str:
    """Return a short text that can be printed; "" for what is neither a text nor a whole number."""
    if not isinstance(value, (str, int)) or isinstance(value, bool):
        return ""
    return "".join(sign if sign.isprintable() else " " for sign in str(value))[:TEXT_MAX]


def _object(text: str) -> Mapping[str, Any]:
    try:
        found = json.loads(text) if text else {}
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value) else None
