"""A consumer at work on a real broker, in this process, and somebody who asks it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from cnctwin.jobs.client import JobsClient
from cnctwin.jobs.consumer import Consumer, Setting
from sparkplug.broker import BrokerAddress
from tests.cnctwin.jobs.consumer_on_trial import setting
from tests.wire.mosquitto import Mosquitto

Start = Callable[..., Consumer]
ROOT = Path(__file__).parents[3]


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
    with JobsClient(address) as asking:
        yield asking


def over(client: JobsClient, job_id: str, seconds: float = 20.0) -> dict[str, object]:
    """The job when nothing more becomes of it."""
    found = client.until(lambda: (job := client.job(job_id, seconds))["state"] not in {"queued", "running"} and job, seconds)
    assert found, client.job(job_id)
    return dict(found)
