"""The terminal view: each machine with the twin beside it, and the ledger of each stage.

Whatever comes from the broker is shown as it is: a bracket in a name is a bracket, no markup.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.markup import escape
from rich.panel import Panel
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from cnctwin.plant.view import MachineView, StageLedger, text
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

# Most telling first; what is not in the list follows by name.
FIRST = (
    "exec_state",
    "program",
    "nc_block",
    "tool_number",
    "tool_change_active",
    "tool_change_source",
    "spindle_rpm",
    "spindle_load_pct",
    "feed_mm_min",
    "spindle_temp_c",
    "ambient_temp_c",
)
_TWIN_FIRST = (
    twin_signals.SPINDLE_TEMP_C,
    twin_signals.SPINDLE_TEMP_RESIDUAL_K,
    twin_signals.CUTTING_FORCE_N,
    twin_signals.EXPECTED_CUTTING_FORCE_N,
    twin_signals.SPINDLE_CUT_LOAD_PCT,
    twin_signals.EXPECTED_SPINDLE_LOAD_PCT,
    twin_signals.SPINDLE_LOAD_RESIDUAL_PCT,
    f"{twin_signals.GAP_PREFIX}spindle_temp_c",
    f"{twin_signals.GAP_PREFIX}spindle_load_pct",
    twin_signals.TOOL_CHANGE_GATE,
    twin_signals.ADJUSTED_SCORE,
    twin_signals.ANOMALY_ALARM,
    twin_signals.SEVERITY,
    twin_signals.ALERT_STATE,
)
_STYLE = {Quality.GOOD: "", Quality.STALE: "dim", Quality.BAD: "red"}
_VALUE_WIDTH_MAX = 60
_TEXT_LONG = 24
"""A text of more characters explains something; values that change stand above it."""
ROWS_MIN = 3
_MACHINE_FRAME_ROWS, _LEDGER_FRAME_ROWS, _NOTE_ROWS = 4, 7, 3


def screen(
    machines: Sequence[MachineView], ledgers: Sequence[StageLedger], note: str, height: int | None = None
) -> RenderableType:
    """The whole view. height: rows of the terminal, in which the ledgers come before the last values of the machines"""
    rows = None
    if height is not None and machines:
        taken = _NOTE_ROWS + (len(ledgers) + _LEDGER_FRAME_ROWS if ledgers else 0)
        rows = max(ROWS_MIN, (height - taken) // len(machines) - _MACHINE_FRAME_ROWS)
    parts: list[RenderableType] = [_machine(machine, rows) for machine in machines]
    if not machines:
        parts.append(Panel("waiting for a machine: no edge has announced one yet", title="no machine yet"))
    if ledgers:
        parts.append(_ledgers(ledgers))
    parts.append(Text(note, style="dim"))
    return Group(*parts)


@dataclass(frozen=True, slots=True)
class Cropped:
    """A view cut to the height of the terminal; its last line then says how to see the rest."""

    whole: RenderableType
    note: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield what there is room for."""
        lines = console.render_lines(self.whole, options, pad=False)
        room = console.height - 1
        if len(lines) <= room:
            yield self.whole
            return
        for shown in lines[: room - 1]:
            yield from shown
            yield Segment.line()
        rest = f"{len(lines) - room} more lines: enlarge the window, or name one machine (cnctwin watch MACHINE) · {self.note}"
        yield Text(rest, style="dim", no_wrap=True, overflow="ellipsis")


def line(machines: Sequence[MachineView], ledgers: Sequence[StageLedger]) -> str:
    """One line for a place that is no terminal."""
    if not machines:
        return "no machine yet"
    parts = []
    for machine in machines:
        values = {**machine.measured, **machine.twin}
        shown = (
            "exec_state",
            "tool_number",
            "spindle_rpm",
            "spindle_load_pct",
            twin_signals.SPINDLE_TEMP_C,
            twin_signals.CUTTING_FORCE_N,
        )
        told = ", ".join(f"{name} {text(values[name])}" for name in shown if name in values)
        change = values.get("tool_change_active")
        parts.append(f"{machine.name}: {told}{', TOOL CHANGE' if change is not None and change.value is True else ''}")
    counted = ", ".join(f"{ledger.node} {ledger.received}" for ledger in ledgers)
    return "; ".join(parts) + f" [{counted}]"


def ledger_table(ledgers: Sequence[StageLedger], *, one_row: bool = False) -> Table:
    """The ledger of each stage: received = emitted + dropped + buffered. one_row: of a stage, whatever its reasons need"""
    table = Table(title="received = emitted + dropped + buffered", title_justify="left", expand=False)
    table.add_column("stage", no_wrap=True)
    for name in ("received", "emitted", "dropped", "buffered"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("balances", no_wrap=True)
    table.add_column("dropped because", no_wrap=one_row, overflow="ellipsis" if one_row else "fold")
    for ledger in ledgers:
        table.add_row(
            Text(ledger.node + ("" if ledger.online else " (offline)")),
            *(f"{n:,}" for n in (ledger.received, ledger.emitted, ledger.dropped, ledger.buffered)),
            Text("yes", style="green") if ledger.balances else Text(f"no, {ledger.missing:+d}", style="bold red"),
            Text(", ".join(f"{reason} {n:,}" for reason, n in sorted(ledger.reasons.items(), key=lambda item: -item[1]))),
        )
    return table


def _machine(machine: MachineView, rows_max: int | None) -> Panel:
    table = Table(show_edge=False, expand=True)
    for title, ratio in (("measured", 3), ("", 4), ("time (UTC)", 2), ("twin, rules, alerts", 4), ("", 4)):
        table.add_column(title, ratio=ratio, no_wrap=True, overflow="ellipsis")
    measured, twin = _ordered(machine.measured, FIRST), _ordered(machine.twin, _TWIN_FIRST)
    rows = max(len(measured), len(twin))
    shown = rows if rows_max is None else min(rows, rows_max)
    for row in range(shown):
        reading = measured[row] if row < len(measured) else None
        beside = twin[row] if row < len(twin) else None
        table.add_row(
            Text(reading.name if reading else ""),
            _cell(reading),
            _clock(reading),
            Text(beside.name.removeprefix(twin_signals.TWIN_PREFIX) if beside else ""),
            _cell(beside),
        )
    state = "[green]online[/]" if machine.online else "[red]offline: values are stale[/]"
    hidden = max(len(measured) - shown, 0) + max(len(twin) - shown, 0)
    more = f"{hidden} more signals in a taller terminal" if hidden else None
    return Panel(
        table, title=f"[bold]{escape(machine.name)}[/] {state}", title_align="left", subtitle=more, subtitle_align="right"
    )


def _ordered(readings: Mapping[str, Reading], first: Sequence[str]) -> list[Reading]:
    """Return readings as a person looks for them: the most telling first, then the known, then those that explain; no JSON."""
    rank = {name: place for place, name in enumerate(first)}

    def place(reading: Reading) -> tuple[int, bool, bool, str]:
        is_long = isinstance(reading.value, str) and len(reading.value) > _TEXT_LONG
        return rank.get(reading.name, len(rank)), reading.value is None, is_long, reading.name

    return sorted((one for one in readings.values() if not _is_json(one)), key=place)


def _is_json(reading: Reading) -> bool:
    """Return True for a value that only programs read: a JSON object or list.

    >>> _is_json(Reading("twin/stops", '{"no data": 1}', 0, Quality.GOOD, None, None, False))
    True
    >>> _is_json(Reading("nc_block", "[#25]", 0, Quality.GOOD, None, None, False))
    False
    """
    if not isinstance(reading.value, str) or not reading.value.startswith(("{", "[")):
        return False
    try:
        json.loads(reading.value)
    except ValueError:
        return False
    return True


def _cell(reading: Reading | None) -> Text:
    if reading is None:
        return Text("")
    changing = reading.name == "tool_change_active" and reading.value is True
    return Text(text(reading)[:_VALUE_WIDTH_MAX], style="bold yellow" if changing else _STYLE[reading.quality])


def _clock(reading: Reading | None) -> str:
    if reading is None or not reading.timestamp_ms:
        return ""
    return datetime.fromtimestamp(reading.timestamp_ms / 1000, UTC).strftime("%H:%M:%S.%f")[:-5]


def _ledgers(ledgers: Sequence[StageLedger]) -> Panel:
    return Panel(ledger_table(ledgers, one_row=True), title="accounted for", title_align="left")
