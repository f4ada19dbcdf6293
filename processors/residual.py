"""The error of the physics of the spindle's temperature: a correction learned from recordings of the machine.

    corrected = twin/spindle_temp_c + forest(speed, load, …)          (twin.residual)

Only inside the region that the forest was trained on; outside the correction is null and says why. Whether it is of use is said
all the time: `twin/residual_gain_pct` compares the errors of both on what came since. What the physics alone is off by stays what
the processor `thermal` publishes as `twin/spindle_temp_residual_k`; it is not touched.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from pydantic import Field

from processors.config import Configuration, ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.description import Description
from sparkplug.datatype import DataType
from twin.errors import TwinError
from twin.live.assumed import completed
from twin.residual.features import AMBIENT, MEASURED, PHYSICS, SIGNALS, Memory, row_after, signals_of
from twin.residual.physics import Physics
from twin.vocabulary import twin_signals

if TYPE_CHECKING:
    from twin.residual.model import ResidualModel

CORRECTION, CORRECTED = twin_signals.SPINDLE_TEMP_CORRECTION_K, twin_signals.SPINDLE_TEMP_CORRECTED_C
LEFT, IN_REGION = twin_signals.SPINDLE_TEMP_CORRECTED_RESIDUAL_K, "twin/residual_in_region"
GAIN, BASIS = "twin/residual_gain_pct", twin_signals.RESIDUAL_BASIS
NO_MODEL = "no model; cnctwin train residual --machine … --out … makes one, [residual] models names its folder"
ANEW = "cnctwin train residual makes one for it"
BEYOND = 1e6
"""No signal of a machine is larger."""


class Config(ProcessorConfig):
    """models: folder with one model for each machine, by name; "" = none: every correction is null then, and says so."""

    of_one_machine: ClassVar[frozenset[str] | None] = frozenset({"ambient_temp_c", "gain_over_s", "gain_min_s"})

    models: str = ""
    ambient_temp_c: float | None = Field(default=None, ge=-50.0, le=80.0)
    gain_over_s: float = Field(default=86_400.0, gt=0.0, le=31_536_000.0)
    gain_min_s: float = Field(default=3600.0, ge=0.0, le=604_800.0)


def read_models(configuration: Configuration[Config]) -> "Mapping[str, ResidualModel]":
    """Return the models in the configured folder by machine. Raises ValueError where one cannot be read."""
    folder = configuration.default.models
    if not folder:
        return {}
    try:
        from twin.residual.model import load_models  # noqa: PLC0415  numpy comes with it
    except ImportError as error:
        raise ValueError(f"a correction needs {error.name}: pip install 'cnctwin[twin]'") from error
    return load_models(Path(folder))


@dataclass(frozen=True, slots=True, eq=False)
class Described:
    """The means of the step: the configuration with the models, and the heat of the machine's description, None without one."""

    configuration: Configuration[Config]
    physics: Physics | None
    version: str = ""

    def why_not(self, model: "ResidualModel") -> str | None:
        """Return why a model corrects another physics than the live one; None where it corrects this one."""
        own = model.trained.physics
        if self.physics is None:
            if not own.description:
                return None
            return f"model {model.version} corrects description {own.description}, and the machine has none; {ANEW}"
        if own.is_as(self.physics):
            return None
        of = f"description {own.description}" if own.description else "constants of the configuration"
        return f"model {model.version} corrects {of}, the live description is {self.version}; {ANEW}"


def described(configuration: Configuration[Config], description: Description | None) -> Described:
    """Return the configuration with the heat that the machine is described by."""
    if description is None:
        return Described(configuration, None)
    physics = Physics.of(completed(description.machine, "thermal"), description=description.version)
    return Described(configuration, physics, description.version)


@dataclass(frozen=True, slots=True)
class Gain:
    """Errors since, forgotten slowly: sums of squares over time, K² s, of the physics and of the corrected; seconds of both."""

    physics_k2_s: float = 0.0
    corrected_k2_s: float = 0.0
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class State:
    """version: of the model that `memory` and `gain` belong to; another begins again."""

    version: str = ""
    memory: Memory = field(default_factory=Memory)
    gain: Gain = field(default_factory=Gain)


def step(given: Described, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Correct the physics at ticks; forget the means at a long hole."""
    config = given.configuration.of(sample.machine)
    model: ResidualModel | None = given.configuration.read.get(sample.machine)
    if model is None:
        return state, _UNKNOWN_WITHOUT_MODEL if sample.kind in (SampleKind.TICK, SampleKind.BIRTH) else ()
    if (why_not := given.why_not(model)) is not None:
        return State(), Output.nulls(_ALL, why_not) if sample.kind in (SampleKind.TICK, SampleKind.BIRTH) else ()
    if state.version != model.version:
        state = State(model.version)
    if sample.kind is SampleKind.HOLE:
        return replace(state, memory=_over_hole(config, state.memory, sample)), ()
    if sample.kind is not SampleKind.TICK:
        return state, ()
    now = _known(config, model, sample)
    if isinstance(now, str):
        return state, (*Output.nulls(_ALL[:4], now), _gain(config, state.gain), Output(BASIS, model.in_words))
    memory = state.memory
    if memory.at_s is not None and sample.at_s - memory.at_s >= config.gap_s_max:
        memory = Memory()
    memory, row = row_after(model.features, memory, now, sample.at_s)
    try:
        correction_k = model.correction_one(row)
    except TwinError as error:
        correction_k = str(error)
    if isinstance(correction_k, str):
        outputs = (*Output.nulls(_ALL[:3], correction_k), Output(IN_REGION, False), _gain(config, state.gain))
        return replace(state, memory=memory), (*outputs, Output(BASIS, model.in_words))
    corrected_c = now[PHYSICS] + correction_k
    measured_c, no_measured = sample.number(MEASURED)
    gain, left = state.gain, Output.null(LEFT, no_measured or "")
    if measured_c is not None:
        left = Output(LEFT, round(measured_c - corrected_c, 3))
        gain = _gained(config, gain, measured_c - now[PHYSICS], measured_c - corrected_c)
    outputs = (
        Output(CORRECTION, round(correction_k, 3)),
        Output(CORRECTED, round(corrected_c, 3)),
        left,
        Output(IN_REGION, True),
    )
    return State(state.version, memory, gain), (*outputs, _gain(config, gain), Output(BASIS, model.in_words))


def _over_hole(config: Config, memory: Memory, sample: Sample) -> Memory:
    """A long hole ends the physics' estimate, and what is remembered of it; over a short one the clock may have been set back."""
    if sample.gap_s >= config.gap_s_max or memory.at_s is None:
        return Memory()
    return replace(memory, at_s=min(memory.at_s, sample.at_s))


def _known(config: Config, model: "ResidualModel", sample: Sample) -> dict[str, float] | str:
    """The signals that the model and the correction need; else which of them is unknown, and why."""
    now: dict[str, float] = {}
    for name in dict.fromkeys((*signals_of(model.features), PHYSICS)):
        value, why = sample.number(name)
        if value is None and name == AMBIENT and config.ambient_temp_c is not None:
            value = config.ambient_temp_c
        if value is None:
            return why or f"{name} is unknown"
        if not abs(value) <= BEYOND:
            return f"{name} is beyond any machine"
        now[name] = value
    return now


def _gained(config: Config, gain: Gain, physics_k: float, corrected_k: float) -> Gain:
    """The gain with the errors of one more tick."""
    kept = math.exp(-config.tick_s / config.gain_over_s)
    return Gain(
        gain.physics_k2_s * kept + min(physics_k**2, BEYOND) * config.tick_s,
        gain.corrected_k2_s * kept + min(corrected_k**2, BEYOND) * config.tick_s,
        gain.seconds * kept + config.tick_s,
    )


def _gain(config: Config, gain: Gain) -> Output:
    """Return how much smaller the error is than that of the physics alone, in the region, of late."""
    if gain.seconds < min(config.gain_min_s, 0.9 * config.gain_over_s):
        return Output.null(GAIN, f"less than {config.gain_min_s:g} s seen in the region yet")
    if gain.physics_k2_s <= 0.0:
        return Output.null(GAIN, "the physics has no error")
    return Output(GAIN, round(100.0 * max(1.0 - math.sqrt(gain.corrected_k2_s / gain.physics_k2_s), -10.0), 1))


_ALL = (CORRECTION, CORRECTED, LEFT, IN_REGION, GAIN, BASIS)
_UNKNOWN_WITHOUT_MODEL = Output.nulls(_ALL, NO_MODEL)

_DOUBLE, _MODELLED, _INFERRED = DataType.DOUBLE, Provenance.MODELLED, Provenance.INFERRED
PROCESSOR = Processor(
    name="residual",
    version=1,
    inputs=frozenset({*SIGNALS, MEASURED}),
    outputs=(
        OutputSpec(CORRECTION, _DOUBLE, "K", "what a forest adds to the modelled spindle temperature", _MODELLED, 0.02),
        OutputSpec(CORRECTED, _DOUBLE, "°C", "spindle temperature by the physics and the correction", _MODELLED, 0.05),
        OutputSpec(LEFT, _DOUBLE, "K", "measured minus corrected spindle temperature", _INFERRED, 0.05),
        OutputSpec(IN_REGION, DataType.BOOLEAN, None, "the machine does what the forest was trained on", _INFERRED),
        OutputSpec(GAIN, _DOUBLE, "%", "1 − RMSE corrected / RMSE of the physics, of late, in the region", _INFERRED, 0.5),
        OutputSpec(BASIS, DataType.STRING, None, "the model, what it was trained on, its gain on held-out time", _INFERRED),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
    wakes=frozenset(),
    reads=read_models,
    described=described,
)
