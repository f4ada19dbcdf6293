"""The power goes just after something was said to be safe: it is there. A receipt makes an edge forget, so it has to be true."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from cnctwin.memory.parts.journal import Journal
from cnctwin.memory.store.contract import Query
from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.memory.store.influx.spool import RingLimits, Spool
from cnctwin.memory.store.sealed.manifest import DAY_MS
from tests.cnctwin.memory.power_cut import cuts, is_possible, lay_out
from tests.cnctwin.memory.store.told import T0_MS
from tests.cnctwin.memory.writes_for_power import BATCHES


def messages_in(folder: Path) -> int:
    store = EmbeddedStore(folder / "store", writable=True, free_bytes=lambda _: 10**12)
    try:
        [column] = store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + 100 * DAY_MS))
    finally:
        store.close()
    return len(column.t_us)


def samples_in(folder: Path) -> int:
    spool = Spool(folder, RingLimits(), wall_ms=lambda: 0, free_bytes=lambda _: 10**12)
    try:
        return spool.held
    finally:
        spool.close()


def parts_in(folder: Path) -> int:
    return len(Journal.read(folder / "mes.json").ids)


@pytest.mark.parametrize(
    ("what", "count"), [("appended", messages_in), ("sealed", messages_in), ("spooled", samples_in), ("delivered", parts_in)]
)
def test_what_was_said_to_be_safe_outlives_a_power_cut(tmp_path: Path, what: str, count: Callable[[Path], int]) -> None:
    if not is_possible():
        pytest.skip("no strace here that may look at a program")
    root = tmp_path / "disk"
    root.mkdir()
    command = [sys.executable, "-m", "tests.cnctwin.memory.writes_for_power", what, str(root)]
    seen = 0
    for number, cut in enumerate(cuts(root, tmp_path / "calls", *command)):
        there = tmp_path / f"after-{number}"
        lay_out(cut, root, there)
        assert count(there / "deep") == int(cut.said)
        seen += 1
    assert seen == BATCHES
    assert what != "sealed" or any(path.suffix == ".parquet" for path in there.rglob("*"))
