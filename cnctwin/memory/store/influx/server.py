"""The sender's view of a server, and what a server may answer.

ServerAnswer
├── ServerAwayError    not now: down, too busy, or it does not let us in; everything is kept and tried again
└── RefusedError       never: what the batch holds is at fault; the culprit is looked for
"""

from typing import Protocol


class ServerAnswer(Exception):  # noqa: N818 — an answer, which is an error only for who cannot go on
    """The root: a write was not taken."""


class ServerAwayError(ServerAnswer):
    """Not now. `retry_after_s` is what the server asks for, if it does; `is_fault`: it answered 500, which a batch may cause."""

    def __init__(self, text: str, retry_after_s: float | None = None, *, is_fault: bool = False) -> None:
        super().__init__(text)
        self.retry_after_s, self.is_fault = retry_after_s, is_fault


class RefusedError(ServerAnswer):
    """Never.

    dropped: so many lines of the batch it has left out, all others it has taken; None where it does not say
    is_sure: the text says that lines are at fault; else that is only believed where other lines pass
    """

    def __init__(self, text: str, dropped: int | None = None, *, is_sure: bool = True) -> None:
        super().__init__(text)
        self.dropped, self.is_sure = dropped, is_sure


class TooLargeError(RefusedError):
    """The batch is too large in bytes: a half of it may pass."""


class Server(Protocol):
    """A server that takes line protocol. One thread.

    settle_s: for so long what it has acknowledged may be lost when it is killed; 0 = acknowledged is on its disk
    """

    settle_s: float

    def write(self, bucket: str, lines: bytes) -> None:
        """Have the lines taken, or raise a ServerAnswer."""

    def incarnation(self) -> str:
        """Another text after each start of the server; raises ServerAwayError. Only asked where settle_s > 0."""

    def close(self) -> None:
        """Close the connections."""
