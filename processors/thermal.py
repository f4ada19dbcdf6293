"""Spindle temperature: the simulator's heat, driven by speed and load, and how far the measured temperature is from it.

    C dT/dt = alpha · load · rpm² + beta · rpm − (T − T_ambient) / R          (twin/live/heat.py)

with every effect on heat and on the sensor that the machine's description has. Where the ambient temperature has never been
known, temperatures are counted from it: the rise goes on, only the absolute temperature is null then. Inputs are held between
messages. Where speed or load is unknown for a while, the estimate is null and bridges the time with the last known heat; after
gap_s_max of that, or of silence, it starts again, and `twin/spindle_temp_basis` says from what. Another description takes the
heat over.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from pydantic import Field, NonNegativeFloat, PositiveFloat

from processors.config import ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.description import Description, in_words
from sparkplug.datatype import DataType
from sparkplug.quality import Quality
from twin.live.assumed import THERMAL, assumed_of, completed
from twin.live.heat import HeatInput, HeatState, LiveHeat
from twin.machine import Machine, MachineFile, Thermal
from twin.vocabulary import twin_signals
from twin.vocabulary.bounds import SPINDLE_LOAD_PCT_MAX, SPINDLE_RPM_MAX

SPEED, LOAD, AMBIENT, MEASURED = "spindle_rpm", "spindle_load_pct", "ambient_temp_c", "spindle_temp_c"
COOLANT = "coolant_on"
TEMPERATURE, RESIDUAL = twin_signals.SPINDLE_TEMP_C, twin_signals.SPINDLE_TEMP_RESIDUAL_K
_NOT_YET = "no speed and load yet"
_TICK, _HOLE = SampleKind.TICK, SampleKind.HOLE
RISE, BASIS = twin_signals.SPINDLE_TEMP_RISE_K, twin_signals.SPINDLE_TEMP_BASIS
CONSTANTS = tuple(Thermal.model_fields)


class Config(ProcessorConfig):
    """The ambient temperature where no signal tells it; and, of old, the four constants of a machine that has no description."""

    of_the_machine: ClassVar[Mapping[str, str]] = dict.fromkeys(CONSTANTS, "[thermal]")

    ambient_temp_c: float | None = Field(default=None, ge=-50.0, le=80.0)
    alpha_w_per_pct_rpm2: NonNegativeFloat | None = None
    beta_w_per_rpm: NonNegativeFloat | None = None
    resistance_k_per_w: PositiveFloat | None = None
    capacity_j_per_k: PositiveFloat | None = None

    @property
    def machine(self) -> MachineFile:
        """The machine by these constants, as far as they go, and marked as assumed where they don't."""
        given = {name: value for name in CONSTANTS if (value := getattr(self, name)) is not None}
        assumed = tuple(f"thermal.{name}" for name in CONSTANTS if name not in given)
        return MachineFile(machine=Machine(name="as configured", assumed=assumed), thermal=THERMAL.model_copy(update=given))


@dataclass(frozen=True, slots=True, eq=False)
class Described:
    """The heat of a machine, as the step is given it. version: of its description, empty where there is none; words: its basis"""

    config: Config
    machine: MachineFile
    heat: LiveHeat
    version: str
    words: str


def described(config: Config, description: Description | None) -> Described:
    """Return the heat of a machine by its description, else by the old constants, else by those that are assumed."""
    machine = config.machine if description is None else completed(description.machine, "thermal")
    heat = LiveHeat.of(machine)
    assumed = assumed_of(machine, "thermal", CONSTANTS)
    said = [] if description is None else [in_words(description.version)]
    if assumed:
        said.append(f"{'heat constants' if len(assumed) == len(CONSTANTS) else ', '.join(assumed)} assumed")
    words = "; ".join((*said, *heat.in_words))
    return Described(config, machine, heat, "" if description is None else description.version, words)


@dataclass(frozen=True, slots=True)
class State:
    """The estimate as of `at_s`, with the inputs that have been held since.

    at_s: None while there is no estimate; `why_not` says why. Constant inputs need no new state between ticks.
    told: the inputs; its ambient is 0 where the true one has never been known, and temperatures are counted from that
    ambient_c: the true one, None = never known; blind_since_s: speed or load is unknown since then; `why_blind` says which
    version: of the description that the heat was stepped with last
    """

    at_s: float | None = None
    heat: HeatState | None = None
    told: HeatInput | None = None
    ambient_c: float | None = None
    blind_since_s: float | None = None
    why_blind: str = ""
    why_not: str = _NOT_YET
    started_from: str = ""
    version: str = ""

    @property
    def rise_k(self) -> float:
        """The rise of the spindle over ambient; 0 while there is no estimate."""
        return 0.0 if self.heat is None or self.told is None else self.heat.temperature_c - self.told.ambient_c


def step(given: Described, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Advance the estimate to the sample, then take over its inputs. Publishes at ticks, and at a hole."""
    if state.version != given.version:
        state = _taken_over(given, state)
    if sample.kind is _TICK:
        if state.at_s is None:
            # Time goes on again after a hole. A value that was not sent again has not changed: start from what is known.
            state = _with_inputs(given, state, sample)
        state = _advanced(given.heat, state, sample.at_s)
        return state, _outputs(given, state, sample)
    if sample.kind is _HOLE:
        state = _with_inputs(given, _over_hole(given, state, sample), sample)
        return state, _outputs(given, state, sample)
    return _with_inputs(given, state, sample), ()


def _taken_over(given: Described, state: State) -> State:
    """The state that another description has left behind: the heat in the spindle stays."""
    if state.heat is None or state.told is None:
        return replace(state, version=given.version)
    return replace(state, heat=given.heat.continued(state.heat, state.told), version=given.version)


def _advanced(heat: LiveHeat, state: State, at_s: float) -> State:
    """The state at `at_s`, with the inputs held."""
    if state.at_s is None or at_s <= state.at_s or state.heat is None or state.told is None:
        return state
    stepped = heat.step(state.heat, state.told, at_s - state.at_s)
    # Spelled out, since this is the hot path, and `replace` looks up each field.
    return State(
        at_s,
        stepped,
        state.told,
        state.ambient_c,
        state.blind_since_s,
        state.why_blind,
        "",
        state.started_from,
        state.version,
    )


def _over_hole(given: Described, state: State, sample: Sample) -> State:
    """A long hole ends the estimate; over a short one it goes on, also where the clock was set back a little."""
    if sample.gap_s >= given.config.gap_s_max:
        return State(why_not=sample.detail, version=given.version)
    if state.at_s is not None and sample.at_s < state.at_s:
        return replace(state, at_s=sample.at_s, blind_since_s=None if state.blind_since_s is None else sample.at_s)
    return _advanced(given.heat, state, sample.at_s)


def _with_inputs(given: Described, state: State, sample: Sample) -> State:
    """The state with the inputs of this sample, advanced to it where they differ from those held."""
    ambient_c = sample.number(AMBIENT)[0] if AMBIENT in sample.row else None
    if ambient_c is None:
        ambient_c = given.config.ambient_temp_c
    if ambient_c is None:
        ambient_c = state.ambient_c  # kept for the day that it is known again
    told, why_blind = _told(given.heat, sample, ambient_c)
    if told is None:
        return _blind(given, state, sample, why_blind)
    if state.blind_since_s is not None and sample.at_s - state.blind_since_s > given.config.gap_s_max:
        state = State(why_not=state.why_blind, version=given.version)
    if state.heat is None or state.told is None or state.at_s is None:
        # A hole only ends an estimate: what the row holds then is from before it.
        over = sample.kind in (SampleKind.HOLE, SampleKind.DEATH)
        return state if over else _started(given, sample, told, ambient_c)
    if told == state.told and ambient_c == state.ambient_c and state.blind_since_s is None:
        return state
    heat, at_s = state.heat, state.at_s
    if sample.at_s > at_s:
        heat, at_s = given.heat.step(heat, state.told, sample.at_s - at_s), sample.at_s
    if state.ambient_c is None and ambient_c is not None:
        heat = given.heat.shifted(heat, ambient_c)
    return State(at_s, heat, told, ambient_c, None, "", _NOT_YET, state.started_from, state.version)


def _blind(given: Described, state: State, sample: Sample, why_blind: str) -> State:
    """The state while speed or load is unknown."""
    if state.at_s is None:
        known = sample.kind in (SampleKind.HOLE, SampleKind.DEATH) or state.why_not == why_blind
        return state if known else replace(state, why_not=why_blind)
    if state.blind_since_s is not None and state.why_blind == why_blind:
        return state
    since_s = sample.at_s if state.blind_since_s is None else state.blind_since_s
    return replace(_advanced(given.heat, state, sample.at_s), blind_since_s=since_s, why_blind=why_blind)


def _started(given: Described, sample: Sample, told: HeatInput, ambient_c: float | None) -> State:
    measured_c, _ = sample.number(MEASURED)
    heat = None if measured_c is None or ambient_c is None else given.heat.started_at_reading(measured_c, told)
    started_from = "the measured temperature"
    if heat is None:
        heat = given.heat.started(told.ambient_c, told)
        started_from = "ambient (an assumption: no measured temperature to start from)"
    return State(sample.at_s, heat, told, ambient_c, started_from=started_from, version=given.version)


def _told(heat: LiveHeat, sample: Sample, ambient_c: float | None) -> tuple[HeatInput | None, str]:
    """The inputs of this sample; None with the reason where one that there has to be is unknown."""
    rpm, no_rpm = sample.number(SPEED)
    load_pct, no_load = sample.number(LOAD)
    if rpm is None or load_pct is None:
        return None, no_rpm or no_load or ""
    if abs(rpm) > SPINDLE_RPM_MAX or abs(load_pct) > SPINDLE_LOAD_PCT_MAX:
        return None, f"{SPEED} or {LOAD} is beyond any spindle"
    if ambient_c is None and heat.needs_ambient:
        return None, f"{AMBIENT} is not known, and a learned term of the machine is over the temperature itself"
    coolant = 1.0 if heat.needs_coolant and is_on(sample) else 0.0
    return tuple.__new__(HeatInput, (load_pct, rpm, 0.0 if ambient_c is None else ambient_c, coolant)), ""


def is_on(sample: Sample) -> bool | None:
    """Return True while the coolant is told to be on; None where nobody tells."""
    reading = sample.row.get(COOLANT)
    return reading.value if reading is not None and isinstance(reading.value, bool) and reading.quality is Quality.GOOD else None


def _ambient(config: Config, sample: Sample) -> tuple[float | None, str]:
    """The ambient temperature and where it is from; None with the reason."""
    measured_c, reason = sample.number(AMBIENT)
    if measured_c is not None:
        return measured_c, "measured"
    if config.ambient_temp_c is not None:
        return config.ambient_temp_c, "configured"
    return None, f"{reason}, and no ambient temperature is configured"


def _outputs(given: Described, state: State, sample: Sample) -> tuple[Output, ...]:
    why_not = state.why_not if state.at_s is None else state.why_blind if state.blind_since_s is not None else None
    if why_not is not None or state.heat is None or state.told is None:
        return tuple(Output.null(name, why_not or "") for name in (TEMPERATURE, RESIDUAL, RISE, BASIS))
    ambient_c, origin = _ambient(given.config, sample)
    rise = Output(RISE, round(state.rise_k, 3))
    said = [f"started from {state.started_from}", f"ambient {'unknown' if ambient_c is None else origin}"]
    if given.heat.needs_coolant and is_on(sample) is None:
        said.append(f"{COOLANT} is not told, and taken to be off")
    basis = Output(BASIS, "; ".join((*said, given.words) if given.words else said))
    if ambient_c is None:
        return Output.null(TEMPERATURE, origin), Output.null(RESIDUAL, origin), rise, basis
    shown_c = given.heat.reading(state.heat, state.told)
    measured_c, no_measured = sample.number(MEASURED)
    if measured_c is None:
        residual = Output.null(RESIDUAL, no_measured or "")
    else:
        residual = Output(RESIDUAL, round(measured_c - shown_c, 3))
    return Output(TEMPERATURE, round(shown_c, 3)), residual, rise, basis


_DOUBLE, _MODELLED, _INFERRED = DataType.DOUBLE, Provenance.MODELLED, Provenance.INFERRED
PROCESSOR = Processor(
    name="thermal",
    version=2,
    inputs=frozenset({SPEED, LOAD, AMBIENT, MEASURED, COOLANT}),
    outputs=(
        OutputSpec(
            TEMPERATURE, _DOUBLE, "°C", "modelled reading of the spindle temperature", _MODELLED, 0.05, of_challenger=True
        ),
        OutputSpec(RESIDUAL, _DOUBLE, "K", "measured minus modelled spindle temperature", _INFERRED, 0.05, of_challenger=True),
        OutputSpec(RISE, _DOUBLE, "K", "modelled rise of the spindle over ambient", _MODELLED, 0.05, of_challenger=True),
        OutputSpec(
            BASIS, DataType.STRING, None, "what the estimate rests on: start, ambient, constants", _INFERRED, of_challenger=True
        ),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
    described=described,
)
