"""`cnctwin simulate-control`: stands in for a control, in each of the protocols that the edges speak."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from cnctwin.commands.options import Device, Devices, Speed, StateFile
from cnctwin.processes.stopping import stopped_by_signals
from cnctwin.standins.mtconnect_agent.serve import replay

control_app = typer.Typer(no_args_is_help=True, help="Stand in for a control, to develop and test without a machine.")

HttpPort = Annotated[int, typer.Option(help="HTTP port on loopback; 0 = any", min=0, max=65535)]
TcpPort = Annotated[int, typer.Option(help="TCP port on loopback; 0 = any", min=0, max=65535)]
ClockOffset = Annotated[float, typer.Option(help="Seconds by which the control's clock is ahead")]
AlarmEvery = Annotated[
    float | None,
    typer.Option("--alarm-every-s", help="Raise an alarm after so many seconds of work, which stops it for 30 s", min=1),
]


class HeidenhainModel(StrEnum):
    """The control that an LSV2 server stands in for."""

    TNC640 = "TNC640"
    ITNC530 = "iTNC530"


@control_app.command("mtconnect")
def simulate_mtconnect(
    recording: Annotated[Path, typer.Argument(help="SHDR log or time|key|value text")],
    devices: Devices = None,
    device: Device = None,
    speed: Speed = 1.0,
    port: HttpPort = 0,
    style: Annotated[str, typer.Option(help="The generation of the agent: 2.3 or 1.4")] = "2.3",
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end")] = False,
    wait: Annotated[bool, typer.Option("--wait", help="Begin when the first client asks for samples")] = False,
    state_file: StateFile = None,
) -> None:
    """Serve a recording as a real MTConnect agent serves its machine; without --devices, the model is drafted from its keys."""
    with stopped_by_signals() as stop:
        replay(
            recording,
            devices,
            stop,
            device=device,
            speed=speed,
            port=port,
            style=style,
            loop=loop,
            wait=wait,
            state_file=state_file,
        )


@control_app.command("machine")
def simulate_machine(
    speed: Speed = 1.0,
    port: HttpPort = 0,
    effect: Annotated[
        str | None, typer.Option(help="Hide an effect in the machine: NAME, NAME@SIGNAL, either with :SIZE, or random")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed for drawing the hidden effect and its size")] = None,
    sealed: Annotated[Path | None, typer.Option(help="Keep the hidden effect in this file, with the salt of its hash")] = None,
    state_file: StateFile = None,
) -> None:
    """Serve the simulated machine, which cuts one part after the other, as an MTConnect agent."""
    from cnctwin.standins.simulated_machine.hidden_effect import choice_of
    from cnctwin.standins.simulated_machine.serve import Hidden
    from cnctwin.standins.simulated_machine.serve import simulate_machine as serve

    hidden = None if effect is None else Hidden(choice_of(effect), seed, sealed)
    with stopped_by_signals() as stop:
        serve(stop, speed=speed, port=port, hidden=hidden, state_file=state_file)


@control_app.command("focas")
def simulate_focas(
    speed: Speed = 1.0,
    port: TcpPort = 8193,
    clock_offset_s: ClockOffset = 0.0,
    tool_number: Annotated[
        bool, typer.Option("--tool-number", help="With the option that reports the tool in the spindle")
    ] = False,
    alarm_every_s: AlarmEvery = None,
    state_file: StateFile = None,
) -> None:
    """Show the simulated machine as a FANUC control does, over FOCAS Ethernet."""
    from cnctwin.standins.focas_server.serve import simulate_focas as serve

    with stopped_by_signals() as stop:
        serve(
            stop,
            speed=speed,
            port=port,
            clock_offset_s=clock_offset_s,
            tool_number=tool_number,
            alarm_every_s=alarm_every_s,
            state_file=state_file,
        )


@control_app.command("opcua")
def simulate_opcua(
    speed: Speed = 1.0,
    port: TcpPort = 4840,
    clock_offset_s: ClockOffset = 0.0,
    is_open: Annotated[bool, typer.Option("--open", help="Also an endpoint without security")] = False,
    alarm_every_s: AlarmEvery = None,
    state_file: StateFile = None,
) -> None:
    """Show the simulated machine as an OPC UA server does: SINUMERIK's names, and the companion models 40501 and 40502."""
    from cnctwin.standins.opcua_server.serve import simulate_opcua as serve

    with stopped_by_signals() as stop:
        serve(
            stop,
            speed=speed,
            port=port,
            clock_offset_s=clock_offset_s,
            is_open=is_open,
            alarm_every_s=alarm_every_s,
            state_file=state_file,
        )


@control_app.command("lsv2")
def simulate_lsv2(
    speed: Speed = 1.0,
    port: TcpPort = 19000,
    clock_offset_s: ClockOffset = 0.0,
    model: Annotated[HeidenhainModel, typer.Option(help="Which control")] = HeidenhainModel.TNC640,
    program: Annotated[Path | None, typer.Option(help="Shown in place of the program that is run")] = None,
    scope: Annotated[bool, typer.Option("--scope", help="The iTNC 530 shows its oscilloscope: servo axes X, Y, Z")] = False,
    effect: Annotated[str | None, typer.Option(help="An effect that the axes have and their description leaves out")] = None,
    on: Annotated[str, typer.Option(help="The axis of the effect")] = "x",
    machine_out: Annotated[Path | None, typer.Option(help="Write the description of the axes there, a machine.toml")] = None,
    state_file: StateFile = None,
) -> None:
    """Show the simulated machine as a HEIDENHAIN control does, over LSV2."""
    from cnctwin.standins.lsv2_server.serve import simulate_lsv2 as serve

    with stopped_by_signals() as stop:
        serve(
            stop,
            speed=speed,
            port=port,
            model=model,
            clock_offset_s=clock_offset_s,
            program=program,
            scope=scope,
            effect=effect,
            on=on,
            machine_out=machine_out,
            state_file=state_file,
        )
