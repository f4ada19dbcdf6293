"""The means of the step: configuration, shift calendar, ideal times of parts, and the rated power of the spindle.

The ideal time of a part, PRI of ISO 22400-2, is what its program takes as the twin plans it, at 100 % of all overrides
(`cnctwin expect`), unless the configuration states another one for a program.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from processors.config import Configuration
from processors.description import Description
from processors.production.calendar import Calendar, Slot, day_slot
from processors.production.calendar_file import read_calendar_file
from processors.production.config import Config
from twin.assumed import is_assumed
from twin.expected.expectation import Expectation
from twin.expected.files import load_expectations
from twin.vocabulary.program_names import program_key

CALENDAR, EXPECTATIONS = "calendar", "expectations"


def read_files(configuration: Configuration[Config]) -> Mapping[str, Any]:
    """Return the shift calendar and the expectations that the configuration names. Raises ValueError where one cannot be read."""
    config = configuration.default
    return {
        CALENDAR: Calendar(read_calendar_file(Path(config.calendar))) if config.calendar else None,
        EXPECTATIONS: load_expectations(Path(config.expectations)) if config.expectations else {},
    }


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """The means of the step. rated_kw: of the spindle drive, as the machine's description states it; None = not stated"""

    configuration: Configuration[Config]
    rated_kw: float | None = None

    @property
    def calendar(self) -> Calendar | None:
        """The shift calendar; None where none is configured."""
        found: Calendar | None = self.configuration.read[CALENDAR]
        return found

    @property
    def time_zone(self) -> str:
        """The zone of the calendar, in which its shifts are written; without one days are counted in UTC."""
        return "UTC" if self.calendar is None else self.calendar.file.time_zone

    def slot(self, machine: str, at_s: float) -> Slot:
        """Return the slot of the calendar, or without one the day in UTC."""
        calendar = self.calendar
        return day_slot(at_s) if calendar is None else calendar.slot_at(machine, at_s)

    def ideal_s(self, machine: str, program: str | None) -> float | None:
        """Return the ideal time of a part by its program; None where it is not known."""
        if program is None:
            return None
        stated = self.configuration.of(machine).ideal_by_key.get(program_key(program))
        if stated is not None:
            return stated
        of_machine: Mapping[str, Expectation] = self.configuration.read[EXPECTATIONS].get(machine, {})
        found = of_machine.get(program)
        return found.time_s if found is not None and found.time_s > 0.0 else None


def given(configuration: Configuration[Config], description: Description | None) -> Given:
    """Return the means of the step for a machine as it is described."""
    if description is None or description.machine.spindle is None or is_assumed(description.machine, "spindle.rated_power_kw"):
        return Given(configuration)
    return Given(configuration, description.machine.spindle.rated_power_kw)
