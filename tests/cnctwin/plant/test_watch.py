"""The live view: a screen in a terminal, lines elsewhere, and an end when it is asked for."""

import io
import signal
from itertools import count
from pathlib import Path

import pytest
from rich.console import Console

from cnctwin.plant import watch as watch_module
from cnctwin.plant.screen import Cropped, screen
from cnctwin.plant.view import ledgers, machines
from cnctwin.plant.watch import show
from sparkplug.host import HostEvent
from tests.cnctwin.plant.pictures import Pictures, balance, owner
from tests.cnctwin.program import Program, until
from tests.wire.mosquitto import Mosquitto


class Host(Pictures):
    """A host application to which nothing happens."""

    def poll(self, _timeout_s: float) -> list[HostEvent]:
        return []


def plant() -> Host:
    host = Host()
    host.add("edge-vmc", owner(balance(3, 3)), {"vmc": owner({"exec_state": "ACTIVE"}), "lathe": owner({"exec_state": "READY"})})
    return host


def seen(*, terminal: bool, machine: str | None = None, kind: str = "xterm") -> str:
    """Return what is shown in five rounds."""
    console = Console(file=io.StringIO(), width=140, force_terminal=terminal, _environ={"TERM": kind})
    rounds = count()
    show(plant(), console, lambda: next(rounds) > 5, machine=machine, note=lambda: "Ctrl-C ends the view")  # type: ignore[arg-type]
    return str(console.file.getvalue())  # type: ignore[attr-defined]


@pytest.fixture(autouse=True)
def lines_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watch_module, "PLAIN_LINE_S", 0.0)


def test_elsewhere_than_in_a_terminal_there_are_lines() -> None:
    lines = seen(terminal=False).splitlines()
    assert len(lines) == 6
    assert set(lines) == {"lathe: exec_state READY; vmc: exec_state ACTIVE [edge-vmc 3]"}


def test_a_terminal_that_cannot_move_its_cursor_gets_lines_too() -> None:
    assert seen(terminal=True, kind="dumb") == seen(terminal=False)


def test_a_low_terminal_says_how_to_see_the_rest() -> None:
    console = Console(file=io.StringIO(), width=80, height=12, force_terminal=True, _environ={"TERM": "xterm"})
    host = plant()
    console.print(Cropped(screen(machines(host), ledgers(host), "a note"), "a note"))
    lines = str(console.file.getvalue()).splitlines()  # type: ignore[attr-defined]
    assert len(lines) == 11
    assert "more lines: enlarge the window, or name one machine (cnctwin watch MACHINE)" in lines[-1]


def test_in_a_terminal_there_is_a_screen() -> None:
    screen = seen(terminal=True)
    assert "accounted for" in screen
    assert "Ctrl-C ends the view" in screen


@pytest.mark.parametrize("terminal", [True, False])
def test_one_machine_can_be_picked(terminal: bool) -> None:
    assert "lathe" in seen(terminal=terminal)
    picked = seen(terminal=terminal, machine="vmc")
    assert "vmc" in picked
    assert "lathe" not in picked


@pytest.mark.broker
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_in_order(mosquitto: Mosquitto, tmp_path: Path, number: int) -> None:
    with Program(tmp_path, "watch", "--broker", f"mqtt://127.0.0.1:{mosquitto.port}") as program:
        until(lambda: "view-" in mosquitto.log, "the view to connect")
        assert program.ask_to_end(number) == 0
        assert program.err == ""
