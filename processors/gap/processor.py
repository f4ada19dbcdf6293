"""The standing gap between twin and machine, by signal and regime, whether it grows, and whether it stands open.

The twin of each signal, and its regimes: `processors/gap/comparison.py`. A figure is the root mean square of twin less
measured over the floor, by means over time in the regime that forget in hours (`processors/gap/cell.py`). The floor is what the
samples of a healthy machine scatter by: configured, or learned while somebody states that it is healthy, never from the data that
is judged; until then it is the noise that the description states. Once an hour each regime's mean and scatter go into a chart
whose rate of false alarms is stated (`processors/gap/growth.py`). Where it alarms, `twin/gap_window` names the recorded stretch,
since it began to grow, in which the gap was largest: the one to diagnose. A twin that was wrong from its first day never grows;
`twin/gap_open` names the signals whose gap stands open.
"""

from collections.abc import Sequence
from dataclasses import replace

from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.gap.cell import Cell, Moments, closed, seen
from processors.gap.comparison import INPUTS, Compared, comparison, times_compared
from processors.gap.config import Config
from processors.gap.described import Given, described
from processors.gap.figures import BASIS, FINDINGS, GROWING, GROWING_SIGNAL, LEFT_OUT, OPEN, WINDOW, opened, outputs
from processors.gap.signals import GAP, NAMES, REGIMES_MAX, REGIMES_OF_SIGNAL_MAX, RESOLUTIONS, SIGNALS, UNITS
from processors.gap.state import State, begun, cells_of, healthy_s, taken_up, terms_of
from processors.gap.timing import timed
from processors.gap.watch import heated, watched
from sparkplug.datatype import DataType

_TICK = SampleKind.TICK


def step(given: Given, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Watch every sample; compare at ticks, each of which stands for tick_s; publish every publish_s."""
    if sample.is_history:
        return state, ()
    config, before = given.config, state.watch
    if state.version != given.twin.version:
        state = taken_up(given, state, sample.at_s)
    watch, timing = watched(before, config.rapid_feed_mm_min, sample), state.timing
    if sample.kind is not _TICK:
        timing = timed(timing, before, watch, sample)
        return (state if watch is before and timing is state.timing else state.watching(watch, timing)), ()
    watch = heated(watch, given.twin.version, sample, config.tick_s)
    times = times_compared(given, timing.done)
    if times:
        timing = replace(timing, done=())
    if watch is not before or times:
        state = state.watching(watch, timing)
    state = begun(given, state, sample.at_s)
    state = _block_closed(given, state, sample.at_s)
    found = comparison(state.watch, given, sample)
    state = _compared(given, state, (*found.compared, *times), sample.at_s, is_left_out=found.is_left_out)
    number = int(sample.at_s // config.publish_s)
    if number == state.round:
        return state, ()
    state = opened(given, replace(state, round=number), sample.at_s)
    return state, outputs(given, state, found.missing, sample.at_s)


def _block_closed(given: Given, state: State, at_s: float) -> State:
    """The state in the block of `at_s`; the one before it is closed. Where the clock was set back, its samples are let go."""
    block_s = given.config.block_s
    block = int(at_s // block_s)
    if block == state.block:
        return state
    healthy, end_s = healthy_s(given, state), (state.block + 1) * block_s
    cells: dict[str, Cell] = {}
    for key, cell in state.cells.items():
        if block < state.block:
            cells[key] = cell._replace(block=Moments())
        else:
            cells[key] = closed(cell, terms_of(given, state, key, cell, at_s), state.block, end_s, healthy)
    return replace(state, block=block, cells=cells)


def _compared(given: Given, state: State, compared: Sequence[Compared], at_s: float, *, is_left_out: bool) -> State:
    """The state with what could be compared, held for a tick. A baseline that is learned begins while the machine is healthy."""
    config, (from_s, until_s) = given.config, healthy_s(given, state)
    is_healthy = from_s <= at_s - config.tick_s and at_s <= until_s
    cells = dict(state.cells)
    for one in compared:
        key = f"{one.signal}/{one.regime}"
        cell = cells.get(key)
        if cell is None or cell.is_learned is not one.is_learned:
            regimes_max = REGIMES_MAX.get(one.signal, REGIMES_OF_SIGNAL_MAX)
            if (one.is_learned and not is_healthy) or len(cells_of(cells, one.signal)) >= regimes_max:
                continue
            cell = Cell(is_learned=one.is_learned)
        seconds = config.tick_s if one.seconds is None else one.seconds
        cells[key] = seen(cell, terms_of(given, state, key, cell, at_s), one.gap, at_s, seconds, is_healthy=is_healthy)
    seconds = min(state.seconds + config.tick_s, config.standing_hours * 3600.0)
    left_out = state.left_out + config.tick_s / seconds * (is_left_out - state.left_out)
    # Spelled out, since `replace` looks up each field.
    return State(
        state.watch, state.timing, state.healthy_from_s, state.block, state.round, seconds, left_out, state.version,
        state.described_s, cells,
    )  # fmt: skip


def _specs() -> tuple[OutputSpec, ...]:
    inferred, specs = Provenance.INFERRED, []
    for signal in SIGNALS:
        for name, regime in NAMES[signal].items():
            meaning = f"rms of twin minus measured {signal} over the floor" + (f", in {regime}" if regime else "")
            specs.append(OutputSpec(name, DataType.DOUBLE, None, meaning, inferred, 0.05, of_challenger=not regime))
        meaning = f"mean of twin minus measured {signal}"
        deadband = RESOLUTIONS[signal] / 10.0
        specs.append(
            OutputSpec(f"{GAP}{signal}/mean", DataType.DOUBLE, UNITS[signal], meaning, inferred, deadband, of_challenger=True)
        )
    texts = {
        GROWING_SIGNAL: "which gap grows: signal, regime, since when",
        FINDINGS: "JSON: the gaps that grow in values: signal, regime, way, amount, unit, since when",
        OPEN: "which gaps stand open though none grew: signal, regime, mean in floors, since when",
        WINDOW: "recorded stretch in which the growing gap was largest, UTC start/end: what to diagnose",
    }
    growing = OutputSpec(GROWING, DataType.BOOLEAN, None, "whether the gap of a signal grows", inferred, is_alarm=True)
    left_out = "share of the time in which nothing was compared: tool changes, settling, unknown inputs"
    return (
        *specs,
        growing,
        *(OutputSpec(name, DataType.STRING, None, meaning, inferred) for name, meaning in texts.items()),
        OutputSpec(BASIS, DataType.STRING, None, "what the gap rests on", inferred, of_challenger=True),
        OutputSpec(LEFT_OUT, DataType.DOUBLE, "%", left_out, inferred, 1.0),
    )


PROCESSOR = Processor(
    name="gap",
    version=2,
    inputs=INPUTS,
    outputs=_specs(),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
    described=described,
    beside=lambda state: state,
)
