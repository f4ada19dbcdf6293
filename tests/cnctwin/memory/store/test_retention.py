"""What is swept, what never is, and what roll-ups say afterwards."""

from pathlib import Path

import numpy as np
import pytest

from cnctwin.memory.store.contract import Message, Pinned, Query, Snapshot, StoreError
from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.memory.store.opening import open_store
from cnctwin.memory.store.plan import load_of, plan
from cnctwin.memory.store.retention import DAY_MS, Retention
from cnctwin.memory.store.store_status import SPARE_FREE_BYTES
from sparkplug.host_session import EventKind
from tests.cnctwin.memory.store.told import BAD, HOUR_MS, T0_MS, TWIN, reading, steady, told

HOURS = 6


@pytest.fixture
def filled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> EmbeddedStore:
    """Six hours of a machine with what its twin says, and a pin in the third hour; all sealed, a file for each hour."""
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.SAMPLES_MIN", 1)
    store = EmbeddedStore(tmp_path, writable=True, retention=Retention(raw_days=2.0, block_days=1.0, disk_bytes=None))
    for hour in range(HOURS):
        store.append(steady(hour * HOUR_MS, 600, every_ms=6000, start=hour))
        at_ms = hour * HOUR_MS
        store.append([told([reading("twin/gap", 0.1 * n, at_ms + n * 60_000) for n in range(60)], at_ms, node=TWIN)])
        store.append([told([reading("wave", tuple(range(hour, hour + 500)), at_ms)], at_ms)])
    store.append([told([reading("x_mm", None, 7000, BAD, "UNAVAILABLE"), reading("exec_state", "READY", 7001)], 7001)])
    store.pin(Pinned("vmc", T0_MS + 2 * HOUR_MS + 1000, T0_MS + 2 * HOUR_MS + 2000, "score 9.1"))
    assert store.tidy(T0_MS + DAY_MS).sealed == HOURS
    return store


def count(store: EmbeddedStore, signal: str, hour: int) -> int:
    [column] = store.query(Query("vmc", (signal,), T0_MS + hour * HOUR_MS, T0_MS + (hour + 1) * HOUR_MS))
    return len(column.t_us)


def test_raw_past_its_time_goes_but_not_what_is_pinned_nor_what_the_twin_says(filled: EmbeddedStore) -> None:
    minutes = Query("vmc", ("x_mm", "exec_state", "twin_like", "twin/gap"), T0_MS, T0_MS + HOURS * HOUR_MS, 60_000)
    before = filled.query(minutes)
    swept = 0
    for day in range(1, 4):
        done = filled.tidy(T0_MS + day * DAY_MS + DAY_MS // 2)
        swept += done.swept
    assert done.pinned > 0 and swept > 0
    raw = [count(filled, "x_mm", hour) for hour in range(HOURS)]
    assert raw.count(0) >= 3 and raw[2] > 0
    assert [count(filled, "twin/gap", hour) for hour in range(HOURS)] == [60] * HOURS
    after = filled.query(minutes)
    for a, b in zip(before, after, strict=True):
        assert (a.t_us, a.count, a.quality, a.reason) == (b.t_us, b.count, b.quality, b.reason)
        assert all(
            x == pytest.approx(y, rel=1e-12) if isinstance(x, float) else x == y for x, y in zip(a.value, b.value, strict=True)
        )
        assert (a.low, a.high) == (b.low, b.high)
    late = [Message(T0_MS + 4 * DAY_MS, m.event) for m in steady(750, 10, every_ms=1500)]
    assert filled.append(late) == (0, 0, 30), "history that comes for a swept hour is too late"
    assert {m.event.kind for m in filled.messages("vmc", T0_MS + 2 * HOUR_MS, T0_MS + 2 * HOUR_MS + 60_000)} == {EventKind.DATA}
    filled.close()


def test_roll_ups_equal_numpy_of_the_raw(filled: EmbeddedStore) -> None:
    filled.tidy(T0_MS + DAY_MS + DAY_MS // 2)
    [raw] = filled.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + HOUR_MS))
    filled.tidy(T0_MS + 4 * DAY_MS)
    assert count(filled, "x_mm", 0) == 0
    [rolled] = filled.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + HOUR_MS, 60_000))
    t = np.array(raw.t_us) // 60_000_000
    values = np.array([np.nan if v is None else v for v in raw.value], dtype=float)
    for n, minute in enumerate(np.unique(t)):
        some = values[t == minute]
        assert rolled.count[n] == len(some)
        assert rolled.value[n] == pytest.approx(np.nanmean(some), rel=1e-12)
        assert (rolled.low[n], rolled.high[n]) == (np.nanmin(some), np.nanmax(some))
    filled.close()


def test_where_the_disk_fills_the_oldest_raw_goes_and_nothing_else(tmp_path: Path, filled: EmbeddedStore) -> None:
    filled.close()
    free = [10**12]
    store = EmbeddedStore(tmp_path, writable=True, retention=Retention(), free_bytes=lambda _: free[0])
    assert store.tidy(T0_MS + DAY_MS).swept == 0
    free[0] = SPARE_FREE_BYTES - 1
    done = store.tidy(T0_MS + DAY_MS + 1)
    assert done.swept >= 1 and done.bytes_freed > 0
    assert count(store, "x_mm", 0) == 0 and count(store, "x_mm", 2) > 0 and count(store, "x_mm", 5) > 0
    for n in range(20):
        store.tidy(T0_MS + DAY_MS + 2 + n)
    assert [count(store, "x_mm", hour) > 0 for hour in range(HOURS)][2] is True
    assert [count(store, "twin/gap", hour) for hour in range(HOURS)] == [60] * HOURS
    store.close()


def test_policy_pins_and_snapshots_outlive_a_restart(tmp_path: Path) -> None:
    policy = Retention(raw_days=30.0, block_days=3.0, disk_bytes=40_000_000_000)
    store = open_store(tmp_path, writable=True, retention=policy)
    for n in range(3):
        store.keep_snapshot(Snapshot("thermal", "vmc", T0_MS + n * HOUR_MS, b"state %d" % n))
    store.close()
    store = EmbeddedStore(tmp_path, writable=True)
    assert store._writer.retention == policy
    assert store.snapshot_before("thermal", "vmc", T0_MS + HOUR_MS) == Snapshot("thermal", "vmc", T0_MS, b"state 0")
    assert store.snapshot_before("thermal", "vmc", T0_MS) is None
    store.close()


def test_a_policy_that_makes_no_sense_is_refused() -> None:
    for wrong in ({"raw_days": 0.0}, {"block_days": float("nan")}, {"disk_bytes": 5}):
        with pytest.raises(StoreError):
            Retention(**wrong)  # type: ignore[arg-type]


def test_a_plan_for_forty_gigabytes() -> None:
    two = plan(load_of(2, 10, 10.0), 40_000_000_000)
    assert two.fits and two.proposed == Retention(365.0, 7.0, 40_000_000_000)
    vibration = plan(load_of(2, 10, 10.0, vibration_hz=2000.0), 10_000_000_000)
    assert not vibration.fits and 3 < vibration.days_to_full < 60
    assert vibration.proposed.block_days >= 1.0
    assert vibration.load.blocks * vibration.proposed.block_days + vibration.load.slow * vibration.proposed.raw_days < 10e9


def test_a_disk_too_small_for_what_stays_for_ever_is_planned_as_such_and_not_divided_by_nothing() -> None:
    made = plan(load_of(500, 11, 10.0), 10_000_000_000)
    assert not made.fits and made.years_for_ever is not None and made.years_for_ever < 1.0
