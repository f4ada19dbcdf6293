"""One part after the other: time, heat, counts and the wait for what is not computed yet."""

from collections.abc import Callable
from itertools import islice, takewhile
from typing import NamedTuple

import pytest

from cnctwin.standins.simulated_machine.moment import Moment
from cnctwin.standins.simulated_machine.part import Part
from cnctwin.standins.simulated_machine.working_day import Pending, ambient_temp_c, switched_on, working_day

SHORT = Part((Moment(0.0, {"Tool_number": "", "Srpm": "0"}), Moment(4.0, {"Tool_number": "1", "Srpm": "8500"})), 10.0, 27.5)
SPARE = Part((Moment(0.0, {"Srpm": "1"}),), 30.0, 25.0)


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
        self.begun: list[tuple[int, float, float]] = []
        self.part = SHORT
        self._late, self._asks = late, asks

    def begin(self, number: int, start_temperature_c: float, ambient_temp_c: float) -> Pending:
        self.begun.append((number, start_temperature_c, ambient_temp_c))
        return Computed(self.part, [], self._asks if number == self._late else 0)


def no_spare() -> Part:
    raise AssertionError("nobody needs it")


def shown(workshop: Workshop, seconds: float, spare: Callable[[], Part] = no_spare, patience_s: float = 10.0) -> list[Moment]:
    return list(takewhile(lambda moment: moment.at_s < seconds, working_day(workshop.begin, spare, patience_s)))


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


def test_the_next_part_starts_with_the_heat_that_is_left() -> None:
    workshop = Workshop()
    moments = shown(workshop, 60.0)
    (_, first_c, _), (_, second_c, air_c) = workshop.begun[:2]
    assert 22.9 < first_c <= 23.0
    assert air_c < second_c < SHORT.temperature_c
    begun = times_of(moments, "execution", "ACTIVE")[1]
    last_shown = [float(m.values["Stemp"]) for m in moments if "Stemp" in m.values and m.at_s < begun][-1]
    assert last_shown == pytest.approx(second_c, abs=0.1), "the display shows the same temperature before and after"


def test_each_part_is_begun_while_the_one_before_it_is_cut() -> None:
    workshop = Workshop()
    for moment in working_day(workshop.begin, no_spare, 10.0):
        if moment.values.get("execution") == "ACTIVE":
            break
    assert [number for number, *_ in workshop.begun] == [1, 2]


def test_a_part_that_is_late_is_waited_for() -> None:
    late, usual = (shown(Workshop(late=2, asks=asks), 200.0) for asks in (5, 0))
    begun = [times_of(moments, "execution", "ACTIVE") for moments in (late, usual)]
    assert begun[0][0] == begun[1][0]
    assert begun[0][1] == begun[1][1] + 5.0, "asked once a second"
    assert [moment.values.keys() for moment in late if moment.waits] == [{"Stemp", "room_temp"}] * 5, "it cools meanwhile"


def test_a_part_that_was_waited_for_starts_with_a_spindle_that_has_cooled_meanwhile() -> None:
    warm = Part(tuple(Moment(float(at_s), {"Stemp": f"{60.0 + at_s:.1f}"}) for at_s in range(8)), 8.0, 67.0)
    workshop = Workshop(late=2, asks=100)
    workshop.part = warm
    moments = shown(workshop, 250.0)
    waits = [float(moment.values["Stemp"]) for moment in moments if moment.waits]
    begun = times_of(moments, "execution", "ACTIVE")[1]
    first = next(float(m.values["Stemp"]) for m in moments if m.at_s == begun and "Stemp" in m.values and not m.waits)
    expected_c = workshop.begun[1][1]
    assert waits[-1] < expected_c - 3.0
    assert first == pytest.approx(60.0 + waits[-1] - expected_c, abs=0.11)


def test_a_first_part_that_keeps_the_machine_waiting_gives_way_to_a_spare_one() -> None:
    workshop = Workshop(late=1, asks=1000)
    moments = shown(workshop, 100.0, spare=lambda: SPARE, patience_s=7.0)
    assert times_of(moments, "execution", "ACTIVE")[0] == 2.0 + 7.0
    assert times_of(moments, "execution", "PROGRAM_COMPLETED")[0] == 2.0 + 7.0 + SPARE.seconds
    assert workshop.begun[1][1] < SPARE.temperature_c, "the next one starts with the heat of the spare one"


def test_what_is_shown_first_says_everything_but_temperatures() -> None:
    first = next(iter(islice(working_day(Workshop().begin, no_spare, 1.0), 1)))
    assert first == Moment(0.0, switched_on())
    assert first.values["block"].startswith("O1701")


def test_the_air_of_the_shop_stays_within_half_a_degree() -> None:
    assert all(abs(ambient_temp_c(at_s) - 21.5) <= 0.5 for at_s in range(0, 10_000, 60))
