"""The twin's expectation of the line that runs, looked up and scaled to the feed and speed that are run, beside what is measured.

    residual = measured load − expected load        cut = measured load − load in air        (twin/expected, `cnctwin expect`)

Between two samples a machine is somewhere in a line, so the expected cut has a least and a greatest value, over the places where
it may be at this sample, and was at one just before. What is not known is null, with the reason.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, NamedTuple

from pydantic import Field

from processors.config import Configuration, ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.description import Description
from processors.expected.place import ANYWHERE_MM, BEYOND, Place, began, placed, window_mm
from processors.expected.usual import Air, Ratio, air_after, ratios_after
from processors.sample import why_unknown
from sparkplug.datatype import DataType
from sparkplug.quality import Quality
from twin.expected.expectation import Expectation
from twin.expected.expected import Expected
from twin.expected.files import load_expectations, stale
from twin.vocabulary import twin_signals

PROGRAM, LINE, TOOL, LOAD = "program", "nc_line", "tool_number", "spindle_load_pct"
SPEED, FEED, OVERRIDE = "spindle_rpm", "feed_mm_min", "feed_override_pct"
NO_FOLDER = "no expectations; cnctwin expect makes them, [expected] expectations names their folder"
TURNING_RPM, STEADY, WITHIN_S, SETTLED_S = 100.0, 0.005, 2.5, 0.7
"""A meter shows for up to SETTLED_S what was a sample ago; a sample WITHIN_S ago tells of the time between."""
CUTS_SHARE, EVEN = 0.3, 1.5
"""A cut tells of the ratio where it is no less than this share of what is expected, and what is expected is known so well."""
BEYOND_MAX = 1e6
DIGITS = 3


class Config(ProcessorConfig):
    """expectations: folder with a file for each machine and program; "" = none: all is null then, and says so."""

    of_one_machine: ClassVar[frozenset[str] | None] = frozenset({"ratio_cut_pct_min"})

    expectations: str = ""
    ratio_cut_pct_min: float = Field(default=2.0, gt=0.0, le=100.0)


def read_expectations(configuration: Configuration[Config]) -> Mapping[str, Mapping[str, Expectation]]:
    """Return the expectations in the configured folder by machine and program. Raises ValueError where one cannot be read."""
    folder = configuration.default.expectations
    return load_expectations(Path(folder)) if folder else {}


@dataclass(frozen=True, slots=True, eq=False)
class Described:
    """The means of the step: the configuration with the expectations; version: of the live description, "" without one."""

    configuration: Configuration[Config]
    version: str = ""

    def expectation(self, machine: str, program: str) -> Expectation | str:
        """Return the expectation of a program, or why there is none."""
        of_machine = self.configuration.read.get(machine)
        if not of_machine:
            return NO_FOLDER if not self.configuration.default.expectations else f"no expectations of {machine}; cnctwin expect"
        found: Expectation | None = of_machine.get(program)
        if found is None:
            return f"no expectation for program {program}: cnctwin expect makes one"
        return found

    def basis(self, expectation: Expectation) -> str:
        """Return in words what an expectation rests on, first of all whether the description has changed since."""
        changed = stale(expectation, description=self.version)
        return expectation.in_words if changed is None else f"{changed}; {expectation.in_words}"


def described(configuration: Configuration[Config], description: Description | None) -> Described:
    """Return the configuration with the version of the description that is live."""
    return Described(configuration, "" if description is None else description.version)


@dataclass(frozen=True, slots=True)
class State:
    """place: in the line; least_pct, most_pct: of the sample before, at `bounds_s`; rpm: of the sample before."""

    place: Place = field(default_factory=Place)
    least_pct: float | None = None
    most_pct: float | None = None
    bounds_s: float = 0.0
    rpm: float | None = None
    air: Air = field(default_factory=Air)
    ratios: Mapping[str, Ratio] = field(default_factory=dict)


def step(given: Described, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Compare at every sample; a hole or a death ends what is known of the place in the line."""
    if sample.kind in (SampleKind.HOLE, SampleKind.DEATH):
        return State(air=state.air, ratios=state.ratios), ()
    if sample.kind is SampleKind.PLAIN:
        return state, ()
    program, no_program = _text(sample, PROGRAM)
    if program is None:
        return _lost(state), Output.nulls(_ALL, no_program)
    expectation = given.expectation(sample.machine, program)
    if isinstance(expectation, str):
        return _lost(state), Output.nulls(_ALL, expectation)
    line, no_line = _whole(sample, LINE)
    if line is None:
        return _lost(state), Output.nulls(_ALL, no_line)
    tool = _whole(sample, TOOL)[0]
    feed, rpm = _bounded(sample, FEED), _bounded(sample, SPEED)
    planned = expectation.planned(line, tool)
    override, before = _override(sample), state.place
    planned_mm_min = 0.0 if planned is None else planned.feed_mm_min * override
    is_new = line != before.line or tool != before.tool or program != before.program
    begins = began(expectation, before, (program, line, tool), sample.at_s, override) if is_new else None
    place = placed(before, (program, line, tool), sample.at_s, feed, planned_mm_min, begins=begins)
    if planned is None:
        return _lost(state, place), Output.nulls(_ALL, f"program {program} has no move in this line")
    window = window_mm(place)
    along_mm = None if window is None or place.doubt_mm >= ANYWHERE_MM else place.along_mm + 0.5 * place.doubt_mm
    run_feed = planned_mm_min if feed is None else feed
    expected = expectation.at(line, run_feed, rpm, tool=tool, along_mm=along_mm)
    assert expected is not None, "a line that is planned is expected"
    ratio_cut_pct_min = given.configuration.of(sample.machine).ratio_cut_pct_min
    now = _Now(expectation, expected, place, window, run_feed, rpm, sample, given.basis(expectation))
    return _compared(ratio_cut_pct_min, state, now)


class _Now(NamedTuple):
    """A sample whose line is known."""

    expectation: Expectation
    expected: Expected
    place: Place
    window: tuple[float, float] | None
    feed: float | None
    rpm: float | None
    sample: Sample
    basis: str

    def bounds(self, before_mm_min: float | None) -> tuple[float, float] | None:
        """Return the least and greatest cut between the places where the machine may be, at the lesser and the greater feed."""
        line, tool = self.place.line, self.place.tool
        assert line is not None
        window = self.window or (0.0, math.inf)
        if self.place.along_mm > BEYOND * self.expectation.length_mm(line, tool):
            window = (0.0, math.inf)
        found = self.expectation.cut_load_between(line, *window, self.feed, self.rpm, tool)
        if found is None or before_mm_min is None or self.feed is None or abs(before_mm_min - self.feed) < 0.02 * self.feed:
            return found
        other = self.expectation.cut_load_between(line, *window, before_mm_min, self.rpm, tool)
        return found if other is None else (min(found[0], other[0]), max(found[1], other[1]))


def _compared(ratio_cut_pct_min: float, state: State, now: _Now) -> tuple[State, Sequence[Output]]:
    """Return the state and all outputs of a sample whose line is known."""
    expected, sample, rpm = now.expected, now.sample, now.rpm
    at_s, tool = sample.at_s, str(now.place.tool)
    outputs = [
        _said(twin_signals.EXPECTED_FEED_MM_MIN, round(expected.feed_mm_min * _override(sample), 1)),
        _said(twin_signals.EXPECTED_LINE_S, round(expected.time_s, DIGITS)),
        _said(twin_signals.EXPECTED_BASIS, now.basis),
    ]
    is_on = state.place.line == now.place.line and now.place.along_mm > 0.0 and at_s - state.place.at_s <= WITHIN_S
    bounds = now.bounds(state.place.feed_mm_min if is_on else None)
    if bounds is None or math.isnan(expected.load_pct):
        why = now.expectation.why_not(now.place.line, now.place.tool) or "no load is expected of this line"
        return _lost(state, now.place), (*outputs, *Output.nulls(_OF_LOAD, why))
    least, most = bounds
    least_shown, most_shown, ago_s = least, most, at_s - state.bounds_s
    if state.least_pct is not None and 0.0 <= ago_s < SETTLED_S:
        least_shown = min(least, state.least_pct)
    if state.most_pct is not None and 0.0 <= ago_s <= WITHIN_S:
        most_shown = max(most, state.most_pct)
    outputs += [
        _said(twin_signals.EXPECTED_SPINDLE_LOAD_PCT, round(expected.load_pct, DIGITS)),
        _said(twin_signals.EXPECTED_CUTTING_FORCE_N, round(expected.force_n, 1)),
        _said(twin_signals.EXPECTED_CUT_LEAST_PCT, round(least_shown, DIGITS)),
        _said(twin_signals.EXPECTED_CUT_MOST_PCT, round(most_shown, DIGITS)),
    ]
    air, ratios = state.air, state.ratios
    load_pct, no_load = sample.number(LOAD)
    if load_pct is None or rpm is None:
        why = no_load or f"{SPEED} is unknown"
        outputs += Output.nulls((twin_signals.SPINDLE_CUT_LOAD_PCT, twin_signals.SPINDLE_LOAD_RESIDUAL_PCT), why)
    else:
        idle_pct = expected.load_pct - expected.cut_load_pct
        is_steady = state.rpm is not None and abs(rpm - state.rpm) <= STEADY * abs(rpm) and abs(rpm) >= TURNING_RPM
        is_air = most <= 0.0 and (most_shown <= 0.0 or ago_s >= SETTLED_S)
        if is_air and is_steady and sample.kind is not SampleKind.BIRTH:
            air = air_after(air, load_pct - idle_pct, abs(rpm))
        cut_pct = load_pct - idle_pct - air.beyond_pct(rpm)
        is_even = ratio_cut_pct_min <= least_shown and most_shown <= EVEN * least_shown
        if is_steady and is_even and cut_pct >= CUTS_SHARE * least_shown:
            since_s = min(max(at_s - state.bounds_s, 0.0), WITHIN_S)
            ratios = ratios_after(ratios, tool, cut_pct, math.sqrt(least_shown * most_shown), since_s)
        outputs += [
            _said(twin_signals.SPINDLE_CUT_LOAD_PCT, round(cut_pct, DIGITS)),
            _said(twin_signals.SPINDLE_LOAD_RESIDUAL_PCT, round(load_pct - expected.load_pct, DIGITS)),
        ]
    own = ratios.get(tool)
    value = None if own is None else own.value
    outputs.append(
        Output.null(twin_signals.EXPECTED_RATIO, "too little of this tool has been seen")
        if value is None
        else _said(twin_signals.EXPECTED_RATIO, round(value, DIGITS))
    )
    return State(now.place, least, most, at_s, rpm, air, ratios), outputs


def _said(name: str, value: float | str) -> Output:
    """Return a good value, the short way: there are nine of them at every sample."""
    return tuple.__new__(Output, (name, value, Quality.GOOD, None, None, None))


def _lost(state: State, place: Place | None = None) -> State:
    """Return the state with what is known of the spindle and the tools, and the place where there is one."""
    return State(place=Place(extra=state.place.extra) if place is None else place, air=state.air, ratios=state.ratios)


def _override(sample: Sample) -> float:
    percent, _ = sample.number(OVERRIDE)
    return 1.0 if percent is None or not 0.0 <= percent <= 500.0 else percent / 100.0


def _bounded(sample: Sample, name: str) -> float | None:
    value, _ = sample.number(name)
    return None if value is None or not abs(value) <= BEYOND_MAX else abs(value)


def _whole(sample: Sample, name: str) -> tuple[int | None, str]:
    value, why = sample.number(name)
    if value is None:
        return None, why or f"{name} is unknown"
    return (int(value), "") if abs(value) <= 2.0**53 else (None, f"{name} is beyond any number")


def _text(sample: Sample, name: str) -> tuple[str | None, str]:
    reading = sample.row.get(name)
    if reading is None:
        return None, f"{name} is not offered"
    if (why := why_unknown(reading)) is not None:
        return None, why
    return (reading.value, "") if isinstance(reading.value, str) and reading.value else (None, f"{name} is empty")


_OF_LOAD = (
    twin_signals.EXPECTED_SPINDLE_LOAD_PCT,
    twin_signals.EXPECTED_CUTTING_FORCE_N,
    twin_signals.EXPECTED_CUT_LEAST_PCT,
    twin_signals.EXPECTED_CUT_MOST_PCT,
    twin_signals.SPINDLE_CUT_LOAD_PCT,
    twin_signals.SPINDLE_LOAD_RESIDUAL_PCT,
    twin_signals.EXPECTED_RATIO,
)
_ALL = (*_OF_LOAD, twin_signals.EXPECTED_FEED_MM_MIN, twin_signals.EXPECTED_LINE_S, twin_signals.EXPECTED_BASIS)

_DOUBLE, _MODELLED, _INFERRED = DataType.DOUBLE, Provenance.MODELLED, Provenance.INFERRED
_OUTPUTS = tuple(
    OutputSpec(name, datatype, unit, meaning, provenance, deadband)
    for name, datatype, unit, meaning, provenance, deadband in (
        (twin_signals.EXPECTED_SPINDLE_LOAD_PCT, _DOUBLE, "%", "spindle load by the twin at this place", _MODELLED, 0.1),
        (twin_signals.EXPECTED_FEED_MM_MIN, _DOUBLE, "mm/min", "mean feed of the line, with the override", _MODELLED, 1.0),
        (twin_signals.EXPECTED_CUTTING_FORCE_N, _DOUBLE, "N", "mean tangential force by the twin", _MODELLED, 1.0),
        (twin_signals.EXPECTED_LINE_S, _DOUBLE, "s", "time that the line takes as planned", _MODELLED, 0.001),
        (twin_signals.EXPECTED_CUT_LEAST_PCT, _DOUBLE, "%", "least load of the cut that the twin expects now", _MODELLED, 0.1),
        (twin_signals.EXPECTED_CUT_MOST_PCT, _DOUBLE, "%", "greatest load of the cut that the twin expects now", _MODELLED, 0.1),
        (twin_signals.SPINDLE_CUT_LOAD_PCT, _DOUBLE, "%", "measured load without what the spindle takes in air", _INFERRED, 0.1),
        (twin_signals.SPINDLE_LOAD_RESIDUAL_PCT, _DOUBLE, "%", "measured − expected spindle load", _INFERRED, 0.1),
        (twin_signals.EXPECTED_RATIO, _DOUBLE, None, "measured over expected cut of this tool, of late", _INFERRED, 0.01),
        (twin_signals.EXPECTED_BASIS, DataType.STRING, None, "what it rests on, and what is left out", _INFERRED, 0.0),
    )
)
PROCESSOR = Processor(
    name="expected",
    version=2,
    inputs=frozenset({PROGRAM, LINE, TOOL, LOAD, SPEED, FEED, OVERRIDE}),
    outputs=_OUTPUTS,
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
    wakes=frozenset({PROGRAM, LINE, TOOL, LOAD, FEED}),
    reads=read_expectations,
    described=described,
)
