"""A processor that only writes down what it is given: what the engine does can be read from it."""

from collections.abc import Sequence
from dataclasses import dataclass

from processors.config import ProcessorConfig
from processors.contract import Output, OutputSpec, PlainOutput, PlainSpec, Processor, Provenance, Sample, SampleKind
from sparkplug.datatype import DataType
from tests.processors.streams import T0_MS


class Config(ProcessorConfig):
    """`fail_at`: a value of `spindle_rpm` at which the step fails; `emit`: what it emits then."""

    fail_at: float = -1.0


@dataclass(frozen=True, slots=True)
class State:
    """All samples so far, as (kind, seconds after the start, names, spindle_rpm)."""

    log: tuple[tuple[str, float, tuple[str, ...], float | None], ...] = ()


def step(config: Config, state: State, sample: Sample) -> tuple[State, Sequence[Output | PlainOutput]]:
    """Write the sample down; emit how many there were, an alarm, and what a test asks for by a value."""
    rpm, _ = sample.number("spindle_rpm")
    if rpm == config.fail_at:
        raise ZeroDivisionError("as asked")
    line = (sample.kind.value, round(sample.at_s - T0_MS / 1000, 3), sample.changed, rpm)
    state = State((*state.log, line))
    if rpm == 666.0:
        return state, [Output("twin/undeclared", 1.0)]
    if rpm == 777.0:
        return state, [Output("twin/count", "seven")]
    if rpm == 888.0:
        return state, [Output("twin/level", float("inf"))]
    if rpm == 999.0:
        return state, [PlainOutput("elsewhere/x", b"")]
    if sample.kind is SampleKind.TICK:
        return state, []
    return state, [Output("twin/count", len(state.log)), Output("twin/alarm", True), Output("twin/level", rpm or 0.0)]


RECORDER = Processor(
    name="recorder",
    version=1,
    inputs=frozenset({"spindle_rpm", "spindle_load_pct"}),
    outputs=(
        OutputSpec("twin/count", DataType.INT64, None, "samples so far", Provenance.MEASURED),
        OutputSpec("twin/alarm", DataType.BOOLEAN, None, "always", Provenance.INFERRED, is_alarm=True),
        OutputSpec("twin/level", DataType.DOUBLE, "rev/min", "speed", Provenance.MEASURED, deadband=5.0),
    ),
    plain=(PlainSpec("recorder/", "nothing"),),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
)
