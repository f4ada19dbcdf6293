"""The length of a request's body: as much as its route has use for, refused before it is read where it says that it is longer."""

from starlette.exceptions import HTTPException
from starlette.types import Message, Receive

from cnctwin.api.i3x.problem import PREFIX as I3X

BODY_BYTES_MAX = 16_384
I3X_BYTES_MAX = 300_000  # element ids, a thousand of them
OF_PATH = {
    "/login": 4_096,
    "/predict": 8_000_000,  # courses of 100,000 steps
    "/jobs": 4_500_000,  # a program in text
}


def bytes_max(path: str) -> int:
    """Return how long the body of a request to this path may be."""
    return OF_PATH.get(path, I3X_BYTES_MAX if path.startswith(f"{I3X}/") else BODY_BYTES_MAX)


def too_long(path: str) -> str:
    """Return the line of the refusal."""
    return f"the body is longer than the {bytes_max(path)} bytes that {path[:80]} takes"


def is_too_long(path: str, content_length: str) -> bool:
    """Return True if a body is longer than it may be by its own account, or if that is no number.

    >>> is_too_long("/login", "4097"), is_too_long("/login", "80"), is_too_long("/login", "-1")
    (True, False, True)
    """
    return not (content_length.isascii() and content_length.isdigit()) or int(content_length[:20]) > bytes_max(path)


def counted(receive: Receive, path: str) -> Receive:
    """Return the body with its limit, also of one that does not say its length."""
    taken = 0

    async def take() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b""))
        if taken > bytes_max(path):
            raise HTTPException(413, too_long(path))
        return message

    return take
