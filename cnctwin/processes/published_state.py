"""The state that a process publishes: a retained JSON document, with the time `at` at which it was written."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any

from cnctwin.errors import UsageError

WRONG_SHAPE = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, OSError)


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


@contextmanager
def of_its_shape(what: str, program: str) -> Iterator[None]:
    """Read a state that anybody on the broker may have written. Raises UsageError where it is not of the shape that is read.

    what: that is read, for the message; program: whose it is
    """
    try:
        yield
    except WRONG_SHAPE as error:
        fault = " ".join(f"{type(error).__name__}: {error}".split())[:100]
        raise UsageError(
            f"{what} are not of the shape that `{program}` publishes ({fault}); is it of another version, or does something else "
            "write there?"
        ) from None
