"""A replay in the terminal."""

from datetime import UTC, datetime

from rich.console import Console
from rich.table import Table

from cnctwin.memory.descriptions import Described
from cnctwin.memory.replay.result import ProcessorReplayed, Replayed

LISTED_MAX = 10


def shown(replayed: Replayed, console: Console) -> None:
    """Print the result, by processor and by metric that differs."""
    table = Table(title=f"{replayed.machine}, {_at(replayed.from_ms)} to {_at(replayed.to_ms)}", title_justify="left")
    for column in ("processor", "same", "differing", "missing", "extra", "restarts", "start"):
        table.add_column(column, justify="left" if column in {"processor", "start"} else "right")
    for one in replayed.processors:
        table.add_row(one.name, *map(str, one.totals), str(one.restarts), one.start)
    console.print(table)
    for described in replayed.descriptions:
        _line(console, _description(described))
    for one in replayed.processors:
        _differences(one, console)
    for note in [f"{one.name}: {note}" for one in replayed.processors for note in one.notes]:
        _line(console, f"note: {note}")
    verdict = "the same, bit for bit" if replayed.is_equal else "NOT the same"
    _line(console, f"{verdict}: {replayed.compared} values compared; {replayed.messages} messages, {replayed.samples} samples")
    _line(console, f"{replayed.seconds:.1f} s, {replayed.speed:.0f} times real time; sha256 {replayed.sha256}")


def _description(one: Described) -> str:
    """Return one line on a description: which, from when, and how it came to be."""
    if one.message is None:
        return f"no {one.role} description from {_at(one.received_ms)}"
    message = one.message
    how = " ".join(filter(None, (message.step, f"by {message.by}" if message.by else "")))
    return f"{one.role} description {one.version} from {_at(one.received_ms)}" + ": ".join(
        ("", *filter(None, (how, message.why)))
    )


def _differences(one: ProcessorReplayed, console: Console) -> None:
    for metric in [metric for metric in one.metrics if metric.first is not None][:LISTED_MAX]:
        first = metric.first
        assert first is not None
        text = f"{metric.signal}: {metric.differing} differ, {metric.missing} are missing, {metric.extra} are extra"
        if metric.largest is not None:
            text += f", by {metric.largest:.3g} at the most"
        _line(
            console, f"{text}; first {first.what} at {_at(first.t)}: then {first.published!r:.60}, now {first.recomputed!r:.60}"
        )


def _line(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def _at(at_ms: int) -> str:
    return datetime.fromtimestamp(at_ms / 1000, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
