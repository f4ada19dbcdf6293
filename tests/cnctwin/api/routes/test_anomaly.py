"""Verdicts through the interface: what is shown, what goes over the broker, what is refused; with the real processor once."""

import json
import time
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

from cnctwin.api.door.audit import AuditLog
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.routes import anomaly as anomaly_routes
from processors.running.runtime import configured, run
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.cnctwin.api.served_plant import PATIENCE_S, PlantServer, get, post, served
from tests.cnctwin.api.small_plant import birth, client_of, data, now, small_plant
from tests.edge.host_watch import wait
from tests.twin.anomaly.parts.alarms.examples import alarmed
from tests.twin.anomaly.parts.milled import SIGNALS, fitted, parts
from tests.until_stopped import until_stopped
from tests.wire.mosquitto import Mosquitto
from twin.anomaly.model import AnomalyModel
from twin.anomaly.parts.alarms.episodes import Memory
from twin.anomaly.parts.alarms.feedback import told_of
from twin.anomaly.parts.alarms.verdict import corrected_memory, verdict_of
from twin.anomaly.parts_scorer import PartsScorer
from twin.anomaly.store import promote, stored

NODE = NodeId("cnc", "twin-joint_anomaly")
PART_S = 92
WHY = {"signal": "spindle_load_pct", "scale": "cut", "measured": 44.0, "expected": 37.0, "by": "12 parts"}


class Ear:
    """A viewer, and behind it a processor that answers at once, as `joint_anomaly` does."""

    online, alive, trouble = True, True, ""

    def __init__(self, live: LivePlant, memory: Memory) -> None:
        self.memory, self.live = memory, live
        self.sent: list[tuple[str, str, bool]] = []

    def publish(self, topic: str, payload: bytes, *, retain: bool = False) -> bool:
        """Take a verdict, and tell the memory after it."""
        self.sent.append((topic, payload.decode(), retain))
        self.memory = corrected_memory(self.memory, verdict_of(payload.decode()), 2000.0)
        self.live.take([data({"twin/anomaly_verdicts": told_of(self.memory, 3000.0)}, now(), NODE)], now())
        return True


def plant(memory: Memory) -> tuple[LivePlant, Ear]:
    """A machine whose score alarms."""
    live = small_plant()
    told: dict[str, Any] = {
        "twin/anomaly_alarm": True,
        "twin/adjusted_score": 3.0,
        "twin/anomaly_threshold": 2.0,
        "twin/anomaly_why": json.dumps(WHY),
        "twin/anomaly_knows": "12 parts",
        "twin/anomaly_verdicts": told_of(memory, 2000.0),
    }
    live.take([birth(told, now(), NODE)], now())
    return live, Ear(live, memory)


def test_the_score_is_shown_with_its_reason() -> None:
    live, ear = plant(alarmed())
    with client_of(live, viewer=ear) as client:
        told = client.get("/anomaly/vmc").json()
    assert (told["is_alarm"], told["score"], told["threshold"], told["knows"]) == (True, 3.0, 2.0, "12 parts")
    assert told["why"] == WHY
    assert told["verdicts"]["alarms"][0]["alarm_at_s"] == 1000.0


def test_without_the_processor_it_says_what_to_do() -> None:
    with client_of(small_plant()) as client:
        told = client.get("/anomaly/vmc").json()
        refused = client.post("/anomaly/vmc/verdict", json={"verdict": "true", "by": "ada"})
        assert client.get("/anomaly/lathe").status_code == 404
    assert (told["is_alarm"], told["verdicts"], "cnctwin process joint_anomaly" in told["reason"]) == (None, None, True)
    assert (refused.status_code, refused.json()["error"]) == (503, told["reason"])


@pytest.mark.parametrize("alarm_at_s", [None, 1000.0])
def test_a_verdict_goes_over_the_broker_is_kept_there_and_noted(alarm_at_s: float | None) -> None:
    live, ear = plant(alarmed())
    audit = AuditLog()
    with client_of(live, viewer=ear, audit=audit) as client:
        body = {"verdict": "known", "label": "dull tool", "by": "ada", "alarm_at_s": alarm_at_s}
        answer = client.post("/anomaly/vmc/verdict", json=body)
    assert answer.status_code == 200
    said = answer.json()["verdicts"]["alarms"][0]["said"]
    assert (said["verdict"], said["label"], said["by"]) == ("known", "dull tool", "ada")
    ((topic, _, is_retained),) = ear.sent
    assert (topic, is_retained) == ("cnctwin/verdict/vmc", True)
    (deed,) = audit.newest(5)
    assert (deed["action"], deed["object"], deed["outcome"]) == ("give verdict", "vmc 1000.000 known", "done")


def test_what_the_memory_refuses_is_a_conflict_with_its_reason() -> None:
    live, ear = plant(alarmed())
    with client_of(live, viewer=ear) as client:
        refused = client.post("/anomaly/vmc/verdict", json={"verdict": "true", "by": "ada", "alarm_at_s": 5.0})
        ended = client.post("/anomaly/vmc/verdict", json={"verdict": "true", "by": "ada", "ends": True})
    assert (refused.status_code, "the last ones: 1000.000" in refused.json()["error"]) == (409, True)
    assert (ended.status_code, ended.json()["error"]) == (409, "the alarm does not stand any more")


def test_of_a_machine_without_an_alarm_nothing_can_be_said() -> None:
    live, ear = plant(Memory())
    with client_of(live, viewer=ear) as client:
        refused = client.post("/anomaly/vmc/verdict", json={"verdict": "true", "by": "ada"})
    assert (refused.status_code, "no anomaly alarm" in refused.json()["error"]) == (404, True)


def test_nobody_s_answer_is_waited_for_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(anomaly_routes, "ANSWER_S_MAX", 0.1)
    live, ear = plant(alarmed())
    monkeypatch.setattr(ear, "publish", lambda *_, **__: True)
    with client_of(live, viewer=ear) as client:
        answer = client.post("/anomaly/vmc/verdict", json={"verdict": "true", "by": "ada"})
    assert (answer.status_code, "the broker keeps the verdict" in answer.json()["error"]) == (504, True)


@pytest.mark.parametrize(
    "wrong",
    [{"verdict": "maybe"}, {"by": " "}, {"by": "a\nb"}, {"label": "x" * 61}, {"alarm_at_s": -1.0}, {"verdct": "true"}],
)
def test_a_verdict_of_another_form_is_refused(wrong: dict[str, Any]) -> None:
    live, ear = plant(alarmed())
    with client_of(live, viewer=ear) as client:
        assert client.post("/anomaly/vmc/verdict", json={"verdict": "true", "by": "ada", **wrong}).status_code == 400
    assert ear.sent == []


@pytest.mark.parametrize("text", ["{", "[]", "3", '"x"', "[" * 3000])
def test_a_text_of_another_shape_is_not_shown(text: str) -> None:
    live, ear = plant(alarmed())
    live.take([data({"twin/anomaly_verdicts": text, "twin/anomaly_why": text}, now(), NODE)], now())
    with client_of(live, viewer=ear) as client:
        told = client.get("/anomaly/vmc").json()
    assert (told["why"], told["verdicts"]) == (None, None)


def row_of(row: dict[str, Any], t_ms: int) -> list[Change]:
    """A second of a machine."""
    return [Change(name, value, t_ms) for name, value in row.items()]


class Milling:
    """A machine that mills four parts as usual and one at 1.6 of the load, and the processor that judges it, on a real broker."""

    def __init__(self, mosquitto: Mosquitto, folder: Path) -> None:
        version = stored(AnomalyModel(SIGNALS, PartsScorer(fitted(machines=1)[0])), folder / "models", "vmc").name
        promote(folder / "models", "vmc", version)
        self._file = folder / "processors.toml"
        self._file.write_text(f'[joint_anomaly]\nmodels = "{folder / "models"}"\nthreshold = 2.0\ntail_s = 2.0\n')
        self._broker = BrokerAddress(*mosquitto.address)
        self.rows = parts(2, 6, {4: 1.6})[: int(4.9 * PART_S)]
        self._began_ms = now() - 1000 * len(self.rows)
        types = {bool: DataType.BOOLEAN, str: DataType.STRING, int: DataType.INT64, float: DataType.DOUBLE}
        first = {"feed_override_pct": 100.0, "spindle_override_pct": 100.0, **self.rows[0]}
        self.edge = EdgeNode(self._broker, NodeId("cnc", "edge-vmc"), [MetricSpec("health/beat", DataType.INT64)])
        self.edge.declare_device("vmc", [MetricSpec(name, types[type(value)], value=value) for name, value in first.items()])

    def judged(self) -> AbstractContextManager[object]:
        """The processor runs."""
        return until_stopped(run, configured(["joint_anomaly"], self._file), self._broker)

    def until_it_alarms(self, server: PlantServer) -> dict[str, Any]:
        """All of the parts, as fast as the broker takes them."""
        self.edge.start()
        wait(lambda: self.edge.online, "the edge to be born")
        wait(lambda: self.second(0) and get(f"{server.url}/machines").json(), "the machine to be known")
        for at in range(len(self.rows)):
            self.second(at)
            if at % 20 == 0:
                time.sleep(0.02)
        wait(lambda: get(f"{server.url}/anomaly/vmc").json()["is_alarm"], "the alarm")
        told: dict[str, Any] = get(f"{server.url}/anomaly/vmc").json()
        return told

    def second(self, at: int) -> bool:
        """One second; whoever comes late hears it, and asks for the birth."""
        return self.edge.publish("vmc", row_of(self.rows[at], self._began_ms + 1000 * at))


@pytest.mark.broker
def test_a_verdict_reaches_the_real_processor(mosquitto: Mosquitto, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(anomaly_routes, "ANSWER_S_MAX", PATIENCE_S)
    milling = Milling(mosquitto, tmp_path)
    with served(mosquitto) as server, milling.judged():
        told = milling.until_it_alarms(server)
        assert (told["why"]["program"], told["verdicts"]["alarms"][0]["state"]) == ("O1", "on")
        answer = post(f"{server.url}/anomaly/vmc/verdict", json={"verdict": "known", "label": "harder material", "by": "ada"})
        assert answer.status_code == 200, answer.text
        assert answer.json()["verdicts"]["alarms"][0]["said"]["label"] == "harder material"
        wait(lambda: get(f"{server.url}/anomaly/vmc").json()["is_alarm"] is False, "the end of the alarm")
    milling.edge.stop()


@pytest.mark.broker
def test_a_verdict_that_is_given_while_the_processor_is_away_is_taken_up(mosquitto: Mosquitto, tmp_path: Path) -> None:
    milling = Milling(mosquitto, tmp_path)
    with served(mosquitto) as server:
        with milling.judged():
            alarm_at_s = milling.until_it_alarms(server)["verdicts"]["alarms"][0]["alarm_at_s"]
            time.sleep(3.0)  # what has changed is saved every two seconds
        said = {"alarm_at_s": alarm_at_s, "verdict": "known", "label": "harder material", "by": "ada", "at_s": time.time()}
        assert post(f"{server.url}/anomaly/vmc/verdict", json={"verdict": "known", "by": "ada"}).status_code == 503
        assert server.sources.viewer is not None
        assert server.sources.viewer.publish("cnctwin/verdict/vmc", json.dumps(said).encode(), retain=True)
        with milling.judged():
            wait(lambda: milling.second(-1) and told_by(server) == "ada", "the verdict")
    milling.edge.stop()


def told_by(server: PlantServer) -> str | None:
    """Return the people who have spoken of the last alarm."""
    verdicts = get(f"{server.url}/anomaly/vmc").json()["verdicts"]
    return verdicts["alarms"][0]["said"]["by"] if verdicts and verdicts["alarms"] and verdicts["alarms"][0]["said"] else None
