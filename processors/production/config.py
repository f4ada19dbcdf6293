"""The configuration of `production`: its files, the definition of a part, and how much has to be known."""

from functools import cached_property, lru_cache
from typing import ClassVar

from pydantic import Field, PositiveFloat

from processors.config import ProcessorConfig
from processors.events.processor import Config as RunsConfig
from processors.production.ratios import KNOWN_SHARE_MIN
from twin.vocabulary.program_names import program_key


class Config(ProcessorConfig):
    """calendar: the file of the shifts; expectations: the folder of `cnctwin expect`; "" = none, and the figures say so.

    ideal_s: seconds of a part by program, in place of what the twin expects
    cycle_s_min, modes, feed_mm_min_min: as of the processor `events`, whose parts these are
    """

    of_one_machine: ClassVar[frozenset[str] | None] = frozenset({"ideal_s", "cycle_s_min", "modes", "feed_mm_min_min"})

    calendar: str = ""
    expectations: str = ""
    ideal_s: dict[str, PositiveFloat] = Field(default_factory=dict, max_length=5000)
    known_share_min: float = Field(default=KNOWN_SHARE_MIN, gt=0.0, le=1.0, description="of what has to be known for a ratio")
    told_s: float = Field(default=60.0, ge=1.0, le=3600.0, description="how often the figures of the shift are published")
    cycle_s_min: float = Field(default=5.0, ge=0.0, le=3600.0, description="a shorter run is no part")
    modes: tuple[str, ...] = Field(default=("AUTOMATIC", "SEMI_AUTOMATIC"), description="a run in another mode is setup")
    feed_mm_min_min: float = Field(default=1.0, gt=0.0, le=1e6, description="without exec_state: ACTIVE from this feed on")

    @property
    def runs(self) -> RunsConfig:
        """The configuration of the runs, in the words of `events`."""
        return _runs(self.cycle_s_min, self.modes, self.feed_mm_min_min)

    @cached_property
    def ideal_by_key(self) -> dict[str, float]:
        """The stated ideal times by the key of their program."""
        return {program_key(program): seconds for program, seconds in self.ideal_s.items()}


@lru_cache(maxsize=1000)
def _runs(cycle_s_min: float, modes: tuple[str, ...], feed_mm_min_min: float) -> RunsConfig:
    return RunsConfig(cycle_s_min=cycle_s_min, modes=modes, feed_mm_min_min=feed_mm_min_min)
