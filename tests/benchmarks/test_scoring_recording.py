"""The Okuma recording: tool changes stand out in the raw score, the gate keeps them from being alerts and hides no fault long."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.recordings import recording

SOURCE = Path(__file__).parent.parent.parent / "benchmarks" / "scoring_recording.py"


@pytest.fixture(scope="module")
def study() -> ModuleType:
    spec = importlib.util.spec_from_file_location("scoring_recording_benchmark", SOURCE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["scoring_recording_benchmark"] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def stretches(study: ModuleType) -> list:
    return study.stretches(recording("mtconnect/okuma.txt"), recording("mtconnect/okuma_devices.xml"))


def test_no_tool_change_is_an_alert_with_the_gate_and_several_are_without(study: ModuleType, stretches: list) -> None:
    seen = [study.seen(stretches, number) for number in range(len(stretches))]
    assert sum(len(one.changes) for one in stretches) == 11
    assert sum(one.of_changes(one.gated_alerts) for one in seen) == 0
    assert sum(one.of_changes(one.open_alerts) for one in seen) >= 3
    for one in seen:
        usual = np.median(one.raw[~one.stretch.shut])
        peaks = [one.raw[change.start : change.end + 8].max() for change in one.stretch.changes]
        assert min(peaks) > usual + 0.1, "the transients stay visible"


def test_a_fault_that_begins_in_a_gate_is_found_after_it(study: ModuleType, stretches: list) -> None:
    in_first_cycle, changes = 0, 0
    for number, stretch in enumerate(stretches):
        ends = [*(change.start for change in stretch.changes[1:]), len(stretch.rows)]
        for change, next_change in zip(stretch.changes, ends, strict=True):
            faulty = study.with_fault(stretch, (change.start + change.end) // 2)
            alerts = [tick for tick in study.seen(stretches, number, faulty).gated_alerts if tick >= change.start]
            assert alerts
            assert alerts[0] >= study.first_clean(stretch, change)
            in_first_cycle += alerts[0] < next_change
            changes += 1
    assert in_first_cycle >= changes - 1, "before the next tool change"
