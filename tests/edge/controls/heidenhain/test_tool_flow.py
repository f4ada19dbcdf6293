"""Which tool can be in the spindle at a block: checked by hand, and against programs that are really run."""

import random
from dataclasses import dataclass, field

from hypothesis import given, settings
from hypothesis import strategies as st

from edge.controls.heidenhain.klartext import Kind, read_program
from edge.controls.heidenhain.tool_flow import BEFORE, PROGRAM_CALLED, flow_of, speed_of, tool_of
from tests.edge.controls.heidenhain.test_klartext import program_of


def tools(*blocks: str) -> list[set[object]]:
    """Return what reaches each of these blocks."""
    flow = flow_of(program_of(*blocks), tool_of)
    assert not flow.fault
    return [set(flow.at(number)) for number in range(1, len(blocks) + 1)]


def test_a_tool_call_counts_from_the_next_block_on() -> None:
    assert tools("L X+1", "TOOL CALL 5 Z S100", "L X+2") == [{BEFORE}, {BEFORE}, {5}]


def test_a_call_brings_back_the_tool_of_its_caller_whatever_other_callers_have() -> None:
    found = tools(
        "TOOL CALL 1 Z", "CALL LBL 3", "L X+1", "TOOL CALL 2 Z", "CALL LBL 3", "L X+2", "M30", "LBL 3", "L Z-1", "LBL 0"
    )
    assert (found[2], found[5], found[8]) == ({1}, {2}, {1, 2})


def test_a_label_that_changes_the_tool_brings_its_own() -> None:
    found = tools("TOOL CALL 1 Z", "CALL LBL 3", "L X+1", "M30", "LBL 3", "TOOL CALL 7 Z", "LBL 0")
    assert (found[2], found[5]) == ({7}, {1})


def test_calls_within_calls() -> None:
    found = tools(
        *("TOOL CALL 1 Z", "CALL LBL 1", "L X+1", "M30"), *("LBL 1", "CALL LBL 2", "L X+2", "LBL 0"), *("LBL 2", "L Z-1", "LBL 0")
    )
    assert (found[2], found[6], found[9]) == ({1}, {1}, {1})


def test_repeats_and_jumps_go_both_ways() -> None:
    assert tools("TOOL CALL 1 Z", "LBL 1", "L X+1", "TOOL CALL 2 Z", "CALL LBL 1 REP 3", "L X+2")[2:] == [
        {1, 2},
        {1, 2},
        {2},
        {2},
    ]
    jump = "FN 9: IF +Q1 EQU +Q2 GOTO LBL 1"
    assert tools("TOOL CALL 1 Z", jump, "TOOL CALL 2 Z", "LBL 1", "L X+2")[3:] == [{1, 2}, {1, 2}]


def test_what_is_not_a_number_stands_for_itself() -> None:
    assert tools('TOOL CALL "MILL" Z', "L X+1")[1] == {'tool "MILL", which is called by its name'}
    assert tools("TOOL CALL Q5 Z", "L X+1")[1] == {"the tool of Q5, which block 1 calls"}
    assert tools("TOOL CALL 1 Z", "CALL PGM TNC:\\SUB.H", "L X+1")[2] == {1, PROGRAM_CALLED}
    assert tools("TOOL CALL 5.2 Z", "TOOL CALL Z S500", "L X+1")[1:] == [{5}, {5}]


def test_a_block_that_may_be_skipped_is_done_and_not_done() -> None:
    text = "0 BEGIN PGM P MM\n1 TOOL CALL 1 Z\n/2 TOOL CALL 2 Z\n3 L X+1\n4 END PGM P MM\n"
    assert set(flow_of(text, tool_of).at(3)) == {1, 2}


def test_a_label_that_is_not_there_or_comes_out_of_a_parameter_is_a_fault() -> None:
    for block in ("CALL LBL 9", "CALL LBL Q5", "FN 9: IF +Q1 EQU +Q2 GOTO LBL QS3"):
        flow = flow_of(program_of("TOOL CALL 1 Z", block, "L X+1"), tool_of)
        assert "cannot be found" in flow.fault
        assert flow.at(3) == {flow.fault}


def test_what_no_way_leads_to_has_nothing_and_a_label_that_calls_itself_ends() -> None:
    assert tools("TOOL CALL 1 Z", "M30", "L X+1")[2] == set()
    assert tools("TOOL CALL 1 Z", "CALL LBL 1", "M30", "LBL 1", "CALL LBL 1", "LBL 0")[1] == {1}


def test_the_speed_goes_the_same_way() -> None:
    flow = flow_of(program_of("TOOL CALL 1 Z S100", "TOOL CALL Z S200", "TOOL CALL 3", "L X+1"), speed_of)
    assert [set(flow.at(number)) for number in (2, 3, 4)] == [{100.0}, {200.0}, {200.0}]


@dataclass
class Runner:
    """Runs the steps of a program as a control would, with a die in place of conditions; keeps what was seen before each."""

    text: str
    chance: random.Random
    seen: list[tuple[int, object]] = field(default_factory=list)

    def run(self, steps_max: int = 300) -> None:
        steps = read_program(self.text).steps
        labels = {step.word: index for index, step in reversed(list(enumerate(steps))) if step.kind is Kind.LABEL}
        tool: object = BEFORE
        at, stack = 0, list[int]()
        for _ in range(steps_max):
            step = steps[at]
            self.seen.append((step.number, tool))
            at += 1
            if step.kind is Kind.TOOL_CALL:
                tool = tool_of(step) or tool
            elif step.kind is Kind.CALL:
                if len(stack) >= 19:  # the control stops with an error
                    return
                stack.append(at)
                at = labels[step.word]
            elif step.kind in (Kind.JUMP, Kind.REPEAT) and self.chance.random() < 0.5:
                at = labels[step.word]
            elif step.kind is Kind.LABEL and step.word == "0" and stack:
                at = stack.pop()
            elif step.kind is Kind.END:
                return


_BLOCKS = ["TOOL CALL 1 Z", "TOOL CALL 2 Z", "TOOL CALL 3 Z", "L X+1", "CALL LBL 1", "CALL LBL 2", "LBL 0", "LBL 0", "M30"]
_BLOCKS += ["FN 9: IF +Q1 EQU +Q2 GOTO LBL 1", "CALL LBL 2 REP 2"]


@settings(max_examples=100)
@given(st.lists(st.sampled_from(_BLOCKS), max_size=14), st.integers(0, 10), st.integers(0, 14), st.integers(0, 2**32))
def test_whatever_a_run_of_the_program_has_in_the_spindle_was_foreseen(blocks: list[str], one: int, two: int, seed: int) -> None:
    blocks.insert(min(one, len(blocks)), "LBL 1")
    blocks.insert(min(two, len(blocks)), "LBL 2")
    text = program_of(*blocks)
    flow, runner = flow_of(text, tool_of), Runner(text, random.Random(seed))
    runner.run()
    for number, tool in runner.seen:
        assert tool in flow.at(number), (number, text)
