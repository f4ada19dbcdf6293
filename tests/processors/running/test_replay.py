"""The law of time: a replay sees the samples that the day itself saw; and a real recording goes through whole."""

from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processors.actions import Action, DeadLetter
from processors.discovery import AnyProcessor, discover
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from tests.processors.recorder import RECORDER
from tests.processors.streams import EDGE, birth, data, death, engine_of, event, fed, reading
from tests.recordings import recording

steps = st.lists(st.tuples(st.sampled_from([0.0, 0.03, 0.4, 1.0, 2.5, 7.7, 31.0, 500.0]), st.sampled_from("dddddb")), max_size=12)


@given(steps=steps, pauses=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=5))
@settings(max_examples=150, deadline=None)
def test_the_day_and_its_replay_are_the_same(steps: list[tuple[float, str]], pauses: list[float]) -> None:
    """On the day, the wall clock brings ticks in silence, whenever the loop happens to turn; a replay knows no silence.

    Left out: a death after a silence longer than gap_s_max. Deaths carry the host's clock, which in a replay is another one, so
    that only a death within gap_s_max is believed about time; the replay gives that silence's ticks and hole at the rebirth.
    """
    day, replay = engine_of(RECORDER, gap_s_max=20.0), engine_of(RECORDER, gap_s_max=20.0)
    start = birth(0.0, spindle_rpm=0.0)
    day_actions, replay_actions = list(day.feed(start, 0.0)), list(replay.feed(start, 0.0))
    now_s, alive = 0.0, True
    for number, (step_s, what) in enumerate(steps):
        for pause in sorted(pauses):
            day_actions += day.silence(now_s + pause * step_s)
        now_s += step_s
        if what == "b" and not (alive and step_s > 20.0):
            happened = death(now_s) if alive else birth(now_s, spindle_rpm=float(number))
            alive = not alive
        elif alive:
            happened = data(now_s, spindle_rpm=float(number))
        else:
            continue
        day_actions += day.feed(happened, now_s)
        replay_actions += replay.feed(happened, 0.0)
    assert day._machines["okuma"].live.state == replay._machines["okuma"].live.state
    assert day_actions == replay_actions


KEYS = {
    "S1speed": "spindle_rpm",
    "S1load": "spindle_load_pct",
    "p1CurrentTool": "tool_number",
    "p1Fact": "feed_mm_min",
    "p1block": "nc_block",
}


def okuma(path: Path) -> list[HostEvent]:
    """The recording as an edge would send it, one message a line."""
    events = [event(EventKind.BIRTH, 1.5e8, *(reading(name, None, 1.5e8, quality=Quality.BAD) for name in KEYS.values()))]
    for line in path.read_text(encoding="utf-8").splitlines():
        stamp, *rest = line.split("|")
        try:
            at_ms = round(datetime.fromisoformat(stamp[:26] + "+00:00").timestamp() * 1000)
        except ValueError:
            continue
        readings = [_reading(KEYS[key], value, at_ms) for key, value in zip(rest[::2], rest[1::2], strict=False) if key in KEYS]
        if readings:
            events.append(HostEvent(EventKind.DATA, EDGE, "okuma", at_ms, tuple(readings)))
    return events


def _reading(name: str, text: str, at_ms: int) -> Reading:
    try:
        value: Any = float(text)
    except ValueError:
        value = text if name == "nc_block" else None
    return Reading(name, value, at_ms, Quality.BAD if value is None else Quality.GOOD, None, None, False)


@pytest.mark.parametrize("processor", discover().values(), ids=discover().keys())
def test_the_okuma_recording_goes_through_whole(processor: AnyProcessor) -> None:
    """Its four sections are not in time order, and lines step back by 80 ms: three holes, nothing dropped, nothing held back."""
    events = okuma(recording("mtconnect/okuma.txt"))
    engine = engine_of(processor)
    actions: list[Action] = fed(engine, *events)
    assert len(events) > 3000
    assert [action for action in actions if isinstance(action, DeadLetter)] == []
    assert engine.counts.holes == (0 if processor.inputs is None else 3)  # who reads everything has no clock of its own
    assert (engine.ledger.emitted, engine.ledger.dropped_total, engine.ledger.buffered) == (len(events), 0, 0)
