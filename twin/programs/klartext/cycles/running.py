"""The machining cycles by number, and how a defined one is run where the tool is."""

from collections.abc import Callable, Mapping
from typing import Final

from twin.programs.klartext import compensation
from twin.programs.klartext.cycles import boring, drilling, milling, tapping
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.state import State
from twin.programs.refusal import RefusedError

Cycle = Callable[[State, Definition], None]
"""The motions of a cycle at the place where the tool is."""

MACHINING: Final[Mapping[int, Cycle]] = {
    200: drilling.drilling,
    201: drilling.reaming,
    202: boring.boring,
    203: drilling.universal_drilling,
    204: boring.back_boring,
    205: drilling.universal_pecking,
    206: tapping.tapping,
    207: tapping.rigid_tapping,
    208: milling.bore_milling,
    209: tapping.tapping_with_breaks,
    240: drilling.centring,
    241: drilling.deep_drilling,
    251: milling.rectangular_pocket,
    252: milling.circular_pocket,
    253: milling.slot,
    254: milling.circular_slot,
}


def run_cycle(state: State, cycle: Definition) -> None:
    """Run a machining cycle where the tool is."""
    compensation.refuse(state, cycle.text)
    if state.corner is not None:
        raise RefusedError(cycle.text, "cannot stand behind RND or CHF")
    if state.frame.angle_deg != 0.0 and state.frame.plane != state.plane:
        raise RefusedError(cycle.text, "needs the plane of cycle 10")
    if cycle.number == 12:
        state.call_program(cycle.name, cycle.name)
        return
    rpm = state.rpm
    MACHINING[cycle.number](state, cycle)
    state.rpm = rpm
    state.last = None
