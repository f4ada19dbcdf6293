"""A small axis that is moved forth and back, with learned terms in it."""

import numpy as np

from tests.twin.simulator.test_simulation import AXIS
from twin.learned.section import LearnedSection
from twin.machine import AddedEffect, MachineFile, machine_from_toml
from twin.simulator.response import RunInput, respond

EVEN = AXIS.replace("static_n = 400.0", "static_n = 300.0")
"""An axis without a Stribeck peak: its friction is the same at rest."""
MACHINE = machine_from_toml("[machine]\nname = 'small'\n" + EVEN.format(letter="x"))
T = np.arange(800, dtype=np.float64) * 0.001
FORTH_AND_BACK = 10.0 * (1.0 - np.cos(2.0 * np.pi * 2.5 * T))
TOLD = RunInput(t_s=T, reference_mm={"x": FORTH_AND_BACK})


def learned(site: str, column: str, knots: list[float], value: list[float], on: str = "x") -> LearnedSection:
    return LearnedSection.model_validate({"site": site, "on": on, "table": {column: knots, "value": value}})


def columns(
    *terms: LearnedSection, effects: tuple[AddedEffect, ...] = (), machine: MachineFile = MACHINE
) -> dict[str, np.ndarray]:
    return respond(machine.model_copy(update={"learned": terms, "effects": effects}), TOLD).columns


def same(one: dict[str, np.ndarray], other: dict[str, np.ndarray], tolerance: float = 0.0) -> None:
    assert one.keys() == other.keys()
    for name, values in one.items():
        np.testing.assert_allclose(values, other[name], rtol=0.0, atol=tolerance, err_msg=name)
