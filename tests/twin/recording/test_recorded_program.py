"""A program beside the recording of its run: what is read off it, and where it is compared."""

import numpy as np
import pytest

from tests.twin.recording.made_programs import made_programs
from twin.recording.recorded_program import RecordedProgram, rapid_rate_mm_min, windows


@pytest.fixture(scope="module")
def made() -> list[RecordedProgram]:
    return made_programs()


def test_the_rapid_rate_is_read_off_the_long_rapids(made: list[RecordedProgram]) -> None:
    rate, spread = rapid_rate_mm_min(made)
    assert rate == pytest.approx(20000.0, rel=1e-6)
    assert spread == pytest.approx(0.0, abs=1.0)


def test_windows_are_apart(made: list[RecordedProgram]) -> None:
    begin, line = windows(made[0], 1.0)
    assert np.diff(begin).min() >= 1.0
    assert np.all(np.diff(line) > 0)
