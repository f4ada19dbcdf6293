"""Tool life and the drift of weeks, folded over the cut records of a machine (`twin/cut_record`).

The wear of a tool is what its load has risen by over that of a sharp one, the material of the batch taken off, since that moves
all tools together (twin/wear/). It is published for the tool in the spindle, and as JSON for all of them; parts left only where
they are known (twin/wear/status.py). What all tools share and what stays over many batches is the drift of the machine, and a
case for the gap diagnosis (processors/tool_wear/drift.py). A broken insert is no wear: it is left to the score of
joint_anomaly.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

from processors.contract import Output, OutputSpec, Processor, Provenance, Sample
from processors.tool_wear.config import Config
from processors.tool_wear.drift import Drift, after_part, in_values, in_words, is_drifting
from sparkplug.datatype import DataType
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals
from twin.wear.cut import Cut, cut_of
from twin.wear.fast import FAST_LIVES
from twin.wear.machine import Wear, cut_added
from twin.wear.status import Status, status_of

RECORD, TOOL = twin_signals.CUT_RECORD, "tool_number"
WEAR, SLOPE = twin_signals.TOOL_WEAR_PCT, twin_signals.TOOL_WEAR_SLOPE_PCT
LEFT, LOW, HIGH = twin_signals.TOOL_PARTS_LEFT, twin_signals.TOOL_PARTS_LEFT_LOW, twin_signals.TOOL_PARTS_LEFT_HIGH
FAST, BASIS, LIVES = twin_signals.TOOL_WEARS_FAST, twin_signals.TOOL_WEAR_BASIS, twin_signals.TOOL_LIVES
DRIFT, DRIFT_BASIS, DRIFT_FINDINGS = (
    twin_signals.MACHINE_DRIFT,
    twin_signals.MACHINE_DRIFT_BASIS,
    twin_signals.MACHINE_DRIFT_FINDINGS,
)
OF_THE_TOOL = (WEAR, SLOPE, LEFT, LOW, HIGH, BASIS)
NO_PART = "no part has ended yet"
SHOWN_MAX = 40
"""Tools that `twin/tool_lives` shows, those used last."""
BACK_S_MAX = 86_400.0
"""A record that ended longer before the newest one is of a clock that was set back; a younger one was heard before."""


@dataclass(frozen=True, slots=True)
class State:
    """The tools of a machine and its drift.

    shown: what is known of each tool by number, as of the last part; heard: the record that was folded last; newest_s: its end;
    no_record: why there is none
    """

    wear: Wear = field(default_factory=Wear)
    shown: Mapping[str, Status] = field(default_factory=dict)
    drift: Drift = field(default_factory=Drift)
    heard: str = ""
    newest_s: float = 0.0
    no_record: str = f"{RECORD} is not offered"
    tool: str | None = None
    no_tool: str = f"{TOOL} is not offered"


def step(config: Config, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Fold the record, if it is a new one, and say what is known of the tool in the spindle."""
    if sample.is_history:
        return state, ()
    tool, no_tool = _tool(sample)
    text, no_record = _record(sample)
    if tool == state.tool and no_tool == state.no_tool and no_record == state.no_record and text in {None, state.heard}:
        return state, () if state.shown else _nothing(state.no_record or NO_PART)
    state = replace(state, tool=tool, no_tool=no_tool, no_record=no_record)
    if text is not None and text != state.heard:
        state = replace(state, heard=text)
        cut = cut_of(text)
        if isinstance(cut, str):
            state = replace(state, no_record=cut)
        elif not state.newest_s or cut.ended_s > state.newest_s or cut.ended_s < state.newest_s - BACK_S_MAX:
            state = _with_cut(config, state, cut)
    return state, _all(config, state, sample.machine)


def _with_cut(config: Config, state: State, cut: Cut) -> State:
    wear, is_judged = cut_added(state.wear, cut, config.terms)
    if not is_judged:
        return replace(state, wear=wear, newest_s=cut.ended_s)
    used = {str(one.tool) for one in state.wear.cuts} & wear.tools.keys()
    shown = {**state.shown, **{name: status_of(name, wear.tools[name], wear, config.terms) for name in used}}
    for name in sorted(shown, key=lambda one: wear.tools[one].seen_s if one in wear.tools else 0.0)[
        : max(len(shown) - SHOWN_MAX, 0)
    ]:
        del shown[name]
    return replace(state, wear=wear, shown=shown, drift=after_part(config, state.drift, wear), newest_s=cut.ended_s)


def _tool(sample: Sample) -> tuple[str | None, str]:
    number, reason = sample.number(TOOL)
    if number is None:
        return None, reason or ""
    return (str(int(number)), "") if number == int(number) and abs(number) < 1e9 else (None, f"{TOOL} is {number:g}")


def _record(sample: Sample) -> tuple[str | None, str]:
    """Return the record that stands; a null one says nothing new, and its reason counts only before the first."""
    reading = sample.row.get(RECORD)
    if reading is None:
        return None, f"{RECORD} is not offered"
    if isinstance(reading.value, str) and reading.quality is Quality.GOOD:
        return reading.value, ""
    return None, reading.reason or f"{RECORD} tells nothing yet"


@lru_cache(maxsize=1000)
def _nothing(reason: str) -> tuple[Output, ...]:
    return tuple(Output.null(name, reason) for name in (*OF_THE_TOOL, FAST, LIVES, DRIFT, DRIFT_BASIS, DRIFT_FINDINGS))


def _all(config: Config, state: State, machine: str) -> tuple[Output, ...]:
    """Return everything there is to say; what has not changed is not published again."""
    shown = state.shown
    if not shown:
        return _nothing(state.no_record or NO_PART)
    drifts, not_drifts = is_drifting(config, state.drift)
    return (
        *_of_the_tool(state, shown),
        _fast(shown),
        Output(LIVES, json.dumps([one.document() for one in sorted(shown.values(), key=lambda one: one.tool)])),
        Output.null(DRIFT, not_drifts) if drifts is None else Output(DRIFT, drifts),
        Output.null(DRIFT_BASIS, not_drifts) if drifts is None else Output(DRIFT_BASIS, in_words(config, state.drift, machine)),
        Output.null(DRIFT_FINDINGS, not_drifts) if drifts is None else Output(DRIFT_FINDINGS, in_values(state.drift)),
    )


def _of_the_tool(state: State, shown: Mapping[str, Status]) -> tuple[Output, ...]:
    if state.tool is None:
        return tuple(Output.null(name, state.no_tool) for name in OF_THE_TOOL)
    one = shown.get(state.tool)
    if one is None:
        return tuple(Output.null(name, f"no cut of tool {state.tool} has been recorded lately") for name in OF_THE_TOOL)
    left = one.left
    return (
        _number(WEAR, one.level_pct, one.why_no_level),
        _number(SLOPE, one.slope_pct, one.why_no_slope),
        _number(LEFT, None if left is None else left.middle, one.why_not_left),
        _number(LOW, None if left is None else left.low, one.why_not_left),
        _number(HIGH, None if left is None else left.high, one.why_not_left),
        Output(BASIS, one.basis),
    )


def _fast(shown: Mapping[str, Status]) -> Output:
    """Return whether a tool of the machine wears too fast: an alarm goes on while another tool is in the spindle."""
    if any(one.is_fast for one in shown.values()):
        return Output(FAST, True)
    if all(one.is_fast is None for one in shown.values()):
        return Output.null(FAST, f"not known yet: no tool has {FAST_LIVES} lives to compare with")
    return Output(FAST, False)


def _number(name: str, value: float | None, reason: str) -> Output:
    return Output.null(name, reason) if value is None else Output(name, value)


_DOUBLE, _STRING, _INFERRED = DataType.DOUBLE, DataType.STRING, Provenance.INFERRED
_HERE = "of the tool in the spindle"
PROCESSOR = Processor(
    name="tool_wear",
    version=1,
    inputs=frozenset({RECORD, TOOL}),
    outputs=(
        OutputSpec(WEAR, _DOUBLE, "%", f"cutting load over that of a sharp tool, {_HERE}", _INFERRED, 0.1),
        OutputSpec(SLOPE, _DOUBLE, "%", f"growth of that load in a part, {_HERE}", _INFERRED, 0.001),
        OutputSpec(LEFT, _DOUBLE, None, f"parts until the tool is spent, median, {_HERE}", _INFERRED),
        OutputSpec(LOW, _DOUBLE, None, f"parts left, lower end of the band of 90 %, {_HERE}", _INFERRED),
        OutputSpec(HIGH, _DOUBLE, None, f"parts left, upper end of the band of 90 %, {_HERE}", _INFERRED),
        OutputSpec(
            FAST, DataType.BOOLEAN, None, "whether a tool wears far faster than in its earlier lives", _INFERRED, is_alarm=True
        ),
        OutputSpec(BASIS, _STRING, None, f"what the wear rests on, {_HERE}", _INFERRED),
        OutputSpec(LIVES, _STRING, None, "JSON: wear, slope and parts left of each tool, with bands", _INFERRED),
        OutputSpec(
            DRIFT, DataType.BOOLEAN, None, "whether the load of all tools and programs has moved", _INFERRED, is_alarm=True
        ),
        OutputSpec(DRIFT_BASIS, _STRING, None, "since when, by how much, and the command that names the cause", _INFERRED),
        OutputSpec(DRIFT_FINDINGS, _STRING, None, "JSON while it drifts: since when, and by how many per cent", _INFERRED),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
    wakes=frozenset({RECORD, TOOL}),
)
