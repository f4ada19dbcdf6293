"""`cnctwin simulate-control lsv2`, as the function that the command calls."""

import json
import socket
import threading
from pathlib import Path

import pyLSV2
import pytest

from cnctwin.errors import ApplicationError, UsageError
from cnctwin.standins.lsv2_server.serve import simulate_lsv2


def test_it_serves_until_it_is_stopped_and_says_where(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stop, state = threading.Event(), tmp_path / "state.json"
    options = {"speed": 60.0, "port": 0, "model": "iTNC530", "state_file": state}
    thread = threading.Thread(target=lambda: simulate_lsv2(stop, **options), daemon=True)  # type: ignore[arg-type]
    thread.start()
    while not state.exists():
        assert thread.is_alive()
        stop.wait(0.05)
    url = json.loads(state.read_text())["url"]
    client = pyLSV2.LSV2("127.0.0.1", port=int(url.rpartition(":")[2]), timeout=30.0, safe_mode=False)
    client.connect()
    assert client.versions.control == "iTNC530"
    client.disconnect()
    stop.set()
    thread.join(60)
    assert not thread.is_alive()
    out = capsys.readouterr().out
    assert out.startswith("lsv2://127.0.0.1:")
    told = "PLC addresses that tell something: M4000, M4001, W1000, D1004, W1008, D1012, W1016, S0; any PLC password is right"
    assert told in out
    assert "writes refused 0" in out
    assert json.loads(state.read_text())["telegrams"] > 5


def test_its_mistakes_are_one_line_each(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--speed"):
        simulate_lsv2(threading.Event(), speed=0.0)
    with pytest.raises(UsageError, match="--model 'TNC7' is not known; there are iTNC530 and TNC640"):
        simulate_lsv2(threading.Event(), model="TNC7")
    with pytest.raises(UsageError, match="--program"):
        simulate_lsv2(threading.Event(), program=tmp_path / "none.h")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(ApplicationError, match="give another with --port"):
            simulate_lsv2(threading.Event(), port=taken.getsockname()[1])
