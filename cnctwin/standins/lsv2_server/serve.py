"""`cnctwin simulate-control lsv2`: a HEIDENHAIN control on LSV2, as a program of its own."""

import importlib
from pathlib import Path
from threading import Event

from cnctwin.errors import ApplicationError, UsageError
from cnctwin.files.output import write
from cnctwin.processes.state_file import STATE_S, keep
from cnctwin.standins.lsv2_server import plc_memory
from cnctwin.standins.lsv2_server.answers import Model
from cnctwin.standins.lsv2_server.oscilloscope import ServoTrace
from cnctwin.standins.lsv2_server.server import Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import production
from cnctwin.standins.simulated_machine.description import check
from twin.errors import TwinError

WEEK_S = 7 * 86_400.0


def simulate_lsv2(
    stop: Event,
    *,
    speed: float = 1.0,
    port: int = 19000,
    model: str = Model.TNC640,
    clock_offset_s: float = 0.0,
    program: Path | None = None,
    scope: bool = False,
    effect: str | None = None,
    on: str = "x",
    machine_out: Path | None = None,
    state_file: Path | None = None,
) -> None:
    """Serve until stopped.

    program: shown in place of the program that is run; its blocks should have the same numbers. scope: the iTNC 530 shows the
    oscilloscope, with an effect of that name on an axis that its description, written to `machine_out`, does not tell.
    """
    if not 0 < speed <= 1000:
        raise UsageError(f"--speed {speed:g} is not between 0 and 1000")
    if model not in {known.value for known in Model}:
        raise UsageError(f"--model {model!r} is not known; there are {' and '.join(Model)}")
    control = SimulatedControl(production(WEEK_S), speed=speed, clock_offset_s=clock_offset_s)
    trace = _trace(model, effect, on, machine_out) if scope or effect or machine_out else None
    server = Lsv2Server(control, model=Model(model), port=port, trace=trace)
    if program is not None:
        try:
            server.answers.program_text = program.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"--program {program}: cannot be read: {error}") from error
    try:
        server.start()
    except OSError as error:
        raise ApplicationError(f"port {port} cannot be used: {error.strerror}; give another with --port") from error
    try:
        shows = "which runs O1701.H" if trace is None else "which runs O1701.H and shows X, Y and Z on its oscilloscope"
        print(f"{server.url} stands in for a control {server.answers.model}, {shows}; Ctrl-C ends it")
        print(f"PLC addresses that tell something: {', '.join(plc_memory.SHOWN)}; any PLC password is right", flush=True)
        while not stop.wait(STATE_S):
            keep(state_file, _state(server))
        keep(state_file, _state(server))
    finally:
        server.stop()
    counters = server.answers.counters
    print(f"telegrams {counters.telegrams}, writes refused {counters.writes_refused}", flush=True)


def _trace(model: str, effect: str | None, on: str, machine_out: Path | None) -> ServoTrace:
    """Simulate the servo axes, and write what a twin of them is told."""
    if model != Model.ITNC530:
        raise UsageError(f"--model {model}: only the iTNC530 shows its oscilloscope over LSV2; add --model iTNC530")
    check(1.0)
    servo_axes = importlib.import_module("cnctwin.standins.lsv2_server.servo_axes")  # with numba, which other controls don't need
    if machine_out is not None:
        write(lambda: machine_out.write_text(servo_axes.told_machine(), encoding="utf-8"), machine_out)
    print("the servo axes go through their program; this takes some seconds", flush=True)
    try:
        hidden = None if effect is None else servo_axes.hidden_effect(effect, on)
        trace: ServoTrace = servo_axes.servo_trace(hidden)
    except TwinError as error:
        raise UsageError(f"--effect {effect} --on {on}: {error}") from None
    return trace


def _state(server: Lsv2Server) -> dict[str, object]:
    counters = server.answers.counters
    return {
        "url": server.url,
        "model": server.answers.model,
        "finished": server.control.is_over,
        "telegrams": counters.telegrams,
        "writes_refused": counters.writes_refused,
        "parts": server.control.now().part_count,
    }
