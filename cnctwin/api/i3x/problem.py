"""The shapes of i3X's answers: success, failure and bulk (Implementation Guide, "Response Format"; the detail is RFC 9457's)."""

from collections.abc import Iterable
from http import HTTPStatus
from typing import Any

PREFIX = "/i3x/v1"
"""The base address of the interface, with the version that the guide asks for."""
Json = dict[str, Any]


def detail(status: int, text: str, title: str | None = None) -> Json:
    """Return the `responseDetail` of an answer.

    >>> detail(404, "Element not found: pump-101")
    {'title': 'Not Found', 'status': 404, 'detail': 'Element not found: pump-101'}
    """
    return {"title": HTTPStatus(status).phrase if title is None else title, "status": status, "detail": text}


def failure(status: int, text: str) -> Json:
    """Return the body of a request that failed as a whole."""
    return {"success": False, "responseDetail": detail(status, text)}


def success(result: Any) -> Json:
    """Return the body of a request that did not ask for several things at once."""
    return {"success": True, "result": result}


def item(key: str, name: str, result: Any) -> Json:
    """Return what became of one of several things that were asked for."""
    return {"success": True, key: name, "result": result}


def missing(key: str, name: str, what: str) -> Json:
    """Return the entry of something that was asked for and is not known."""
    return {"success": False, key: name, "responseDetail": detail(404, f"{what} not found: {name[:200]}")}


def bulk(items: Iterable[Json]) -> Json:
    """Return the entries in the order of the request."""
    results = list(items)
    return {"success": all(one["success"] for one in results), "results": results}
