"""`tool_change_active` and `tool_number` from what a control shows: a debounced state machine, a pure fold in event time.

    SETTLED ──number empty──► DOUBT ──empty for blank_s, or M06, or another number──► CHANGING
       ▲  ▲                     │                                                        │
       │  └──same number back───┘      ┌────────────M06, or another number───────────────┘ (from SETTLED, at once)
       └───────────────number stood for debounce_s, or the M06 block passed──────────────┘

What the recordings show, and what follows from it:

* A change begins when the number goes empty; `M06` appears in the block text 0.09 to 0.50 s later, once 0.09 s before. So an
  empty number is in doubt until there is more evidence, and the change is then stamped with the time at which it went empty.
* After the change the number flickers (number, empty, number, up to three times in 1.8 s). So the change is over when the number
  has stood for `debounce_s`, and its end is stamped with the beginning of that time.
* Once the number is empty for 0.7 s, comes back the same, and there is no M06: no change.
* `M602` to `M697` are other functions: M06 counts as a word. A block that is only shown (READY, STOPPED, …) changes nothing.
* A Hurco shows 0 while it changes, a Mazak just steps to the next number, and sends the old number again after each loss of
  connection.
* The state as found on (re)joining, and what comes with a jump of the clock (a recording has sections that are hours apart, in
  any order), is where we are, not something that happened.

* An adapter that can see the change itself (a FANUC works on M6, a PLC has a bit for it) says so with the signal
  `tool_change_cue`: it begins a change at once, and the change lasts as long as the cue does. It is evidence, never published.

What a control does not tell cannot be known: a change that is not in the number, the block or a cue is not seen here.
"""

import re
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from typing import Any

from edge.config import ToolChangeSection
from edge.sample import EMPTY, UNAVAILABLE, EdgeSample
from sparkplug.quality import Quality

CLOCK_BACK_MS_MAX = 10_000
CLOCK_AHEAD_MS_MAX = 300_000
REJOIN_MS = 1_000
CUE = "tool_change_cue"
COMMANDED = "block commands a tool change"
_IDLE_STATES = frozenset({"READY", "STOPPED", "PROGRAM_COMPLETED", "PROGRAM_STOPPED"})
_COMMENT = re.compile(r"\([^)]*\)?|;.*")
_pattern = lru_cache(maxsize=64)(re.compile)


class Phase(Enum):
    """The phase of the machine."""

    SETTLED = "settled"
    DOUBT = "doubt"
    CHANGING = "changing"


@dataclass(frozen=True, slots=True)
class State:
    """`tool` is what is published ("" = none in the spindle, None = not known yet), `candidate` a number that has to stand.

    `passed_ms`: since when the block, or the cue, that commanded the change is over; `cue` is None where the control gives none.
    """

    phase: Phase = Phase.SETTLED
    clock_ms: int | None = None
    rejoined_ms: int | None = None
    tool: str | None = None
    is_announced: bool = False
    is_lost: bool = False  # the number is unavailable, and that was said
    onset_ms: int = 0
    blank_since_ms: int | None = None
    blank: EdgeSample | None = None
    candidate: EdgeSample | None = None
    number_moved: bool = False
    block: str | None = None
    shows_change: bool = False
    cue: bool | None = None
    passed_ms: int | None = None
    is_idle: bool = False
    evidence: tuple[str, ...] = ()

    @property
    def held(self) -> int:
        """Observations that wait for the outcome."""
        return sum(sample.observations for sample in (self.blank, self.candidate) if sample is not None)

    def changed(self, **changes: Any) -> "State":
        """As `dataclasses.replace`, which takes three times as long; each frame of a control tells the time."""
        return State(**({name: getattr(self, name) for name in self.__slots__} | changes))


@dataclass(frozen=True, slots=True)
class Step:
    """The state after, what is published, and how many observations turned out to be flaps."""

    state: State
    samples: tuple[EdgeSample, ...] = ()
    debounced: int = 0

    def then(self, after: "Step") -> "Step":
        """This step and the one after it as one."""
        return Step(after.state, self.samples + after.samples, self.debounced + after.debounced)


def step(config: ToolChangeSection, state: State, sample: EdgeSample) -> Step:
    """One sample of any signal. Those of `tool_number` are taken in; all others only tell the time and the evidence."""
    done = _advance(config, state, sample)
    if sample.signal == "tool_number":
        return done.then(_number(config, done.state, sample))
    if sample.signal == "nc_block":
        return done.then(_block(config, done.state, sample))
    if sample.signal == "exec_state":
        return done.then(_execution(done.state, sample))
    if sample.signal == CUE:
        return done.then(_cue(done.state, sample))
    return done


def tick(config: ToolChangeSection, state: State, now_ms: int) -> Step:
    """Time has passed in the machine's own clock: what had to stand for a while may have stood long enough."""
    if now_ms != state.clock_ms:  # all samples of one look have one time
        state = state.changed(clock_ms=now_ms)
    if state.phase is Phase.DOUBT and now_ms - state.onset_ms >= config.blank_s * 1000:
        return _enter(state, state.onset_ms, "tool number empty")
    if state.phase is not Phase.CHANGING:
        return Step(state)
    debounce_ms, change_ms_max = config.debounce_s * 1000, config.change_s_max * 1000
    if state.cue:
        given_up = now_ms - state.onset_ms >= change_ms_max
        return _leave(state, round(state.onset_ms + change_ms_max), _given_up(config, "cue stayed")) if given_up else Step(state)
    if state.candidate is not None:
        since_ms = state.candidate.timestamp_ms
        return (
            _leave(state, since_ms, f"number stood {config.debounce_s:g} s") if now_ms - since_ms >= debounce_ms else Step(state)
        )
    if not state.number_moved and state.passed_ms is not None and now_ms - state.passed_ms >= debounce_ms:
        return _leave(state, state.passed_ms, f"{_what_passed(state)}, same number")
    since_ms = state.onset_ms if state.blank_since_ms is None else state.blank_since_ms
    if now_ms - since_ms >= change_ms_max:
        what = "number stayed empty" if state.number_moved else "number did not change"
        return _leave(state, round(since_ms + change_ms_max), _given_up(config, what))
    return Step(state)


def _what_passed(state: State) -> str:
    return "block passed" if COMMANDED in state.evidence else "cue ended"


def _given_up(config: ToolChangeSection, what: str) -> str:
    return f"given up: {what} for {config.change_s_max:g} s"


def not_observable(now_ms: int) -> tuple[EdgeSample, ...]:
    """Return what is published where the control offers neither a tool number nor the block text."""
    reason = "the control offers neither tool number nor block text"
    return (
        EdgeSample("tool_change_active", None, now_ms, Quality.BAD, reason, observations=0),
        EdgeSample("tool_change_source", "none", now_ms, observations=0),
        EdgeSample("tool_change_evidence", "none", now_ms, observations=0),
    )


def is_tool_change_block(config: ToolChangeSection, block: str) -> bool:
    """Return whether a block commands a tool change; comments do not.

    >>> [is_tool_change_block(ToolChangeSection(), b) for b in ("N10 T7 M06", "T7M6", "M602", "(M06) G0 X1", "TOOL CALL 5 Z")]
    [True, True, False, False, True]
    """
    return _pattern(config.block_pattern).search(_COMMENT.sub(" ", block[:4096].upper())) is not None


def _advance(config: ToolChangeSection, state: State, sample: EdgeSample) -> Step:
    """Tell the time. A clock that jumps means another section of a recording, or a machine that was away."""
    now_ms, clock_ms = sample.timestamp_ms, state.clock_ms
    if clock_ms is None or (sample.is_baseline and now_ms > clock_ms):
        return Step(replace(state, clock_ms=now_ms))
    if sample.is_baseline:
        return Step(state)
    if now_ms < clock_ms - CLOCK_BACK_MS_MAX:
        return _rejoin(state, now_ms)
    if now_ms > clock_ms + CLOCK_AHEAD_MS_MAX:
        done = tick(config, state, now_ms)
        return done.then(Step(replace(done.state, rejoined_ms=now_ms)))
    return tick(config, state, max(now_ms, clock_ms))


def _rejoin(state: State, now_ms: int) -> Step:
    """The clock went back: finish what can be finished, and measure the rest by the new clock."""
    done = Step(state)
    if state.phase is Phase.CHANGING and state.candidate is not None:
        done = _leave(state, state.candidate.timestamp_ms, "number stood until the clock jumped")
    after = replace(done.state, clock_ms=now_ms, rejoined_ms=now_ms)
    if after.phase is Phase.DOUBT:
        after = replace(after, onset_ms=now_ms)
    if after.blank_since_ms is not None:
        after = replace(after, blank_since_ms=now_ms)
    if after.passed_ms is not None:
        after = replace(after, passed_ms=now_ms)
    return done.then(Step(after))


def _tool_of(config: ToolChangeSection, sample: EdgeSample) -> str:
    """Return what tells one tool from another; "" is none. A name that is no number still is a tool; its number is null."""
    if sample.value is None:
        return "" if sample.reason == EMPTY else str(sample.reason)
    return "" if config.zero_is_no_tool and sample.value == 0 else str(sample.value)


def _number(config: ToolChangeSection, state: State, sample: EdgeSample) -> Step:
    if str(sample.reason).startswith(UNAVAILABLE):
        return _unavailable(state, sample)
    state = replace(state, is_lost=False) if state.is_lost else state
    tool = _tool_of(config, sample)
    if tool == "" and sample.value is not None:
        sample = replace(sample, value=None, reason="0: no tool in the spindle")
    is_found = sample.is_baseline or state.tool is None
    is_found |= state.rejoined_ms is not None and abs(sample.timestamp_ms - state.rejoined_ms) <= REJOIN_MS
    if is_found and (tool or state.phase is Phase.SETTLED) and not (state.cue and state.phase is Phase.CHANGING):
        return _found(state, sample, tool)
    if state.phase is Phase.CHANGING:
        return _number_while_changing(state, sample, tool)
    if state.phase is Phase.DOUBT:
        if tool == "":
            return Step(state, debounced=sample.observations)
        if tool == state.tool:
            settled = replace(state, phase=Phase.SETTLED, blank=None, blank_since_ms=None)
            return Step(settled, debounced=state.held + sample.observations)
        entered = _enter(state, state.onset_ms, "tool number empty")
        return entered.then(_number_while_changing(entered.state, sample, tool))
    if tool == state.tool:
        return Step(state, (sample,))
    if tool == "":
        at_ms = sample.timestamp_ms
        return Step(replace(state, phase=Phase.DOUBT, onset_ms=at_ms, blank=sample, blank_since_ms=at_ms))
    entered = _enter(state, sample.timestamp_ms, "tool number changed")
    return entered.then(_number_while_changing(entered.state, sample, tool))


def _found(state: State, sample: EdgeSample, tool: str) -> Step:
    """The number on (re)joining. An empty one may be the middle of a change, so it is in doubt; a number ends what was open."""
    flaps, at_ms = state.held, sample.timestamp_ms
    if tool == "" and state.tool is None:
        doubt = replace(state, phase=Phase.DOUBT, tool="?", onset_ms=at_ms, blank=sample, blank_since_ms=at_ms)
        if state.shows_change and not state.is_idle:
            return _enter(doubt, at_ms, "tool number empty", "block shows a tool change")
        return Step(doubt, debounced=flaps)
    evidence = f"as found: tool number {'known' if tool else 'empty'}"
    settled = replace(_settled(state, tool), is_announced=True)
    return Step(settled, (sample, *_active(False, at_ms, evidence, sample.is_baseline)), flaps)


def _unavailable(state: State, sample: EdgeSample) -> Step:
    if state.cue is not None:  # the control says of itself whether it is changing the tool
        kept = state if state.phase is Phase.CHANGING else _settled(state, None)
        return Step(replace(kept, tool=None, blank_since_ms=None, candidate=None, number_moved=False), (sample,), state.held)
    if state.is_lost:  # said before; the block may show a change all the same
        return Step(state, (sample,))
    at_ms, reason = sample.timestamp_ms, "the control does not report its tool"
    samples = (
        sample,
        EdgeSample("tool_change_active", None, at_ms, Quality.BAD, reason, observations=0),
        EdgeSample("tool_change_source", "stale", at_ms, observations=0),
        EdgeSample("tool_change_evidence", "none: tool number unavailable", at_ms, observations=0),
    )
    return Step(replace(_settled(state, None), is_announced=False, is_lost=True), samples, state.held)


def _number_while_changing(state: State, sample: EdgeSample, tool: str) -> Step:
    flaps = 0 if state.candidate is None else state.candidate.observations
    if tool == "":
        at_ms = sample.timestamp_ms
        after = replace(state, candidate=None, blank_since_ms=at_ms, number_moved=True)
        if state.number_moved:
            return Step(after, debounced=flaps + sample.observations)
        return Step(after, (sample,), flaps)
    if state.candidate is not None and sample.value == state.candidate.value and sample.reason == state.candidate.reason:
        return Step(state, debounced=sample.observations)
    return Step(replace(state, candidate=sample, blank_since_ms=None, number_moved=True), debounced=flaps)


def _block(config: ToolChangeSection, state: State, sample: EdgeSample) -> Step:
    block = sample.value if isinstance(sample.value, str) else None
    if block == state.block:  # a control that is looked at shows its block again at each look
        return _announce(state, sample)
    shows = block is not None and is_tool_change_block(config, block)
    passed_ms = sample.timestamp_ms if state.shows_change and not shows else state.passed_ms
    ended = Step(state)
    if shows and state.cue is False and state.phase is Phase.CHANGING and state.passed_ms is not None:
        ended = _leave(state, state.passed_ms, f"{_what_passed(state)}, same number")
    after = ended.state.changed(block=block, shows_change=shows, passed_ms=None if shows else passed_ms)
    announced = ended.then(_announce(after, sample))
    if not shows or state.is_idle or (sample.is_baseline and state.phase is not Phase.DOUBT):
        return announced
    return announced.then(_commanded(announced.state, sample.timestamp_ms, COMMANDED))


def _cue(state: State, sample: EdgeSample) -> Step:
    """The control says of itself whether it is changing the tool (None: it does not say)."""
    at_ms, before = sample.timestamp_ms, state.cue
    cue = sample.value if isinstance(sample.value, bool) else None
    after = replace(state, cue=cue)
    if cue and not before:
        done = Step(after)
        if before is False and state.phase is Phase.CHANGING and state.passed_ms is not None:
            done = _leave(after, state.passed_ms, f"{_what_passed(state)}, same number")
        done = done.then(Step(replace(done.state, passed_ms=None)))
        return done.then(_commanded(done.state, at_ms, sample.reason or "cue of the control"))
    if cue is False and before and state.phase is Phase.CHANGING:
        if state.candidate is not None or sample.is_baseline:
            since_ms = at_ms if state.candidate is None else max(at_ms, state.candidate.timestamp_ms)
            return _leave(after, since_ms, "as found: no cue" if sample.is_baseline else "cue ended")
        return Step(replace(after, passed_ms=at_ms))  # the number may follow in the next look
    return _announce(after, sample)


def _commanded(state: State, at_ms: int, why: str) -> Step:
    """A running block commands a tool change, or the control works on one."""
    if state.phase is Phase.SETTLED:
        return _enter(state, at_ms, why)
    if state.phase is Phase.DOUBT:
        return _enter(state, state.onset_ms, "tool number empty", why)
    if why in state.evidence and state.candidate is not None:  # the next change, before the last number had stood
        left = _leave(state, state.candidate.timestamp_ms, "next change commanded")
        return left.then(_enter(left.state, at_ms, why))
    if why in state.evidence:
        return Step(state)
    evidence = (*state.evidence, why)
    return Step(replace(state, evidence=evidence), (_evidence(at_ms, evidence),))


def _execution(state: State, sample: EdgeSample) -> Step:
    is_idle = sample.value in _IDLE_STATES
    after = replace(state, is_idle=is_idle)
    if state.is_idle and not is_idle and state.shows_change and state.phase is Phase.SETTLED and not sample.is_baseline:
        return _enter(after, sample.timestamp_ms, COMMANDED)
    if is_idle and state.shows_change and state.passed_ms is None:  # the program ended on the block
        after = replace(after, passed_ms=sample.timestamp_ms)
    return Step(after)


def _enter(state: State, onset_ms: int, *evidence: str) -> Step:
    blank = () if state.blank is None else (state.blank,)
    after = replace(
        state,
        phase=Phase.CHANGING,
        is_announced=True,
        onset_ms=onset_ms,
        blank=None,
        candidate=None,
        number_moved=state.blank is not None,
        passed_ms=None,
        evidence=evidence,
    )
    return Step(after, (*_active(True, onset_ms, " + ".join(evidence)), *blank))


def _leave(state: State, at_ms: int, how: str) -> Step:
    """The change is over; it lasted at least a millisecond, or nobody would see it."""
    at_ms = max(at_ms, state.onset_ms + 1)
    tool = state.tool
    samples: tuple[EdgeSample, ...] = ()
    if state.candidate is not None:
        tool = str(state.candidate.value if state.candidate.value is not None else state.candidate.reason)
        samples = (state.candidate,)
    elif state.number_moved:
        tool = ""
    evidence = " + ".join((*state.evidence, how))
    return Step(_settled(state, tool), samples + _active(False, at_ms, evidence))


def _settled(state: State, tool: str | None) -> State:
    return replace(
        state,
        phase=Phase.SETTLED,
        tool=tool,
        blank=None,
        blank_since_ms=None,
        candidate=None,
        number_moved=False,
        passed_ms=None,
        evidence=(),
    )


def _announce(state: State, sample: EdgeSample) -> Step:
    if state.is_announced or state.phase is not Phase.SETTLED or sample.value is None:
        return Step(state)
    after = replace(state, is_announced=True)
    evidence = "as found: no cue" if sample.signal == CUE else "as found: block text"
    return Step(after, _active(False, sample.timestamp_ms, evidence, sample.is_baseline))


def _active(value: bool, at_ms: int, evidence: str, is_baseline: bool = False) -> tuple[EdgeSample, ...]:
    return (
        EdgeSample("tool_change_active", value, at_ms, observations=0, is_baseline=is_baseline),
        EdgeSample("tool_change_source", "controller", at_ms, observations=0, is_baseline=is_baseline),
        EdgeSample("tool_change_evidence", evidence, at_ms, observations=0, is_baseline=is_baseline),
    )


def _evidence(at_ms: int, evidence: tuple[str, ...]) -> EdgeSample:
    return EdgeSample("tool_change_evidence", " + ".join(evidence), at_ms, observations=0)
