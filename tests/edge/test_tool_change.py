"""The state machine of the tool change, on the patterns that real controls showed."""

from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.config import ToolChangeSection
from edge.running.pipeline import tells_nothing
from edge.sample import EdgeSample
from edge.tool_change import Phase, State, is_tool_change_block, not_observable, step, tick
from sparkplug.quality import Quality

CONFIG = ToolChangeSection()
T0 = 1_700_000_000_000
Event = tuple[float, str, object]


def sample(at_s: float, kind: str, value: object, *, is_baseline: bool = False) -> EdgeSample:
    at_ms = T0 + round(at_s * 1000)
    kinds = {"tool": "tool_number", "block": "nc_block", "exec": "exec_state", "time": "spindle_rpm", "cue": "tool_change_cue"}
    signal = kinds[kind]
    if kind == "cue":
        assert isinstance(value, bool | None)
        return EdgeSample(signal, value, at_ms, reason="M6" if value else "", is_baseline=is_baseline)
    if kind == "tool" and value == "":
        return EdgeSample(signal, None, at_ms, Quality.GOOD, "empty", is_baseline=is_baseline)
    if value == "UNAVAILABLE":
        return EdgeSample(signal, None, at_ms, Quality.BAD, "unavailable", is_baseline=is_baseline)
    if kind == "tool" and isinstance(value, str):
        return EdgeSample(signal, None, at_ms, Quality.BAD, f"not a number: {value!r}", is_baseline=is_baseline)
    assert value is None or isinstance(value, str | int)
    return EdgeSample(signal, value, at_ms, is_baseline=is_baseline)


class Run:
    """A machine that runs block by block with tool 1, and what was published of it."""

    def __init__(self, *events: Event, config: ToolChangeSection = CONFIG) -> None:
        self.state, self.published, self.debounced, self.config = State(), list[EdgeSample](), 0, config
        self.feed((0, "exec", "ACTIVE"), (0, "block", "G0 X1"), (0, "tool", 1), *events)

    def feed(self, *events: Event) -> "Run":
        for event in events:
            self.take(step(self.config, self.state, sample(*event)))
        return self

    def take(self, done: object) -> None:
        self.state = done.state  # type: ignore[attr-defined]
        self.published += done.samples  # type: ignore[attr-defined]
        self.debounced += done.debounced  # type: ignore[attr-defined]

    def tick(self, at_s: float) -> "Run":
        self.take(tick(self.config, self.state, T0 + round(at_s * 1000)))
        return self

    def of(self, signal: str) -> list[tuple[float, object]]:
        """Times and values of a signal, from the first event on; repetitions left out as report by exception does."""
        found: list[tuple[float, object]] = []
        for s in self.published:
            if s.signal == signal and (not found or found[-1][1] != s.value):
                found.append(((s.timestamp_ms - T0) / 1000, s.value))
        return found

    @property
    def changes(self) -> list[tuple[float, object]]:
        return self.of("tool_change_active")[1:]

    @property
    def evidence(self) -> str:
        return str(self.of("tool_change_evidence")[-1][1])


def test_a_change_spans_from_the_empty_number_to_the_number_that_stays() -> None:
    run = Run((10, "tool", ""), (10.45, "block", "M06"), (16, "block", "G21"), (17.1, "tool", 2), (20, "time", 0))
    assert run.changes == [(10, True), (17.1, False)]
    assert run.of("tool_number") == [(0, 1), (10, None), (17.1, 2)]
    assert run.evidence == "tool number empty + block commands a tool change + number stood 2 s"
    assert run.of("tool_change_source") == [(0, "controller")]


def test_flaps_after_the_change_do_not_show() -> None:
    run = Run((10, "tool", ""), (10.4, "block", "M06"), (17, "tool", 2), (17.4, "tool", ""), (18, "tool", 2))
    run.feed((18.4, "tool", ""), (19.2, "tool", 2), (19.3, "block", "M602"), (25, "time", 0))
    assert run.changes == [(10, True), (19.2, False)]
    assert run.of("tool_number") == [(0, 1), (10, None), (19.2, 2)]
    assert (run.debounced, run.state.held) == (4, 0)


def test_a_number_that_is_empty_for_a_moment_is_no_change() -> None:
    run = Run((10, "tool", ""), (10.7, "tool", 1), (20, "time", 0))
    assert run.changes == []
    assert run.of("tool_number") == [(0, 1)]
    assert (run.debounced, run.state.phase) == (2, Phase.SETTLED)


def test_a_number_that_is_empty_for_long_is_a_change_without_any_block() -> None:
    run = Run((10, "tool", ""), (10.5, "time", 0))
    assert (run.changes, run.state.held) == ([], 1)
    run.feed((11, "time", 0))
    assert run.changes == [(10, True)]
    assert run.evidence == "tool number empty"


def test_a_block_just_before_the_empty_number_is_the_same_change() -> None:
    run = Run((10.165, "block", "M06"), (10.072, "tool", ""), (16, "tool", 2), (19, "time", 0))
    assert run.changes == [(10.165, True), (16, False)]


def test_a_tool_that_is_changed_for_itself_counts() -> None:
    run = Run((10, "block", "T1 M6"), (13, "block", "G0 X2"), (14, "time", 0))
    assert run.changes == [(10, True)]
    run.feed((15, "time", 0))
    assert run.changes == [(10, True), (13, False)]
    assert run.evidence == "block commands a tool change + block passed, same number"


def test_a_number_that_just_steps_is_a_change_of_a_moment() -> None:
    run = Run((10, "tool", 2), (13, "time", 0))
    assert run.changes == [(10, True), (10.001, False)]
    assert run.of("tool_number") == [(0, 1), (10, 2)]


def test_a_walk_through_the_magazine_is_one_change() -> None:
    walk = [(10 + i * 1.2, "tool", 2 + i) for i in range(12)]
    run = Run(*walk, (40, "time", 0))
    assert run.changes == [(10, True), (23.2, False)]
    assert run.of("tool_number")[-1] == (23.2, 13)


def test_zero_is_no_tool_and_another_number_after_a_short_zero_is_a_change() -> None:
    run = Run((10, "tool", 0), (10.6, "tool", 7), (13, "time", 0))
    assert run.changes == [(10, True), (10.6, False)]
    assert run.of("tool_number") == [(0, 1), (10, None), (10.6, 7)]


def test_a_control_may_have_a_tool_zero() -> None:
    run = Run((10, "tool", 0), (13, "time", 0), config=ToolChangeSection(zero_is_no_tool=False))
    assert run.of("tool_number") == [(0, 1), (10, 0)]


def test_a_lost_connection_and_the_old_number_again_is_no_change() -> None:
    run = Run((10, "tool", "UNAVAILABLE"), (80, "tool", 1), (90, "time", 0))
    assert run.changes == [(10, None), (80, False)]
    assert run.of("tool_change_source") == [(0, "controller"), (10, "stale"), (80, "controller")]


def test_a_number_that_changed_while_the_connection_was_lost_is_told_but_not_dated() -> None:
    run = Run((10, "tool", "UNAVAILABLE"), (80, "tool", 2), (90, "time", 0))
    assert (80, True) not in run.changes
    assert run.of("tool_number")[-1] == (80, 2)


def test_a_name_that_is_no_number_is_a_tool_whose_number_is_null() -> None:
    run = Run((10, "tool", "DRILL_8"), (13, "time", 0), (20, "tool", "MILL_10"), (23, "time", 0))
    assert [value for _, value in run.changes] == [True, False, True, False]
    assert run.published[-4].reason == "not a number: 'MILL_10'"


def test_a_block_that_is_only_shown_is_no_change_until_it_runs() -> None:
    run = Run((5, "exec", "READY"), (6, "block", "M06"), (9, "time", 0))
    assert run.changes == []
    run.feed((10, "exec", "ACTIVE"))
    assert run.changes == [(10, True)]


def test_a_spindle_that_stays_empty_is_given_up_on() -> None:
    run = Run((10, "tool", ""), (10.2, "block", "T0 M6"), (15, "block", "M30"), (60, "time", 0), (70, "time", 0))
    assert run.changes == [(10, True), (70, False)]
    assert run.of("tool_number")[-1] == (10, None)
    assert run.feed((80, "tool", "")).changes == [(10, True), (70, False)]
    run.feed((100, "tool", 4), (103, "time", 0))  # a tool is put in
    assert run.changes[2:] == [(100, True), (100.001, False)]


def test_time_that_passes_without_samples_ends_a_change_too() -> None:
    run = Run((10, "tool", ""), (10.2, "block", "M6"), (16, "tool", 2)).tick(17.9)
    assert run.changes == [(10, True)]
    assert run.tick(18).changes == [(10, True), (16, False)]


def test_the_next_change_may_come_before_the_last_number_has_stood() -> None:
    run = Run((10, "tool", ""), (10.4, "block", "M06"), (16, "block", "G0"), (17, "tool", 2), (18, "block", "T3 M06"))
    run.feed((18.2, "tool", ""), (25, "tool", 3), (28, "time", 0))
    assert run.changes == [(10, True), (17, False), (18, True), (25, False)]


def test_a_clock_that_jumps_back_finishes_what_stood_and_takes_the_state_as_found() -> None:
    run = Run((10_000, "tool", ""), (10_000.4, "block", "M06"), (10_007, "tool", 2))
    run.feed((9_000, "tool", 9), (9_003, "time", 0))
    assert [value for _, value in run.changes] == [True, False]
    assert run.of("tool_number")[-1] == (9_000, 9)


def test_the_state_as_found_is_no_change() -> None:
    state, published = State(), list[EdgeSample]()
    for event in ((0, "block", "M06"), (5, "tool", 3)):
        done = step(CONFIG, state, sample(*event, is_baseline=True))
        state, published = done.state, published + list(done.samples)
    assert [s.value for s in published if s.signal == "tool_change_active"] == [False, False]


@pytest.mark.parametrize("order", [("tool", "block"), ("block", "tool")])
def test_an_edge_that_joins_in_the_middle_of_a_change_says_so(order: Iterable[str]) -> None:
    found = {"tool": (5, "tool", ""), "block": (5.4, "block", "M06")}
    run = Run()
    run.state, run.published = State(), []
    for kind in order:
        run.take(step(CONFIG, run.state, sample(*found[kind], is_baseline=True)))
    run.feed((12, "tool", 4), (15, "time", 0))
    assert [value for _, value in run.of("tool_change_active")][-2:] == [True, False]
    assert run.of("tool_number")[-1] == (12, 4)


def test_a_control_that_tells_nothing_is_said_to() -> None:
    active, source, _ = not_observable(T0)
    assert (active.value, active.reason) == (None, "the control offers neither tool number nor block text")
    assert source.value == "none"


def test_a_cue_begins_a_change_at_once_and_the_change_lasts_as_long_as_it() -> None:
    run = Run((10, "cue", False), (12, "cue", True), (12.2, "cue", True), (13, "tool", 2), (19, "cue", True))
    assert run.changes == [(12, True)]  # the number has stood for long, but the control is still at it
    run.feed((20, "tool", 2), (20, "cue", False), (30, "cue", False))
    assert run.changes == [(12, True), (20, False)]
    assert run.of("tool_number") == [(0, 1), (13, 2)]
    assert run.evidence == "M6 + cue ended"


def test_a_number_that_follows_the_cue_by_a_look_belongs_to_the_same_change() -> None:
    run = Run((10, "cue", True), (14, "cue", False), (14.2, "tool", 2), (20, "time", 0))
    assert run.changes == [(10, True), (14.2, False)]


def test_a_cue_and_the_same_number_is_a_change_too() -> None:
    run = Run((10, "cue", True), (14, "cue", False), (15.9, "time", 0))
    assert run.changes == [(10, True)]
    run.feed((16, "time", 0))
    assert run.changes == [(10, True), (14, False)]
    assert run.evidence == "M6 + cue ended, same number"


def test_a_cue_dates_a_change_that_an_empty_number_had_begun() -> None:
    run = Run((10, "tool", ""), (10.2, "cue", True), (13, "tool", 2), (13.2, "cue", False))
    assert run.changes == [(10, True), (13.2, False)]
    assert run.evidence == "tool number empty + M6 + cue ended"


def test_two_cues_close_together_are_two_changes() -> None:
    run = Run((10, "cue", True), (13, "cue", False), (14, "cue", True), (17, "tool", 2), (17, "cue", False))
    assert run.changes == [(10, True), (13, False), (14, True), (17, False)]


def test_a_block_that_commands_the_next_change_ends_one_whose_cue_is_over() -> None:
    run = Run(
        (9, "cue", False), (10, "cue", True), (13, "cue", False), (14, "block", "T3 M6"), (14.2, "cue", True), (17, "cue", False)
    )
    run.feed((20, "time", 0))
    assert run.changes == [(10, True), (13, False), (14, True), (17, False)]


def test_a_change_that_ended_in_a_hole_ends_where_the_hole_does() -> None:
    run = Run((10, "cue", True))
    run.take(step(CONFIG, run.state, sample(18, "cue", False, is_baseline=True)))
    assert (run.changes, run.evidence) == ([(10, True), (18, False)], "M6 + as found: no cue")


def test_a_cue_that_stays_is_given_up_on_and_begins_no_second_change() -> None:
    run = Run((10, "cue", True), *((at, "cue", True) for at in range(11, 100, 5)))
    assert run.changes == [(10, True), (70, False)]
    assert run.evidence == "M6 + given up: cue stayed for 60 s"


def test_a_cue_that_the_control_stops_giving_leaves_the_rest_to_the_number() -> None:
    run = Run((10, "cue", True), (11, "cue", None), (13, "tool", 2), (15, "time", 0))
    assert run.changes == [(10, True), (13, False)]


def test_an_edge_that_joins_while_the_control_works_on_m6_says_so() -> None:
    run = Run()
    for event in ((0.1, "tool", 1), (0.1, "cue", True)):
        run.take(step(CONFIG, run.state, sample(*event, is_baseline=True)))
    assert run.changes == [(0.1, True)]
    lone = Run()
    lone.state, lone.published = State(), []
    lone.take(step(CONFIG, lone.state, sample(0, "cue", False, is_baseline=True)))
    assert (lone.of("tool_change_active"), lone.evidence) == ([(0, False)], "as found: no cue")


def test_a_number_that_cannot_be_had_leaves_the_cue_alone() -> None:
    lost = [event for at in (10, 11, 12.5, 14) for event in ((at, "tool", "UNAVAILABLE"), (at, "cue", at == 11))]
    run = Run((9, "cue", False), *lost, (20, "tool", 2))
    assert run.changes == [(11, True), (12.5, False)]
    assert run.of("tool_number") == [(0, 1), (10, None), (20, 2)]


def test_a_number_that_cannot_be_had_for_long_is_said_once_and_the_block_still_tells() -> None:
    lost = [(at / 5, "tool", "UNAVAILABLE") for at in range(50, 100)]
    blocks = [(at / 5, "block", "T3 M6" if 60 <= at < 75 else "G0 X1") for at in range(50, 100)]
    run = Run(*(event for pair in zip(lost, blocks, strict=True) for event in pair))
    assert run.changes == [(10, None), (10, False), (12, True), (15, False)]


def test_a_block_that_is_shown_at_each_look_commands_one_change() -> None:
    run = Run((10, "block", "T2 M6"), (12, "tool", 2), *((at / 5, "block", "T2 M6") for at in range(61, 100)))
    assert run.changes == [(10, True), (12, False)]
    run.feed((20, "block", "G0 X1"), (30, "block", "T2 M6"), (31, "block", "G0 X1"), (40, "time", 0))
    assert run.changes[2:] == [(30, True), (31, False)]


@pytest.mark.parametrize(
    ("block", "expected"),
    [
        ("M06", True),
        ("M6", True),
        ("N10T7M6", True),
        ("t7 m006", True),
        ("TOOL CALL 5 Z S2000", True),
        ("M602", False),
        ("TS=12207 BT=0 M602", False),
        ("N000 G00 W=1200.0000 M696 M246 M63", False),
        ("M60", False),
        ("M6.1", False),
        ("G0 X1 (M06 FOLLOWS)", False),
        ("G0 X1 ; M06", False),
        ("VM6=1", False),
        ("TOOL CALL Z S2000", False),
        ("", False),
    ],
)
def test_m6_counts_as_a_word(block: str, expected: bool) -> None:
    assert is_tool_change_block(CONFIG, block) is expected


_tools = st.sampled_from(["", 0, 1, 2, "UNAVAILABLE", "DRILL"]).map(lambda v: ("tool", v))
_blocks = st.sampled_from(["", "M06", "M602", "G0 X1", "UNAVAILABLE"]).map(lambda v: ("block", v))
_states = st.sampled_from(["ACTIVE", "READY", "STOPPED", "UNAVAILABLE"]).map(lambda v: ("exec", v))
_cues = st.sampled_from([True, False, None]).map(lambda v: ("cue", v))
_events = st.tuples(
    st.floats(-20_000, 20_000) | st.floats(0, 3), st.one_of(_tools, _blocks, _states, _cues, st.just(("time", 0))), st.booleans()
)


@given(st.lists(_events, max_size=40), st.sampled_from([("time", 0), ("tool", 2), ("block", "M06"), ("cue", True)]))
def test_what_tells_nothing_changes_nothing(
    events: list[tuple[float, tuple[str, object], bool]], last: tuple[str, object]
) -> None:
    state, at_s = step(CONFIG, State(), sample(0.0, "time", 0)).state, 0.0
    for step_s, (kind, value), is_baseline in events:
        at_s += step_s
        state = step(CONFIG, state, sample(at_s, kind, value, is_baseline=is_baseline)).state
    assert state.clock_ms is not None
    one = sample((state.clock_ms - T0) / 1000, *last)
    assert tells_nothing(state, one) is (last[0] == "time" and state.phase is Phase.SETTLED)
    if tells_nothing(state, one):
        done = step(CONFIG, state, one)
        assert (done.state, done.samples, done.debounced) == (state, (), 0)


@given(st.lists(_events, max_size=40))
def test_whatever_comes_each_number_is_published_held_or_a_flap_and_no_change_ends_before_it_began(
    events: list[tuple[float, tuple[str, object], bool]],
) -> None:
    state, at_s, numbers, debounced, emitted, begun = State(), 0.0, 0, 0, 0, 0
    for step_s, (kind, value), is_baseline in events:
        at_s += step_s
        one = sample(at_s, kind, value, is_baseline=is_baseline)
        numbers += one.signal == "tool_number"
        done = step(CONFIG, state, one)
        assert done == step(CONFIG, state, one)
        state, debounced = done.state, debounced + done.debounced
        emitted += sum(s.observations for s in done.samples)
        for s in done.samples:
            assert s.value is not None or s.reason
            if s.signal == "tool_change_active" and s.value is True:
                begun = s.timestamp_ms
            if s.signal == "tool_change_active" and s.value is False and "stood" in str(done.samples[-1].value):
                assert s.timestamp_ms > begun
    assert numbers == emitted + debounced + state.held
