"""Jobs over a real broker and the real consumer: asked for, shown, cancelled, their files; and where there is no consumer."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from cnctwin.api.access import Access
from cnctwin.api.routes import jobs as job_routes
from cnctwin.api.server import Server
from cnctwin.jobs.consumer import Consumer
from sparkplug.broker import BrokerAddress
from tests.cnctwin.api.served_plant import PATIENCE_S, get, post, served
from tests.cnctwin.api.small_plant import client_of
from tests.cnctwin.jobs.consumer_on_trial import setting
from tests.cnctwin.jobs.counting import chain_to
from tests.edge.host_watch import wait
from tests.recordings import PROJECT
from tests.until_stopped import until_stopped
from tests.wire.mosquitto import Mosquitto
from twin.vocabulary.topics import JOBS_STATE

NAMED = {"X-Remote-User": "grace"}
PROXIED = Access(proxy_header="X-Remote-User", proxy="127.0.0.1")


@pytest.fixture
def folder(mosquitto: Mosquitto, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Of a consumer that runs, and whose jobs count."""
    monkeypatch.setenv("PYTHONPATH", str(PROJECT))
    monkeypatch.setattr(job_routes, "ANSWER_S_MAX", PATIENCE_S)
    consumer = Consumer(tmp_path / "jobs", BrokerAddress(*mosquitto.address), setting())
    with until_stopped(consumer.run):
        yield tmp_path / "jobs"


def jobs(server: Server) -> dict[str, Any]:
    told: dict[str, Any] = get(f"{server.url}/jobs").json()
    return told


def state_of(server: Server, job_id: str) -> str | None:
    return next((str(one["state"]) for one in jobs(server)["jobs"] if one["id"] == job_id), None)


@pytest.mark.broker
def test_a_job_is_asked_for_shown_and_its_files_are_had(mosquitto: Mosquitto, folder: Path) -> None:
    with served(mosquitto, jobs=folder) as server:
        wait(lambda: jobs(server)["available"], "the consumer")
        asked = {"job": "count", "id": "ten", "to": 10, "machine": "mill"}
        told = [post(f"{server.url}/jobs", json=asked).json() for _ in range(2)]
        assert [(one["id"], one["answer"]) for one in told] == [("ten", "accepted"), ("ten", "known")]
        wait(lambda: state_of(server, "ten") == "done", "its end")
        (short,) = jobs(server)["jobs"]
        assert (short["kind"], short["progress_pct"], short["sentence"]) == ("count", 100.0, "counted to 10")
        wait(lambda: get(f"{server.url}/jobs/ten").json().get("result"), "its result")
        assert get(f"{server.url}/jobs/ten").json()["result"]["chain"] == chain_to(10)
        assert get(f"{server.url}/machines").json() == [], "neither a job nor what it is about is a machine of the plant"
        file = get(f"{server.url}/jobs/ten/files/chain.txt")
        assert (file.text, file.headers["content-disposition"]) == (chain_to(10), 'attachment; filename="ten-chain.txt"')
        for place in (
            "ten/files/state.json",
            "ten/files/..%2Fstate.json",
            "eleven/files/chain.txt",
            "..%2Fjobs/files/x",
            "eleven",
        ):
            refused = get(f"{server.url}/jobs/{place}")
            assert (refused.status_code, list(refused.json())) == (404, ["error"]), place


@pytest.mark.broker
def test_a_job_is_cancelled_and_what_is_wrong_is_refused(mosquitto: Mosquitto, folder: Path) -> None:
    with served(mosquitto) as server:
        wait(lambda: jobs(server)["available"], "the consumer")
        long = post(f"{server.url}/jobs", json={"job": "count", "to": 10_000, "pause_s": 0.05}).json()
        assert long["id"].startswith("count-")
        wait(lambda: state_of(server, long["id"]) == "running", "its start")
        told = post(f"{server.url}/jobs/{long['id']}/cancel")
        assert (told.status_code, told.json()["answer"]) == (200, "cancelled")
        wait(lambda: state_of(server, long["id"]) == "cancelled", "its end")
        assert post(f"{server.url}/jobs/nobody/cancel").status_code == 404
        for body, status, said in (
            ({"job": "bake"}, 400, "job = 'bake': is none of"),
            ({"job": "count"}, 400, "to"),
            ({"job": "diagnose", "case": "x", "reply_to": "a/b"}, 400, "reply_to"),
            ({"job": "diagnose", "case": "../x"}, 409, "--files"),
            ({"job": "count", "to": 3, "id": long["id"]}, 409, "is that of another request"),
        ):
            refused = post(f"{server.url}/jobs", json=body)
            assert (refused.status_code, said in refused.json()["error"]) == (status, True), refused.text
        foreign = post(f"{server.url}/jobs", json={"job": "count", "to": 1}, headers={"Origin": "http://elsewhere.example"})
        assert foreign.status_code == 403


@pytest.mark.broker
def test_a_job_is_in_the_name_of_the_proxy_s_user_and_so_is_its_end(mosquitto: Mosquitto, folder: Path) -> None:
    with served(mosquitto, access=PROXIED) as server:
        wait(lambda: get(f"{server.url}/jobs", headers=NAMED).json()["available"], "the consumer")
        asked = {"job": "count", "to": 10_000, "pause_s": 0.05, "id": "mine", "by": "mallory"}
        assert post(f"{server.url}/jobs", json=asked, headers=NAMED).status_code == 200
        wait(lambda: get(f"{server.url}/jobs/mine", headers=NAMED).status_code == 200, "the job")
        assert get(f"{server.url}/jobs/mine", headers=NAMED).json()["by"] == "grace"
        assert post(f"{server.url}/jobs/mine/cancel", headers=NAMED).status_code == 200
        wait(lambda: get(f"{server.url}/jobs/mine", headers=NAMED).json()["reason"] == "cancelled by grace", "its end")
        deeds = get(f"{server.url}/audit", headers=NAMED).json()["deeds"]
        assert [(one["user"], one["action"], one["object"], one["outcome"]) for one in reversed(deeds)] == [
            ("grace", "ask for job", "mine", "done"),
            ("grace", "cancel job", "mine", "done"),
        ]


@pytest.mark.broker
def test_where_no_consumer_is_it_says_so(mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job_routes, "ANSWER_S_MAX", 0.3)
    asked = {"job": "diagnose", "case": "vmc"}
    with served(mosquitto) as server:
        wait(lambda: get(f"{server.url}/health").json()["parts"][0]["state"] == "ok", "the broker")
        assert "nothing was heard of jobs" in jobs(server)["reason"]
        unheard = post(f"{server.url}/jobs", json=asked)
        assert (unheard.status_code, "cnctwin jobs run" in unheard.json()["error"]) == (503, True)
        heard = server.sources.viewer.jobs.take
        heard(JOBS_STATE, b'{"at": "2020-01-01T00:00:00Z", "jobs": []}')
        assert "does not run any more" in jobs(server)["reason"]
        heard(JOBS_STATE, b'{"at": "2999-01-01T00:00:00Z", "jobs": []}')
        assert jobs(server)["available"]
        nobody = post(f"{server.url}/jobs", json=asked)
        assert (nobody.status_code, "no answer within 0.3 s" in nobody.json()["error"]) == (504, True)


def test_behind_a_proxy_only_its_users_may_ask() -> None:
    with client_of(access=PROXIED) as client:
        assert client.post("/jobs", json={"job": "diagnose", "case": "x"}).status_code == 401
        assert client.get("/jobs").status_code == 401
