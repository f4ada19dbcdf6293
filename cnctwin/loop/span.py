"""The stretch of history that a diagnosis is put to: since the gap is open, and at least as long as the window that is told."""

from cnctwin.loop.config import LoopConfig
from cnctwin.loop.standing import Span
from cnctwin.loop.world import World

DAY_MS, HOUR_MS = 86_400_000.0, 3_600_000.0
FIRST_MS = HOUR_MS
"""A gap that opened so soon after the first description is that of a twin which was never right."""


def span_of(config: LoopConfig, world: World) -> Span:
    """Return [from, to) in ms since 1970, by the machine's clock.

    What was recorded before the gap opened is of a machine that may have been another one: it is neither fitted nor judged on.
    Where the twin was never right, it is of this machine, and all of it counts.
    """
    found = world.standing
    to_ms = world.at_ms or world.now_ms
    if found.window_ms is not None:
        to_ms = max(to_ms, found.window_ms[1])
    oldest_ms = to_ms - round(config.history_days * DAY_MS)
    if was_never_right(world):
        return oldest_ms, to_ms
    begins = [begin for begin in (found.since_ms, found.window_ms and found.window_ms[0]) if begin]
    from_ms = min(begins) if begins else to_ms - round(config.window_hours * HOUR_MS)
    return max(from_ms, oldest_ms), to_ms


def is_long_enough(config: LoopConfig, world: World) -> bool:
    """Return True where there is enough history for a diagnosis that nobody has asked for, and nobody has stated that the machine
    is healthy."""
    since_ms = world.standing.since_ms
    if world.at_ms < world.healthy_until_ms:
        return False
    return since_ms is None or was_never_right(world) or world.at_ms - since_ms >= config.open_hours * HOUR_MS


def was_never_right(world: World) -> bool:
    """Return True where the gap has been open since the machine was first described, and no growth has been seen."""
    since_ms = world.standing.since_ms
    return (
        world.is_first and not world.standing.grows and since_ms is not None and abs(since_ms - world.live_since_ms) <= FIRST_MS
    )
