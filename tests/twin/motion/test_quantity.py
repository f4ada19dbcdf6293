"""A single quantity of the control is what the planner is given of it, and needs no numpy."""

import subprocess
import sys

import pytest

from twin.effects.catalogue import catalogue
from twin.machine import AddedEffect, MachineFile, Program, machine_from_toml
from twin.motion.control import LENGTH_OVER_FEED, QUANTITIES, control_of
from twin.motion.quantity import changed_quantity
from twin.sites import Site

STATED = Program(rapid_mm_min=30_000.0, acceleration_mm_s2=2500.0, tool_change_s=6.0, block_time_s=0.01)
OF_PROGRAMS = sorted(name for name, effect in catalogue().items() if effect.site is Site.PROGRAM)


def machine(*names: str) -> MachineFile:
    """The machine with these effects at their typical size."""
    effects = tuple(AddedEffect(effect=name, parameters=catalogue()[name].typical_values()) for name in names)
    return machine_from_toml('[machine]\nname = "vmc"').model_copy(update={"program": STATED, "effects": effects})


@pytest.mark.parametrize("names", [(), *((name,) for name in OF_PROGRAMS), tuple(OF_PROGRAMS)])
@pytest.mark.parametrize("quantity", ["tool_change_s", "block_time_s"])
def test_it_is_what_the_planner_is_given(names: tuple[str, ...], quantity: str) -> None:
    assert quantity in QUANTITIES
    described = machine(*names)
    planned = getattr(control_of(described, STATED).limits, quantity)
    assert changed_quantity(described, quantity, getattr(STATED, quantity)) == planned


def test_a_quantity_that_nothing_changes_stays() -> None:
    assert changed_quantity(machine(), "tool_change_s", 6.0) == 6.0
    assert LENGTH_OVER_FEED.tool_change_s == 0.0


def test_it_needs_no_numpy() -> None:
    asked = "import sys, twin.motion.quantity; raise SystemExit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", asked], check=False).returncode == 0
