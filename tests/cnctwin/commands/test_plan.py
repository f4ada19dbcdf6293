"""`cnctwin plan`: exit codes, and what a program and a person read."""

import json

import pytest
from typer.testing import CliRunner

from cnctwin.cli import app

RUNNER = CliRunner()


def test_a_small_fleet_fits_and_a_program_can_read_the_plan() -> None:
    done = RUNNER.invoke(app, ["plan", "fleet", "--machines", "2", "--hz", "1", "--cores", "2", "--disk-gb", "100", "--json"])
    told = json.loads(done.stdout)
    assert done.exit_code == 0 and told["limits"] == [] and told["fleet"] == {"machines": 2, "hz": 1.0, "metrics": 13}
    assert len(told["processes"]) == 1 and told["calibration_us"] is None


def test_a_fleet_that_is_too_large_says_what_follows() -> None:
    done = RUNNER.invoke(app, ["plan", "fleet", "--machines", "5000", "--cores", "2", "--disk-gb", "100"])
    assert done.exit_code == 1
    assert "One computer is not enough" in done.stdout and "Kafka" in done.stdout and "groups of" in done.stdout


def test_past_one_computer_the_layout_on_kafka_is_told_with_what_it_rests_on() -> None:
    given = ["plan", "fleet", "--machines", "5000", "--hz", "10", "--processors", "12", "--cores", "2", "--disk-gb", "100"]
    done = RUNNER.invoke(app, given)
    assert done.exit_code == 1
    for what in ("MQTT brokers:", "bridges:", "runners:", "partitions:", "Kafka brokers:", "Kafka disk:", "network:", "pages:"):
        assert what in done.stdout, what
    assert "is an extrapolation" in done.stdout and done.stdout.count("from ") >= 8
    told = json.loads(RUNNER.invoke(app, [*given, "--json"]).stdout)
    assert told["kafka"]["runners"] >= 1 and sum(len(one["processors"]) for one in told["processes"]) == 12


def test_on_one_computer_nothing_is_said_of_kafka() -> None:
    given = ["plan", "fleet", "--machines", "2", "--cores", "2", "--disk-gb", "100"]
    assert "Kafka" not in RUNNER.invoke(app, given).stdout
    assert json.loads(RUNNER.invoke(app, [*given, "--json"]).stdout)["kafka"] is None


def test_some_processors_only() -> None:
    given = ["plan", "fleet", "--machines", "3", "--processors", "thermal,mirror", "--cores", "2"]
    done = RUNNER.invoke(app, given)
    assert done.exit_code == 0 and "disk:" not in done.stdout and "One computer is enough" in done.stdout
    assert [p["processors"] for p in json.loads(RUNNER.invoke(app, [*given, "--json"]).stdout)["processes"]] == [
        ["mirror", "thermal"]
    ]


@pytest.mark.parametrize("slower", [1.0, 3.0])
def test_what_is_measured_here_scales_the_plan(slower: float, monkeypatch: pytest.MonkeyPatch) -> None:
    from cnctwin.planning import calibration
    from cnctwin.planning.measured import MEASURED

    given = ["plan", "fleet", "--machines", "2", "--cores", "2", "--json"]
    plain = json.loads(RUNNER.invoke(app, given).stdout)
    monkeypatch.setattr(calibration, "calibrated_us", lambda: slower * MEASURED.calibration_us)
    told = json.loads(RUNNER.invoke(app, [*given, "--measure"]).stdout)
    assert told["cores"] == pytest.approx(slower * plain["cores"])
