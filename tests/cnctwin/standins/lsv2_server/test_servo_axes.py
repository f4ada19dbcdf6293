"""The servo axes behind the oscilloscope: recorded, they are a run that the twin of their description can be compared with."""

from pathlib import Path

import numpy as np
import pytest

from cnctwin.importing.control_recording import record, wanted
from cnctwin.standins.lsv2_server import servo_axes
from cnctwin.standins.lsv2_server.answers import Model
from cnctwin.standins.lsv2_server.oscilloscope import CHANNELS, LABELS
from cnctwin.standins.lsv2_server.server import Lsv2Server
from cnctwin.standins.simulated_control.control import SimulatedControl
from cnctwin.standins.simulated_control.state import ControlState
from edge.controls.heidenhain.oscilloscope import Oscilloscope
from twin.errors import EffectError
from twin.machine import read_machine
from twin.runlog import read_run
from twin.simulator.recorded import told_of

NAMES = [f"{axis}_{role}" for axis in "xyz" for role in ("ref", "pos", "torque")]


def test_a_recording_fits_the_description_and_shows_the_effect_that_it_does_not_tell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(servo_axes, "PASSES", 1)
    plain = servo_axes.servo_trace()
    trace = servo_axes.servo_trace(servo_axes.hidden_effect("gravity", "y"))
    assert len(trace.raw) == len(LABELS) * len(CHANNELS)
    now = [0.0]
    control = SimulatedControl([ControlState()], machine_s=lambda: now[0])

    def wait(seconds: float) -> None:
        now[0] += seconds

    with Lsv2Server(control, model=Model.ITNC530, trace=trace, pause=wait) as server:
        scope = Oscilloscope(server.url, timeout_s=10.0)
        scope.open()
        try:
            record(scope, wanted(scope.signals(), NAMES, None), 12.0, 600, tmp_path / "run.parquet")
        finally:
            scope.close()
    run = read_run(tmp_path / "run.parquet")
    (tmp_path / "machine.toml").write_text(servo_axes.told_machine())
    told = told_of(run, read_machine(tmp_path / "machine.toml"))
    assert set(told.reference_mm) == {"x", "y", "z"}
    current = [channel.column for channel in CHANNELS].index("torque_a")
    means = {axis: np.mean(trace.raw[axis, current]) - np.mean(plain.raw[axis, current]) for axis in range(3)}
    assert abs(means[1]) > 100 * max(abs(means[0]), abs(means[2]))


def test_an_effect_that_there_is_not_is_refused() -> None:
    with pytest.raises(EffectError):
        servo_axes.hidden_effect("rust", "y")
