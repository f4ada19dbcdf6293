"""`cnctwin simulate-control focas`, as a function."""

import json
import struct
import threading
import time
from datetime import UTC, datetime
from pathlib import Path

import pytest

from cnctwin.errors import ApplicationError, UsageError
from cnctwin.standins.focas_server.serve import simulate_focas
from tests.cnctwin.standins.focas_server.client import RawClient, ask
from tests.cnctwin.standins.focas_server.moments import Serve


def test_it_serves_a_working_day_with_a_clock_that_is_wrong_and_tells_its_counts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stop, file = threading.Event(), tmp_path / "state.json"
    options = {"speed": 100.0, "port": 0, "clock_offset_s": -90_000.0, "state_file": file}
    thread = threading.Thread(target=simulate_focas, args=(stop,), kwargs=options)
    thread.start()
    try:
        while not file.exists():
            time.sleep(0.01)
        port = int(json.loads(file.read_text())["url"].rpartition(":")[2])
        with RawClient(port) as client:
            status, date, time_, tool = ask(client, (1, 0x19), (1, 0x45, 0), (1, 0x45, 1), (1, 0x22))
        year, month, day, hour, minute, second = struct.unpack(">6H", date.data[:6] + time_.data[6:])
        shown = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
        assert -90_001 < (shown - datetime.now(UTC)).total_seconds() < -89_000
        assert struct.unpack(">7H", status.data)[0] == 1
        assert tool.code == 6
    finally:
        stop.set()
        thread.join()
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"focas://127.0.0.1:{port} shows a FANUC control, which runs base_plate.nc; Ctrl-C ends it"
    assert lines[1] == "addresses that tell something: variables #500, #501; PMC R100.0, D100:2"
    assert lines[2].startswith("connections 1, frames 2, asked 4, answered 3, refused 1")
    assert json.loads(file.read_text())["ledger"]["answered"] == 3


@pytest.mark.parametrize("speed", [0.0, -1.0, 1e6])
def test_a_speed_that_makes_no_sense_is_wrong_input(speed: float) -> None:
    with pytest.raises(UsageError, match=r"--speed .+ is not between 0 and 1000; 1 is real time"):
        simulate_focas(threading.Event(), speed=speed)


def test_a_port_that_is_taken_is_told_in_one_line(serve: Serve) -> None:
    with pytest.raises(ApplicationError, match="give another port, or 0"):
        simulate_focas(threading.Event(), port=serve().port)
