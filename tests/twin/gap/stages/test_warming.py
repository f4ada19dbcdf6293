"""The stretches in which a spindle warms or cools: where they begin, and from which temperature."""

import numpy as np
import pytest

from twin.gap.stages.warming import stretches_of
from twin.runlog import RunLog, run_log

SILENT_S, FALLS_K_PER_S = 12.0, -0.0125


def cooling(silent_s: float) -> RunLog:
    """A spindle that cools evenly from 30 °C, whose temperature nobody tells at first: so does a recorder that has just begun."""
    t_s = np.arange(0.0, 110.0, 1.0)
    temperature = np.where(t_s < silent_s, np.nan, 30.0 + FALLS_K_PER_S * t_s)
    others = {name: np.zeros(len(t_s)) for name in ("spindle_rpm", "spindle_load_pct")}
    return run_log({"t_s": t_s, "spindle_temp_c": temperature, "ambient_temp_c": np.full(len(t_s), 21.5), **others}, "made")


@pytest.mark.parametrize("silent_s", [0.0, SILENT_S])
def test_a_stretch_starts_with_its_first_reading_of_the_temperature_and_as_warm_as_it_is_then(silent_s: float) -> None:
    (stretch,) = stretches_of(cooling(silent_s))
    assert stretch.at_s[0] == silent_s
    assert stretch.start_c == pytest.approx(30.0 + FALLS_K_PER_S * silent_s, abs=1e-9)
    assert np.isfinite(stretch.temperature_c).all()
