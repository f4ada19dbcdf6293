"""One part as the control shows it, from cycle start to its end; and one that was computed before."""

from collections.abc import Iterable
from dataclasses import dataclass

from cnctwin.standins.simulated_machine.description import SPARE_PART
from cnctwin.standins.simulated_machine.moment import Moment, moments_of

TEMPERATURES = ("Stemp", "room_temp")


@dataclass(frozen=True, slots=True)
class Part:
    """The cycle of one part. Times of its moments count from cycle start; the day adds the temperatures."""

    moments: tuple[Moment, ...]
    seconds: float


def spare_part() -> Part:
    """The first part of a day, as `scripts/make-recording` has computed it."""
    with SPARE_PART.open(encoding="utf-8") as lines:
        return part_of(moments_of(lines))


def part_of(moments: Iterable[Moment]) -> Part:
    """The first part in what a control has shown.

    >>> told = [Moment(2.0, {"execution": "ACTIVE"}), Moment(2.1, {"Stemp": "23", "Srpm": "9"})]
    >>> part_of([Moment(0.0, {"execution": "READY"}), *told, Moment(9.0, {"execution": "PROGRAM_COMPLETED"})])
    Part(moments=(Moment(at_s=0.1, values={'Srpm': '9'}, waits=False),), seconds=7.0)
    """
    begun_s: float | None = None
    shown: list[Moment] = []
    for moment in moments:
        state = moment.values.get("execution")
        if state == "ACTIVE":
            begun_s = moment.at_s
        elif begun_s is not None:
            if state == "PROGRAM_COMPLETED":
                return Part(tuple(shown), round(moment.at_s - begun_s, 6))
            values = {key: text for key, text in moment.values.items() if key not in TEMPERATURES}
            shown.append(Moment(round(moment.at_s - begun_s, 6), values))
    raise AssertionError("no part was finished")
