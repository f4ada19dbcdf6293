"""The Okuma recording: tool changes stand out in the raw score, the gate keeps them from being alerts and hides no fault long."""

import numpy as np
import pytest

from benchmarks.recorded import tool_changes as study
from tests.recordings import recording


@pytest.fixture(scope="module")
def stretches() -> list:
    return study.stretches(recording("mtconnect/okuma.txt"), recording("mtconnect/okuma_devices.xml"))


def test_no_tool_change_is_an_alert_with_the_gate_and_several_are_without(stretches: list) -> None:
    seen = study.each_by_the_others(stretches)
    assert sum(len(one.changes) for one in stretches) == 11
    assert sum(one.of_changes(one.gated_alerts) for one in seen) == 0
    assert sum(one.of_changes(one.open_alerts) for one in seen) >= 3
    for one in seen:
        usual = np.median(one.raw[~one.stretch.shut])
        peaks = [one.raw[change.start : change.end + 8].max() for change in one.stretch.changes]
        assert min(peaks) > usual + 0.1, "the transients stay visible"


def test_a_fault_that_begins_in_a_gate_is_found_after_it(stretches: list) -> None:
    by_all = study.taught(stretches)
    in_first_cycle, changes = 0, 0
    for stretch in stretches:
        ends = [*(change.start for change in stretch.changes[1:]), len(stretch.rows)]
        for change, next_change in zip(stretch.changes, ends, strict=True):
            faulty = study.with_fault(stretch, (change.start + change.end) // 2)
            alerts = [tick for tick in study.seen(faulty, *by_all).gated_alerts if tick >= change.start]
            assert alerts
            assert alerts[0] >= study.first_clean(stretch, change)
            in_first_cycle += alerts[0] < next_change
            changes += 1
    assert in_first_cycle >= changes - 1, "before the next tool change"
