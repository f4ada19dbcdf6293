"""The stretch of history that a diagnosis is put to: since the gap is open, and at least as long as the window that is told."""

from cnctwin.loop.config import LoopConfig
from cnctwin.loop.standing import Span
from cnctwin.loop.world import World

DAY_MS, HOUR_MS = 86_400_000.0, 3_600_000.0


def span_of(config: LoopConfig, world: World) -> Span:
    """Return [from, to) in ms since 1970, by the machine's clock.

    What was recorded before the gap opened is of a machine that may have been another one: it is neither fitted nor judged on.
    """
    found = world.standing
    to_ms = world.at_ms or world.now_ms
    if found.window_ms is not None:
        to_ms = max(to_ms, found.window_ms[1])
    begins = [begin for begin in (found.since_ms, found.window_ms and found.window_ms[0]) if begin]
    from_ms = min(begins) if begins else to_ms - round(config.window_hours * HOUR_MS)
    return max(from_ms, to_ms - round(config.history_days * DAY_MS)), to_ms
