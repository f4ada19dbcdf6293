"""Tool wear on the stream: what it says before it knows, what it says then, and what it does not count twice."""

import json
from typing import Any

from processors.contract import Output, Sample, SampleKind
from processors.tool_wear.config import Config
from processors.tool_wear.processor import (
    BACK_S_MAX,
    BASIS,
    DRIFT,
    FAST,
    HIGH,
    LEFT,
    LIVES,
    LOW,
    PROCESSOR,
    RECORD,
    TOOL,
    WEAR,
    State,
    step,
)
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from tests.twin.wear.made_parts import Made, made
from twin.wear.cut import Cut

CONFIG = Config()


def sample(record: str | None, tool: Any = 1, kind: SampleKind = SampleKind.DATA, reason: str | None = None) -> Sample:
    quality = Quality.GOOD if record is not None else Quality.BAD
    row = {
        RECORD: Reading(RECORD, record, 0, quality, None, reason, False),
        TOOL: Reading(TOOL, tool, 0, Quality.GOOD, None, None, False),
    }
    return Sample("vmc", kind, 0.0, row, (RECORD,))


def text(cut: Cut) -> str:
    return json.dumps({"version": 1, **cut._asdict()})


def folded(parts: int, tool: int = 1) -> tuple[State, dict[str, Output]]:
    state, said = State(), {}
    for cuts, _ in made(Made(parts)):
        for cut in cuts:
            state, outputs = step(CONFIG, state, sample(text(cut), tool))
            said |= {one.name: one for one in outputs}
    return state, said


def test_before_a_part_has_ended_each_output_is_null_with_a_reason() -> None:
    state, outputs = step(CONFIG, State(), sample(None, kind=SampleKind.TICK, reason="no operation has ended yet"))
    assert state.wear.parts == 0
    assert {one.name for one in outputs} == {spec.name for spec in PROCESSOR.outputs}
    assert {(one.value, one.reason) for one in outputs} == {(None, "no operation has ended yet")}


def test_a_tool_with_lives_has_all_figures_and_one_without_a_reason() -> None:
    state, said = folded(420)
    values = {name: one.value for name, one in said.items()}
    assert values[LOW] <= values[LEFT] <= values[HIGH]  # type: ignore[operator]
    assert values[FAST] is False
    assert [row["tool"] for row in json.loads(str(values[LIVES]))] == [1, 2, 3]
    assert said[DRIFT].reason and "being learned" in said[DRIFT].reason
    _, outputs = step(CONFIG, state, sample(state.heard, tool=9))
    other = {one.name: one for one in outputs}
    assert other[WEAR].value is None
    assert other[WEAR].reason == "no cut of tool 9 has been recorded lately"
    assert other[LIVES].value == values[LIVES]


def test_a_record_that_is_heard_again_after_a_restart_counts_once() -> None:
    state, _ = folded(3)
    cuts = [cut for part, _ in made(Made(3)) for cut in part]
    again, _ = step(CONFIG, state, sample(text(cuts[-2])))
    assert again.wear == state.wear
    set_back, _ = step(CONFIG, state, sample(text(cuts[0]._replace(part=77, ended_s=cuts[-1].ended_s - 2.0 * BACK_S_MAX))))
    assert set_back.wear != state.wear


def test_a_record_that_is_none_says_why_and_changes_no_figure() -> None:
    state, said = folded(3)
    after, _ = step(CONFIG, state, sample('{"version":7}'))
    assert after.wear == state.wear
    assert after.no_record == "cut record has version 7, and 1 is read"
    assert said[BASIS].value is not None


def test_history_is_not_folded() -> None:
    assert step(CONFIG, State(), sample("{}")._replace(is_history=True)) == (State(), ())


def test_alarms_are_declared() -> None:
    assert {spec.name for spec in PROCESSOR.outputs if spec.is_alarm} == {FAST, DRIFT}
