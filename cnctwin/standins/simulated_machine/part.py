"""One part as the control shows it, from cycle start to its end; and one that was computed before."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from cnctwin.standins.simulated_machine.description import SPARE_PART
from cnctwin.standins.simulated_machine.moment import Moment, moments_of


@dataclass(frozen=True, slots=True)
class Part:
    """The cycle of one part. Times of its moments count from cycle start.

    temperature_c: of the spindle at its end
    """

    moments: tuple[Moment, ...]
    seconds: float
    temperature_c: float


def warmer(part: Part, by_k: float, time_constant_s: float) -> Part:
    """The same part, begun with a spindle that is warmer by so much: in a linear network the difference dies away by itself.

    >>> part = Part((Moment(0.0, {"Stemp": "25.0"}), Moment(100.0, {"Stemp": "26.0", "Srpm": "0"})), 100.0, 26.0)
    >>> [moment.values["Stemp"] for moment in warmer(part, -1.0, 100.0).moments]
    ['24.0', '25.6']
    """

    def corrected(moment: Moment) -> Moment:
        if "Stemp" not in moment.values:
            return moment
        shown_c = float(moment.values["Stemp"]) + by_k * math.exp(-moment.at_s / time_constant_s)
        return moment._replace(values={**moment.values, "Stemp": f"{shown_c:.1f}"})

    end_c = part.temperature_c + by_k * math.exp(-part.seconds / time_constant_s)
    return Part(tuple(map(corrected, part.moments)), part.seconds, end_c)


def spare_part() -> Part:
    """The first part of a day, as `scripts/make-recording` has computed it."""
    with SPARE_PART.open(encoding="utf-8") as lines:
        return part_of(moments_of(lines))


def part_of(moments: Iterable[Moment]) -> Part:
    """The first part in what a control has shown.

    >>> told = [Moment(0.0, {"execution": "READY"}), Moment(2.0, {"execution": "ACTIVE"}), Moment(2.1, {"Stemp": "23.5"})]
    >>> part_of([*told, Moment(9.0, {"execution": "PROGRAM_COMPLETED"})])
    Part(moments=(Moment(at_s=0.1, values={'Stemp': '23.5'}, waits=False),), seconds=7.0, temperature_c=23.5)
    """
    begun_s: float | None = None
    shown: list[Moment] = []
    temperature_c = 0.0
    for moment in moments:
        state = moment.values.get("execution")
        if state == "ACTIVE":
            begun_s = moment.at_s
        elif begun_s is not None:
            if state == "PROGRAM_COMPLETED":
                return Part(tuple(shown), round(moment.at_s - begun_s, 6), temperature_c)
            shown.append(Moment(round(moment.at_s - begun_s, 6), moment.values))
            temperature_c = float(moment.values.get("Stemp", temperature_c))
    raise AssertionError("no part was finished")
