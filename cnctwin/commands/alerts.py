"""`cnctwin alerts`: what fires, acknowledge it, silence it, try a receiver. All of it over the broker.

Exit codes: 0 = done, or nothing fires unacknowledged; 1 = something does, or the command was not done; 2 = wrong input.
"""

import json
import os
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Annotated, Any
from uuid import uuid4

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from cnctwin.errors import UsageError
from cnctwin.processes.given_broker import address
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.host_session import EventKind
from twin.vocabulary.topics import ALERT_COMMAND, ALERT_STATE

FRESH_S_MAX = 150.0  # the state comes once a minute
TEST_S_MAX = 30.0
ID_SHOWN = 8
_DURATION = re.compile(r"(\d+(?:\.\d+)?)([smhd]?)")
_SECONDS = {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0, "d": 86_400.0}

alerts_app = typer.Typer(no_args_is_help=True, help="What fires, who knows of it, and who takes care of it.")

Broker = Annotated[str | None, typer.Option(help="mqtt[s]://[user@]host[:port]; else $CNCTWIN_BROKER", show_default=False)]
By = Annotated[str, typer.Option(help="Who says so")]
Comment = Annotated[str, typer.Option(help="Why")]
Wait = Annotated[float, typer.Option("--wait", help="Seconds to wait for an answer", min=0.5, max=600.0)]
AsJson = Annotated[bool, typer.Option("--json", help="For a program to read")]


@dataclass
class Desk:
    """A connection to the alerts processor: its state as it comes, and a way to give it a command."""

    host: HostApplication
    url: str
    state: dict[str, Any] = field(default_factory=dict)

    def until(self, true: Callable[[], Any], seconds: float) -> Any:
        """Read until something is so; what was not false, or None."""
        deadline_s = time.monotonic() + seconds
        while True:
            for event in self.host.poll(0.05):
                if event.kind is EventKind.PLAIN and event.topic == ALERT_STATE and event.payload:
                    self.state = _parsed(event.payload)
            if (value := true()) or time.monotonic() > deadline_s:
                return value or None

    def command(self, name: str, wait_s: float, **fields: Any) -> str:
        """Give a command and wait for what becomes of it. Raises UsageError where it is not done."""
        key = uuid4().hex[:16]
        payload = json.dumps({"id": key, **fields}, ensure_ascii=False).encode()
        if not self.host.publish_plain(ALERT_COMMAND + name, payload, qos=1):
            raise UsageError(f"the connection to {self.url} was lost; try again")

        def outcome() -> Any:
            return next((one for one in self.state.get("commands", ()) if one.get("id") == key), None)

        found = self.until(outcome, wait_s)
        if found is None:
            raise UsageError(f"no answer within {wait_s:g} s; does the processor `alerts` run? (cnctwin process alerts)")
        if not found["done"]:
            raise UsageError(str(found["text"]))
        return str(found["text"])


@alerts_app.command("list")
def list_alerts(broker: Broker = None, wait_s: Wait = 5.0, as_json: AsJson = False) -> None:
    """All alerts, silences and receivers. Exit code 1: something fires that nobody has acknowledged."""
    with _desk(broker, wait_s) as desk:
        state = desk.state
    if as_json:
        sys.stdout.write(json.dumps(state) + "\n")
    else:
        _show(state, Console())
    raise typer.Exit(1 if any(alert.get("phase") == "firing" for alert in state.get("alerts", ())) else 0)


@alerts_app.command()
def ack(
    fingerprint: Annotated[str, typer.Argument(help="Of the alert, or its beginning")],
    by: By,
    comment: Comment = "",
    broker: Broker = None,
    wait_s: Wait = 5.0,
) -> None:
    """Say that somebody takes care of an alert: it is not repeated and goes to nobody else."""
    with _desk(broker, wait_s) as desk:
        alert = _one(desk.state, fingerprint)
        fields = {"fingerprint": alert["fingerprint"], "episode": alert["episode"]}
        print(desk.command("ack", wait_s, by=by, comment=comment, **fields))


@alerts_app.command()
def silence(
    for_: Annotated[str, typer.Option("--for", help="How long: 90s, 30m, 2h, 1d")],
    by: By,
    machine: Annotated[str, typer.Option(help="Of this machine; * and ? stand for any characters")] = "",
    alert: Annotated[str, typer.Option(help="Of this name, as rule_vibration")] = "",
    severity: Annotated[str, typer.Option(help="low, medium or high")] = "",
    comment: Comment = "",
    broker: Broker = None,
    wait_s: Wait = 5.0,
) -> None:
    """Send no notifications for a while, of alerts that match all that is named."""
    given = {"machine": machine, "alertname": alert, "severity": severity}
    matchers = {name: pattern for name, pattern in given.items() if pattern}
    if not matchers:
        raise UsageError("a silence needs --machine, --alert or --severity; --machine '*' is all of them")
    for_s = duration_s(for_)
    with _desk(broker, wait_s) as desk:
        print(desk.command("silence", wait_s, by=by, comment=comment, matchers=matchers, for_s=for_s))


@alerts_app.command()
def unsilence(
    silence: Annotated[str, typer.Argument(help="Its id, as `list` shows it")], by: By, broker: Broker = None, wait_s: Wait = 5.0
) -> None:
    """End a silence now."""
    with _desk(broker, wait_s) as desk:
        print(desk.command("unsilence", wait_s, by=by, silence=silence))


@alerts_app.command("test")
def try_receiver(
    receiver: Annotated[str, typer.Argument(help="Its name in the configuration")],
    by: By = "cnctwin alerts test",
    broker: Broker = None,
    wait_s: Wait = 5.0,
) -> None:
    """Send a test to a receiver, and say what became of it. Exit code 1: it was not delivered."""
    with _desk(broker, wait_s) as desk:
        before = _counts(desk.state, receiver)
        key = desk.command("test", wait_s, by=by, receiver=receiver)
        desk.until(lambda: _counts(desk.state, receiver) != before, max(wait_s, TEST_S_MAX))
        failure = next((one for one in desk.state.get("failures", ()) if one.get("id") == key), None)
        if failure is not None:
            print(f"{receiver}: failed: {failure['reason']}", file=sys.stderr)
            raise typer.Exit(1)
        if _counts(desk.state, receiver) == before:
            print(f"{receiver}: nothing is known of it yet; is the courier running? `list` shows what waits", file=sys.stderr)
            raise typer.Exit(1)
        print(f"{receiver}: delivered")


def duration_s(text: str) -> float:
    """A duration with its unit. Raises UsageError.

    >>> duration_s("90s"), duration_s("2h"), duration_s("0.5d")
    (90.0, 7200.0, 43200.0)
    """
    found = _DURATION.fullmatch(text.strip())
    seconds = float(found[1]) * _SECONDS[found[2]] if found else 0.0
    if not 0.0 < seconds <= 30 * 86_400.0:
        raise UsageError(f"{text!r} is no duration of up to 30 days; write 90s, 30m, 2h or 1d")
    return seconds


@contextmanager
def _desk(broker: str | None, wait_s: float) -> Iterator[Desk]:
    """A connection, and the state. Raises UsageError where there is none, or one that is not kept up."""
    where = address(broker) or BrokerAddress()
    host = HostApplication(where, f"alerts-{os.getpid()}", (), publish_state=False)
    host.subscribe_plain(ALERT_STATE)
    host.start()
    try:
        desk = Desk(host, where.url)
        if desk.until(lambda: desk.state, wait_s) is None:
            if not host.online:
                raise UsageError(host.last_error or f"no connection to {where.url}")
            raise UsageError(f"{where.url} knows nothing of alerts; does the processor run? (cnctwin process alerts)")
        age_s = _age_s(desk.state)
        if age_s > FRESH_S_MAX:
            raise UsageError(f"the state of alerts is {age_s:.0f} s old: the processor `alerts` does not run any more")
        yield desk
    finally:
        host.stop()


def _parsed(payload: bytes) -> dict[str, Any]:
    try:
        state = json.loads(payload)
    except (ValueError, RecursionError):
        return {}
    return state if isinstance(state, dict) else {}


def _age_s(state: Mapping[str, Any]) -> float:
    try:
        return time.time() - datetime.fromisoformat(str(state["at"])).astimezone(UTC).timestamp()
    except (KeyError, ValueError, OverflowError):
        return float("inf")


def _one(state: Mapping[str, Any], start: str) -> Mapping[str, Any]:
    """The alert whose fingerprint begins like this."""
    on = [alert for alert in state.get("alerts", ()) if alert.get("phase") in ("firing", "acknowledged")]
    found: list[Mapping[str, Any]] = [alert for alert in on if start and alert["fingerprint"].startswith(start)]
    if len(found) == 1:
        return found[0]
    firing = ", ".join(f"{alert['fingerprint'][:ID_SHOWN]} {alert['annotations'].get('summary', '')}" for alert in on[:10])
    raise UsageError(f"{len(found) or 'no'} alerts fire whose fingerprint begins with {start!r}; there are: {firing or 'none'}")


def _counts(state: Mapping[str, Any], receiver: str) -> tuple[int, int]:
    known = state.get("receivers", {}).get(receiver, {})
    return int(known.get("delivered", 0)), int(known.get("failed", 0))


def _show(state: Mapping[str, Any], console: Console) -> None:
    if not console.is_terminal:
        console.width = 140
    alerts = [alert for alert in state.get("alerts", ()) if alert.get("phase") != "resolved"]
    if alerts:
        table = _table("", "severity", "machine", "alert", "state", "since (UTC)", "told", "by")
        for alert in alerts:
            notes = [name for name, is_so in (("flaps", alert["flapping"]), ("unknown", alert["unknown"])) if is_so]
            notes += [f"silenced {alert['silenced_by']}"] if alert["silenced_by"] else []
            notes += ["UNDELIVERED"] if alert["undelivered"] else []
            phase = ", ".join([alert["phase"], *notes])
            labels = alert["labels"]
            row = (alert["fingerprint"][:ID_SHOWN], alert["severity"], labels["machine"], labels["alertname"], phase)
            _row(table, *row, alert["startsAt"][:19], ", ".join(alert["told"]), alert["acknowledged_by"])
        console.print(table)
    else:
        console.print("no alert fires")
    for one in state.get("silences", ()):
        what = ", ".join(f"{name} {pattern}" for name, pattern in one["matchers"].items())
        line = f"silence {one['id']}: {what}, until {one['ends'][:19]} by {one['by']} {one['comment']}".rstrip()
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    if state.get("receivers"):
        table = _table("receiver", "delivered", "failed", "waiting", "held back", "last error")
        for name, known in state["receivers"].items():
            counts = (str(known[what]) for what in ("delivered", "failed", "waiting", "held_back"))
            _row(table, name, *counts, known["last_error"])
        console.print(table)


def _table(*columns: str) -> Table:
    table = Table(show_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _row(table: Table, *cells: str) -> None:
    table.add_row(*(Text(cell) for cell in cells))  # as text: a bracket in a name is no markup
