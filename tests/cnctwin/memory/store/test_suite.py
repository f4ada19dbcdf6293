"""The suite of every store (`tests/cnctwin/memory/store/influx/suite.py`), run on the embedded one: hot, and sealed."""

from pathlib import Path

import pytest

from cnctwin.memory.store.contract import Store
from cnctwin.memory.store.embedded import EmbeddedStore
from tests.cnctwin.memory.store.influx.suite import T0_MS, Opened, StoreSuite


class TestHot(StoreSuite):
    @pytest.fixture
    def opened(self, tmp_path: Path) -> Opened:
        return lambda: EmbeddedStore(tmp_path, writable=True)


class TestSealed(StoreSuite):
    """Everything is sealed as soon as it is there."""

    @pytest.fixture
    def opened(self, tmp_path: Path) -> Opened:
        self.now_ms = T0_MS + 100 * 3_600_000
        return lambda: EmbeddedStore(tmp_path, writable=True)

    def settle(self, store: Store) -> None:
        self.now_ms += 3_600_000
        store.tidy(self.now_ms)
