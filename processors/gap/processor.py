"""The standing gap between twin and machine, by signal and regime, and whether it grows.

What the twin says of a signal, and in which regime: `processors/gap/comparison.py`. A figure is the root mean square of twin less
measured over the floor, by means over time in the regime that forget in hours (`processors/gap/cell.py`). The floor is what the
samples of a healthy machine scatter by: configured, or learned while somebody states that it is healthy, never from the data that
is judged. Once an hour each regime's mean and scatter go into a chart whose rate of false alarms is stated
(`processors/gap/growth.py`). Where it alarms, `twin/gap_window` names the recorded stretch, since it began to grow, in which
the gap was largest: the one to diagnose.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from typing import Self

from pydantic import AwareDatetime, Field, NonNegativeFloat, PositiveFloat, model_validator

from processors.config import ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.gap.cell import Cell, Moments, Terms, closed, seen
from processors.gap.comparison import (
    INPUTS,
    LOAD,
    REGIMES,
    RESOLUTIONS,
    SIGNALS,
    UNITS,
    Compared,
    Given,
    ToolChange,
    Watch,
    comparison,
    heated,
    watched,
)
from processors.gap.growth import BLOCKS_MIN
from sparkplug.datatype import DataType
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

GAP, GROWING = twin_signals.GAP_PREFIX, twin_signals.GAP_GROWING
GROWING_SIGNAL, WINDOW = twin_signals.GAP_GROWING_SIGNAL, twin_signals.GAP_WINDOW
BASIS, LEFT_OUT = twin_signals.GAP_BASIS, twin_signals.GAP_LEFT_OUT_PCT
NAMES = {
    signal: {f"{GAP}{signal}": ""} | {f"{GAP}{signal}/{regime}": regime for regime in regimes if len(regimes) > 1}
    for signal, regimes in REGIMES.items()
}
"""The metrics of a signal's figures, with the regime that each is of, "" for all."""
NONE = "none"
_TICK = SampleKind.TICK
PUBLISH_S = 60.0
YEAR_S = 365.25 * 86_400.0
SIDES = 3
"""The ways in which a cell grows: its mean rises, its mean falls, its scatter grows."""
REGIMES_OF_SIGNAL_MAX = 8
GROWING_SHOWN_MAX = 3


class Config(ProcessorConfig):
    """The drive as the twin knows it, the healthy period, and how soon to raise an alarm.

    healthy_from: with its time zone; without it, the first hours that are seen are taken to be healthy, and the basis says so
    """

    late_s_max: float = Field(default=60.0, ge=0.0, le=3600.0, description="processor thermal is a moment behind the machine")
    healthy_from: AwareDatetime | None = None
    healthy_hours: float = Field(default=336.0, gt=0.0, le=8766.0)
    floors: dict[str, PositiveFloat] = Field(default_factory=dict, description="by signal, in its unit; else learned")
    growth_floors: PositiveFloat = 0.5
    false_alarms_per_year: float = Field(default=0.1, gt=0.0, le=100.0)
    block_s: float = Field(default=3600.0, ge=60.0, le=86_400.0)
    window_hours: float = Field(default=2.0, gt=0.0, le=48.0)
    standing_hours: float = Field(default=8.0, gt=0.0, le=720.0)
    shown_s_min: float = Field(default=60.0, ge=1.0, le=3600.0, description="of a regime, before its standing figure is told")
    settle_s: NonNegativeFloat = 2.0
    rapid_feed_mm_min: PositiveFloat = 15_000.0
    rated_power_kw: PositiveFloat | None = None
    idle_power_kw: NonNegativeFloat | None = None

    @cached_property
    def given(self) -> Given:
        """The settings of the comparison."""
        idle_kw, rated_kw = self.idle_power_kw, self.rated_power_kw
        idle_pct = None if idle_kw is None or rated_kw is None else 100.0 * idle_kw / rated_kw
        return Given(self.settle_s, self.rapid_feed_mm_min, idle_pct)

    @cached_property
    def blocks_of_window(self) -> int:
        """The blocks of a stretch that is long enough to diagnose."""
        return max(2, round(self.window_hours * 3600.0 / self.block_s))

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if unknown := sorted(set(self.floors) - set(SIGNALS)):
            raise ValueError(f"floors has {', '.join(unknown)}; there are {', '.join(SIGNALS)}")
        if self.tick_s > self.block_s / 4.0:
            raise ValueError(f"tick_s {self.tick_s:g} is more than a quarter of block_s {self.block_s:g}")
        return self


@dataclass(frozen=True, slots=True)
class State:
    """The cells by signal and regime, and how far time has come.

    block, minute: number of the present ones since 1970; left_out: share of the time in which nothing could be compared
    """

    watch: Watch = field(default_factory=Watch)
    healthy_from_s: float | None = None
    block: int = -1
    minute: int = -1
    seconds: float = 0.0
    left_out: float = 0.0
    cells: Mapping[str, Cell] = field(default_factory=dict)

    def watching(self, watch: Watch) -> "State":
        """Return the state with this watch. Spelled out, since `replace` looks up each field."""
        return State(watch, self.healthy_from_s, self.block, self.minute, self.seconds, self.left_out, self.cells)


def step(config: Config, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Watch every sample; compare at ticks, each of which stands for tick_s; publish once a minute."""
    if sample.is_history:
        return state, ()
    watch = watched(state.watch, config.given, sample)
    if sample.kind is not _TICK:
        return (state if watch is state.watch else state.watching(watch)), ()
    watch = heated(watch, sample, config.tick_s)
    if watch is not state.watch:
        state = state.watching(watch)
    state = _begun(config, state, sample.at_s)
    state = _block_closed(config, state, sample.at_s)
    found = comparison(state.watch, config.given, sample)
    state = _compared(config, state, found.compared, sample.at_s, is_left_out=found.is_left_out)
    minute = int(sample.at_s // PUBLISH_S)
    if minute == state.minute:
        return state, ()
    return replace(state, minute=minute), _outputs(config, state, found.missing, sample.at_s)


def _begun(config: Config, state: State, at_s: float) -> State:
    """The state with the start of the healthy period; where another one is configured now, all is learned anew."""
    if config.healthy_from is None:
        return state if state.healthy_from_s is not None else replace(state, healthy_from_s=at_s)
    from_s = config.healthy_from.timestamp()
    return state if state.healthy_from_s == from_s else State(watch=state.watch, healthy_from_s=from_s)


def _healthy_s(config: Config, state: State) -> tuple[float, float]:
    from_s = state.healthy_from_s or 0.0
    return from_s, from_s + config.healthy_hours * 3600.0


def _block_closed(config: Config, state: State, at_s: float) -> State:
    """The state in the block of `at_s`; the one before it is closed. Where the clock was set back, its samples are let go."""
    block = int(at_s // config.block_s)
    if block == state.block:
        return state
    healthy_s, end_s = _healthy_s(config, state), (state.block + 1) * config.block_s
    cells: dict[str, Cell] = {}
    for key, cell in state.cells.items():
        if block < state.block:
            cells[key] = cell._replace(block=Moments())
        else:
            cells[key] = closed(cell, _terms(config, state, key, cell, at_s), state.block, end_s, healthy_s)
    return replace(state, block=block, cells=cells)


def _terms(config: Config, state: State, key: str, cell: Cell, at_s: float) -> Terms:
    signal = key.partition("/")[0]
    blocks_a_year = YEAR_S / config.block_s
    return Terms(
        floor=_floor(config, state, signal, cell, at_s),
        resolution=RESOLUTIONS[signal],
        standing_s=config.standing_hours * 3600.0,
        block_s=config.block_s,
        growth_floors=config.growth_floors,
        blocks_between_alarms=SIDES * max(len(state.cells), 1) * blocks_a_year / config.false_alarms_per_year,
        blocks_of_window=config.blocks_of_window,
    )


def _floor(config: Config, state: State, signal: str, cell: Cell, at_s: float) -> float | None:
    """The floor of a cell; None while it is not known."""
    configured = config.floors.get(signal)
    if configured is not None:
        return configured
    if not cell.is_judged or at_s < _healthy_s(config, state)[1]:
        return None
    return max(cell.healthy.deviation, RESOLUTIONS[signal] / math.sqrt(12.0))


def _compared(config: Config, state: State, compared: Sequence[Compared], at_s: float, *, is_left_out: bool) -> State:
    """The state with what could be compared, held for a tick. A baseline that is learned begins while the machine is healthy."""
    from_s, until_s = _healthy_s(config, state)
    is_healthy = from_s <= at_s - config.tick_s and at_s <= until_s
    cells = dict(state.cells)
    for one in compared:
        key = f"{one.signal}/{one.regime}"
        cell = cells.get(key)
        if cell is None or cell.is_learned is not one.is_learned:
            if (one.is_learned and not is_healthy) or len(_cells_of(cells, one.signal)) >= REGIMES_OF_SIGNAL_MAX:
                continue
            cell = Cell(is_learned=one.is_learned)
        cells[key] = seen(cell, _terms(config, state, key, cell, at_s), one.gap, at_s, config.tick_s, is_healthy=is_healthy)
    seconds = min(state.seconds + config.tick_s, config.standing_hours * 3600.0)
    left_out = state.left_out + config.tick_s / seconds * (is_left_out - state.left_out)
    # Spelled out, since `replace` looks up each field.
    return State(state.watch, state.healthy_from_s, state.block, state.minute, seconds, left_out, cells)


def _cells_of(cells: Mapping[str, Cell], signal: str) -> dict[str, Cell]:
    """The cells of a signal, by regime."""
    start = f"{signal}/"
    return {key[len(start) :]: cell for key, cell in cells.items() if key.startswith(start)}


def _outputs(config: Config, state: State, missing: Mapping[str, str], at_s: float) -> list[Output]:
    outputs: list[Output] = []
    for signal in SIGNALS:
        outputs += _figures(config, state, signal, missing.get(signal), at_s)
    growing = sorted((key for key, cell in state.cells.items() if cell.grows), key=lambda key: -state.cells[key].rise)
    if any(cell.is_judged for cell in state.cells.values()) and at_s >= _healthy_s(config, state)[1]:
        outputs.append(Output(GROWING, bool(growing)))
    else:
        outputs.append(Output.null(GROWING, _why_not_judged(config, state, at_s)))
    said = "; ".join(_growth_in_words(key, state.cells[key]) for key in growing[:GROWING_SHOWN_MAX])
    outputs += [Output(GROWING_SIGNAL, said or NONE), Output(WINDOW, _window(config, state, growing))]
    outputs += [Output(BASIS, _basis(config, state)), Output(LEFT_OUT, round(100.0 * state.left_out, 1))]
    return outputs


def _figures(config: Config, state: State, signal: str, missing: str | None, at_s: float) -> list[Output]:
    """The gap of a signal over its floor, of each of its regimes, and its mean; stale where an input is missing now."""
    name, quality = f"{GAP}{signal}", Quality.GOOD if missing is None else Quality.STALE
    cells = _cells_of(state.cells, signal)
    known = _known(config, state, signal, cells, at_s)
    outputs: list[Output] = []
    for title, regime in NAMES[signal].items():
        found = [one for key, one in known.items() if key.startswith(regime)]  # cutting has one for each program
        if found:
            square = sum(cell.standing.seconds * (cell.rms / floor) ** 2 for cell, floor in found)
            total_s = sum(cell.standing.seconds for cell, _ in found)
            outputs.append(Output(title, round(math.sqrt(square / total_s), 3), quality, missing))
        elif missing or any(cell.standing.seconds >= config.shown_s_min for key, cell in cells.items() if key.startswith(regime)):
            outputs.append(Output.null(title, missing or _why_not_judged(config, state, at_s)))
        else:
            of = regime or " or ".join(REGIMES[signal])
            outputs.append(Output.null(title, f"less than {config.shown_s_min:g} s seen of {of}"))
    if not known:
        return [*outputs, Output.null(f"{name}/mean", outputs[0].reason or "")]
    total_s = sum(cell.standing.seconds for cell, _ in known.values())
    mean = sum(cell.standing.seconds * cell.mean for cell, _ in known.values()) / total_s
    return [*outputs, Output(f"{name}/mean", round(mean, 4), quality, missing)]


def _known(config: Config, state: State, signal: str, cells: Mapping[str, Cell], at_s: float) -> dict[str, tuple[Cell, float]]:
    """The cells that have a standing figure, with their floor, by regime."""
    is_learned = at_s >= _healthy_s(config, state)[1]
    known = {}
    for regime, cell in cells.items():
        if cell.standing.seconds >= config.shown_s_min and (not cell.is_learned or (is_learned and cell.is_judged)):
            floor = _floor(config, state, signal, cell, at_s)
            if floor is not None:
                known[regime] = cell, floor
    return known


def _why_not_judged(config: Config, state: State, at_s: float) -> str:
    until_s = _healthy_s(config, state)[1]
    if at_s < until_s:
        return f"what a healthy machine does is being learned until {_iso(until_s)}"
    return f"fewer than {BLOCKS_MIN} blocks, or too much alike, were seen while the machine was healthy, until {_iso(until_s)}"


def _growth_in_words(key: str, cell: Cell) -> str:
    signal, _, regime = key.partition("/")
    chart = cell.level_chart
    if not chart.grows:
        return f"{signal} in {regime}: scatter has grown since {_iso(cell.spread_chart.since_s)}"
    return f"{signal} in {regime}: twin minus measured has {'risen' if chart.grows > 0 else 'fallen'} since {_iso(chart.since_s)}"


def _window(config: Config, state: State, growing: Sequence[str]) -> str:
    """Start and end of the stretch to diagnose, of what grows most."""
    stretch = next((most for key in growing if (most := state.cells[key].most) is not None), None)
    if stretch is None:
        return NONE
    return f"{_iso(min(stretch.start_s, stretch.end_s - config.window_hours * 3600.0))}/{_iso(stretch.end_s)}"


def _basis(config: Config, state: State) -> str:
    """Return the basis of the figures, and who said that the machine was healthy."""
    from_s, until_s = _healthy_s(config, state)
    idle = "learned" if config.given.idle_load_pct is None else f"idle power, {config.given.idle_load_pct:.3g} % of rated"
    stated = "stated" if config.healthy_from is not None else "assumed, nobody stated it"
    floors = ", ".join(f"{signal} {floor:g}" for signal, floor in config.floors.items()) or "none"
    gate = "; tool changes are not gated: nobody tells them" if state.watch.change is ToolChange.ABSENT else ""
    return (
        f"temperature: thermal network; {LOAD}: in air {idle}, cutting learned by program; speed: command; axis loads: learned; "
        f"healthy {_iso(from_s)}/{_iso(until_s)} ({stated}); floors configured: {floors}, else learned{gate}"
    )


def _iso(at_s: float) -> str:
    """UTC to the second; for a time that no calendar reaches, the seconds since 1970."""
    try:
        return f"{datetime.fromtimestamp(at_s, UTC).isoformat(timespec='seconds').removesuffix('+00:00')}Z"
    except (OverflowError, ValueError, OSError):
        return f"{at_s:g} s"


def _specs() -> tuple[OutputSpec, ...]:
    inferred, specs = Provenance.INFERRED, []
    for signal in SIGNALS:
        for name, regime in NAMES[signal].items():
            meaning = f"rms of twin minus measured {signal} over the floor" + (f", in {regime}" if regime else "")
            specs.append(OutputSpec(name, DataType.DOUBLE, None, meaning, inferred, 0.05))
        meaning = f"mean of twin minus measured {signal}"
        deadband = RESOLUTIONS[signal] / 10.0
        specs.append(OutputSpec(f"{GAP}{signal}/mean", DataType.DOUBLE, UNITS[signal], meaning, inferred, deadband))
    texts = {
        GROWING_SIGNAL: "which gap grows: signal, regime, since when",
        WINDOW: "recorded stretch in which the growing gap was largest, UTC start/end: what to diagnose",
        BASIS: "what the gap rests on",
    }
    growing = OutputSpec(GROWING, DataType.BOOLEAN, None, "whether the gap of a signal grows", inferred, is_alarm=True)
    left_out = "share of the time in which nothing was compared: tool changes, settling, unknown inputs"
    return (
        *specs,
        growing,
        *(OutputSpec(name, DataType.STRING, None, meaning, inferred) for name, meaning in texts.items()),
        OutputSpec(LEFT_OUT, DataType.DOUBLE, "%", left_out, inferred, 1.0),
    )


PROCESSOR = Processor(
    name="gap",
    version=1,
    inputs=INPUTS,
    outputs=_specs(),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
)
