"""Spindle temperature: a lumped RC network driven by speed and load, and how far the measured temperature is from it.

    C dT/dt = alpha · load · rpm² + beta · rpm − (T − T_ambient) / R          (twin.thermal)

The model runs on the rise over ambient, so it goes on where the ambient temperature is not known; only the absolute temperature
is null then. Inputs are held between messages. Where speed or load is unknown for a while, the estimate is null and bridges the
time with the last known heat; after gap_s_max of that, or of silence, it starts anew, and `twin/spindle_temp_basis` says from
what.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from pydantic import Field

from processors.config import ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from sparkplug.datatype import DataType
from twin.thermal import ThermalNetwork, heat_input_w, rise_after
from twin.vocabulary import twin_signals
from twin.vocabulary.bounds import SPINDLE_LOAD_PCT_MAX, SPINDLE_RPM_MAX

SPEED, LOAD, AMBIENT, MEASURED = "spindle_rpm", "spindle_load_pct", "ambient_temp_c", "spindle_temp_c"
TEMPERATURE, RESIDUAL = twin_signals.SPINDLE_TEMP_C, twin_signals.SPINDLE_TEMP_RESIDUAL_K
_NOT_YET = "no speed and load yet"
_TICK, _HOLE = SampleKind.TICK, SampleKind.HOLE
RISE, BASIS = twin_signals.SPINDLE_TEMP_RISE_K, twin_signals.SPINDLE_TEMP_BASIS


class Config(ProcessorConfig):
    """The four constants of the network, and the ambient temperature where no signal tells it."""

    alpha_w_per_pct_rpm2: float = Field(default=1.8e-8, ge=0.0)
    beta_w_per_rpm: float = Field(default=1.2e-3, ge=0.0)
    resistance_k_per_w: float = Field(default=0.18, gt=0.0)
    capacity_j_per_k: float = Field(default=14_500.0, gt=0.0)
    ambient_temp_c: float | None = Field(default=None, ge=-50.0, le=80.0)

    @cached_property
    def network(self) -> ThermalNetwork:
        """The constants as the physics takes them."""
        return ThermalNetwork(self.alpha_w_per_pct_rpm2, self.beta_w_per_rpm, self.resistance_k_per_w, self.capacity_j_per_k)


@dataclass(frozen=True, slots=True)
class State:
    """The estimate as of `at_s`, with the inputs that have been held since.

    at_s: None while there is no estimate; `why_not` says why. Constant inputs need no new state between ticks.
    blind_since_s: speed or load is unknown since then; `why_blind` says which
    """

    at_s: float | None = None
    rise_k: float = 0.0
    heat_w: float = 0.0
    ambient_c: float | None = None
    blind_since_s: float | None = None
    why_blind: str = ""
    why_not: str = _NOT_YET
    started_from: str = ""


def step(config: Config, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Advance the estimate to the sample, then take over its inputs. Publishes at ticks, and at a hole."""
    if sample.kind is _TICK:
        if state.at_s is None:
            # Time goes on again after a hole. A value that was not sent again has not changed: start from what is known.
            state = _with_inputs(config, state, sample)
        state = _advanced(config.network, state, sample.at_s)
        return state, _outputs(config, state, sample)
    if sample.kind is _HOLE:
        state = _with_inputs(config, _over_hole(config, state, sample), sample)
        return state, _outputs(config, state, sample)
    return _with_inputs(config, state, sample), ()


def _advanced(network: ThermalNetwork, state: State, at_s: float) -> State:
    """The state at `at_s`, with the inputs held."""
    if state.at_s is None or at_s <= state.at_s:
        return state
    rise_k = rise_after(network, state.rise_k, state.heat_w, at_s - state.at_s)
    # Spelled out, since this is the hot path, and `replace` looks up each field.
    return State(at_s, rise_k, state.heat_w, state.ambient_c, state.blind_since_s, state.why_blind, "", state.started_from)


def _over_hole(config: Config, state: State, sample: Sample) -> State:
    """A long hole ends the estimate; over a short one it goes on, also where the clock was set back a little."""
    if sample.gap_s >= config.gap_s_max:
        return State(why_not=sample.detail)
    if state.at_s is not None and sample.at_s < state.at_s:
        return replace(state, at_s=sample.at_s, blind_since_s=None if state.blind_since_s is None else sample.at_s)
    return _advanced(config.network, state, sample.at_s)


def _with_inputs(config: Config, state: State, sample: Sample) -> State:
    """The state with the inputs of this sample, advanced to it where they differ from those held."""
    heat_w, why_blind = _heat(config.network, sample)
    if heat_w is None:
        if state.at_s is None:
            known = sample.kind in (SampleKind.HOLE, SampleKind.DEATH) or state.why_not == why_blind
            return state if known else replace(state, why_not=why_blind)
        if state.blind_since_s is not None and state.why_blind == why_blind:
            return state
        since_s = sample.at_s if state.blind_since_s is None else state.blind_since_s
        return replace(_advanced(config.network, state, sample.at_s), blind_since_s=since_s, why_blind=why_blind)
    if state.blind_since_s is not None and sample.at_s - state.blind_since_s > config.gap_s_max:
        state = State(why_not=state.why_blind)
    ambient_c = sample.number(AMBIENT)[0] if AMBIENT in sample.row else None
    if ambient_c is None:
        ambient_c = config.ambient_temp_c
    if state.at_s is None:
        # A hole only ends an estimate: what the row holds then is from before it.
        return state if sample.kind in (SampleKind.HOLE, SampleKind.DEATH) else _started(sample, heat_w, ambient_c)
    if ambient_c is None:
        ambient_c = state.ambient_c  # kept for the day that it is known again
    if heat_w == state.heat_w and ambient_c == state.ambient_c and state.blind_since_s is None:
        return state
    rise_k = state.rise_k
    if sample.at_s > state.at_s:
        rise_k = rise_after(config.network, rise_k, state.heat_w, sample.at_s - state.at_s)
    if ambient_c is not None and state.ambient_c is not None:
        rise_k += state.ambient_c - ambient_c  # the spindle's temperature does not jump with the ambient's
    at_s = max(sample.at_s, state.at_s)
    return State(at_s, rise_k, heat_w, ambient_c, None, "", _NOT_YET, state.started_from)


def _started(sample: Sample, heat_w: float, ambient_c: float | None) -> State:
    measured_c, _ = sample.number(MEASURED)
    if measured_c is not None and ambient_c is not None:
        rise_k, started_from = measured_c - ambient_c, "the measured temperature"
    else:
        rise_k, started_from = 0.0, "ambient (an assumption: no measured temperature to start from)"
    return State(sample.at_s, rise_k, heat_w, ambient_c, started_from=started_from)


def _heat(network: ThermalNetwork, sample: Sample) -> tuple[float | None, str]:
    rpm, no_rpm = sample.number(SPEED)
    load_pct, no_load = sample.number(LOAD)
    if rpm is None or load_pct is None:
        return None, no_rpm or no_load or ""
    if abs(rpm) > SPINDLE_RPM_MAX or abs(load_pct) > SPINDLE_LOAD_PCT_MAX:
        return None, f"{SPEED} or {LOAD} is beyond any spindle"
    return heat_input_w(network, rpm, load_pct), ""


def _ambient(config: Config, sample: Sample) -> tuple[float | None, str]:
    """The ambient temperature and where it is from; None with the reason."""
    measured_c, reason = sample.number(AMBIENT)
    if measured_c is not None:
        return measured_c, "measured"
    if config.ambient_temp_c is not None:
        return config.ambient_temp_c, "configured"
    return None, f"{reason}, and no ambient temperature is configured"


def _outputs(config: Config, state: State, sample: Sample) -> tuple[Output, ...]:
    why_not = state.why_not if state.at_s is None else state.why_blind if state.blind_since_s is not None else None
    if why_not is not None:
        return tuple(Output.null(name, why_not) for name in (TEMPERATURE, RESIDUAL, RISE, BASIS))
    ambient_c, origin = _ambient(config, sample)
    rise = Output(RISE, round(state.rise_k, 3))
    start = f"started from {state.started_from}"
    if ambient_c is None:
        basis = Output(BASIS, f"{start}; ambient unknown")
        return Output.null(TEMPERATURE, origin), Output.null(RESIDUAL, origin), rise, basis
    basis = Output(BASIS, f"{start}; ambient {origin}")
    modelled_c = ambient_c + state.rise_k
    measured_c, no_measured = sample.number(MEASURED)
    if measured_c is None:
        residual = Output.null(RESIDUAL, no_measured or "")
    else:
        residual = Output(RESIDUAL, round(measured_c - modelled_c, 3))
    return Output(TEMPERATURE, round(modelled_c, 3)), residual, rise, basis


_DOUBLE, _MODELLED = DataType.DOUBLE, Provenance.MODELLED
PROCESSOR = Processor(
    name="thermal",
    version=1,
    inputs=frozenset({SPEED, LOAD, AMBIENT, MEASURED}),
    outputs=(
        OutputSpec(TEMPERATURE, _DOUBLE, "°C", "spindle temperature by the RC network", _MODELLED, 0.05),
        OutputSpec(RESIDUAL, _DOUBLE, "K", "measured minus modelled spindle temperature", Provenance.INFERRED, 0.05),
        OutputSpec(RISE, _DOUBLE, "K", "modelled rise of the spindle over ambient", _MODELLED, 0.05),
        OutputSpec(BASIS, DataType.STRING, None, "what the estimate was started from, and its ambient", Provenance.INFERRED),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
)
