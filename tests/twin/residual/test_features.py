"""Features: the same numbers in training and at the machine, and none that follows the sensor."""

import numpy as np
import pytest

from tests.twin.residual.days import recorded
from twin.residual import features
from twin.residual.errors import ResidualError
from twin.residual.features import MEASURED, SETS, Memory, feature, row_after, signals_of
from twin.residual.table import Recorded, table_of

EVERY = tuple(dict.fromkeys(one for own in SETS.values() for one in own))


def test_training_has_the_very_rows_that_the_processor_has() -> None:
    whole = recorded(20.0)
    known = {name: values.copy() for name, values in whole.signals.items()}
    known["spindle_rpm"][500:515] = np.nan  # 450 s: the means go on after it
    known["feed_mm_min"][900:930] = np.nan  # 900 s: they begin again
    told = Recorded(whole.t_s, np.where(whole.t_s > 50_010.0, 1, 0), known)
    found = table_of(told, EVERY, 30.0)
    memory, rows, stretch = Memory(), [], 0
    for place, at_s in enumerate(told.t_s.tolist()):
        now = {name: float(known[name][place]) for name in signals_of(EVERY)}
        if told.stretch[place] != stretch or (memory.at_s is not None and at_s - memory.at_s >= 600.0):
            memory, stretch = Memory(), int(told.stretch[place])
        if all(value == value for value in now.values()):
            memory, row = row_after(EVERY, memory, now, at_s)
            rows.append(row)
    assert len(found.x) == len(rows) == len(told.t_s) - 45
    assert np.array_equal(found.x, np.array(rows))


@pytest.mark.parametrize("name", ["", "speed", "spindle_rpm~", "spindle_rpm~-1", "spindle_rpm~nan", "spindle_rpm~1e9", MEASURED])
def test_what_is_no_feature_is_refused(name: str) -> None:
    with pytest.raises(ResidualError, match="is no feature of the residual"):
        feature(name)


def test_no_set_holds_what_was_measured_of_the_temperature() -> None:
    assert all(MEASURED not in signals_of(own) for own in SETS.values())


@pytest.mark.parametrize("one", EVERY, ids=str)
def test_a_name_is_read_as_it_is_written(one: features.Feature) -> None:
    assert feature(str(one)) == one
