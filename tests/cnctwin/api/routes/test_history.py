"""History from a real store, from memory where there is none, and what it is refused for."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cnctwin.api.event_list import event_signals, events_of, part_records
from cnctwin.api.live.trace import AGE_MS_MAX, SAMPLES_MAX, Sample, Trace
from cnctwin.api.store_reader import StoreReader
from cnctwin.memory.store.contract import Message, Pinned, Snapshot
from cnctwin.memory.store.opening import open_store
from processors.alarms import alarm_signals
from processors.description import DescriptionMessage
from sparkplug.quality import Quality
from tests.cnctwin.api.small_plant import Client, birth, client_of, data, death, now, small_plant

T0 = 1_760_000_000_000
LOAD = "spindle_load_pct"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with ten minutes of a machine, a value each second, and a hole."""
    folder = tmp_path_factory.mktemp("store")
    store = open_store(folder, writable=True)
    events = [birth({LOAD: 0.0, "exec_state": "READY", "alarm": "", "tool_change_active": False, "twin/part_record": None}, T0)]
    events += [data({LOAD: float(second % 60)}, T0 + 1000 * second) for second in range(1, 600)]
    events += [
        data({"exec_state": "ACTIVE"}, T0 + 10_000),
        data({"alarm": "spindle hot"}, T0 + 20_000),
        data({"alarm": ""}, T0 + 30_000),
        data({"tool_change_active": True}, T0 + 40_000),
        data({"tool_change_active": False}, T0 + 46_000),
        data({"twin/part_record": '{"program": "O1000", "seconds": 90.0}'}, T0 + 100_000),
        data({"twin/part_record": "no record"}, T0 + 110_000),
        death({"exec_state": "ACTIVE"}, T0 + 600_000),
        birth({LOAD: 1.0, "exec_state": "READY"}, T0 + 700_000),
    ]
    events.sort(key=lambda event: event.timestamp_ms)
    store.append([Message(event.timestamp_ms, event) for event in events])
    said = DescriptionMessage(version="3f2a", toml="", step="promoted", by="anna", why="it fits")
    store.keep_snapshot(
        Snapshot(
            "description", "vmc/live", T0 - 60_000, said.model_copy(update={"version": "11aa", "step": "described"}).payload()
        ),
        Snapshot("description", "vmc/live", T0 + 200_000, said.payload()),
        Snapshot("description", "vmc/fault", T0 + 210_000, b'{"t": 1, "text": "machines/vmc.toml: line 7: no value"}'),
        Snapshot("description", "vmc/fault", T0 + 220_000, b'{"t": 2, "text": "machines/vmc.toml: [axes] is missing"}'),
        Snapshot("description", "vmc/fault", T0 + 230_000, b""),
    )
    store.pin(Pinned("vmc", T0 + 15_000, T0 + 35_000, "anomaly"))
    store.close()
    return folder


@pytest.fixture(scope="module")
def client(place: Path) -> Iterator[Client]:
    store = StoreReader(str(place))
    with client_of(store=store) as client:
        yield client
    store.close()


def test_samples_come_as_they_were_kept(client: Client) -> None:
    told = client.get(f"/history/vmc?signals={LOAD},exec_state&from={T0}&to={T0 + 12_000}").json()
    assert (told["source"], told["from"], told["to"], told["every_ms"]) == ("store", T0, T0 + 12_000, None)
    load, state = told["columns"]
    assert (load["signal"], load["unit"]) == (LOAD, "%")
    assert load["t"] == [T0 + 1000 * second for second in range(12)]
    assert load["value"] == [float(second) for second in range(12)]
    assert set(load["quality"]) == {"good"}
    assert (state["value"], state["t"]) == (["READY", "ACTIVE"], [T0, T0 + 10_000])


def test_windows_have_mean_low_and_high(client: Client) -> None:
    told = client.get(f"/history/vmc?signals={LOAD}&from={T0}&to={T0 + 120_000}&every_ms=60000").json()
    (column,) = told["columns"]
    assert [t % 60_000 for t in column["t"]] == [0] * len(column["t"])
    assert sum(column["count"]) == 120
    assert column["low"][0] <= column["value"][0] <= column["high"][0]


def test_a_signal_that_nobody_told_has_an_empty_column(client: Client) -> None:
    (column,) = client.get(f"/history/vmc?signals=nothing&from={T0}&to={T0 + 1000}").json()["columns"]
    assert (column["t"], column["value"], column["unit"]) == ([], [], None)


@pytest.mark.parametrize(
    ("query", "line"),
    [
        ("", "signals is missing"),
        ("signals=", "signals names 0"),
        ("signals=,,", "signals names 0"),
        (f"signals={','.join(f's{n}' for n in range(61))}", "signals names 61"),
        (f"signals=a&from={T0}&to={T0}", f"to {T0} is not after from {T0}"),
        (f"signals=a&from={T0}&to={T0 - 1}", "is not after"),
        (f"signals=a&from={T0}&to={T0 + 3_600_001}", "is more than an hour as it came; give every_ms"),
        (f"signals=a&from=0&to={T0}&every_ms=1", "windows of 1 signals; 200000 are the limit"),
        ("signals=a&from=-1", "from is '-1'"),
        ("signals=a&from=99999999999999999", "from is"),
        ("signals=a&from=yesterday", "from is 'yesterday'"),
        ("signals=a&from=NaN", "from is 'NaN'"),
        ("signals=a&every_ms=0", "every_ms is '0'"),
        (f"signals={'x' * 6001}", "signals is"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_400_with_a_line_that_names_it(client: Client, query: str, line: str) -> None:
    refusal = client.get(f"/history/vmc?{query}")
    assert refusal.status_code == 400
    assert line in refusal.json()["error"]


def test_a_machine_that_the_store_does_not_know_is_404(client: Client) -> None:
    for path in ("/history/lathe?signals=a", "/events/lathe", "/parts/lathe"):
        assert client.get(path).status_code == 404, path


def test_events_are_what_the_signals_say(client: Client) -> None:
    told = client.get(f"/events/vmc?from={T0}&to={T0 + 800_000}").json()
    seen = [
        (one["kind"], one["text"], one["t"] - T0, None if one["until"] is None else one["until"] - T0) for one in told["events"]
    ]
    assert seen == [
        ("execution", "READY", 0, 10_000),
        ("execution", "ACTIVE", 10_000, 700_000),
        ("pin", "raw data kept for good: anomaly", 15_000, 35_000),
        ("alarm", "spindle hot", 20_000, 30_000),
        ("tool_change", "tool change", 40_000, 46_000),
        ("part", "part made: O1000", 100_000, None),
        ("description", "description 3f2a live: promoted by anna: it fits", 200_000, None),
        ("description_fault", "machines/vmc.toml: line 7: no value", 210_000, 220_000),
        ("description_fault", "machines/vmc.toml: [axes] is missing", 220_000, 230_000),
        ("hole", "edge node offline", 600_000, 700_000),
        ("execution", "READY", 700_000, None),
    ]


def test_the_description_that_held_when_a_stretch_began_is_told_with_those_that_came_later(client: Client) -> None:
    told = client.get(f"/events/vmc?from={T0}&to={T0 + 800_000}").json()["descriptions"]
    assert [(one["t"] - T0, one["role"], one["version"]) for one in told] == [
        (-60_000, "live", "11aa"),
        (200_000, "live", "3f2a"),
    ]
    later = client.get(f"/events/vmc?from={T0 + 215_000}&to={T0 + 225_000}").json()
    assert [(one["version"], one["t"] - T0) for one in later["descriptions"]] == [("3f2a", 200_000)]
    faults = [(one["text"], one["t"] - T0, one["until"]) for one in later["events"] if one["kind"] == "description_fault"]
    assert faults == [
        ("machines/vmc.toml: line 7: no value", 215_000, T0 + 220_000),
        ("machines/vmc.toml: [axes] is missing", 220_000, None),
    ]


def test_parts_are_the_records_newest_first_and_what_is_no_record_is_passed_over(client: Client) -> None:
    told = client.get(f"/parts/vmc?from={T0}&to={T0 + 800_000}").json()
    assert told["parts"] == [{"program": "O1000", "seconds": 90.0, "t": T0 + 100_000}]


def test_stretches_of_events_are_bounded(client: Client) -> None:
    refusal = client.get(f"/events/vmc?from=0&to={T0}")
    assert refusal.status_code == 400
    assert "31 days" in refusal.json()["error"]


# Without a store.


def test_without_a_store_the_last_minutes_are_told_from_memory_with_the_reason() -> None:
    t_ms = now()
    with client_of(small_plant(t_ms)) as client:
        told = client.get(f"/history/vmc?signals={LOAD}&from={t_ms - 60_000}&to={t_ms + 1}").json()
        assert client.get(f"/events/vmc?from={t_ms - 60_000}&to={t_ms + 1}").json()["source"] == "memory"
    assert (told["source"], told["columns"][0]["value"]) == ("memory", [37.25])
    assert "--store" in told["reason"]


def test_a_store_that_is_not_there_is_tried_again_and_used_when_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.api.store_reader.TRY_AGAIN_S", 0.0)
    store, t_ms = StoreReader(str(tmp_path / "store")), now()
    with client_of(small_plant(t_ms), store=store) as client:
        assert client.get(f"/history/vmc?signals={LOAD}&from={t_ms - 60_000}").json()["source"] == "memory"
        (part,) = (part for part in client.get("/health").json()["parts"] if part["part"] == "store")
        assert (part["state"], part["do"]) == ("missing", "cnctwin process historian")
        assert client.get(f"/history/lathe?signals={LOAD}").status_code == 503
        assert client.get("/metrics").text.count("twin_store_up 0.0") == 1
        writer = open_store(tmp_path / "store", writable=True)
        writer.append([Message(t_ms, birth({LOAD: 12.0}, t_ms - 30_000))])
        told = client.get(f"/history/vmc?signals={LOAD}&from={t_ms - 60_000}").json()
        assert (told["source"], told["columns"][0]["value"]) == ("store", [12.0])
        assert "twin_store_up 1.0" in client.get("/metrics").text
        writer.close()
    store.close()


def test_a_stretch_that_memory_holds_in_full_is_told_from_memory(place: Path) -> None:
    live, t_ms = small_plant(now() - 60_000), now()
    for second in range(50, 0, -1):
        live.take([data({LOAD: float(second)}, t_ms - 1000 * second)], t_ms)
    store = StoreReader(str(place))
    with client_of(live, store=store) as client:
        inside = client.get(f"/history/vmc?signals={LOAD}&from={t_ms - 50_000}&to={t_ms}").json()
        beyond = client.get(f"/history/vmc?signals={LOAD}&from={t_ms - 90_000}&to={t_ms}").json()
    store.close()
    assert (inside["source"], len(inside["columns"][0]["t"])) == ("memory", 50)
    assert beyond["source"] == "store"


def test_what_was_missed_while_the_broker_was_away_is_not_told_from_memory() -> None:
    t_ms = now()
    live = small_plant(t_ms - 60_000)
    live.take([death({LOAD: 37.25}, t_ms - 40_000)], t_ms)
    live.take([birth({LOAD: 5.0}, t_ms - 20_000)], t_ms)
    assert live.remembers("vmc", (LOAD,), t_ms - 20_000)
    assert not live.remembers("vmc", (LOAD,), t_ms - 50_000)
    same = small_plant(t_ms - 60_000)
    same.take([death({LOAD: 37.25}, t_ms - 40_000)], t_ms)
    same.take([birth({LOAD: 37.25}, t_ms - 60_000)._replace(timestamp_ms=t_ms - 20_000)], t_ms)
    assert same.remembers("vmc", (LOAD,), t_ms - 60_000)
    samples = same.recent("vmc", (LOAD,), 0, t_ms)[LOAD][1]
    assert [(one.t_ms - t_ms, one.quality) for one in samples] == [
        (-60_000, Quality.GOOD), (-40_000, Quality.STALE), (-20_000, Quality.GOOD),
    ]  # fmt: skip


# Limits.


def test_a_question_that_takes_too_long_and_one_too_many_are_503(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gate, store = threading.Event(), StoreReader(str(place), query_s_max=0.2)

    class Slow:
        def query(self, _query: object) -> list[object]:
            gate.wait(60)
            return []

    monkeypatch.setattr(store, "_opened", Slow)
    with client_of(store=store) as client:
        begun_s = time.monotonic()
        slow = client.get("/history/lathe?signals=a")
        assert time.monotonic() - begun_s < 30.0
        assert (slow.status_code, slow.json()["error"]) == (
            503,
            "no answer within 0.2 s; ask for a shorter stretch or wider windows",
        )
        monkeypatch.setattr("cnctwin.api.store_reader.WAITING_MAX", 1)
        busy = client.get("/history/lathe?signals=a")
        assert (busy.status_code, busy.headers["retry-after"]) == (503, "2")
        for path in ("/machines", "/health", "/metrics", "/gap/vmc"):
            assert client.get(path).status_code in (200, 404), path
        gate.set()
    store.close()


def test_a_trace_is_bounded_in_number_and_age() -> None:
    trace = Trace()
    for number in range(5 * SAMPLES_MAX):
        trace.add(number, float(number), Quality.GOOD, None)
        assert len(trace) < 2 * SAMPLES_MAX
    assert len(trace.since(0, 10**9)) == SAMPLES_MAX
    assert trace.since(0, 10**9)[-1].value == 5 * SAMPLES_MAX - 1
    trace.add(10_000 + AGE_MS_MAX, 1.0, Quality.GOOD, None)
    assert trace.oldest_ms >= 10_000


@pytest.mark.parametrize("values", [[1.5, None, 2.5], [True, None, False], [3, None, 4], ["a", None, "b"]])
def test_a_trace_gives_back_what_it_was_given(values: list[float | str | None]) -> None:
    trace = Trace()
    given = [
        Sample(number, value, Quality.BAD if value is None else Quality.GOOD, None if value else "why")
        for number, value in enumerate(values)
    ]
    for sample in given:
        trace.add(*sample)
    assert trace.since(0, 10) == given
    assert [type(one.value) for one in trace.since(0, 10)] == [type(value) for value in values]


def test_a_clock_that_was_set_back_begins_a_trace_anew_and_a_straggler_does_not() -> None:
    trace = Trace()
    trace.add(100_000, 1.0, Quality.GOOD, None)
    trace.add(99_000, 2.0, Quality.GOOD, None)
    assert [one.value for one in trace.since(0, 10**9)] == [1.0]
    trace.add(50_000, 3.0, Quality.GOOD, None)
    assert [one.value for one in trace.since(0, 10**9)] == [3.0]


def test_reasons_without_end_do_not_grow_a_trace_without_end() -> None:
    trace = Trace()
    for number in range(3000):
        trace.add(number, 1.0, Quality.BAD, f"reason {number}")
    assert len(trace.since(0, 10**9)) == SAMPLES_MAX
    assert {one.quality for one in trace.since(0, 10**9)} == {Quality.BAD}


def test_every_declared_alarm_is_listed_as_an_event_and_what_is_told_beside_it_is_not() -> None:
    beside = {"twin/rule_detail", "twin/gap_basis", "twin/raw_score", "spindle_rpm"}
    assert set(event_signals({*alarm_signals(), *beside, "program"})) == {*alarm_signals(), "program"}


def test_the_alarm_of_a_control_is_one_event_in_its_own_words() -> None:
    texts = [Sample(0, "", 192, None), Sample(5, "EX1012 NO OIL", 192, None), Sample(9, "", 192, None)]
    flags = [Sample(0, False, 192, None), Sample(6, True, 192, None), Sample(9, False, 192, None)]
    told = events_of({"alarm": texts, "twin/control_alarm": flags})
    assert [(one["kind"], one["text"], one["t"], one["until"]) for one in told] == [("alarm", "EX1012 NO OIL", 5, 9)]
    assert [one["text"] for one in events_of({"twin/control_alarm": flags})] == ["control alarm"]


def test_what_was_kept_from_before_a_stretch_is_told_at_its_beginning(client: Client) -> None:
    told = client.get(f"/events/vmc?from={T0 + 20_000}&to={T0 + 30_000}").json()["events"]
    assert [(one["t"] - T0, one["until"] - T0) for one in told if one["kind"] == "pin"] == [(20_000, 35_000)]


def test_alarms_of_the_twin_are_events() -> None:
    ran = [Sample(0, False, 192, None), Sample(5, True, 192, None), Sample(9, None, 0, "blind"), Sample(12, True, 192, None)]
    assert [(one["kind"], one["text"], one["t"], one["until"]) for one in events_of({"twin/rule_load_over_limit": ran})] == [
        ("alarm", "load over limit", 5, 9),
        ("alarm", "load over limit", 12, None),
    ]
    assert part_records([Sample(0, "[1]", 192, None), Sample(1, "{", 192, None), Sample(2, None, 192, None)]) == []
