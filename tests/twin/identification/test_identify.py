"""Identification of whole machines: simulated ones whose constants are known, and recordings of real ones."""

from pathlib import Path

import numpy as np
import pytest

from tests.depth import IS_FULL
from tests.recordings import recordings_folder
from tests.twin.simulator.test_simulation import MACHINE
from twin.case import Case, Run, RunEntry, RunKind, read_case
from twin.errors import CaseError
from twin.identification.axis_fit import AxisModel, AxisRecording, fit_axis
from twin.identification.axis_parameters import VELOCITY_DELAY, axis_parameters
from twin.identification.estimate import INTERVAL_Z
from twin.identification.identify import Identification, identify
from twin.machine import MachineFile, machine_from_toml
from twin.machine_toml import machine_to_toml
from twin.runlog import RunLog
from twin.simulator.recorded import told_of
from twin.simulator.response import respond
from twin.simulator.simulation import simulate

PROGRAM = """
N1 G21 G90 S6000 M3
N2 G4 P200
N3 G1 X8 F1200
N4 G1 X0
N5 G1 X1.5 F300
N6 G1 X0
N7 G1 X40 F9000
N8 G1 X0
N9 G4 P300
N10 G1 X0.05 F200
N11 G1 X0
N12 G4 P200
M30
"""

SHORT = """
N1 G21 G90 S6000 M3
N2 G4 P200
N3 G1 X2 F1200
N4 G1 X0
N5 G1 X10 F9000
N6 G1 X0
N7 G4 P200
M30
"""


class RecordedRun(Run):
    """A run of which the log is there already."""

    def __init__(self, name: str, kind: RunKind, role: str, log: RunLog) -> None:
        super().__init__(RunEntry(file=name, kind=kind, role=role), Path())  # type: ignore[arg-type]
        self.__dict__["log"] = log


def stated(**factors: float) -> MachineFile:
    """A machine description that is a few percent off the real one, MACHINE without stock."""
    axis = MACHINE.axes["x"]
    friction = axis.friction.model_copy(
        update={"coulomb_n": 300.0 / factors["coulomb"], "viscous_n_s_per_mm": 2.0 / factors["viscous"]}
    )
    axes = {"x": axis.model_copy(update={"mass_kg": 300.0 / factors["mass"], "friction": friction})}
    return MACHINE.model_copy(update={"axes": axes, "stock": None, "noise": {"position_mm": 0.0003, "torque_a": 0.01}})


@pytest.fixture(scope="module")
def known_machine() -> Identification:
    real = MACHINE.model_copy(update={"axes": {"x": MACHINE.axes["x"]}, "stock": None})
    runs = tuple(
        RecordedRun(f"{role}_{seed}", RunKind.AIR, role, simulate(real, PROGRAM, seed=seed).run)
        for seed, role in ((1, "fit"), (2, "fit"), (3, "check"))
    )
    return identify(Case("known", stated(mass=1.04, coulomb=0.96, viscous=1.03), runs))


def test_the_constants_of_a_known_machine_are_inside_their_intervals(known_machine: Identification) -> None:
    truth = {
        "axes.x.mass_kg": 300.0,
        "axes.x.friction.coulomb_n": 300.0,
        "axes.x.friction.static_n": 400.0,
        "axes.x.friction.viscous_n_s_per_mm": 2.0,
        "axes.x.friction.coulomb_asymmetry": 0.0,
    }
    found = {e.path: e for e in known_machine.estimates}
    for path, value in truth.items():
        e = found[path]
        assert e.identifiable, path
        # three times the half width: the check is of gross errors, not of the level of one draw of noise
        assert abs(e.value - value) < 1.5 * (e.high - e.low) + 1e-4, e.sentence()
    assert abs(found["axes.x.mass_kg"].value / 300.0 - 1.0) < 0.01


def test_what_air_runs_cannot_know_is_said(known_machine: Identification) -> None:
    said = " ".join(known_machine.unknown)
    assert "only the ratios of mass, friction and torque constant are known" in said
    assert "tool: K_t and K_e: no run cuts on a dynamometer" in said
    assert "three combinations (alpha/C, beta/C and R·C)" in said


def test_no_delay_is_found_where_there_is_none(known_machine: Identification) -> None:
    assert not known_machine.machine.effects


def test_the_identified_machine_is_a_file_like_any_other(known_machine: Identification) -> None:
    assert machine_from_toml(machine_to_toml(known_machine.machine)) == known_machine.machine
    assert known_machine.machine.uncertainty["axes.x.mass_kg"] < 0.01


def test_a_sign_that_is_wrong_is_said_to_fit_nothing() -> None:
    real = MACHINE.model_copy(update={"axes": {"x": MACHINE.axes["x"]}, "stock": None})
    log = simulate(real, SHORT, seed=1).run
    turned = RunLog(log.t_s, dict(log.columns) | {"x_torque_a": -log["x_torque_a"]}, log.text)
    runs = tuple(RecordedRun(role, RunKind.AIR, role, turned) for role in ("fit", "check"))
    found = identify(Case("turned", stated(mass=1.0, coulomb=1.0, viscous=1.0), runs))
    assert any("x_torque_a is missed" in sentence for sentence in found.misfits), found.misfits
    assert all("cnctwin gap diagnose CASE" in sentence for sentence in found.misfits)
    assert not found.machine.effects, "a velocity from the future is no finding"


def test_a_known_machine_has_no_misfit(known_machine: Identification) -> None:
    assert not known_machine.misfits


@pytest.mark.parametrize("rows", [1, 3, 30])
def test_a_run_too_short_to_say_anything_says_nothing(rows: int) -> None:
    log = simulate(MACHINE.model_copy(update={"stock": None}), "G1 X1 F100\nM30\n", seed=1).run
    short = RunLog(log.t_s[:rows], {name: values[:rows] for name, values in log.columns.items()}, {})
    found = identify(Case("short", MACHINE, (RecordedRun("fit", RunKind.AIR, "fit", short),)))
    assert not [e for e in found.estimates if e.path.startswith("axes")]


def test_a_case_with_nothing_to_fit_is_refused() -> None:
    log = simulate(MACHINE.model_copy(update={"stock": None}), "G1 X1 F100\nM30\n", seed=1).run
    with pytest.raises(CaseError, match="no run of role fit"):
        identify(Case("empty", MACHINE, (RecordedRun("check", RunKind.AIR, "check", log),)))


def case(name: str) -> Case:
    folder = recordings_folder().parent / "cases" / name
    if not folder.exists():
        pytest.skip(f"no case {folder}; CNCTWIN_DATA names the folder of the recordings, the cases lie beside it")
    return read_case(folder)


@pytest.fixture(scope="module")
def emps() -> tuple[Identification, Run]:
    question = case("emps")
    return identify(question), question.of(role="check")[0]


def test_the_emps_axis_follows_to_two_micrometres_on_the_half_that_was_not_fitted(emps: tuple[Identification, Run]) -> None:
    found, run = emps
    twin = respond(found.machine, told_of(run.log, found.machine)).columns
    position_um = 1000.0 * np.sqrt(np.mean((twin["x_pos_mm"] - run.log["x_pos_mm"]) ** 2))
    force_n = 35.1507 * np.sqrt(np.mean((twin["x_torque_a"] - run.log["x_torque_a"]) ** 2))
    following_um = 1000.0 * np.sqrt(np.mean((run.log["x_ref_mm"] - run.log["x_pos_mm"]) ** 2))
    assert following_um == pytest.approx(578.0, abs=1.0)
    assert position_um < 2.0
    assert force_n < 2.2


def test_the_published_mass_of_emps_is_inside_the_interval(emps: tuple[Identification, Run]) -> None:
    """Janot, Gautier, Brunot 2019: 95.109 kg."""
    found = {e.path: e for e in emps[0].estimates}
    assert found["axes.x.mass_kg"].low < 95.109 < found["axes.x.mass_kg"].high


def test_in_the_published_structure_all_published_parameters_are_inside_the_intervals(emps: tuple[Identification, Run]) -> None:
    """M 95.109 kg, F_v 203.50 N·s/m, F_c 20.39 N and an offset of −3.165 N, which a constant difference by direction is."""
    question = case("emps")
    machine = question.machine
    log = question.of(role="fit")[0].log
    sigma = np.repeat([[3e-5], [0.004]], len(log), axis=1)
    recording = AxisRecording(log.t_s, log["x_ref_mm"], log["x_pos_mm"], log["x_torque_a"], None, sigma)
    wanted = {"mass_kg", "coulomb_n", "viscous_n_s_per_mm", "coulomb_asymmetry"}
    published = [p for p in axis_parameters(machine, "x", force_known=False, free_gains=False) if p.name in wanted]
    model = AxisModel(machine.axes["x"], (*published, VELOCITY_DELAY), (recording,), 0.001)
    fitted = fit_axis(model)
    deviation = np.sqrt(np.diag(fitted.found.covariance))
    value = dict(zip((p.name for p in model.parameters), zip(fitted.theta, deviation, strict=True), strict=True))
    for name, base, truth in (("mass_kg", 95.0, 95.109), ("coulomb_n", 20.0, 20.39), ("viscous_n_s_per_mm", 0.2, 0.2035)):
        theta, sigma_theta = value[name]
        assert abs(np.log(truth / base) - theta) < INTERVAL_Z * sigma_theta, (name, base * np.exp(theta), sigma_theta)
    asymmetry, sigma_asymmetry = value["coulomb_asymmetry"]
    coulomb_n = 20.0 * np.exp(value["coulomb_n"][0])
    assert abs(-3.165 - asymmetry * coulomb_n) < INTERVAL_Z * np.hypot(
        sigma_asymmetry * coulomb_n, asymmetry * coulomb_n * value["coulomb_n"][1]
    )


@pytest.mark.parametrize("name", ["case_16", "case_17", "case_18"] if IS_FULL else ["case_18"])
def test_a_healthy_machine_is_followed_to_its_own_repeatability(name: str) -> None:
    """Signal by signal and regime by regime, 1.5 times what its runs differ by: the pair's difference, or what the twin expects
    of runs with its disturbance where that is more, because a pair with a dozen stops in it can agree by luck."""
    found = identify(case(name))
    over = [row for row in found.gaps if row.gap > 1.5 * max(row.repeatability or 0.0, row.expected)]
    assert len(found.gaps) >= 18
    assert len(over) <= 2, over
    assert all(row.gap < 2.5 * max(row.repeatability or 0.0, row.expected) for row in over), over
    assert not [
        row for row in over if row.signal.endswith(("_pos_mm", "_table_mm")) or row.signal.startswith(("force", "spindle"))
    ]
