"""A working day: one part after the other, with the door open in between, until somebody ends it.

A part is computed while the one before it is cut, in a thread of its own. Where it is not ready in time, the machine waits for it
as for an operator. Where the first one takes long, since the kernels have to be compiled on this computer, a spare one that was
computed before is shown meanwhile.
"""

from collections.abc import Callable, Iterator
from random import Random
from typing import Protocol

from cnctwin.standins.simulated_machine.description import program_text
from cnctwin.standins.simulated_machine.heat import with_temperatures
from cnctwin.standins.simulated_machine.moment import Moment
from cnctwin.standins.simulated_machine.part import Part
from twin.machine import MachineFile

CLOSED_S, COMPLETED_S, IDLE_SHOWN_S = 2.0, 1.0, 1.0
CHANGE_S = (7.0, 12.0)
"""From READY to the closed door: an operator, or a robot."""
AT_REST = dict.fromkeys(("Srpm", "Fact", "Xabs", "Yabs", "Zabs"), "0")
"""Spindle and feed stand still, the axes are at the reference point."""


class Pending(Protocol):
    """A part that is being computed."""

    @property
    def ready(self) -> bool:
        """True if it is there."""

    def result(self) -> Part:
        """It; waits for it, and raises what it raised."""


Begin = Callable[[int], Pending]
"""Begins to compute a part, by its number."""


def working_day(begin: Begin, spare: Callable[[], Part], patience_s: float, machine: MachineFile) -> Iterator[Moment]:
    """Yield what the control shows, from the moment that it is switched on.

    spare: gives the part to show where the first one is not computed `patience_s` after the machine is ready for it
    machine: the machine as it is, whose spindle warms
    """
    return with_temperatures(_parts(begin, spare, patience_s), machine)


def _parts(begin: Begin, spare: Callable[[], Part], patience_s: float) -> Iterator[Moment]:
    """Yield one part after the other, with the pauses between them."""
    at_s, number, pause_s = 0.0, 1, _pause_s(1)
    pending = begin(number)
    yield Moment(at_s, switched_on())
    while True:
        yield from _pause(at_s, pause_s)
        at_s += pause_s
        late_s = 0.0
        while not pending.ready and (number > 1 or late_s < patience_s):
            late_s += IDLE_SHOWN_S
            yield Moment(at_s + late_s, {}, waits=True)
        part = pending.result() if pending.ready else spare()
        begun_s = at_s + late_s
        at_s, pause_s = begun_s + part.seconds + COMPLETED_S, _pause_s(number + 1)
        pending = begin(number + 1)
        yield Moment(begun_s, {"execution": "ACTIVE"})
        yield from (shown._replace(at_s=begun_s + shown.at_s) for shown in part.moments)
        yield Moment(begun_s + part.seconds, {"execution": "PROGRAM_COMPLETED", "part_count": str(number)})
        yield Moment(at_s, {"execution": "READY", **AT_REST, **_rewound()})
        number += 1


def switched_on() -> dict[str, str]:
    """Return what the control shows before the first part. The last tool of the part is in the spindle, the drives are off."""
    modes = {"avail": "AVAILABLE", "mode": "AUTOMATIC", "execution": "READY", "program": "O1701", "part_count": "0"}
    overrides = {"Fovr": "100", "Frapidovr": "100", "Sovr": "100"}
    rest = {"Tool_number": "5", "door_state": "OPEN", "coolant": "OFF"}
    return modes | _rewound() | overrides | rest | AT_REST | dict.fromkeys(("Sload", "Xload", "Yload", "Zload"), "0")


def _rewound() -> dict[str, str]:
    """The program stands at its beginning."""
    blocks = program_text().splitlines()
    line = next(line for line, block in enumerate(blocks) if block.startswith("O"))
    return {"block": blocks[line], "line": str(line)}


def _pause_s(number: int) -> float:
    """Return how long the workpiece change before part `number` takes, a little different each time. The first is in the vice."""
    if number == 1:
        return CLOSED_S
    return round(Random(number).uniform(*CHANGE_S), 1) + CLOSED_S  # noqa: S311 — no secret


def _pause(at_s: float, seconds: float) -> Iterator[Moment]:
    """The door is open, then closed."""
    since_s, closes_s = 0.0, seconds - CLOSED_S
    yield Moment(at_s, {"door_state": "OPEN"})
    closed = False
    while since_s < seconds:
        if since_s >= closes_s and not closed:
            closed = True
            yield Moment(at_s + closes_s, {"door_state": "CLOSED"})
        yield Moment(at_s + since_s, {})
        since_s += IDLE_SHOWN_S
