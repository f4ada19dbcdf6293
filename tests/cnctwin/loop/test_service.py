"""The loop's service on a real broker, with the real consumer of jobs: the way round, and kill -9 in every step of it."""

import json
import os
import signal
import time
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from processors.description import version_of
from sparkplug.clock import now_ms
from tests.cnctwin.composing.made_up import DAY_MS, DESCRIPTION, T0_MS, store_of_days
from tests.cnctwin.loop.loop_on_trial import BETTER, LIVE, ROOT, VA, VB, LoopPlant
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker


@pytest.fixture
def plant(tmp_path: Path, mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch) -> Iterator[LoopPlant]:
    """A machine whose gap stands open until the better description is live."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    with LoopPlant(tmp_path, mosquitto.port) as found:
        yield found


def test_an_open_gap_is_diagnosed_promoted_by_a_person_and_taken_back(plant: LoopPlant) -> None:
    plant.until_step("shadow")
    assert (plant.own.live_version(), plant.own.challenger_version()) == (VA, VB)
    assert (plant.machines / "diagnoses").is_dir() is False  # this child files nothing for the page
    plant.until(lambda: plant.document["standing"].get("spindle_temp_c", {}).get("challenger") == 1.0, "the shadow's gap")
    document = plant.document
    assert document["may_promote"] and document["score"] == {"live": 3.1, "challenger": 1.1, "runs": 2}
    assert document["challenger"]["sentence"] == "coolant cools"
    plant.ask("promote", version=VB, id="first")
    plant.ask("promote", version=VB, id="second")
    plant.until(lambda: {"first", "second"} <= {one["id"] for one in plant.document["answers"]}, "both answers")
    plant.until_step("promoted")
    assert (plant.machines / "vmc.toml").read_text() == BETTER
    plant.until(lambda: (plant.document["last"] or {}).get("after") == 1.0, "the gap after")
    assert plant.document["last"]["text"] == "coolant cools: gap of the temperature 3.1 → 1.0 × the repeatability"
    assert plant.document["text"].startswith("coolant cools: gap of the temperature 3.1 → 1.0 × the repeatability since ")
    plant.ask("back", version=VB, id="third")
    plant.ask("back", version=VB, id="third")
    plant.until(lambda: plant.own.live_version() == VA, "the way back")
    assert (plant.machines / "vmc.toml").read_text() == LIVE
    kinds = Counter(str(step.step) for step in plant.own.steps())
    assert (kinds["promoted"], kinds["back"]) == (1, 1)
    assert [step.by for step in plant.own.steps() if step.step == "promoted"] == ["anna"]


def test_what_may_not_be_is_answered_with_its_reason(plant: LoopPlant) -> None:
    plant.gaps[VA] = 1.0
    plant.until_step("watching")
    plant.ask("promote", version=VB, id="one")
    plant.until(lambda: any(one["id"] == "one" for one in plant.document.get("answers", ())), "the answer")
    answer = plant.document["answers"][-1]
    assert not answer["done"] and "versions begin with" in answer["text"]
    assert plant.own.live_version() == VA


def test_a_description_that_makes_it_worse_goes_back_by_itself(plant: LoopPlant) -> None:
    plant.gaps[VB] = 4.0
    plant.until_step("shadow")
    plant.until(lambda: plant.document["standing"].get("spindle_temp_c", {}).get("live") == 3.1, "the gap")
    plant.until(lambda: plant.own.challenger_version() == VB, "a challenger")
    plant.ask("promote", version=VB, id="one")
    plant.until(lambda: any(str(step.step) == "back" for step in plant.own.steps()), "the way back")
    step = next(step for step in plant.own.steps() if str(step.step) == "back")
    assert step.by == "rule" and "before the promotion it was" in step.why
    assert plant.own.live_version() == VA


def test_with_real_history_and_the_real_diagnosis_the_cause_is_named_and_the_page_finds_it(
    tmp_path: Path, mosquitto: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    store_of_days(tmp_path / "store", 2, coolant_gain=2.0).close()
    began, ended = (datetime.fromtimestamp(ms / 1000, UTC).isoformat() for ms in (T0_MS, T0_MS + 2 * DAY_MS))
    live = version_of(DESCRIPTION)
    window, at_ms = f"{began}/{ended}", lambda: T0_MS + 2 * DAY_MS + now_ms() % 1_000_000
    with LoopPlant(
        tmp_path, mosquitto.port, gaps={live: 3.1}, live=DESCRIPTION, window=window, at_ms=at_ms, store=tmp_path / "store"
    ) as plant:
        plant.until_step("shadow")
        document = plant.document
        assert document["challenger"]["verdict"] == "explained"
        assert "coolant cools" in document["challenger"]["sentence"]
        assert ": gap of the spindle " in document["challenger"]["sentence"]
        assert "coolant_cooling" in [cause["effect"] for cause in document["challenger"]["causes"]]
        assert document["score"]["runs"] > 0 and document["score"]["challenger"] < document["score"]["live"]
        assert document["may_promote"]
        filed = json.loads((plant.machines / "diagnoses" / "vmc" / "diagnosis.json").read_text())
        assert filed["verdict"] == "explained" and (plant.machines / "diagnoses" / "vmc" / "report.html").is_file()
        plant.ask("promote", id="one")
        plant.until_step("promoted")
        assert "coolant" in plant.own.live_file.read_text()
        assert plant.own.card(plant.own.live_version()).fitted_to < T0_MS + DAY_MS


HOLDS = {
    "composing": "files/loop/vmc/hold-compose",
    "diagnosing": "jobs/hold",
    "judging": "files/loop/vmc/hold-judge",
}


def test_killed_in_every_step_it_comes_to_the_same_end_and_nothing_is_promoted_twice(plant: LoopPlant) -> None:
    for hold in HOLDS.values():
        (plant.folder / hold).touch()
    for name, hold in HOLDS.items():
        plant.until_step("diagnosing" if name == "judging" else name)
        if name == "diagnosing":
            plant.until(lambda: plant.document["progress"] == 0.5, "the job to be on its way")
        time.sleep(0.3)
        plant.kill()
        plant.start()
        (plant.folder / hold).unlink()
    plant.until_step("shadow")
    plant.kill()
    plant.start()
    plant.ask("promote", version=VB, id="one")
    plant.until(lambda: plant.own.live_version() == VB or plant.ask("promote", version=VB, id="one"), "the promotion")
    plant.kill()
    plant.start()
    plant.until_step("promoted")
    plant.kill()
    plant.start()
    plant.until(lambda: plant.document.get("step") == "promoted" and plant.document["last"]["after"] == 1.0, "the end")
    kinds = Counter(str(step.step) for step in plant.own.steps())
    assert kinds == {"described": 1, "composing": 1, "diagnosing": 1, "filed": 1, "promoted": 1}
    assert (plant.own.live_version(), plant.own.challenger_version()) == (VB, "")
    assert len([path for path in plant.jobs.iterdir() if path.name.startswith("loop-")]) == 1


def test_the_diagnosing_child_killed_is_begun_again_and_one_challenger_comes_of_it(plant: LoopPlant) -> None:
    hold, pid = plant.folder / HOLDS["diagnosing"], plant.jobs / "pid"
    hold.touch()
    plant.until_step("diagnosing")
    first = plant.until(lambda: pid.is_file() and pid.read_text(), "the child")
    os.kill(int(first), signal.SIGKILL)
    plant.until(lambda: pid.read_text() not in ("", first), "the child of the next attempt")
    hold.unlink()
    plant.until_step("shadow")
    kinds = Counter(str(step.step) for step in plant.own.steps())
    assert kinds == {"described": 1, "composing": 1, "diagnosing": 1, "filed": 1}
    assert (plant.own.live_version(), plant.own.challenger_version()) == (VA, VB)
    assert len([path for path in plant.jobs.iterdir() if path.name.startswith("loop-")]) == 1
