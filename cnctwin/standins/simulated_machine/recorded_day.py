"""The simulated machine's day as a recording: lines of SHDR, computed part by part, as fast as they can be."""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import NamedTuple

from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.machining import machined
from cnctwin.standins.simulated_machine.moment import Adapter
from cnctwin.standins.simulated_machine.part import Part
from cnctwin.standins.simulated_machine.working_day import working_day
from twin.machine import AddedEffect, MachineFile

START = datetime(2026, 3, 2, 8, 0, 0, tzinfo=UTC)


class OnDemand(NamedTuple):
    """A part that is computed when it is asked for."""

    number: int
    machine: MachineFile
    ready: bool = True

    def result(self) -> Part:
        """It."""
        return machined(self.number, self.machine)


def recorded_day(parts: int, spare: Callable[[], Part], hidden: AddedEffect | None = None) -> Iterator[str]:
    """Yield what the control shows until so many parts are made, from a morning of March 2026 on. hidden: an effect it has"""
    adapter, readies, machine = Adapter(START.timestamp()), 0, machine_as_built(hidden)
    for moment in working_day(lambda number: OnDemand(number, machine), spare, 0.0, machine):
        if (line := adapter.line(moment)) is not None:
            yield line
        readies += moment.values.get("execution") == "READY"
        if readies > parts:  # the first one is before the first part
            return
