"""What the joint score publishes live is what the array forms give over the same ticks, whatever comes late, dies or restarts."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from processors.actions import Action, DeadLetter, Publish
from processors.joint_anomaly.member import ADJUSTED, ALARM, COMMON, GATE
from processors.joint_anomaly.parts_member import RAW
from processors.running.engine import Engine
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from tests.depth import examples
from tests.processors.joint_anomaly.test_processor import A_TENTH, PlainModel, born, cell, engine_with, fed, metric, says
from tests.processors.streams import T0_MS, birth, death, event, reading
from twin.anomaly.alarm import AlarmRule, is_alarm
from twin.anomaly.common_mode import CommonModeRule, Method, adjust_frames
from twin.anomaly.gate import gate

UNTIL_S = 60
FINE = 10  # edges fall on tenths of a tick
LOADS = (30.0, 45.0, 55.0, 62.0, 70.0, 80.0, 95.0, None)
quickly = settings(max_examples=examples(60, 30), deadline=None)


@dataclass(frozen=True)
class Shift:
    """What each machine says and when, in s after the start; and the settings."""

    table: dict[str, Any]
    says: dict[str, list[tuple[float, dict[str, Any]]]]
    clear_fraction: float = 0.8


def drawn(seed: int) -> Shift:
    """A minute of up to five machines: loads, unknown ones too, and tool changes, each said when it changes."""
    chance = Random(seed)
    table = {
        "common_mode": chance.choice(["source", "residual"]),
        "common_mode_factor": chance.choice([0.3, 0.5, 1.0]),
        "exclude_gated_peers": chance.random() < 0.5,
        "look_back_s": chance.choice([0.0, 0.0, 2.0, 4.5]),
        "tail_s": chance.choice([0.0, 1.0, 2.5, 4.0]),
        "dwell_ticks": chance.choice([1, 2, 3]),
        "calm_s": chance.choice([0.0, 7.0]),
        "peer_wait_s": 10.0,
    }
    said = {}
    for machine in "abcde"[: chance.randint(1, 5)]:
        at, is_changing, course = 0, False, []
        while (at := at + chance.randint(1, 60)) < UNTIL_S * FINE:
            values: dict[str, Any] = {"spindle_load_pct": chance.choice(LOADS)} if chance.random() < 0.8 else {}
            if not values or chance.random() < 0.25:
                values["tool_change_active"] = is_changing = not is_changing
            course.append((at / FINE, values))
        said[machine] = course
    return Shift(table, said)


def engine_for(shift: Shift) -> Engine:
    """All machines have the plain model; for the residual a spread of 0.1 about −0.2."""
    return cell(*shift.says, calibration=Centred(), **shift.table)


@dataclass(frozen=True)
class Centred:
    """What the residual needs of a calibration."""

    raw_center: float = -0.2
    raw_spread: float = 0.1
    threshold: float = 0.1
    in_words: str = "for tests"
    hourly_means: tuple[float, ...] = ()


@dataclass(frozen=True)
class Expected:
    """By the array forms, one row a tick from the first on, one column a machine; NaN = not known."""

    raw: NDArray[np.float64]
    adjusted: NDArray[np.float64]
    common: NDArray[np.bool_]
    gated: NDArray[np.bool_]
    alarm: NDArray[np.bool_]


def expected(shift: Shift, unheard: dict[str, range] | None = None) -> Expected:
    """Over arrays. `unheard`: ticks at which a machine was offline.

    A tick sees what was said before it, not what was said at its very moment. Edges fall between ticks: the gate is that over a
    grid of tenths, looked at where the ticks are.
    """
    config = engine_for(shift)._configuration.default
    ticks, fine = UNTIL_S - 1, (UNTIL_S + 20) * FINE
    raw, active = np.full((ticks, len(shift.says)), np.nan), np.zeros((fine, len(shift.says)), dtype=np.bool_)
    for place, (machine, course) in enumerate(shift.says.items()):
        for from_s, values in [(0.0, {"spindle_load_pct": 30.0}), *course]:
            after = int(from_s * FINE + 0.5) + 1
            if "spindle_load_pct" in values:
                load = values["spindle_load_pct"]
                raw[(after - 1) // FINE :, place] = np.nan if load is None else (load - 50.0) / 100.0
            if "tool_change_active" in values:
                active[after:, place] = values["tool_change_active"]
        for tick in (unheard or {}).get(machine, ()):
            raw[tick - 1, place] = np.nan
    # in fine steps, with tail and look-back in whole ticks
    tail_s, look_back_s = (np.ceil(value) for value in (config.tail_s, config.look_back_s))
    gated = gate(active, 1.0 / FINE, float(tail_s), float(look_back_s))[FINE : UNTIL_S * FINE : FINE]
    z = raw if config.common_mode is Method.SOURCE else (raw + 0.2) / 0.1
    rule = CommonModeRule(config.common_mode, config.common_mode_factor, config.exclude_gated_peers)
    adjusted, common = adjust_frames(rule, z, gated)
    alarm = is_alarm(
        AlarmRule(0.1, config.dwell_ticks, config.clear_fraction, round(config.calm_s / config.tick_s)), adjusted, gated
    )
    return Expected(raw, adjusted, common, gated, alarm)


def is_resolved(shift: Shift) -> bool:
    """Return whether some tick sees each tool change, and each pause between two."""
    for course in shift.says.values():
        edges = [0.0, *(at_s for at_s, values in course if "tool_change_active" in values)]
        if any(int(late) == int(early) for early, late in pairwise(edges[1:])):
            return False
    return True


def messages(shift: Shift) -> list[HostEvent]:
    """Without the births, by the time of the machines."""
    told = [says(at_s, machine, **values) for machine, course in shift.says.items() for at_s, values in course]
    return sorted(told, key=lambda one: one.timestamp_ms)


def lived(engine: Engine, arrivals: Sequence[tuple[float, HostEvent]], from_s: float = 0.0) -> list[Action]:
    """As the worker does it: each message as it comes, and silence twice a second, until all that was on its way has come."""
    actions: list[Action] = []
    waiting = sorted(arrivals, key=lambda pair: pair[0])
    wall_s = from_s
    while wall_s < UNTIL_S + 20.0 or waiting:
        while waiting and waiting[0][0] <= wall_s:
            came_s, one = waiting.pop(0)
            actions += engine.feed(one, came_s)
        actions += engine.silence(wall_s)
        wall_s += 0.5
    return actions


def prompt(shift: Shift) -> list[tuple[float, HostEvent]]:
    """Nothing is late."""
    return [((one.timestamp_ms - T0_MS) / 1000, one) for one in messages(shift)]


def held(told: Sequence[tuple[float, Any]]) -> list[Any]:
    """At each tick what was said last, of what is told when it changes."""
    values, series = dict(told), []
    value = None
    for tick in range(1, UNTIL_S):
        value = values.get(float(tick), value)
        series.append(value)
    return series


def everything(actions: Sequence[Action], machine: str, until_s: float = UNTIL_S - 1) -> list[tuple[Any, ...]]:
    """All that was published of a machine, by name and time, up to the last tick that counts."""
    changes = [
        change for action in actions if isinstance(action, Publish) and action.machine == machine for change in action.changes
    ]
    until_ms = T0_MS + until_s * 1000
    return sorted((c.name, c.timestamp_ms, repr(c.value), c.reason or "") for c in changes if T0_MS < c.timestamp_ms <= until_ms)


def as_numbers(series: Sequence[Any]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else float(value) for value in series])


def assert_agrees(actions: Sequence[Action], machine: str, place: int, arrays: Expected) -> None:
    for name, column in ((RAW, arrays.raw), (ADJUSTED, arrays.adjusted)):
        np.testing.assert_array_equal(as_numbers(held(metric(list(actions), name, machine))), column[:, place])
    assert held(metric(list(actions), GATE, machine)) == arrays.gated[:, place].tolist()
    known = ~np.isnan(arrays.adjusted[:, place])
    common, alarm = held(metric(list(actions), COMMON, machine)), held(metric(list(actions), ALARM, machine))
    assert [bool(told) for told in common] == arrays.common[:, place].tolist()
    assert [told is None for told in common] == (~known).tolist()
    assert [bool(told) for told in alarm] == arrays.alarm[:, place].tolist()
    assert [told is None for told in alarm] == (~known & ~arrays.alarm[:, place]).tolist()


@given(seed=st.integers(0, 2**32))
@quickly
def test_what_is_published_live_is_what_the_array_forms_give(seed: int) -> None:
    shift = drawn(seed)
    engine = engine_for(shift)
    actions = [*fed(engine, *born(*shift.says)), *lived(engine, prompt(shift))]
    arrays = expected(shift)
    for place, machine in enumerate(shift.says):
        assert_agrees(actions, machine, place, arrays)
    assert not [action for action in actions if isinstance(action, DeadLetter)]
    assert engine.ledger.balance == 0


@given(seed=st.integers(0, 2**32))
@quickly
def test_the_gate_is_that_of_the_ticks_where_a_tick_sees_every_change(seed: int) -> None:
    shift = drawn(seed)
    if not is_resolved(shift):
        return
    config = engine_for(shift)._configuration.default
    active = np.zeros((UNTIL_S + 20, len(shift.says)), dtype=np.bool_)
    for place, course in enumerate(shift.says.values()):
        for at_s, values in course:
            if "tool_change_active" in values:
                active[int(at_s) :, place] = values["tool_change_active"]
    by_ticks = gate(active, 1.0, config.tail_s, config.look_back_s)[: UNTIL_S - 1]
    np.testing.assert_array_equal(by_ticks, expected(shift).gated)


@given(seed=st.integers(0, 2**32))
@quickly
def test_the_order_in_which_messages_of_different_machines_come_changes_nothing(seed: int) -> None:
    """Each machine's own order stays; it is up to 5 s late, and up to 1.5 s more than its birth was."""
    shift, chance = drawn(seed), Random(seed + 1)
    delay_s = {machine: chance.uniform(0.0, 5.0) for machine in shift.says}
    came_s = dict.fromkeys(shift.says, 0.0)
    births = [birth(-10.0, device=m, node=NodeId("cnc", m), spindle_load_pct=30.0, tool_change_active=False) for m in shift.says]
    late = [(delay_s[one.device or ""] - 10.0, one) for one in births]
    for one in messages(shift):
        machine = one.device or ""
        at_s = (one.timestamp_ms - T0_MS) / 1000 + delay_s[machine] + chance.uniform(0.0, 1.5)
        came_s[machine] = max(came_s[machine], at_s)
        late.append((came_s[machine], one))
    first, second = engine_for(shift), engine_for(shift)
    in_time = lived(first, [*((-10.0, one) for one in births), *prompt(shift)], -10.0)
    by_arrival = lived(second, late, -10.0)
    for machine in shift.says:
        assert everything(by_arrival, machine) == everything(in_time, machine)


def born_again(engine: Engine, machine: str, at_s: float) -> HostEvent:
    """The edge has lived on: its birth has all values with their own times."""
    row = engine._machines[machine].live.row
    readings = [reading(name, one.value, (one.timestamp_ms - T0_MS) / 1000) for name, one in row.items()]
    return event(EventKind.BIRTH, at_s, *readings, node=NodeId("cnc", machine), device=machine)


@given(seed=st.integers(0, 2**32), cut=st.floats(0.0, 1.0))
@quickly
def test_a_restart_at_any_point_changes_nothing(seed: int, cut: float) -> None:
    shift, chance = drawn(seed), Random(seed + 2)
    stream = prompt(shift)
    whole, first, second = engine_for(shift), engine_for(shift), engine_for(shift)
    opening, rest = stream[: round(cut * len(stream))], stream[round(cut * len(stream)) :]
    at_s = opening[-1][0] if opening else 0.0
    uninterrupted = [*fed(whole, *born(*shift.says)), *lived(whole, stream)]
    before = fed(first, *born(*shift.says))
    for came_s, one in opening:
        before += [*first.feed(one, came_s), *first.silence(came_s)]
    second.restore(first.snapshot("all"))
    births = [born_again(first, machine, at_s) for machine in shift.says]
    chance.shuffle(births)
    after = [action for one in births for action in second.feed(one, at_s)]
    after += lived(second, rest, at_s)
    for machine in shift.says:
        alarms_and_scores = {RAW, ADJUSTED, COMMON, GATE, ALARM}
        told = [one for one in everything([*before, *after], machine) if one[0] in alarms_and_scores]
        assert told == [one for one in everything(uninterrupted, machine) if one[0] in alarms_and_scores]


@given(seed=st.integers(0, 2**32))
@quickly
def test_a_death_takes_a_machine_out_of_the_frames_from_the_next_tick_on(seed: int) -> None:
    """A machine dies between the ticks 20 and 21 and is born again before 31; its peers are judged by those who are there."""
    shift = drawn(seed)
    loads_only = {
        machine: [(at_s, values) for at_s, values in course if not (machine == "a" and 20.0 <= at_s <= 30.5)]
        for machine, course in shift.says.items()
    }
    shift = Shift(shift.table, loads_only)
    loads = [values["spindle_load_pct"] for at_s, values in shift.says["a"] if at_s < 25.0 and "spindle_load_pct" in values]
    active = [values["tool_change_active"] for at_s, values in shift.says["a"] if at_s < 25.0 and "tool_change_active" in values]
    node = NodeId("cnc", "a")
    again = birth(30.5, device="a", node=node, spindle_load_pct=[30.0, *loads][-1], tool_change_active=[False, *active][-1])
    engine = engine_for(shift)
    stream = [*prompt(shift), (20.5, death(20.5, device="a", node=node)), (30.5, again)]
    actions = [*fed(engine, *born(*shift.says)), *lived(engine, stream)]
    arrays = expected(shift, {"a": range(21, 31)})
    for place, machine in enumerate(shift.says):
        if machine != "a":
            assert_agrees(actions, machine, place, arrays)
    told = dict(metric(actions, ALARM, "a"))
    assert not [at_s for at_s in told if 20.0 < at_s < 31.0]
    assert not [action for action in actions if isinstance(action, DeadLetter)]


class HalfBroken(PlainModel):
    """No finite answer above 80 %, and an error above 90 %."""

    def score_one(self, values: Sequence[float]) -> float:
        if values[0] > 90.0:
            raise ValueError("this library cannot")
        return float("nan") if values[0] > 80.0 else super().score_one(values)


@pytest.mark.parametrize(("load", "why"), [(85.0, "the model has no finite answer"), (95.0, "the model fails: ValueError")])
@pytest.mark.parametrize("common_mode", ["source", "residual"])
def test_a_model_that_fails_concerns_its_own_machine_only_and_is_said(load: float, why: str, common_mode: str) -> None:
    models = {"a": HalfBroken(Centred()), "b": PlainModel(Centred())}
    engine = engine_with(models, {"threshold": A_TENTH, "common_mode": common_mode})
    stream = [
        one
        for s in range(1, 12)
        for one in (says(s + 0.2, "a", spindle_load_pct=load), says(s + 0.3, "b", spindle_load_pct=90.0))
    ]
    actions = fed(engine, *born("a", "b"), *stream)
    changes = [
        c for e in actions if isinstance(e, Publish) and e.machine == "a" for c in e.changes if c.timestamp_ms > T0_MS + 1500
    ]
    assert {(c.name, c.value, c.reason) for c in changes if c.name in (RAW, ADJUSTED)} == {
        (RAW, None, why),
        (ADJUSTED, None, why),
    }
    assert True in [on for _, on in metric(actions, ALARM, "b")]
    assert not [action for action in actions if isinstance(action, DeadLetter)]


@pytest.mark.parametrize("leap_s", [-86_400.0, -100.0, -7.0, 100.0, 86_400.0])
def test_a_clock_that_is_set_costs_that_machine_its_dwell_and_its_peers_nothing(leap_s: float) -> None:
    """From 10 s on the clock of c is another; a and b are still judged beside each other at every tick."""
    engine = cell("a", "b", "c")
    stream = [
        says(s + 0.5 + (leap_s if machine == "c" and s >= 10 else 0.0), machine, spindle_load_pct=30.0 + s % 3)
        for s in range(40)
        for machine in "abc"
    ]
    actions = fed(engine, *born("a", "b", "c"), *stream)
    for machine in "ab":
        assert [at_s for at_s, _ in metric(actions, ADJUSTED, machine)] == [float(s) for s in range(1, 40)]
        assert {peers for at_s, peers in metric(actions, "twin/common_mode_peers", machine) if at_s > 20} <= {1, 2}
    assert metric(actions, ADJUSTED, "c")[-1][0] > 35.0 + leap_s
    assert not [action for action in actions if isinstance(action, DeadLetter)]


def test_what_is_known_of_a_machine_is_kept_while_it_is_offline_and_others_are_born() -> None:
    engine = cell("a", "b")
    fed(engine, *born("a", "b"), *(says(s + 0.5, m, spindle_load_pct=30.0 + s) for s in range(20) for m in "ab"))
    known = engine.known_units["all"].live.state.members["a"]
    fed(engine, death(20.0, device="a", node=NodeId("cnc", "a")), *born("b"))
    kept = engine.known_units["all"].live.state.members["a"]
    assert (known.tick, kept.tick) == (T0_MS // 1000 + 19, None)
    assert (kept.drift, kept.alarm, kept.gate.changes) == (known.drift, known.alarm, known.gate.changes)
    assert kept.total_s >= known.total_s > 0.0


def test_a_thousand_machines_in_one_cell_in_any_order() -> None:
    machines, chance = [f"m{i}" for i in range(1000)], Random(7)
    engine = cell(*machines)
    actions = fed(engine, *born(*machines))
    for second in range(3):
        chance.shuffle(machines)
        actions += fed(engine, *(says(second + 0.5, machine, spindle_load_pct=40.0 + second) for machine in machines))
    peers = [c.value for e in actions if isinstance(e, Publish) for c in e.changes if c.name == "twin/common_mode_peers"]
    assert peers == [999] * 1000


def test_a_change_of_tools_before_the_processor_was_restarted_still_has_its_tail() -> None:
    """The change ends at 10.5 s, the processor is away from 11 to 13 s: the gate lasts to 18.5 s."""
    first, second = cell("a"), cell("a")
    opening = [
        says(5.5, "a", tool_change_active=True),
        says(10.5, "a", tool_change_active=False),
        says(11.2, "a", spindle_load_pct=99.0),
    ]
    fed(first, *born("a"), *opening)
    second.restore(first.snapshot("all"))
    again = birth(13.2, device="a", node=NodeId("cnc", "a"), spindle_load_pct=99.0, tool_change_active=False)
    actions = fed(second, again, *(says(s + 0.5, "a", spindle_load_pct=99.0 - s / 10) for s in range(14, 30)))
    assert metric(actions, GATE)[-1] == (19.0, False)
    assert metric(actions, ALARM)[-1] == (21.0, True)
