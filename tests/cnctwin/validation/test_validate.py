"""`cnctwin validate` from end to end: a store with the twin's own words in it, run logs, the history, a real broker."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from cnctwin.commands.twin.validate import validate
from cnctwin.errors import ApplicationError
from cnctwin.memory.store.opening import open_store
from cnctwin.standins.simulated_machine.description import PROCESSORS, TOLD
from cnctwin.validation.budgets import Budgets, budgets_of, tables_of
from cnctwin.validation.cycles import cycles_of
from cnctwin.validation.evidence import of_store
from cnctwin.validation.history import kept, nights_of, validation_of
from cnctwin.validation.published import PREFIX, metrics
from processors.config import ConfigurationError
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.host_session import EventKind
from tests.cnctwin.validation.made_night import START_S, told_twin, warm_night, working_spindle
from tests.cnctwin.validation.stored_night import stored, told, twin_told
from tests.twin.gap.programs.written import made, shop_program
from tests.wire.mosquitto import Mosquitto
from twin.runlog import RunLog, run_log, write_run

DAY = ["--from", "2026-11-21", "--to", "2026-11-22"]
CONFIG = ["--config", str(PROCESSORS), "--twin", str(TOLD)]


def run(*arguments: str) -> tuple[int, dict[str, Any]]:
    """Exit code, and what it printed as JSON. Raises what the program would print in one line."""
    app = typer.Typer()
    app.command()(validate)
    done = CliRunner().invoke(app, ["--machine", "vmc", "--json", *arguments])
    if isinstance(done.exception, ApplicationError | ConfigurationError):
        raise done.exception
    return done.exit_code, json.loads(done.stdout) if done.stdout else {}


def verdicts(night: dict[str, Any]) -> dict[str, str]:
    return {f"{one['quantity']}_{one['measure']}": one["verdict"] for one in night["figures"]}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two hours of the simulated machine, with what `thermal` and `cutting_force` said of them."""
    events = list(told(warm_night(2.0), START_S + 3600.0))
    return stored(
        tmp_path_factory.mktemp("stored") / "store", list(twin_told(events, ["thermal", "cutting_force"], told_twin().tables))
    )


def test_a_night_in_a_store_is_judged_by_what_the_twin_published(store: Path, tmp_path: Path) -> None:
    code, night = run("--store", str(store), *DAY, *CONFIG, "--out", str(tmp_path))
    assert code == 0 and night["night"] == "2026-11-21" and night["verdict"] == "within"
    by_name = {f"{one['quantity']}_{one['measure']}": one for one in night["figures"]}
    mae = by_name["temperature_mae"]
    assert 0.1 < mae["value"] < 0.8 and mae["budget"] == 2.0 and mae["hours"] == pytest.approx(2.1, abs=0.15)
    assert mae["basis"] == "twin/spindle_temp_c as published; against the machine's own sensor"
    assert verdicts(night) | {"force_mape": "not observable", "vibration_r": "not observable"} == verdicts(night)
    assert [one["night"] for one in nights_of("vmc", tmp_path)] == ["2026-11-21"]
    assert night["retrain"] is False and night["retrain_reason"] is None


def test_a_dynamometer_with_a_clock_of_its_own_is_put_where_it_was(store: Path, tmp_path: Path) -> None:
    spindle = working_spindle(2.0)
    power_kw = np.maximum(0.85 * (spindle["spindle_load_pct"] / 100.0 * 7.5 - 0.22), 0.0)
    size = 1.1 * np.hypot(1.0, 0.35) * np.where(spindle["spindle_rpm"] > 0, 1000.0 * power_kw / (np.pi * 0.012 * 8500 / 60), 0.0)
    kept_rows = slice(1000, 4000)
    force = np.repeat(size[kept_rows], 10)
    write_run(
        run_log({"t_s": np.arange(len(force)) * 0.1, "force_x_n": force, "force_y_n": 0.0 * force}, "kistler"),
        tmp_path / "k.parquet",
    )
    code, night = run("--store", str(store), *DAY, *CONFIG, "--truth", str(tmp_path / "k.parquet"), "--no-keep")
    (found,) = [one for one in night["figures"] if one["quantity"] == "force"]
    assert code == 0 and night["clock"]["offset_s"] == pytest.approx(START_S + 3600.0 + 1000.0, abs=1.0)
    assert found["verdict"] == "within" and 5.0 < found["value"] < 19.0 and found["low"] < found["value"] < found["high"]
    assert "twin/cutting_force_n as published" in found["basis"]


def test_two_nights_over_call_for_retraining_by_exit_code_and_in_words(tmp_path: Path) -> None:
    constants = "".join(f"{name} = {value}\n" for name, value in told_twin().tables["thermal"].items())
    (tmp_path / "p.toml").write_text(f"[thermal]\n{constants}\n[validation]\ntemperature_mae_k = 0.05\n")
    for night, at_s in ((1, START_S - 86_400.0), (2, START_S)):
        write_run(warm_night(1.5, at_s), tmp_path / f"{night}.parquet")
        code, said = run(
            "--runs", str(tmp_path / f"{night}.parquet"), "--config", str(tmp_path / "p.toml"), "--out", str(tmp_path)
        )
        assert code == 1 and said["verdict"] == "over" and verdicts(said)["temperature_rmse"] == "within"
        assert said["retrain"] is (night == 2)
    assert said["retrain_reason"] == (
        "temperature_mae over its budget on 2026-11-20 and 2026-11-21; "
        "temperature_mae_worst_hour over its budget on 2026-11-20 and 2026-11-21"
    )


def cycles_in_a_store(folder: Path) -> Path:
    """A program three times, the second broken off; feed and line seven times a second."""
    rows: list[dict[str, Any]] = []
    columns = made(shop_program(2000.0), {})
    length = len(columns["t_s"])
    at_s = 0.0
    for kept_rows in (length, length // 2, length):
        rows += [
            {
                "t_s": at_s + float(columns["t_s"][n]),
                "nc_line": float(columns["line"][n]),
                "feed_mm_min": float(columns["feed_mm_min"][n]),
                "tool_number": float(columns["tool_number"][n]),
                "exec_state": "PROGRAM_COMPLETED" if n == length - 1 else "ACTIVE",
            }
            for n in range(kept_rows)
        ]
        at_s = rows[-1]["t_s"] + 10.0
        rows.append({**rows[-1], "t_s": at_s, "exec_state": "STOPPED" if kept_rows < length else "READY"})
        rows.append({**rows[-1], "t_s": at_s + 5.0, "exec_state": "READY"})
        at_s += 20.0
    numbers = {name: np.array([row[name] for row in rows]) for name in ("nc_line", "feed_mm_min", "tool_number")}
    text = {
        "exec_state": np.array([row["exec_state"] for row in rows], dtype=object),
        "program": np.array(["O1"] * len(rows), dtype=object),
    }
    log = RunLog(np.array([row["t_s"] for row in rows]), numbers, text)
    return stored(folder, list(told(log, START_S)))


def test_programs_in_a_store_are_timed_and_one_that_was_broken_off_is_not(tmp_path: Path) -> None:
    place = cycles_in_a_store(tmp_path / "store")
    (tmp_path / "O1.nc").write_text(shop_program(2000.0))
    (tmp_path / "m.toml").write_text(
        "[machine]\nname = 'm'\nservo_period_s = 0.001\n[program]\nrapid_mm_min = 30000.0\nacceleration_mm_s2 = 1e9\n"
    )
    store = open_store(place)
    cycles, _ = cycles_of(store, "vmc", round(START_S * 1000), round((START_S + 86_400) * 1000))
    store.close()
    assert [cycle.program for cycle in cycles] == ["O1", "O1"]
    given = ["--store", str(place), *DAY, "--twin", str(tmp_path / "m.toml"), "--programs", str(tmp_path), "--no-keep"]
    _, night = run(*given)
    (found,) = [one for one in night["figures"] if one["quantity"] == "cycle_time"]
    assert (found["on"], found["samples"], found["verdict"]) == ("O1", 2, "within")
    assert found["value"] < 2.0


def test_what_is_published_is_on_the_broker_as_metrics_and_as_plain_json(
    mosquitto: Mosquitto, store: Path, tmp_path: Path
) -> None:
    broker = BrokerAddress(*mosquitto.address)
    host = HostApplication(broker, "looks-on", ("spBv1.0/cnc/#",), publish_state=False)
    host.subscribe_plain("cnctwin/validation/#")
    host.start()
    try:
        deadline_s = time.monotonic() + 60.0
        while not host.online and time.monotonic() < deadline_s:
            host.poll(0.05)
        code, _ = run("--store", str(store), *DAY, *CONFIG, "--out", str(tmp_path), "--broker", broker.url)
        seen, plain, kinds = {}, b"", set()
        deadline_s = time.monotonic() + 60.0
        while time.monotonic() < deadline_s and not (plain and EventKind.DEATH in kinds):
            for event in host.poll(0.1):
                if event.kind is EventKind.PLAIN:
                    plain = event.payload
                elif event.device == "vmc" and event.node.node == "twin-validation":
                    kinds.add(event.kind)
                    seen |= {one.name: one.value for one in event.readings if one.value is not None}
    finally:
        host.stop()
    assert code == 0 and {EventKind.BIRTH, EventKind.DATA} <= kinds
    told_plain = json.loads(plain)
    assert told_plain["machine"] == "vmc" and told_plain["nights"][-1]["night"] == "2026-11-21"
    mae = next(one["value"] for one in told_plain["figures"] if one["measure"] == "mae")
    assert seen[f"{PREFIX}temperature_mae"] == pytest.approx(mae) and seen[f"{PREFIX}temperature_mae_budget"] == 2.0
    assert seen[f"{PREFIX}verdict"] == "within" and seen[f"{PREFIX}force_verdict"] == "not observable"
    assert seen[f"{PREFIX}retrain"] is False and seen[f"{PREFIX}nights_over_budget"] == 0
    assert f"{PREFIX}force_mape" not in seen


def test_a_metric_without_a_value_is_a_null_that_says_why(tmp_path: Path) -> None:
    figure = {"quantity": "force", "measure": "mape", "on": "", "value": None, "unit": "%", "budget": 20.0,
              "verdict": "not observable", "reason": "the force was not measured"}  # fmt: skip
    kept({"night": "2026-11-21", "t": 1, "verdict": "not observable", "twin": "a", "figures": [figure]}, "vmc", tmp_path)
    _, changes = metrics(validation_of("vmc", tmp_path))
    (null,) = [one for one in changes if one.name == f"{PREFIX}force_mape"]
    assert null.value is None and null.reason == "the force was not measured"


def test_the_sample_configuration_holds_the_defaults() -> None:
    import cnctwin.validation as package

    sample = Path(package.__file__).with_name("validation.toml")
    assert budgets_of(tables_of(sample)["validation"], "sample") == Budgets()
    assert set(tables_of(sample)["validation"]) == set(Budgets.model_fields)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--store", "nowhere/at/all", *DAY], "nowhere/at/all"),
        (["--runs", "none.parquet"], "none.parquet"),
        (["--from", "yesterday"], "--from 'yesterday' is no moment"),
        (["--from", "2026-11-22", "--to", "2026-11-21"], "is not after"),
        (["--runs", "a.parquet", "--store", "b"], "give one of them"),
        (["--runs", "a.parquet", "--truth", "b.parquet", "--truth", "c.parquet"], "2 truth files for 1 runs"),
    ],
)
def test_wrong_input_is_one_line(arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    app = typer.Typer()
    app.command()(validate)
    done = CliRunner().invoke(app, ["--machine", "vmc", *arguments])
    text = str(done.exception)
    assert said in text and "\n" not in text and not isinstance(done.exception, (KeyError, TypeError, AttributeError, IndexError))


def test_a_budget_that_is_none_is_refused_with_what_there_is(tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text("[validation]\ntemperature_k = 2.0\n")
    write_run(warm_night(0.1), tmp_path / "r.parquet")
    with pytest.raises(ApplicationError, match=r"\[validation\] temperature_k is not known; did you mean temperature_mae_k"):
        run("--runs", str(tmp_path / "r.parquet"), "--config", str(tmp_path / "p.toml"))


def test_a_machine_that_the_store_does_not_hold_is_said(store: Path) -> None:
    opened = open_store(store)
    try:
        with pytest.raises(ApplicationError, match="holds no machine mill; there are vmc"):
            of_store(opened, "mill", 0, 1000, "the store")
    finally:
        opened.close()
