"""What is pinned: the stretch about a flag, once, and no more than a day may have."""

from dataclasses import replace

import pytest

from processors.contract import Output, Pin, Sample, SampleKind
from processors.historian import PINS, REASON, WINDOW, HistorianConfig, HistorianState, step
from sparkplug.metric import Reading
from sparkplug.quality import Quality

CONFIG = HistorianConfig(pin_before_s=60.0, pin_after_s=30.0, pin_s_max=600.0, pins_a_day_max=3)
ALARM = "twin/anomaly_alarm"


def told(name: str, value: object, at_s: float, quality: Quality = Quality.GOOD, *, is_history: bool = False) -> Sample:
    reading = Reading(name, value, round(at_s * 1000), quality, None, None, is_history)  # type: ignore[arg-type]
    return Sample("vmc", SampleKind.DATA, at_s, {name: reading}, (name,), is_history=is_history)


def fold(*samples: Sample, config: HistorianConfig = CONFIG) -> tuple[HistorianState, list[Pin], list[Output]]:
    state, pins, outputs = HistorianState(), [], []
    for sample in samples:
        state, news = step(config, state, sample)
        pins += [one for one in news if isinstance(one, Pin)]
        outputs += [one for one in news if isinstance(one, Output)]
    return state, pins, outputs


def test_a_flag_that_rises_pins_what_lies_about_it() -> None:
    state, pins, outputs = fold(told(ALARM, value=True, at_s=1000.0))
    assert pins == [Pin("vmc", 940_000, 1_030_000, "anomaly_alarm")]
    assert outputs == [Output(PINS, 1), Output(REASON, "anomaly_alarm")]
    assert state.risen[0].since_ms == 1_000_000


def test_a_flag_that_stays_is_pinned_until_it_falls_but_not_for_ever() -> None:
    assert fold(told(ALARM, value=True, at_s=1000.0), told(ALARM, value=False, at_s=1200.0))[1][1:] == [
        Pin("vmc", 940_000, 1_230_000, "anomaly_alarm")
    ]
    assert fold(told(ALARM, value=True, at_s=1000.0), told(ALARM, value=False, at_s=9000.0))[1][1:] == [
        Pin("vmc", 940_000, 1_600_000, "anomaly_alarm")
    ]


def test_a_flag_that_is_told_again_pins_nothing_more() -> None:
    _, pins, _ = fold(told(ALARM, value=True, at_s=1000.0), told(ALARM, value=True, at_s=1010.0))
    assert len(pins) == 1


@pytest.mark.parametrize("value, quality", [(None, Quality.BAD), (True, Quality.STALE), ("yes", Quality.GOOD)])
def test_what_is_not_known_pins_nothing(value: object, quality: Quality) -> None:
    assert fold(told(ALARM, value, 1000.0, quality))[1] == []


def test_history_wakes_nobody_and_pins_nothing() -> None:
    assert fold(told(ALARM, value=True, at_s=1000.0, is_history=True))[1] == []


def test_the_window_that_a_growing_gap_wants_diagnosed_is_pinned_once() -> None:
    window = "2026-05-04T06:00:00Z/2026-05-04T06:20:00Z"
    _, pins, _ = fold(told(WINDOW, window, 5.0), told(WINDOW, window, 6.0), told(WINDOW, "none", 7.0))
    assert [(pin.to_ms - pin.from_ms, pin.reason) for pin in pins] == [(1_200_000, "gap window to diagnose")]


def test_a_flag_that_flaps_cannot_fill_the_disk() -> None:
    flapping = [told(ALARM, value=i % 2 == 0, at_s=1000.0 + 100 * i) for i in range(20)]
    state, pins, outputs = fold(*flapping)
    assert state.pins == 3
    assert len(pins) == 6  # three that begin, and go on until the flag fell
    assert outputs[-1].quality is Quality.BAD
    next_day = replace(state, risen=())
    assert step(CONFIG, next_day, told(ALARM, value=True, at_s=200_000.0))[1]


def test_firings_that_overlap_are_one_stretch_and_cost_the_day_one() -> None:
    told_of = [told(ALARM, value=i % 2 == 0, at_s=1000.0 + 20 * i) for i in range(40)]
    state, pins, outputs = fold(*told_of)
    assert state.pins == 1
    assert outputs[-2:] == [Output(PINS, 1), Output(REASON, "anomaly_alarm")]
    assert min(pin.from_ms for pin in pins) == 940_000
    assert max(pin.to_ms for pin in pins) >= 1_780_000 + 30_000
    assert len(pins) <= 1 + 840 / 30


def test_another_reason_within_a_stretch_is_kept_too() -> None:
    other = "twin/gap_growing"
    state, pins, _ = fold(told(ALARM, value=True, at_s=1000.0), told(other, value=True, at_s=1000.0))
    assert state.pins == 1
    assert [pin.reason for pin in pins] == ["anomaly_alarm", "gap_growing"]
