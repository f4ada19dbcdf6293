"""The rapid knob of runs that do not record it, read off their rapids."""

from pathlib import Path

import numpy as np
import pytest

from tests.twin.gap.programs.written import case_of, made, shop_program
from twin.gap.diagnosis import Diagnosis
from twin.gap.programs.diagnose import diagnose_programs
from twin.runlog import run_log

RATE = 24000.0
MACHINE = f"[program]\nrapid_mm_min = {RATE}\nacceleration_mm_s2 = 1e9\n"
TOLD = "rapid_override_pct"
SLOW = {"tool_change_time": {"change_s": 4.0}}
"""The effect that the control really has."""


def diagnosis(folder: Path, knobs: dict[str, tuple[str, float, float, bool]], machine: str = MACHINE) -> Diagnosis:
    """knobs: run → role, feed, where the rapid knob stands, whether the recording tells it."""
    runs = {}
    for name, (role, feed, ratio, told) in knobs.items():
        text = shop_program(feed).replace("M5", "M5\nG0 X-400.0\nG0 X0.0")
        own = {"feed_override": {"ratio": 1.0, "rapid": ratio * RATE / 30000.0}}
        columns = made(text, SLOW | own)
        given = {TOLD: np.full(len(columns["t_s"]), 100.0 * ratio)} if told else {}
        runs[name] = (role, run_log(columns | given, name), text)
    return diagnose_programs(case_of(folder, runs, machine)).diagnosis


@pytest.mark.parametrize("machine", [MACHINE, ""])
def test_a_knob_that_stood_elsewhere_in_runs_that_do_not_record_it_is_an_input(tmp_path: Path, machine: str) -> None:
    found = diagnosis(
        tmp_path,
        {
            "a": ("fit", 1200, 0.5, False),
            "b": ("fit", 3000, 0.5, False),
            "c": ("check", 2000, 1.0, True),
            "d": ("check", 900, 1.0, True),
        },
        machine,
    )
    assert [cause.effect for cause in found.causes] == ["tool_change_time"]
    assert any("no rapid override is recorded" in note and "a.parquet 50 %" in note for note in found.notes)


def test_rapids_that_no_run_does_at_the_stated_rate_are_a_gap(tmp_path: Path) -> None:
    slow = {"a": ("fit", 1200, 0.5, False), "b": ("fit", 3000, 0.5, False), "c": ("check", 2000, 0.5, False)}
    found = diagnosis(tmp_path, slow)
    assert {cause.effect for cause in found.causes} == {"tool_change_time", "feed_override"}
