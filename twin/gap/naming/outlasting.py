"""Effects that take longer than what was recorded: they are not named.

A sensor whose time constant is longer than the recording shows no step response, only a trend, and so does nearly anything that
warms or cools: a spindle that is cooled more, a larger heat capacity.
"""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from twin.effects.catalogue import effect_named
from twin.gap.diagnosis import Effected
from twin.gap.stages.stage import Stage


@runtime_checkable
class Lasting(Protocol):
    """A stage of slow signals, which knows how long they were followed without a break."""

    @property
    def lasts_s(self) -> float:
        """Seconds of the longest stretch that is compared."""


def outlasts(stage: Stage, effected: Effected, values: Mapping[str, float]) -> bool:
    """Return True where an effect with these parameters takes longer than any stretch of the stage to show what it is."""
    settles_s = effect_named(effected.effect).settles_s
    return settles_s is not None and isinstance(stage, Lasting) and bool(settles_s(**values) > stage.lasts_s)
