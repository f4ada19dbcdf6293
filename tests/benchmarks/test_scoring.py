"""The count of a cell's scores: faults found, false alerts by occasion, lines of the table."""

import numpy as np
import pytest

from benchmarks.evaluation.events import delays_s
from benchmarks.scored.detectors import page
from benchmarks.scored.judged import OCCASIONS, Judged, occasion, outcome
from benchmarks.scored.table import details, of_faults, row
from benchmarks.simulated_cell.cell import Cell, draw_cell
from benchmarks.simulated_cell.schedule import DAY_S, KNOWN_PROGRAMS

FROM_S, DAYS = DAY_S, 3


@pytest.fixture(scope="module")
def cell() -> Cell:
    """Two machines, a day without faults and two with them."""
    return draw_cell(5, 2, DAYS, 1)


def told(cell: Cell, place: int, extra_s: tuple[int, ...] = ()) -> Judged:
    """The outcome where the alarm comes on 30 s after each fault begins, and for a minute at other times."""
    on = np.zeros((DAYS - 1) * DAY_S, dtype=np.bool_)
    for fault in cell.faults:
        if fault.machine == place:
            on[int(fault.start_s) - FROM_S + 30 : int(fault.end_s) - FROM_S] = True
    for at in extra_s:
        on[at - FROM_S : at - FROM_S + 60] = True
    idle = np.zeros(len(on), dtype=np.bool_)
    return outcome(cell, place, FROM_S, 1, scores=on.astype(np.float64), idle=idle, on=on, has_threshold=True)


def test_an_alarm_within_each_fault_finds_all_after_its_delay(cell: Cell) -> None:
    parts = [told(cell, place) for place in (0, 1)]
    every = of_faults(parts, lambda _: True)
    assert sum(len(one.delays_s) for one in every) == len(cell.faults) > 4
    assert delays_s(every) == pytest.approx([30.0] * len(cell.faults), abs=1.0)
    line = row(parts, np.random.default_rng(0))
    assert line["size 1"].startswith("1.00")
    assert line["≥1 within 60 s"].startswith("1.00")
    assert line["false/week"].startswith("0.00")
    assert float(line["VUS-PR"].split()[0]) > 0.9


def test_no_alarm_finds_nothing(cell: Cell) -> None:
    count = (DAYS - 1) * DAY_S
    nothing, no = np.full(count, np.nan), np.zeros(count, dtype=np.bool_)
    one = outcome(cell, 0, FROM_S, 1, scores=nothing, idle=no, on=no, has_threshold=False)
    line = row([one], np.random.default_rng(0))
    assert (line["size 1"][:4], line["delay s"], line["no threshold"]) == ("0.00", "-", "1")


def test_an_alert_that_is_none_is_false_and_told_by_occasion(cell: Cell) -> None:
    quiet = [part for part in cell.schedules[0].parts if part.start_s > FROM_S and part.is_first]
    faults = [fault for fault in cell.faults if fault.machine == 0]
    at_s = next(
        int(part.start_s) + 100
        for part in quiet
        if not any(fault.start_s - 200 <= part.start_s + 100 <= fault.end_s + 400 for fault in faults)
    )
    one = told(cell, 0, (at_s,))
    assert one.detections.false == 1
    assert list(one.false) == [occasion(cell, 0, at_s)]
    assert any("first part" in name for name in one.false)
    assert any(line.strip().startswith("false alerts") for line in details([one]))


def test_occasions_are_known_by_their_names(cell: Cell) -> None:
    own = cell.schedules[1]
    new = [part for part in own.parts if part.program == KNOWN_PROGRAMS]
    hand = own.hands_s[0]
    assert occasion(cell, 1, hand[0] + 5.0) == OCCASIONS[0]
    assert occasion(cell, 1, new[0].start_s + 5.0) in OCCASIONS[:2]
    assert occasion(cell, 1, new[-1].start_s + 5.0) in {OCCASIONS[0], OCCASIONS[3]}
    assert occasion(cell, 1, 0.5 * DAY_S + 6 * DAY_S) in OCCASIONS[6:]


def test_the_part_in_which_a_fault_begins_is_known(cell: Cell) -> None:
    one = told(cell, 1)
    for fault, where in zip(one.faults, one.contexts, strict=True):
        parts = [part for part in cell.schedules[1].parts if part.start_s <= fault.start_s < part.end_s]
        assert (where.number >= 0) == bool(parts)
        assert where.is_new == any(part.program == KNOWN_PROGRAMS for part in parts)


def test_pages_statistic_grows_with_what_stays_above_its_slack() -> None:
    rows, idle = np.array([[1.5], [1.5], [0.0], [-9.0]]), np.array([False, False, False, True])
    assert page(rows, idle, slice(0, 4)).tolist() == [1.0, 2.0, 1.5, 1.5]
