"""An edge with two brokers and a historian as its primary host: a broker dies, the historian moves, no row is lost or twice."""

from __future__ import annotations

from pathlib import Path

import pytest

from sparkplug.broker import BrokerAddress
from tests.cnctwin.memory.test_historian_killed import NumberedEdge, stored, values
from tests.cnctwin.program import Program, until
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker
MOVES = 3


def test_every_row_is_in_the_store_once_whichever_broker_dies(tmp_path: Path) -> None:
    settings = tmp_path / "processors.toml"
    settings.write_text(f'[historian]\nstore = "{tmp_path / "store"}"\nraw_days = 36500.0\n')
    command = ["process", "historian", "--config", str(settings), "--state-dir", str(tmp_path / "state")]
    (tmp_path / "log").mkdir()

    def stored_further(rows: int) -> None:
        until(lambda: stored(tmp_path) > rows, f"more than {rows} rows in the store", 120.0)

    with Mosquitto() as first, Mosquitto() as second:
        brokers = (first, second)
        addresses = [BrokerAddress(*broker.address) for broker in brokers]
        with NumberedEdge(tmp_path, *addresses, primary_host="twin-historian").running() as edge:
            for move in range(MOVES):
                present, other = brokers[move % 2], brokers[(move + 1) % 2]
                with Program(tmp_path / "log", *command, "--broker", f"mqtt://127.0.0.1:{present.port}"):
                    stored_further(stored(tmp_path) + 100)
                    present.kill()
                    missed = edge.rows
                with Program(tmp_path / "log", *command, "--broker", f"mqtt://127.0.0.1:{other.port}"):
                    stored_further(missed)
                    present.restart()
                    stored_further(edge.rows)
            edge.enough()
            with Program(tmp_path / "log", *command, "--broker", f"mqtt://127.0.0.1:{brokers[MOVES % 2].port}"):
                until(lambda: edge.forwarder.observations == 0, "a receipt for every row", 180.0)
            rows = edge.rows
    assert values(tmp_path) == list(range(1, rows + 1))
