"""`cnctwin watch`: a live view of the broker in the terminal."""

import os
import time
from collections.abc import Callable
from threading import Event
from uuid import uuid4

from rich.console import Console
from rich.live import Live

from cnctwin.plant.screen import Cropped, line, screen
from cnctwin.plant.view import MachineView, ledgers, machines
from sparkplug.admission.limits import DEFAULTS, Limits
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication, HostEvent
from sparkplug.topics import group_filter
from twin.vocabulary.nodes import is_twin_node
from twin.vocabulary.topics import RESERVED_MACHINES

PLAIN_LINE_S = 5.0


def viewer(broker: BrokerAddress, group: str, limits: Limits = DEFAULTS) -> HostApplication:
    """A host application that only looks: it publishes no STATE, so nobody waits for it."""
    return HostApplication(
        broker,
        f"view-{os.getpid()}-{uuid4().hex[:8]}",
        (group_filter(group),),
        publish_state=False,
        limits=limits,
        reserved=RESERVED_MACHINES,
        trusted=lambda node: is_twin_node(node.node),
    )


def show(
    host: HostApplication,
    console: Console,
    stop: Callable[[], bool],
    *,
    machine: str | None = None,
    note: Callable[[], str] = lambda: "Ctrl-C ends the view",
    on_events: Callable[[list[HostEvent]], None] = lambda _: None,
) -> None:
    """Show the plant until `stop` says so: a live screen in a terminal, else a line now and then."""

    def seen() -> list[MachineView]:
        return [view for view in machines(host) if machine is None or view.name == machine]

    if not console.is_terminal or console.is_dumb_terminal:
        told_s = time.monotonic()
        while not stop():
            on_events(host.poll(0.2))
            if time.monotonic() - told_s >= PLAIN_LINE_S:
                told_s = time.monotonic()
                console.print(line(seen(), ledgers(host)), markup=False, highlight=False, soft_wrap=True)
        return
    with Live(console=console, auto_refresh=False, transient=True) as live:
        shown_s = 0.0
        while not stop():
            on_events(host.poll(0.1))
            if time.monotonic() - shown_s >= 0.25:
                shown_s = time.monotonic()
                view = screen(seen(), ledgers(host), note(), console.height)
                live.update(Cropped(view, note()), refresh=True)


def watch(broker: BrokerAddress, group: str, machine: str | None, stop: Event) -> None:
    """Look at a broker until stopped."""
    host = viewer(broker, group)
    host.start()
    try:
        show(
            host, Console(), stop.is_set, machine=machine, note=lambda: host.last_error or f"{broker.url} · Ctrl-C ends the view"
        )
    finally:
        host.stop()
