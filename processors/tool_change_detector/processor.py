"""Tool changes of a control that reports none, recognised by what the spindle's drive does (`twin/transient`).

The signal of the model is sampled at ticks, held between reports. Where its beginning looks like that of a change, the gate opens
provisionally; the whole pattern confirms it; without an end in time it is retracted. Feed and block number are taken into account
where the model has weights for them and the control tells them. Without a model, without its signal, or too soon after a hole to
have seen a whole change, the answer is null with the reason, never "no".

A control that reports `tool_change_active` itself is believed first by those who read both; this goes on beside it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from pydantic import Field, PlainSerializer, PlainValidator

from processors.config import MACHINES, Configuration, ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.errors import ConfigurationError
from sparkplug.datatype import DataType
from sparkplug.quality import Quality
from twin.vocabulary.twin_signals import TOOL_CHANGE_ACTIVE, TWIN_PREFIX

if TYPE_CHECKING:
    from twin.transient.detector import Detector
    from twin.transient.detector import State as Search

ACTIVE, SOURCE = TOOL_CHANGE_ACTIVE, f"{TWIN_PREFIX}tool_change_source"
CONFIDENCE, PHASE = f"{TWIN_PREFIX}tool_change_confidence", f"{TWIN_PREFIX}tool_change_phase"
BASIS = f"{TWIN_PREFIX}tool_change_detector_basis"
SIGNALS = ("spindle_rpm", "spindle_current_a", "spindle_load_pct")
FEED, LINE, BLOCK, REPORTED = "feed_mm_min", "nc_line", "nc_block", "tool_change_active"
RESTING_MM_MIN = 10.0
UNKNOWN = -1.0
NO_MODEL = "no model is configured: learn one from a captured change with `cnctwin train detector`"
TOLD_S = 1.0
OTHERS = ""
BLOCK_CHARACTERS_MAX = 200


class Config(ProcessorConfig):
    """The model and its thresholds. tick_s has to go into its sample period a whole number of times."""

    tick_s: float = Field(default=0.1, ge=0.001, le=3600.0, description="the model's sample period, or a whole part of it")
    model: Path | None = None
    shown_s: float = Field(default=2.0, gt=0.0, le=60.0)
    pattern_score: float | None = Field(default=None, ge=0.0, lt=1.0, description="in place of the model's, by the signal alone")
    opens_early: bool = Field(default=True, description="whether the gate opens on the beginning alone")


class Model(NamedTuple):
    """A detector, the mark by which it is told from another, and the ticks for each of its samples."""

    detector: "Detector"
    mark: str
    ticks_of_sample: int


def read_models(configuration: Configuration[Config]) -> "Mapping[str, Model | None]":
    """Return the models by machine; that of the machines without values of their own is named OTHERS.

    Raises ValueError, and ConfigurationError that names the machine, where a model cannot be read or does not fit.
    """
    models = {OTHERS: _model_of(configuration.default)}
    for machine in configuration.machines:
        try:
            models[machine] = _model_of(configuration.of(machine))
        except ValueError as error:
            raise ConfigurationError(f"[tool_change_detector.{MACHINES}.{machine}] {error}") from error
    return models


def _model_of(config: Config) -> Model | None:
    if config.model is None:
        return None
    try:
        from twin.transient.artefact import load_detector  # noqa: PLC0415 - a light install has no arrays
    except ImportError as error:
        raise ValueError(f"a model needs {error.name}, which is not installed: pip install 'cnctwin[twin]'") from None

    detector, mark = load_detector(config.model)
    detector = replace(detector, shown_s=config.shown_s)
    if config.pattern_score is not None:
        detector = detector.with_score(config.pattern_score)
    detector.warmed_up()
    period_s = detector.template.period_s
    ticks = round(period_s / config.tick_s)
    if ticks < 1 or abs(ticks * config.tick_s - period_s) > 1e-6 * period_s:
        raise ValueError(
            f"tick_s {config.tick_s:g} does not go into the sample period {period_s:g} s of {config.model}: set it so"
        )
    return Model(detector, mark, ticks)


def _dumped(search: "Search | None") -> Any:
    if search is None:
        return None
    history = search.history
    kept = [[int(value) for value in row] for row in history.kept()]
    return {"length": history.length, "seen": history.seen, "kept": kept, "gate": list(search.gate)}


def _restored(dumped: Any) -> "Search | None":
    if dumped is None or not isinstance(dumped, dict):
        return dumped
    from twin.transient.detector import restored  # noqa: PLC0415 - a light install has no arrays

    return restored(dumped["kept"], dumped["length"], dumped["seen"], dumped["gate"])


@dataclass(frozen=True, slots=True)
class State:
    """The search as of the last tick, and the samples of one of its periods.

    mark: of the model that it belongs to; total, ticks: of the period that is being averaged
    feed_rest, block_stand: run lengths in the model's samples; block: that is being executed; told: what was published last
    """

    search: Annotated[Any, PlainSerializer(_dumped), PlainValidator(_restored)] = None
    mark: str = ""
    total: float = 0.0
    ticks: int = 0
    feed_rest: float = UNKNOWN
    block_stand: float = UNKNOWN
    block: str | None = None
    why_not: str = ""
    told: str = ""
    told_s: float = 0.0


def step(configuration: Configuration[Config], state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Sample at ticks; what a hole or a death leaves behind is not a stream."""
    read, config = configuration.read, configuration.of(sample.machine)
    model: Model | None = read.get(sample.machine, read.get(OTHERS))
    if model is None:
        return (state, _UNKNOWN_WITHOUT_MODEL) if sample.kind is not SampleKind.DATA else (state, ())
    if sample.kind is SampleKind.TICK:
        return _told(config, model.detector, _ticked(model, state, sample), sample)
    if sample.kind is SampleKind.HOLE:
        return _told(config, model.detector, State(why_not=sample.detail or "messages were lost"), sample)
    if sample.kind is SampleKind.DATA:
        return state, ()
    _, missing = sample.number(model.detector.signal)
    if sample.kind is SampleKind.DEATH and missing:
        state = State(why_not=missing)  # there are no ticks until it comes back: what goes on is not seen
    return _told(config, model.detector, replace(state, told=""), sample)


def _ticked(model: Model, state: State, sample: Sample) -> State:
    """The state after a tick."""
    detector, mark, ticks_of_sample = model
    value, why_not = sample.number(detector.signal)
    if value is None:
        return State(why_not=why_not or "", told=state.told, told_s=state.told_s)
    if state.mark != mark or state.search is None:
        state = State(detector.begun(), mark, why_not=state.why_not, told=state.told, told_s=state.told_s)
    search, _, total, ticks, feed_rest, block_stand, block, why_not, told, told_s = _fields(state)
    total, ticks = total + value, ticks + 1
    if ticks < ticks_of_sample:
        return State(search, mark, total, ticks, feed_rest, block_stand, block, why_not, told, told_s)
    feed, _ = sample.number(FEED)
    feed_rest = UNKNOWN if feed is None else max(feed_rest, 0.0) + 1.0 if abs(feed) < RESTING_MM_MIN else 0.0
    now = _block(sample)
    block_stand = UNKNOWN if now is None else max(block_stand, 0.0) + 1.0 if now == block else 0.0
    search, _ = detector.advanced(search, total / ticks, feed_rest, block_stand)
    return State(search, mark, 0.0, 0, feed_rest, block_stand, now, why_not, told, told_s)


def _fields(state: State) -> tuple[Any, str, float, int, float, float, str | None, str, str, float]:
    return (
        state.search, state.mark, state.total, state.ticks, state.feed_rest, state.block_stand, state.block, state.why_not,
        state.told, state.told_s,
    )  # fmt: skip


def _block(sample: Sample) -> str | None:
    """Return what is executed now: the line, else the text of the block; None where neither is known."""
    for name in (LINE, BLOCK):
        reading = sample.row.get(name)
        if reading is not None and reading.quality is Quality.GOOD and isinstance(reading.value, int | float | str):
            return str(reading.value)[:BLOCK_CHARACTERS_MAX]
    return None


def _told(config: Config, detector: "Detector", state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """The outputs where they differ from those before, and once a second."""
    search: Search | None = state.search
    gate = None if search is None else search.gate
    key = state.why_not if gate is None else "none" if not gate.until else f"{gate.phase.value} {gate.confidence:.2f}"
    if key == state.told and 0.0 <= sample.at_s - state.told_s < TOLD_S:
        return state, ()
    return replace(state, told=key, told_s=sample.at_s), _outputs(config, detector, search, state, sample)


def _outputs(config: Config, detector: "Detector", search: "Search | None", state: State, sample: Sample) -> Sequence[Output]:
    _, missing = sample.number(detector.signal)
    if search is None or missing:
        reading = sample.row.get(detector.signal)
        source = "stale" if reading is not None and reading.quality is Quality.STALE else "none"
        return _nulls(source, missing or state.why_not or f"{detector.signal} has not been seen yet")
    phase = search.gate.phase
    is_active = phase == "confirmed" or (phase == "provisional" and config.opens_early)
    if phase not in ("provisional", "confirmed") and search.history.seen < detector.samples_min:
        begun = f"; {state.why_not}" if state.why_not else ""
        return _nulls(
            "none", f"{detector.signal} was seen for less than the {detector.template.seconds:.3g} s of a change{begun}"
        )
    return (
        Output(ACTIVE, is_active),
        Output(SOURCE, "detector"),
        Output(CONFIDENCE, round(search.gate.confidence, 3)),
        Output(PHASE, str(phase.value)),
        Output(BASIS, _basis(detector, sample)),
    )


def _basis(detector: "Detector", sample: Sample) -> str:
    """Return the basis of the answer."""
    limits = detector.limits
    parts = [f"{detector.signal}: two-part matched filter, pattern from a score of {limits.pattern_score:.2f}"]
    if detector.weighing is not None:
        _, no_feed = sample.number(FEED)
        has_block = _block(sample) is not None
        parts.append("feed and block weighed" if has_block and not no_feed else f"signal alone: {no_feed or 'no block reported'}")
    reported = sample.row.get(REPORTED)
    if reported is not None and reported.quality is Quality.GOOD and isinstance(reported.value, bool):
        parts.append(f"the control itself reports {REPORTED}")
    return "; ".join(parts)


def _nulls(source: str, reason: str) -> tuple[Output, ...]:
    named = (ACTIVE, CONFIDENCE, PHASE)
    return *(Output.null(name, reason) for name in named), Output(SOURCE, source), Output(BASIS, f"none: {reason}")


_UNKNOWN_WITHOUT_MODEL = _nulls("none", NO_MODEL)

_INFERRED = Provenance.INFERRED
PROCESSOR = Processor(
    name="tool_change_detector",
    version=1,
    inputs=frozenset({*SIGNALS, FEED, LINE, BLOCK, REPORTED}),
    outputs=(
        OutputSpec(ACTIVE, DataType.BOOLEAN, None, "whether a tool change is going on, by the drive's signal", _INFERRED),
        OutputSpec(SOURCE, DataType.STRING, None, "who says so: detector; none or stale where it can say nothing", _INFERRED),
        OutputSpec(
            CONFIDENCE,
            DataType.DOUBLE,
            None,
            "likeness to the pattern; with feed and block weighed, probability",
            _INFERRED,
            0.01,
        ),
        OutputSpec(PHASE, DataType.STRING, None, "none, provisional, confirmed or retracted", _INFERRED),
        OutputSpec(BASIS, DataType.STRING, None, "what the detection rests on", _INFERRED),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
    wakes=frozenset(),
    reads=read_models,
)
