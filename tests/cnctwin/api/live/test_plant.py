"""The live plant alone: what one sender tells keeps nobody else's values out."""

import pytest

from cnctwin.api.live.plant import LivePlant
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality
from tests.cnctwin.api.small_plant import birth, client_of, data, death, now, small_plant

LOAD = "spindle_load_pct"
HOSTILE = NodeId("cnc", "edge-hostile")
STAMPS = [2**63 - 1, 2**63, 2**64 - 1, -1, 32_503_680_000_001]


def told(live: LivePlant, machine: str, signal: str) -> dict[str, object]:
    state = live.state(machine, now())
    assert state is not None
    found: dict[str, object] = state["measured"][signal]
    return found


def test_a_metric_by_which_a_machine_is_commanded_is_no_signal_of_it() -> None:
    live, t_ms = small_plant(), now()
    live.take([birth({LOAD: 1.0, "Device Control/Receipt": ""}, t_ms)], t_ms)
    live.take([data({LOAD: 2.0, "Device Control/Receipt": "7"}, t_ms + 1)], t_ms + 1)
    state = live.state("vmc", now())
    assert state is not None
    assert set(state["measured"]) == {LOAD}


@pytest.mark.parametrize("stamp_ms", STAMPS)
@pytest.mark.parametrize("is_watched", [False, True])
def test_a_stamp_that_is_no_time_keeps_its_reading_out_and_no_other(stamp_ms: int, is_watched: bool) -> None:
    live, t_ms = small_plant(), now()
    live.take([birth({LOAD: 1.0, "spindle_rpm": 10.0}, t_ms, HOSTILE, "bad")], t_ms)
    if is_watched:
        for name in ("vmc", "bad", None):
            live.watch(name)
        live.flush(t_ms)
    mixed = (
        Reading(LOAD, 2.0, stamp_ms, Quality.GOOD, "%", None, False),
        Reading("spindle_rpm", 20.0, t_ms + 1, Quality.GOOD, None, None, False),
    )
    live.take([HostEvent(EventKind.DATA, HOSTILE, "bad", stamp_ms, mixed), data({LOAD: 55.0}, t_ms + 1)], t_ms + 1)
    bad = told(live, "bad", LOAD)
    assert (bad["value"], bad["quality"], bad["t"]) == (None, "bad", t_ms + 1)
    assert f"its stamp {stamp_ms} ms" in str(bad["reason"])
    assert told(live, "bad", "spindle_rpm")["value"] == 20.0
    assert told(live, "vmc", LOAD)["value"] == 55.0
    assert live.counts["readings_refused"] == 1
    assert live.counts["failures"] == 0
    if is_watched:
        payloads = [batch.payload for batch in live.flush(t_ms + 100)]
        assert len(payloads) == 3
        assert any(b"55.0" in one for one in payloads)
    live.take([HostEvent(EventKind.DATA, HOSTILE, "bad", t_ms + 2, (mixed[0]._replace(timestamp_ms=t_ms + 2),))], t_ms + 2)
    assert told(live, "bad", LOAD)["value"] == 2.0
    values = [one.value for one in live.recent("bad", [LOAD], 0, t_ms + 10)[LOAD][1]]
    assert values == [1.0, None, 2.0]


@pytest.mark.parametrize("stamp_ms", STAMPS)
def test_births_deaths_and_holes_of_no_time_are_taken_at_the_time_of_now(stamp_ms: int) -> None:
    live, t_ms = small_plant(), now()
    live.watch("bad")
    live.watch(None)
    of_the_bad = {LOAD: 1.0, "exec_state": "ACTIVE"}
    for event in (birth(of_the_bad, stamp_ms, HOSTILE, "bad"), death(of_the_bad, stamp_ms, HOSTILE, "bad")):
        live.take([event, HostEvent(EventKind.HOLE, HOSTILE, None, stamp_ms)], t_ms)
        assert live.flush(t_ms)
    assert live.counts["failures"] == 0
    assert live.remembers("vmc", [LOAD], t_ms + 1)
    with client_of(live) as client:
        for path in ("/machines", "/state/bad", "/metrics", "/events/bad", f"/history/bad?signals={LOAD}"):
            assert client.get(path).status_code == 200, path
        parts = {part["part"]: part for part in client.get("/health").json()["parts"]}
        assert parts["input"]["state"] == "degraded"
        assert f"its stamp {stamp_ms} ms" in parts["input"]["reason"]
        assert 'twin_page_refused_total{what="readings"}' in client.get("/metrics").text


def test_an_event_that_nobody_thought_of_is_counted_and_the_next_one_is_taken(caplog: pytest.LogCaptureFixture) -> None:
    live, t_ms = small_plant(), now()
    broken = HostEvent(EventKind.DATA, HOSTILE, "vmc", t_ms, (None,))  # type: ignore[arg-type]
    live.take([birth({LOAD: 1.0}, t_ms, HOSTILE, "vmc"), broken, data({LOAD: 60.0}, t_ms + 1)], t_ms + 1)
    assert live.counts["failures"] == 1
    assert "goes on with the next" in caplog.text
    assert live.readings("vmc")["spindle_rpm"].value == 6000.0


def test_who_takes_the_name_of_a_machine_changes_none_of_its_values_until_its_own_edge_is_gone() -> None:
    live, t_ms = small_plant(), now()
    live.take([data({LOAD: 55.0}, t_ms)], t_ms)
    live.take([birth({LOAD: 1.0, "made_up": 3.0}, t_ms, HOSTILE, "vmc"), data({LOAD: 2.0}, t_ms + 1, HOSTILE)], t_ms + 1)
    assert told(live, "vmc", LOAD)["value"] == 55.0
    assert told(live, "vmc", "made_up")["value"] == 3.0
    live.take([death({LOAD: 2.0}, t_ms + 2, HOSTILE, "vmc")], t_ms + 2)
    assert told(live, "vmc", LOAD)["quality"] == "good"
    live.take([birth({LOAD: 4.0}, t_ms + 3, HOSTILE, "vmc"), death({LOAD: 55.0}, t_ms + 4)], t_ms + 4)
    assert told(live, "vmc", LOAD)["value"] == 4.0


def test_values_of_a_processor_that_is_gone_name_it_and_not_the_edge() -> None:
    live, t_ms = small_plant(), now()
    twin = NodeId("cnc", "twin-cutting_force")
    live.take([birth({LOAD: 1.0}, t_ms), birth({"twin/cutting_force_n": 80.0}, t_ms, twin)], t_ms)
    live.take([death({"twin/cutting_force_n": 80.0}, t_ms + 1, twin)], t_ms + 1)
    state = live.state("vmc", now())
    assert state is not None and state["online"]
    assert state["twin"]["twin/cutting_force_n"]["reason"] == "the processor cutting_force is offline"
