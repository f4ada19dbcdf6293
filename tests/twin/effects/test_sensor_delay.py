"""A reading that is late is told from what makes a table or a motor depart as well."""

import pytest

from tests.twin.gap.small_case import air_case
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Verdict
from twin.machine import AddedEffect


@pytest.mark.parametrize("signal", ["z_table_mm", "z_torque_a", "z_pos_mm"])
def test_a_reading_that_is_two_milliseconds_late_is_neither_play_nor_wind_up_nor_a_loop(signal: str) -> None:
    found = diagnose(air_case(AddedEffect(effect="sensor_delay", on=signal, parameters={"delay_s": 0.002}))).diagnosis
    (cause,) = found.causes
    assert (cause.effect, cause.on) == ("sensor_delay", signal)
    assert {rival.effect for rival in cause.indistinguishable_from} <= {"sensor_lag"}
    assert cause.parameters["delay_s"].value == pytest.approx(0.002, rel=0.02)
    assert found.verdict is Verdict.EXPLAINED


@pytest.mark.parametrize(
    "true",
    [
        AddedEffect(effect="backlash", on="z", parameters={"play_mm": 0.004}),
        AddedEffect(effect="screw_compliance", on="z", parameters={"stiffness_n_per_mm": 4e5}),
        AddedEffect(effect="command_delay", on="z", parameters={"delay_s": 0.0015}),
    ],
    ids=lambda true: true.effect,
)
def test_what_is_late_or_off_in_the_machine_itself_is_no_late_reading(true: AddedEffect) -> None:
    found = diagnose(air_case(true)).diagnosis
    named = {e.effect for cause in found.causes for e in (cause, *cause.indistinguishable_from)}
    assert true.effect in named
    assert "sensor_delay" not in named
