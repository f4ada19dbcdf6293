"""A servo-rate case of a machine is three commands: `record`, `gap case`, `gap diagnose`, as docs/how-to/recording.md says."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cnctwin.cli import app
from cnctwin.standins.lsv2_server import servo_axes
from cnctwin.standins.lsv2_server.answers import Model
from cnctwin.standins.lsv2_server.server import Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from twin.case import read_case

PASS_S = 34.0
BEGINS_S = {"run": 5.0, "again": PASS_S + 6.5, "other": 2 * PASS_S + 22.0}
"""The start of each recording, in the machine's time: two at about one place of the air program, the third elsewhere in it."""


class Machine:
    """A stand-in of an iTNC 530 whose clock goes on as fast as its packets are asked for."""

    def __init__(self) -> None:
        self.now_s = 0.0
        control = SimulatedControl([ControlState()], machine_s=lambda: self.now_s)
        trace = servo_axes.servo_trace(servo_axes.hidden_effect("direction_friction", "y"))
        self.server = Lsv2Server(control, model=Model.ITNC530, trace=trace, pause=self._wait)

    def _wait(self, seconds: float) -> None:
        self.now_s += seconds


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Iterator[Machine]:
    monkeypatch.setattr(servo_axes, "PASSES", 3)
    found = Machine()
    with found.server:
        yield found


def test_three_commands_lead_from_a_control_to_the_effect_that_its_description_does_not_tell(
    machine: Machine, tmp_path: Path
) -> None:
    runner = CliRunner()
    for name, begins_s in BEGINS_S.items():
        machine.now_s = begins_s
        signals = ["--signals", "y_ref,y_pos,y_torque", "--interval", "600", "--seconds", "16"]
        done = runner.invoke(app, ["record", machine.server.url, *signals, "--out", str(tmp_path / f"{name}.parquet")])
        assert done.exit_code == 0, done.output
    (tmp_path / "machine.toml").write_text(servo_axes.told_machine())
    runs = [str(tmp_path / f"{name}.parquet") for name in BEGINS_S]
    case, described = tmp_path / "case", ["--machine-file", str(tmp_path / "machine.toml")]
    done = runner.invoke(app, ["gap", "case", *runs, "--check", "other", *described, "--out", str(case)])
    assert done.exit_code == 0, done.output
    assert "run, again did not begin at the same moment: they are cut to the 14.5 s that they share" in done.output
    entries = [run.entry for run in read_case(case).runs]
    assert [(entry.role, entry.repeats) for entry in entries] == [("fit", None), ("fit", "runs/run.parquet"), ("check", None)]
    done = runner.invoke(app, ["gap", "diagnose", str(case), "--out", str(tmp_path / "diagnosis")])
    assert done.exit_code == 0, done.output
    answer = json.loads((tmp_path / "diagnosis" / "diagnosis.json").read_text())
    assert answer["verdict"] == "explained" and done.output.startswith("Explained: ")
    (cause,) = answer["causes"]
    assert (cause["effect"], cause["on"]) == ("direction_friction", "y")
    asymmetry = cause["parameters"]["asymmetry"]
    assert asymmetry["low"] <= 0.10 <= asymmetry["high"]
    assert answer["gap"]["after"] < 1.3
