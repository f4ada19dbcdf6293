"""The reason of an alarm, and what was said of earlier ones, as the interface tells it."""

import json
import time
from typing import Any

from tests.cnctwin.page.fake_server import now_ms
from tests.cnctwin.page.simulated_shop import SignalValue


def why(**more: Any) -> dict[str, Any]:
    """Spindle load above what it was in the last parts."""
    like = [{"label": "packed chips", "likeness": 0.91, "at_s": 1_793_700_000.0}]
    told = {
        "signal": "spindle_load_pct",
        "scale": "cut",
        "program": "O1701",
        "tool": 5,
        "lines": [210, 260],
        "section": 7,
        "measured": 43.66,
        "expected": 37.0,
        "unit": "%",
        "spreads": 5.2,
        "since_s": 42.0,
        "by": "12 parts",
        "like": like,
        "peers": [],
    }
    return told | more


def verdicts(said: dict[str, Any] | None = None, state: str = "on", **more: Any) -> dict[str, Any]:
    """The memory of the alarms of a machine."""
    began_s = round(time.time() - 300.0, 3)
    before = {"verdict": "true", "label": "packed chips", "by": "bob", "at_s": began_s - 80_000.0}
    cut: dict[str, Any] = {"operation": "O1701|T5|1", "signals": ["spindle_load_pct, cut"]}
    alarms = [
        {**cut, "alarm_at_s": began_s, "ended_s": None, "state": state, "said": said},
        {**cut, "alarm_at_s": began_s - 90_000.0, "ended_s": began_s - 89_000.0, "state": "over", "said": before},
    ]
    limit = {"operation": "O1701|T2|1", "signal": "vibration_rms_g", "scale": "seconds", "side": "above", "factor": 1.95}
    told = {
        "version": 1,
        "alarms": alarms,
        "limits": [{**limit, "since_s": began_s - 5e5, "by": "ada"}],
        "outcomes": [],
        "remembered": 14,
        "raised": 1,
        "precision": "9 of the last 14 alarms with a verdict were true: 0.64 (0.43–0.81)",
        "suggestion": None,
    }
    return told | more


def anomaly(machine: str = "vmc", **more: Any) -> dict[str, Any]:
    """As GET /anomaly/{machine} has it."""
    told = {"machine": machine, "now": now_ms(), "is_alarm": True, "score": 2.7, "threshold": 2.0, "reason": None}
    return told | {"why": why(), "why_t": now_ms() - 300_000, "knows": "12 parts", "verdicts": verdicts()} | more


def signals(told: dict[str, Any]) -> dict[str, SignalValue]:
    """Return that document as the stream of a machine has it."""
    text = {name: None if told[name] is None else json.dumps(told[name]) for name in ("why", "verdicts")}
    return {
        "twin/anomaly_alarm": SignalValue(told["is_alarm"], None, "inferred"),
        "twin/anomaly_why": SignalValue(text["why"], None, "inferred", None if text["why"] else "no alarm"),
        "twin/anomaly_verdicts": SignalValue(text["verdicts"], None, "inferred"),
        "twin/anomaly_knows": SignalValue(told["knows"], None, "inferred"),
    }
