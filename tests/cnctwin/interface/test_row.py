"""The row of one machine, event by event."""

from datetime import UTC, datetime

from cnctwin.interface.row import Rows
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

EDGE, TWIN = NodeId("cnc", "edge-vmc"), NodeId("cnc", "twin-thermal")


def told(kind: EventKind, *readings: Reading, node: NodeId = EDGE, device: str | None = "vmc") -> HostEvent:
    return HostEvent(kind, node, device, 0, readings)


def reading(name: str, value: object, t_ms: int = 0, quality: Quality = Quality.GOOD, *, history: bool = False) -> Reading:
    return Reading(name, value, t_ms, quality, "%", None if quality is Quality.GOOD else "gone", history)  # type: ignore[arg-type]


def test_a_row_holds_what_the_control_and_its_twin_said_last() -> None:
    rows = Rows("vmc")
    rows.after(told(EventKind.BIRTH, reading("spindle_load_pct", 3.0), reading("exec_state", None, quality=Quality.BAD)))
    rows.after(told(EventKind.BIRTH, reading("twin/cutting_force_n", 80.0), node=TWIN))
    row = rows.after(told(EventKind.DATA, reading("spindle_load_pct", 4.0, 1500)))
    assert row is not None
    assert row.values() == {"spindle_load_pct": 4.0, "exec_state": None, "twin/cutting_force_n": 80.0}
    assert row.changed == ("spindle_load_pct",)
    assert row.t == row["spindle_load_pct"].t == datetime(1970, 1, 1, 0, 0, 1, 500_000, UTC)
    assert (row["exec_state"].quality, row["exec_state"].reason, row["exec_state"].unit) == ("bad", "gone", "%")


def test_a_twin_that_is_heard_before_the_edge_makes_no_row() -> None:
    rows = Rows("vmc")
    assert rows.after(told(EventKind.BIRTH, reading("twin/cutting_force_n", 80.0), node=TWIN)) is None
    row = rows.after(told(EventKind.BIRTH, reading("spindle_load_pct", 3.0)))
    assert row is not None and set(row.signals) == {"spindle_load_pct", "twin/cutting_force_n"}


def test_a_death_makes_a_row_whose_values_are_stale() -> None:
    rows = Rows("vmc")
    rows.after(told(EventKind.BIRTH, reading("spindle_load_pct", 3.0)))
    row = rows.after(told(EventKind.DEATH, reading("spindle_load_pct", 3.0, 9, Quality.STALE)))
    assert row is not None and row["spindle_load_pct"].quality == "stale" and row["spindle_load_pct"].value == 3.0
    assert row.values() == {"spindle_load_pct": None}


def test_a_birth_forgets_what_its_sender_no_longer_has() -> None:
    rows = Rows("vmc")
    rows.after(told(EventKind.BIRTH, reading("old", 1.0)))
    row = rows.after(told(EventKind.BIRTH, reading("new", 1.0)))
    assert row is not None and set(row.signals) == {"new"}


def test_other_machines_history_commands_and_jobs_make_no_row() -> None:
    rows = Rows("vmc")
    assert rows.after(told(EventKind.DATA, reading("x", 1.0), device="other")) is None
    assert rows.after(told(EventKind.DATA, reading("x", 1.0), device=None)) is None
    assert rows.after(told(EventKind.DATA, reading("x", 1.0, history=True))) is None
    assert rows.after(told(EventKind.DATA, reading("Device Control/Receipt", None))) is None
    assert rows.after(told(EventKind.HOLE)) is None


def test_a_row_that_was_handed_out_does_not_change() -> None:
    rows = Rows("vmc")
    first = rows.after(told(EventKind.BIRTH, reading("x", 1.0)))
    rows.after(told(EventKind.DATA, reading("x", 2.0)))
    assert first is not None and first.values() == {"x": 1.0}
