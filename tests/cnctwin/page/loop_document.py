"""The document of a machine's loop as the page gets it, step by step: watched, diagnosed, tried, promoted."""

import hashlib
import json
from typing import Any

from tests.cnctwin.page.fake_server import now_ms

SALT = "a1" * 32
STATEMENT = {
    "added": {"effect": "coolant_cooling", "on": "", "parameters": {"gain": 2.1}},
    "equation": "1/R = 1/R (1 + gain · coolant_on)",
    "parameters": {"gain": {"value": 2.1, "unit": "", "meaning": "part by which the cooling is more while the coolant is on"}},
}
TEXT = json.dumps(STATEMENT, sort_keys=True)
SHA256 = hashlib.sha256(f"{SALT}\n{TEXT}".encode()).hexdigest()
CAUSE = {
    "effect": "coolant_cooling",
    "on": "",
    "probability": 0.94,
    "parameters": {"gain": {"value": 2.04, "low": 1.8, "high": 2.3, "unit": ""}},
    "indistinguishable_from": [{"effect": "second_thermal_mass", "on": ""}],
}


def loop(machine: str, step: str, *, revealed: bool = False, ready: bool = True, **more: Any) -> dict[str, Any]:
    """The document at a step; ready: the challenger may be promoted."""
    now = now_ms()
    tried = step == "shadow"
    texts = {
        "watching": "the gap of the temperature is open at 6.1 floors since 12:03",
        "composing": "the last 104 s are cut out of the history",
        "diagnosing": "14 of 24 effects are tried on the heat",
        "shadow": "the challenger runs beside the live twin, and its gap is 1.1 floors",
        "promoted": "the challenger is live, and the gap is closed",
        "refused": "no effect explains the gap; the live twin stays",
    }
    challenger = {
        "version": "0f1e2d3c4b5a",
        "since": now - 20_000,
        "sentence": "coolant cools: it takes twice the heat off while it is on",
        "verdict": "explained",
        "causes": [CAUSE],
        "gap_before": 6.1,
        "gap_after": 1.12,
    }
    promoted = {
        "text": "coolant cools: gap of the temperature 6.1 → 1.1 floors",
        "before": 6.1,
        "after": 1.1,
        "since": now - 30_000,
    }
    first = {"t": now - 300_000, "step": "edit", "version": "c0ffee000000", "by": "the demo", "why": "first description"}
    later = {
        "t": now - 30_000,
        "step": "promote",
        "version": "0f1e2d3c4b5a",
        "by": "ada",
        "why": "coolant cools",
        "before": 6.1,
        "after": 1.1,
    }
    was = step == "promoted"
    return {
        "machine": machine,
        "step": step,
        "since": now - 12_000,
        "text": texts[step],
        "progress": 0.58 if step == "diagnosing" else None,
        "case": None,
        "job": "diagnose-1" if step == "diagnosing" else None,
        "live": {"version": "0f1e2d3c4b5a" if was else "c0ffee000000", "since": now - 300_000, "by": "the demo", "why": ""},
        "challenger": challenger if tried else None,
        "standing": {
            "spindle_temp_c": {"live": 1.1 if was else 6.1, "challenger": 1.1 if tried else None},
            "spindle_load_pct": {"live": 0.9, "challenger": 0.9 if tried else None},
        },
        "score": {"live": 5.8, "challenger": 1.2, "runs": 2} if tried else None,
        "may_promote": tried and ready,
        "why_not": None if tried and ready else "the challenger has run for 4 s; 15 s are asked for",
        "last": promoted if was else None,
        "steps": [first, later] if was else [first],
        "sealed": {"sha256": SHA256, "revealed": {**STATEMENT, "salt": SALT, "text": TEXT} if revealed else None},
        **more,
    }
