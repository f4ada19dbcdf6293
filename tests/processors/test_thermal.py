"""The thermal processor: the closed form comes out, and what is not known is said."""

import math
from typing import Any

import pytest

from processors.actions import Action, Publish
from processors.running.engine import Engine
from processors.thermal import BASIS, PROCESSOR, RESIDUAL, RISE, TEMPERATURE
from sparkplug.host_session import EventKind
from sparkplug.metric import Change
from sparkplug.quality import Quality
from tests.processors.streams import birth, data, death, engine_of, event, fed, reading

ALPHA, BETA, R, C = 1.8e-8, 1.2e-3, 0.18, 14_500.0
RUNNING = {"spindle_rpm": 6000.0, "spindle_load_pct": 50.0}


def rise_after(rise_k: float, heat_w: float, duration_s: float) -> float:
    """The closed form of one thermal mass."""
    return heat_w * R + (rise_k - heat_w * R) * math.exp(-duration_s / (R * C))


def heat_w(rpm: float, load_pct: float) -> float:
    """The heat of speed and load."""
    return ALPHA * load_pct * rpm * rpm + BETA * rpm


def last(engine: Engine) -> dict[str, Change]:
    """Return what a reader knows by now."""
    return engine._machines["okuma"].live.emission.latest


def shown(actions: list[Action], name: str) -> list[Any]:
    """The values of one output, in the order of their publication."""
    return [c.value for action in actions if isinstance(action, Publish) for c in action.changes if c.name == name]


def minutes(count: int, **values: Any) -> list[Any]:
    """Data once a minute."""
    return [data(60.0 * i, **values) for i in range(1, count + 1)]


def test_at_constant_speed_and_load_the_closed_form_comes_out() -> None:
    engine = engine_of(PROCESSOR, ambient_temp_c=22.0)
    fed(engine, birth(0.0, **RUNNING), *minutes(60, **RUNNING))
    expected = rise_after(0.0, heat_w(6000.0, 50.0), 3600.0)
    state = engine._machines["okuma"].live.state
    assert state.rise_k == pytest.approx(expected, rel=1e-9)
    assert last(engine)[RISE].value == pytest.approx(expected, abs=0.05)
    assert last(engine)[TEMPERATURE].value == pytest.approx(22.0 + expected, abs=0.05)


def test_inputs_are_held_until_they_change() -> None:
    engine = engine_of(PROCESSOR, ambient_temp_c=22.0)
    fed(engine, birth(0.0, **RUNNING), data(90.5, spindle_rpm=0.0), data(200.0, spindle_load_pct=0.0))
    hot = rise_after(0.0, heat_w(6000.0, 50.0), 90.5)
    assert engine._machines["okuma"].live.state.rise_k == pytest.approx(rise_after(hot, 0.0, 109.5))


def test_without_any_ambient_the_rise_is_still_published() -> None:
    engine = engine_of(PROCESSOR)
    fed(engine, birth(0.0, **RUNNING), data(30.0, spindle_rpm=6000.0))
    assert last(engine)[RISE].value > 0
    temperature = last(engine)[TEMPERATURE]
    assert (temperature.value, temperature.quality) == (None, Quality.BAD)
    assert temperature.reason == "ambient_temp_c is not offered, and no ambient temperature is configured"
    assert last(engine)[BASIS].value == (
        "started from ambient (an assumption: no measured temperature to start from); ambient unknown; heat constants assumed"
    )


def test_a_measured_temperature_is_where_it_starts_and_what_it_is_compared_with() -> None:
    engine = engine_of(PROCESSOR)
    start = birth(0.0, spindle_rpm=0.0, spindle_load_pct=0.0, ambient_temp_c=20.0, spindle_temp_c=30.0)
    fed(engine, start, data(1.0, spindle_rpm=0.0))
    assert last(engine)[TEMPERATURE].value == pytest.approx(30.0, abs=0.01)
    assert last(engine)[RESIDUAL].value == pytest.approx(0.0, abs=0.01)
    assert last(engine)[BASIS].value == "started from the measured temperature; ambient measured; heat constants assumed"
    fed(engine, data(2.0, spindle_temp_c=33.0), data(3.0, spindle_rpm=0.0))
    assert last(engine)[RESIDUAL].value == pytest.approx(3.0, abs=0.05)


def test_without_a_measured_temperature_the_residual_is_null_and_says_so() -> None:
    engine = engine_of(PROCESSOR, ambient_temp_c=20.0)
    fed(engine, birth(0.0, **RUNNING), data(1.0, spindle_rpm=6000.0))
    residual = last(engine)[RESIDUAL]
    assert (residual.value, residual.reason) == (None, "spindle_temp_c is not offered")
    assert "; ambient configured; " in last(engine)[BASIS].value


def test_the_spindle_does_not_jump_with_the_ambient() -> None:
    engine = engine_of(PROCESSOR)
    start = birth(0.0, spindle_rpm=0.0, spindle_load_pct=0.0, ambient_temp_c=20.0, spindle_temp_c=40.0)
    fed(engine, start, data(1.5, ambient_temp_c=25.0), data(2.0, spindle_rpm=0.0))
    assert last(engine)[TEMPERATURE].value == pytest.approx(40.0, abs=0.05)
    assert engine._machines["okuma"].live.state.rise_k == pytest.approx(15.0, abs=0.05)


def test_while_speed_or_load_is_unknown_the_estimate_is_null_and_bridges_the_time() -> None:
    engine = engine_of(PROCESSOR, ambient_temp_c=20.0)
    unknown = reading("spindle_load_pct", None, 60.0, quality=Quality.BAD, reason="UNAVAILABLE")
    fed(engine, birth(0.0, **RUNNING), event(EventKind.DATA, 60.0, unknown), data(70.0, spindle_rpm=6000.0))
    assert last(engine)[TEMPERATURE].value is None
    assert last(engine)[RISE].reason == "spindle_load_pct is bad: UNAVAILABLE"
    fed(engine, data(130.0, spindle_load_pct=50.0), data(131.0, spindle_load_pct=50.0))
    expected = rise_after(0.0, heat_w(6000.0, 50.0), 131.0)
    assert last(engine)[RISE].value == pytest.approx(expected, abs=0.05)


def test_after_a_long_silence_the_estimate_starts_anew_and_is_null_meanwhile() -> None:
    engine = engine_of(PROCESSOR, ambient_temp_c=20.0, gap_s_max=60.0)
    actions = fed(engine, birth(0.0, **RUNNING), *minutes(1, **RUNNING))
    actions += fed(engine, data(2000.0, spindle_rpm=6000.0), data(2001.0, spindle_rpm=6000.0))
    assert None in shown(actions, TEMPERATURE)
    assert "no message for 60 s" in {c.reason for e in actions if isinstance(e, Publish) for c in e.changes}
    assert engine._machines["okuma"].live.state.rise_k == pytest.approx(0.0, abs=0.02)


def test_a_machine_that_was_away_too_long_starts_anew() -> None:
    engine = engine_of(PROCESSOR, ambient_temp_c=20.0, gap_s_max=300.0)
    fed(engine, birth(0.0, **RUNNING), *minutes(4, **RUNNING), death(250.0), birth(900.0, **RUNNING))
    assert engine._machines["okuma"].live.state.rise_k == pytest.approx(0.0)


def test_a_short_death_is_bridged() -> None:
    engine = engine_of(PROCESSOR, ambient_temp_c=20.0)
    fed(engine, birth(0.0, **RUNNING), data(100.0, spindle_rpm=6000.0), death(110.0), birth(115.0, **RUNNING))
    expected = rise_after(0.0, heat_w(6000.0, 50.0), 115.0)
    assert engine._machines["okuma"].live.state.rise_k == pytest.approx(expected)


def test_a_clock_set_back_by_hours_starts_anew_and_by_seconds_goes_on() -> None:
    for back_s, stays in ((20.0, True), (5000.0, False)):
        engine = engine_of(PROCESSOR, ambient_temp_c=20.0)
        begin = 6000.0
        fed(engine, birth(begin, **RUNNING), data(begin + 300, spindle_rpm=6000.0))
        warm = engine._machines["okuma"].live.state.rise_k
        fed(engine, *(data(begin + 300 - back_s + i / 10, spindle_rpm=6000.0) for i in range(3)))
        rise = engine._machines["okuma"].live.state.rise_k
        assert (rise == pytest.approx(warm, rel=0.01)) is stays


def test_implausible_inputs_are_no_inputs() -> None:
    engine = engine_of(PROCESSOR, ambient_temp_c=20.0)
    fed(engine, birth(0.0, **RUNNING), data(1.0, spindle_rpm=1e300), data(2.0, spindle_load_pct=50.0))
    assert last(engine)[RISE].reason == "spindle_rpm or spindle_load_pct is beyond any spindle"


def test_it_reports_by_exception_and_does_not_flood() -> None:
    engine = engine_of(PROCESSOR, ambient_temp_c=20.0)
    actions = fed(engine, birth(0.0, **RUNNING), *(data(0.1 * i, **RUNNING) for i in range(1, 6001)))
    rise = shown(actions, RISE)[1:]  # the first one is the null of the birth
    assert len(rise) <= rise[-1] / 0.05 + 2  # 600 s, 6000 messages, one publication for each 0.05 K
    assert len(shown(actions, BASIS)) == 1


def test_each_machine_may_have_constants_of_its_own() -> None:
    engine = engine_of(PROCESSOR, ambient_temp_c=20.0, machines={"mazak": {"resistance_k_per_w": 0.36}})
    for device in ("okuma", "mazak"):
        fed(engine, birth(0.0, device=device, **RUNNING), data(500.0, device=device, spindle_rpm=6000.0))
    rises = {name: machine.live.state.rise_k for name, machine in engine._machines.items()}
    assert rises["mazak"] > rises["okuma"]
