"""The consumer as a process, ended in every way while a job runs and others wait: nothing is lost, nothing runs twice."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from cnctwin.jobs.client import JobsClient
from cnctwin.jobs.kinds import KINDS
from cnctwin.jobs.left_over import left_over
from sparkplug.broker import BrokerAddress
from tests.cnctwin.jobs.conftest import PATIENCE_S, ROOT, over
from tests.cnctwin.jobs.counting import COUNT, chain_to, checkpoint_of, written
from tests.cnctwin.program import is_alive, until

pytestmark = pytest.mark.broker
Process = subprocess.Popen[str]


@pytest.fixture(autouse=True)
def counting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who asks has to know the kind too, whichever tests this process has run before."""
    monkeypatch.setitem(KINDS, "count", COUNT)


@pytest.fixture
def begin(address: BrokerAddress, jobs: Path) -> Iterator[Callable[[], Process]]:
    """Starts a consumer; it is killed with the test."""
    with ExitStack() as stack:

        def begun() -> Process:
            command = [sys.executable, "-m", "tests.cnctwin.jobs.consumer_on_trial", str(address.port), str(jobs)]
            process = stack.enter_context(subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True))
            stack.callback(process.kill)
            return process

        yield begun


def test_a_killed_consumer_loses_nothing(begin: Callable[[], Process], client: JobsClient, jobs: Path) -> None:
    first = begin()
    client.submit({"job": "count", "to": 40, "hold_at": 20, "id": "a", "companion": True})
    client.submit({"job": "count", "to": 5, "id": "b"})
    until(lambda: checkpoint_of(jobs / "a") == 20, "the job to be on its way")
    at_work = left_over(jobs / "a")
    first.send_signal(signal.SIGKILL)
    first.wait()
    until(lambda: not any(map(is_alive, at_work)), "its processes to end with it")
    (jobs / "a/go").touch()
    second = begin()
    assert over(client, "a")["attempt"] == 2
    assert over(client, "b")["attempt"] == 1
    assert written(jobs / "a") == chain_to(40)
    assert written(jobs / "b") == chain_to(5)
    second.send_signal(signal.SIGTERM)
    assert second.wait(60) == 0
    assert "cut short, since the consumer ended; it goes on" in (second.stderr.read() if second.stderr else "")


def test_an_ordered_end_counts_as_no_attempt(begin: Callable[[], Process], client: JobsClient, jobs: Path) -> None:
    first = begin()
    client.submit({"job": "count", "to": 40, "hold_at": 20, "id": "a"})
    until(lambda: checkpoint_of(jobs / "a") == 20, "the job to be on its way")
    at_work = left_over(jobs / "a")
    os.kill(at_work[0], signal.SIGTERM)  # as a supervisor does that asks all of a group
    first.send_signal(signal.SIGTERM)
    assert first.wait(60) == 0
    assert not any(map(is_alive, at_work))
    kept = json.loads((jobs / "a/state.json").read_text())
    assert (kept["state"], kept["attempt"]) == ("queued", 0)
    assert client.until(lambda: str(client.job("a")["reason"]).startswith("the consumer was ended"), PATIENCE_S)
    (jobs / "a/go").touch()
    begin()
    found = over(client, "a")
    assert (found["state"], found["attempt"]) == ("done", 1)
    assert written(jobs / "a") == chain_to(40)
