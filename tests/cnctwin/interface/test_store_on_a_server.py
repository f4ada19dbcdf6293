"""The same history in a folder and on a real time-series server: the same tables."""

from pathlib import Path

import pytest

import cnctwin
from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.memory.store.influx.opening import open_influx
from cnctwin.memory.store.influx.store import ServerStore
from sparkplug.host_session import EventKind
from tests.cnctwin.memory.store.influx.servers import Influxd, ServerProcess, VictoriaMetrics
from tests.cnctwin.memory.store.influx.suite import T0_MS as RECENT_MS
from tests.cnctwin.memory.store.told import BAD, T0_MS, reading, steady, told


@pytest.mark.parametrize("kind", [VictoriaMetrics, Influxd])
def test_a_folder_and_a_server_give_the_same_tables(
    kind: type[ServerProcess], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if reason := kind.missing():
        pytest.skip(reason)
    monkeypatch.setenv("CNCTWIN_STATE_DIR", str(tmp_path / "state"))
    at = RECENT_MS - T0_MS
    unknown = reading("spindle_rpm", None, at, BAD, "not known yet")
    messages = [told([unknown, reading("x_mm", 0.5, at)], at, kind=EventKind.BIRTH), *steady(at + 100, 300)]
    messages.append(told([reading("spindle_rpm", 900.0, at + 30_500)], at + 30_500))
    folder = EmbeddedStore(tmp_path / "folder", writable=True)
    folder.append(messages)
    folder.close()
    (tmp_path / "server").mkdir()
    server = kind(tmp_path / "server")
    server.start()
    try:
        writing = open_influx(server.url(), writable=True, spool=tmp_path / "ring")
        assert isinstance(writing, ServerStore)
        writing.append(messages)
        assert writing.drain(60.0), writing.status()
        writing.close()
        server.flush()
        with cnctwin.open_store(tmp_path / "folder") as here, cnctwin.open_store(server.url()) as there:
            assert there.machines() == here.machines() == ["vmc"]
            assert [one.name for one in there.signals("vmc")] == [one.name for one in here.signals("vmc")]
            signals = ["exec_state", "spindle_rpm", "x_mm"]  # with figures of few digits: VictoriaMetrics keeps fifteen
            for asked in ({}, {"details": True}, {"every": "1s"}):
                ours, theirs = (store.table("vmc", signals, **asked).to_pydict() for store in (there, here))  # type: ignore[arg-type]
                assert ours.pop("x_mm") == pytest.approx(theirs.pop("x_mm"), nan_ok=True)
                assert ours == theirs
    finally:
        server.stop()
