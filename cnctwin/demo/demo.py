"""`cnctwin demo`: a machine, its edge, a real broker and the twin, started together and accounted for at the end.

Each part is a process of its own, as in production, and is started again when it dies. What is shown and summed up at the end is
read from the broker, as anyone could.
"""

import json
import os
import sys
import time
import webbrowser
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event
from urllib.parse import quote

from rich.console import Console

from cnctwin.demo.loop_outcome import LoopOutcome, LoopWatch
from cnctwin.demo.parts import PROCESSORS, Demo, DemoOptions
from cnctwin.plant.screen import ledger_table
from cnctwin.plant.view import StageLedger, ledgers, machines, text
from cnctwin.plant.watch import show, viewer
from cnctwin.standins.simulated_machine import description
from sparkplug.host import EventKind, HostApplication, HostEvent
from sparkplug.topics import NAMESPACE
from twin.vocabulary.topics import LOOP, MIRROR

GROUP = "cnc"
QUIET_S = 1.5
SETTLE_S_MAX = 12.0


@dataclass(frozen=True, slots=True)
class Summary:
    """The account of a demo. `recording_ended` is None for the simulated machine, `parts` for a recording.

    loop: None where nothing was hidden
    """

    machine: str
    tool_changes: int
    last_tool: str
    seconds: float
    recording_ended: bool | None
    parts: int | None
    restarts: dict[str, int]
    ledgers: tuple[StageLedger, ...]
    loop: LoopOutcome | None = None

    @property
    def balances(self) -> bool:
        """True if every stage published a ledger, each saw something, and each balances."""
        whole = len(self.ledgers) == 1 + len(PROCESSORS) and all(ledger.received for ledger in self.ledgers)
        return whole and all(ledger.balances for ledger in self.ledgers)


class ToolChanges:
    """Counts how often the control's tool change begins, from the events of the broker."""

    def __init__(self, machine: str) -> None:
        self._machine = machine
        self._active = False
        self.count = 0

    def see(self, events: list[HostEvent]) -> None:
        """Take the next events."""
        for event in events:
            if event.device != self._machine or event.kind not in (EventKind.BIRTH, EventKind.DATA):
                continue
            for reading in event.readings:
                if reading.name == "tool_change_active" and isinstance(reading.value, bool):
                    self.count += reading.value and not self._active
                    self._active = reading.value


def run(options: DemoOptions, stop: Event) -> int:
    """Run the demo until its time is over or `stop` is set; the exit code is 1 where the ledger does not balance."""
    console = Console(stderr=options.json)
    if not console.is_terminal:
        console.width = 120
    with TemporaryDirectory(prefix="cnctwin-") as folder, ExitStack() as stack:
        demo = Demo(options, Path(folder))
        stack.callback(demo.stop)
        demo.broker.start()
        host = viewer(demo.broker.address, GROUP)
        host.subscribe_plain(f"{LOOP}+")
        host.start()
        stack.callback(host.stop)
        begun_s = time.monotonic()
        demo.start()
        changes, loop = ToolChanges(demo.machine), LoopWatch(demo.machine, begun_s)

        def see(events: list[HostEvent]) -> None:
            changes.see(events)
            loop.see(events)

        if demo.page_url and not options.no_open:
            open_browser(view_url(demo))
        console.print(greeting(demo), markup=False, highlight=False, soft_wrap=True)
        started_s = time.monotonic()
        ends_s = None if options.seconds is None else started_s + options.seconds

        told = {"", demo.page_url}

        def over() -> bool:
            demo.watch()
            if demo.page_url not in told:  # it came up late
                told.add(demo.page_url)
                console.print(page_line(demo), markup=False, highlight=False, soft_wrap=True)
                if not options.no_open:
                    open_browser(view_url(demo))
            if not console.is_terminal and (notice := demo.notice) not in told:
                told.add(notice)
                console.print(f"{demo.machine}: {notice}", markup=False, highlight=False, soft_wrap=True)
            return stop.is_set() or (ends_s is not None and time.monotonic() >= ends_s)

        show(host, console, over, note=lambda: _note(demo, loop, ends_s), on_events=see)
        ended = demo.recording_ended
        demo.stop_source()
        _settle(host, see)
        summary = Summary(
            machine=demo.machine,
            tool_changes=changes.count,
            last_tool=_last_tool(host, demo.machine),
            seconds=round(time.monotonic() - started_s, 1),
            recording_ended=ended,
            parts=demo.parts,
            restarts=demo.restarts(),
            ledgers=tuple(ledgers(host)),
            loop=loop.outcome(demo.sealed) if demo.hides else None,
        )
        _tell(summary, demo, console, as_json=options.json)
    return 0 if summary.balances else 1


def greeting(demo: Demo) -> str:
    """Return the lines that a user needs to know at the start."""
    port = demo.broker.port
    at = "" if port == 1883 else f" -p {port}"
    speed = demo.options.speed
    if demo.options.recording:
        what = f"{demo.options.recording.name} at {speed:g} times its pace"
    else:
        pace = "in real time" if speed == 1 else f"at {speed:g} times real time"
        what = f"simulated {pace}; it runs {description.PROGRAM.name}, one part after the other"
    return (
        f"{demo.machine}: {what}\n"
        f"{page_line(demo)}\n"
        f"broker:    {demo.broker.address.url} (private, loopback only)\n"
        f"read it:   mosquitto_sub{at} -t '{MIRROR}#' -v          plain JSON, any MQTT client\n"
        f"           mosquitto_sub{at} -t '{NAMESPACE}/#' -F '%t'  the Sparkplug B messages behind it\n"
        f"elsewhere: cnctwin watch --broker {demo.broker.address.url}   cnctwin doctor --broker {demo.broker.address.url}"
    )


def page_line(demo: Demo) -> str:
    """Return the line that says where the page is, or why there is none."""
    return f"page:      {view_url(demo) if demo.page_url else demo.page_trouble}"


def view_url(demo: Demo) -> str:
    """Return the address of the view to begin with: that of the gap, where the loop is followed; a recording has no loop."""
    view = "machine" if demo.options.recording else "gap"
    return f"{demo.page_url}/#/{view}/{quote(demo.machine, safe='')}"


def open_browser(url: str) -> None:
    """Show the page, where somebody sits before a screen: never a text browser inside a terminal or a service."""
    has_screen = sys.platform in {"win32", "darwin"} or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if has_screen and sys.stdout.isatty():
        webbrowser.open(url)


def _settle(host: HostApplication, on_events: Callable[[list[HostEvent]], None]) -> None:
    """Wait until nothing moves any more: the ledgers stay as they are and no stage holds anything back."""
    deadline_s = time.monotonic() + SETTLE_S_MAX
    before: tuple[StageLedger, ...] = ()
    since_s = time.monotonic()
    while time.monotonic() < deadline_s:
        on_events(host.poll(0.1))
        now = tuple(ledgers(host))
        begun = len(now) == 1 + len(PROCESSORS) and all(ledger.received for ledger in now)
        if not begun or now != before or any(ledger.buffered for ledger in now):
            before, since_s = now, time.monotonic()
        elif time.monotonic() - since_s >= QUIET_S:
            return


def _told(loop: LoopOutcome) -> str:
    """Return in a sentence what was hidden, what was named, and what that did to the gap."""
    hidden = f"hidden: {loop.effect}{f' on {loop.on}' if loop.on else ''}"
    if not loop.named:
        return f"{hidden}; the loop named nothing by then"
    others = f", not told apart from {', '.join(loop.not_told_from)}" if loop.not_told_from else ""
    if not loop.promoted or loop.gap_before is None or loop.gap_after is None:
        return f"{hidden}; named: {', '.join(loop.named)}{others}; {'promoted' if loop.promoted else 'not promoted'} by then"
    closed = f", closed after {loop.seconds:.0f} s" if loop.seconds is not None else ""
    gap = f"{loop.gap_before:.1f} → {loop.gap_after:.1f} × the repeatability"
    return f"{hidden}; named: {', '.join(loop.named)}{others}; promoted, standing gap {gap}{closed}"


def _last_tool(host: HostApplication, machine: str) -> str:
    reading = next((m.measured.get("tool_number") for m in machines(host) if m.name == machine), None)
    return "none" if reading is None or reading.value is None else text(reading)


def _note(demo: Demo, loop: LoopWatch, ends_s: float | None) -> str:
    left = "Ctrl-C ends the demo" if ends_s is None else f"{max(ends_s - time.monotonic(), 0):.0f} s left, Ctrl-C ends it earlier"
    ended = " · the recording has ended" if demo.recording_ended else ""
    notice = f" · {demo.notice}" if demo.notice else ""
    twin = f" · twin: {loop.text}" if loop.text else ""
    return f"{left}{ended}{notice}{twin} · mosquitto_sub -p {demo.broker.port} -t '{MIRROR}#' -v"


def _tell(summary: Summary, demo: Demo, console: Console, *, as_json: bool) -> None:
    if as_json:
        ledger = [{**asdict(stage), "balances": stage.balances} for stage in summary.ledgers]
        loop = None if summary.loop is None else summary.loop.as_dict()
        whole = {**asdict(summary), "ledgers": ledger, "balances": summary.balances, "agent": demo.agent_ledger, "loop": loop}
        sys.stdout.write(json.dumps(whole) + "\n")
        return
    if summary.parts is not None:
        state = f"{summary.parts} part{'' if summary.parts == 1 else 's'} made"
    else:
        state = f"the recording was {'' if summary.recording_ended else 'not '}played to its end"
    console.print(
        f"{summary.machine}: {summary.seconds:g} s, {state}; {summary.tool_changes} tool changes, tool {summary.last_tool} last",
        markup=False,
        highlight=False,
    )
    console.print(ledger_table(summary.ledgers))
    if summary.loop is not None:
        console.print(_told(summary.loop), markup=False, highlight=False, soft_wrap=True)
    if summary.restarts:
        console.print(f"started again: {summary.restarts}", markup=False)
    if not summary.balances:
        console.print("the ledger does not balance, or a stage published none", style="bold red")
