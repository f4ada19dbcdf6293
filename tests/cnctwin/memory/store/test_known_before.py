"""A value that was told before a stretch and has not changed since holds at its start: in the question, and in a run log."""

from pathlib import Path

import pytest

from cnctwin.memory.store.embedded import EmbeddedStore
from cnctwin.memory.store.known_before import known_before
from cnctwin.memory.store.run_export import export, run_of
from sparkplug.host_session import EventKind
from tests.cnctwin.memory.store.told import BAD, HOUR_MS, T0_MS, reading, told
from twin.runlog import read_run

DAY_MS = 24 * HOUR_MS
TOLD = (  # signal, value, how long before T0 it was told
    ("program", "O1234", 400 * DAY_MS),
    ("exec_state", "ACTIVE", 400 * DAY_MS),
    ("tool_number", 7, 20 * DAY_MS),
    ("feed_mm_min", 1200.0, 5 * HOUR_MS),
    ("spindle_load_pct", 33.0, 120_000),
)


@pytest.fixture
def store(tmp_path: Path) -> EmbeddedStore:
    """A machine of which all but one signal is silent in the stretch; what is older than two days is sealed."""
    made = EmbeddedStore(tmp_path / "store", writable=True)
    for name, value, before_ms in TOLD:
        if name == "feed_mm_min":  # dense until it fell silent
            readings = [reading(name, 1.0 + n, -before_ms - (2000 - n) * 1000) for n in range(2000)]
            made.append([told([one], one.timestamp_ms - T0_MS) for one in readings])
        made.append([told([reading(name, value, -before_ms)], -before_ms)])
    made.append([told([reading("coolant_on", True, -3000)], -3000)])
    made.append([told([reading("coolant_on", None, -2000, BAD, "UNAVAILABLE")], -2000)])
    made.append([told([reading("spindle_rpm", 100.0 + n, n * 1000)], n * 1000) for n in range(10)])
    made.tidy(T0_MS + HOUR_MS)
    return made


def test_the_last_value_of_each_signal_is_found_however_long_ago(store: EmbeddedStore) -> None:
    names = [name for name, _, _ in TOLD]
    found = known_before(store, "vmc", [*names, "coolant_on", "spindle_rpm", "alarm"], T0_MS)
    assert {name: known.value for name, known in found.items()} == {name: value for name, value, _ in TOLD}
    assert [(T0_MS - found[name].t_us // 1000) for name, _, _ in TOLD] == [before_ms for _, _, before_ms in TOLD]


def test_a_moment_at_which_a_value_came_is_not_before_it(store: EmbeddedStore) -> None:
    assert known_before(store, "vmc", ["spindle_rpm"], T0_MS) == {}
    assert known_before(store, "vmc", ["spindle_rpm"], T0_MS + 1)["spindle_rpm"].value == 100.0


def test_a_run_log_begins_with_the_state_that_was_known(store: EmbeddedStore, tmp_path: Path) -> None:
    store.close()
    out = tmp_path / "run.parquet"
    assert export(tmp_path / "store", "vmc", (T0_MS, T0_MS + HOUR_MS), out) == 10, "and has no row for it of its own"
    run = read_run(out)
    first = {name: values[0] for name, values in (*run.columns.items(), *run.text.items())}
    assert first == {
        "spindle_rpm": 100.0,
        "tool_number": 7.0,
        "program": "O1234",
        "exec_state": "ACTIVE",
        "feed_mm_min": 1200.0,
        "spindle_load_pct": 33.0,
    }
    assert run["tool_number"][1] != run["tool_number"][1], "told once; what is held is asked for with --held"


def test_held_values_reach_through_the_stretch_until_the_signal_speaks(store: EmbeddedStore) -> None:
    store.append([told([reading("tool_number", 8, 5000)], 5000, kind=EventKind.DATA)])
    run = run_of(store, "vmc", T0_MS, T0_MS + HOUR_MS, held=True)
    assert run["tool_number"].tolist() == [7.0] * 5 + [8.0] * 5
    assert set(run.text["exec_state"].tolist()) == {"ACTIVE"}
    assert "coolant_on" not in run.columns, "its last word was that nobody knows"
