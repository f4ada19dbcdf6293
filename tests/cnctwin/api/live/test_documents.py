"""Retained documents of the wrong shape: refused at the door with one line and a count, and everything else goes on."""

import json
import time
from typing import Any

import pytest

from cnctwin.api.live.documents import DEPTH_MAX
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.live.viewer import Viewer
from sparkplug.broker import BrokerAddress
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from tests.cnctwin.api.small_plant import birth, client_of, data, now
from twin.vocabulary.topics import ALERT_STATE, JOBS_STATE, state_of_job

AT = "2999-01-01T00:00:00Z"
JOB = {"id": "night-7", "kind": "optimise", "state": "done"}
JOBS = {"at": AT, "jobs": [JOB], "queued": 0, "running": None, "disk_trouble": None}
ALERT = {"fingerprint": "ea33a6", "phase": "firing", "labels": {"machine": "vmc"}, "episode": 1}
ALERTS = {"at": AT, "alerts": [ALERT], "commands": []}
NOBODY = NodeId("", "")
DEEP: Any = 1
for _ in range(DEPTH_MAX + 5):
    DEEP = [DEEP]

WRONG_VALUES = [None, 5, "text", [5], [[]], [None], {"a": 1}, float("nan"), float("inf"), "\ud800", DEEP, [{}], True]


def plain(topic: str, document: object) -> HostEvent:
    payload = document if isinstance(document, bytes) else json.dumps(document).encode()
    return HostEvent(EventKind.PLAIN, NOBODY, None, 0, topic=topic, payload=payload)


def one_wrong(document: dict[str, Any]) -> list[dict[str, Any]]:
    """The document with each of its keys replaced by each wrong value, also those of the first item of a list."""
    found = [{**document, key: value} for key in document for value in WRONG_VALUES]
    for key, held in document.items():
        if isinstance(held, list) and held and isinstance(held[0], dict):
            found += [{**document, key: [one]} for one in one_wrong(held[0])]
    return found


@pytest.mark.parametrize(
    ("topic", "right"),
    [(JOBS_STATE, JOBS), (state_of_job("night-7"), {**JOB, "result": {"files": {"a.txt": 3}}}), (ALERT_STATE, ALERTS)],
    ids=["jobs", "job", "alerts"],
)
def test_no_document_makes_an_answer_fail_or_keeps_a_machine_s_values_out(topic: str, right: dict[str, Any]) -> None:
    live = LivePlant()
    viewer = Viewer(BrokerAddress(), "cnc", live)
    wrong: list[object] = [*one_wrong(right), b"{", b"[1]", b'"x"', b"\xff", b"null", b"1e999", {"x": 1}]
    wrong += [{**right, "more": 10**400}, {**right, "result": {"files": []}}, {**right, "result": [1]}]
    live.watch(None)
    live.take([birth({"spindle_load_pct": 0.0}, now())], now())
    started = [plain(JOBS_STATE, JOBS), plain(state_of_job("night-7"), {**JOB, "result": {}}), plain(ALERT_STATE, ALERTS)]
    viewer._take(started)
    with client_of(live, viewer=viewer) as client:
        for number, document in enumerate(wrong, start=1):
            t_ms = now() + number
            value = float(number)
            viewer._take([plain(topic, document), data({"spindle_load_pct": value}, t_ms)])
            assert live.flush(t_ms), document
            assert client.get("/state/vmc").json()["measured"]["spindle_load_pct"]["value"] == value
            for path in ("/jobs", "/jobs/night-7", "/jobs/night-7/files/a.txt", "/alerts", "/health"):
                assert client.get(path).status_code in (200, 404), (path, document)
            answer = client.post("/alerts/ea33a6/acknowledge", json={"by": "ada", "episode": 99})
            assert answer.status_code in (404, 409, 503), (answer.text, document)
        assert live.counts["documents_refused"] > 10
        assert live.counts["failures"] == 0
        parts = {part["part"]: part for part in client.get("/health").json()["parts"]}
        assert f"{live.counts['documents_refused']} documents kept out; the newest: {topic}: " in parts["input"]["reason"]
        assert b'twin_page_refused_total{what="documents"}' in client.get("/metrics").content


def test_a_document_that_is_refused_leaves_the_last_good_one() -> None:
    live = LivePlant()
    viewer = Viewer(BrokerAddress(), "cnc", live)
    viewer._take([plain(JOBS_STATE, JOBS), plain(JOBS_STATE, {"jobs": {}}), plain(ALERT_STATE, ALERTS), plain(ALERT_STATE, [])])
    with client_of(live, viewer=viewer) as client:
        assert [one["id"] for one in client.get("/jobs").json()["jobs"]] == ["night-7"]
        assert [one["fingerprint"] for one in client.get("/alerts").json()["alerts"]] == ["ea33a6"]
    assert live.refused == f"{ALERT_STATE}: a JSON list; an object is wanted"


def test_part_records_of_any_shape_are_told_or_passed_over() -> None:
    live, t_ms = LivePlant(), now()
    records = [
        '{"program": "O1"}',
        '{"x": NaN}',
        '{"x": 1e999}',
        '{"x": "\\ud800"}',
        "[1]",
        "{",
        json.dumps({"x": DEEP}),
        '{"t": []}',
    ]
    live.take([birth({"twin/part_record": records[0], "exec_state": "READY"}, t_ms, NodeId("cnc", "twin-events"))], t_ms)
    for number, record in enumerate(records, start=1):
        live.take([data({"twin/part_record": record}, t_ms + number, NodeId("cnc", "twin-events"))], t_ms + number)
    time.sleep(0.02)
    with client_of(live) as client:
        end = f"from={t_ms - 1000}&to={t_ms + 1000}"
        parts = client.get(f"/parts/vmc?{end}")
        assert (parts.status_code, {one.get("program") for one in parts.json()["parts"]}) == (200, {"O1", None})
        assert client.get(f"/events/vmc?{end}").status_code == 200


def test_a_fault_of_a_description_stands_above_every_view_until_it_is_mended() -> None:
    live = LivePlant()
    viewer = Viewer(BrokerAddress(), "cnc", live)
    live.take([birth({"spindle_load_pct": 0.0}, now())], now())
    said = [
        ("cnctwin/description/vmc/fault", {"t": 1, "text": "machines/vmc.toml: line 7: no value"}, "line 7: no value"),
        ("cnctwin/description/vmc/fault/thermal/live", {"t": 2, "text": "thermal cannot"}, "no value; vmc: thermal cannot"),
        ("cnctwin/description/vmc/fault", b"", "vmc: thermal cannot"),
    ]
    with client_of(live, viewer=viewer) as client:
        for number, (topic, document, ending) in enumerate(said):
            viewer._take([plain(topic, document)])
            told = [batch.payload for batch in live.flush(now() + 2000 * number)]
            assert any(payload.startswith(b"event: processors") for payload in told)
            assert client.get("/state/vmc").json()["described"].endswith(ending)
        viewer._take([plain("cnctwin/description/vmc/fault/thermal/live", b"")])
        live.flush(now() + 20_000)
        assert client.get("/state/vmc").json()["described"] is None
