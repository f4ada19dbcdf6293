"""`cnctwin simulate-control focas`: a FANUC control without a machine, as a program of its own."""

from pathlib import Path
from threading import Event

from cnctwin.errors import UsageError
from cnctwin.processes.state_file import STATE_S, keep
from cnctwin.standins.focas_server.server import FocasServer
from cnctwin.standins.focas_server.shown import PMC_SHOWN, ControlDescription, coded
from cnctwin.standins.simulated_control.alarm import RaisedAlarm, with_alarms
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import production
from cnctwin.standins.simulated_machine.description import PROGRAM

DAY_S = 24 * 3600.0
PORT = 8193
TOOLS = 5
ALARM = (1012, "SPINDLE LUBRICATION FAILURE")  # EX1012: from 1000 on, alarms are the builder's
RADIUS_WEAR, RADIUS, LENGTH_WEAR, LENGTH = range(4)  # the kinds of `cnc_rdtofs`


def simulate_focas(
    stop: Event,
    *,
    speed: float = 1.0,
    port: int = PORT,
    clock_offset_s: float = 0.0,
    tool_number: bool = False,
    alarm_every_s: float | None = None,
    state_file: Path | None = None,
) -> None:
    """Serve a working day until stopped; says where, and keeps `state_file` up to date for a program that started us.

    clock_offset_s: how far the control's clock is ahead; tool_number: whether the control has the option for the tool number
    alarm_every_s: the seconds of work before an alarm; None: there is none
    """
    if not 0 < speed <= 1000:
        raise UsageError(f"--speed {speed:g} is not between 0 and 1000; 1 is real time")
    day = production(DAY_S)
    if alarm_every_s is not None:
        day = with_alarms(day, RaisedAlarm(alarm_every_s, *ALARM))
    control = SimulatedControl(coded(day), speed=speed, clock_offset_s=clock_offset_s)
    description = described(has_tool_number=tool_number)
    server = FocasServer(control, description, port=port)
    with server:
        print(f"{server.url} shows a FANUC control, which runs {PROGRAM.name}; Ctrl-C ends it")
        macros = ", ".join(f"#{number}" for number in description.macros)
        print(f"addresses that tell something: variables {macros}; PMC {', '.join(PMC_SHOWN)}", flush=True)
        while not stop.wait(STATE_S):
            _keep(state_file, server, control)
        _keep(state_file, server, control)
    print(", ".join(f"{name} {count}" for name, count in server.ledger.as_dict().items()), flush=True)


def described(*, has_tool_number: bool = False) -> ControlDescription:
    """Return the control as the shop has set it up: its tools are measured, the program has its comment in its head."""
    lines = tuple(PROGRAM.read_text(encoding="utf-8").splitlines())
    head = next(line for line in lines if line.startswith("O"))
    name, _, comment = head.partition(" ")
    lengths = {(tool, LENGTH): 120.0 + 7.5 * tool for tool in range(1, TOOLS + 1)}
    wear = {(tool, LENGTH_WEAR): -0.01 * tool for tool in range(1, TOOLS + 1)}
    return ControlDescription(
        has_tool_number=has_tool_number,
        program_lines=lines,
        program_comments={int(name.removeprefix("O")): comment.strip("()")},
        operator_message=(2001, "CHECK COOLANT LEVEL"),
        macros={500: 80.0, 501: 50.0},
        tool_offsets_mm={**lengths, **wear, (TOOLS, RADIUS): 6.0, (TOOLS, RADIUS_WEAR): 0.005},
    )


def _keep(state_file: Path | None, server: FocasServer, control: SimulatedControl) -> None:
    state = {"url": server.url, "finished": control.is_over, "ledger": server.ledger.as_dict()}
    keep(state_file, state)
