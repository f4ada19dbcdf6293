"""Each starter machine is complete, assumed to the last figure, and good enough for everything to run at once."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cnctwin.errors import UsageError
from cnctwin.machines.starters import machine_classes, starter_text
from tests.twin.programs.plate import SETTINGS
from twin.case import Case, RunAtHand, RunEntry, RunKind
from twin.errors import MachineError
from twin.gap.diagnose import diagnose
from twin.identification.identify import Identification, identify
from twin.live.assumed import completed
from twin.machine import Axis, MachineFile, Stock, machine_from_toml
from twin.simulator.simulation import simulate

PLATE = Path(__file__).parents[2] / "twin" / "programs" / "fanuc" / "plate.nc"
MILLS = [one for one in machine_classes() if one != "lathe"]
TURNED = """%
O0002 (radius programming, feed a turn, constant surface speed)
G21 G18 G40 G90 G95
G92 S2000
T1 M6
G96 S180 M3
G0 X26. Z2.
G1 Z-6. F0.3
G2 X28. Z-8. R2.
G1 X30.
G0 X50. Z20.
M30
%
"""
BACK_AND_FORTH = "G90 G94 G21\n" + "".join(f"G1 X{to}. F{feed}\n" for feed in (400, 6000) for to in (12, -12, 0))
SERVO = ("x_ref_mm", "x_pos_mm", "x_torque_a")
MASS, GAIN, FRICTION = 1.25, 0.9, 0.75
"""The machine's own constants, which stand over those of its class."""


def starter(machine_class: str) -> MachineFile:
    return machine_from_toml(starter_text(machine_class, "mill"))


def as_it_is(machine: MachineFile) -> MachineFile:
    """Return a machine of the class, whose X axis is another one than the class says."""
    axis = machine.axes["x"]
    friction = axis.friction.model_copy(update={"coulomb_n": FRICTION * float(np.mean(axis.friction.coulomb_n))})
    own = {"mass_kg": MASS * axis.mass_kg, "position_gain_per_s": GAIN * axis.position_gain_per_s, "friction": friction}
    return machine.model_copy(update={"axes": machine.axes | {"x": axis.model_copy(update=own)}, "effects": ()})


def recorded(machine: MachineFile) -> Case:
    """Return a case: the starter, and what the X axis of the machine as it is records."""
    runs = []
    for seed, role in ((1, "fit"), (2, "check")):
        run = simulate(as_it_is(machine), BACK_AND_FORTH, seed=seed).run
        kept = {name: column for name, column in run.columns.items() if name in SERVO}
        entry = RunEntry(file=f"{role}.parquet", kind=RunKind.AIR, role=role)
        runs.append(RunAtHand(entry, Path(), replace(run, columns=kept)))
    return Case("mill", machine, tuple(runs))


def figures(value: Any, path: str = "") -> Iterator[str]:
    """Yield the paths of all figures of a machine file."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from figures(inner, f"{path}.{key}" if path else str(key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def test_there_is_one_for_each_class_that_people_ask_for() -> None:
    assert set(machine_classes()) == {"vmc-40", "hmc", "lathe", "router", "five-axis"}


def test_a_class_that_there_is_not_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(UsageError, match="class 'mill' is not known; there are five-axis, hmc"):
        starter_text("mill", "a")


@pytest.mark.parametrize("machine_class", machine_classes())
def test_every_figure_is_assumed_with_its_source_and_a_range(machine_class: str) -> None:
    tables = tomllib.loads(starter_text(machine_class, "mill"))
    assumed = tables.pop("assumed")
    for path in figures(tables):
        entry = assumed.get(path) or assumed.get(path.partition(".")[0])
        assert entry is not None, f"{path} is stated as if somebody had measured it"
        assert len(entry["source"]) > 10
        assert "range" in entry or not path.startswith(("axes.", "spindle.", "thermal.", "program.")), f"{path} has no range"
    machine = starter(machine_class)
    assert machine.machine.name == "mill"
    assert all(completed(machine, section) is machine for section in ("thermal", "spindle")), "live figures find all they need"


@pytest.mark.parametrize("machine_class", MILLS)
def test_a_mill_of_each_class_cuts_the_plate(machine_class: str) -> None:
    machine = starter(machine_class)
    stock = Stock(min_mm=(0.0, 20.0, -15.0), max_mm=(140.0, 100.0, 5.0))
    done = simulate(machine.model_copy(update={"stock": stock}), PLATE.read_text(encoding="utf-8"), settings=SETTINGS)
    assert 20.0 < done.seconds < 200.0
    assert 10.0 < np.nanmax(done.run["cutting_force_peak_n"]) < 5000.0
    assert all(np.abs(error).max() < 20.0 for error in done.following_error_mm().values())
    assert any(note.startswith("assumed, neither stated nor fitted: ") for note in done.notes)


def test_a_lathe_turns_a_program_in_air() -> None:
    machine = starter("lathe")
    done = simulate(machine, TURNED)
    assert "cutting_force_peak_n" not in done.run.columns or not np.nanmax(done.run["cutting_force_peak_n"])
    assert np.abs(np.diff(done.run["spindle_rpm"])).max() > 0.0, "the surface speed is constant, so the spindle's is not"
    assert set(done.following_error_mm()) >= {"x", "z"}


@pytest.fixture(scope="module", params=machine_classes())
def identified(request: pytest.FixtureRequest) -> tuple[Case, Identification]:
    case = recorded(starter(request.param))
    return case, identify(case)


def test_recordings_narrow_what_was_assumed(identified: tuple[Case, Identification]) -> None:
    case, found = identified
    stated, fitted = case.machine.axes["x"], found.machine.axes["x"]
    assert fitted.mass_kg / stated.mass_kg == pytest.approx(MASS, rel=0.03)
    assert fitted.position_gain_per_s / stated.position_gain_per_s == pytest.approx(GAIN, rel=0.01)
    assert _coulomb(fitted) / _coulomb(stated) == pytest.approx(FRICTION, rel=0.05)
    known = {"axes.x.mass_kg", "axes.x.position_gain_per_s", "axes.x.friction.coulomb_n"}
    assert known <= case.machine.assumed.keys()
    assert not known & found.machine.assumed.keys()
    assert "axes.z.mass_kg" in found.machine.assumed, "nobody has recorded it"
    assert any("assumed constants are known from these recordings now; still assumed: " in note for note in found.notes)


def _coulomb(axis: Axis) -> float:
    return float(np.mean(axis.friction.coulomb_n))


def test_a_diagnosis_begins_with_it(identified: tuple[Case, Identification]) -> None:
    case, found = identified
    done = diagnose(Case(case.name, found.machine, case.runs))
    assert done.diagnosis.verdict.value in ("healthy", "explained")
    assert done.twin.assumed.keys() <= found.machine.assumed.keys()


SLIPS = {
    "mass_kg = 1500.0 -> mas_kg = 1500.0": "axes.x.mas_kg is not known; did you mean mass_kg?",
    "torque_limit_a = 60.0 -> torque_limit_a = -40.0": "axes.x.torque_limit_a = -40.0: must be above 0",
    "coulomb_n = 400.0 -> coulomb_n = 'lots'": "axes.x.friction.coulomb_n = 'lots': is no number; write one without quotes",
    "coulomb_n = 400.0 -> coulomb_n = [-1.0, 2.0]": "axes.x.friction.coulomb_n.0 = -1.0: must be 0 or more",
    "mass_kg = 1500.0\n -> ": "axes.x.mass_kg is missing",
}


@pytest.mark.parametrize("slip", SLIPS)
def test_one_slip_in_a_file_that_assumes_is_one_fault(slip: str) -> None:
    right, wrong = slip.split(" -> ")
    with pytest.raises(MachineError) as error:
        machine_from_toml(starter_text("five-axis", "vmc").replace(right, wrong, 1), "vmc.toml")
    assert str(error.value).startswith(f"vmc.toml: {SLIPS[slip]}")
    assert "\n" not in str(error.value)


def test_an_assumption_of_what_the_file_does_not_state_is_a_fault() -> None:
    text = starter_text("five-axis", "vmc") + '\n[assumed."axes.q.mass_kg"]\nsource = "none"\n'
    with pytest.raises(MachineError, match=r"axes\.q\.mass_kg is assumed, but the file does not state it"):
        machine_from_toml(text, "vmc.toml")
