"""The connection to a control: what is asked when, what follows from each code, and which time is a hole."""

import threading
import time
from itertools import pairwise

import pytest

from edge.controls.focas.calls import Call
from edge.controls.focas.connection import BACKOFF_S_MAX, FocasConnection, calendar_ms
from edge.controls.focas.plan import LOOKS_BUSY_MAX
from edge.controls.focas.policy import CODES, Policy, policy_of, told
from edge.sample import ClockReading
from edge.sweep import Sweep
from tests.edge.controls.focas.imagined_control import T0_S, ImaginedControl, times_asked

LOAD = Call.SPINDLE_LOAD


def facts(sweep: Sweep) -> dict[str, object]:
    return {fact.key: fact.fault or fact.value for fact in sweep.facts}


def codes_with(policy: Policy) -> list[int]:
    return [code for code in CODES if policy_of(code) is policy]


def test_the_first_sweep_has_everything_and_the_others_what_changes_fast() -> None:
    control = ImaginedControl()
    first, second, *_ = sweeps = control.looks(12)
    assert facts(first)["control.axes"] == "X B"
    assert {"program.name", "alarms", "modal.G2", "block", "servo_load.B"} <= facts(first).keys()
    assert not {"control.axes", "program.name", "alarms"} & facts(second).keys()
    assert [sweep.number for sweep in sweeps] == list(range(12))
    assert [sweep.t_ms - sweeps[0].t_ms for sweep in sweeps[:3]] == [0, 200, 400]
    assert times_asked(control, Call.PROGRAM) == 3
    assert times_asked(control, Call.STATUS) == 12
    assert not any(sweep.holes for sweep in sweeps)


def test_groups_that_are_left_out_are_not_asked() -> None:
    control = ImaginedControl(groups=[], tool_change_pmc="R100.3", tool_number_pmc="D100:2")
    control.looks(2)
    assert {name for asked in control.asked for name in asked} == {
        "cnc_statinfo",
        "cnc_rddynamic2",
        "pmc_rdpmcrng R100",
        "pmc_rdpmcrng D100:2",
        "cnc_exeprgname",
    }


def test_the_second_path_has_its_signals_a_thousand_further_on() -> None:
    control = ImaginedControl(path=2)
    control.looks(1)
    assert {"pmc_rdpmcrng F1007", "pmc_rdpmcrng F1010:4", "pmc_rdpmcrng G1012"} <= set(control.asked[0])


@pytest.mark.parametrize("code", codes_with(Policy.BAD))
def test_a_bad_code_is_a_fault_of_that_fact_and_asked_again(code: int) -> None:
    control = ImaginedControl()
    control.fails = {LOAD: code}
    sweeps = control.looks(3)
    assert [facts(sweep)["spindle_load"] for sweep in sweeps] == [told(code)] * 3
    assert times_asked(control, LOAD) == 3
    assert told(code) in control.connection.last_error


@pytest.mark.parametrize("code", codes_with(Policy.GIVE_UP))
def test_a_function_that_is_missing_is_given_up_and_said_once(code: int) -> None:
    control = ImaginedControl()
    control.fails = {LOAD: code}
    first, *others = control.looks(5)
    assert facts(first)["spindle_load"] == told(code)
    assert not any("spindle_load" in facts(sweep) for sweep in others)
    assert times_asked(control, LOAD) == 1
    assert control.connection.last_error == f"cnc_rdspmeter: {told(code)}"


@pytest.mark.parametrize("code", codes_with(Policy.RETRY))
def test_a_busy_control_is_asked_again_and_the_value_stands(code: int) -> None:
    control = ImaginedControl()
    control.fails = {LOAD: code}
    sweeps = control.looks(LOOKS_BUSY_MAX)
    assert not any("spindle_load" in facts(sweep) for sweep in sweeps[:-1])
    assert facts(sweeps[-1])["spindle_load"] == told(code)
    assert not any(sweep.holes or sweep.error for sweep in sweeps)
    assert "asked again at the next look" in control.connection.last_error
    control.fails.clear()
    assert facts(control.looks(1)[0])["spindle_load"] == 0


@pytest.mark.parametrize("code", codes_with(Policy.RECONNECT))
def test_a_lost_handle_is_made_again_and_the_time_between_is_a_hole(code: int) -> None:
    control = ImaginedControl()
    control.looks(1)
    control.fails, control.refuses = {Call.STATUS: code}, [0, code, code, code]

    def back() -> None:
        if control.opened > 5:
            control.fails.clear()

    control.before_ask = back
    (after,) = control.looks(1)
    (hole,) = after.holes
    assert (hole.reason, hole.to_ms) == (told(code), after.t_ms)
    away_ms = after.t_ms - round(T0_S * 1000)
    assert hole.from_ms == round(T0_S * 1000)
    assert hole.lost >= (round(away_ms / 200) - 1) * 20
    assert "control.axes" in facts(after)
    assert control.connection.reconnects == 5
    assert control.waits == sorted(control.waits) or max(control.waits) < 5


def test_waits_grow_to_a_bound_and_never_are_the_same_for_all() -> None:
    control = ImaginedControl()
    control.refuses = [-16] * 20
    control.looks(1)
    waits = control.waits[:20]
    assert all(wait <= BACKOFF_S_MAX for wait in waits)
    assert waits[0] <= 0.25
    assert waits[10] >= BACKOFF_S_MAX / 2
    assert len({round(wait, 6) for wait in waits}) == 20
    assert control.connection.last_error == f"focas://127.0.0.1:8193: {told(-16)}: told to"


def test_what_was_given_up_is_asked_again_of_a_new_handle() -> None:
    control = ImaginedControl()
    control.fails = {LOAD: 6}
    control.looks(2)
    control.fails = {Call.STATUS: -16}
    control.before_ask = lambda: control.fails.clear() if control.opened > 1 else None
    (after,) = control.looks(1)
    assert facts(after)["spindle_load"] == 0


def test_a_slow_control_is_looked_at_less_often_and_only_long_silence_is_a_hole() -> None:
    control = ImaginedControl()
    control.call_s = 0.4
    assert not any(sweep.holes for sweep in control.looks(5))
    control.call_s = 3.0
    sweeps = control.looks(3)
    assert [hole.reason for sweep in sweeps[1:] for hole in sweep.holes] == ["the control answered slowly"] * 2
    assert all(hole.lost > 0 for sweep in sweeps for hole in sweep.holes)


def test_the_clock_is_read_once_in_a_while_and_stamps_nothing() -> None:
    control = ImaginedControl(clock_interval_s=2)
    readings = [sweep.clock for sweep in control.looks(21)]
    read = [at for at, reading in enumerate(readings) if reading]
    assert read[0] == 0
    assert all(5 <= later - before <= 10 for before, later in pairwise(read)), (
        "each 2 s, up to a second early, five looks a second"
    )
    first = readings[0]
    assert first == ClockReading(1_700_000_001_000, round(T0_S * 1000), 0, 1000, stamps_samples=False)
    ahead = ImaginedControl(utc_offset_min=540).looks(1)[0].clock
    assert ahead is not None
    assert first is not None
    assert first.control_ms - ahead.control_ms == 540 * 60_000


@pytest.mark.parametrize("words", [[2026, 2, 30, 9, 0, 0], [2026, 5, 14, 0, 0, 1], [2026, 5, 14], [1, 1, 1, 1, 1, 1], [0] * 6])
def test_a_calendar_that_shows_no_time_gives_no_reading(words: list[int]) -> None:
    assert not calendar_ms(words, 0)


def test_the_first_look_asks_all_that_is_rare_and_later_ones_a_few_at_a_time() -> None:
    control = ImaginedControl()
    (first,) = control.looks(1)
    kinds = {"offset.length", "offset.length_wear", "offset.radius", "offset.radius_wear"}
    assert kinds | {"program.comment"} <= facts(first).keys()
    control.shows["modal.H"] = 8
    control.looks(2)
    control.shows |= {"modal.H": 9, "modal.D": 29, "program.number": 1702}
    control.looks(4)
    rare = ("cnc_rdtofs", "cnc_rdprogdir3")
    asked = [[name for name in names if name.startswith(rare)] for names in control.asked[4:]]  # after the look that shows H 8
    assert asked == [
        ["cnc_rdtofs length_wear 8", "cnc_rdtofs length 8"],  # only what has changed
        [],
        ["cnc_rdtofs radius_wear 29", "cnc_rdtofs radius 29", "cnc_rdtofs length_wear 9", "cnc_rdtofs length 9"],
        ["cnc_rdprogdir3 1702"],
        [],
    ]


def test_an_offset_that_is_not_in_force_is_a_null_with_the_reason() -> None:
    control = ImaginedControl()
    control.shows["modal.H"] = 0
    (first,) = control.looks(1)
    faults = {fact.key: fact.fault for fact in first.facts}
    assert (faults["offset.length"], faults["offset.radius"]) == ("no offset is in force: H 0", "")


def test_chosen_variables_and_addresses_are_asked_with_the_slow_ones() -> None:
    control = ImaginedControl(variables={"width": {"address": "#500"}}, plc={"door": {"address": "R100.3", "kind": "flag"}})
    control.looks(6)
    assert [times_asked(control, call) for call in (Call.MACRO, Call.MESSAGE)] == [2, 2]
    assert sum("pmc_rdpmcrng R100" in asked for asked in control.asked) == 2


def test_closing_ends_the_frames_at_once_whatever_they_wait_for() -> None:
    control = ImaginedControl()
    control.refuses = [-16] * 10_000
    connection = FocasConnection(control.config, backend=control)
    connection._failures = 16  # so that it would wait for 15 s at least
    thread = threading.Thread(target=lambda: list(connection.frames()))
    thread.start()
    time.sleep(0.05)
    began_s = time.monotonic()
    connection.close()
    thread.join(10)
    assert not thread.is_alive()
    assert time.monotonic() - began_s < 10.0


def test_silence_is_counted_from_the_last_look() -> None:
    control = ImaginedControl()
    control.looks(1)
    control.now_s += 7
    assert control.connection.silent_s() == pytest.approx(7, abs=0.3)
