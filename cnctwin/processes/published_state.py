"""The state that a process publishes: a retained JSON document, with the time `at` at which it was written."""

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any


def parsed(payload: bytes) -> dict[str, Any]:
    """Return the state in a payload; empty where it holds none.

    >>> parsed(b'{"jobs": 2}'), parsed(b"[1]"), parsed(b"{")
    ({'jobs': 2}, {}, {})
    """
    try:
        state = json.loads(payload)
    except (ValueError, RecursionError):
        return {}
    return state if isinstance(state, dict) else {}


def age_s(state: Mapping[str, Any], now_s: float) -> float:
    """Return the age of a state; infinite where it does not say when it was written.

    >>> age_s({"at": "1970-01-01T00:01:00.000Z"}, 90.0), age_s({}, 90.0)
    (30.0, inf)
    """
    try:
        return now_s - datetime.fromisoformat(str(state["at"])).astimezone(UTC).timestamp()
    except (KeyError, ValueError, OverflowError):
        return float("inf")
