"""Tables of figures, whose sums anybody can add up; and the same as CSV."""

import csv
import io
from typing import Any

import pytest

from cnctwin.figures.comma_separated import COLUMNS, to_csv
from cnctwin.figures.documents import PartTold, ShiftTold
from cnctwin.figures.table import Asked, By, table, time_zone_of

HOUR_MS = 3_600_000


def _shift(begin_h: int = 0, identity: str = "a", machine: str = "vmc", **changed: Any) -> ShiftTold:
    values: dict[str, Any] = {
        **{"kind": "shift", "id": identity, "machine": machine, "shift": "early", "over": True, "calendar": True},
        **{"begin": begin_h * HOUR_MS, "end": (begin_h + 1) * HOUR_MS, "planned_s": 3600.0, "production_s": 2700.0},
        **{"setup_s": 300.0, "delay_s": 500.0, "down_s": 100.0, "unknown_s": 0.0, "beside_s": 0.0},
        "stops": {
            "feed hold": {"kind": "delay", "s": 500.0, "n": 2},
            "mode MANUAL": {"kind": "setup", "s": 300.0, "n": 1},
            "alarm: FAULT": {"kind": "down", "s": 100.0, "n": 1},
        },
        **{"energy_kwh": 2.0, "energy_s": 3600.0},
    }
    return ShiftTold.model_validate(values | changed)


def _part(n: int, begin_h: int = 0, machine: str = "vmc", **changed: Any) -> PartTold:
    values: dict[str, Any] = {
        **{"kind": "part", "id": f"{machine}{begin_h}{n}", "machine": machine, "program": "O1", "shift": "early"},
        **{"shift_begin": begin_h * HOUR_MS, "begin": begin_h * HOUR_MS + n * 1000, "end": begin_h * HOUR_MS + n * 1000 + 500},
        **{"complete": True, "ideal_s": 90.0, "active_s": 100.0, "interrupted_s": 0.0, "unknown_s": 0.0},
        **{"energy_kwh": 0.1, "quality": "good"},
    }
    return PartTold.model_validate(values | changed)


ASKED = Asked(By.SHIFT, 0, 24 * HOUR_MS)


def test_a_shift_has_its_ratios_and_its_stops_by_length() -> None:
    parts = [_part(n, quality="scrap" if n == 0 else "good") for n in range(10)]
    (row,) = table([_shift()], parts, ASKED)
    assert (row["availability"], row["performance"], row["quality"], row["oee"]) == (0.75, 0.9, 0.9, 0.6075)
    assert list(row["stops"]) == ["feed hold", "mode MANUAL", "alarm: FAULT"]
    assert (row["parts"], row["energy_a_part_kwh"], row["why"]) == (10, 0.1, {})


def test_shifts_of_a_machine_add_up_and_machines_stay_apart() -> None:
    shifts = [_shift(), _shift(1, "b", production_s=900.0, delay_s=2300.0), _shift(0, "c", machine="lathe")]
    parts = [_part(1), _part(1, 1), _part(1, machine="lathe", ideal_s=120.0)]
    rows = table(shifts, parts, ASKED._replace(by=By.MACHINE))
    assert [(row["machine"], row["shifts"], row["availability"], row["performance"]) for row in rows] == [
        ("vmc", 2, 0.5, 0.9),
        ("lathe", 1, 0.75, 1.2),
    ]
    assert rows[0]["stops"]["feed hold"] == {"kind": "delay", "s": 1000.0, "n": 4}


def test_a_shift_that_two_lives_of_the_process_saw_is_one() -> None:
    """The second one began in mid-shift: of what was before it, it knows nothing, and the first one does."""
    first = _shift(planned_s=1800.0, production_s=1500.0, setup_s=0.0, delay_s=300.0, down_s=0.0, stops={}, over=True)
    second = _shift(0, "b", production_s=900.0, setup_s=0.0, delay_s=700.0, down_s=0.0, unknown_s=2000.0, stops={})
    (row,) = table([first, second], [], ASKED)
    assert (row["planned_s"], row["production_s"], row["delay_s"], row["unknown_s"]) == (3600.0, 2400.0, 1000.0, 200.0)
    assert row["stops"] == {"no data": {"kind": "unknown", "s": 200.0, "n": 1}}


@pytest.mark.parametrize(
    ("shift", "part", "null", "why"),
    [
        ({"unknown_s": 500.0, "production_s": 2200.0}, {}, "availability", "was not heard"),
        ({"calendar": False, "planned_s": 0.0}, {}, "availability", "no shift calendar"),
        ({}, {"ideal_s": None}, "performance", "ideal time"),
        ({}, {"complete": False}, "performance", "no complete part"),
        ({}, {"quality": None}, "quality", "part_quality"),
    ],
)
def test_what_is_not_known_is_null_and_says_why(shift: dict[str, Any], part: dict[str, Any], null: str, why: str) -> None:
    (row,) = table([_shift(**shift)], [_part(1, **part)], ASKED)
    assert (row[null], row["oee"]) == (None, None)
    assert why in row["why"][null]


def test_parts_and_programs_have_their_rows() -> None:
    parts = [_part(1), _part(2, active_s=80.0), _part(3, program="O2", ideal_s=None, energy_kwh=None)]
    told = table([], parts, ASKED._replace(by=By.PART))
    assert [row["performance"] for row in told] == [0.9, 1.125, None]
    first, second = table([], parts, ASKED._replace(by=By.PROGRAM))
    assert (first["program"], first["parts"], first["active_s"], first["performance"]) == ("O1", 2, 90.0, 1.0)
    assert (second["ideal_s"], second["performance"], second["energy_a_part_kwh"]) == (None, None, None)


def test_only_what_begins_or_ends_in_the_stretch_is_in_it() -> None:
    asked = Asked(By.SHIFT, HOUR_MS, 2 * HOUR_MS)
    assert [row["begin"] for row in table([_shift(), _shift(1, "b"), _shift(2, "c")], [], asked)] == [HOUR_MS]
    assert table([], [_part(1), _part(1, 2)], asked._replace(by=By.PART)) == []


@pytest.mark.parametrize(
    ("named", "zone"),
    [
        ([], "UTC"),
        ([None, "Europe/Berlin"], "Europe/Berlin"),
        (["Europe/Berlin", "America/New_York"], "UTC"),
        (["Mars/Olympus"], "UTC"),
        (["../../etc/passwd"], "UTC"),
        ([17], "UTC"),
    ],
)
def test_the_zone_is_that_of_the_calendar_that_all_shifts_name(named: list[Any], zone: str) -> None:
    assert time_zone_of([_shift(n, str(n), time_zone=one) for n, one in enumerate(named)]) == zone


@pytest.mark.parametrize("by", list(By))
def test_a_csv_has_a_field_for_each_column_and_reads_back(by: By) -> None:
    rows = table([_shift()], [_part(1, program='=HYPERLINK("x"),y\nz')], ASKED._replace(by=by))
    read = list(csv.reader(io.StringIO(to_csv(rows, by), newline="")))
    assert read[0] == list(COLUMNS[by])
    assert {len(line) for line in read} == {len(COLUMNS[by])}
    named = dict(zip(read[0], read[1], strict=True))
    if "program" in named:
        assert named["program"] == '\'=HYPERLINK("x"),y\nz'
    else:
        assert (named["begin"], named["oee"]) == ("1970-01-01T00:00:00Z", "0.675")


def test_a_machines_figures_are_of_its_shifts_and_not_of_what_was_made_outside_them() -> None:
    outside = _shift(2, "b", shift=None, planned_s=0.0, production_s=0.0, setup_s=0.0, delay_s=0.0, down_s=0.0, beside_s=600.0)
    parts = [*(_part(n) for n in range(3)), *(_part(n, 2, shift=None) for n in range(5))]
    (alone,) = table([_shift()], parts[:3], Asked(By.MACHINE, 0, 9 * HOUR_MS))
    (both,) = table([_shift(), outside], parts, Asked(By.MACHINE, 0, 9 * HOUR_MS))
    assert {name: both[name] for name in ("parts", "performance", "oee", "shifts")} == {
        name: alone[name] for name in ("parts", "performance", "oee", "shifts")
    }
    assert (alone["beside_s"], both["beside_s"]) == (0.0, 600.0)  # counted beside, in no ratio
