"""Processors of the tests: one whose step waits for a gate, and one that cannot bear a certain speed."""

from collections.abc import Sequence
from dataclasses import replace
from threading import Event

from processors.contract import Output, Processor, Sample
from processors.running.runtime import Configured
from tests.processors.describing import DESCRIBING, Gain, State
from tests.processors.describing import step as step_of_describing

UNBEARABLE_RPM = 13.0


def gated(gate: Event, machine: str, wait_s: float) -> Processor:
    """A processor whose step takes `wait_s` for one machine until the gate is opened."""

    def step(gain: Gain, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
        if sample.machine == machine and not gate.is_set():
            gate.wait(wait_s)
        return step_of_describing(gain, state, sample)

    return replace(DESCRIBING, name="gated", step=step)


def delicate() -> Processor:
    """A processor whose step raises at a certain speed."""

    def step(gain: Gain, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
        if sample.number("spindle_rpm")[0] == UNBEARABLE_RPM:
            raise ArithmeticError("thirteen is unbearable")
        return step_of_describing(gain, state, sample)

    return replace(DESCRIBING, name="delicate", step=step)


def of_version(version: int) -> Processor:
    """A processor whose states of another version are of no use to it."""
    return replace(DESCRIBING, name="upgraded", version=version)


def alone(processor: Processor) -> list[Configured]:
    """The processor as a runner's only one, without configuration."""
    return [(processor, processor.configured({}))]
