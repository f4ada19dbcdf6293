"""The broker is away for a while, and the edge is back before the historian: as configured by default the store has every row;
where an edge is told to wait for nobody, the rows that are missing are named."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from cnctwin.plant.doctor import examine
from edge.config import StoreSection
from sparkplug.broker import BrokerAddress
from tests.cnctwin.memory.test_historian_killed import NumberedEdge, stored, values
from tests.cnctwin.program import Program, until
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker
DEFAULTS = StoreSection(free_bytes_min=0)
WITHOUT = StoreSection(free_bytes_min=0, await_receipt=False)


def historian(folder: Path, port: int) -> Program:
    settings = folder / "processors.toml"
    settings.write_text(f'[historian]\nstore = "{folder / "store"}"\nraw_days = 36500.0\nhole_s = 3.0\n')
    (folder / "log").mkdir(exist_ok=True)
    state = str(folder / "state")
    broker = f"mqtt://127.0.0.1:{port}"
    return Program(folder / "log", "process", "historian", "--config", str(settings), "--broker", broker, "--state-dir", state)


def outage(folder: Path, mosquitto: Mosquitto, edge: NumberedEdge, memory: Program) -> None:
    """The broker is away for some seconds, and the historian comes back later than the edge, which has told all by then."""
    until(lambda: stored(folder) > 0, "the first rows in the store", 120.0)
    mosquitto.kill()
    before = edge.rows
    until(lambda: edge.rows > before + 200, "two seconds of rows without a broker")
    memory.process.send_signal(signal.SIGSTOP)
    mosquitto.restart()
    until(lambda: edge.forwarder.health()["health/store_waiting_rows"] == 0, "the history to be told")
    told = edge.rows
    until(lambda: edge.rows > told + 200, "the broker's word for all of it")
    memory.process.send_signal(signal.SIGCONT)


def status(folder: Path) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-m", "cnctwin", "store", "status", "--store", str(folder / "store"), "--json"],
        capture_output=True,
        check=False,
        timeout=120.0,
    )
    told: dict[str, Any] = json.loads(done.stdout)
    return told


def test_by_default_no_row_is_missing(tmp_path: Path, mosquitto: Mosquitto) -> None:
    with historian(tmp_path, mosquitto.port) as memory:
        with NumberedEdge(tmp_path, BrokerAddress(*mosquitto.address), limits=DEFAULTS).running() as edge:
            outage(tmp_path, mosquitto, edge, memory)
            edge.enough()
            until(lambda: edge.forwarder.observations == 0, "a receipt for every row", 180.0)
            rows = edge.rows
        memory.ask_to_end(signal.SIGTERM)
    kept = values(tmp_path)
    assert kept == list(range(rows - len(kept) + 1, rows + 1)), "every row since the edge has heard of the historian"
    assert len(kept) > 300, "and those of the outage are among them"
    assert status(tmp_path)["sequence_holes"] == []


def test_without_receipts_the_rows_that_are_missing_are_named(tmp_path: Path, mosquitto: Mosquitto) -> None:
    with historian(tmp_path, mosquitto.port) as memory:
        with NumberedEdge(tmp_path, BrokerAddress(*mosquitto.address), limits=WITHOUT).running() as edge:
            outage(tmp_path, mosquitto, edge, memory)
            lines: list[str] = []

            def is_named() -> bool:
                report = examine(BrokerAddress(*mosquitto.address), "cnc", 3.0)
                lines[:] = [finding.text for finding in report.findings if "rows of edges are missing" in finding.text]
                return bool(lines)

            until(is_named, "the doctor to name what is missing", 120.0)
            edge.enough()
        memory.ask_to_end(signal.SIGTERM)
    (line,) = lines
    (hole,) = status(tmp_path)["sequence_holes"]
    assert f"vmc: {hole['first']}–{hole['last']} missing since" in line
    kept = set(values(tmp_path))
    # The birth that ended the silence showed the values of the last of them.
    assert not kept.intersection(range(hole["first"], hole["last"]))
    assert {hole["first"] - 1, hole["last"] + 1} <= kept
