"""What the engine does with time, rows, sources and failures, read from a processor that writes it down."""

import json
from dataclasses import replace

import pytest

from processors.actions import DeadLetter, Declare, Publish, Remove
from processors.contract import NoState, OutputSpec, PlainSpec, Provenance
from processors.errors import DeclarationError
from processors.running.engine import Engine
from processors.running.ledger import DropReason
from processors.sample import Sample, SampleKind
from sparkplug.datatype import DataType
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from sparkplug.quality import Quality
from tests.processors.recorder import RECORDER, State
from tests.processors.streams import EDGE, T0_MS, birth, data, death, engine_of, event, fed, hole, published, reading

VIBRATION = NodeId("cnc", "edge-vibration")


def log(engine: Engine, *, history: bool = False) -> list[tuple[str, float]]:
    """(kind, seconds after the start) of the samples that the fold saw."""
    machine = engine._machines["okuma"]
    lane = machine.history if history else machine.live
    assert lane is not None
    assert isinstance(lane.state, State)
    return [(kind, at_s) for kind, at_s, _, _ in lane.state.log]


def speeds(engine: Engine) -> list[float | None]:
    """The speed in the row, sample by sample."""
    state = engine._machines["okuma"].live.state
    return [rpm for *_, rpm in state.log]


# Ticks.


def test_ticks_come_at_whole_multiples_before_the_sample_that_passes_them() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.4, spindle_rpm=1.0), data(0.9, spindle_rpm=2.0), data(3.0, spindle_rpm=3.0))
    assert log(engine) == [("birth", 0.4), ("data", 0.9), ("tick", 1.0), ("tick", 2.0), ("tick", 3.0), ("data", 3.0)]


def test_a_tick_sees_the_row_as_it_was_before_the_sample() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.0, spindle_rpm=1.0), data(1.5, spindle_rpm=2.0))
    assert speeds(engine) == [1.0, 1.0, 2.0]


def test_ticks_given_by_the_wall_clock_are_the_ones_that_the_next_sample_would_have_brought() -> None:
    replay, day = engine_of(RECORDER), engine_of(RECORDER)
    fed(replay, birth(0.2, spindle_rpm=1.0), data(7.7, spindle_rpm=2.0))
    day.feed(birth(0.2, spindle_rpm=1.0), 1000.0)
    for tenth in range(70):
        day.silence(1000.0 + tenth / 10)
    assert ("tick", 4.0) in log(day)
    day.feed(data(7.7, spindle_rpm=2.0), 1007.5)
    assert log(day) == log(replay)


def test_wall_clock_ticks_wait_for_what_is_still_on_its_way() -> None:
    engine = engine_of(RECORDER)
    engine.feed(birth(0.0, spindle_rpm=1.0), 1000.0)
    engine.silence(1002.9)  # the margin is 2 s
    assert log(engine) == [("birth", 0.0)]
    engine.silence(1003.0)
    assert log(engine) == [("birth", 0.0), ("tick", 1.0)]


def test_no_tick_is_given_for_a_machine_that_is_offline() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.0, spindle_rpm=1.0), death(1.5))
    engine.silence(5000.0)
    fed(engine, birth(60.0, spindle_rpm=1.0))
    assert log(engine) == [("birth", 0.0), ("tick", 1.0), ("death", 1.0), ("birth", 60.0)]


@pytest.mark.parametrize("by_wall_clock", [False, True])
def test_a_long_silence_is_bounded_and_ends_in_one_hole(by_wall_clock: bool) -> None:
    """The same on the day, where the silence is lived through, and in its replay, where it is jumped over."""
    engine = engine_of(RECORDER, gap_s_max=5.0)
    fed(engine, birth(0.0, spindle_rpm=1.0))
    if by_wall_clock:
        for second in range(0, 20_000, 100):
            engine.silence(float(second))
    fed(engine, data(20_000.25, spindle_rpm=2.0))
    ticks = [("tick", float(second)) for second in (1, 2, 3, 4, 5)]
    assert log(engine) == [("birth", 0.0), *ticks, ("hole", 5.0), ("data", 20_000.25)]
    assert engine.counts.holes == 1


# Late and out of order.


def test_a_sample_80_ms_late_is_folded_at_the_present_time() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.0, spindle_rpm=1.0), data(0.5, spindle_load_pct=3.0), data(0.42, spindle_rpm=2.0))
    assert log(engine)[-1] == ("data", 0.5)
    assert speeds(engine)[-1] == 2.0
    assert engine.counts.late == 1


def test_a_reading_older_than_what_is_known_of_its_signal_is_not_news() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.0, spindle_rpm=1.0), data(0.5, spindle_rpm=2.0), data(0.4, spindle_rpm=9.0))
    assert speeds(engine) == [1.0, 2.0]
    assert engine.ledger.dropped[DropReason.SUPERSEDED] == 1


def test_a_straggler_is_dropped_and_does_not_move_the_clock() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(100.0, spindle_rpm=1.0), data(1.0, spindle_load_pct=9.0))
    assert engine.ledger.buffered == 1
    fed(engine, data(100.5, spindle_rpm=2.0))
    assert log(engine) == [("birth", 100.0), ("data", 100.5)]
    assert (engine.ledger.buffered, engine.ledger.dropped[DropReason.LATE]) == (0, 1)


def test_a_clock_that_is_set_back_is_followed_and_loses_nothing() -> None:
    engine = engine_of(RECORDER)
    back = [data(1.0 + i / 10, spindle_rpm=10.0 + i) for i in range(4)]
    fed(engine, birth(9000.0, spindle_rpm=1.0), *back)
    assert log(engine) == [("birth", 9000.0), ("hole", 1.0), ("data", 1.0), ("data", 1.1), ("data", 1.2), ("data", 1.3)]
    assert speeds(engine)[-4:] == [10.0, 11.0, 12.0, 13.0]
    assert engine.ledger.balance == engine.ledger.buffered == engine.ledger.dropped_total == 0


def test_a_null_stamped_by_another_clock_does_not_move_time() -> None:
    """An agent stamps UNAVAILABLE with its own start; the recording it replays is four years older."""
    engine = engine_of(RECORDER)
    unavailable = reading("spindle_load_pct", None, 1.5e8, quality=Quality.BAD, reason="UNAVAILABLE")
    fed(engine, birth(0.0, spindle_rpm=1.0), event(EventKind.DATA, 0.5, unavailable), data(0.9, spindle_load_pct=4.0))
    assert log(engine) == [("birth", 0.0), ("data", 0.0), ("data", 0.9)]
    assert engine._machines["okuma"].live.row["spindle_load_pct"].value == 4.0


def test_a_birth_of_nulls_sets_no_clock() -> None:
    engine = engine_of(RECORDER)
    nulls = reading("spindle_rpm", None, 1.5e8, quality=Quality.BAD)
    fed(engine, event(EventKind.BIRTH, 1.5e8, nulls), data(0.5, spindle_rpm=4.0), data(1.5, spindle_rpm=5.0))
    assert [kind for kind, _ in log(engine)] == ["birth", "data", "tick", "data"]
    assert engine.counts.holes == 0


def test_a_rebirth_of_an_idle_machine_does_not_turn_the_clock_back() -> None:
    engine = engine_of(RECORDER)
    engine.feed(birth(0.0, spindle_rpm=1.0), 0.0)
    engine.silence(60.0)
    engine.feed(birth(0.0, spindle_rpm=1.0), 60.0)
    assert log(engine)[-1] == ("birth", 58.0)
    assert engine.counts.holes == 0


# Sources.


def test_data_before_a_birth_is_dropped_with_that_reason() -> None:
    engine = engine_of(RECORDER)
    assert fed(engine, data(0.0, spindle_rpm=1.0)) == []
    assert engine.ledger.dropped[DropReason.BEFORE_BIRTH] == 1


def test_a_processor_never_reads_itself_and_reads_others_only_where_it_asks_to() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.0, node=NodeId("cnc", "twin-recorder"), spindle_rpm=1.0))
    fed(engine, birth(0.0, node=NodeId("cnc", "twin-thermal"), spindle_rpm=1.0))
    assert (engine.ledger.received, engine.counts.ignored, engine.machines) == (0, 2, ())


def test_two_edges_of_one_machine_complete_each_other() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.0, spindle_rpm=1.0), birth(0.1, node=VIBRATION, spindle_load_pct=5.0))
    actions = fed(engine, death(0.2))
    assert Remove("okuma") not in actions
    row = engine._machines["okuma"].live.row
    assert (row["spindle_rpm"].quality, row["spindle_load_pct"].quality) == (Quality.STALE, Quality.GOOD)
    assert Remove("okuma") in fed(engine, death(0.3, node=VIBRATION))


def test_a_signal_that_two_edges_offer_is_taken_from_the_first_until_it_dies() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.0, spindle_rpm=1.0), birth(0.1, node=VIBRATION, spindle_rpm=2.0))
    fed(engine, data(0.2, node=VIBRATION, spindle_rpm=3.0))
    assert speeds(engine)[-1] == 1.0
    assert engine.ledger.dropped[DropReason.NAME_CLASH] == 1
    fed(engine, death(0.3), birth(0.4, node=VIBRATION, spindle_rpm=4.0), birth(0.5, spindle_rpm=5.0))
    assert speeds(engine)[-1] == 4.0


def test_a_signal_that_a_new_birth_does_not_offer_is_stale() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.0, spindle_rpm=1.0, spindle_load_pct=2.0), birth(1.0, spindle_rpm=1.0))
    assert engine._machines["okuma"].live.row["spindle_load_pct"].quality is Quality.STALE


def test_machines_are_bounded_and_the_dead_make_room() -> None:
    engine = Engine(RECORDER, engine_of(RECORDER)._configuration, machines_max=2)
    fed(engine, *(birth(0.0, device=name, spindle_rpm=1.0) for name in ("a", "b", "c")))
    assert engine.ledger.dropped[DropReason.MACHINES_MAX] == 1
    fed(engine, death(1.0, device="a"), birth(2.0, device="c", spindle_rpm=1.0))
    assert engine.machines == ("b", "c")
    assert engine.ledger.balance == 0


def test_a_birth_with_too_many_signals_is_refused() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.0, **{f"signal_{i}": 0 for i in range(5001)}))
    assert engine.ledger.dropped[DropReason.SIGNALS_MAX] == 1
    assert engine.machines == ()


def test_lost_messages_are_a_hole_for_each_machine_of_the_node() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(0.0, spindle_rpm=1.0), birth(0.0, device="mazak", spindle_rpm=1.0), hole(0.5))
    assert log(engine)[-1] == ("hole", 0.0)
    assert engine.counts.holes == 2


def test_a_machine_that_is_restored_and_not_born_again_dies() -> None:
    first, second = engine_of(RECORDER), engine_of(RECORDER)
    fed(first, birth(0.0, spindle_rpm=1.0))
    second.restore(first.snapshot("okuma"))
    second.bury_unborn(T0_MS + 15_000)
    assert log(second)[-1] == ("death", 15.0)
    assert second._machines["okuma"].live.row["spindle_rpm"].quality is Quality.STALE


def test_what_was_missed_while_the_processor_was_down_is_one_counted_hole() -> None:
    first, second = engine_of(RECORDER), engine_of(RECORDER)
    fed(first, birth(0.0, spindle_rpm=1.0))
    second.restore(first.snapshot("okuma"))
    fed(second, birth(2.5, spindle_rpm=4.0))
    assert log(second) == [("birth", 0.0), ("hole", 2.5), ("birth", 2.5)], "nobody heard what held meanwhile, so no ticks"
    assert second.counts.holes == 1


# Outputs and failures.


def test_the_twin_device_is_born_before_its_first_value_and_dies_with_the_machine() -> None:
    actions = fed(engine_of(RECORDER), birth(0.0, spindle_rpm=1.0), death(0.1), birth(0.2, spindle_rpm=1.0))
    # The birth tells the last known values: the device is a new one.
    kinds = [type(action) for action in actions]
    assert kinds == [Declare, Publish, Publish, Remove, Declare, Publish]
    first, second = actions[0], actions[4]
    assert isinstance(first, Declare)
    assert isinstance(second, Declare)
    assert {(change.value, change.reason) for change in first.latest} == {(None, "nothing computed yet")}
    assert [change.value for change in second.latest] == [2, True, 1.0]  # as of the death


def test_a_number_is_published_again_only_when_it_left_the_deadband() -> None:
    engine = engine_of(RECORDER)
    actions = fed(engine, birth(0.0, spindle_rpm=10.0), *(data(0.1 * i, spindle_rpm=10.0 + i) for i in range(1, 8)))
    assert [value for _, name, value, _ in published(actions) if name == "twin/level"] == [10.0, 15.0]


def test_an_answer_that_is_not_finite_is_a_null_that_says_so() -> None:
    actions = fed(engine_of(RECORDER), birth(0.0, spindle_rpm=888.0))
    *_, change = (change for action in actions if isinstance(action, Publish) for change in action.changes)
    assert (change.value, change.quality, change.reason) == (None, Quality.BAD, "the model has no finite answer")


@pytest.mark.parametrize(
    ("rpm", "error"),
    [
        (13.0, "ZeroDivisionError: as asked"),
        (666.0, "OutputError: recorder emits 'twin/undeclared', which it does not declare"),
        (777.0, "OutputError: twin/count is declared INT64, and a step returned 'seven'"),
        (999.0, "OutputError: recorder emits 'elsewhere/x', which it does not declare"),
    ],
)
def test_a_step_that_fails_leaves_the_state_before_and_a_letter(rpm: float, error: str) -> None:
    engine = engine_of(RECORDER, fail_at=13.0)
    actions = fed(engine, birth(0.0, spindle_rpm=1.0), data(0.1, spindle_rpm=rpm), data(0.2, spindle_rpm=2.0))
    (letter,) = [json.loads(action.payload) for action in actions if isinstance(action, DeadLetter)]
    assert letter["error"] == error
    assert (letter["machine"], letter["kind"], letter["changed"]) == ("okuma", "data", {"spindle_rpm": rpm})
    assert log(engine) == [("birth", 0.0), ("data", 0.2)]
    assert engine.ledger.dropped[DropReason.DEAD_LETTER] == engine.counts.dead_letters == 1
    assert engine.ledger.balance == 0


# History.


def test_history_folds_into_a_state_of_its_own_and_its_outputs_say_so() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(1000.0, spindle_rpm=1.0))
    actions = fed(engine, data(10.0, history=True, spindle_rpm=50.0), data(12.0, history=True, spindle_rpm=60.0))
    assert log(engine) == [("birth", 1000.0)]
    assert log(engine, history=True) == [("data", 10.0), ("tick", 11.0), ("tick", 12.0), ("data", 12.0)]
    assert {flag for *_, flag in published(actions)} == {True}
    assert speeds(engine) == [1.0]


def test_history_wakes_nobody() -> None:
    engine = engine_of(RECORDER)
    live = published(fed(engine, birth(1000.0, spindle_rpm=1.0)))
    late = published(fed(engine, data(10.0, history=True, spindle_rpm=50.0)))
    assert "twin/alarm" in {name for _, name, *_ in live}
    assert {name for _, name, *_ in late} == {"twin/count", "twin/level"}


def test_a_message_with_both_goes_through_both_lanes_and_the_ledger_balances() -> None:
    engine = engine_of(RECORDER)
    fed(engine, birth(100.0, spindle_rpm=1.0))
    both = event(EventKind.DATA, 100.1, reading("spindle_rpm", 5.0, 3.0, history=True), reading("spindle_rpm", 2.0, 100.1))
    fed(engine, both)
    assert (log(engine)[-1], log(engine, history=True)) == (("data", 100.1), [("data", 3.0)])
    assert (engine.ledger.received, engine.ledger.balance) == (3, 0)


# Declarations.


def test_the_row_is_read_only() -> None:
    def meddle(_: object, state: NoState, sample: Sample) -> tuple[NoState, tuple[()]]:
        sample.row["spindle_rpm"] = reading("spindle_rpm", 1.0)  # type: ignore[index]
        return state, ()

    processor = replace(RECORDER, name="meddler", outputs=(), state=NoState, initial=lambda _: NoState(), step=meddle)
    actions = fed(engine_of(processor), birth(0.0, spindle_rpm=1.0))
    assert isinstance(actions[0], DeadLetter)
    assert b"does not support item assignment" in actions[0].payload


def test_a_wrong_declaration_is_refused_where_it_stands() -> None:
    with pytest.raises(DeclarationError, match="has to start with 'twin/'"):
        OutputSpec("temperature", DataType.DOUBLE, None, "", Provenance.MODELLED)
    with pytest.raises(DeclarationError, match="DATASET"):
        OutputSpec("twin/table", DataType.DATASET, None, "", Provenance.MODELLED)
    with pytest.raises(DeclarationError, match=r"spBv1.0"):
        PlainSpec("spBv1.0/cnc/", "")
    with pytest.raises(DeclarationError, match="frozen dataclass"):
        replace(RECORDER, state=dict)


def test_the_kinds_of_samples_are_these() -> None:
    assert [kind.value for kind in SampleKind] == ["data", "tick", "birth", "death", "hole", "plain", "beat"]


def test_a_hole_of_an_unknown_node_concerns_nobody() -> None:
    engine = engine_of(RECORDER)
    assert fed(engine, hole(0.0), HostEvent(EventKind.DEATH, EDGE, None, T0_MS)) == []
    assert engine.ledger.received == 0


def test_what_another_processor_says_of_no_concern_does_not_move_the_time() -> None:
    """A recording of 2022 is replayed; the alerts beside it are stamped by the clock on the wall."""
    alerts = NodeId("cnc", "twin-alerts")
    reader = replace(RECORDER, name="reader", inputs=frozenset({"spindle_rpm", "twin/raw_score"}))
    engine = engine_of(reader)
    years_s = 1.5e8
    fed(engine, birth(0.0, spindle_rpm=1.0), birth(years_s, node=alerts, **{"twin/alert_state": "none"}))
    fed(engine, data(years_s, node=alerts, **{"twin/alert_state": "firing"}), data(1.5, spindle_rpm=2.0))
    assert [kind for kind, _ in log(engine)] == ["birth", "birth", "tick", "data"]
    assert engine.counts.holes == 0
    assert engine.ledger.balance == 0


def test_a_machine_whose_edge_is_offline_is_offline_whatever_other_processors_go_on_saying() -> None:
    rules = NodeId("cnc", "twin-rules")
    reader = replace(RECORDER, name="reader", inputs=frozenset({"spindle_rpm", "twin/severity"}))
    engine = engine_of(reader)
    severe = {"twin/severity": "none"}
    fed(engine, birth(0.0, node=rules, **severe))
    assert engine.machines == (), "nobody's machine"
    fed(engine, birth(0.0, spindle_rpm=1.0), data(1.0, node=rules, **severe))
    assert engine.machines == ("okuma",)
    actions = fed(engine, death(2.0))
    assert actions[-1] == Remove("okuma")
    assert engine.machines == ()
    assert fed(engine, data(3.0, node=rules, **{"twin/severity": "high"}), birth(4.0, node=rules, **severe)) == []
    assert engine.machines == ()
    assert engine.ledger.balance == 0
    assert Declare in map(type, fed(engine, birth(9.0, spindle_rpm=2.0)))
    assert engine._machines["okuma"].live.row["twin/severity"].value == "none"
