"""What a job that is done leaves above a limit, as the interface tells it beside the job: in short and in full."""

import json

import pytest

from cnctwin.api.live.plant import LivePlant
from cnctwin.api.live.viewer import Viewer
from sparkplug.broker import BrokerAddress
from tests.cnctwin.api.small_plant import client_of
from twin.vocabulary.topics import JOBS_STATE, state_of_job

DONE = {"id": "night-7", "kind": "optimise", "state": "done"}


@pytest.mark.parametrize(
    ("result", "caution"),
    [
        ({"lines_over": 0, "collisions": []}, ""),
        ({"lines_over": 2, "collisions": []}, "2 lines are above a limit"),
        ({"lines_over": 0, "collisions": [12]}, "a rapid goes into material in line 12"),
        ({}, ""),
    ],
)
def test_a_job_is_told_with_what_its_result_exceeds(result: dict[str, object], caution: str) -> None:
    viewer = Viewer(BrokerAddress(), "cnc", LivePlant())
    viewer.jobs.take(JOBS_STATE, json.dumps({"at": "2999-01-01T00:00:00Z", "jobs": [DONE]}).encode())
    viewer.jobs.take(state_of_job("night-7"), json.dumps({**DONE, "result": result}).encode())
    with client_of(viewer=viewer) as client:
        (short,) = client.get("/jobs").json()["jobs"]
        assert (short["caution"], client.get("/jobs/night-7").json()["caution"]) == (caution, caution)
