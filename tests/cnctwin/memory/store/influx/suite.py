"""The suite of every store, wherever its bytes lie. Subclass it and give `opened`, a fixture that opens the same place each time.

class TestEmbedded(StoreSuite):
    @pytest.fixture
    def opened(self, tmp_path: Path) -> Opened:
        return lambda: open_store(tmp_path, writable=True)
"""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any
from uuid import uuid4

import pytest

from cnctwin.memory.store.contract import DERIVED, RAW, Appended, Column, Message, Pinned, Query, Sample, Store
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

Opened = Callable[[], Store]
GOOD, STALE, BAD = Quality.GOOD, Quality.STALE, Quality.BAD
EDGE, OTHER = NodeId("cnc", "hall"), NodeId("cnc", "hall-2")
UNITS = {"spindle_rpm": "rev/min", "spindle_load_pct": "%", "twin/spindle_temp_c": "°C"}
T0_MS = int(time.time()) // 3600 * 3_600_000 - 3 * 3_600_000
"""A whole hour, three to four hours ago: within every server's retention."""


def reading(
    name: str, value: Any, t_ms: int, quality: Quality = GOOD, reason: str | None = None, *, history: bool = False
) -> Reading:
    """A reading `t_ms` after T0_MS."""
    return Reading(name, value, T0_MS + t_ms, quality, UNITS.get(name), reason, history)


def told(machine: str, *readings: Reading, kind: EventKind = EventKind.DATA, node: NodeId = EDGE, t_ms: int = 0) -> Message:
    """A message of a machine, received half a second after it was sent."""
    sent_ms = T0_MS + t_ms
    return Message(sent_ms + 500, HostEvent(kind, node, machine, sent_ms, readings))


def points(column: Column) -> list[tuple[int, Any]]:
    """Times, in ms after T0_MS, and values."""
    return [(t_us // 1000 - T0_MS, value) for t_us, value in zip(column.t_us, column.value, strict=True)]


class StoreSuite:
    """The contract of `cnctwin.memory.store.contract.Store` about samples."""

    figures_rel = 1e-12
    """VictoriaMetrics keeps numbers as decimals: the last digits of a double may differ."""

    @pytest.fixture
    def opened(self) -> Opened:
        raise NotImplementedError

    @pytest.fixture
    def machine(self) -> str:
        return f"vmc-{uuid4().hex[:8]}"

    @pytest.fixture
    def store(self, opened: Opened) -> Iterator[Store]:
        store = opened()
        yield store
        store.close()

    def settle(self, store: Store) -> None:
        """Wait until what was appended can be asked for."""

    def keep(self, store: Store, *messages: Message) -> Appended:
        """Append and settle."""
        appended = store.append(messages)
        self.settle(store)
        return appended

    def ask(self, store: Store, machine: str, *signals: str, every_ms: int | None = None, span_ms: int = 600_000) -> list[Column]:
        """The columns from T0_MS on."""
        return store.query(Query(machine, signals, T0_MS, T0_MS + span_ms, every_ms))

    def test_samples_come_back_with_value_time_unit_quality_and_reason(self, store: Store, machine: str) -> None:
        kept = self.keep(
            store,
            told(machine, reading("spindle_rpm", 0.1, 0), reading("coolant_on", True, 0), kind=EventKind.BIRTH),
            told(machine, reading("spindle_rpm", 8000, 100), reading("exec_state", "ACTIVE", 100), t_ms=100),
            told(machine, reading("spindle_rpm", None, 200, BAD, "the control says UNAVAILABLE"), t_ms=200),
            told(machine, reading("spindle_rpm", -1e-7, 300, BAD, "below 0"), reading("coolant_on", False, 300), t_ms=300),
        )
        assert kept == Appended(7, 0, 0)
        rpm, state, coolant, nothing = self.ask(store, machine, "spindle_rpm", "exec_state", "coolant_on", "never_told")
        assert rpm.signal == "spindle_rpm" and rpm.unit == "rev/min"
        assert rpm.t_us == [(T0_MS + t) * 1000 for t in (0, 100, 200, 300)]
        assert rpm.value[2] is None
        assert [v for v in rpm.value if v is not None] == pytest.approx([0.1, 8000, -1e-7], rel=self.figures_rel)
        assert rpm.quality == [GOOD, GOOD, BAD, BAD]
        assert rpm.reason == [None, None, "the control says UNAVAILABLE", "below 0"]
        assert rpm.low == rpm.high == rpm.count == []
        assert points(state) == [(100, "ACTIVE")] and state.unit is None
        assert points(coolant) == [(0, True), (300, False)] and all(isinstance(v, bool) for v in coolant.value)
        assert nothing.t_us == [] and nothing.signal == "never_told"

    def test_what_comes_again_is_there_once(self, opened: Opened, machine: str) -> None:
        messages = [told(machine, reading("spindle_rpm", n, n * 10, history=True), t_ms=n * 10) for n in range(50)]
        store = opened()
        assert self.keep(store, *messages) == Appended(50, 0, 0)
        assert self.keep(store, *messages) == Appended(0, 50, 0)
        store.close()
        store = opened()
        birth = told(machine, reading("spindle_rpm", 49, 490), kind=EventKind.BIRTH, t_ms=1000)
        assert self.keep(store, birth, *messages[:3]).stored == 0
        [column] = self.ask(store, machine, "spindle_rpm")
        assert points(column) == [(n * 10, n) for n in range(50)]
        store.close()

    def test_different_values_of_one_millisecond_are_numbered(self, opened: Opened, machine: str) -> None:
        first = told(machine, reading("spindle_rpm", 1, 0, history=True), reading("exec_state", "READY", 0, history=True))
        second = told(machine, reading("spindle_rpm", 2, 0, history=True), reading("exec_state", "ACTIVE", 0, history=True))
        store = opened()
        self.keep(store, first, second)
        assert self.keep(store, second, first) == Appended(0, 4, 0)
        store.close()
        store = opened()
        assert self.keep(store, second, first) == Appended(0, 4, 0)
        rpm, state = self.ask(store, machine, "spindle_rpm", "exec_state")
        assert rpm.t_us == state.t_us == [T0_MS * 1000, T0_MS * 1000 + 1]
        assert rpm.value == [1, 2] and state.value == ["READY", "ACTIVE"]
        store.close()

    def test_a_live_value_that_came_back_within_a_millisecond_is_a_third_sample(self, store: Store, machine: str) -> None:
        self.keep(store, *(told(machine, reading("coolant_on", value, 0)) for value in (True, False, True)))
        [coolant] = self.ask(store, machine, "coolant_on")
        assert coolant.value == [True, False, True]
        assert coolant.t_us == [T0_MS * 1000 + n for n in range(3)]

    def test_windows_hold_mean_low_high_and_count(self, store: Store, machine: str) -> None:
        self.keep(
            store,
            *(told(machine, reading("spindle_load_pct", float(n), n * 100), t_ms=n * 100) for n in range(25)),
            told(machine, reading("spindle_load_pct", 500.0, 2450, BAD, "outside 0 to 200 %"), t_ms=2450),
            told(machine, reading("spindle_load_pct", None, 7000, BAD, "not told"), t_ms=7000),
        )
        [load] = self.ask(store, machine, "spindle_load_pct", every_ms=1000, span_ms=60_000)
        assert [t // 1000 - T0_MS for t in load.t_us] == [0, 1000, 2000, 7000]
        assert load.value[:3] == pytest.approx([4.5, 14.5, 22.0]) and load.value[3] is None
        assert (load.low, load.high) == ([0, 10, 20, None], [9, 19, 24, None])
        assert load.count == [10, 10, 6, 1]
        assert load.quality == [GOOD, GOOD, BAD, BAD]
        assert load.reason == [None, None, "outside 0 to 200 %", "not told"]

    def test_a_question_may_begin_and_end_within_a_window(self, store: Store, machine: str) -> None:
        self.keep(store, *(told(machine, reading("spindle_rpm", n, n * 100), t_ms=n * 100) for n in range(60)))
        [rpm] = store.query(Query(machine, ("spindle_rpm",), T0_MS + 550, T0_MS + 3250, 1000))
        assert [t // 1000 - T0_MS for t in rpm.t_us] == [0, 1000, 2000, 3000]
        assert rpm.count == [4, 10, 10, 3]
        assert rpm.value == pytest.approx([7.5, 14.5, 24.5, 31.0])
        [rpm] = store.query(Query(machine, ("spindle_rpm",), T0_MS + 1100, T0_MS + 1400))
        assert points(rpm) == [(1100, 11), (1200, 12), (1300, 13)]

    def test_windows_of_texts_and_bools_hold_the_last_one(self, store: Store, machine: str) -> None:
        self.keep(
            store,
            told(machine, reading("exec_state", "READY", 100), reading("coolant_on", True, 100)),
            told(machine, reading("exec_state", "ACTIVE", 600), reading("coolant_on", False, 600), t_ms=600),
            told(machine, reading("exec_state", "READY", 1100, STALE, "edge offline"), t_ms=1100),
        )
        state, coolant = self.ask(store, machine, "exec_state", "coolant_on", every_ms=1000)
        assert points(state) == [(0, "ACTIVE"), (1000, "READY")]
        assert state.quality == [GOOD, STALE] and state.reason == [None, "edge offline"]
        assert state.low == state.high == [None, None] and state.count == [2, 1]
        assert points(coolant) == [(0, False)] and coolant.value[0] is False

    def test_the_reason_of_a_window_is_that_of_its_worst_sample(self, store: Store, machine: str) -> None:
        self.keep(
            store,
            told(machine, reading("spindle_rpm", 1, 0, BAD, "too low")),
            told(machine, reading("spindle_rpm", 2, 100, STALE, "edge offline"), t_ms=100),
            told(machine, reading("spindle_rpm", 3, 200), t_ms=200),
        )
        [rpm] = self.ask(store, machine, "spindle_rpm", every_ms=1000)
        assert (rpm.quality, rpm.reason, rpm.value, rpm.count) == ([BAD], ["too low"], [3], [3])

    def test_series_and_machines_are_known(self, store: Store, machine: str) -> None:
        self.keep(
            store,
            told(machine, reading("spindle_rpm", 1, 0), reading("exec_state", "READY", 0), kind=EventKind.BIRTH),
            told(machine, reading("spindle_rpm", 2, 5000), t_ms=5000),
            told(machine, reading("twin/spindle_temp_c", 31.5, 1000), node=NodeId("cnc", "twin-thermal"), t_ms=1000),
        )
        assert machine in store.machines()
        series = store.series(machine)
        assert [(s.signal, s.node, s.unit, s.measurement) for s in series] == [
            ("exec_state", "cnc/hall", None, RAW),
            ("spindle_rpm", "cnc/hall", "rev/min", RAW),
            ("twin/spindle_temp_c", "cnc/twin-thermal", "°C", DERIVED),
        ]
        assert (series[1].first_us, series[1].last_us) == (T0_MS * 1000, (T0_MS + 5000) * 1000)
        assert store.series("nobody") == [] and store.latest("nobody") == {}

    def test_the_latest_of_each_signal(self, store: Store, machine: str) -> None:
        self.keep(
            store,
            told(machine, reading("spindle_rpm", 1, 0), reading("coolant_on", True, 0), kind=EventKind.BIRTH),
            told(machine, reading("spindle_rpm", 2, 5000), reading("twin/spindle_temp_c", 31.5, 5000), t_ms=5000),
            told(machine, reading("spindle_rpm", None, 6000, BAD, "UNAVAILABLE"), t_ms=6000),
            told(machine, reading("exec_state", "ACTIVE", 7000), t_ms=7000),
        )
        latest = store.latest(machine)
        assert latest["spindle_rpm"] == Sample("spindle_rpm", (T0_MS + 6000) * 1000, None, BAD, "UNAVAILABLE", "rev/min")
        assert latest["coolant_on"] == Sample("coolant_on", T0_MS * 1000, True, GOOD, None, None)
        assert latest["exec_state"].value == "ACTIVE" and latest["twin/spindle_temp_c"].value == 31.5

    def test_a_death_makes_stale_and_a_birth_after_it_makes_good_again(self, store: Store, machine: str) -> None:
        self.keep(
            store,
            told(machine, reading("spindle_rpm", 5, 0), kind=EventKind.BIRTH),
            told(machine, reading("spindle_rpm", 5, 1000, STALE, "edge offline"), kind=EventKind.DEATH, t_ms=1000),
        )
        assert store.latest(machine)["spindle_rpm"].quality is STALE
        self.keep(store, told(machine, reading("spindle_rpm", 5, 0), kind=EventKind.BIRTH, t_ms=2000))
        [rpm] = self.ask(store, machine, "spindle_rpm")
        assert points(rpm) == [(0, 5), (1000, 5), (2000, 5)]
        assert rpm.quality == [GOOD, STALE, GOOD] and rpm.reason == [None, "edge offline", None]
        assert store.latest(machine)["spindle_rpm"] == Sample("spindle_rpm", (T0_MS + 2000) * 1000, 5, GOOD, None, "rev/min")

    def test_two_nodes_that_tell_a_signal_are_merged_by_time(self, store: Store, machine: str) -> None:
        self.keep(
            store,
            told(machine, reading("spindle_rpm", 1, 0), reading("spindle_rpm", 3, 200)),
            told(machine, reading("spindle_rpm", 2, 100), node=OTHER),
        )
        [rpm] = self.ask(store, machine, "spindle_rpm")
        assert points(rpm) == [(0, 1), (100, 2), (200, 3)]
        [rpm] = self.ask(store, machine, "spindle_rpm", every_ms=1000)
        assert (rpm.value, rpm.count) == ([2], [3])

    def test_nodes_holes_and_plain_messages_are_no_samples(self, store: Store, machine: str) -> None:
        hole = HostEvent(EventKind.HOLE, EDGE, None, T0_MS, (), "3 messages are lost")
        node = HostEvent(EventKind.BIRTH, EDGE, None, T0_MS, (reading("health/rows", 1, 0),))
        assert self.keep(store, Message(T0_MS, hole), Message(T0_MS, node)) == Appended(0, 0, 0)

    def test_names_and_reasons_may_hold_any_printable_text(self, store: Store, machine: str) -> None:
        signal, odd = "gap_x, y=\"z\" 'µ' {a|b}.*", 'says "no", it\'s 5 % = café'
        self.keep(store, told(machine, reading(signal, 1, 0, BAD, odd), reading("gap_x", 2, 0)))
        [column] = self.ask(store, machine, signal)
        assert points(column) == [(0, 1)] and column.reason == [odd]
        assert {s.signal for s in store.series(machine)} == {signal, "gap_x"}

    def test_what_cannot_be_kept_is_counted_and_the_rest_goes_through(self, store: Store, machine: str) -> None:
        table = object()
        kept = self.keep(store, told(machine, reading("layout", table, 0), reading("spindle_rpm", 1, 0)))
        assert kept == Appended(1, 0, 1)
        [rpm] = self.ask(store, machine, "spindle_rpm")
        assert points(rpm) == [(0, 1)]
        assert not [v for v in rpm.value if isinstance(v, float) and math.isnan(v)]

    def test_many_windows_and_many_signals_fit_one_question(self, store: Store, machine: str) -> None:
        signals = [f"axis_x{n}_load_pct" for n in range(60)]
        self.keep(store, told(machine, *(reading(signal, n, 0) for n, signal in enumerate(signals))))
        found = store.query(Query(machine, tuple(signals), T0_MS, T0_MS + 25_000_000, 1000))
        assert [column.value for column in found] == [[n] for n in range(60)]
        assert [column.signal for column in found] == signals

    def test_a_pin_is_kept_once_and_over_a_restart(self, opened: Opened, machine: str) -> None:
        store = opened()
        pinned = Pinned(machine, T0_MS, T0_MS + 60_000, "gap of spindle_temp_c grows")
        store.pin(pinned)
        store.pin(pinned)
        store.pin(pinned._replace(reason="score 9.1"))
        store.close()
        store = opened()
        assert store.pins(machine) == [pinned._replace(reason=f"{pinned.reason}, score 9.1")]
        assert store.pins("nobody") == []
        store.close()
