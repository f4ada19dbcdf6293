"""The loop through the interface: what it tells, what an operator asks of it, and what is refused; with the real service once."""

import json
from pathlib import Path
from typing import Any

import pytest

from cnctwin.api.door.audit import AuditLog
from cnctwin.api.live.documents import DocumentError
from cnctwin.api.live.loops import LiveLoops
from cnctwin.api.routes import twin as twin_routes
from tests.cnctwin.api.served_plant import PATIENCE_S, get, post, served
from tests.cnctwin.api.small_plant import client_of, small_plant
from tests.cnctwin.loop.loop_on_trial import BETTER, ROOT, VA, VB, LoopPlant
from tests.edge.host_watch import wait
from tests.wire.mosquitto import Mosquitto

TOPIC = "cnctwin/loop/vmc"


class Ear:
    """A viewer that hears one document, and a loop that answers at once as it is told."""

    online, alive, trouble = True, True, ""

    def __init__(self, document: dict[str, Any], *, done: bool = True, text: str = "done") -> None:
        self.loops, self.sent = LiveLoops(), list[tuple[str, dict[str, Any]]]()
        self._document, self._done, self._text = document, done, text
        if document:
            self.loops.take(TOPIC, json.dumps(document).encode())

    def publish(self, topic: str, payload: bytes) -> bool:
        """Take a request, and answer it."""
        asked = json.loads(payload)
        self.sent.append((topic, asked))
        answer = {"id": asked["id"], "request": topic.rpartition("/")[2], "done": self._done, "text": self._text, "t": 0}
        self.loops.take(TOPIC, json.dumps({**self._document, "answers": [answer]}).encode())
        return True


def document(**more: Any) -> dict[str, Any]:
    told = {"machine": "vmc", "step": "shadow", "live": {"version": "9c01"}, "challenger": {"version": "3f2a"}}
    return {**told, "may_promote": True, "why_not": None, **more}


def test_what_the_loop_retains_is_what_is_told() -> None:
    with client_of(small_plant(), viewer=Ear(document())) as client:
        assert client.get("/twin/vmc").json() == document()


def test_without_a_loop_it_says_what_to_do_and_of_an_unknown_machine_that_it_is_unknown() -> None:
    with client_of(small_plant(), viewer=Ear({})) as client:
        told = client.get("/twin/vmc").json()
        assert told["step"] is None and "cnctwin twin run" in told["reason"]
        assert client.get("/twin/lathe").status_code == 404
        assert client.post("/twin/vmc/diagnose", json={"by": "ada"}).status_code == 404


@pytest.mark.parametrize(("word", "version"), [("promote", "3f2a"), ("withdraw", "3f2a"), ("back", "9c01"), ("diagnose", "3f2a")])
def test_a_request_names_the_version_that_is_meant(word: str, version: str) -> None:
    ear = Ear(document())
    with client_of(small_plant(), viewer=ear, audit=(audit := AuditLog())) as client:
        answer = client.post(f"/twin/vmc/{word}", json={"by": "ada", "version": None})
    assert (answer.status_code, answer.json()["answers"][0]["done"]) == (200, True)
    ((topic, asked),) = ear.sent
    assert topic == f"cnctwin/loop/request/{word}"
    assert (asked["machine"], asked["by"], asked["version"]) == ("vmc", "ada", version)
    (deed,) = audit.newest(5)
    assert (deed["object"], deed["outcome"]) == (f"vmc {version}", "done")


def test_what_cannot_be_is_a_conflict_with_its_reason_and_noted() -> None:
    audit = AuditLog()
    shadowed = document(may_promote=False, why_not="it has run beside the live one for 4 of 900 s")
    with client_of(small_plant(), viewer=Ear(shadowed), audit=audit) as client:
        refused = client.post("/twin/vmc/promote", json={"by": "ada"})
    assert (refused.status_code, refused.json()["error"]) == (409, shadowed["why_not"])
    assert audit.newest(1)[0]["outcome"].startswith("409 it has run")
    with client_of(small_plant(), viewer=Ear(document(), done=False, text="nothing to go back to")) as client:
        refused = client.post("/twin/vmc/back", json={"by": "ada"})
    assert (refused.status_code, refused.json()["error"]) == (409, "nothing to go back to")


@pytest.mark.parametrize("body", [{}, {"by": " "}, {"by": "ada", "version": "../x"}, {"by": "ada", "vershun": "3f2a"}])
def test_a_request_of_another_form_is_refused(body: dict[str, Any]) -> None:
    ear = Ear(document())
    with client_of(small_plant(), viewer=ear) as client:
        assert client.post("/twin/vmc/promote", json=body).status_code == 400
    assert ear.sent == []


def test_nobody_s_answer_is_waited_for_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(twin_routes, "ANSWER_S_MAX", 0.1)
    ear = Ear(document())
    monkeypatch.setattr(ear, "publish", lambda *_: True)
    with client_of(small_plant(), viewer=ear) as client:
        answer = client.post("/twin/vmc/back", json={"by": "ada"})
    assert answer.status_code == 504 and "cnctwin twin run" in answer.json()["error"]


@pytest.mark.parametrize("payload", [b"{", b"[]", b'{"machine": 3, "step": "shadow"}', b'{"machine": "vmc"}'])
def test_a_document_of_another_shape_is_not_taken(payload: bytes) -> None:
    loops = LiveLoops()
    loops.take(TOPIC, json.dumps(document()).encode())
    with pytest.raises(DocumentError):
        loops.take(TOPIC, payload)
    assert loops.of("vmc") == document()
    loops.take(TOPIC, b"")
    assert loops.of("vmc") is None


@pytest.mark.broker
def test_an_operator_promotes_and_goes_back_over_the_real_loop(
    mosquitto: Mosquitto, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setattr(twin_routes, "ANSWER_S_MAX", PATIENCE_S)
    with LoopPlant(tmp_path, mosquitto.port) as plant, served(mosquitto) as server:
        plant.until_step("shadow")
        plant.until(lambda: plant.document["may_promote"], "what speaks for it")
        wait(lambda: get(f"{server.url}/twin/vmc").json().get("may_promote"), "the interface to hear it")
        told = post(f"{server.url}/twin/vmc/promote", json={"by": "ada"}).json()
        assert told["answers"][-1]["done"]
        assert (plant.machines / "vmc.toml").read_text() == BETTER
        wait(lambda: get(f"{server.url}/twin/vmc").json()["live"]["version"] == VB, "the live version")
        stale = post(f"{server.url}/twin/vmc/back", json={"by": "ada", "version": VA}).json()
        assert "is not live any more" in stale["answers"][-1]["text"] and plant.own.live_version() == VB
        assert post(f"{server.url}/twin/vmc/back", json={"by": "ada"}).status_code == 200
        assert plant.own.live_version() == VA
        assert [step.by for step in plant.own.steps() if step.step in ("promoted", "back")] == ["ada", "ada"]
        noted = [(one["action"], one["object"], one["outcome"]) for one in get(f"{server.url}/audit").json()["deeds"]]
        assert ("promote twin", f"vmc {VB}", "done") in noted
