"""The parser: the tool number from the program's text, from the control and from the PLC, and what is said where nobody knows."""

from typing import Any

from edge.config import EdgeConfig, SignalSection
from edge.controls.heidenhain.config import Config, HeidenhainConfig
from edge.controls.heidenhain.cursor import Cursor, parse, start
from edge.running.pipeline import Pipeline
from edge.sample import UNAVAILABLE, EdgeSample, SampleSet
from edge.sweep import Fact, Hole, Plain, Sweep
from tests.edge.controls.heidenhain.test_klartext import program_of

PATH = "TNC:\\PLATE.H"
PLATE = program_of(
    *("; PLATE", "TOOL CALL 1 Z S8500", "L X+10", "CALL LBL 3", "TOOL CALL 2 Z S4000", "CALL LBL 3", "L X+20", "M30"),
    *("LBL 3", "L Z-5", "LBL 0"),
)
IN_LABEL, READY, RUNNING, INTERRUPTED, CANCELLED = 10, 7, 0, 4, 3


class Player:
    """Looks at a control, one after the other, through the parser and the pipeline."""

    def __init__(self, text: str = PLATE, **source: Any) -> None:
        self.config: Config = EdgeConfig(source=HeidenhainConfig(**source))
        self.cursor: Cursor = start(self.config)
        self.pipeline = Pipeline(self.config)
        self.text, self.number, self.t_ms = text, 0, 1_000_000
        self.published: list[EdgeSample] = []

    def look(self, line: int, state: int = RUNNING, *, hole: bool = False, path: str = PATH, **facts: Plain) -> SampleSet:
        told = [Fact("program_state", state), Fact("program", path), Fact("current_program", path), Fact("line", line)]
        told += [Fact(key.replace("__", ":"), value) for key, value in facts.items()]
        if self.number == 0:
            told.append(Fact(f"text:{PATH}", self.text))
        holes = (Hole("no answer", self.t_ms, self.t_ms + 5000, 100),) if hole else ()
        self.t_ms += 5000 if hole else 500
        return self.take(Sweep("life", self.number, self.t_ms, tuple(told), holes, 500))

    def take(self, sweep: Sweep) -> SampleSet:
        self.number += 1
        self.cursor, given = parse(self.config, self.cursor, sweep.encode())
        assert given.accounted()
        self.published += [sample for row in self.pipeline.take(given, self.t_ms / 1000).rows for sample in row]
        return given

    def values(self, name: str) -> list[object]:
        """Return what was published of a signal."""
        return [sample.value for sample in self.published if sample.signal == name]


def value(given: SampleSet, name: str) -> EdgeSample:
    (found,) = [sample for sample in given.samples if sample.signal == name]
    return found


def test_the_tool_is_that_of_the_last_tool_call_and_the_change_lasts_as_long_as_its_block() -> None:
    player = Player()
    for line in (1, 2, 2, 2, 2, 2, 2, 3, 4):
        player.look(line)
    assert player.values("tool_change_active") == [False, True, False]
    assert player.values("tool_number") == [None, 1]
    why = "block commands a tool change + TOOL CALL in block 2 of the program text + cue ended"
    assert player.values("tool_change_evidence")[-1] == why


def test_in_a_label_of_several_callers_it_is_the_tool_that_was_seen_last() -> None:
    player = Player()
    for line in (1, 2, 2, 3, 4, IN_LABEL, 5, 5, 6):
        player.look(line)
    assert value(player.look(IN_LABEL), "tool_number").value == 2


def test_who_joins_in_such_a_label_or_has_looked_away_does_not_know_and_says_why() -> None:
    player = Player()
    joined = value(player.look(IN_LABEL), "tool_number")
    assert (joined.value, joined.reason) == (None, "it may be 1 or 2")
    assert value(player.look(7), "tool_number").value == 2
    assert value(player.look(IN_LABEL, hole=True), "tool_number").reason == "it may be 1 or 2"
    player.look(7)
    assert set(player.values("tool_change_active")) == {False}, "that it is known again is no tool change"


def test_after_the_program_the_tool_stays_where_it_was() -> None:
    player = Player()
    for line in (1, 2, 2, 3, 5, 5, 7):
        player.look(line)
    assert value(player.look(8, READY), "tool_number").value == 2
    assert value(player.look(1, READY), "tool_number").value == 2


def test_a_program_that_is_started_behind_its_tool_call_is_believed_from_the_next_one_on() -> None:
    player = Player()
    for line, state in ((1, RUNNING), (2, RUNNING), (2, RUNNING), (3, RUNNING), (1, CANCELLED)):
        player.look(line, state)
    started = value(player.look(7), "tool_number")
    assert started.reason == "the program was started after its TOOL CALL, in block 7"
    assert value(player.look(8), "tool_number").value is None
    player.look(5)
    player.look(5)
    assert value(player.look(6), "tool_number").value == 2
    assert player.values("tool_number") == [None, 1, None, 2]


def test_a_stop_is_no_start_and_a_paused_tool_call_goes_on() -> None:
    player = Player()
    for line, state in ((1, 0), (2, 0), (2, INTERRUPTED), (2, 0), (3, 0), (3, INTERRUPTED), (3, 0)):
        given = player.look(line, state)
    assert value(given, "tool_number").value == 1
    assert player.values("tool_change_active") == [False, True, False]


def test_a_program_that_is_ended_in_a_tool_call_leaves_nobody_knowing_the_tool() -> None:
    player = Player()
    for line, state in ((1, 0), (2, 0), (2, 0), (3, 0), (5, 0), (5, 0), (5, CANCELLED), (5, CANCELLED)):
        given = player.look(line, state)
    assert value(given, "tool_number").reason == "the program was ended in the TOOL CALL of block 5"
    for line, state in ((1, READY), (1, 0), (2, 0), (3, 0)):
        given = player.look(line, state)
    assert value(given, "tool_number").value == 1


def test_a_program_with_structured_jumps_has_blocks_and_changes_but_no_tool() -> None:
    player = Player(program_of("IF +Q1 EQU +Q2 THEN", "TOOL CALL 5 Z", "END IF", "L X+1"))
    for line in (1, 2, 2, 3, 4, 4, 4, 4, 4, 4):
        given = player.look(line)
    assert value(given, "tool_number").reason == "block 1 is a structured jump, which is not followed"
    assert value(given, "nc_block").value == "L X+1"
    assert player.values("tool_change_active") == [False, True, False]


def test_a_tool_that_is_called_by_its_name_or_a_parameter_is_a_change_to_a_tool_without_a_number() -> None:
    for word, reason in (('"MILL"', 'tool "MILL", which is called by its name'), ("Q5", "the tool of Q5, which block 2 calls")):
        player = Player(PLATE.replace("TOOL CALL 1 Z", f"TOOL CALL {word} Z"))
        for line in (1, 2, 2, 3):
            given = player.look(line)
        assert (value(given, "tool_number").value, value(given, "tool_number").reason) == (None, reason)
        assert player.values("tool_change_active") == [False, True, False]


def test_the_speed_of_the_tool_call_is_commanded_and_no_more() -> None:
    player = Player()
    for line in (1, 2, 3):
        given = player.look(line)
    assert value(given, "spindle_rpm_cmd").value == 8500.0
    assert (value(player.look(4), "nc_block").value, player.values("spindle_rpm")) == ("CALL LBL 3", [None])


def test_a_text_that_is_not_whole_or_of_another_kind_gives_neither_block_nor_tool() -> None:
    torn = value(Player(PLATE[:40]).look(1), "nc_block")
    assert (torn.value, bool(torn.reason)) == (None, True)
    player = Player()
    player.look(1)
    iso = player.look(1, path="TNC:\\PLATE.I")
    assert value(iso, "nc_block").reason == "TNC:\\PLATE.I is no Klartext program (.H)"
    assert value(iso, "tool_number").reason == UNAVAILABLE
    assert player.values("tool_change_active") == [False, None]
    assert value(player.look(99), "nc_block").reason == "TNC:\\PLATE.H has no block 99"


def test_a_refused_tool_number_is_unavailable_and_no_change() -> None:
    player = Player(tool_number_from="control")
    player.look(1, tool=5)
    player.take(Sweep("life", 1, player.t_ms + 500, (Fact("tool", None, "LSV2_BUSY 90"), Fact("line", 1)), (), 500))
    player.look(1, tool=5)
    assert player.values("tool_number") == [5, None, 5]
    assert player.values("tool_change_active") == [False, None, False]


def test_a_plc_bit_says_best_when_a_change_is_in_progress() -> None:
    player = Player(plc={"tool_number": "W1000", "tool_change": "M4000"}, program_text=False)
    for bit, tool in ((False, 5), (True, 5), (True, 0), (True, 7), (False, 7)):
        given = player.look(1, plc__tool_change=bit, plc__tool_number=tool)
        assert given.dropped.get("evidence") == 1
    assert player.values("tool_change_active") == [False, True, False]
    assert player.values("tool_number")[-1] == 7
    assert "PLC M4000" in str(player.values("tool_change_evidence")[-1])


def test_plc_values_go_through_scale_and_limits_and_come_before_what_the_control_tells() -> None:
    player = Player(plc={"spindle_load_pct": "W1008", "feed_override_pct": "W2"})
    player.config = EdgeConfig(source=player.config.source, signals={"spindle_load_pct": SignalSection(scale=0.1)})
    given = player.look(1, plc__spindle_load_pct=413, plc__feed_override_pct=80, feed_override=100.0)
    assert (value(given, "spindle_load_pct").value, value(given, "feed_override_pct").value) == (41.3, 80.0)
    assert value(player.look(1, plc__spindle_load_pct=9500), "spindle_load_pct").reason == "outside 0 to 200 %: 950"


def test_what_nobody_tells_is_declared_once_as_null_with_the_reason() -> None:
    player = Player()
    first, second = player.look(1), player.look(1)
    assert value(first, "spindle_rpm").reason == "no telegram of LSV2 tells it; name its PLC address in [heidenhain.plc]"
    assert {offer.signal for offer in first.offers or ()} >= {"spindle_rpm", "feed_mm_min", "tool_number", "nc_block"}
    assert second.offers is None
    assert "spindle_rpm" not in {sample.signal for sample in second.samples}


def test_a_look_without_the_axes_does_not_take_them_out_of_the_birth() -> None:
    player = Player()
    player.look(1, axis__X=1.5, axis__C=90.0)
    lost = player.take(Sweep("life", 1, player.t_ms + 500, (Fact("axes", None, "answers nothing"),), (), 500))
    assert (value(lost, "axis_x_pos_mm").value, value(lost, "axis_x_pos_mm").reason) == (None, "answers nothing")
    assert value(lost, "axis_c_pos_deg").value is None
    assert lost.offers is None


def test_words_of_the_control() -> None:
    player = Player()
    words = [value(player.look(1, state), "exec_state").value for state in range(9)]
    assert words == ["ACTIVE", "INTERRUPTED", "PROGRAM_COMPLETED", "STOPPED", "INTERRUPTED", "STOPPED", "STOPPED", "READY", None]
    modes = [value(player.look(1, execution_mode=mode), "controller_mode").value for mode in range(6)]
    assert modes == ["MANUAL", "MANUAL_DATA_INPUT", "MANUAL", "SEMI_AUTOMATIC", "AUTOMATIC", None]


def test_a_signal_that_is_not_wanted_is_not_published() -> None:
    player = Player()
    player.config = EdgeConfig(source=player.config.source, signals={"nc_line": SignalSection(publish=False)})
    given = player.look(1)
    assert "nc_line" not in {sample.signal for sample in given.samples} | {offer.signal for offer in given.offers or ()}
