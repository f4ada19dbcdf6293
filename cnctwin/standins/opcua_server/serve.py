"""`cnctwin simulate-control opcua`: the simulated control behind an OPC UA server, as a program of its own."""

import importlib.util
import logging
from pathlib import Path
from threading import Event

from cnctwin.errors import ApplicationError
from cnctwin.processes.state_file import STATE_S, keep
from cnctwin.standins.opcua_server.shown import ADDRESSES
from cnctwin.standins.simulated_control.alarm import RaisedAlarm, with_alarms
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import production
from edge.state_dir import state_dir

DAY_S = 8 * 3600.0
PORT = 4840
ALARM = (700012, "Spindle lubrication failure")  # from 700000 on, alarms are of the machine's PLC


def simulate_opcua(
    stop: Event,
    *,
    speed: float = 1.0,
    port: int = PORT,
    clock_offset_s: float = 0.0,
    is_open: bool = False,
    alarm_every_s: float | None = None,
    state_file: Path | None = None,
) -> None:
    """Serve until stopped; says where, and what to pin.

    is_open: also without security, for those who ask for that
    alarm_every_s: the seconds of work before an alarm; None: there is none but the open door's between two parts
    """
    if importlib.util.find_spec("asyncua") is None:
        raise ApplicationError("an OPC UA server needs the library asyncua; install it with: pip install 'cnctwin[opcua]'")
    from cnctwin.standins.opcua_server.alarms import alarms_of  # noqa: PLC0415  asyncua is an extra
    from cnctwin.standins.opcua_server.server import OpcUaServer  # noqa: PLC0415

    logging.getLogger("asyncua.server.server").setLevel(logging.CRITICAL)  # why it can't start is told below, without a traceback
    day = production(DAY_S)
    if alarm_every_s is not None:
        day = with_alarms(day, RaisedAlarm(alarm_every_s, *ALARM))
    control = SimulatedControl(day, speed=speed, clock_offset_s=clock_offset_s)
    with OpcUaServer(control, state_dir() / "simulated-opcua", port=port, open_too=is_open) as server:
        discover = f"cnctwin edge discover '{server.url}?server_fingerprint={server.fingerprint}'"
        print(f"{server.url} serves a simulated control; Ctrl-C ends it\nto draft a configuration: {discover}")
        print(f"addresses that tell something: {', '.join(ADDRESSES)}", flush=True)
        while not stop.wait(STATE_S) and server.error is None:
            server.set_alarms(*alarms_of(control.now()))
            keep(state_file, {"url": server.url, "fingerprint": server.fingerprint, "writes": server.writes})
        if server.error is not None:
            raise ApplicationError(f"the OPC UA server broke down: {server.error}") from server.error
    print(f"written to by clients {server.writes} times, methods called {server.calls} times", flush=True)
