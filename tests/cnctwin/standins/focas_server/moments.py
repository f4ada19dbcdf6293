"""Moments of a machine that the tests show: in the middle of a tool change, and cutting."""

from collections.abc import Callable
from dataclasses import replace

from cnctwin.standins.focas_server.server import FocasServer
from cnctwin.standins.focas_server.shown import ControlDescription, coded
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState

CHANGING = ControlState(
    exec_state="ACTIVE",
    program="O1701",
    block="T2 M6",
    line=2,
    is_changing_tool=True,
    spindle_rpm=3956.0,
    spindle_load_pct=17.4,
    feed_mm_min=0.0,
    feed_override_pct=80.0,
    rapid_override_pct=50.0,
    spindle_override_pct=110.0,
    axis_pos_mm=(-12.5, -290.0, 0.001),
    axis_load_pct=(3.0, -4.0, 12.0),
    part_count=41,
)
CUTTING = replace(CHANGING, block="G1 X3. F500. (M6)", is_changing_tool=False, tool_number=2, feed_mm_min=500.0)
DESCRIPTION = ControlDescription(
    program_lines=("O1701", "T2 M6", "G0 G54 X10. S4000 M3", "G43 H2 T3"),
    macros={500: 12.345, 501: -7.0},
    tool_offsets_mm={(2, 3): 110.25},
)
SWITCHED_ON_S = 1_767_225_600.0  # 2026-01-01T00:00:00Z

Serve = Callable[..., FocasServer]


def control_at(*states: ControlState, at_s: float = 0.0) -> SimulatedControl:
    """A control that stands still at the last of these states."""
    return SimulatedControl(coded(states), machine_s=lambda: at_s, switched_on_s=SWITCHED_ON_S)
