"""`cnctwin figures`: what a person and a program read, the CSV, and what it refuses."""

import csv
import json
from datetime import UTC, datetime
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from cnctwin.commands.see.figures.command import figures
from cnctwin.errors import UsageError
from cnctwin.memory.store.contract import Message
from cnctwin.memory.store.opening import open_store
from processors.errors import ConfigurationError
from tests.processors.streams import T0_MS, birth, data

RUNNER = CliRunner()
APP = typer.Typer()
APP.command()(figures)
CALENDAR = '[shifts.early]\ndays = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"]\nstart = "13:51"\nend = "14:51"\n'


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The options that name a store with an hour of a machine, and its calendar."""
    folder = tmp_path_factory.mktemp("figures")
    (folder / "calendar.toml").write_text('time_zone = "UTC"\n' + CALENDAR, encoding="utf-8")
    (folder / "processors.toml").write_text(
        f"[production]\ncalendar = {json.dumps(str(folder / 'calendar.toml'))}\nideal_s = {{ O1 = 60.0 }}\n", encoding="utf-8"
    )
    events = [birth(0.0, exec_state="READY", controller_mode="AUTOMATIC", program="O1", part_quality="")]
    for n in range(36):
        events += [data(100.0 * n + 10, exec_state="ACTIVE"), data(100.0 * n + 85, exec_state="READY", part_quality=f"good {n}")]
    store = open_store(folder / "store", writable=True)
    store.append([Message(event.timestamp_ms, event) for event in events])
    store.close()
    return ["--store", str(folder / "store"), "--config", str(folder / "processors.toml"), "--from", str(T0_MS)]


def _to(seconds: float) -> list[str]:
    return ["--to", datetime.fromtimestamp(T0_MS / 1000 + seconds, UTC).isoformat()]


def test_a_program_reads_the_figures_of_a_shift(asked: list[str]) -> None:
    done = RUNNER.invoke(APP, [*asked, *_to(7200.0), "--machine", "okuma", "--json"])
    (row,) = json.loads(done.stdout)["rows"]
    assert (row["shift"], row["parts"], row["good"], row["performance"], row["quality"]) == ("early", 36, 36, 0.8, 1.0)
    assert row["availability"] == round(36 * 75.0 / row["planned_s"], 4)
    assert row["oee"] == pytest.approx(0.8 * row["availability"], abs=1e-4)


def test_a_person_reads_them_with_the_stops_and_the_reasons(asked: list[str]) -> None:
    done = RUNNER.invoke(APP, [*asked, *_to(7200.0), "--all", "--by", "machine"])
    assert "80.0 %" in done.stdout
    assert "not told 8" in done.stdout
    assert "[production]" not in done.stdout  # nothing is missing


def test_what_is_made_outside_shifts_is_told_beside_the_table(asked: list[str], tmp_path: Path) -> None:
    short = tmp_path / "short.toml"
    short.write_text('time_zone = "UTC"\n' + CALENDAR.replace("14:51", "14:21"), encoding="utf-8")
    shown = RUNNER.invoke(APP, [*asked, *_to(7200.0), "--all", "--by", "machine", "--calendar", str(short)]).stdout
    assert "1350 s made in breaks or outside shifts, not counted" in shown  # 18 parts of 75 s
    assert "breaks" not in RUNNER.invoke(APP, [*asked, *_to(7200.0), "--all", "--by", "machine"]).stdout


def test_times_are_those_of_the_calendar_and_its_zone_is_named_once(asked: list[str], tmp_path: Path) -> None:
    berlin = tmp_path / "berlin.toml"
    calendar = CALENDAR.replace("14:51", "15:51").replace("13:51", "14:51")  # the same hour by another clock
    berlin.write_text('time_zone = "Europe/Berlin"\n' + calendar, encoding="utf-8")
    told = [*asked, *_to(7200.0), "--all", "--calendar", str(berlin)]
    shown = RUNNER.invoke(APP, told).stdout
    assert shown.count("Europe/Berlin") == 1
    assert "14:51" in shown
    assert "13:51" not in shown
    found = json.loads(RUNNER.invoke(APP, [*told, "--json"]).stdout)
    assert found["time_zone"] == "Europe/Berlin"
    assert datetime.fromtimestamp(found["rows"][0]["begin"] / 1000, UTC).strftime("%H:%M") == "13:51"


def test_the_csv_is_what_the_table_is(asked: list[str], tmp_path: Path) -> None:
    out = tmp_path / "parts.csv"
    done = RUNNER.invoke(APP, [*asked, *_to(7200.0), "--all", "--by", "part", "--csv", str(out)])
    with out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert (done.stdout, len(rows), {row["active_s"] for row in rows}, rows[0]["quality"]) == ("", 36, {"75.0"}, "good")


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--machine", "okuma", "--all"], "name one machine with --machine, or all of them with --all"),
        ([], "name one machine with --machine, or all of them with --all"),
        (["--machine", "vmx"], "the store has no machine 'vmx'; it has: okuma"),
        (["--all", "--to", "2001-01-01"], "is not after --from"),
    ],
)
def test_what_makes_no_sense_is_refused(asked: list[str], more: list[str], said: str) -> None:
    done = RUNNER.invoke(APP, [*asked, *more])
    assert isinstance(done.exception, UsageError)
    assert said in str(done.exception)


def test_a_calendar_that_is_wrong_is_named(asked: list[str], tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.toml"
    wrong.write_text('time_zone = "Europe/Stuttgart"\n' + CALENDAR, encoding="utf-8")
    done = RUNNER.invoke(APP, [*asked, "--all", "--calendar", str(wrong)])
    assert isinstance(done.exception, ConfigurationError)
    assert f"{wrong}: time_zone = 'Europe/Stuttgart': no time zone" in str(done.exception)
