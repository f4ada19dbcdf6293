"""Work that ends when it is asked to, in a thread of its own for as long as a test needs it."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

JOIN_S_MAX = 60.0


@contextmanager
def until_stopped(work: Any, *arguments: Any, **named: Any) -> Iterator[None]:
    """Run `work`, whose last positional argument is the event that ends it; what it raised is raised here."""
    stop, raised = threading.Event(), []

    def body() -> None:
        try:
            work(*arguments, stop, **named)
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=body)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(JOIN_S_MAX)
    assert not thread.is_alive()
    assert raised == []
