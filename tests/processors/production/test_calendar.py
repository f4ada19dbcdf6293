"""The shift calendar: at most one shift at a time, real seconds, days of 23 and 25 hours."""

from datetime import UTC, date, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processors.production.calendar import Calendar
from processors.production.calendar_file import CalendarFile, read_calendar_file
from processors.wall_clock import DAYS
from tests.depth import examples

THREE = {
    "early": {"start": "06:00", "end": "14:00", "breaks": [["09:00", "09:15"], ["12:00", "12:30"]]},
    "late": {"start": "14:00", "end": "22:00"},
    "night": {"start": "22:00", "end": "06:00", "days": ["sun", "mon", "tue", "wed", "thu"]},
}


def _calendar(**changed: Any) -> Calendar:
    return Calendar(CalendarFile.model_validate({"time_zone": "Europe/Berlin", "shifts": THREE} | changed))


def _utc(text: str) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    ("at", "shift", "is_planned"),
    [
        ("2026-11-23T04:59:59", "night", True),  # Berlin is an hour ahead: 05:59:59 on a Monday
        ("2026-11-23T05:00:00", "early", True),
        ("2026-11-23T08:00:00", "early", False),  # in the break
        ("2026-11-23T08:15:00", "early", True),
        ("2026-11-23T13:00:00", "late", True),
        ("2026-11-27T21:00:00", None, False),  # no night shift on Friday
        ("2026-11-29T21:30:00", "night", True),  # that of Monday begins on Sunday
        ("2026-07-06T04:00:00", "early", True),  # in summer, two hours ahead
    ],
)
def test_a_moment_is_in_its_shift(at: str, shift: str | None, is_planned: bool) -> None:
    slot = _calendar().slot_at("vmc", _utc(at))
    assert (slot.shift, slot.is_planned) == (shift, is_planned)


@pytest.mark.parametrize(
    ("day", "hours"),
    [("2026-03-28", 7.0), ("2026-10-24", 9.0), ("2026-11-22", 8.0)],
    ids=["clocks go forward", "clocks go back", "any night"],
)
def test_a_night_shift_lasts_as_long_as_it_really_does(day: str, hours: float) -> None:
    night = {"start": "22:00", "end": "06:00", "days": list(DAYS)}
    (shift,) = _calendar(shifts={"night": night}).on("vmc", date.fromisoformat(day))
    assert (shift.end_s - shift.begin_s) / 3600 == hours


def test_a_time_that_the_clock_jumps_over_is_the_moment_of_the_jump() -> None:
    short = {"start": "01:00", "end": "02:30", "days": list(DAYS)}
    next_one = {"start": "02:30", "end": "04:00", "days": list(DAYS)}
    first, second = _calendar(shifts={"short": short, "next": next_one}).on("vmc", date(2026, 3, 29))
    assert (first.begin_s, first.end_s) == (_utc("2026-03-29T00:00"), _utc("2026-03-29T01:00"))
    assert (second.begin_s, second.end_s) == (_utc("2026-03-29T01:00"), _utc("2026-03-29T02:00"))


def test_holidays_exceptions_and_machines_have_their_own_shifts() -> None:
    calendar = _calendar(
        holidays=["2026-12-25"],
        exceptions=[
            {"date": "2026-12-19", "shifts": ["early"], "reason": "Saturday before the holidays"},
            {"date": "2026-12-21", "shifts": []},
            {"date": "2026-12-21", "shifts": ["late"], "machines": ["okuma"]},
        ],
        machines={"robot": {"works_on_holidays": True}, "old": {"shifts": ["early"]}},
    )
    told = {
        (machine, day): [one.shift for one in calendar.on(machine, date(2026, 12, day))]
        for machine, day in [("vmc", 25), ("robot", 25), ("vmc", 19), ("vmc", 21), ("okuma", 21), ("old", 22), ("vmc", 22)]
    }
    assert told == {
        ("vmc", 25): [],
        ("robot", 25): ["early", "late"],
        ("vmc", 19): ["early"],
        ("vmc", 21): [],
        ("okuma", 21): ["late"],
        ("old", 22): ["early"],
        ("vmc", 22): ["early", "late", "night"],
    }


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"time_zone": "Europe/Stuttgart"}, "no time zone 'Europe/Stuttgart'"),
        ({"shifts": {"a": {"start": "6", "end": "14:00"}}}, "'6' is no time of the day"),
        ({"shifts": {"a": {"start": "06:00", "end": "14:00", "days": ["monday"]}}}, "have to be some of mon"),
        ({"shifts": {"a": {"start": "06:00", "end": "14:00", "breaks": [["13:50", "14:10"]]}}}, "13:50 to 14:10 is not within"),
        ({"shifts": {"a": {"start": "06:00", "end": "14:00"}, "b": {"start": "13:00", "end": "22:00"}}}, "'a' and 'b' overlap"),
        ({"shifts": {"a": {"start": "22:00", "end": "07:00"}, "b": {"start": "06:00", "end": "14:00"}}}, "'a' and 'b' overlap"),
        ({"exceptions": [{"date": "2026-12-19", "shifts": ["erly"]}]}, "there is no shift 'erly'"),
        (
            {"exceptions": [{"date": "2026-12-19", "shifts": ["early"], "machine": "x"}]},
            "exceptions.0.machine is not known; did you mean machines?",
        ),
        ({"machines": {"old": {"shifts": ["noon"]}}}, "machines.old: there is no shift 'noon'"),
        ({"holidays": ["Christmas"]}, "holidays.0 = 'Christmas'"),
    ],
)
def test_a_wrong_calendar_is_refused_in_one_line(tmp_path: Path, changed: dict[str, Any], said: str) -> None:
    import tomli_w

    path = tmp_path / "calendar.toml"
    path.write_text(tomli_w.dumps({"time_zone": "Europe/Berlin", "shifts": THREE} | changed), encoding="utf-8")
    with pytest.raises(ValueError, match=r".") as caught:
        read_calendar_file(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


_zones = st.sampled_from(["Europe/Berlin", "America/New_York", "Australia/Lord_Howe", "UTC", "Asia/Kolkata", "America/Santiago"])
_moments = st.one_of(
    st.integers(1_600_000_000, 1_900_000_000),
    st.integers(0, 4 * 3600).map(lambda s: int(_utc("2026-03-28T23:00")) + s),
    st.integers(0, 4 * 3600).map(lambda s: int(_utc("2026-10-24T23:00")) + s),
)


@st.composite
def _calendars(draw: st.DrawFn) -> Calendar:
    """Up to four shifts that follow one another through the day, with pauses between them, breaks, exceptions and holidays."""
    marks = sorted(draw(st.lists(st.integers(0, 95), min_size=2, max_size=8, unique=True)))
    turn = draw(st.integers(0, 95))
    clock = [f"{(m + turn) % 96 // 4:02}:{(m + turn) % 4 * 15:02}" for m in marks]
    days = list(DAYS)
    shifts: dict[str, Any] = {}
    for n, (start, end) in enumerate(list(pairwise(clock))[:: draw(st.integers(1, 2))]):
        shifts[f"s{n}"] = {"start": start, "end": end, "days": draw(st.lists(st.sampled_from(days), unique=True))}
        if draw(st.booleans()):
            shifts[f"s{n}"]["breaks"] = [[start, start[:3] + f"{int(start[3:]) + 7:02}"]]
    exceptions = [{"date": "2026-03-29", "shifts": ["s0"]}] if draw(st.booleans()) else []
    return Calendar(
        CalendarFile.model_validate(
            {"time_zone": draw(_zones), "shifts": shifts, "exceptions": exceptions, "holidays": ["2026-10-25"]}
        )
    )


@given(calendar=_calendars(), at=_moments)
@settings(max_examples=examples(60, 20), deadline=None)
def test_every_moment_belongs_to_one_slot_and_at_most_one_shift(calendar: Calendar, at: int) -> None:
    slot = calendar.slot_at("vmc", at)
    assert slot.begin_s <= at < slot.until_s <= slot.end_s
    day = datetime.fromtimestamp(at, UTC).date()
    holding = [
        one for n in (-2, -1, 0, 1, 2) for one in calendar.on("vmc", day + timedelta(days=n)) if one.begin_s <= at < one.end_s
    ]
    assert len(holding) <= 1
    assert [one.shift for one in holding] == ([] if slot.shift is None else [slot.shift])


@given(calendar=_calendars(), at=_moments)
@settings(max_examples=examples(40, 20), deadline=None)
def test_slots_follow_one_another_and_the_parts_of_a_shift_add_up_to_it(calendar: Calendar, at: int) -> None:
    now_s, spent_s = float(at), {}
    for _ in range(60):
        slot = calendar.slot_at("vmc", now_s)
        if slot.shift is not None:
            whole = spent_s.setdefault((slot.shift, slot.begin_s, slot.end_s), [0.0, 0.0])
            whole[slot.is_planned] += slot.until_s - now_s
        now_s = slot.until_s
    for (shift, begin_s, end_s), (break_s, planned_s) in spent_s.items():
        if at <= begin_s and end_s <= now_s:
            (made,) = [one for one in calendar.shifts("vmc", begin_s, begin_s + 1) if one.shift == shift]
            assert break_s + planned_s == end_s - begin_s
            assert break_s == sum(to_s - from_s for from_s, to_s in made.breaks)
