"""The benchmark of the simulator runs, and what it compares computes the same; its times are not tested."""

import shutil
from pathlib import Path

import pytest

from benchmarks import simulator

pytestmark = pytest.mark.skipif(not shutil.which("gcc"), reason="no gcc, and the yardstick is a C loop")


@pytest.mark.parametrize("name", ["contour", "axis by axis"])
def test_the_c_loop_and_the_simulator_move_alike(tmp_path: Path, name: str) -> None:
    machine = simulator.machine_from_toml(simulator.MACHINE)
    motion = simulator.motion_of(machine, simulator.MOTIONS[name], 1000)
    row = simulator.servo_rows(machine, motion, {"C": simulator.PlainLoop(tmp_path, simulator.PLAIN)}, 1)
    assert row["C differs, mm"] <= simulator.AGREEMENT_MM
    assert row["batch differs from single, mm"] <= simulator.AGREEMENT_MM
    assert motion.reference_mm["x"].max() > 0.1


def test_every_group_is_printed() -> None:
    servo = dict.fromkeys(("C, traces", "C, sums", "limit, traces", "single", "batch, traces", "batch, sums"), 1.0)
    effects = {f"{some}, {kept}": 2.0 for some in ("bare", "all") for kept in ("traces", "sums")}
    groups = {
        "sticking": {"x": 0.5},
        "servo": servo | {"C differs, mm": 1e-15},
        "effects": effects | {"effects": 14.0},
        "chain": {f"{kind}, {some}": 3.0 for kind in ("batch", "single") for some in ("bare", "all", "all but helix")},
        "stages": {"plan": 0.5, "chain": 0.5},
    }
    text = "\n".join(simulator.report("contour", groups))
    assert "contour: sticking x 50 % of the time" in text
    assert "(aim ≤ 0.25)" in text
    assert "C differs, mm 1.0e-15" in text
