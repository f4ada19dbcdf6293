"""The contract of a store, on a real VictoriaMetrics, a real InfluxDB 1.x, and on InfluxDB 2 where one is given."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from cnctwin.memory.store.contract import Store
from cnctwin.memory.store.influx.opening import open_influx
from cnctwin.memory.store.influx.store import ServerStore
from tests.cnctwin.memory.store.influx.servers import Influxd, ServerProcess, VictoriaMetrics, given_influx2
from tests.cnctwin.memory.store.influx.suite import Opened, StoreSuite


def _running(kind: type[ServerProcess], folder: Path) -> Iterator[ServerProcess]:
    if reason := kind.missing():
        pytest.skip(reason)
    server = kind(folder)
    server.start()
    yield server
    server.stop()


@pytest.fixture(scope="module")
def victoria(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    yield from _running(VictoriaMetrics, tmp_path_factory.mktemp("victoria"))


@pytest.fixture(scope="module")
def influxd(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    yield from _running(Influxd, tmp_path_factory.mktemp("influxd"))


class TestVictoriaMetrics(StoreSuite):
    @pytest.fixture
    def opened(self, victoria: VictoriaMetrics, tmp_path: Path) -> Opened:
        self.flush = victoria.flush
        return lambda: open_influx(victoria.url(), writable=True, spool=tmp_path / "ring")

    def settle(self, store: Store) -> None:
        _drained(store)
        self.flush()


class TestInfluxDb1(StoreSuite):
    @pytest.fixture
    def opened(self, influxd: Influxd, tmp_path: Path) -> Opened:
        return lambda: open_influx(influxd.url(), writable=True, spool=tmp_path / "ring")

    def settle(self, store: Store) -> None:
        _drained(store)


class TestInfluxDb2(StoreSuite):
    """Buckets `<prefix>cnc_raw` and so on have to be there: CNCTWIN_INFLUX_URL names server, organisation and prefix."""

    @pytest.fixture
    def opened(self, tmp_path: Path) -> Opened:
        url = given_influx2()
        if not url:
            pytest.skip("no InfluxDB 2 is given: set CNCTWIN_INFLUX_URL=influx+http://host:8086?org=… and CNCTWIN_INFLUX_TOKEN")
        return lambda: open_influx(url, writable=True, spool=tmp_path / "ring")

    def settle(self, store: Store) -> None:
        _drained(store)


def _drained(store: Store) -> None:
    assert isinstance(store, ServerStore)
    assert store.drain(60.0), store.status()
