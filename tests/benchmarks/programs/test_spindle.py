"""The ramp of a spindle, read off recorded run-ups."""

import numpy as np
import pytest

from benchmarks.programs.spindle import RunUp, run_ups, spindle_ramp
from tests.recordings import recording
from twin.errors import RunLogError
from twin.recording.observations import read_observations
from twin.recording.program_run import program_runs


def test_the_base_speed_of_a_spindle_is_read_off_its_run_ups_to_several_speeds() -> None:
    alpha, base = 4000.0, 2500.0
    seen = [RunUp(rpm, base / (2 * alpha) + rpm**2 / (2 * alpha * base)) for rpm in (4000.0, 8000.0, 12000.0, 12000.0)]
    ramp = spindle_ramp(seen)
    assert (ramp.acceleration_rpm_s, ramp.base_rpm) == pytest.approx((alpha, base))
    with pytest.raises(RunLogError, match="two speeds"):
        spindle_ramp(seen[2:])


def test_the_cover_shows_run_ups_that_the_plates_share() -> None:
    cover, plate = (
        [one for run in program_runs(read_observations(recording(f"nist/{name}").read_text())) for one in run_ups(run)]
        for name in ("cover/Cover-Hurco04-01of20.txt", "plate/Plate-Hurco04-13of20.txt")
    )
    at_nine, at_twelve = ([one.seconds for one in seen if one.rpm == rpm] for seen, rpm in ((plate, 9000.0), (cover, 12000.0)))
    assert np.median(at_nine) == pytest.approx(4.05, abs=0.15)
    assert np.median(at_twelve) == pytest.approx(7.05, abs=0.15)  # 1.74 times as long for 1.33 times the speed: power, not torque
