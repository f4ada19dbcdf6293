"""`cnctwin simulate-control machine`: the simulated machine behind an MTConnect agent, as a program of its own."""

import os
import sys
from dataclasses import dataclass
from math import inf
from pathlib import Path
from threading import Event

from cnctwin.errors import ApplicationError
from cnctwin.processes.state_file import STATE_S, keep
from cnctwin.standins.mtconnect_agent.errors import ReplayError
from cnctwin.standins.simulated_machine.agent import PATIENCE_S, SimulatedMachine
from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.description import PROGRAM
from cnctwin.standins.simulated_machine.hidden_effect import Choice, sealed_effect


@dataclass(frozen=True, slots=True)
class Hidden:
    """A choice of a hidden effect. seed: None = another one each time; sealed: the file that keeps it until it is revealed"""

    choice: Choice
    seed: int | None = None
    sealed: Path | None = None


def simulate_machine(
    stop: Event, *, speed: float = 1.0, port: int = 0, hidden: Hidden | None = None, state_file: Path | None = None
) -> None:
    """Serve until stopped; says where, and keeps `state_file` up to date for a program that started us."""
    added = None
    if hidden is not None:
        added, sealed = sealed_effect(hidden.choice, hidden.seed, hidden.sealed)
        print(f"an effect is hidden in the machine; the hash of its name, size and salt is {sealed.seal.digest}", flush=True)
    try:
        machine = SimulatedMachine(
            speed=speed, port=port, machine=machine_as_built(added), patience_s=inf if added else PATIENCE_S
        )
    except ReplayError as error:
        raise ApplicationError(str(error)) from error
    machine.start()
    try:
        print(f"{machine.url} serves {machine.device_name}, which runs {PROGRAM.name}; Ctrl-C ends it", flush=True)
        told = ""
        while not stop.wait(STATE_S) and machine.error is None:
            if machine.notice not in ("", told):
                told = machine.notice
                print(told, flush=True)
            _keep(state_file, machine)
        _keep(state_file, machine)
    finally:
        is_idle = machine.stop()
    if machine.error is not None:
        raise ApplicationError(f"the simulated machine broke down: {machine.error}") from machine.error
    print(", ".join(f"{name} {count}" for name, count in machine.ledger.as_dict().items()), flush=True)
    if not is_idle:  # A kernel that is being compiled would be torn down under its thread.
        sys.stdout.flush()
        os._exit(0)


def _keep(state_file: Path | None, machine: SimulatedMachine) -> None:
    keep(
        state_file,
        {
            "url": machine.url,
            "device": machine.device_name,
            "finished": False,
            "ledger": machine.ledger.as_dict(),
            "parts": machine.parts,
            "notice": machine.notice,
        },
    )
