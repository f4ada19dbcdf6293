"""A consumer at work on a real broker, in this process, and somebody who asks it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from cnctwin.jobs.client import JobsClient
from cnctwin.jobs.consumer import Consumer, Setting
from sparkplug.broker import BrokerAddress
from tests.cnctwin.jobs.consumer_on_trial import setting
from tests.wire.mosquitto import Mosquitto

Start = Callable[..., Consumer]
ROOT = Path(__file__).parents[3]
PATIENCE_S = 60.0  # the tests run beside others


class PatientClient(JobsClient):
    """It waits for a consumer whose process is still to start beside many others."""

    def submit(self, document: dict[str, Any], wait_s: float = PATIENCE_S) -> dict[str, Any]:
        """As it is."""
        return super().submit(document, wait_s)

    def cancel(self, job_id: str, wait_s: float = PATIENCE_S) -> dict[str, Any]:
        """As it is."""
        return super().cancel(job_id, wait_s)

    def state(self, wait_s: float = PATIENCE_S) -> dict[str, Any]:
        """As it is."""
        return super().state(wait_s)

    def job(self, job_id: str, wait_s: float = PATIENCE_S) -> dict[str, Any]:
        """As it is."""
        return super().job(job_id, wait_s)


@pytest.fixture
def address(mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch) -> BrokerAddress:
    """Of the broker; processes that are started find the tests."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    return BrokerAddress(port=mosquitto.port)


@pytest.fixture
def jobs(tmp_path: Path) -> Path:
    """The folder of jobs."""
    return tmp_path / "jobs"


@pytest.fixture
def start(address: BrokerAddress, jobs: Path) -> Iterator[Start]:
    """Starts a consumer; it ends with the test."""
    with ExitStack() as stack:

        def started(given: Setting | None = None) -> Consumer:
            consumer = Consumer(jobs, address, given or setting())
            stop = threading.Event()
            thread = threading.Thread(target=consumer.run, args=(stop,))
            thread.start()
            stack.callback(thread.join, 20)
            stack.callback(stop.set)
            return consumer

        yield started


@pytest.fixture
def client(address: BrokerAddress) -> Iterator[JobsClient]:
    """Somebody who asks."""
    with PatientClient(address) as asking:
        yield asking


def over(client: JobsClient, job_id: str, seconds: float = PATIENCE_S) -> dict[str, object]:
    """The job when nothing more becomes of it."""
    found = client.until(lambda: (job := client.job(job_id, seconds))["state"] not in {"queued", "running"} and job, seconds)
    assert found, client.job(job_id)
    return dict(found)
