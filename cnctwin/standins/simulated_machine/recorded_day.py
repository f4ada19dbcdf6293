"""The simulated machine's day as a recording: lines of SHDR, computed part by part, as fast as they can be."""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import NamedTuple

from cnctwin.standins.simulated_machine.machining import machined
from cnctwin.standins.simulated_machine.moment import Adapter
from cnctwin.standins.simulated_machine.part import Part
from cnctwin.standins.simulated_machine.working_day import working_day

START = datetime(2026, 3, 2, 8, 0, 0, tzinfo=UTC)


class OnDemand(NamedTuple):
    """A part that is computed when it is asked for."""

    number: int
    start_temperature_c: float
    ambient_temp_c: float
    ready: bool = True

    def result(self) -> Part:
        """It."""
        return machined(self.number, self.start_temperature_c, self.ambient_temp_c)


def recorded_day(parts: int, spare: Callable[[], Part]) -> Iterator[str]:
    """Yield what the control shows until so many parts are made, from a morning of March 2026 on."""
    adapter, readies = Adapter(START.timestamp()), 0
    for moment in working_day(OnDemand, spare, 0.0):
        if (line := adapter.line(moment)) is not None:
            yield line
        readies += moment.values.get("execution") == "READY"
        if readies > parts:  # the first one is before the first part
            return
