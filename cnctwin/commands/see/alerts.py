"""`cnctwin alerts`: what fires, acknowledge it, silence it, try a receiver. All of it over the broker.

Exit codes: 0 = done, or nothing fires unacknowledged; 1 = something does, or the command was not done; 2 = wrong input.
"""

import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Annotated, Any

import typer
from rich.console import Console

from cnctwin.commands.options import AsJson, Broker, Wait
from cnctwin.errors import UsageError
from cnctwin.plant.alert_desk import alert_desk
from cnctwin.processes.given_broker import address
from cnctwin.terminal.console import standard_output
from cnctwin.terminal.table import left_out, text_table

TEST_S_MAX = 30.0
ID_SHOWN = 8
TABLE_WIDTH = 140
OVER_SHOWN_MAX = 20
ALERT_COLUMNS = ("number", "severity", "alert", "state", "since (UTC)", "for", "told", "by")
OVER_COLUMNS = ("number", "severity", "alert", "from (UTC)", "to (UTC)")
GIVES_WAY = ("since (UTC)", "told", "from (UTC)", "severity")
"""Columns that a narrow terminal is not shown; "for" says since when too."""
RECEIVER_COLUMNS = ("receiver", "delivered", "failed", "waiting", "held back", "last error")
_DURATION = re.compile(r"(\d+(?:\.\d+)?)([smhd])")
_SECONDS = {"s": 1.0, "m": 60.0, "h": 3600.0, "d": 86_400.0}

alerts_app = typer.Typer(no_args_is_help=True, help="What fires, who knows of it, and who takes care of it.")

By = Annotated[str, typer.Option(help="Who does it")]
Comment = Annotated[str, typer.Option("--why", "--comment", help="Why, for the log")]


@alerts_app.command("list")
def list_alerts(broker: Broker = None, wait_s: Wait = 5.0, as_json: AsJson = False) -> None:
    """List what fires and what is over, in the words of its notification; silences and receivers.

    Exit code 1: something fires that nobody has acknowledged.
    """
    with alert_desk(address(broker), wait_s) as desk:
        state = desk.state
        if as_json:
            sys.stdout.write(json.dumps(state) + "\n")
        else:
            _show(state)
        fires = any(alert.get("phase") == "firing" for alert in state.get("alerts", ()))
    raise typer.Exit(1 if fires else 0)


@alerts_app.command()
def ack(
    fingerprint: Annotated[str, typer.Argument(help="Number of the alert in `list`, or its beginning")],
    by: By,
    comment: Comment = "",
    broker: Broker = None,
    wait_s: Wait = 5.0,
) -> None:
    """Say that somebody takes care of an alert: it is neither repeated nor escalated."""
    with alert_desk(address(broker), wait_s) as desk:
        alert = _one(desk.state, fingerprint)
        fields = {"fingerprint": alert["fingerprint"], "episode": alert["episode"]}
        print(desk.command("ack", wait_s, by=by, comment=comment, **fields))


@alerts_app.command()
def silence(
    for_: Annotated[str, typer.Option("--for", help="How long: 90s, 30m, 2h, 1d")],
    by: By,
    machine: Annotated[str, typer.Option(help="Alerts of this machine; * and ? stand for any characters")] = "",
    alert: Annotated[str, typer.Option(help="Alerts of this name, as rule_vibration")] = "",
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
    with alert_desk(address(broker), wait_s) as desk:
        print(desk.command("silence", wait_s, by=by, comment=comment, matchers=matchers, for_s=for_s))


@alerts_app.command()
def unsilence(
    silence: Annotated[str, typer.Argument(help="Number of the silence in `list`, or its beginning")],
    by: By,
    broker: Broker = None,
    wait_s: Wait = 5.0,
) -> None:
    """End a silence now."""
    with alert_desk(address(broker), wait_s) as desk:
        print(desk.command("unsilence", wait_s, by=by, silence=_one_silence(desk.state, silence)))


@alerts_app.command("test")
def try_receiver(
    receiver: Annotated[str, typer.Argument(help="Name of the receiver in the configuration")],
    by: By = "cnctwin alerts test",
    broker: Broker = None,
    wait_s: Wait = 5.0,
) -> None:
    """Send a test to a receiver, and say what became of it. Exit code 1: it was not delivered."""
    with alert_desk(address(broker), wait_s) as desk:
        before = _counts(desk.state, receiver)
        key = desk.command("test", wait_s, by=by, receiver=receiver)
        desk.until(lambda: _counts(desk.state, receiver) != before or _not_taken(desk.state, receiver), max(wait_s, TEST_S_MAX))
        failure = next((one for one in desk.state.get("failures", ()) if one.get("id") == key), None)
        if failure is not None:
            print(f"{receiver}: failed: {failure['reason']}", file=sys.stderr)
            raise typer.Exit(1)
        if _counts(desk.state, receiver) == before:
            waits = f"no outcome within {max(wait_s, TEST_S_MAX):g} s; `cnctwin alerts list` shows what waits"
            print(f"{receiver}: {_not_taken(desk.state, receiver) or waits}", file=sys.stderr)
            raise typer.Exit(1)
        print(f"{receiver}: delivered")


def duration_s(text: str) -> float:
    """A duration with its unit. Raises UsageError.

    >>> duration_s("90s"), duration_s("2h"), duration_s("0.5d")
    (90.0, 7200.0, 43200.0)
    """
    if text.strip().replace(".", "", 1).isdecimal():
        raise UsageError(f"--for {text!r} has no unit; write {text.strip()}h for hours, {text.strip()}m for minutes")
    found = _DURATION.fullmatch(text.strip())
    seconds = float(found[1]) * _SECONDS[found[2]] if found else 0.0
    if not 0.0 < seconds <= 30 * 86_400.0:
        raise UsageError(f"{text!r} is no duration of up to 30 days; write 90s, 30m, 2h or 1d")
    return seconds


def _one(state: Mapping[str, Any], start: str) -> Mapping[str, Any]:
    """The alert whose fingerprint begins like this."""
    on = [alert for alert in state.get("alerts", ()) if alert.get("phase") in ("firing", "acknowledged")]
    found: list[Mapping[str, Any]] = [alert for alert in on if start and alert["fingerprint"].startswith(start)]
    if len(found) == 1:
        return found[0]
    firing = ", ".join(f"{alert['fingerprint'][:ID_SHOWN]} {alert['annotations'].get('summary', '')}" for alert in on[:10])
    raise UsageError(f"{len(found) or 'no'} alerts fire whose number begins with {start!r}; there are: {firing or 'none'}")


def _one_silence(state: Mapping[str, Any], start: str) -> str:
    """Return the number of the silence that begins like this."""
    silences = list(state.get("silences", ()))
    found = [str(one["id"]) for one in silences if start and one["id"].startswith(start)]
    if len(found) == 1:
        return found[0]
    there = "; ".join(map(_silence_line, silences[:10])) or "none"
    raise UsageError(f"{len(found) or 'no'} silences have a number that begins with {start!r}; there are: {there}")


def _silence_line(one: Mapping[str, Any]) -> str:
    what = ", ".join(f"{name} {pattern}" for name, pattern in one["matchers"].items())
    why = f": {one['comment']}" if one["comment"] else ""
    return f"{one['id']}: {what}, until {_moment(one['ends'])} UTC, by {one['by']}{why}"


def _counts(state: Mapping[str, Any], receiver: str) -> tuple[int, int]:
    known = state.get("receivers", {}).get(receiver, {})
    return int(known.get("delivered", 0)), int(known.get("failed", 0))


def _not_taken(state: Mapping[str, Any], receiver: str) -> str:
    """Return what is the matter with a notification that is tried again; "" where none is."""
    known = state.get("receivers", {}).get(receiver, {})
    return str(known["last_error"]) if known.get("not_taken") else ""


def _show(state: Mapping[str, Any]) -> None:
    console = standard_output(TABLE_WIDTH)
    alerts = [alert for alert in state.get("alerts", ()) if alert.get("phase") != "resolved"]
    if alerts:
        _print_table(console, ALERT_COLUMNS, map(_alert_row, alerts))
    else:
        console.print("no alert fires")
    over = [alert for alert in state.get("alerts", ()) if alert.get("phase") == "resolved"]
    if over:
        latest = sorted(over, key=lambda alert: str(alert["endsAt"]), reverse=True)[:OVER_SHOWN_MAX]
        console.print()
        _print_table(console, OVER_COLUMNS, map(_over_row, latest))
    for one in state.get("silences", ()):
        console.print(f"silence {_silence_line(one)}", markup=False, highlight=False, soft_wrap=True)
    if state.get("receivers"):
        console.print()
        rows = (_receiver_row(name, known) for name, known in state["receivers"].items())
        _print_table(console, RECEIVER_COLUMNS, rows)


def _print_table(console: Console, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    table = text_table(columns, rows, console.width, [name for name in GIVES_WAY if name in columns])
    console.print(table)
    if missing := left_out(table, columns):
        console.print(f"no room for: {', '.join(missing)}; a wider terminal or --json shows it", style="dim", soft_wrap=True)


def _alert_row(alert: Mapping[str, Any]) -> list[str]:
    notes = [name for name, is_so in (("comes and goes", alert["flapping"]), ("unknown", alert["unknown"])) if is_so]
    notes += [f"silenced {alert['silenced_by']}"] if alert["silenced_by"] else []
    notes += ["UNDELIVERED"] if alert["undelivered"] else []
    phase = ", ".join([alert["phase"], *notes])
    row = (*_named(alert), phase, _moment(alert["startsAt"]), _lasting(alert["startsAt"]))
    return [*row, ", ".join(alert["told"]), alert["acknowledged_by"]]


def _over_row(alert: Mapping[str, Any]) -> list[str]:
    return [*_named(alert), _moment(alert["startsAt"]), _moment(alert["endsAt"])]


def _named(alert: Mapping[str, Any]) -> tuple[str, str, str]:
    """Return the beginning of the fingerprint, the severity, and the first line of a notification over the alert's name."""
    words = f"{alert['annotations']['summary']}\n{alert['labels']['alertname']}"
    return alert["fingerprint"][:ID_SHOWN], alert["severity"], words


def _moment(text: str) -> str:
    return text[:19].replace("T", " ")


def _lasting(began: str) -> str:
    from processors.alerts.words.language import ENGLISH, language
    from processors.alerts.words.wording import duration

    seconds = (datetime.now(UTC) - datetime.fromisoformat(began)).total_seconds()
    return duration(seconds, language(ENGLISH).form)


def _receiver_row(name: str, known: Mapping[str, Any]) -> list[str]:
    return [name, *(str(known[what]) for what in ("delivered", "failed", "waiting", "held_back")), known["last_error"]]
