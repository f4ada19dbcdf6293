"""A processor that shows what a description gives it: the test of all that hands descriptions on."""

from collections.abc import Sequence
from dataclasses import dataclass

from processors.config import ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.description import Description, DescriptionMessage, Role, topic_of
from sparkplug.datatype import DataType
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from tests.processors.streams import T0_MS

SUM, VERSION, SHADOWED = "twin/sum", "twin/version", "twin/of_others"
REFUSED_W = 13.0


def toml(power_kw: float, *lines: str) -> str:
    """The text of a description whose spindle is rated at `power_kw`."""
    return "\n".join(['[machine]\nname = "okuma"', *lines, f"[spindle]\nrated_power_kw = {power_kw}\nefficiency = 0.9\n"])


WHOLE = """
[machine]
name = "okuma"
[tool]
diameter_mm = 10.0
teeth = 4
tangential_coefficient_n_per_mm2 = 900.0
radial_ratio = 0.4
[spindle]
rated_power_kw = {power_kw}
efficiency = 0.85
idle_power_kw = 0.25
[thermal]
alpha_w_per_pct_rpm2 = 2.2e-8
beta_w_per_rpm = 1.6e-2
resistance_k_per_w = {resistance_k_per_w}
capacity_j_per_k = 9000.0
[program]
rapid_mm_min = 36000.0
acceleration_mm_s2 = 2500.0
"""
"""A description with all tables that a live processor may ask for."""


def whole(power_kw: float = 11.0, resistance_k_per_w: float = 0.12) -> Description:
    """Return a machine that is described as a whole."""
    return Description.from_toml(WHOLE.format(power_kw=power_kw, resistance_k_per_w=resistance_k_per_w))


def description(power_kw: float) -> Description:
    """The description whose spindle is rated at `power_kw`."""
    return Description.from_toml(toml(power_kw))


def message(power_kw: float | None, role: Role = Role.LIVE, machine: str = "okuma", at_s: float = 0.0) -> HostEvent:
    """The message that describes a machine; None: it is described no more."""
    payload = b""
    if power_kw is not None:
        payload = DescriptionMessage(version=description(power_kw).version, toml=toml(power_kw), by="anna").payload()
    at_ms = T0_MS + round(at_s * 1000)
    return HostEvent(EventKind.PLAIN, NodeId("", ""), None, at_ms, topic=topic_of(machine, role), payload=payload)


@dataclass(frozen=True, slots=True)
class Gain:
    """The means of the step: a factor, and its origin."""

    factor: float
    version: str


@dataclass(frozen=True, slots=True)
class State:
    """The sum of speed times factor over all samples, so that nothing of the past is ever forgotten."""

    total: float = 0.0


def _described(_: ProcessorConfig, given: Description | None) -> Gain:
    if given is None:
        return Gain(1.0, "assumed")
    assert given.machine.spindle is not None
    if given.machine.spindle.rated_power_kw == REFUSED_W:
        raise ValueError("thirteen is refused")
    return Gain(given.machine.spindle.rated_power_kw, given.version)


def step(gain: Gain, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Add up speed times factor."""
    rpm, no_rpm = sample.number("spindle_rpm")
    if rpm is None:
        return state, (Output.null(SUM, no_rpm or "none"), Output(VERSION, gain.version))
    other = sample.row.get(SHADOWED)
    total = state.total + gain.factor * rpm + (1000.0 if sample.kind is SampleKind.TICK else 0.0)
    own = [Output(SUM, total), Output(VERSION, gain.version), Output("twin/samples", total)]
    return State(total), own if other is None else [*own, Output("twin/seen", other.value)]


DESCRIBING = Processor(
    name="describing",
    version=1,
    inputs=frozenset({"spindle_rpm", SHADOWED}),
    outputs=(
        OutputSpec(SUM, DataType.DOUBLE, None, "speed times factor", Provenance.MODELLED, of_challenger=True),
        OutputSpec("twin/seen", DataType.DOUBLE, None, "what another processor says", Provenance.MODELLED, of_challenger=True),
        OutputSpec("twin/samples", DataType.DOUBLE, None, "of the live one only", Provenance.MODELLED),
        OutputSpec(VERSION, DataType.STRING, None, "which description", Provenance.INFERRED, of_challenger=True),
    ),
    config=ProcessorConfig,
    state=State,
    initial=lambda _: State(),
    step=step,
    described=_described,
)
