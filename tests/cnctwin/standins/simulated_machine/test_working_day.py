"""One part after the other: time, heat, counts and the wait for what is not computed yet."""

from collections.abc import Callable
from itertools import islice, pairwise, takewhile
from typing import NamedTuple

import pytest

from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.heat import START_TEMPERATURE_C, ambient_temp_c
from cnctwin.standins.simulated_machine.moment import Moment
from cnctwin.standins.simulated_machine.part import Part
from cnctwin.standins.simulated_machine.working_day import Pending, switched_on, working_day

MACHINE = machine_as_built()
SHORT = Part((Moment(0.0, {"Tool_number": "", "Srpm": "0"}), Moment(4.0, {"Tool_number": "1", "Srpm": "8500"})), 10.0)
SPARE = Part((Moment(0.0, {"Srpm": "1"}),), 30.0)


class Computed(NamedTuple):
    """A part that is there as soon as it has been asked for `asks` times."""

    part: Part
    asked: list[int]
    asks: int

    @property
    def ready(self) -> bool:
        self.asked.append(1)
        return len(self.asked) > self.asks

    def result(self) -> Part:
        return self.part


class Workshop:
    """Notes what is begun; part `late` is ready after `asks` questions only."""

    def __init__(self, late: int = 0, asks: int = 0) -> None:
        self.begun: list[int] = []
        self.part = SHORT
        self._late, self._asks = late, asks

    def begin(self, number: int) -> Pending:
        self.begun.append(number)
        return Computed(self.part, [], self._asks if number == self._late else 0)


def no_spare() -> Part:
    raise AssertionError("nobody needs it")


def shown(workshop: Workshop, seconds: float, spare: Callable[[], Part] = no_spare, patience_s: float = 10.0) -> list[Moment]:
    return list(takewhile(lambda moment: moment.at_s < seconds, working_day(workshop.begin, spare, patience_s, MACHINE)))


def times_of(moments: list[Moment], key: str, value: str) -> list[float]:
    return [moment.at_s for moment in moments if moment.values.get(key) == value]


def test_time_never_goes_back() -> None:
    times = [moment.at_s for moment in shown(Workshop(), 300.0)]
    assert times == sorted(times)
    assert times[0] == 0.0


def test_a_part_counts_when_it_is_completed() -> None:
    moments = shown(Workshop(), 100.0)
    begun, ended = times_of(moments, "execution", "ACTIVE"), times_of(moments, "execution", "PROGRAM_COMPLETED")
    assert [end - begin for begin, end in zip(begun, ended, strict=False)] == pytest.approx([SHORT.seconds] * len(ended))
    counts = [moment.values["part_count"] for moment in moments if "part_count" in moment.values]
    assert counts == [str(number) for number in range(len(ended) + 1)]
    assert len(ended) > 3


def test_between_two_parts_the_machine_is_ready_and_its_door_opens() -> None:
    moments = shown(Workshop(), 60.0)
    ended, begun = times_of(moments, "execution", "PROGRAM_COMPLETED")[0], times_of(moments, "execution", "ACTIVE")[1]
    between = [moment for moment in moments if ended < moment.at_s < begun]
    assert times_of(between, "execution", "READY") == [ended + 1.0]
    assert times_of(between, "door_state", "OPEN") < times_of(between, "door_state", "CLOSED")
    assert 8.0 < begun - ended < 16.0


def temperatures(moments: list[Moment]) -> list[tuple[float, float]]:
    return [(moment.at_s, float(moment.values["Stemp"])) for moment in moments if "Stemp" in moment.values]


def test_a_temperature_is_shown_each_second_and_never_jumps() -> None:
    workshop = Workshop()
    workshop.part = Part(tuple(Moment(0.1 * step, {"Srpm": "8500"}) for step in range(300)), 30.0)
    shown_c = temperatures(shown(workshop, 200.0))
    assert shown_c[0][1] == pytest.approx(START_TEMPERATURE_C, abs=0.15)
    assert max(after - before for (before, _), (after, _) in pairwise(shown_c)) < 2.01
    assert len(shown_c) > 100
    assert max(abs(after - before) for (_, before), (_, after) in pairwise(shown_c)) < 0.6


def test_the_spindle_warms_while_it_turns_and_cools_while_it_stands() -> None:
    turning, standing = (
        Part(tuple(Moment(float(at_s), {"Srpm": rpm, "Sload": "20"}) for at_s in range(300)), 300.0) for rpm in ("8500", "0")
    )
    workshop = Workshop()
    for part, sign in ((turning, 1.0), (standing, -1.0)):
        workshop.part = part
        (_, first_c), *_, (_, last_c) = temperatures(shown(workshop, 300.0))
        assert sign * (last_c - first_c) > 0.3
    assert temperatures(shown(workshop, 8000.0))[-1][1] == pytest.approx(ambient_temp_c(8000.0), abs=0.5), "as cold as the air"


def test_each_part_is_begun_while_the_one_before_it_is_cut() -> None:
    workshop = Workshop()
    for moment in working_day(workshop.begin, no_spare, 10.0, MACHINE):
        if moment.values.get("execution") == "ACTIVE":
            break
    assert workshop.begun == [1, 2]


def test_a_part_that_is_late_is_waited_for() -> None:
    late, usual = (shown(Workshop(late=2, asks=asks), 200.0) for asks in (5, 0))
    begun = [times_of(moments, "execution", "ACTIVE") for moments in (late, usual)]
    assert begun[0][0] == begun[1][0]
    assert begun[0][1] == begun[1][1] + 5.0, "asked once a second"
    assert [moment.values.keys() for moment in late if moment.waits] == [{"Stemp", "room_temp"}] * 5, "it cools meanwhile"


def test_a_first_part_that_keeps_the_machine_waiting_gives_way_to_a_spare_one() -> None:
    workshop = Workshop(late=1, asks=1000)
    moments = shown(workshop, 100.0, spare=lambda: SPARE, patience_s=7.0)
    assert times_of(moments, "execution", "ACTIVE")[0] == 2.0 + 7.0
    assert times_of(moments, "execution", "PROGRAM_COMPLETED")[0] == 2.0 + 7.0 + SPARE.seconds


def test_what_is_shown_first_says_everything() -> None:
    first = next(iter(islice(working_day(Workshop().begin, no_spare, 1.0, MACHINE), 1)))
    assert first.at_s == 0.0
    assert first.values == {**switched_on(), **{key: first.values[key] for key in ("Stemp", "room_temp")}}
    assert first.values["block"].startswith("O1701")


def test_the_air_of_the_shop_stays_within_half_a_degree() -> None:
    assert all(abs(ambient_temp_c(at_s) - 21.5) <= 0.5 for at_s in range(0, 10_000, 60))
