"""`cnctwin edge run` and the table of `cnctwin edge check`."""

import tomllib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Event, Thread

from rich.table import Table
from rich.text import Text

from cnctwin.given_broker import broker_or_own
from cnctwin.state_dir import state_dir
from edge.adapter import Row
from edge.config_file import load
from edge.run import broker_address, edge_runtime
from sparkplug.broker import BrokerAddress


def run(config_path: Path, given: BrokerAddress | None, stop: Event) -> dict[str, int]:
    """Run the edge of this file until stopped; the last ledger.

    `given` takes the place of the broker in the file; where neither names one, one of our own is started.
    """
    config = load(config_path)
    if not config.broker.session_file:
        file = state_dir() / f"{config.broker.group}.{config.node}.json"
        config = replace(config, broker=config.broker.model_copy(update={"session_file": str(file)}))
    if given is None and _names_broker(config_path):
        given = broker_address(config.broker, config.path)
    with broker_or_own(given) as broker:
        runtime = edge_runtime(config, broker)
        Thread(target=_pass_on, args=(stop, runtime.stop), daemon=True).start()
        runtime.run()
        return runtime.ledger.snapshot()


def table(rows: Sequence[Row]) -> Table:
    """What an edge would publish, for a person to read."""
    shown = Table(title=f"{len(rows)} signals would be published", title_justify="left")
    for column in ("signal", "from", "unit", "native unit", "value now", "why not"):
        shown.add_column(column, overflow="fold")
    for row in rows:
        value = "–" if row.value is None else str(row.value)
        cells = (row.signal, row.source, row.unit or "", row.native_unit or "", value, row.reason or "")
        shown.add_row(*(Text(cell) for cell in cells))  # as text: a bracket in a block of the program is no markup
    return shown


def _names_broker(path: Path) -> bool:
    with suppress(OSError, ValueError, AttributeError):
        return "url" in tomllib.loads(path.read_text()).get("broker", {})
    return False


def _pass_on(stop: Event, runtime_stop: Event) -> None:
    stop.wait()
    runtime_stop.set()
