"""The consumer on a real Mosquitto: asked in plain JSON and by Sparkplug commands, its jobs killed, its broker gone."""

import json
import os
import signal
import sys
import time
from pathlib import Path
from random import Random

import pytest

from cnctwin.errors import UsageError
from cnctwin.jobs.client import JobsClient
from cnctwin.jobs.consumer import Consumer, Setting
from cnctwin.jobs.job import Job, JobState
from cnctwin.jobs.job_queue import Limits
from cnctwin.jobs.left_over import left_over
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.host_session import EventKind
from sparkplug.metric import Change, NodeId
from tests.cnctwin.jobs.conftest import PATIENCE_S, PatientClient, Start, over
from tests.cnctwin.jobs.consumer_on_trial import COUNTING, setting
from tests.cnctwin.jobs.counting import chain_to, checkpoint_of, written
from tests.cnctwin.program import until
from tests.wire.mosquitto import Mosquitto
from twin.vocabulary import topics

pytestmark = pytest.mark.broker
NODE = NodeId("cnc", "twin-jobs")


class Plant:
    """A host application that hears all of Sparkplug, and plain topics."""

    def __init__(self, address: BrokerAddress, *plain: str) -> None:
        self.host = HostApplication(address, "plant", rebirth_interval_ms_min=100)
        self.plain: list[tuple[str, dict[str, object]]] = []
        self.shown: dict[tuple[str, str], list[object]] = {}
        for topic in plain:
            self.host.subscribe_plain(topic)
        self.host.start()
        self.until(lambda: self.host.online)

    def until(self, true: object, seconds: float = PATIENCE_S) -> None:
        """Listen until something is so."""
        deadline_s = time.monotonic() + seconds
        while not true():  # type: ignore[operator]
            assert time.monotonic() < deadline_s, (self.plain, self.shown)
            for event in self.host.poll(0.02):
                if event.kind is EventKind.PLAIN:
                    self.plain.append((event.topic, json.loads(event.payload)))
                for reading in event.readings:
                    self.shown.setdefault((event.device or "", reading.name), []).append(reading.value)

    def is_heard(self) -> bool:
        """Return whether a consumer listens: it says how jobs stand when it has subscribed, and on the same connection."""
        return any(topic == topics.JOBS_STATE for topic, _ in self.plain)

    def said(self, device: str, name: str) -> list[object]:
        """All values of a metric, in their order."""
        return self.shown.get((device, name), [])


def test_a_plain_request_is_accepted_done_and_answered(start: Start, address: BrokerAddress, jobs: Path) -> None:
    start()
    plant = Plant(address, "cell/answers", "cnc/jobs/#")
    asked = {"job": "count", "to": 30, "id": "night-7", "reply_to": "cell/answers", "machine": "vmc", "hold_at": 15}
    plant.until(plant.is_heard)
    plant.host.publish_plain(topics.JOB_REQUEST, json.dumps(asked).encode(), qos=1)
    for device in ("vmc", "jobs"):
        plant.until(lambda device=device: any(plant.said(device, "twin/job_progress_pct")))  # more than none
    (jobs / "night-7/go").touch()
    answers: list[dict[str, object]] = []

    def answered() -> bool:
        answers[:] = [told for topic, told in plant.plain if topic == "cell/answers"]
        return len(answers) == 2 and "done" in plant.said("vmc", "twin/job_state")

    plant.until(answered)
    assert answers[0] == {"id": "night-7", "answer": "accepted", "reason": "", "state": "queued", "place": 1}
    assert answers[1]["answer"] == "done"
    assert answers[1]["result"] == {"sentence": "counted to 30", "chain": chain_to(30), "files": {"chain.txt": 64}}
    assert written(jobs / "night-7") == chain_to(30)
    for device in ("vmc", "jobs"):
        states = [state for state in plant.said(device, "twin/job_state") if state]
        # a device that is born late begins with what is true by then
        assert list(dict.fromkeys(states)) in (["queued", "running", "done"], ["running", "done"])
        assert plant.said(device, "twin/job_id")[-1] == "night-7"
        assert json.loads(str(plant.said(device, "twin/job_result")[-1]))["chain"] == chain_to(30)
        progress = [value for value in plant.said(device, "twin/job_progress_pct") if isinstance(value, float)]
        assert progress[-1] == 100.0
        assert progress == sorted(progress)
        assert len(progress) > 2
    shown = [told for topic, told in plant.plain if topic == topics.state_of_job("night-7")]
    assert shown[-1]["state"] == "done"
    plant.host.stop()


def test_a_device_command_is_a_request_and_its_answer_a_metric(start: Start, address: BrokerAddress, client: JobsClient) -> None:
    start()
    plant = Plant(address)
    plant.until(lambda: plant.said("jobs", "Job/Request") and plant.said("", "Job/Request"))

    def answer(device: str | None, metric: str, text: str, to_hold: str) -> None:
        plant.host.send_command(NODE, device, [Change(metric, text, 1)])
        plant.until(lambda: to_hold in str(plant.said(device or "", "Job/Answer")[-1:]))

    for device in ("jobs", None):
        answer(
            device,
            "Job/Request",
            json.dumps({"job": "count", "to": 3, "id": f"by-{device}"}),
            f'"by-{device}", "answer": "accepted"',
        )
        assert over(client, f"by-{device}")["state"] == "done"
    answer("jobs", "Job/Request", "{nonsense", "is not JSON")
    answer("jobs", "Job/Cancel", "by-jobs", "done already")
    plant.host.stop()


def test_a_killed_process_goes_on_from_its_checkpoint_to_the_same_result(start: Start, client: JobsClient, jobs: Path) -> None:
    start()
    client.submit({"job": "count", "to": 60, "id": "a", "hold_at": 20, "companion": True})
    until(lambda: checkpoint_of(jobs / "a") == 20, "the job to be on its way")
    processes = left_over(jobs / "a")
    assert len(processes) == 2
    os.kill(min(processes), signal.SIGKILL)
    (jobs / "a/go").touch()
    found = over(client, "a")
    assert (found["state"], found["attempt"], found["reason"]) == ("done", 2, "")
    assert written(jobs / "a") == chain_to(60)
    until(lambda: not left_over(jobs / "a"), "what it started to be gone")


def test_what_kills_three_attempts_is_given_up_and_reported_and_the_next_one_is_done(
    start: Start, client: JobsClient, jobs: Path
) -> None:
    consumer = start()
    client.submit({"job": "count", "to": 9, "id": "a", "kill_at": [2, 4, 6, 8]})
    client.submit({"job": "count", "to": 9, "id": "b"})
    found = over(client, "a")
    assert (found["state"], found["attempt"]) == ("failed", 3)
    assert found["reason"] == "given up after 3 attempts; the last one: killed by SIGKILL"
    assert checkpoint_of(jobs / "a") == 6
    assert over(client, "b")["state"] == "done"
    assert consumer.announcer.counts["attempts_lost"] == 3


def test_what_memory_or_disk_do_not_allow_is_reported(start: Start, client: JobsClient) -> None:
    start(setting(Limits(attempts_max=1)))
    reasons = {
        "memory": "given up after 1 attempt; it: the memory was not enough",
        "disk": "the disk is full; make room, and ask for it again under another id",
    }
    for fail in reasons:
        client.submit({"job": "count", "to": 1, "id": fail, "fail": fail})
    assert {fail: over(client, fail)["reason"] for fail in reasons} == reasons
    assert {over(client, fail)["state"] for fail in reasons} == {"failed"}


def test_jobs_that_are_over_too_long_go_from_disk_and_broker(start: Start, client: JobsClient, jobs: Path) -> None:
    start(setting(Limits(kept_max=1)))
    for name in ("a", "b"):
        client.submit({"job": "count", "to": 1, "id": name, "machine": f"machine of {name}"})
        assert over(client, name)["state"] == "done"
    assert client.until(lambda: [one["id"] for one in client.state()["jobs"]] == ["b"], PATIENCE_S)
    assert not (jobs / "a").exists()
    with pytest.raises(UsageError, match="knows no job 'a'"), JobsClient(client.broker) as later:
        later.job("a", 0.5)


def test_jobs_that_wait_and_one_that_runs_are_cancelled(start: Start, client: JobsClient, jobs: Path) -> None:
    start()
    long = {"job": "count", "to": 2, "hold_at": 1}
    assert client.submit({**long, "id": "a"})["place"] == 1
    until(lambda: checkpoint_of(jobs / "a") > 0, "the job to run")
    assert [client.submit({**long, "id": one})["place"] for one in ("b", "c")] == [1, 2]
    assert client.cancel("b")["answer"] == "cancelled"
    assert client.until(lambda: client.job("c")["place"] == 1, PATIENCE_S)
    assert client.cancel("a")["answer"] == "cancelled"
    assert left_over(jobs / "a") == []
    assert over(client, "a")["state"] == over(client, "b")["state"] == "cancelled"
    assert client.until(lambda: client.job("c")["state"] == "running", PATIENCE_S)
    assert client.cancel("a")["reason"] == "job a is cancelled already"
    assert "no job" in client.cancel("never")["reason"]
    client.cancel("c")


def test_a_job_that_takes_too_long_is_ended(start: Start, client: JobsClient, jobs: Path) -> None:
    start(setting(Limits(seconds_max=0.7, pause_s=0.01)))
    client.submit({"job": "count", "to": 2, "hold_at": 1, "id": "a"})
    found = over(client, "a")
    assert found["state"] == "failed"
    assert "it took more than" in str(found["reason"])
    assert left_over(jobs / "a") == []


def test_the_same_request_is_one_job_and_another_under_its_id_is_refused(start: Start, client: JobsClient, jobs: Path) -> None:
    start(setting(Limits(queued_max=1)))
    first = {"job": "count", "to": 2, "hold_at": 1, "id": "a"}
    assert client.submit(first)["answer"] == "accepted"
    until(lambda: checkpoint_of(jobs / "a") > 0, "the job to run")
    assert client.submit(dict(reversed(first.items())))["answer"] == "known"
    assert "another request" in client.submit({**first, "to": 3})["reason"]
    assert client.submit({**first, "id": "b"})["place"] == 1
    full = client.submit({**first, "id": "c"})
    assert (full["answer"], full["reason"]) == ("refused", "1 jobs wait already; send it again when some are done")
    assert not (jobs / "c").exists()
    client.cancel("b")
    client.cancel("a")


def test_what_was_done_when_the_consumer_was_killed_is_not_done_again(start: Start, client: JobsClient, jobs: Path) -> None:
    folder = jobs / "a"
    folder.mkdir(parents=True)
    job = Job(id="a", kind="count", number=1, digest="", accepted_ms=1, changed_ms=1, attempt=1, reply_topic="cnc/jobs/reply/a")
    (folder / "state.json").write_text(job.now(2, state=JobState.RUNNING).model_dump_json())
    (folder / "request.json").write_text('{"job": "count", "to": 3, "id": "a"}')
    (folder / "outcome.json").write_text('{"attempt": 1, "state": "done", "result": {"sentence": "as it said"}}')
    start()
    found = over(client, "a")
    assert (found["state"], found["attempt"], found["result"]) == ("done", 1, {"sentence": "as it said"})
    assert not (folder / "checkpoint.json").exists()


def test_no_payload_ends_the_consumer(start: Start, client: JobsClient, address: BrokerAddress) -> None:
    consumer = start()
    chance = Random(8)
    nasty = [
        b"",
        b"\xff\xfe",
        b"[" * 100_000,
        b'{"job": "count", "to": 1e400}',
        b'{"id": {}}',
        b"9" * 5000,
        b'{"job": "\\ud800"}',
    ]
    nasty += [
        b'{"job": "count", "to": NaN}',
        b'{"reply_to": "spBv1.0/cnc/NCMD/edge"}',
        b'{"id": "reply"}',
        b'{"id": "a\\n"}',
        b"null",
        b'"x"',
    ]
    nasty += [chance.randbytes(chance.randrange(300)) for _ in range(60)]
    plant = Plant(address, topics.JOBS_STATE)
    plant.until(plant.is_heard)
    for number, payload in enumerate(nasty, start=1):
        for topic in (topics.JOB_REQUEST, topics.JOB_CANCEL, topics.state_of_job("x"), topics.state_of_job("%")):
            plant.host.publish_plain(topic, payload, qos=1)
        if number % 20 == 0:  # its inbox has room for 200 messages
            until(lambda number=number: consumer.announcer.counts["requests_refused"] == number, "it to have read them")
    client.submit({"job": "count", "to": 1, "id": "good"})
    assert over(client, "good")["state"] == "done"
    assert consumer.announcer.counts["requests_refused"] == len(nasty)
    plant.host.stop()


def test_after_the_broker_was_away_what_it_retains_is_right_again(
    start: Start, client: JobsClient, mosquitto: Mosquitto, address: BrokerAddress, jobs: Path
) -> None:
    start()
    client.submit({"job": "count", "to": 2, "hold_at": 1, "id": "a"})
    mosquitto.kill()
    until(lambda: checkpoint_of(jobs / "a") == 1, "the job to be on its way")
    (jobs / "a/go").touch()
    until((jobs / "a/outcome.json").exists, "its end")
    mosquitto.start()
    with PatientClient(address) as later:
        assert over(later, "a")["state"] == "done"
        state = later.state()
        assert [one["id"] for one in state["jobs"]] == ["a"]
        assert later.until(lambda: later.state()["jobs"][0]["state"] == "done", PATIENCE_S)


def test_a_file_outside_the_files_folder_is_refused_with_its_name(start: Start, client: JobsClient, tmp_path: Path) -> None:
    (tmp_path / "files").mkdir()
    (tmp_path / "secret.nc").write_text("G0")
    start(Setting(files=tmp_path / "files", child=COUNTING))
    asked = {"job": "optimise", "program": "../secret.nc", "machine_toml": "[machine]\nname = 'a'"}
    answer = client.submit(asked)
    assert answer["answer"] == "refused"
    assert answer["reason"] == "program = '../secret.nc': leads out of the consumer's files folder; name a file below it"


def test_a_second_consumer_of_the_same_folder_is_refused(start: Start, jobs: Path, address: BrokerAddress) -> None:
    start()
    with pytest.raises(UsageError, match=f"process {os.getpid()} .* runs these jobs already"):
        Consumer(jobs, address, setting())


def test_the_password_of_the_broker_goes_to_no_job(monkeypatch: pytest.MonkeyPatch, start: Start, jobs: Path) -> None:
    monkeypatch.setenv("CNCTWIN_PASSWORD", "hunter2")
    if sys.platform != "linux":
        pytest.skip("looks into /proc")
    consumer = start()
    with PatientClient(BrokerAddress(port=consumer.broker.port)) as client:
        client.submit({"job": "count", "to": 2, "hold_at": 1, "id": "a"})
        until(lambda: bool(left_over(jobs / "a")), "the job to run")
        assert b"hunter2" not in Path(f"/proc/{left_over(jobs / 'a')[0]}/environ").read_bytes()
        client.cancel("a")
