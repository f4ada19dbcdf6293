"""The meaning of the status of an answer to a write, the same for all servers: every text fits one line and holds no secret."""

import json
import math
import re
from email.utils import parsedate_to_datetime

from cnctwin.memory.store.influx.server import RefusedError, ServerAnswer, ServerAwayError, TooLargeError

RETRY_AFTER_S_MAX = 300.0
_DROPPED = re.compile(r"dropped=(\d+)")
_LEFT_OUT = re.compile(r"points beyond retention policy")
"""All other lines were taken: nobody needs to look for the culprits."""
_CONTENT = re.compile(
    r"unable to parse|partial write|field type conflict|beyond retention|invalid (field|tag|number|boolean)|missing"
)
"""Texts of a 400 where lines are at fault; any other may come of a proxy or a wrong address, and then no line is."""


def one_line(text: str, token: str) -> str:
    """A server's text, short, in one line, without the token."""
    flat = " ".join(text.split())
    return (flat.replace(token, "…") if token else flat)[:300]


def answer(where: str, status: int, body: str, retry_after: str | None, *, now_s: float, token: str) -> ServerAnswer | None:
    """None where the write was taken, else what to raise."""
    if 200 <= status < 300:
        return None
    said = one_line(message(body), token)
    if status == 413:
        return TooLargeError(f"{where} says 413: {said}")
    if status in {400, 422}:
        dropped = _DROPPED.search(said) if _LEFT_OUT.search(said) else None
        is_sure = status == 422 or _CONTENT.search(said) is not None
        return RefusedError(f"{where} says {status}: {said}", int(dropped[1]) if dropped else None, is_sure=is_sure)
    ways_out = {
        401: "; is the token right?",
        403: "; may the token write there?",
        404: "; are the buckets there, and the address right?",
    }
    return ServerAwayError(
        f"{where} says {status}: {said}{ways_out.get(status, '')}", wait_s(retry_after, now_s), is_fault=status == 500
    )


def message(body: str) -> str:
    """The text in an error's JSON, else the body."""
    try:
        told = json.loads(body)
    except ValueError:
        return body
    if isinstance(told, dict):
        return str(told.get("message") or told.get("error") or body)
    return body


def wait_s(retry_after: str | None, now_s: float) -> float | None:
    """Seconds of a Retry-After, which is a number or a date; at most RETRY_AFTER_S_MAX.

    >>> wait_s("3", 0.0), wait_s("Thu, 01 Jan 1970 00:00:10 GMT", 4.0), wait_s("soon", 0.0)
    (3.0, 6.0, None)
    """
    if not retry_after:
        return None
    try:
        asked = float(retry_after)
    except ValueError:
        try:
            asked = parsedate_to_datetime(retry_after).timestamp() - now_s
        except ValueError:
            return None
    return min(max(asked, 0.0), RETRY_AFTER_S_MAX) if math.isfinite(asked) else None
