"""The owner of a connection, who is told what happens to it."""

from collections.abc import Callable
from dataclasses import dataclass

from sparkplug.actions import Connect


@dataclass(frozen=True, slots=True)
class Listener:
    """`connecting` and `unsent` are called in the thread of an attempt, the rest by whoever turns the loop."""

    connecting: Callable[[int], Connect]  # the number of the broker in the list
    unsent: Callable[[], None]  # the broker was not reached: that CONNECT was never sent
    connected: Callable[[], None]
    message: Callable[[str, bytes], None]
    lost: Callable[[], None]
    tick: Callable[[], None]
    confirmed: Callable[[int], None] = lambda _: None  # the broker has taken all that was sent before this barrier
    wanted: Callable[[str], bool] = lambda _: True  # whether messages of a topic are; the answer may be kept
    holds: Callable[[int], bool] = lambda _: False  # whether the message of QoS 1 that was just given is acknowledged later
