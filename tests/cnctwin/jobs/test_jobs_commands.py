"""`cnctwin jobs` against a real broker and a consumer that does real work: figures, exit codes, one line for what is wrong."""

import json
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cnctwin.commands.run.jobs import jobs_app
from cnctwin.errors import UsageError
from cnctwin.jobs.client import JobsClient
from cnctwin.jobs.consumer import Setting
from sparkplug.broker import BrokerAddress
from tests.cnctwin.commands.test_gap import written
from tests.cnctwin.jobs.conftest import PatientClient, Start, over
from tests.cnctwin.jobs.consumer_on_trial import setting
from tests.twin.gap.small_case import warm_case
from twin.machine import read_machine

pytestmark = pytest.mark.broker


class Jobs:
    """The command, run in this process to its end."""

    def __init__(self, address: BrokerAddress, patch: pytest.MonkeyPatch, captured: pytest.CaptureFixture[str]) -> None:
        patch.setenv("CNCTWIN_BROKER", address.url)
        self._captured = captured

    def __call__(self, *arguments: object) -> tuple[int, str, str]:
        """Exit code, stdout, stderr; an error of ours is exit code 2, as in cnctwin.cli."""
        self._captured.readouterr()
        try:
            code = jobs_app([str(argument) for argument in arguments], standalone_mode=False)
        except UsageError as error:
            print(f"cnctwin: {error}", file=sys.stderr)
            code = 2
        return int(code or 0), *self._captured.readouterr()


@pytest.fixture
def cnctwin_jobs(address: BrokerAddress, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Iterator[Jobs]:
    """The command."""
    yield Jobs(address, monkeypatch, capfd)


def test_a_job_is_asked_for_listed_shown_and_cancelled(cnctwin_jobs: Jobs, start: Start, tmp_path: Path) -> None:
    start(setting())
    (tmp_path / "a.json").write_text('{"job": "count", "to": 2, "id": "a", "machine": "[red]"}')
    code, out, _ = cnctwin_jobs("submit", tmp_path / "a.json", "--follow", "--json")
    assert (code, json.loads(out)["state"]) == (0, "done")
    (tmp_path / "b.json").write_text('{"job": "count", "to": 2, "hold_at": 1}')
    code, out, _ = cnctwin_jobs("submit", tmp_path / "b.json", "--id", "b", "--json")
    assert (code, json.loads(out)["answer"]) == (0, "accepted")
    code, out, _ = cnctwin_jobs("list")
    assert code == 0
    assert "[red]" in out
    assert "counted to 2" in out
    assert [one["id"] for one in json.loads(cnctwin_jobs("list", "--json")[1])["jobs"]] == ["b", "a"]
    assert cnctwin_jobs("cancel", "b")[0] == 0
    code, _, err = cnctwin_jobs("cancel", "b")
    assert (code, err) == (1, "cnctwin: job b is cancelled already\n")
    code, out, _ = cnctwin_jobs("show", "b")
    assert code == 1
    assert "reason: cancelled by request" in out
    code, _, err = cnctwin_jobs("show", "c", "--wait", "0.5")
    assert code == 2
    assert "knows no job 'c'" in err


def test_what_nobody_accepts_is_no_success_and_a_consumer_that_comes_late_is_asked_again(
    cnctwin_jobs: Jobs, start: Start, address: BrokerAddress, client: JobsClient
) -> None:
    code, _, err = cnctwin_jobs("submit", "--job", "diagnose", "--case", "x", "--id", "a", "--wait", "0.5")
    assert code == 1
    assert "a was not accepted within 0.5 s" in err
    assert "is `cnctwin jobs run` running? It is safe to send it again" in err
    code, _, err = cnctwin_jobs("list", "--wait", "0.5")
    assert code == 1
    assert "knows nothing of jobs" in err
    setting()
    answers: list[dict[str, object]] = []

    def ask() -> None:
        with PatientClient(address) as asking:
            answers.append(asking.submit({"job": "count", "to": 1, "id": "late"}))

    asking = threading.Thread(target=ask)
    asking.start()
    time.sleep(0.5)
    start()
    asking.join()
    assert answers[0]["answer"] == "accepted"
    assert over(client, "late")["state"] == "done"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("submit",), "give a file with a request, or --job"),
        (("submit", "nowhere.json"), "nowhere.json: cannot be read"),
        (("submit", "--job", "diagnose"), "case"),
        (("submit", "nowhere.json", "--job", "diagnose"), "either a request or options"),
        (("submit", "--job", "optimise", "--program", "nowhere.nc"), "nowhere.nc: cannot be read"),
        (("run", "--files", "nowhere"), "--files nowhere: is no folder"),
        (("run", "--dask", "http://x"), "Dask address 'http://x' is not tcp://"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(cnctwin_jobs: Jobs, arguments: tuple[str, ...], said: str) -> None:
    code, _, err = cnctwin_jobs(*arguments)
    assert code == 2
    assert said in err
    assert err.count("\n") == 1


def test_run_does_real_jobs_until_it_is_asked_to_end(cnctwin_jobs: Jobs, client: JobsClient, tmp_path: Path) -> None:
    written(warm_case(), tmp_path / "files/warm")
    answers: list[dict[str, object]] = []

    def ask() -> None:
        try:
            client.submit({"job": "identify", "case": "warm", "id": "i"})
            answers.append(over(client, "i", 300))
        finally:
            os.kill(os.getpid(), signal.SIGTERM)

    asking = threading.Thread(target=ask)
    asking.start()
    code, _, err = cnctwin_jobs("run", "--files", tmp_path / "files", "--dir", tmp_path / "jobs")
    asking.join()
    assert code == 0, err
    assert (answers[0]["state"], answers[0]["machine"]) == ("done", "small"), answers
    assert read_machine(tmp_path / "jobs/i/result/machine.toml").machine.name == "small"


def test_a_setting_is_the_command_of_a_job(tmp_path: Path) -> None:
    command = Setting(files=tmp_path, workers=3, dask="tcp://127.0.0.1:8786", child=("job",)).command
    assert command == ["job", "--files", str(tmp_path), "--workers", "3", "--dask", "tcp://127.0.0.1:8786"]
