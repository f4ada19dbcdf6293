"""Alerts over the real processor and a real broker: listed, streamed, acknowledged."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cnctwin.api.access import Access
from cnctwin.api.routes import alerts as alert_routes
from cnctwin.api.server import Server
from processors.running.runtime import configured, run
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.cnctwin.api.served_plant import PATIENCE_S, Stream, get, post, served
from tests.cnctwin.api.small_plant import birth, client_of, death, small_plant
from tests.edge.host_watch import wait
from tests.processors.alerts.courier.alert_shop import VIBRATION
from tests.until_stopped import until_stopped
from tests.wire.mosquitto import Mosquitto

PROXIED = Access(proxy_header="X-Remote-User", proxy="127.0.0.1")
BEAT = "health/beat"
NAMED = {"X-Remote-User": "grace"}


@pytest.fixture
def firing(mosquitto: Mosquitto, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Mosquitto]:
    """A machine whose alarm fires, and the processor that says so."""
    monkeypatch.setattr(alert_routes, "ANSWER_S_MAX", PATIENCE_S)
    file = tmp_path / "alerts.toml"
    file.write_text("[alerts]\ngroup_wait_s = 0.0\n")
    broker = BrokerAddress(*mosquitto.address)
    edge = EdgeNode(broker, NodeId("cnc", "edge-vmc"), [MetricSpec(BEAT, DataType.INT64)])
    edge.declare_device("vmc", [MetricSpec(VIBRATION, DataType.BOOLEAN, value=True)])
    with until_stopped(run, configured(["alerts"], file), broker):
        edge.start()
        with until_stopped(beat, edge):
            yield mosquitto
    edge.stop()


def beat(edge: EdgeNode, stop: threading.Event) -> None:
    """As real edges do: who comes late hears something, and asks for the birth."""
    while not stop.wait(0.2):
        edge.publish(None, [Change(BEAT, time.monotonic_ns(), time.time_ns() // 1_000_000)])


def alerts(server: Server, **headers: str) -> list[dict[str, object]]:
    told = get(f"{server.url}/alerts", headers=headers).json()
    found: list[dict[str, object]] = [one for one in told["alerts"] if one["labels"]["alertname"] == "rule_vibration"]
    return found


@pytest.mark.broker
def test_an_alert_is_listed_streamed_and_acknowledged(firing: Mosquitto) -> None:
    with served(firing) as server:
        wait(lambda: alerts(server), "the alert")
        (alert,) = alerts(server)
        assert alert["phase"] == "firing"
        told = get(f"{server.url}/alerts").json()
        assert (told["available"], told["reason"]) == (True, None)
        url = f"{server.url}/alerts/{str(alert['fingerprint'])[:8]}/acknowledge"
        for body, status in (({"by": " "}, 400), ({"by": "ada", "episode": 1}, 409), ({"by": "ada", "episod": 1}, 400)):
            refused = post(url, json=body)
            assert (refused.status_code, list(refused.json())) == (status, ["error"])
        assert alerts(server)[0]["phase"] == "firing"
        with Stream(server.url, None) as stream:
            answer = post(url, json={"by": "ada", "comment": "on my way", "episode": alert["episode"]})
            assert (answer.status_code, answer.json()["done"]) == (200, True)
            wait(lambda: [one for one in stream.last("alerts").get("alerts", ()) if one["acknowledged_by"] == "ada"], "the event")
        (alert,) = alerts(server)
        assert (alert["phase"], alert["comment"]) == ("acknowledged", "on my way")


@pytest.mark.broker
def test_behind_a_proxy_it_is_the_proxy_s_user_who_acknowledges(firing: Mosquitto) -> None:
    with served(firing, access=PROXIED) as server:
        wait(lambda: alerts(server, **NAMED), "the alert")
        (alert,) = alerts(server, **NAMED)
        url = f"{server.url}/alerts/{alert['fingerprint']}/acknowledge"
        assert post(url, json={"by": "mallory"}).status_code == 401
        assert post(url, json={"by": "mallory"}, headers=NAMED).status_code == 200
        wait(lambda: alerts(server, **NAMED)[0]["acknowledged_by"] == "grace", "who acknowledged")


@pytest.mark.broker
def test_an_alert_is_silenced_by_a_person_and_not_by_nobody(firing: Mosquitto) -> None:
    with served(firing) as server:
        wait(lambda: alerts(server), "the alert")
        asked = {"machine": "vmc", "for_s": 3600.0, "by": "ada", "comment": "service"}
        for wrong in ({**asked, "machine": ""}, {**asked, "by": " "}, {**asked, "for_s": 0}, {**asked, "for_s": 1e300}):
            assert post(f"{server.url}/silences", json=wrong).status_code == 400
        assert post(f"{server.url}/silences", json=asked).json()["done"] is True
        wait(lambda: alerts(server)[0]["silenced_by"], "the silence")
        (silence,) = get(f"{server.url}/alerts").json()["silences"]
        assert (silence["by"], silence["matchers"]) == ("ada", {"machine": "vmc"})
        assert post(f"{server.url}/silences/unknown/end", json={"by": "ada"}).status_code == 404
        assert post(f"{server.url}/silences/{silence['id']}/end", json={"by": "ada"}).json()["done"] is True
        wait(lambda: not alerts(server)[0]["silenced_by"], "its end")


@pytest.mark.broker
def test_where_nobody_answers_it_says_so(mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alert_routes, "ANSWER_S_MAX", 0.3)
    with served(mosquitto) as server:
        url = f"{server.url}/alerts/ea33a6/acknowledge"
        unheard = post(url, json={"by": "ada"})
        assert (unheard.status_code, unheard.json()["error"]) == (
            503,
            "nothing was heard of alerts; does the processor run? (cnctwin process alerts)",
        )
        state = {
            "at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "alerts": [{"fingerprint": "ea33a6", "phase": "firing", "episode": 1}],
        }
        server.sources.live.take_alerts(state)
        wait(lambda: get(f"{server.url}/health").json()["parts"][0]["state"] == "ok", "the broker")
        nobody = post(url, json={"by": "ada"})
        assert (nobody.status_code, "no answer within 0.3 s" in nobody.json()["error"]) == (504, True)


def test_a_fingerprint_that_does_not_fire_is_refused() -> None:
    live = small_plant()
    at = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    live.take_alerts(
        {"at": at, "alerts": [{"fingerprint": "ea33a6", "phase": "firing"}, {"fingerprint": "bb", "phase": "resolved"}]}
    )
    with client_of(live) as client:
        for one in ("ffff", "e", "%2e%2e%2f", "EA33A6", "ea33a6%00", "ea33 a6", "*", "ea33a6" * 11):
            refusal = client.post(f"/alerts/{one}/acknowledge", json={"by": "ada"})
            assert (refusal.status_code in (400, 404, 503), list(refusal.json())) == (True, ["error"]), one


def test_a_state_that_nobody_keeps_up_is_not_available() -> None:
    live = small_plant()
    live.take_alerts({"at": "2020-01-01T00:00:00Z", "alerts": []})
    with client_of(live) as client:
        told = client.get("/alerts").json()
    assert told["available"] is False
    assert "nothing heard from the processor alerts since 2020-01-01 00:00:00 UTC" in told["reason"]


def test_a_state_whose_processor_has_died_is_not_available_at_once() -> None:
    live, node, at_ms = small_plant(), NodeId("cnc", "twin-alerts"), round(time.time() * 1000)
    live.take_alerts({"at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), "alerts": []})
    live.take([birth({"health/lag_s": 0.0}, at_ms, node, None)], at_ms)
    with client_of(live) as client:
        assert client.get("/alerts").json()["available"] is True
        live.take([death({"health/lag_s": 0.0}, at_ms + 1, node, None)], at_ms + 1)
        told = client.get("/alerts").json()
    assert told["available"] is False
    assert told["reason"].endswith("is `cnctwin process alerts` running?")
