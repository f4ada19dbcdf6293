"""The sections of a program between its tool changes, and how long the twin says that each takes."""

from twin.errors import MachineError
from twin.machine import MachineFile
from twin.motion.control import control_of
from twin.motion.path import EventKind, path_from_moves
from twin.programs import Settings, interpret


def section_seconds(machine: MachineFile, text: str, settings: Settings | None = None) -> tuple[float, ...]:
    """Return the seconds of each section of a program, from its start, or the end of a tool change, to the next tool change, or
    its end. The tool changes themselves are in none. settings: None = those of the machine

    Raises MachineError where the machine states nothing of how its control moves, PartProgramError where the text is no program.

    100 mm at 6,000 mm/min, a tool change, and 200 mm:

    >>> from twin.machine import machine_from_toml
    >>> toml = "[machine]\\nname = 'a'\\n[program]\\nrapid_mm_min = 30000.0\\nacceleration_mm_s2 = 1e6\\ntool_change_s = 5.0"
    >>> text = "G21 G90 G94 G1 X100. F6000.\\nT2 M6\\nX300.\\nM30\\n"
    >>> [round(seconds, 1) for seconds in section_seconds(machine_from_toml(toml), text)]
    [1.0, 2.0]
    """
    if machine.program is None:
        raise MachineError(f"{machine.machine.name}: [program] is missing; it states how the control moves")
    settings = machine.settings if settings is None else settings
    moves = interpret(text, settings)
    plan = control_of(machine, machine.program).plan(path_from_moves(moves, settings.start_mm or None))
    seconds, begun_s = [], 0.0
    for event, at_s, lasts_s in zip(plan.path.events, plan.event_start_s.tolist(), plan.event_duration_s.tolist(), strict=True):
        if event.kind is EventKind.TOOL_CHANGE:
            seconds.append(at_s - begun_s)
            begun_s = at_s + lasts_s
    return (*seconds, plan.total_s - begun_s)
