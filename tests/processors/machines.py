"""Descriptions of machines for the tests of processors that read one."""

from collections.abc import Sequence
from typing import Any

from processors.config import Configuration
from processors.contract import Outputs, Processor
from processors.description import Description
from processors.sample import Sample, SampleKind
from sparkplug.metric import Reading
from tests.processors.streams import T0_MS, reading
from twin.machine import MachineFile
from twin.machine_toml import machine_to_toml

THERMAL = {
    "alpha_w_per_pct_rpm2": 2.2e-8,
    "beta_w_per_rpm": 1.6e-2,
    "resistance_k_per_w": 0.12,
    "capacity_j_per_k": 9000.0,
}
SPINDLE = {"rated_power_kw": 11.0, "efficiency": 0.85, "idle_power_kw": 0.25}
CUTTER = {"teeth": 4, "tangential_coefficient_n_per_mm2": 900.0, "radial_ratio": 0.4}


def described_as(*effects: dict[str, Any], **sections: Any) -> Description:
    """The description of a machine with these sections; [machine] may say what is assumed."""
    head = {"name": "okuma", **sections.pop("machine", {})}
    machine = MachineFile.model_validate({"machine": head, "effects": list(effects), **sections})
    return Description.from_toml(machine_to_toml(machine))


class Fold:
    """A machine folded step by step, with a description that can change on the way."""

    def __init__(self, processor: Processor[Any, Any], description: Description | None = None, **table: Any) -> None:
        self.processor, self.configuration = processor, Configuration(processor.config, table)
        self.state = processor.initial(self.configuration.default)
        self.row: dict[str, Reading] = {}
        self.describe(description)

    def describe(self, description: Description | None) -> None:
        """The machine is described like this from now on."""
        self.given = self.processor.given(self.configuration, "okuma", description)

    def at(self, at_s: float, kind: SampleKind = SampleKind.DATA, **values: Any) -> dict[str, Any]:
        """Return the outputs of the sample: output → value, or the reason for a null."""
        self.row |= {name: reading(name, value, at_s) for name, value in values.items()}
        sample = Sample("okuma", kind, T0_MS / 1000.0 + at_s, self.row, tuple(values))
        self.state, outputs = self.processor.step(self.given, self.state, sample)
        return said(outputs)

    def tick(self, at_s: float) -> dict[str, Any]:
        """Return the outputs of a tick."""
        return self.at(at_s, SampleKind.TICK)


def said(outputs: Outputs | Sequence[Any]) -> dict[str, Any]:
    """Output → value, or its reason where it is null."""
    return {one.name: one.value if one.value is not None else one.reason for one in outputs}
